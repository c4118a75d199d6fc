"""Mipmaps and patch errors in NumPy float64, sample by sample as they are defined: the twin of the compiled loops."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from esker.contract import PATCH_KERNEL_CELLS
from esker.patchwork.raster import patches

Floats = NDArray[np.float64]

AROUND = [(y, x) for y in (-1, 0, 1) for x in (-1, 0, 1) if (y, x) != (0, 0)]


def halved(fine: Floats) -> Floats:
    """The next coarser level: the mean of the valid samples of each 2 x 2 block, NaN where there is none."""
    rows, cols = fine.shape
    out = np.full(((rows + 1) // 2, (cols + 1) // 2), np.nan)
    for row in range(out.shape[0]):
        for col in range(out.shape[1]):
            block = fine[2 * row : 2 * row + 2, 2 * col : 2 * col + 2]
            valid = block[~np.isnan(block)]
            if len(valid):
                out[row, col] = valid.mean()
    return out


def mipmaps(heights: Floats) -> tuple[Floats, ...]:
    """All levels of a grid, itself first, until one patch holds a level."""
    levels = [np.asarray(heights, np.float64)]
    while max(levels[-1].shape) > PATCH_KERNEL_CELLS:
        levels.append(halved(levels[-1]))
    return tuple(levels)


def following(a: float, b: float, c: float) -> float:
    """Returns the sample that comes after c, b, a: the lesser of the two slopes goes on, none where they have opposite
    signs."""
    if np.isnan([a, b, c]).any():
        return float("nan")
    steps = np.array([a - b, b - c])
    return float(a + (steps[np.argmin(np.abs(steps))] if steps[0] * steps[1] > 0 else 0.0))


def _gone_on(line: Floats, before: int, after: int) -> Floats:
    """A line with samples more at both ends, on the straight lines that begin there."""
    out = np.pad(line, (before, after), mode="edge")
    if len(line) >= 3:
        south, north = (following(*end[:3]) - end[0] for end in (line, line[::-1]))
        out[:before] += np.nan_to_num(south) * np.arange(before, 0, -1)
        out[len(out) - after :] += np.nan_to_num(north) * np.arange(1, after + 1)
    return out


def patch_samples(mip: Floats, row: int, col: int, side: int) -> Floats:
    """Samples (side, side) from [row, col] on: the level's slope goes on beyond its border, rows first; then nodata."""
    row, col, side = row - 3, col - 3, side + 6  # what lies around the patch has a say in its holes
    around = [max(0, -row), max(0, row + side - mip.shape[0]), max(0, -col), max(0, col + side - mip.shape[1])]
    wide = np.array([_gone_on(line, *around[2:]) for line in np.asarray(mip, np.float64)])
    wide = np.array([_gone_on(line, *around[:2]) for line in wide.T]).T
    out = wide[max(0, row) :, max(0, col) :][:side, :side].copy()
    while np.isnan(out[3:-3, 3:-3]).any():
        known = np.pad(out, 3, constant_values=np.nan)
        for r, c in np.argwhere(np.isnan(out)):
            near = [[known[r + 3 + k * y, c + 3 + k * x] for k in (1, 2, 3)] for y, x in AROUND]
            sloping = [value for value in (following(*line) for line in near) if not np.isnan(value)]
            flat = [line[0] for line in near if not np.isnan(line[0])]
            if flat:
                out[r, c] = np.mean(sloping or flat)
    return out[3:-3, 3:-3]


def bilinear(samples: Floats, u: Floats, v: Floats) -> Floats:
    """A patch at sample coordinates (u, v); beyond its samples its border goes on."""
    last = len(samples) - 1
    u, v = np.clip(u, 0, last), np.clip(v, 0, last)
    i, j = np.minimum(u.astype(int), last - 1), np.minimum(v.astype(int), last - 1)
    f, g = u - i, v - j
    low = samples[j, i] * (1 - f) + samples[j, i + 1] * f
    high = samples[j + 1, i] * (1 - f) + samples[j + 1, i + 1] * f
    return np.asarray(low * (1 - g) + high * g)


def patch_error(mips: tuple[Floats, ...], warp: Floats | None, scale: int, j: int, i: int) -> float:
    """max |sample - patch| over the valid samples of the grid whose true places lie in the domain of a patch."""
    level, size = patches.level_of(scale), patches.kernel_samples(scale)
    samples = patch_samples(mips[level], j * size - patches.RING, i * size - patches.RING, patches.side_of(scale))
    rows, cols = mips[0].shape
    laid = patches.lay(rows, cols, warp, scale, np.array([j]), np.array([i]))
    return _farthest(mips[0], warp, samples, laid)


def rim_error(heights: Floats, warp: Floats | None, box: NDArray[np.int32]) -> float:
    """As :func:`patch_error`, of the patch of a kernel of the rim (row, column, rows, columns)."""
    side = int(box[2:].max()) + 2 * patches.RING
    samples = patch_samples(heights, int(box[0]) - patches.RING, int(box[1]) - patches.RING, side)
    rows, cols = heights.shape
    return _farthest(heights, warp, samples, patches.lay_rim(rows, cols, warp, box[None]))


def _farthest(heights: Floats, warp: Floats | None, samples: Floats, laid: patches.Lattice) -> float:
    """max |sample - patch| over the valid samples in the domain of one patch."""
    rows, cols = heights.shape
    v, u = (index.ravel() for index in np.indices((rows, cols)))
    place = patches.warped(warp, rows, cols, np.stack([u, v], 1).astype(np.float64))
    at = place @ laid.to_patch[0, :, :2].T + laid.to_patch[0, :, 2]
    inside = (at >= 0).all(axis=1) & (at <= laid.extent[0]).all(axis=1) & ~np.isnan(heights.ravel())
    at = at[inside]
    return float(np.abs(heights.ravel()[inside] - bilinear(samples, at[:, 0], at[:, 1])).max())
