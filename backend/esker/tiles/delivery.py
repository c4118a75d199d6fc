"""What to send to whom, next (DESIGN 6, 7, 8): one ``TileServer`` a room, one ``ClientTiles`` a client.

Nothing is queued. A client's next frame is planned from the newest levels when its byte window has room, so a newer
version of a tile replaces an older one by construction, and a slow client sees fewer steps but the same end.

Two rules keep every client's ground consistent while levels arrive coarse to fine and solves restart:

- A level is *current* when no coarser level changed after it was put. A LEVEL frame is sent only of a current level:
  else the fine ground, which the page moves along with its parents, would jump back to an older solve.
- A FILL adds a tile only when its content is of the same put as what the client holds of that level, or older and
  unchanged since, and no ancestor changed there since the level was put. So it fits its neighbours to the bit.
"""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from esker.contract import DEFAULT_LEVEL, FrameKind, Predictor, View
from esker.grid import TileKey
from esker.tiles.codec import Ints, Wide, child_window, cost, pack, predict
from esker.tiles.frame import FrameHead, TileRecord, write_frame, write_tile
from esker.tiles.pyramid import Counts, Level, Mask, Pyramid
from esker.tiles.quadtree import ALWAYS, default_selection, select

FILL_TILES: Final = 48
"""Most tiles in one FILL frame: about 64 KiB where a tile takes 1 to 1.5 KB."""
SPARE_TILES: Final = 32
"""Most tiles out of view that a LEVEL frame brings up to date rather than drops."""
CACHE_BYTES: Final = 32 * 1024 * 1024

CacheKey = tuple[TileKey, int, int, int, int]
"""Tile, its version, its parent's; and the versions of both that it may be predicted from instead, 0 for none."""
Base = tuple[Level, Level | None]
"""States of a level and of its parent in which a client holds a tile and the parent that belongs to it."""


class EncodedTiles:
    """LRU of coded tiles by (key, version, base version), shared by all clients of a room; safe across threads."""

    def __init__(self, limit: int = CACHE_BYTES) -> None:
        self._limit = limit
        self._lock = threading.Lock()
        self._items: OrderedDict[CacheKey, bytes] = OrderedDict()
        self._bytes = 0

    def get(self, key: CacheKey) -> bytes | None:
        """The coded tile, or None."""
        with self._lock:
            found = self._items.get(key)
            if found is not None:
                self._items.move_to_end(key)
            return found

    def put(self, key: CacheKey, value: bytes) -> None:
        """Keeps a coded tile and forgets the least recently used ones above the limit."""
        with self._lock:
            if key in self._items:
                return
            self._items[key] = value
            self._bytes += len(value)
            while self._bytes > self._limit and len(self._items) > 1:
                self._bytes -= len(self._items.popitem(last=False)[1])

    @property
    def bytes(self) -> int:
        """Bytes held."""
        return self._bytes


@dataclass(frozen=True, eq=False)
class FramePlan:
    """A frame decided but not yet coded. Captures immutable levels: ``encode`` may run in any thread, any time."""

    kind: FrameKind
    level: Level
    parent: Level | None
    keys: tuple[TileKey, ...]
    drops: tuple[TileKey, ...]
    bases: tuple[Base | None, ...]
    """For each key: what the client holds of the same tile, where the server still knows it."""
    cache: EncodedTiles

    def encode(self) -> bytes:
        """The binary frame. Pure: the same plan always gives the same bytes."""
        predictions: dict[tuple[int, TileKey], Wide] = {}

        def predicted(level: Level, key: TileKey) -> Wide:
            """All four children of one tile: predicted once, used by each of them."""
            place = (id(level), key)
            if place not in predictions:
                predictions[place] = predict(_window(level, key))
            return predictions[place]

        coded = []
        for key, base in zip(self.keys, self.bases, strict=True):
            name = self._cache_key(key, base)
            tile = self.cache.get(name)
            if tile is None:
                tile = self._write(key, base, predicted)
                self.cache.put(name, tile)
            coded.append(tile)
        head = FrameHead(self.kind, self.level.level, self.level.clock, self.level.settled)
        return write_frame(head, [(d.x, d.y) for d in self.drops], coded)

    def _write(self, key: TileKey, base: Base | None, predicted: Callable[[Level, TileKey], Wide]) -> bytes:
        """Codes a tile with the cheaper of its predictors."""
        samples = _window(self.level, key)
        _, version, parent_version, held_version, _ = self._cache_key(key, base)
        kind, base_version = Predictor.ZERO, 0
        residual: Wide = samples.astype(np.int64)
        moved: Wide | None = None
        if self.parent is not None:
            own = child_window(predicted(self.parent, key.parent()), key.x, key.y)
            kind, base_version, residual = Predictor.PARENT, parent_version, samples - own.astype(np.int64)
            if base is not None and base[1] is not None:
                then = child_window(predicted(base[1], key.parent()), key.x, key.y)
                moved = own.astype(np.int64) - then
        if base is not None:
            change: Wide = samples - _window(base[0], key).astype(np.int64)
            change = change if moved is None else change - moved
            if np.abs(change).max() < 1 << 31 and cost(change) < cost(residual):
                kind, base_version, residual = Predictor.PREVIOUS, held_version, change
        planes, payload = pack(residual)
        return write_tile(TileRecord(key.x, key.y, kind, planes, version, base_version, payload))

    def _cache_key(self, key: TileKey, base: Base | None) -> CacheKey:
        at, above = (key.y, key.x), (key.y >> 1, key.x >> 1)
        parent = 0 if self.parent is None else int(self.parent.versions[above])
        held = 0 if base is None else int(base[0].versions[at])
        held_parent = 0 if base is None or base[1] is None else int(base[1].versions[above])
        return key, int(self.level.versions[at]), parent, held, held_parent


def _window(level: Level, key: TileKey) -> Ints:
    """The 65x65 samples of a tile."""
    r, c = 64 * key.y, 64 * key.x
    return level.samples[r : r + 65, c : c + 65]


class TileServer:
    """The newest ground of one room, as tiles. Mutable; owned by the room, used from one thread."""

    def __init__(self, size_m: float, levels: int) -> None:
        self.pyramid = Pyramid(size_m, levels)
        self.cache = EncodedTiles()

    @property
    def levels(self) -> int:
        """The finest level that can be put."""
        return self.pyramid.levels

    def put_level(self, clock: int, level: int, heights: NDArray[np.float32], settled: bool) -> int:
        """Takes a level of a solve: (N_l, N_l) float32 metres, row 0 south. Returns the number of changed tiles.

        A tile changes when a sample moved by at least one quantum; a settled level is exact. Raises ValueError for a
        wrong level, shape, NaN or infinity, and changes nothing then.
        """
        return self.pyramid.put(clock, level, heights, settled)

    def settled(self) -> bool:
        """True when every level is final for one and the same clock."""
        levels = [self.pyramid.level(level) for level in range(self.levels + 1)]
        return all(level is not None and level.settled for level in levels) and len({v.clock for v in levels if v}) == 1


class ClientTiles:
    """What one client holds and wants. Mutable; used from the room's thread; one plan is outstanding at a time.

    ``rest_level``: once the ground is settled and the view is served, the client gets every other tile up to this
    level too, so that a turning camera finds full detail and all pages answer ``heightAt`` alike everywhere; -1 never.
    """

    def __init__(self, tiles: TileServer, rest_level: int = DEFAULT_LEVEL) -> None:
        self._server = tiles
        self._rest_level = min(rest_level, tiles.levels)
        n = tiles.levels + 1
        self._held: list[Counts] = [np.zeros((1 << level, 1 << level), dtype=np.uint32) for level in range(n)]
        """Version that the client holds, 0 for none."""
        self._bases: list[Counts] = [np.zeros_like(held) for held in self._held]
        """Version of the parent when the client's tile was last sent or confirmed: its decoder remembers that one."""
        self._stamps = [0] * n
        """The put of each level of which the client has, or needs, nothing more."""
        self._moved = [False] * n
        """The client shows a preview of this level: an ancestor was sent since its last LEVEL frame."""
        self._settled = [False] * n
        self._view: View | None = None
        self._wanted = default_selection(tiles.levels)
        self._errors: list[NDArray[np.float32]] | None = None
        self._selected_generation = -1
        self._view_changed = False
        self._idle_stamp = -1

    def set_view(self, view: View) -> None:
        """The client's camera. Selection follows at the next ``plan``."""
        if view != self._view:
            self._view = view
            self._view_changed = True

    def held(self) -> dict[TileKey, int]:
        """Versions that the client holds once it has applied every committed frame."""
        return {
            TileKey(level, int(x), int(y)): int(versions[y, x])
            for level, versions in enumerate(self._held)
            for y, x in np.argwhere(versions > 0)
        }

    def wanted(self) -> list[Mask]:
        """The present selection, one (2^l, 2^l) mask per level."""
        self._select()
        return self._wanted

    def plan(self) -> FramePlan | None:
        """The most useful next frame, or None when there is nothing to send now. Cheap; changes nothing held.

        Levels coarse to fine: a LEVEL frame where a newer put waits; then FILL frames for tiles that came into view,
        coarse to fine and by projected error; then, when the ground is settled, for all others.
        """
        pyramid = self._server.pyramid
        if self._idle_stamp == pyramid.stamp and not self._view_changed:
            return None
        self._select()
        for level in range(self._server.levels + 1):
            plan = self._plan_level(level)
            if plan is not None:
                return plan
        for level in range(self._server.levels + 1):
            plan = self._plan_fill(level, self._wanted[level])
            if plan is not None:
                return plan
        if self._server.settled():
            for level in range(self._rest_level + 1):
                plan = self._plan_fill(level, np.True_)
                if plan is not None:
                    return plan
        self._idle_stamp = pyramid.stamp
        return None

    def commit(self, plan: FramePlan) -> None:
        """The frame was handed to the socket: from now on the client counts as holding it."""
        level = plan.level.level
        held = self._held[level]
        for key in plan.drops:
            for below in range(level, self._server.levels + 1):
                r, c, n = key.y << (below - level), key.x << (below - level), 1 << (below - level)
                self._held[below][r : r + n, c : c + n] = 0
        if plan.keys:
            rows = np.fromiter((k.y for k in plan.keys), dtype=np.intp, count=len(plan.keys))
            cols = np.fromiter((k.x for k in plan.keys), dtype=np.intp, count=len(plan.keys))
            held[rows, cols] = plan.level.versions[rows, cols]
            if level:
                self._bases[level][rows, cols] = self._held[level - 1][rows >> 1, cols >> 1]
        if plan.kind == FrameKind.LEVEL:
            self._stamps[level] = plan.level.stamp
            self._moved[level] = False
            self._settled[level] = plan.level.settled
            if level:
                self._bases[level] = self._held[level - 1].repeat(2, axis=0).repeat(2, axis=1)
            if plan.keys:
                for below in range(level + 1, self._server.levels + 1):
                    self._moved[below] = True
        self._idle_stamp = -1

    def _select(self) -> None:
        """Selects again when the view moved or the ground changed since the last selection."""
        pyramid = self._server.pyramid
        if self._view is None or not (self._view_changed or self._selected_generation != pyramid.generation):
            return
        self._wanted, self._errors = select(pyramid.bounds(), self._view)
        self._selected_generation = pyramid.generation
        self._view_changed = False
        self._idle_stamp = -1

    def _parents_held(self, level: int) -> Mask | bool:
        """Where the parent's newest version is held, so that a child may be predicted from it."""
        if level == 0:
            return True
        parent = self._server.pyramid.level(level - 1)
        if parent is None:
            return False
        ok = self._held[level - 1] == parent.versions
        return np.asarray(ok.repeat(2, axis=0).repeat(2, axis=1), dtype=np.bool_)

    def _plan_level(self, index: int) -> FramePlan | None:
        pyramid = self._server.pyramid
        level = pyramid.level(index)
        if level is None or level.stamp == self._stamps[index]:
            return None
        held = self._held[index]
        if index > ALWAYS and not held.any():
            # Nothing to keep in step: FILL frames bring the level by and by, the most visible tiles first.
            self._stamps[index], self._moved[index], self._settled[index] = level.stamp, False, level.settled
            return None
        coarser = [pyramid.level(i) for i in range(index)]
        if any(c is not None and c.changed > level.stamp for c in coarser):
            return None
        stale = held != level.versions
        possible = stale & self._parents_held(index)
        send = possible & self._wanted[index]
        spare = possible & (held > 0) & ~send
        if index <= self._rest_level and np.count_nonzero(spare) <= SPARE_TILES:
            send |= spare  # a change costs little; dropped, the whole tile would be sent again at rest
        drop = stale & (held > 0) & ~send
        preview = self._moved[index] or level.settled != self._settled[index]
        if not send.any() and not drop.any() and not preview:
            # Nothing that the client shows differs from this put.
            self._stamps[index], self._moved[index], self._settled[index] = level.stamp, False, level.settled
            return None
        return self._frame(FrameKind.LEVEL, level, _keys(index, send), _keys(index, drop))

    def _plan_fill(self, index: int, wanted: Mask | np.bool_) -> FramePlan | None:
        level = self._server.pyramid.level(index)
        if level is None:
            return None
        held = self._held[index]
        send = wanted & (held == 0)
        if not send.any():
            return None
        send &= self._parents_held(index)
        send &= level.versions <= self._stamps[index]
        send &= self._server.pyramid.lineage()[index] <= level.stamp
        keys = _keys(index, send)
        if self._errors is not None:
            error = self._errors[index]
            keys.sort(key=lambda k: -float(error[k.y, k.x]))
        return self._frame(FrameKind.FILL, level, keys[:FILL_TILES], []) if keys else None

    def _frame(self, kind: FrameKind, level: Level, keys: list[TileKey], drops: list[TileKey]) -> FramePlan:
        parent = self._server.pyramid.level(level.level - 1) if level.level else None
        return FramePlan(
            kind, level, parent, tuple(keys), tuple(drops), self._known(level.level, keys), self._server.cache
        )

    def _known(self, level: int, keys: list[TileKey]) -> tuple[Base | None, ...]:
        """For each tile the states in which the client holds it and its parent, as far as the server remembers them."""
        held = self._held[level]
        if not any(held[k.y, k.x] for k in keys):
            return (None,) * len(keys)
        own = self._server.pyramid.states(level)
        bases = self._bases[level]
        above = self._server.pyramid.states(level - 1) if level else []
        found: list[Base | None] = []
        for k in keys:
            at, up = (k.y, k.x), (k.y >> 1, k.x >> 1)
            tile = next((state for state in own if state.versions[at] == held[at]), None)
            parent = next((state for state in above if state.versions[up] == bases[at]), None)
            found.append(None if tile is None or (level and parent is None) else (tile, parent))
        return tuple(found)


def _keys(level: int, mask: Mask) -> list[TileKey]:
    return [TileKey(level, int(x), int(y)) for y, x in np.argwhere(mask)]
