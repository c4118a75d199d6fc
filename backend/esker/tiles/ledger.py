"""What one client holds of the levels of one channel that are solved as a whole, and what to send of them next.

Two rules keep every client's ground consistent while levels arrive coarse to fine and solves restart:

- A level is *current* when no coarser level changed after it was put. A LEVEL frame is sent only of a current level:
  else the fine ground, which the page moves along with its parents, would jump back to an older solve.
- A FILL adds a tile only when its content is of the same put as what the client holds of that level, or older and
  unchanged since, and no ancestor changed there since the level was put. So it fits its neighbours to the bit.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from esker.contract import Channel, FrameKind
from esker.grid import TileKey
from esker.tiles.plans import EncodedTiles, FramePlan, TilePlan, TileState
from esker.tiles.pyramid import Counts, Level, Mask, Pyramid

FILL_TILES: Final = 48
"""Most tiles in one FILL frame: about 64 KiB where a tile takes 1 to 1.5 KB."""
SPARE_TILES: Final = 32
"""Most tiles out of view that a LEVEL frame brings up to date rather than drops."""


def state_of(level: Level, key: TileKey) -> TileState:
    """Returns a tile of a level, its samples as a view where they are stored as they are."""
    r, c = 64 * key.y, 64 * key.x
    return TileState(int(level.versions[key.y, key.x]), level.window(slice(r, r + 65), slice(c, c + 65)))


class Ledger:
    """Mutable; used from the room's tile thread; one plan is outstanding at a time.

    ``always``: levels up to this one come as LEVEL frames even to a client that holds nothing of them; finer ones
    begin with FILL frames. ``rest_level``: the finest level of which tiles out of view are kept up to date.
    """

    def __init__(
        self, pyramid: Pyramid, cache: EncodedTiles, always: int, rest_level: int, channel: Channel = Channel.HEIGHT
    ) -> None:
        self._pyramid, self._cache, self._channel = pyramid, cache, channel
        self._always, self._rest_level = always, rest_level
        n = pyramid.levels + 1
        self.versions: list[Counts] = [np.zeros((1 << level, 1 << level), dtype=np.uint32) for level in range(n)]
        """Versions that the client holds, 0 for none."""
        self._bases: list[Counts] = [np.zeros_like(held) for held in self.versions]
        """Versions of the parents when the client's tiles were last sent or confirmed: its decoder remembers these."""
        self._stamps = [0] * n
        """The last put of each level that the client has, as far as it needs it."""
        self._moved = [False] * n
        """Whether the client shows a preview of this level: an ancestor was sent since its last LEVEL frame."""
        self._settled = [False] * n

    @property
    def levels(self) -> int:
        """The finest level."""
        return self._pyramid.levels

    def held(self) -> dict[TileKey, int]:
        """Returns the versions that the client holds once it has applied every committed frame."""
        return {
            TileKey(level, int(x), int(y)): int(versions[y, x])
            for level, versions in enumerate(self.versions)
            for y, x in np.argwhere(versions > 0)
        }

    def holds(self, level: int, versions: Counts, newer: Counts) -> bool:
        """Returns whether the client has a tile of ``level``, or the children of one, as it was with ``versions``
        and is not with the ``newer`` ones (``Pyramid.forget_earlier``)."""
        other = versions != newer
        if (other & (self.versions[level] == versions)).any():
            return True
        if level == self.levels:
            return False
        under = (other.repeat(2, axis=0).repeat(2, axis=1), versions.repeat(2, axis=0).repeat(2, axis=1))
        children = (self.versions[level + 1] > 0) & (self._bases[level + 1] == under[1])
        return bool((under[0] & children).any())

    def newest(self, key: TileKey) -> TileState | None:
        """Returns the tile as the client holds it, when that is the newest there is."""
        level = self._pyramid.level(key.level)
        at = (key.y, key.x)
        if level is None or not level.versions[at] or self.versions[key.level][at] != level.versions[at]:
            return None
        return state_of(level, key)

    def plan_level(self, index: int, wanted: Mask | np.bool_) -> FramePlan | None:
        """Plans a LEVEL frame of level ``index``, when a newer put waits that the client should see."""
        pyramid = self._pyramid
        level = pyramid.level(index)
        if level is None or level.stamp == self._stamps[index]:
            return None
        held = self.versions[index]
        if index > self._always and not held.any():
            # The client has nothing that must be kept in step: FILL frames bring the level by and by, the most visible
            # tiles first.
            self._stamps[index], self._moved[index], self._settled[index] = level.stamp, False, level.settled
            return None
        coarser = [pyramid.level(i) for i in range(index)]
        if any(c is not None and c.changed > level.stamp for c in coarser):
            return None
        stale = held != level.versions
        possible = stale & self._parents_held(index)
        send = possible & wanted
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

    def plan_fill(
        self, index: int, wanted: Mask | np.bool_, errors: NDArray[np.float32] | None = None
    ) -> FramePlan | None:
        """Plans a FILL frame of wanted tiles of a level that are not held, the largest of ``errors`` first."""
        level = self._pyramid.level(index)
        if level is None:
            return None
        send = wanted & (self.versions[index] == 0)
        if not send.any():
            return None
        send &= self._parents_held(index)
        send &= level.versions <= self._stamps[index]
        send &= self._pyramid.lineage()[index] <= level.stamp
        keys = _keys(index, send)
        if errors is not None:
            keys.sort(key=lambda k: -float(errors[k.y, k.x]))
        return self._frame(FrameKind.FILL, level, keys[:FILL_TILES], []) if keys else None

    def plan_limit(self) -> FramePlan | None:
        """Drops the held tiles above the finest level that is solved at present (``Pyramid.limit``)."""
        for index in range(self._pyramid.top + 1, self._pyramid.levels + 1):
            gone = _keys(index, self.versions[index] > 0)
            if gone:
                below = self._pyramid.level(self._pyramid.top)
                clock = 0 if below is None else below.clock
                return FramePlan(FrameKind.FILL, self._channel, index, clock, False, (), tuple(gone), None, self._cache)
        return None

    def commit(self, plan: FramePlan) -> None:
        """Says that the frame was handed to the socket: from now on the client counts as holding it."""
        index, keys = plan.level, plan.keys
        held = self.versions[index]
        for key in plan.drops:
            for below in range(index, self._pyramid.levels + 1):
                r, c, n = key.y << (below - index), key.x << (below - index), 1 << (below - index)
                self.versions[below][r : r + n, c : c + n] = 0
        level = plan.source
        if not isinstance(level, Level):
            return
        if keys:
            rows = np.fromiter((k.y for k in keys), dtype=np.intp, count=len(keys))
            cols = np.fromiter((k.x for k in keys), dtype=np.intp, count=len(keys))
            held[rows, cols] = level.versions[rows, cols]
            if index:
                self._bases[index][rows, cols] = self.versions[index - 1][rows >> 1, cols >> 1]
        if plan.kind == FrameKind.LEVEL:
            self._stamps[index] = level.stamp
            self._moved[index] = False
            self._settled[index] = level.settled
            if index:
                self._bases[index] = self.versions[index - 1].repeat(2, axis=0).repeat(2, axis=1)
            if keys:
                for below in range(index + 1, self._pyramid.levels + 1):
                    self._moved[below] = True

    def _parents_held(self, level: int) -> Mask | bool:
        """Returns where the parent's newest version is held, so that a child may be predicted from it."""
        if level == 0:
            return True
        parent = self._pyramid.level(level - 1)
        if parent is None:
            return False
        ok = self.versions[level - 1] == parent.versions
        return np.asarray(ok.repeat(2, axis=0).repeat(2, axis=1), dtype=np.bool_)

    def _frame(self, kind: FrameKind, level: Level, keys: Sequence[TileKey], drops: Sequence[TileKey]) -> FramePlan:
        tiles = tuple(self._tiles(level, keys))
        return FramePlan(
            kind, self._channel, level.level, level.clock, level.settled, tiles, tuple(drops), level, self._cache
        )

    def _tiles(self, level: Level, keys: Sequence[TileKey]) -> list[TilePlan]:
        """Returns each tile with the states in which the client holds it and its parent, as far as the server knows
        them."""
        index = level.level
        held, bases = self.versions[index], self._bases[index]
        parent = self._pyramid.level(index - 1) if index else None
        own = self._pyramid.states(index)
        above = self._pyramid.states(index - 1) if index else []
        plans = []
        for k in keys:
            at, up = (k.y, k.x), (k.y >> 1, k.x >> 1)
            now, over = state_of(level, k), None if parent is None else state_of(parent, k.parent())
            before = then = None
            if held[at]:
                was = next((state for state in own if state.versions[at] == held[at]), None)
                base = next((state for state in above if state.versions[up] == bases[at]), None)
                before = None if was is None else state_of(was, k)
                then = None if base is None else state_of(base, k.parent())
            plans.append(TilePlan(k, now, over, before, then))
        return plans


def _keys(level: int, mask: Mask) -> list[TileKey]:
    return [TileKey(level, int(x), int(y)) for y, x in np.argwhere(mask)]
