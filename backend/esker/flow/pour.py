"""How high water stands that is poured out at a place (twin of ``frontend/src/tiles/water/pour.ts``).

Hollows fill from their pit, run over at their lowest brim into the next, and join where both stand at it. No drop is
lost: what the pools hold and what has run off is what was poured.

>>> import numpy as np
>>> crater = np.array([[9, 9, 9, 9, 9], [9, 7, 7, 7, 9], [9, 7, 3, 7, 6], [9, 7, 7, 7, 9], [9, 9, 9, 9, 9]], np.int32)
>>> found = pour(find_water(crater), 12, 5.0)
>>> found.pools[0].level, found.pools[0].volume, found.left
(7.0, 4.0, 1.0)
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from esker.flow.water import Water, find_water

Ints = NDArray[np.int32]

__all__ = ["Pool", "Poured", "brim", "find_water", "pour"]


@dataclass(frozen=True, eq=False)
class Pool:
    """Water that stands in one hollow, or in several that have joined.

    ``level``: steps of height, not always a whole number. ``samples``: the indices of those below it, rising.
    ``volume``: steps of height times samples.
    """

    level: float
    samples: Ints
    volume: float


@dataclass(frozen=True, eq=False)
class Poured:
    """``pools``: in the order in which they filled. ``left``: what ran off over the border or into the sea."""

    pools: tuple[Pool, ...]
    left: float


@dataclass
class _Filling:
    basins: set[int]
    front: list[tuple[int, int]]
    level: float
    samples: list[int] = field(default_factory=list)


def brim(water: Water, index: int) -> int:
    """The last sample of the lake that a sample runs into, over which it runs out; -1 where water finds no lake."""
    basin, filled, receiver = water.basin.ravel(), water.filled.ravel(), water.receiver.ravel()
    if basin[index] == 0:
        return -1
    level, last, at = water.spill[basin[index]], -1, index
    while at >= 0 and filled[at] >= level:
        last, at = at, int(receiver[at])
    return last


def pour(water: Water, index: int, volume: float) -> Poured:
    """Pours a volume (steps of height times samples) out at a sample."""
    z, basin = water.z.ravel(), water.basin.ravel()
    pits = _pits(z, basin, len(water.spill))
    taken = np.zeros(z.size, np.bool_)
    fillings: list[_Filling] = []
    left, to = volume, int(basin[index])
    while to != 0 and left > 0:
        known = next((k for k, f in enumerate(fillings) if to in f.basins), None)
        if known is None:
            pit = int(pits[to])
            fillings.append(_Filling({to}, [(int(z[pit]), pit)], float(z[pit])))
        else:
            _join(fillings, known)
        left, to = _fill(water, fillings[-1], taken, left)
    return Poured(tuple(_pool(f, z) for f in fillings), left)


def _pits(z: Ints, basin: Ints, count: int) -> NDArray[np.intp]:
    """The lowest sample of each basin, of equally low ones the first."""
    order = np.lexsort((np.arange(z.size), z, basin))
    return order[np.searchsorted(basin[order], np.arange(count))]


def _join(fillings: list[_Filling], first: int) -> None:
    """The pools from ``first`` on stand at the brim between them: they are one from now on."""
    into = fillings[first]
    for other in fillings[first + 1 :]:
        into.basins |= other.basins
        into.front += other.front
        into.samples += other.samples
        into.level = max(into.level, other.level)
    heapq.heapify(into.front)
    del fillings[first + 1 :]


def _fill(water: Water, pool: _Filling, taken: NDArray[np.bool_], volume: float) -> tuple[float, int]:
    """Raises a pool until the water is used up or runs over: what is left, and the basin into which it runs."""
    z, basin, cols = water.z.ravel(), water.basin.ravel(), water.shape[1]
    left = volume
    while pool.front:
        height, i = pool.front[0]
        is_own = int(basin[i]) in pool.basins
        if is_own and taken[i]:
            heapq.heappop(pool.front)
            continue
        to = max(pool.level, float(height))
        more = (to - pool.level) * len(pool.samples)
        if left < more:
            break
        left -= more
        pool.level = to
        if not is_own:
            return left, int(basin[i])
        heapq.heappop(pool.front)
        taken[i] = True
        pool.samples.append(i)
        # No sample of a basin lies on the border, so all around one are samples.
        for j in (i + 1, i - 1, i + cols, i - cols, i + 1 - cols, i + cols - 1):
            # Water of another pool is a way out too: both join where they stand equally high.
            if not taken[j] or int(basin[j]) not in pool.basins:
                heapq.heappush(pool.front, (int(z[j]), j))
    pool.level += left / len(pool.samples)
    return 0.0, 0


def _pool(filling: _Filling, z: Ints) -> Pool:
    samples = np.array(sorted(filling.samples), np.int32)
    samples = samples[z[samples] < filling.level]
    return Pool(filling.level, samples, float((filling.level - z[samples].astype(np.float64)).sum()))
