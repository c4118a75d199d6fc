"""Where there is data, and how fine: the survey channel (``contract.Channel.SURVEY``), from which synthesis knows the
levels that the data's own detail fills."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from esker.contract import BASE_SURVEY, TILE_CELLS
from esker.patchwork.jit import bands, kernel, read_only, spread
from esker.patchwork.lod.space import Model, Placed


def levels(model: Model, size_m: float, samples: int) -> NDArray[np.float32]:
    """log2(size / (64 * spacing)) of the finest layer with a valid sample at each place; ``BASE_SURVEY`` without any.

    float32 (samples, samples) over the domain. A layer's spacing is the geometric mean of its two steps.
    """
    out = np.full((samples, samples), BASE_SURVEY, dtype=np.float32)
    for placed in model.placed:
        _lay(placed, size_m, out)
    return out


def _lay(placed: Placed, size_m: float, out: NDArray[np.float32]) -> None:
    layer, raster = placed.layer, placed.raster
    level = math.log2(size_m / (TILE_CELLS * math.sqrt(layer.spacing_m[0] * layer.spacing_m[1])))
    warp = raster.warp if raster.warp is not None else read_only(np.zeros((2, 2, 2)))
    turn = math.radians(layer.rotation_deg)
    c, s = math.cos(turn), math.sin(turn)
    to_lattice = np.array([[c / layer.spacing_m[0], s / layer.spacing_m[0]],
                           [-s / layer.spacing_m[1], c / layer.spacing_m[1]]])  # fmt: skip
    anchor = np.array(layer.anchor, dtype=np.float64)
    step = size_m / (len(out) - 1)

    def some(start: int, stop: int) -> None:
        _mark(raster.heights, warp, to_lattice, anchor, step, max(level, BASE_SURVEY), start, stop, out)

    spread(some, bands(len(out), 32))


@kernel
def _mark(
    heights: NDArray[np.float32],
    warp: NDArray[np.float64],
    to_lattice: NDArray[np.float64],
    anchor: NDArray[np.float64],
    step: float,
    level: float,
    first: int,
    last: int,
    out: NDArray[np.float32],
) -> None:
    rows, cols = heights.shape
    tall, wide = warp.shape[0] - 1, warp.shape[1] - 1
    for row in range(first, last):
        for col in range(out.shape[1]):
            x, y = col * step - anchor[0], row * step - anchor[1]
            far_u = to_lattice[0, 0] * x + to_lattice[0, 1] * y
            far_v = to_lattice[1, 0] * x + to_lattice[1, 1] * y
            u, v = far_u, far_v
            for _ in range(3):  # the bend is small and slow: (u, v) + warp(u, v) = far, by repeated substitution
                a = min(max(v / (rows - 1), 0.0), 1.0) * tall
                b = min(max(u / (cols - 1), 0.0), 1.0) * wide
                i, j = min(int(a), tall - 1), min(int(b), wide - 1)
                f, g = a - i, b - j
                du = (1 - f) * ((1 - g) * warp[i, j, 0] + g * warp[i, j + 1, 0])
                du += f * ((1 - g) * warp[i + 1, j, 0] + g * warp[i + 1, j + 1, 0])
                dv = (1 - f) * ((1 - g) * warp[i, j, 1] + g * warp[i, j + 1, 1])
                dv += f * ((1 - g) * warp[i + 1, j, 1] + g * warp[i + 1, j + 1, 1])
                u, v = far_u - du, far_v - dv
            k, m = int(np.floor(v + 0.5)), int(np.floor(u + 0.5))
            if 0 <= k < rows and 0 <= m < cols and not np.isnan(heights[k, m]):
                out[row, col] = max(out[row, col], np.float32(level))
