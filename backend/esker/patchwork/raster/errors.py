"""Own errors of the patches of one grid, compiled (paper 2, section 3.1: delta, and 4.1).

The error of a patch is the greatest distance between a valid sample of the grid in the patch's domain, at its true
place, and the patch, whose samples are interpolated bilinearly. ``errors_reference`` is the plain twin.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from esker.contract import PATCH_KERNEL_CELLS
from esker.patchwork.jit import bands, kernel, read_only, spread
from esker.patchwork.raster import paging, patches, rim
from esker.patchwork.raster.patches import Floats, PatchErrors
from esker.patchwork.raster.samples import beyond, cut, row_beyond

Heights = NDArray[np.float32]
Ints = NDArray[np.int64]
PART_ROWS: Final = 256
"""Rows of samples that a patch is measured at in one go, at most."""
NO_WARP = read_only(np.zeros((0, 0, 2)))


@kernel
def _any_nodata(heights: Heights, start: int, stop: int, out: NDArray[np.bool_]) -> None:
    for row in range(start, stop):
        line = heights[row]
        total = np.float32(0.0)
        for col in range(line.size):
            total += line[col] * np.float32(0.0)
        if np.isnan(total):
            out[row] = True


@kernel
def _whole_kernels(heights: Heights, size: int, start: int, stop: int, out: NDArray[np.bool_]) -> None:
    rows, cols = heights.shape
    for j in range(start, stop):
        for row in range(size * j, min(size * (j + 1), rows)):
            for col in range(cols):
                if np.isnan(heights[row, col]):
                    out[j, col // size] = False


def whole_kernels(heights: Heights) -> NDArray[np.bool_] | None:
    """Finds which of the smallest kernels of a grid hold no nodata; None if the grid holds none at all."""
    rows, cols = heights.shape
    holed = np.zeros(rows, np.bool_)
    paging.sweep(lambda a, b: _any_nodata(heights, a, b, holed), heights, 64)
    if not holed.any():
        return None
    out = np.ones(patches.table_shape(rows, cols, 0), np.bool_)
    size = patches.SMALLEST_KERNEL
    paging.sweep(lambda a, b: _whole_kernels(heights, size, a, b, out), heights, 1, size)
    return out


@kernel
def _level_errors(heights: Heights, mip: Heights, level: int, parts: Ints, start: int, stop: int, out: Heights) -> None:
    """Errors of the patches of a level >= 1, for grids without nodata and warp, in float32.

    ``parts`` (n, 3): a row of patches, and rows of samples, first and end, that it is measured at; those of the patches
    of part k go to ``out[k]``.

    A row of samples lies between two rows of the mipmap level: these are mixed first, then stretched to the samples'
    spacing, and the greatest distance is kept for each column of the band. Patches take theirs from that.
    """
    cols = heights.shape[1]
    mip_rows, mip_cols = mip.shape
    step, half = 1 << level, 1 << (level - 1)
    size = PATCH_KERNEL_CELLS * step
    margin = 3 * half
    mixed = np.empty(mip_cols + 2, np.float32)
    stretched = np.empty((mip_cols + 1) * step, np.float32)
    worst = np.empty(cols, np.float32)
    south, north = np.empty(mip_cols + 2, np.float32), np.empty(mip_cols + 2, np.float32)
    row_beyond(mip, True, -1, south)
    row_beyond(mip, False, -1, north)
    share = np.empty(step, np.float32)
    for phase in range(step):
        share[phase] = (phase + 0.5) / step
    for k in range(start, stop):
        for col in range(cols):
            worst[col] = 0.0
        for row in range(parts[k, 1], parts[k, 2]):
            cell = (row + half) // step - 1
            part = share[(row + half) % step]
            low = mip[cell] if cell >= 0 else south[1:-1]
            high = mip[cell + 1] if cell + 1 < mip_rows else north[1:-1]
            _mix(low, high, part, mixed[1:-1])
            for first in (True, False):
                end = 0 if first else mip_cols + 1
                near = beyond(low, first) if cell >= 0 else south[end]
                far = beyond(high, first) if cell + 1 < mip_rows else north[end]
                mixed[end] = near + (far - near) * part
            if step == 2:
                _stretch_twice(mixed, stretched)
            elif step == 4:
                _stretch_four_times(mixed, stretched)
            else:
                _stretch(mixed, share, stretched)
            # Samples begin half a cell after the first, which lies beyond the border.
            _raise(heights[row], stretched[half : half + cols], worst)
        for i in range(out.shape[1]):
            greatest = np.float32(0.0)
            for col in range(max(0, size * i - margin), min(cols, size * (i + 1) + margin)):
                greatest = max(greatest, worst[col])
            out[k, i] = greatest


@kernel
def _mix(low: Heights, high: Heights, part: np.float32, mixed: Heights) -> None:
    """The row between two rows of a level."""
    for k in range(low.size):
        mixed[k] = low[k] + (high[k] - low[k]) * part


@kernel
def _stretch(mixed: Heights, share: Heights, out: Heights) -> None:
    """Interpolate ``share.size`` samples between each two of ``mixed``."""
    step = share.size
    for k in range(mixed.size - 1):
        value = mixed[k]
        rise = mixed[k + 1] - value
        part = out[k * step : (k + 1) * step]
        for t in range(step):
            part[t] = value + rise * share[t]


@kernel
def _stretch_twice(mixed: Heights, out: Heights) -> None:
    """:func:`_stretch` by 2, as one loop that runs on many samples at once."""
    after = mixed[1:]
    for k in range(after.size):
        value = mixed[k]
        rise = after[k] - value
        out[2 * k] = value + rise * np.float32(0.25)
        out[2 * k + 1] = value + rise * np.float32(0.75)


@kernel
def _stretch_four_times(mixed: Heights, out: Heights) -> None:
    """:func:`_stretch` by 4, as one loop that runs on many samples at once."""
    after = mixed[1:]
    for k in range(after.size):
        value = mixed[k]
        rise = after[k] - value
        out[4 * k] = value + rise * np.float32(0.125)
        out[4 * k + 1] = value + rise * np.float32(0.375)
        out[4 * k + 2] = value + rise * np.float32(0.625)
        out[4 * k + 3] = value + rise * np.float32(0.875)


@kernel
def _raise(line: Heights, stretched: Heights, worst: Heights) -> None:
    """Raise ``worst`` to the distance of each sample of a row from the stretched one."""
    for col in range(worst.size):
        distance = abs(line[col] - stretched[col])
        known = worst[col]
        worst[col] = distance if distance > known else known


@kernel
def segment(
    warp: Floats, rows: int, cols: int, m: Floats, row: int, col: int
) -> tuple[int, float, float, float, float]:
    """Where the samples of a row lie in a patch, from a column up to where the control net has its next one.

    ``m``: (warped) lattice to patch. Returns that column, and u = a + b col, v = c + d col. The net is empty for none.
    """
    if warp.shape[0] == 0:
        return cols, m[0, 1] * row + m[0, 2], m[0, 0], m[1, 1] * row + m[1, 2], m[1, 0]
    wide = (warp.shape[1] - 1) / (cols - 1)
    b = row * ((warp.shape[0] - 1) / (rows - 1))
    i = min(int(col * wide), warp.shape[1] - 2)
    j = min(int(b), warp.shape[0] - 2)
    g = b - j
    x0 = warp[j, i, 0] + (warp[j + 1, i, 0] - warp[j, i, 0]) * g
    x1 = warp[j, i + 1, 0] + (warp[j + 1, i + 1, 0] - warp[j, i + 1, 0]) * g
    y0 = warp[j, i, 1] + (warp[j + 1, i, 1] - warp[j, i, 1]) * g
    y1 = warp[j, i + 1, 1] + (warp[j + 1, i + 1, 1] - warp[j, i + 1, 1]) * g
    # Displacement = x0 + (x1 - x0) (col wide - i): a line in col.
    xs, ys = (x1 - x0) * wide, (y1 - y0) * wide
    x, y = x0 - (x1 - x0) * i, row + y0 - (y1 - y0) * i
    end = cols if i == warp.shape[1] - 2 else min(cols, max(col + 1, int(np.ceil((i + 1) / wide))))
    return (
        end,
        m[0, 0] * x + m[0, 1] * y + m[0, 2],
        m[0, 0] * (1.0 + xs) + m[0, 1] * ys,
        m[1, 0] * x + m[1, 1] * y + m[1, 2],
        m[1, 0] * (1.0 + xs) + m[1, 1] * ys,
    )


@kernel
def farthest(
    line: Heights,
    gain: float,
    lift: float,
    block: Floats,
    ends: tuple[float, float],
    at: tuple[float, float, float, float],
    first: int,
    last: int,
) -> float:
    """Greatest distance of samples first..last of a row from a patch, -1 if none of them lies in its domain.

    ``block``: the patch's samples; sample c of the row is gain * line[c] + lift at (at[0] + at[1] c, at[2] + at[3] c).
    """
    worst = -1.0
    end = block.shape[0] - 2
    for col in range(first, last):
        u, v = at[0] + at[1] * col, at[2] + at[3] * col
        if u < 0.0 or v < 0.0 or u > ends[0] or v > ends[1]:
            continue
        i, j = min(int(u), end), min(int(v), end)
        f, g = u - i, v - j
        near = block[j, i] + (block[j, i + 1] - block[j, i]) * f
        far = block[j + 1, i] + (block[j + 1, i + 1] - block[j + 1, i]) * f
        distance = abs(gain * line[col] + lift - (near + (far - near) * g))
        if distance > worst:  # never for nodata, which is NaN
            worst = distance
    return worst


@kernel
def _patch_errors(
    heights: Heights,
    mip: Heights,
    warp: Floats,
    step: int,
    kernels: Ints,
    to_patch: Floats,
    extent: Floats,
    parts: Ints,
    start: int,
    stop: int,
    out: Heights,
) -> None:
    """Errors of patches of a level, whatever the grid: float64, sample by sample.

    ``kernels`` (n, 4): row, column, rows, columns in samples of ``mip``; ``parts`` (m, 3) as :func:`_level_errors`, of
    patches instead of rows of patches; ``out[k]`` is for part k.
    """
    rows, cols = heights.shape
    # Half a sample and the margin around the kernel; one cell of the level more for what a bent lattice brings in.
    reach = 2 * step + (step if warp.shape[0] else 0)
    block = np.empty((0, 0), np.float32)
    exact = np.empty((0, 0))
    for k in range(start, stop):
        p = parts[k, 0]
        side = max(kernels[p, 2], kernels[p, 3]) + 4
        if side != len(block):
            block, exact = np.empty((side, side), np.float32), np.empty((side, side))
        cut(mip, kernels[p, 0] - 2, kernels[p, 1] - 2, block, False)
        for r in range(side):
            for c in range(side):
                exact[r, c] = block[r, c]
        left = kernels[p, 1] * step
        right = min(cols, left + kernels[p, 3] * step + reach)
        ends = (extent[p, 0], extent[p, 1])
        worst = 0.0
        for row in range(parts[k, 1], parts[k, 2]):
            col = max(0, left - reach)
            while col < right:
                end, a, b, c0, d = segment(warp, rows, cols, to_patch[p], row, col)
                last = min(end, right)
                worst = max(worst, farthest(heights[row], 1.0, 0.0, exact, ends, (a, b, c0, d), col, last))
                col = last
        out[k] = worst


def measure(
    mips: tuple[Heights, ...],
    warp: Floats | None = None,
    progress: Callable[[float], None] | None = None,
) -> PatchErrors:
    """Errors of every patch of the grid ``mips[0]`` (its levels: ``mipmaps.mipmaps``). ``progress``: share done."""
    heights = mips[0]
    rows, cols = heights.shape
    whole = whole_kernels(heights)
    plain = whole is None and warp is None
    tables: list[Heights] = []
    exist = patches.existing(rows, cols, len(mips), warp, whole)
    for scale, there in enumerate(exist):
        level = patches.level_of(scale)
        table = np.full(there.shape, np.nan, np.float32)
        if plain and level:
            table[:] = _by_rows(heights, mips[level], level, *there.shape)
        elif warp is None and not level:
            table[there] = 0.0
        else:
            table[there] = _each(mips, warp, scale, there)
        tables.append(table)
        if progress:
            progress((scale + 1) / len(exist))
    found = rim.find(heights, whole)
    return PatchErrors(tuple(tables), found, rim_errors(heights, warp, found))


def _by_rows(heights: Heights, mip: Heights, level: int, tall: int, wide: int) -> Heights:
    """Errors (tall, wide) of all patches of a level of a grid without nodata and warp."""
    rows = len(heights)
    margin = 3 << level - 1
    low = np.arange(tall) * (PATCH_KERNEL_CELLS << level)
    parts, of = _parts(np.maximum(low - margin, 0), np.minimum(low + (PATCH_KERNEL_CELLS << level) + margin, rows))
    out = np.empty((len(parts), wide), np.float32)
    _spread(lambda a, b: _level_errors(heights, mip, level, parts, a, b, out), heights, mip, level, parts)
    return np.maximum.reduceat(out, of, axis=0)


def _each(mips: tuple[Heights, ...], warp: Floats | None, scale: int, there: NDArray[np.bool_]) -> Heights:
    """Errors of the existing patches of a scale, measured sample by sample."""
    j, i = np.nonzero(there)
    rows, cols = mips[0].shape
    level, size = patches.level_of(scale), patches.kernel_samples(scale)
    kernels = np.stack([j * size, i * size, np.full_like(j, size), np.full_like(i, size)], 1)
    return _exactly(mips[0], mips[level], warp, level, kernels, patches.lay(rows, cols, warp, scale, j, i))


def rim_errors(heights: Heights, warp: Floats | None, found: rim.Boxes) -> Heights:
    """Errors of the patches of the rim: none unless the lattice is bent."""
    if warp is None:
        return np.zeros(len(found), np.float32)
    rows, cols = heights.shape
    laid = patches.lay_rim(rows, cols, warp, found)
    return _exactly(heights, heights, warp, 0, found.astype(np.int64), laid)


def _exactly(
    heights: Heights, mip: Heights, warp: Floats | None, level: int, kernels: Ints, laid: patches.Lattice
) -> Heights:
    """Errors of patches with ``kernels`` (n, 4) of a level, sample by sample."""
    if not len(kernels):
        return np.empty(0, np.float32)
    step = 1 << level
    reach = 2 * step + (step if warp is not None else 0)
    low, high = kernels[:, 0] * step, (kernels[:, 0] + kernels[:, 2]) * step
    parts, of = _parts(np.maximum(low - reach, 0), np.minimum(high + reach, len(heights)))
    net = NO_WARP if warp is None else warp
    matrix, extent = laid.to_patch, laid.extent
    out = np.empty(len(parts), np.float32)

    def work(start: int, stop: int) -> None:
        _patch_errors(heights, mip, net, step, kernels, matrix, extent, parts, start, stop, out)

    _spread(work, heights, mip, level, parts)
    return np.maximum.reduceat(out, of)


def _parts(low: Ints, high: Ints) -> tuple[Ints, Ints]:
    """Rows low..high (n,) of patches in parts of ``PART_ROWS`` at most, (m, 3), and the first part of each patch.

    Great patches are shared out so, and pages of mapped heights are let go in between.
    """
    each = -(-(high - low) // PART_ROWS)
    of = np.concatenate([[0], np.cumsum(each)]).astype(np.int64)
    patch = np.repeat(np.arange(len(low)), each)
    part = np.arange(of[-1]) - of[patch]
    start = low[patch] + (high - low)[patch] * part // each[patch]
    stop = low[patch] + (high - low)[patch] * (part + 1) // each[patch]
    return np.stack([patch, start, stop], 1).astype(np.int64), of[:-1]


def _spread(work: Callable[[int, int], None], heights: Heights, mip: Heights, level: int, parts: Ints) -> None:
    """Call ``work`` for ranges of parts that cover them; where heights are mapped, let go of their rows behind it."""

    def one(start: int, stop: int) -> None:
        work(start, stop)
        first, end = int(parts[start:stop, 1].min()), int(parts[start:stop, 2].max())
        paging.let_go(heights, first, end)
        paging.let_go(mip, first >> level, (end >> level) + 1)

    if paging.mapped(heights):
        cuts = np.flatnonzero(np.diff(parts[:, 1] // paging.strip_rows(heights))) + 1
        edges = [0, *cuts.tolist(), len(parts)]
        spread(one, itertools.pairwise(edges))
    else:
        tallest = int((parts[:, 2] - parts[:, 1]).max())
        spread(work, bands(len(parts), max(1, PART_ROWS // tallest)))
