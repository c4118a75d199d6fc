"""Where the water of each sample runs to: steepest descent on the drawn triangles, then over level ground.

Squares of the grid are drawn as two triangles that share the diagonal from south-east to north-west. A way along the
other diagonal crosses the middle of that edge, so it counts only where it is downhill there too. Without that rule
water would cross ridges that are drawn, and a flood of the samples would not be the flood of the ground.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from esker.compiled import kernel

Ints = NDArray[np.int32]

OUT: Final = -1
"""The receiver of the border and of the sea: water leaves there."""
STRAIGHT: Final = 256
"""What a drop towards one of the four samples beside counts."""
DIAGONAL: Final = 181
"""What a drop along a diagonal counts: 181 / 256 is 1 / sqrt(2) to four digits, and whole."""


@kernel
def steepest(z: Ints, sea: int, receiver: Ints) -> None:
    """The receiver of each sample of ``z``: OUT, an index, or the sample itself where no way leads down.

    Ways are compared in the order E W N S SE NW NE SW, and the first of the steepest is taken. Drops are compared in
    64 bits, where no two heights are too far apart. The selections have no branches, so a processor does several
    samples at once.
    """
    rows, cols = z.shape
    for c in range(cols):
        receiver[0, c] = OUT
        receiver[rows - 1, c] = OUT
    for r in range(1, rows - 1):
        receiver[r, 0] = OUT
        receiver[r, cols - 1] = OUT
        here, west, east = z[r, 1:-1], z[r, :-2], z[r, 2:]
        north, north_west, north_east = z[r + 1, 1:-1], z[r + 1, :-2], z[r + 1, 2:]
        south, south_west, south_east = z[r - 1, 1:-1], z[r - 1, :-2], z[r - 1, 2:]
        out = receiver[r, 1:-1]
        first = r * cols + 1
        for k in range(cols - 2):
            i = first + k
            own = np.int64(here[k])
            e, w, n, s = np.int64(east[k]), np.int64(west[k]), np.int64(north[k]), np.int64(south[k])
            best, at = np.int64(0), i
            drop = (own - e) * STRAIGHT
            at = i + 1 if drop > best else at
            best = max(best, drop)
            drop = (own - w) * STRAIGHT
            at = i - 1 if drop > best else at
            best = max(best, drop)
            drop = (own - n) * STRAIGHT
            at = i + cols if drop > best else at
            best = max(best, drop)
            drop = (own - s) * STRAIGHT
            at = i - cols if drop > best else at
            best = max(best, drop)
            drop = (own - np.int64(south_east[k])) * DIAGONAL
            at = i - cols + 1 if drop > best else at
            best = max(best, drop)
            drop = (own - np.int64(north_west[k])) * DIAGONAL
            at = i + cols - 1 if drop > best else at
            best = max(best, drop)
            drop = (own - np.int64(north_east[k])) * DIAGONAL if n + e < 2 * own else np.int64(0)
            at = i + cols + 1 if drop > best else at
            best = max(best, drop)
            drop = (own - np.int64(south_west[k])) * DIAGONAL if s + w < 2 * own else np.int64(0)
            at = i - cols - 1 if drop > best else at
            out[k] = at if own > sea else OUT


@kernel
def across_flats(z: Ints, receiver: Ints, queue: Ints) -> None:
    """Leads level ground to its outlet, breadth first; what has none, to its sample of the lowest index: its pit.

    ``receiver`` and ``queue`` are one number a sample, in one row. Flat ground is joined as the mesh is. A pit's
    receiver is itself.
    """
    rows, cols = z.shape
    flat = z.ravel()
    steps = np.array([1, -1, cols, -cols, 1 - cols, cols - 1])  # E W N S SE NW
    head = tail = 0
    for r in range(1, rows - 1):
        for i in range(r * cols + 1, r * cols + cols - 1):
            if receiver[i] != i:
                continue
            for step in steps:
                j = i + step
                # An outlet is found before any ground is led to it, so it is marked, and led below.
                if flat[j] == flat[i] and receiver[j] != j and receiver[j] >= OUT:
                    receiver[i] = OUT - 1 - j
                    queue[tail] = i
                    tail += 1
                    break
    for t in range(tail):
        receiver[queue[t]] = OUT - 1 - receiver[queue[t]]
    while head < tail:
        i = queue[head]
        head += 1
        for step in steps:
            j = i + step
            if receiver[j] == j and flat[j] == flat[i]:
                receiver[j] = i
                queue[tail] = j
                tail += 1
    for pit in range(flat.size):
        if receiver[pit] != pit:
            continue
        head = 0
        queue[0] = pit
        tail = 1
        while head < tail:
            i = queue[head]
            head += 1
            for step in steps:
                j = i + step
                if receiver[j] == j and j != pit and flat[j] == flat[i]:
                    receiver[j] = i
                    queue[tail] = j
                    tail += 1
