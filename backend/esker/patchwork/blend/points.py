"""The blend at any places, in float64, with its first and second derivatives."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from esker.contract import PATCH_MARGIN_CELLS
from esker.patchwork.blend.jets import (
    fade_line,
    linear_jet,
    product,
    quotient,
    rest,
    spline_jet,
    taper_line,
    tensor,
    total,
    turned,
)
from esker.patchwork.blend.loops import bin_patches
from esker.patchwork.blend.packs import Pack
from esker.patchwork.jit import bands, kernel, spread

_MOST_CELLS = 1 << 20
"""Cells that points are looked up by, at most."""


class Places(NamedTuple):
    """float64 (n, 6) each: value, d/dx, d/dy, d2/dx2, d2/dxdy, d2/dy2 of the blended height and of the cover.

    Heights are 0 where the cover is 0.
    """

    heights: NDArray[np.float64]
    cover: NDArray[np.float64]


def evaluate(packed: Pack, points: NDArray[np.float64]) -> Places:
    """The blend at world points (n, 2). Raises ValueError for points that are not finite."""
    points = np.ascontiguousarray(points, dtype=np.float64)
    if not np.isfinite(points).all():
        raise ValueError("places must be finite")
    out = Places(np.zeros((len(points), 6)), np.zeros((len(points), 6)))
    if len(points) == 0 or len(packed) == 0:
        return out
    corner = points.min(axis=0)
    pitch = _pitch(packed, np.ptp(points, axis=0))
    cells = np.floor((points - corner) / pitch).astype(np.int64)
    wide, tall = (int(n) + 1 for n in cells.max(axis=0))
    to_patch = packed.to_patch.copy()
    to_patch[:, :, 2] += to_patch[:, :, :2] @ corner
    start, patch = _cells(to_patch, packed, pitch, tall, wide)
    which = cells[:, 1] * wide + cells[:, 0]
    order = np.argsort(which, kind="stable")

    def some(first: int, last: int) -> None:
        _evaluate(points, corner, order, which, start, patch, packed.smooth, packed.coefficients, to_patch,
                  packed.domain, packed.kernel, packed.volume, packed.side, packed.rank, first, last, *out)  # fmt: skip

    spread(some, bands(len(points), 256))
    return out


def _pitch(packed: Pack, size: NDArray[np.float64]) -> float:
    """Side of the cells, metres: about half a small patch, and not too many of them."""
    area = 4 / packed.volume
    wanted = 0.5 * float(np.sqrt(np.quantile(area, 0.25)))
    return max(wanted, float(np.sqrt(size.prod() / _MOST_CELLS)), float(size.max()) / _MOST_CELLS, 1e-3)


def _cells(
    to_patch: NDArray[np.float64], packed: Pack, pitch: float, tall: int, wide: int
) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """Patches that meet each cell (CSR)."""
    found = np.zeros(tall * wide + 1, dtype=np.int64)
    args = (to_patch, packed.domain, pitch, pitch, 0, tall, 0, wide)
    bin_patches(*args, found, np.empty(0, np.int32), np.empty((0, 2), np.float32))
    start = np.cumsum(found)
    patch, origin = np.empty(start[-1], dtype=np.int32), np.empty((start[-1], 2), dtype=np.float32)
    bin_patches(*args, start.copy(), patch, origin)
    return start, patch


@kernel
def _evaluate(
    points: NDArray[np.float64],
    corner: NDArray[np.float64],
    order: NDArray[np.int64],
    which: NDArray[np.int64],
    start: NDArray[np.int64],
    patch: NDArray[np.int32],
    smooth: bool,
    coefficients: NDArray[np.float32],
    to_patch: NDArray[np.float64],
    domain: NDArray[np.float64],
    kernels: NDArray[np.float64],
    volume: NDArray[np.float64],
    side: NDArray[np.int32],
    rank: NDArray[np.int32],
    first: int,
    last: int,
    heights: NDArray[np.float64],
    cover: NDArray[np.float64],
) -> None:
    zero = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for at in range(first, last):
        n = order[at]
        x, y = points[n, 0] - corner[0], points[n, 1] - corner[1]
        above, below = zero, zero
        bare = (1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        veil, at_rank = bare, np.int32(-1)
        for entry in range(start[which[n]], start[which[n] + 1]):
            k = patch[entry]
            if rank[k] != at_rank:
                veil, at_rank = bare, rank[k]
            to, d, inner = to_patch[k], domain[k], kernels[k]
            u = to[0, 0] * x + to[0, 1] * y + to[0, 2]
            v = to[1, 0] * x + to[1, 1] * y + to[1, 2]
            if u <= d[0] or u >= d[1] or v <= d[2] or v >= d[3]:
                continue
            along = taper_line(u - (d[0] + d[1]) / 2, 2 / (d[1] - d[0]), smooth)
            across = taper_line(v - (d[2] + d[3]) / 2, 2 / (d[3] - d[2]), smooth)
            along = (along[0] * volume[k], along[1] * volume[k], along[2] * volume[k])
            weight = product(turned(tensor(along, across), to), veil)
            jet = spline_jet(coefficients[k], u, v, side[k] - 2) if smooth else linear_jet(
                coefficients[k], u, v, side[k] - 2)  # fmt: skip
            above = total(above, product(weight, turned(jet, to)))
            below = total(below, weight)
            near = tensor(
                fade_line(u, inner[0], inner[1], PATCH_MARGIN_CELLS),
                fade_line(v, inner[2], inner[3], PATCH_MARGIN_CELLS),
            )
            bare = product(bare, rest(turned(near, to)))
        if below[0] > 0:
            height, presence = quotient(above, below), rest(bare)
            for c in range(6):
                heights[n, c] = height[c]
                cover[n, c] = presence[c]


@kernel
def joined(
    heights: NDArray[np.float64], cover: NDArray[np.float64], beyond: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Jets (n, 6) of m f + (1 - m) O from those of the blend f, its cover m and the continuation O."""
    out = np.empty_like(heights)
    for n in range(len(heights)):
        f = (heights[n, 0], heights[n, 1], heights[n, 2], heights[n, 3], heights[n, 4], heights[n, 5])
        m = (cover[n, 0], cover[n, 1], cover[n, 2], cover[n, 3], cover[n, 4], cover[n, 5])
        o = (beyond[n, 0], beyond[n, 1], beyond[n, 2], beyond[n, 3], beyond[n, 4], beyond[n, 5])
        jet = total(product(m, f), product(rest(m), o))
        for c in range(6):
            out[n, c] = jet[c]
    return out
