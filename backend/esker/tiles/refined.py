"""Tiles above the levels that are solved as a whole, kept where somebody looks (DESIGN 5.6, 6).

A tile is *verified* in an epoch: an epoch begins whenever the ground has settled, and ends with the next level of any
solve. Made anew with the same samples, a tile keeps its version, so a change elsewhere sends nothing.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Set
from dataclasses import dataclass
from typing import Final
from weakref import WeakValueDictionary

import numpy as np
from numpy.typing import NDArray

from esker import grid
from esker.contract import MAX_REFINED_LEVEL, MAX_REFINED_TILES, PATCH_CELLS, SUBPATCHES, TILE_SAMPLES
from esker.grid import TileKey
from esker.tiles import loops
from esker.tiles.bounds import Floats
from esker.tiles.codec.payload import SAMPLE_LIMIT, Ints
from esker.tiles.ledger import state_of
from esker.tiles.plans import TileState
from esker.tiles.pyramid import Pyramid
from esker.tiles.surface import total

ROOM_TILES: Final = 2048
"""Refined tiles that a room keeps: 35 MB of samples."""


@dataclass(frozen=True, eq=False)
class Refined:
    """A refined tile. ``low``, ``high``, ``error``: (4, 4) float32 per sub-patch of the ground as it is drawn, metres;
    error: against its parent.

    ``epoch``: the last one in which it was verified. ``ground``: stamp of the levels below at that time.
    ``content``: the refiner's digest of all that it depends on.
    """

    key: TileKey
    state: TileState
    content: bytes
    epoch: int
    ground: int
    low: Floats
    high: Floats
    error: Floats


@dataclass(frozen=True, eq=False)
class Known:
    """The tiles of one level as arrays: ``codes`` sorted (see ``code``), (n, 4, 4) bounds, ``Refined.ground``,
    and the bounds of the whole tiles."""

    codes: NDArray[np.int64]
    low: Floats
    high: Floats
    error: Floats
    ground: NDArray[np.int64]
    lowest: Floats
    highest: Floats
    worst: Floats


def code(x: NDArray[np.int64], y: NDArray[np.int64], level: int) -> NDArray[np.int64]:
    """Returns tiles (n,) of a level as integers that sort by rows."""
    return (y << level) | x


@dataclass(frozen=True, eq=False)
class Under:
    """What a refined tile lies on. ``ground``: the stamp of the ground below, for ``Refined.ground``.

    ``base``, ``above``: (65, 65) quanta that are added to the tile and to its parent, for the bounds; None for none.
    """

    ground: int
    base: Ints | None = None
    above: Ints | None = None


class RefinedTiles:
    """Refined tiles of one room.

    Mutable; owned by ``delivery.TileServer``, used from its thread. ``levels``: the finest level solved as a whole;
    ``finest``: the finest that is refined. ``client_tiles``: most that one client holds.
    """

    def __init__(self, size_m: float, levels: int, finest: int, room_tiles: int | None = None) -> None:
        if not levels <= finest <= MAX_REFINED_LEVEL:
            raise ValueError(f"tiles are refined to level {levels}..{MAX_REFINED_LEVEL}, not {finest}")
        self.size_m, self.levels, self.finest = size_m, levels, finest
        self.room_tiles = ROOM_TILES if room_tiles is None else room_tiles
        self.client_tiles = min(MAX_REFINED_TILES, self.room_tiles)
        self.stamp = 0
        """A counter that rises with every change; versions are its values."""
        self.generation = 0
        """A counter that rises when a selection might come out differently."""
        self.epoch = 0
        self.active = False
        self.clock = -1
        """Clock of the settled ground of the present epoch."""
        self._tiles: OrderedDict[TileKey, Refined] = OrderedDict()
        self._known: dict[int, Known] = {}
        self._bases: WeakValueDictionary[tuple[TileKey, int], TileState] = WeakValueDictionary()

    def __len__(self) -> int:
        return len(self._tiles)

    def get(self, key: TileKey) -> Refined | None:
        """Returns the tile as it was last made."""
        return self._tiles.get(key)

    def verified(self, key: TileKey) -> Refined | None:
        """Returns the tile, if it belongs to the settled ground as it is."""
        found = self._tiles.get(key)
        return found if found is not None and self.active and found.epoch == self.epoch else None

    def kept(self, key: TileKey, state: TileState) -> TileState:
        """Returns the tile with samples of its own, one copy for all clients. Those of a whole level may be a view of
        it, or made for whoever asked."""
        if key.level > self.levels:
            return state
        found = self._bases.get((key, state.version))
        if found is None:
            own = state.samples if state.samples.base is None else state.samples.copy()
            found = self._bases[key, state.version] = TileState(state.version, own)
        return found

    def suspend(self) -> None:
        """Says that the ground moves: nothing is verified until it has settled again."""
        if self.active:
            self.active = False
            self.stamp += 1

    def begin(self, clock: int) -> None:
        """Says that the ground has settled at ``clock``."""
        self.active, self.clock = True, clock
        self.epoch += 1
        self._changed()

    def takes(self, clock: int, key: TileKey, heights: NDArray[np.float32], pyramid: Pyramid) -> bool:
        """Returns whether ``put`` would take this tile. Raises as ``put`` does."""
        side = 1 << max(0, key.level)
        if not (self.levels < key.level <= self.finest and 0 <= key.x < side and 0 <= key.y < side):
            raise ValueError(f"tile {tuple(key)} is not refined here")
        if heights.shape != (TILE_SAMPLES, TILE_SAMPLES) or not np.isfinite(heights).all():
            raise ValueError(f"tile {tuple(key)} is not 65x65 finite heights")
        return self.active and clock == self.clock and self.parent(key, pyramid) is not None

    def put(
        self,
        clock: int,
        key: TileKey,
        heights: NDArray[np.float32],
        content: bytes,
        pyramid: Pyramid,
        under: Under | None = None,
    ) -> bool:
        """Takes a tile of the settled solve at ``clock``.

        Returns False when that ground is no longer the newest, or the parent is not known. Raises ValueError for a key
        that is not refined here, a wrong shape, NaN or infinity.
        """
        if not self.takes(clock, key, heights, pyramid):
            return False
        above = self.parent(key, pyramid)
        assert above is not None
        samples = _quantise(heights, key.level, self.size_m)
        old = self._tiles.get(key)
        if old is not None and np.array_equal(old.state.samples, samples):
            state = old.state
        else:
            state = TileState(self.stamp + 1, samples)
        under = under or Under(pyramid.stamp)
        self._tiles[key] = self._measured(key, state, above, content, under)
        self._tiles.move_to_end(key)
        self._changed(key.level)
        return True

    def parent(self, key: TileKey, pyramid: Pyramid) -> Ints | None:
        """Returns the parent's samples as they are now."""
        if key.level - 1 > self.levels:
            found = self.verified(key.parent())
            return None if found is None else found.state.samples
        level = pyramid.level(self.levels)
        return None if level is None else state_of(level, key.parent()).samples

    def _measured(self, key: TileKey, state: TileState, above: Ints, content: bytes, under: Under) -> Refined:
        q = np.float32(grid.quantum(key.level, self.size_m))
        r, c = 32 * (key.y & 1), 32 * (key.x & 1)
        samples, parent = state.samples, above[r : r + 33, c : c + 33]
        if under.base is not None and under.above is not None:
            samples, parent = total(samples, under.base), total(parent, under.above[r : r + 33, c : c + 33])
        low, high = np.empty((2, SUBPATCHES, SUBPATCHES), dtype=np.int32)
        error = np.empty((SUBPATCHES, SUBPATCHES), dtype=np.uint32)
        loops.bounded(samples, PATCH_CELLS, low, high)
        loops.erred(samples, parent, PATCH_CELLS, error)
        bounds = (a * q for a in (low.astype(np.float32), high.astype(np.float32), error.astype(np.float32)))
        return Refined(key, state, content, self.epoch, under.ground, *bounds)

    def known(self, level: int) -> Known:
        """Returns all tiles of a level, as arrays."""
        found = self._known.get(level)
        if found is None:
            tiles = sorted((t for k, t in self._tiles.items() if k.level == level), key=lambda t: (t.key.y, t.key.x))
            n = len(tiles)

            def bounds(name: str) -> Floats:
                rows = [getattr(t, name) for t in tiles]
                return np.stack(rows) if rows else np.zeros((0, 4, 4), dtype=np.float32)

            codes = np.fromiter(((t.key.y << level) | t.key.x for t in tiles), dtype=np.int64, count=n)
            ground = np.fromiter((t.ground for t in tiles), dtype=np.int64, count=n)
            low, high, error = bounds("low"), bounds("high"), bounds("error")
            whole = low.min(axis=(1, 2)), high.max(axis=(1, 2)), error.max(axis=(1, 2))
            found = Known(codes, low, high, error, ground, *whole)
            self._known[level] = found
        return found

    def make_room(self, wanted: Set[TileKey], held: Set[TileKey]) -> int:
        """Forgets tiles, those made longest ago first, so that all of ``wanted`` fit; returns how many more may come.

        Tiles that somebody holds are forgotten last: they are sent again when they are looked at again.
        """
        over = len(self._tiles) + sum(key not in self._tiles for key in wanted) - self.room_tiles
        for spared in (wanted | held, wanted):
            for key in [key for key in self._tiles if key not in spared][: max(0, over)]:
                del self._tiles[key]
                self._known.pop(key.level, None)
                over -= 1
        return max(0, self.room_tiles - len(self._tiles))

    def keep(self, others: RefinedTiles) -> None:
        """Forgets the tiles that are not in ``others``."""
        for key in [key for key in self._tiles if key not in others._tiles]:
            del self._tiles[key]
            self._known.pop(key.level, None)

    def _changed(self, level: int | None = None) -> None:
        self.stamp += 1
        self.generation += 1
        if level is None:
            self._known.clear()
        else:
            self._known.pop(level, None)


def _quantise(heights: NDArray[np.float32], level: int, size_m: float) -> Ints:
    """Rounds metres to quanta of the level, halves to even, saturating as the levels below do."""
    steps = heights * np.float32(1.0 / grid.quantum(level, size_m))
    samples: Ints = np.rint(np.clip(steps, -SAMPLE_LIMIT, SAMPLE_LIMIT)).astype(np.int32)
    samples.flags.writeable = False
    return samples
