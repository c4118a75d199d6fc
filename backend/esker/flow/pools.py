"""Ground that still water covers: the pool around a sample, and the sea that comes in from the border."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from esker.compiled import kernel

Ints = NDArray[np.int32]
Mask = NDArray[np.bool_]


@kernel
def spread(z: Ints, level: int, wet: Mask, stack: Ints, count: int) -> None:
    """Marks what lies below ``level`` and hangs together, over edges and corners, with ``stack[:count]``, which is
    marked already. ``stack`` has a place for every sample."""
    rows, cols = z.shape
    while count > 0:
        count -= 1
        row, col = divmod(stack[count], cols)
        for i in range(max(row - 1, 0), min(row + 2, rows)):
            for j in range(max(col - 1, 0), min(col + 2, cols)):
                if not wet[i, j] and z[i, j] < level:
                    wet[i, j] = True
                    stack[count] = i * cols + j
                    count += 1


def pool(z: Ints, index: int, level: int) -> Mask:
    """The samples below ``level`` that hang together with one, which is not among them where it is as high."""
    wet = np.zeros(z.shape, np.bool_)
    if z.ravel()[index] < level:
        stack = np.empty(z.size, np.int32)
        wet.ravel()[index] = True
        stack[0] = index
        spread(z, level, wet, stack, 1)
    return wet


def sea(z: Ints, level: int) -> Mask:
    """The samples below ``level`` to which water comes from the border."""
    wet = np.zeros(z.shape, np.bool_)
    for edge in (np.s_[0, :], np.s_[-1, :], np.s_[:, 0], np.s_[:, -1]):
        wet[edge] |= z[edge] < level
    found = np.flatnonzero(wet)
    stack = np.empty(z.size, np.int32)
    stack[: len(found)] = found
    spread(z, level, wet, stack, len(found))
    return wet
