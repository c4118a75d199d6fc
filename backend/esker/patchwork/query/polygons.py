"""Small convex polygons, clipped (compiled): where a patch's domain meets the triangle of a view."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from esker.patchwork.jit import kernel

Floats = NDArray[np.float64]

MOST: Final = 12
"""Corners of a quadrangle clipped by a triangle, with room to spare."""


@kernel
def clipped(xs: Floats, ys: Floats, count: int, ax: float, ay: float, bx: float, by: float, out: Floats) -> int:
    """Keep what lies left of a -> b of a convex polygon, in place; how many corners stay. ``out``: scratch."""
    made = 0
    for k in range(count):
        n = k + 1 if k + 1 < count else 0
        p = (bx - ax) * (ys[k] - ay) - (by - ay) * (xs[k] - ax)
        q = (bx - ax) * (ys[n] - ay) - (by - ay) * (xs[n] - ax)
        if p >= 0:
            out[0, made], out[1, made] = xs[k], ys[k]
            made += 1
        if (p > 0 and q < 0) or (p < 0 and q > 0):
            t = p / (p - q)
            out[0, made], out[1, made] = xs[k] + t * (xs[n] - xs[k]), ys[k] + t * (ys[n] - ys[k])
            made += 1
    for k in range(made):
        xs[k], ys[k] = out[0, k], out[1, k]
    return made


@kernel
def depths(corners: Floats, triangle: Floats, forward: Floats, work: Floats) -> tuple[float, float]:
    """Least and greatest (p - triangle[0]) . forward over a convex quadrangle (4, 2) cut by a triangle (3, 2).

    Both counter-clockwise. (inf, -inf) where they do not meet. ``work``: (4, MOST) scratch.
    """
    xs, ys, scratch = work[0], work[1], work[2:]
    for k in range(4):
        xs[k], ys[k] = corners[k, 0], corners[k, 1]
    count = 4
    for k in range(3):
        n = (k + 1) % 3
        count = clipped(xs, ys, count, triangle[k, 0], triangle[k, 1], triangle[n, 0], triangle[n, 1], scratch)
        if count == 0:
            return np.inf, -np.inf
    low, high = np.inf, -np.inf
    for k in range(count):
        depth = (xs[k] - triangle[0, 0]) * forward[0] + (ys[k] - triangle[0, 1]) * forward[1]
        low, high = min(low, depth), max(high, depth)
    return low, high
