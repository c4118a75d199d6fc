"""When do many kernels together cover one? Cut where few meet, quartered where many do (compiled).

Taking kernels out of a polygon one after the other leaves ever more pieces, so that the time grows with the square of
their number. Where more than ``FEW`` meet a quad it is quartered instead, and each quarter asks those that reach it:
the time grows with their number, and ends at the first quarter that is not covered.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from esker.patchwork.jit import kernel
from esker.patchwork.lod.quads import MOST, contains, overlap, subtracted

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

COVERED: Final = 1e-7
"""Share of an area that may be left over and count as covered: rounding, not ground."""
SLIVER: Final = 1e-9
"""Share of an area below which a left over piece is rounding."""
FEW: Final = 32
"""Kernels that are cut out of a quad as it is."""
DEEPEST: Final = 10
"""How often a quad is quartered: below that, however many meet it are cut out."""


@kernel
def local(kernels: Floats, q: int, x: float, y: float, out: Floats) -> None:
    """The kernel q relative to (x, y)."""
    for c in range(4):
        out[c, 0] = kernels[q, c, 0] - x
        out[c, 1] = kernels[q, c, 1] - y


@kernel
def _quarters(quad: Floats, out: Floats) -> None:
    """Four quads (4, 4, 2) that a quad is made of."""
    mx, my = 0.0, 0.0
    for c in range(4):
        mx += 0.25 * quad[c, 0]
        my += 0.25 * quad[c, 1]
    for c in range(4):
        after, before = (c + 1) % 4, (c + 3) % 4
        for k in range(2):
            out[c, 0, k] = quad[c, k]
            out[c, 1, k] = 0.5 * (quad[c, k] + quad[after, k])
            out[c, 2, k] = mx if k == 0 else my
            out[c, 3, k] = 0.5 * (quad[c, k] + quad[before, k])


@kernel
def _cut(
    kernels: Floats,
    slack: Floats,
    min_z: Floats,
    quad: Floats,
    whole: float,
    x: float,
    y: float,
    numbers: Ints,
    count: int,
    best: float,
) -> float:
    """Computes :func:`least_cover` by cutting."""
    other = np.empty((4, 2))
    pieces, corners = np.empty((1, MOST, 2)), np.full(1, 4, np.int64)
    for c in range(4):
        pieces[0, c, 0], pieces[0, c, 1] = quad[c, 0], quad[c, 1]
    parts = 1
    for k in range(count):
        q = numbers[k]
        local(kernels, q, x, y, other)
        left, sizes = np.empty((8 * parts + 1, MOST, 2)), np.empty(8 * parts + 1, np.int64)
        parts, area = subtracted(pieces, corners, parts, other, slack[q], SLIVER * whole, left, sizes)
        pieces, corners = left, sizes
        if area <= COVERED * whole:
            return float(min_z[q])
    return best


@kernel
def _meeting(
    kernels: Floats,
    slack: Floats,
    min_z: Floats,
    quad: Floats,
    area: float,
    x: float,
    y: float,
    numbers: Ints,
    limit: float,
    out: Ints,
) -> tuple[int, float]:
    """How many of the kernels ``numbers`` meet a quad of this area, into ``out``, up to the first that holds it whole;
    and the smaller of ``limit`` and that one's error."""
    other, met = np.empty((4, 2)), 0
    for k in range(numbers.size):
        q = numbers[k]
        local(kernels, q, x, y, other)
        if contains(other, quad, slack[q] + 1e-7 * np.sqrt(area)):
            return met, min(limit, min_z[q])
        if overlap(quad, other, slack[q]):
            out[met] = q
            met += 1
    return met, limit


@kernel
def least_cover(
    kernels: Floats,
    slack: Floats,
    min_z: Floats,
    quad: Floats,
    whole: float,
    x: float,
    y: float,
    numbers: Ints,
    count: int,
    best: float,
    whether: bool,
) -> float:
    """Smallest error at which the first kernels of a list, in its order, cover a quad; ``best`` if all do not.

    ``kernels`` (n, 4, 2) world, ``slack`` metres they are taken greater by, ``min_z`` their errors, below ``best`` and
    ascending in ``numbers[:count]``. If only asked ``whether`` they do, they need not ascend, and any answer but
    ``best`` is yes. ``quad`` (4, 2) relative to (x, y), ``whole`` the area that shares are of.
    """
    if count <= FEW:
        return _cut(kernels, slack, min_z, quad, whole, x, y, numbers, count, best)
    lists, held = np.empty((DEEPEST + 1, count), np.int64), np.zeros(DEEPEST + 1, np.int64)
    for k in range(count):
        lists[0, k] = numbers[k]
    held[0] = count
    quads, depths = np.empty((4 * DEEPEST + 4, 4, 2)), np.ones(4 * DEEPEST + 4, np.int64)
    limits = np.full(4 * DEEPEST + 4, best)
    _quarters(quad, quads[:4])
    waiting, part, found = 4, np.empty((4, 2)), -np.inf
    while waiting:
        waiting -= 1
        depth, limit = depths[waiting], limits[waiting]
        for k in range(4):
            part[k, 0], part[k, 1] = quads[waiting, k, 0], quads[waiting, k, 1]
        asked = lists[depth - 1, : held[depth - 1]]
        met, limit = _meeting(kernels, slack, min_z, part, whole * 0.25**depth, x, y, asked, limit, lists[depth])
        if limit <= found or (whether and limit < best):
            continue
        if met <= FEW or depth == DEEPEST:
            # The share that may be left over is of the whole quad: a sliver lies in one quarter, seldom in two.
            z = _cut(kernels, slack, min_z, part, whole, x, y, lists[depth], met, limit)
            if z == best:
                return best
            found = max(found, z)
            continue
        held[depth] = met
        _quarters(part, quads[waiting : waiting + 4])
        for k in range(waiting, waiting + 4):
            depths[k], limits[k] = depth + 1, limit
        waiting += 4
    return found
