"""What one client holds of the tiles above the levels that are solved as a whole, and what to send of them next.

To the client these levels are like any other: while an ancestor has moved, a tile rides along with it, and a LEVEL
frame of its own level puts it right. Such a frame waits until the ground has settled and every tile in view whose
parent has come to rest elsewhere has been made anew; such tiles out of view are dropped. No frame ever leaves two
neighbours that differ on the edge that they share: a tile whose neighbour is still of an older solve waits for it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Set
from dataclasses import dataclass
from typing import Final

import numpy as np

from esker.contract import Channel, FrameKind
from esker.grid import TileKey
from esker.tiles.codec.payload import Ints
from esker.tiles.ledger import FILL_TILES, Ledger
from esker.tiles.plans import EncodedTiles, FramePlan, TilePlan, TileState
from esker.tiles.refined import RefinedTiles
from esker.tiles.sparse import Selection

SPARE_ROOM: Final = 32
"""Tiles dropped beyond what is needed when a client holds its fill, so that it is not done for each new tile."""
AROUND: Final = tuple((dx, dy) for dy in (-1, 0, 1) for dx in (-1, 0, 1) if dx or dy)


@dataclass(frozen=True, eq=False)
class _Held:
    """A tile as the client holds it, and its parent as it was when the tile was last sent or confirmed."""

    state: TileState
    base: TileState


class _Blocked(Exception):
    """A LEVEL frame is due but waits for tiles that are still being made."""


class RefinedLedger:
    """The refined tiles that one client holds of a channel.

    Mutable; used from the room's tile thread. ``below``: the ledger of the channel up to the finest whole level.
    """

    def __init__(
        self, refined: RefinedTiles, below: Ledger, cache: EncodedTiles, channel: Channel = Channel.HEIGHT
    ) -> None:
        self._refined, self._below, self._cache, self._channel = refined, below, cache, channel
        self._held: dict[int, dict[TileKey, _Held]] = {
            level: {} for level in range(refined.levels + 1, refined.finest + 1)
        }
        """Tiles held of each level, oldest first."""
        self._moved: set[int] = set()
        """Levels that may show a preview: an ancestor was sent since their last LEVEL frame."""

    def held(self) -> dict[TileKey, int]:
        """Returns the versions that the client holds."""
        return {key: tile.state.version for tiles in self._held.values() for key, tile in tiles.items()}

    def keys(self) -> set[TileKey]:
        """Returns the tiles that the client holds."""
        return {key for tiles in self._held.values() for key in tiles}

    # --- planning -----------------------------------------------------------------------------------------------

    def plan_levels(self, selection: Selection) -> tuple[FramePlan | None, int]:
        """A LEVEL frame that is due on settled ground, when the levels below have nothing to send; and the finest level
        up to which none is, nor waits: so far tiles may be filled in."""
        finest = self._refined.levels
        for level in self._held:
            try:
                plan = self._plan_level(level, selection)
            except _Blocked:
                break
            if plan is not None:
                return plan, finest
            finest = level
        return None, finest

    def plan_fill(self, level: int, selection: Selection, among: Set[TileKey] | None = None) -> FramePlan | None:
        """Plans a FILL frame of wanted tiles of a level, by their projected errors; only of those ``among``, if
        given."""
        held = self._held[level]
        ready = [
            key
            for key in selection.tiles
            if key.level == level
            and key not in held
            and (among is None or key in among)
            and self._refined.verified(key) is not None
            and self._parent(key) is not None
        ]
        return self._fill(level, ready, selection) if ready else None

    def _plan_level(self, level: int, selection: Selection) -> FramePlan | None:
        """Plans a LEVEL frame of a level.

        Raises _Blocked when a tile that is to be replaced, or that fits such a tile, has not been made yet.
        """
        held = self._held[level]
        if not held:
            self._moved.discard(level)
            return None
        send: set[TileKey] = set()
        drop: set[TileKey] = set()
        for key, tile in held.items():
            newest = self._refined.verified(key)
            if newest is None:
                if self._held_parent(key).version != tile.base.version:
                    if key in selection.tiles:
                        raise _Blocked
                    drop.add(key)
            elif newest.state.version != tile.state.version:
                (send if key in selection.tiles else drop).add(key)
        if not (level in self._moved or send or drop):
            return None
        drop |= self._misfits(level, send, drop, selection)
        return self._frame(FrameKind.LEVEL, level, sorted(send), sorted(drop))

    def _misfits(self, level: int, send: set[TileKey], drop: set[TileKey], selection: Selection) -> set[TileKey]:
        """Returns held neighbours of older solves that contradict tiles to send and at which nobody looks.

        Raises _Blocked.
        """
        gone: set[TileKey] = set()
        for key in send:
            for other in self._contradicted(level, key, send | drop):
                if other in selection.tiles:
                    raise _Blocked
                gone.add(other)
        return gone

    def _contradicted(self, level: int, key: TileKey, besides: set[TileKey]) -> Iterator[TileKey]:
        """Returns held neighbours, not of the present solve, whose samples on the common edge are not those of
        ``key``."""
        held, now = self._held[level], self._refined.verified(key)
        assert now is not None
        for dx, dy in AROUND:
            other = TileKey(level, key.x + dx, key.y + dy)
            theirs = held.get(other)
            if theirs is None or other in besides or self._refined.verified(other) is not None:
                continue
            if not np.array_equal(_edge(now.state.samples, dx, dy), _edge(theirs.state.samples, -dx, -dy)):
                yield other

    def _fill(self, level: int, ready: list[TileKey], selection: Selection) -> FramePlan | None:
        over = len(ready) + sum(map(len, self._held.values())) - self._refined.client_tiles
        if over > 0:
            plan = self._plan_trim(over + SPARE_ROOM, selection)
            if plan is not None:
                return plan
        ready.sort(key=lambda k: -selection.tiles[k])
        send: list[TileKey] = []
        drop: set[TileKey] = set()
        for key in ready:
            wrong = set(self._contradicted(level, key, drop))
            if not wrong & selection.tiles.keys():
                send.append(key)
                drop |= wrong
            if len(send) == FILL_TILES:
                break
        return self._frame(FrameKind.FILL, level, send, sorted(drop)) if send else None

    def _plan_trim(self, count: int, selection: Selection) -> FramePlan | None:
        """Drops tiles out of view, finest level and longest held first."""
        for level in reversed(self._held):
            gone = [key for key in self._held[level] if key not in selection.tiles][:count]
            if gone:
                return self._frame(FrameKind.FILL, level, (), gone)
        return None

    def _parent(self, key: TileKey) -> TileState | None:
        """Returns the parent as the client holds it, or None.

        It is the newest: the levels below were brought up to date.
        """
        up = key.parent()
        if up.level == self._refined.levels:
            return self._below.newest(up)
        held = self._held[up.level].get(up)
        return None if held is None else held.state

    def _held_parent(self, key: TileKey) -> TileState:
        """Returns the parent of a held tile."""
        found = self._parent(key)
        assert found is not None, "whoever holds a tile holds its parent"
        return found

    def _frame(self, kind: FrameKind, level: int, keys: Iterable[TileKey], drops: Iterable[TileKey]) -> FramePlan:
        tiles = []
        for key in keys:
            now, parent, held = self._refined.verified(key), self._parent(key), self._held[level].get(key)
            assert now is not None
            assert parent is not None
            before, base = (None, None) if held is None else (held.state, held.base)
            tiles.append(TilePlan(key, now.state, parent, before, base))
        clock = self._refined.clock
        return FramePlan(
            kind, self._channel, level, clock, True, tuple(tiles), tuple(drops), self, self._cache, smooth=True
        )

    # --- what was sent ------------------------------------------------------------------------------------------

    def commit(self, plan: FramePlan) -> None:
        """Says that a frame of the channel was handed to the socket, of these levels or of one below (then committed
        there)."""
        for key in plan.drops:
            self._forget(key)
        if plan.level > self._refined.levels:
            held = self._held[plan.level]
            for tile in plan.tiles:
                assert tile.parent is not None
                held[tile.key] = _Held(tile.now, self._refined.kept(tile.key.parent(), tile.parent))
            if plan.kind == FrameKind.LEVEL:
                self._confirm(plan.level)
        if plan.kind == FrameKind.LEVEL and plan.tiles:
            self._moved |= {level for level, tiles in self._held.items() if level > plan.level and tiles}

    def _confirm(self, level: int) -> None:
        """Says that all tiles of the level are exact: their decoder takes their parents as they are now."""
        self._moved.discard(level)
        held = self._held[level]
        for key, tile in held.items():
            parent = self._held_parent(key)
            if parent.version != tile.base.version:
                held[key] = _Held(tile.state, self._refined.kept(key.parent(), parent))

    def _forget(self, gone: TileKey) -> None:
        """Forgets a tile that was dropped, and with it all its descendants."""
        for below, tiles in self._held.items():
            shift = below - gone.level
            if shift < 0:
                continue
            for key in [k for k in tiles if (k.x >> shift, k.y >> shift) == (gone.x, gone.y)]:
                del tiles[key]


def _edge(samples: Ints, dx: int, dy: int) -> Ints:
    """Returns the samples that a tile shares with its neighbour in this direction."""
    rows = {-1: slice(0, 1), 0: slice(None), 1: slice(64, 65)}[dy]
    cols = {-1: slice(0, 1), 0: slice(None), 1: slice(64, 65)}[dx]
    return samples[rows, cols]
