"""Mipmaps and patch errors in NumPy float64, sample by sample as they are defined: the twin of the compiled loops."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from esker.contract import PATCH_KERNEL_CELLS
from esker.patchwork import patches

Floats = NDArray[np.float64]


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


def patch_samples(mip: Floats, row: int, col: int, side: int) -> Floats:
    """Samples (side, side) from [row, col] on: the level's border goes on, nodata is the mean of valid neighbours."""
    rows = np.clip(np.arange(row, row + side), 0, mip.shape[0] - 1)
    cols = np.clip(np.arange(col, col + side), 0, mip.shape[1] - 1)
    out = np.array(mip[np.ix_(rows, cols)], np.float64)
    while np.isnan(out).any():
        known = np.pad(out, 1, constant_values=np.nan)
        for r, c in np.argwhere(np.isnan(out)):
            near = known[r : r + 3, c : c + 3]
            if not np.isnan(near).all():
                out[r, c] = near[~np.isnan(near)].mean()
    return out


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
