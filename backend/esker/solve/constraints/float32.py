"""Arithmetic of float32 on float64 arrays, bit for bit (docs/decisions/0030-the-same-in-every-precision.md).

Where a sample decides between two things, the nearest of two segments say, kernels and twins must decide alike. So both
take the same operations, correctly rounded: every OpenCL device has those of addition, product and fma, and here they
are for NumPy. Arrays are float64 whose values are float32.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def rounded(value: Any) -> Floats:
    """The nearest float32. Of a sum or product of two float32 it is their float32 sum or product."""
    return np.asarray(value).astype(np.float32).astype(np.float64)


def fused(a: Any, b: Any, c: Any) -> Floats:
    """fma(a, b, c): a b + c rounded once.

    >>> float(fused(1 + 2.0**-12, 1 + 2.0**-12, -1 - 2.0**-11) * 2**24)
    1.0
    """
    product = np.asarray(a, dtype=np.float64) * b  # exact: 48 bits
    total = np.asarray(product + c)
    part = total - product
    lost = (product - (total - part)) + (c - part)
    # Rounded to odd, a second rounding falls as if the first had not been: the last bit says that something is left.
    even = (total.view(np.int64) & 1) == 0
    return rounded(np.where((lost != 0) & even, np.nextafter(total, np.copysign(np.inf, lost)), total))
