"""Basins: which pit each sample runs to, and how high water rises in it before it runs over.

A flood of all samples (Barnes, Lehman & Mulla 2014) finds for each the lowest way out: the least, over all ways to the
border, of the highest ground on the way. From a sample one descends to its pit without rising, so that height is
max(z, height of its pit), and only the few hundred pits need a flood: over the graph of basins, whose edges are the
lowest passes between them.
"""

from __future__ import annotations

import heapq

import numpy as np
from numpy.typing import NDArray

from esker.compiled import kernel

Ints = NDArray[np.int32]
Wide = NDArray[np.int64]

LOWEST = -(1 << 40)
"""Below every height: where water stands outside."""


@kernel
def label(receiver: Ints, order: Ints, basin: Ints) -> int:
    """The basin of each sample: 0 where water runs out without a lake, else 1, 2, ... in the order of the pits'
    indices. Returns how many basins have a pit.

    ``order``: every sample, after all that run through it (``area.gather``); it is read from its end, so the basin of a
    receiver is known before that of what runs to it.
    """
    count = 0
    for i in range(receiver.size):
        if receiver[i] == i:
            count += 1
            basin[i] = count
    for t in range(order.size - 1, -1, -1):
        i = order[t]
        j = receiver[i]
        if j < 0:
            basin[i] = 0
        elif j != i:
            basin[i] = basin[j]
    return count


@kernel
def _offer(passes: Wide, key: int, height: int, inner: int, outer: int) -> int:
    """Keeps the lowest pass of a pair of basins; of equally low ones that of the lower sample, then of the lower other.

    ``passes``: (capacity, 4) rows of key, height, sample of the lower basin, of the higher one; the capacity is a power
    of two, and no key is -1. Returns 1 for a new pair, else 0.
    """
    mask = passes.shape[0] - 1
    at = ((key * 0x9E3779B1) >> 12) & mask
    while passes[at, 0] != key and passes[at, 0] >= 0:
        at = (at + 1) & mask
    if passes[at, 0] < 0:
        passes[at, 0], passes[at, 1], passes[at, 2], passes[at, 3] = key, height, inner, outer
        return 1
    if height > passes[at, 1]:
        return 0
    low, high = min(inner, outer), max(inner, outer)
    old_low, old_high = min(passes[at, 2], passes[at, 3]), max(passes[at, 2], passes[at, 3])
    if height < passes[at, 1] or low < old_low or (low == old_low and high < old_high):
        passes[at, 1], passes[at, 2], passes[at, 3] = height, inner, outer
    return 0


@kernel
def find_passes(z: Ints, basin: Ints, count: int, passes: Wide) -> int:
    """Fills the table of the lowest passes between basins that touch along an edge of the mesh, for ``_offer``.

    Returns how many there are, or -1 when more than half of the table is full: then a larger one is needed.
    """
    rows, cols = z.shape
    heights = z.ravel()
    used = 0
    steps = np.array([1, cols, cols - 1])  # E N NW: each edge once
    for r in range(rows):
        for c in range(cols):
            i = r * cols + c
            own = int(basin[i])  # without numba a product of 32 bits would overflow
            for k in range(3):
                if (k == 0 and c == cols - 1) or (k > 0 and r == rows - 1) or (k == 2 and c == 0):
                    continue
                j = i + steps[k]
                other = int(basin[j])
                if other == own:
                    continue
                height = max(heights[i], heights[j])
                if own < other:
                    used += _offer(passes, own * (count + 1) + other, height, i, j)
                else:
                    used += _offer(passes, other * (count + 1) + own, height, j, i)
                if used * 2 > passes.shape[0]:
                    return -1
    return used


@kernel
def flood(count: int, passes: Wide, spill: Wide, exit_in: Ints, exit_out: Ints) -> None:
    """Prim's flood from outside over the graph of basins.

    ``spill``: at which height each basin runs over. ``exit_in``, ``exit_out``: the samples on both sides of the pass
    over which it does. Of equally high ways the one of the lower samples comes first, so the outcome does not depend on
    how the table was filled.
    """
    start = np.zeros(count + 2, np.int64)
    for at in range(passes.shape[0]):
        if passes[at, 0] >= 0:
            start[passes[at, 0] // (count + 1) + 1] += 1
            start[passes[at, 0] % (count + 1) + 1] += 1
    for k in range(count + 1):
        start[k + 1] += start[k]
    edges = np.empty(start[count + 1], np.int64)
    place = start[:-1].copy()
    for at in range(passes.shape[0]):
        if passes[at, 0] >= 0:
            for end in (passes[at, 0] // (count + 1), passes[at, 0] % (count + 1)):
                edges[place[end]] = at
                place[end] += 1
    done = np.zeros(count + 1, np.bool_)
    heap = [(np.int64(LOWEST), np.int64(0), np.int64(0), np.int64(0), np.int64(-1))]
    while len(heap) > 0:
        level, _, _, b, edge = heapq.heappop(heap)
        if done[b]:
            continue
        done[b] = True
        spill[b] = level
        if edge >= 0:
            inner = passes[edge, 0] // (count + 1) == b
            exit_in[b] = passes[edge, 2] if inner else passes[edge, 3]
            exit_out[b] = passes[edge, 3] if inner else passes[edge, 2]
        for e in range(start[b], start[b + 1]):
            way = edges[e]
            low, high = passes[way, 0] // (count + 1), passes[way, 0] % (count + 1)
            other = high if low == b else low
            if not done[other]:
                p, q = min(passes[way, 2], passes[way, 3]), max(passes[way, 2], passes[way, 3])
                heapq.heappush(heap, (max(level, passes[way, 1]), p, q, other, way))


@kernel
def turn_round(receiver: Ints, count: int, exit_in: Ints, exit_out: Ints) -> None:
    """Turns round the way from each basin's exit to its pit, so that its water runs over and every sample reaches
    the border or the sea."""
    for b in range(1, count + 1):
        at, new = exit_in[b], exit_out[b]
        while True:
            old = receiver[at]
            receiver[at] = new
            if old == at:
                break
            new, at = at, old


@kernel
def fill(z: Ints, basin: Ints, spill: Wide, filled: Ints) -> None:
    """How high water or ground stands at each sample. All are one number a sample, in one row."""
    for i in range(z.size):
        filled[i] = max(np.int64(z[i]), spill[basin[i]])
