"""Convex polygons cut by quads, compiled: what is left of a kernel when others are taken away from it.

Polygons are arrays (MOST, 2) with a count of corners, counter-clockwise. All lengths are those of the caller, who puts
the origin near the polygons so that products of coordinates keep their digits.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from esker.patchwork.jit import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

MOST: Final = 24
"""Corners that a polygon may have; one that would have more is cut in two."""


@kernel
def area_of(points: Floats, count: int) -> float:
    """Area of a convex polygon."""
    total = 0.0
    for k in range(1, count - 1):
        ax, ay = points[k, 0] - points[0, 0], points[k, 1] - points[0, 1]
        bx, by = points[k + 1, 0] - points[0, 0], points[k + 1, 1] - points[0, 1]
        total += ax * by - ay * bx
    return abs(total) * 0.5


@kernel
def clipped(
    points: Floats, count: int, x: float, y: float, nx: float, ny: float, offset: float, sign: float, out: Floats
) -> int:
    """The part of a polygon on one side of the line through (x, y) with normal (nx, ny), moved ``offset`` back.

    ``sign``: 1 for the side that the normal points to, -1 for the other.
    """
    kept = 0
    for k in range(count):
        m = k + 1 if k + 1 < count else 0
        a = sign * ((points[k, 0] - x) * nx + (points[k, 1] - y) * ny + offset)
        b = sign * ((points[m, 0] - x) * nx + (points[m, 1] - y) * ny + offset)
        if a >= 0:
            out[kept, 0], out[kept, 1] = points[k, 0], points[k, 1]
            kept += 1
        if (a > 0 and b < 0) or (a < 0 and b > 0):
            t = a / (a - b)
            out[kept, 0] = points[k, 0] + t * (points[m, 0] - points[k, 0])
            out[kept, 1] = points[k, 1] + t * (points[m, 1] - points[k, 1])
            kept += 1
    return kept


@kernel
def contains(quad: Floats, points: Floats, tolerance: float) -> bool:
    """Returns whether a quad, grown by ``tolerance``, holds all four corners of another."""
    for k in range(4):
        m = (k + 1) % 4
        dx, dy = quad[m, 0] - quad[k, 0], quad[m, 1] - quad[k, 1]
        length = np.sqrt(dx * dx + dy * dy)
        for c in range(4):
            if dx * (points[c, 1] - quad[k, 1]) - dy * (points[c, 0] - quad[k, 0]) < -tolerance * length:
                return False
    return True


@kernel
def overlap(first: Floats, second: Floats, slack: float) -> bool:
    """Returns whether two quads share more than an edge, the second one grown by ``slack`` (separating axes of
    both)."""
    for turn in range(2):
        a, b = (first, second) if turn == 0 else (second, first)
        for k in range(4):
            m = (k + 1) % 4
            dx, dy = a[m, 0] - a[k, 0], a[m, 1] - a[k, 1]
            most = -np.inf
            for c in range(4):
                most = max(most, dx * (b[c, 1] - a[k, 1]) - dy * (b[c, 0] - a[k, 0]))
            if most + slack * np.sqrt(dx * dx + dy * dy) <= 0:
                return False
    return True


@kernel
def shrunk(quad: Floats, slack: float, out: Floats) -> None:
    """A quad drawn towards its middle, so that each edge moves by ``slack`` at least."""
    mx = 0.25 * (quad[0, 0] + quad[1, 0] + quad[2, 0] + quad[3, 0])
    my = 0.25 * (quad[0, 1] + quad[1, 1] + quad[2, 1] + quad[3, 1])
    nearest = np.inf
    for k in range(4):
        m = (k + 1) % 4
        dx, dy = quad[m, 0] - quad[k, 0], quad[m, 1] - quad[k, 1]
        nearest = min(nearest, (dx * (my - quad[k, 1]) - dy * (mx - quad[k, 0])) / np.sqrt(dx * dx + dy * dy))
    keep = max(0.0, 1.0 - slack / nearest)
    for k in range(4):
        out[k, 0] = mx + (quad[k, 0] - mx) * keep
        out[k, 1] = my + (quad[k, 1] - my) * keep


@kernel
def subtracted(
    pieces: Floats, corners: Ints, count: int, quad: Floats, slack: float, least: float, out: Floats, sizes: Ints
) -> tuple[int, float]:
    """``count`` polygons minus a quad grown by ``slack``, put into ``out`` and ``sizes``: how many, their whole area.

    Slivers of an area up to ``least`` are dropped. The outputs must hold eight times as many polygons.
    """
    rest, inner, cut = np.empty((2 * MOST, 2)), np.empty((2 * MOST, 2)), np.empty((2 * MOST, 2))
    found, total = 0, 0.0
    for p in range(count):
        n = corners[p]
        for k in range(n):
            rest[k, 0], rest[k, 1] = pieces[p, k, 0], pieces[p, k, 1]
        for k in range(4):
            m = (k + 1) % 4
            nx, ny = quad[k, 1] - quad[m, 1], quad[m, 0] - quad[k, 0]
            offset = slack * np.sqrt(nx * nx + ny * ny)
            kept = clipped(rest, n, quad[k, 0], quad[k, 1], nx, ny, offset, -1.0, cut)
            if kept > 2:
                size = area_of(cut, kept)
                if size > least:
                    total += size
                    found = _put(cut, kept, out, sizes, found)
            n = clipped(rest, n, quad[k, 0], quad[k, 1], nx, ny, offset, 1.0, inner)
            if n < 3:
                break
            rest, inner = inner, rest
    return found, total


@kernel
def _put(cut: Floats, count: int, out: Floats, sizes: Ints, found: int) -> int:
    """Add a polygon to a list, in two halves if it has too many corners to be cut again."""
    half = count if count <= MOST - 4 else count // 2 + 1
    for k in range(half):
        out[found, k, 0], out[found, k, 1] = cut[k, 0], cut[k, 1]
    sizes[found] = half
    if half == count:
        return found + 1
    out[found + 1, 0, 0], out[found + 1, 0, 1] = cut[0, 0], cut[0, 1]
    for k in range(half - 1, count):
        out[found + 1, k - half + 2, 0], out[found + 1, k - half + 2, 1] = cut[k, 0], cut[k, 1]
    sizes[found + 1] = count - half + 2
    return found + 2
