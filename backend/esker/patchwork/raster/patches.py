"""Which patches an elevation grid has, and where they lie on its lattice (DESIGN 11; paper 2, sections 3.1 and 4.1).

Patches come at *scales*. At scale t kernels are 7 2^t lattice cells a side and tile the grid from its sample [0, 0] on,
so that four kernels of a scale are one of the next. Scales 2 and up are the mipmap levels 0 and up, with patches of
32 x 32 samples. Scales 0 and 1 are patches of 11 x 11 and 18 x 18 samples of the grid itself, made only where nodata or
a bend of the lattice forbids the greater ones. No kernel holds nodata. (Coarser levels need no small patches: their
kernels would be those of full patches of the level below.) Where not even a kernel of 7 x 7 has none, what is valid is
the *rim*: rectangles of 1 to 42 samples of the grid itself (``rim``), which lie below scale 0, at scale ``RIM``.

Places are in area coordinates (sample k covers k..k+1, its middle is the lattice coordinate k) unless it says lattice.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from esker.contract import PATCH_KERNEL_CELLS, PATCH_MARGIN_CELLS, PATCH_SAMPLES

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

SMALL_SCALES = 2
"""Scales below that of the full patches: kernels of a half and a quarter of theirs."""
RIM = -1
"""Scale of the patches of the rim."""
SMALLEST_KERNEL = PATCH_KERNEL_CELLS >> SMALL_SCALES
RING = (PATCH_SAMPLES - PATCH_KERNEL_CELLS) // 2
"""Samples that a patch has around those of its kernel."""
MAX_BEND = 0.25
"""How far the lattice may bend away from a kernel's straight edges, in cells of the patch's level."""


def level_of(scale: int) -> int:
    """Mipmap level that the patches of a scale take their samples from."""
    return max(0, scale - SMALL_SCALES)


def kernel_samples(scale: int) -> int:
    """Samples of its level that a kernel of a scale is wide: 7, 14 or 28."""
    return SMALLEST_KERNEL << min(scale, SMALL_SCALES)


def side_of(scale: int) -> int:
    """Samples a side of the patches of a scale: 11, 18 or 32."""
    return kernel_samples(scale) + 2 * RING


def table_shape(rows: int, cols: int, scale: int) -> tuple[int, int]:
    """Kernels that a grid is tiled with at a scale."""
    cells = SMALLEST_KERNEL << scale
    return -(-rows // cells), -(-cols // cells)


@dataclass(frozen=True, eq=False)
class PatchErrors:
    """Own errors of all patches of a grid: ``tables[scale][j, i]``, float32, in the unit of its samples.

    NaN where there is no such patch. The tables of the small scales have shape (0, 0) when there are none at all.
    The error is max |sample - patch| over the valid samples of the grid in the patch's domain, at their true places.
    ``rim``: int32 (n, 4), kernels of the rim (see ``rim.find``); ``rim_errors``: float32 (n,).
    """

    tables: tuple[NDArray[np.float32], ...]
    rim: NDArray[np.int32]
    rim_errors: NDArray[np.float32]

    @property
    def levels(self) -> int:
        """Levels of the mipmap."""
        return len(self.tables) - SMALL_SCALES

    @property
    def count(self) -> int:
        """Patches in all."""
        return len(self.rim) + sum(int(np.count_nonzero(~np.isnan(table))) for table in self.tables)


def warped(warp: Floats | None, rows: int, cols: int, points: Floats) -> Floats:
    """Lattice points (..., 2) with the displacement of a control net (m, n, 2) added, bilinear between its points.

    Beyond the net's border its outermost cells go on, so that half a cell around the samples is no edge.
    """
    if warp is None:
        return points
    net_rows, net_cols = warp.shape[:2]
    a = points[..., 0] * ((net_cols - 1) / (cols - 1))
    b = points[..., 1] * ((net_rows - 1) / (rows - 1))
    i = np.clip(np.floor(a).astype(np.int64), 0, net_cols - 2)
    j = np.clip(np.floor(b).astype(np.int64), 0, net_rows - 2)
    f, g = (a - i)[..., None], (b - j)[..., None]
    low = warp[j, i] + (warp[j, i + 1] - warp[j, i]) * f
    high = warp[j + 1, i] + (warp[j + 1, i + 1] - warp[j + 1, i]) * f
    return np.asarray(points + (low + (high - low) * g), np.float64)


@dataclass(frozen=True, eq=False)
class Lattice:
    """Where n patches of one scale lie on their grid's lattice, warp included.

    ``kernel`` (n, 4, 2): corners in the order of area coordinates (0,0), (1,0), (1,1), (0,1), neighbours with the same
    bits. ``to_patch`` (n, 2, 3): lattice to sample coordinates 0..side-1 of the patch, the affine that fits its domain.
    ``extent`` (n, 2): the domain is [0, extent] in sample coordinates: side - 1, less where the grid's end clips the
    kernel. ``bend`` (n,): lattice units by which the kernel's true edges leave its straight ones.
    """

    kernel: Floats
    to_patch: Floats
    extent: Floats
    bend: Floats


def lay(rows: int, cols: int, warp: Floats | None, scale: int, j: NDArray[np.int64], i: NDArray[np.int64]) -> Lattice:
    """Lay the patches (j, i) of a scale on the lattice of a (rows, cols) grid."""
    cells, step = SMALLEST_KERNEL << scale, 1 << level_of(scale)
    low = np.stack([i * cells, j * cells], 1).astype(np.float64)
    high = np.minimum(low + cells, np.array([cols, rows], np.float64))
    return _laid(rows, cols, warp, step, low, high)


def lay_rim(rows: int, cols: int, warp: Floats | None, rim: NDArray[np.int32]) -> Lattice:
    """Lay the patches of the rim (n, 4) on the lattice of a (rows, cols) grid."""
    low = rim[:, [1, 0]].astype(np.float64)
    return _laid(rows, cols, warp, 1, low, low + rim[:, [3, 2]])


def _laid(rows: int, cols: int, warp: Floats | None, step: int, low: Floats, high: Floats) -> Lattice:
    """Patches with kernels low..high (n, 2), x and y in area coordinates, of a level with samples ``step`` apart."""
    margin = PATCH_MARGIN_CELLS * step
    extent = np.ascontiguousarray((high - low + 2 * margin) / step)
    kernel = warped(warp, rows, cols, _corners(low, high) - 0.5)
    origin = low - margin - 0.5
    to_patch = np.zeros((len(low), 2, 3))
    if warp is None:
        to_patch[:, 0, 0] = to_patch[:, 1, 1] = 1.0 / step
        to_patch[:, :, 2] = -origin / step
        return Lattice(kernel, to_patch, extent, np.zeros(len(low)))
    width = high - low + 2 * margin
    domain = warped(warp, rows, cols, _corners(origin, origin + width))
    along = (domain[:, 1] + domain[:, 2] - domain[:, 0] - domain[:, 3]) / (2 * width[:, :1]) * step
    across = (domain[:, 2] + domain[:, 3] - domain[:, 0] - domain[:, 1]) / (2 * width[:, 1:]) * step
    determinant = along[:, 0] * across[:, 1] - along[:, 1] * across[:, 0]
    to_patch[:, 0, 0], to_patch[:, 0, 1] = across[:, 1] / determinant, -across[:, 0] / determinant
    to_patch[:, 1, 0], to_patch[:, 1, 1] = -along[:, 1] / determinant, along[:, 0] / determinant
    middle = domain.mean(axis=1)
    to_patch[:, :, 2] = extent / 2 - np.einsum("nij,nj->ni", to_patch[:, :, :2], middle)
    return Lattice(kernel, to_patch, extent, _bend(rows, cols, warp, low, high, kernel))


def _corners(low: Floats, high: Floats) -> Floats:
    """(n, 4, 2) corners of n rectangles, counter-clockwise in (x, y)."""
    return np.stack([low, np.stack([high[:, 0], low[:, 1]], 1), high, np.stack([low[:, 0], high[:, 1]], 1)], 1)


def _bend(rows: int, cols: int, warp: Floats, low: Floats, high: Floats, kernel: Floats) -> Floats:
    """How far the warped edges of kernels leave the straight ones: the greatest distance at seven points of each."""
    flat = _corners(low, high) - 0.5
    worst = np.zeros(len(low))
    for share in np.arange(1, 8) / 8.0:
        true = warped(warp, rows, cols, flat + (np.roll(flat, -1, 1) - flat) * share)
        straight = kernel + (np.roll(kernel, -1, 1) - kernel) * share
        worst = np.maximum(worst, np.hypot(*np.moveaxis(true - straight, -1, 0)).max(axis=1))
    return worst


def _all_of_four(valid: Mask) -> Mask:
    """Returns whether all (up to four) children of each parent are valid."""
    padded = np.ones((-(-valid.shape[0] // 2) * 2, -(-valid.shape[1] // 2) * 2), bool)
    padded[: valid.shape[0], : valid.shape[1]] = valid
    return np.asarray(padded.reshape(padded.shape[0] // 2, 2, -1, 2).all(axis=(1, 3)), np.bool_)


def _four_of(parents: Mask, shape: tuple[int, int]) -> Mask:
    """Repeats each parent's value for its children."""
    return parents.repeat(2, 0).repeat(2, 1)[: shape[0], : shape[1]]


STRAIGHT_AT_ONCE: Final = 1 << 14
"""Kernels whose bend is found at a time: a grid of 14,000 x 14,000 has a million of the smallest."""


def _straight(rows: int, cols: int, warp: Floats | None, scale: int) -> Mask:
    """Kernels of a scale whose edges the lattice's bend leaves straight enough."""
    shape = table_shape(rows, cols, scale)
    if warp is None:
        return np.ones(shape, bool)
    straight = np.empty(shape, np.bool_)
    band = max(1, STRAIGHT_AT_ONCE // shape[1])
    for top in range(0, shape[0], band):
        j, i = np.indices((min(band, shape[0] - top), shape[1])).reshape(2, -1)
        bend = lay(rows, cols, warp, scale, top + j, i).bend
        straight[top : top + band] = (bend <= MAX_BEND * (1 << level_of(scale))).reshape(-1, shape[1])
    return straight


def existing(rows: int, cols: int, levels: int, warp: Floats | None, whole: Mask | None) -> tuple[Mask, ...]:
    """Which patches a grid has, a table for each scale.

    ``whole``: which of the smallest kernels have no nodata; None if there is none in the grid. Full patches are where
    their kernels are whole and straight, the smaller ones of the grid's own level where a greater one could not be;
    the smallest are made however the lattice bends.
    """
    valid = np.ones(table_shape(rows, cols, 0), bool) if whole is None else whole
    wholes = [valid]
    for _ in range(1, levels + SMALL_SCALES):
        wholes.append(_all_of_four(wholes[-1]))
    tables = [mask if t < 1 else mask & _straight(rows, cols, warp, t) for t, mask in enumerate(wholes)]
    taken = tables[SMALL_SCALES]
    for t in range(SMALL_SCALES - 1, -1, -1):
        inside = _four_of(taken, tables[t].shape)
        tables[t] = tables[t] & ~inside
        taken = tables[t] | inside
    for t in range(SMALL_SCALES):
        if not tables[t].any():
            tables[t] = np.zeros((0, 0), bool)
    return tuple(tables)
