"""The samples of a patch: cut from its mipmap level, with borders and nodata filled (compiled)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from esker.patchwork.jit import kernel


@kernel
def cut(mip: NDArray[np.float32], row: int, col: int, out: NDArray[np.float32]) -> None:
    """Copy the samples of ``mip`` from [row, col] on to ``out`` (side, side).

    Beyond the level's border its outermost samples go on. Nodata, which only lies in the margin, takes the mean of its
    valid neighbours, ring by ring outwards from the valid ones.
    """
    rows, cols = mip.shape
    side = out.shape[0]
    holes = 0
    for r in range(side):
        source = mip[min(max(row + r, 0), rows - 1)]
        for c in range(side):
            value = source[min(max(col + c, 0), cols - 1)]
            out[r, c] = value
            if np.isnan(value):
                holes += 1
    if holes:
        fill(out, holes)


@kernel
def fill(out: NDArray[np.float32], holes: int) -> None:
    """Replace the ``holes`` NaN of a patch by the mean of their valid neighbours (of eight), ring by ring."""
    side = out.shape[0]
    known = np.empty_like(out)
    while 0 < holes < side * side:
        for r in range(side):
            for c in range(side):
                known[r, c] = out[r, c]
        for r in range(side):
            for c in range(side):
                if not np.isnan(known[r, c]):
                    continue
                total, count = 0.0, 0
                for y in range(max(r - 1, 0), min(r + 2, side)):
                    for x in range(max(c - 1, 0), min(c + 2, side)):
                        if not np.isnan(known[y, x]):
                            total += known[y, x]
                            count += 1
                if count:
                    out[r, c] = total / count
                    holes -= 1
