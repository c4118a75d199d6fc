"""Up and down from one sample: its watershed, and the way of a drop that falls there."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from esker.compiled import kernel

Ints = NDArray[np.int32]
Marks = NDArray[np.int8]

INSIDE: Final = 1
OUTSIDE: Final = 2


@kernel
def mark_upstream(receiver: Ints, index: int, inside: Marks) -> None:
    """Marks with INSIDE the samples whose water passes ``index``, the others with OUTSIDE. ``inside``: zeros.

    Each way is walked down to what is known, and walked again to mark it, so no sample is walked more than twice.
    """
    inside[index] = INSIDE
    for i in range(receiver.size):
        at = i
        found = inside[at]
        while found == 0:
            at = receiver[at]
            found = OUTSIDE if at < 0 else inside[at]
        at = i
        while at >= 0 and inside[at] == 0:
            inside[at] = found
            at = receiver[at]


@kernel
def follow(receiver: Ints, index: int, way: Ints) -> int:
    """Writes the samples from ``index`` down to where water leaves; returns how many there are."""
    count = 0
    at = index
    while at >= 0:
        way[count] = at
        count += 1
        at = receiver[at]
    return count
