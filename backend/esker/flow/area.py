"""Drainage area: how many samples run through each, itself one. Whole numbers, visited in topological order."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from esker.compiled import kernel

Ints = NDArray[np.int32]
Marks = NDArray[np.int8]

VISITED = -1
"""In the count of what still comes in: nothing does, and the sample is in the order."""


@kernel
def gather(receiver: Ints, area: Ints, order: Ints, coming: Marks) -> None:
    """Areas, and an ``order`` in which each sample comes after all that run through it (Kahn's).

    From every sample into which nothing runs one walks down, adding, until something else still comes in. ``coming``
    is scratch, and VISITED everywhere afterwards. A receiver may be the sample itself: a pit.
    """
    for i in range(receiver.size):
        area[i] = 1
        coming[i] = 0
    for i in range(receiver.size):
        j = receiver[i]
        if j >= 0 and j != i:
            coming[j] += 1
    place = 0
    for i in range(receiver.size):
        if coming[i] != 0:
            continue
        at = i
        while True:
            coming[at] = VISITED
            order[place] = at
            place += 1
            j = receiver[at]
            if j < 0 or j == at:
                break
            area[j] += area[at]
            coming[j] -= 1
            if coming[j] != 0:
                break
            at = j


@kernel
def find_trunks(
    receiver: Ints, area: Ints, count: int, exit_in: Ints, exit_out: Ints, coming: Marks, trunk: Ints, own: Ints
) -> int:
    """The samples whose area changes when basins run over: all below the exits, on both sides of them.

    Each gets in ``own`` what runs into it beside the trunks. Returns how many there are; the first so many of ``trunk``
    are they. ``receiver``: before its basins were turned round; ``coming``: as ``gather`` leaves it.
    """
    found = 0
    for b in range(1, count + 1):
        for side in range(2):
            at = exit_in[b] if side == 0 else exit_out[b]
            while coming[at] == VISITED:
                coming[at] = 0
                own[at] = area[at]
                trunk[found] = at
                found += 1
                j = receiver[at]
                if j < 0 or j == at:
                    break
                at = j
    for t in range(found):
        i = trunk[t]
        j = receiver[i]
        if j >= 0 and j != i:
            own[j] -= area[i]
    return found


@kernel
def gather_trunks(receiver: Ints, area: Ints, coming: Marks, trunk: Ints, found: int, own: Ints) -> None:
    """Areas once basins run over; only those of the ``found`` trunks differ from before. ``receiver``: turned round."""
    for t in range(found):
        i = trunk[t]
        area[i] = own[i]
        if receiver[i] >= 0:
            coming[receiver[i]] += 1
    for t in range(found):
        at = trunk[t]
        if coming[at] != 0:
            continue
        while True:
            coming[at] = VISITED
            j = receiver[at]
            if j < 0:
                break
            area[j] += area[at]
            coming[j] -= 1
            if coming[j] != 0:
                break
            at = j


@kernel
def highest_above(receiver: Ints, z: Ints, top: Ints, coming: Marks) -> None:
    """The highest ground that runs through each sample. No sample is a pit any more; ``coming`` is scratch."""
    for i in range(receiver.size):
        top[i] = z[i]
        coming[i] = 0
    for i in range(receiver.size):
        if receiver[i] >= 0:
            coming[receiver[i]] += 1
    for i in range(receiver.size):
        at = i
        while coming[at] == 0:
            coming[at] = VISITED
            j = receiver[at]
            if j < 0:
                break
            top[j] = max(top[j], top[at])
            coming[j] -= 1
            at = j
