"""Blending of patches: f = sum P W / sum W (paper 2 section 3.2, equation 1), on lattices of samples.

The weight of a patch is the tensor product of w(t) over its domain, t from -1 to 1 on each axis, divided by the area of
the domain (unit volume): w = 1 - |t| with bilinear patches, so that f is continuous; w = (1 - |t|)^3 (3 |t| + 1) with
bicubic ones, so that f is twice continuously differentiable (paper 2, section 4.1). The domain is the patch's kernel
grown by its margin, a rectangle of any half sides.

Cover = 1 - prod (1 - q_i), where q_i is 1 in the kernel of patch i and falls to 0 (quintic, C2) over its margin: 1 on
the data, 0 where no patch says anything, and smooth. ``outside`` joins the ground beyond the data by it.

Patches *stand* at the greater of their error and the tolerance of the cut. Where one stands higher than others its
weight is multiplied by prod (1 - q_i) of those that stand lower: a patch that serves below its error, because nothing
better covers all of its kernel, gives way where something better is. The paper has no such patches; without the rule
they would show through wherever weights are small, at the edges of all kernels.

A lattice is cut into bins of ``BIN`` x ``BIN`` samples, counted from sample [0, 0] of the domain. A bin is computed
whole from the patches whose domain meets it, in the order of their identities: its bits depend on these patches only,
not on what else is asked for with it, nor on threads. Twins: ``blend_reference`` (float64), ``blend_device`` (OpenCL).
"""

from __future__ import annotations

import functools
import hashlib
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from esker.contract import PATCH_MARGIN_CELLS, Layer
from esker.patchwork.blend.device import ClDevice, program
from esker.patchwork.blend.loops import BIN, bin_patches, fill_patches, linear_bins, smooth_bins
from esker.patchwork.blend.packs import Bins, Pack
from esker.patchwork.blend.splines import STRIDE
from esker.patchwork.jit import bands, spread
from esker.patchwork.lod.space import Model


class Lattice(NamedTuple):
    """Samples ``[row, col]`` at world ``(col * spacing, row * spacing)``: rows row0..row1, columns col0..col1."""

    spacing: float
    row0: int
    row1: int
    col0: int
    col1: int

    @property
    def shape(self) -> tuple[int, int]:
        """Samples in the two directions."""
        return self.row1 - self.row0, self.col1 - self.col0

    @property
    def bins(self) -> tuple[int, int, int, int]:
        """Rows and columns of bins that hold it, half open: row0, row1, col0, col1."""
        return self.row0 // BIN, -(-self.row1 // BIN), self.col0 // BIN, -(-self.col1 // BIN)

    def rect(self) -> tuple[float, float, float, float]:
        """x0, y0, x1, y1 in metres of all samples of its bins."""
        r0, r1, c0, c1 = self.bins
        s = self.spacing
        return c0 * BIN * s, r0 * BIN * s, (c1 * BIN - 1) * s, (r1 * BIN - 1) * s


def pack(model: Model, index: NDArray[np.int32], smooth: bool, tolerance: float = np.inf, bent: bool = False) -> Pack:
    """The patches ``index`` of a model, chosen at ``tolerance`` metres, with their coefficients.

    Without a tolerance all stand equal, whatever their errors. ``bent``: they go on beyond their grids with the bend
    that these have there (``samples.cut``).
    """
    standing = np.maximum(model.min_z[index], tolerance)
    order = np.lexsort((identities(model, index), standing))
    index, standing = index[order], standing[order]
    rank = np.concatenate([[0], np.cumsum(standing[1:] != standing[:-1])])[: len(index)].astype(np.int32)
    to_patch, side = model.to_patch[index], model.side[index].astype(np.int32)
    inner, domain = extents(model.kernel[index], to_patch, side)
    half = np.stack([domain[:, 1] - domain[:, 0], domain[:, 3] - domain[:, 2]], axis=1) / 2
    turn = np.abs(to_patch[:, 0, 0] * to_patch[:, 1, 1] - to_patch[:, 0, 1] * to_patch[:, 1, 0])
    coefficients = _coefficients(model, index, smooth, bent)
    volume = turn / (half[:, 0] * half[:, 1])
    return Pack(smooth, coefficients, to_patch, domain, inner, volume, side, rank, model.owner[index])


def _coefficients(model: Model, index: NDArray[np.int32], smooth: bool, bent: bool) -> NDArray[np.float32]:
    """``Pack.coefficients`` of patches, mipmap by mipmap."""
    stored = np.zeros((len(index), STRIDE, STRIDE), dtype=np.float32)
    groups = model.owner[index].astype(np.int64) * 64 + model.level[index]
    order = np.lexsort((index, groups))  # neighbours follow each other: samples are read once
    for part in np.split(order, np.flatnonzero(np.diff(groups[order])) + 1) if len(order) else []:
        first = index[part[0]]
        placed = model.placed[model.owner[first]]
        mip, layer = placed.raster.mips[model.level[first]], placed.layer
        chosen = index[part]
        rows, cols, sides = model.row[chosen], model.col[chosen], model.side[chosen]

        args = (mip, rows, cols, sides, part, layer.scale, layer.lift_m, smooth, bent, stored)
        fill = functools.partial(fill_patches, *args)
        spread(fill, bands(len(part), 64))
    return stored


def extents(
    kernel: NDArray[np.float64], to_patch: NDArray[np.float64], side: NDArray[np.int32]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Kernel and domain, float64 (n, 4) as u0, u1, v0, v1, of patches with world kernels (n, 4, 2).

    A bent grid's kernel is not quite a rectangle in the patch's frame: the one around it is taken, no gap can open.
    """
    places = np.einsum("nij,nkj->nki", to_patch[:, :, :2], kernel) + to_patch[:, None, :, 2]
    low, high = places.min(axis=1), places.max(axis=1)
    end = (side - 1.0)[:, None]
    grown_low, grown_high = np.maximum(low - PATCH_MARGIN_CELLS, 0.0), np.minimum(high + PATCH_MARGIN_CELLS, end)
    order = [0, 2, 1, 3]
    inner, outer = np.hstack([low, high])[:, order], np.hstack([grown_low, grown_high])[:, order]
    return np.ascontiguousarray(inner), np.ascontiguousarray(outer)  # one kind of array for the compiled loops


def identities(model: Model, index: NDArray[np.int32]) -> NDArray[np.uint64]:
    """A number for every patch of ``index`` that says what it is: same grid, place and samples, same number."""
    layers = np.array([layer_number(p.layer) for p in model.placed] or [0], dtype=np.uint64)
    words = (model.level[index].astype(np.uint64) << np.uint64(56)) ^ (
        model.side[index].astype(np.uint64) << np.uint64(48)
    )
    words ^= (model.row[index].astype(np.int64) + 64).astype(np.uint64) << np.uint64(24)
    words ^= (model.col[index].astype(np.int64) + 64).astype(np.uint64)
    return _mixed(words ^ layers[model.owner[index]])


def layer_number(layer: Layer) -> int:
    """Returns a number that follows from all that the heights of a layer's patches follow from."""
    text = repr((layer.content, layer.anchor, layer.rotation_deg, layer.spacing_m, layer.scale, layer.lift_m))
    return int.from_bytes(hashlib.blake2b(text.encode(), digest_size=8).digest(), "little")


def _mixed(x: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """SplitMix64's finaliser: one to one on 64 bits."""
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return x ^ (x >> np.uint64(31))


def bins(packed: Pack, lattice: Lattice) -> Bins:
    """Finds which patches meet which bin of a lattice."""
    r0, r1, c0, c1 = lattice.bins
    count = (r1 - r0) * (c1 - c0)
    found = np.zeros(count + 1, dtype=np.int64)
    reach = (BIN - 1) * lattice.spacing
    args = (packed.to_patch, packed.domain, BIN * lattice.spacing, reach, r0, r1, c0, c1)
    bin_patches(*args, found, np.empty(0, np.int32), np.empty((0, 2), np.float32))
    start = np.cumsum(found)
    patch = np.empty(start[-1], dtype=np.int32)
    origin = np.empty((start[-1], 2), dtype=np.float32)
    bin_patches(*args, start.copy(), patch, origin)
    to = packed.to_patch * lattice.spacing
    step = np.stack([to[:, 0, 0], to[:, 1, 0], to[:, 0, 1], to[:, 1, 1]], axis=1)
    return Bins(start.astype(np.int32), patch, origin, np.ascontiguousarray(step, dtype=np.float32))


def evaluate(
    packed: Pack, lattice: Lattice, device: ClDevice | None = None
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Blended heights and cover on a lattice, float32 ``lattice.shape`` each; heights are 0 where the cover is 0.

    Without a device by compiled loops. Raises pyopencl errors for a device that does not work.
    """
    found, constants = bins(packed, lattice), per_patch(packed)
    r0, r1, c0, c1 = lattice.bins
    rows, cols = r1 - r0, c1 - c0
    if device is not None:
        built = program(device, packed.smooth)
        heights, cover = built.run(device.queue, packed, constants, found, (rows, cols))
    else:
        heights = np.empty((rows * BIN, cols * BIN), dtype=np.float32)
        cover = np.empty_like(heights)
        work = smooth_bins if packed.smooth else linear_bins

        def some(start: int, stop: int) -> None:
            work(found.start, found.patch, found.origin, found.step, packed.coefficients, constants, packed.side,
                 packed.rank, cols, start, stop, heights, cover)  # fmt: skip

        spread(some, bands(rows * cols, 4))
    top, left = lattice.row0 - r0 * BIN, lattice.col0 - c0 * BIN
    crop = (slice(top, top + lattice.shape[0]), slice(left, left + lattice.shape[1]))
    return heights[crop], cover[crop]


def per_patch(packed: Pack) -> NDArray[np.float32]:
    """float32 (n, 9): the domain's middle u, v, one over its half sides in samples, kernel u0, u1, v0, v1, volume."""
    d = packed.domain
    half = np.stack([d[:, 1] - d[:, 0], d[:, 3] - d[:, 2]], axis=1) / 2
    middle = np.stack([d[:, 1] + d[:, 0], d[:, 3] + d[:, 2]], axis=1) / 2
    return np.hstack([middle, 1 / half, packed.kernel, packed.volume[:, None]]).astype(np.float32)
