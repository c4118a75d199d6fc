"""Own errors of the patches of one grid, compiled (paper 2, section 3.1: delta, and 4.1).

The error of a patch is the greatest distance between a valid sample of the grid in the patch's domain, at its true
place, and the patch, whose samples are interpolated bilinearly. ``errors_reference`` is the plain twin.
"""

from __future__ import annotations

import functools
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from esker.contract import PATCH_KERNEL_CELLS
from esker.patchwork import patches
from esker.patchwork.jit import bands, kernel, spread
from esker.patchwork.patches import Floats, PatchErrors
from esker.patchwork.samples import cut

Heights = NDArray[np.float32]
NO_WARP = np.zeros((0, 0, 2))


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
    """Which of the smallest kernels of a grid hold no nodata; None if the grid holds none at all."""
    rows, cols = heights.shape
    holed = np.zeros(rows, np.bool_)
    spread(lambda a, b: _any_nodata(heights, a, b, holed), bands(rows, 64))
    if not holed.any():
        return None
    out = np.ones(patches.table_shape(rows, cols, 0), np.bool_)
    spread(lambda a, b: _whole_kernels(heights, patches.SMALLEST_KERNEL, a, b, out), bands(out.shape[0]))
    return out


@kernel
def _level_errors(heights: Heights, mip: Heights, level: int, start: int, stop: int, out: Heights) -> None:
    """Errors of the patches of rows start..stop of a level >= 1, for grids without nodata and warp, in float32.

    A row of samples lies between two rows of the mipmap level: these are mixed first, then stretched to the samples'
    spacing, and the greatest distance is kept for each column of the band. Patches take theirs from that.
    """
    rows, cols = heights.shape
    mip_rows, mip_cols = mip.shape
    step, half = 1 << level, 1 << (level - 1)
    size = PATCH_KERNEL_CELLS * step
    margin = 3 * half
    mixed = np.empty(mip_cols + 2, np.float32)
    stretched = np.empty((mip_cols + 1) * step, np.float32)
    worst = np.empty(cols, np.float32)
    share = np.empty(step, np.float32)
    for phase in range(step):
        share[phase] = (phase + 0.5) / step
    for j in range(start, stop):
        for col in range(cols):
            worst[col] = 0.0
        for row in range(max(0, size * j - margin), min(rows, size * (j + 1) + margin)):
            cell = (row + half) // step - 1
            _mix(mip[max(cell, 0)], mip[min(cell + 1, mip_rows - 1)], share[(row + half) % step], mixed)
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
            out[j, i] = greatest


@kernel
def _mix(low: Heights, high: Heights, part: np.float32, mixed: Heights) -> None:
    """The row between two rows of a level, with one sample more at each end."""
    inner = mixed[1:-1]
    for k in range(low.size):
        inner[k] = low[k] + (high[k] - low[k]) * part
    mixed[0] = mixed[1]
    mixed[low.size + 1] = mixed[low.size]


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
    level: int,
    size: int,
    j: NDArray[np.int64],
    i: NDArray[np.int64],
    to_patch: Floats,
    extent: Floats,
    start: int,
    stop: int,
    out: Heights,
) -> None:
    """Errors of the patches start..stop of a scale, whatever the grid: float64, sample by sample."""
    rows, cols = heights.shape
    step = 1 << level
    # Half a sample and the margin around the kernel; one cell of the level more for what a bent lattice brings in.
    reach = 2 * step + (step if warp.shape[0] else 0)
    block = np.empty((size + 4, size + 4), np.float32)
    exact = np.empty((size + 4, size + 4))
    for p in range(start, stop):
        cut(mip, j[p] * size - 2, i[p] * size - 2, block)
        for r in range(size + 4):
            for c in range(size + 4):
                exact[r, c] = block[r, c]
        top, left = j[p] * size * step, i[p] * size * step
        right = min(cols, left + size * step + reach)
        ends = (extent[p, 0], extent[p, 1])
        worst = 0.0
        for row in range(max(0, top - reach), min(rows, top + size * step + reach)):
            col = max(0, left - reach)
            while col < right:
                end, a, b, c0, d = segment(warp, rows, cols, to_patch[p], row, col)
                last = min(end, right)
                worst = max(worst, farthest(heights[row], 1.0, 0.0, exact, ends, (a, b, c0, d), col, last))
                col = last
        out[p] = worst


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
            work = functools.partial(_level_errors_into, table, heights, mips[level], level)
            spread(work, bands(len(table), max(1, 256 // (PATCH_KERNEL_CELLS << level))))
        elif warp is None and not level:
            table[there] = 0.0
        else:
            table[there] = _each(mips, warp, scale, there)
        tables.append(table)
        if progress:
            progress((scale + 1) / len(exist))
    return PatchErrors(tuple(tables))


def _level_errors_into(table: Heights, heights: Heights, mip: Heights, level: int, start: int, stop: int) -> None:
    _level_errors(heights, mip, level, start, stop, table)


def _each(mips: tuple[Heights, ...], warp: Floats | None, scale: int, there: NDArray[np.bool_]) -> Heights:
    """Errors of the existing patches of a scale, measured sample by sample."""
    j, i = np.nonzero(there)
    rows, cols = mips[0].shape
    level, size = patches.level_of(scale), patches.kernel_samples(scale)
    laid = patches.lay(rows, cols, warp, scale, j, i)
    net = NO_WARP if warp is None else warp
    out = np.empty(len(j), np.float32)
    matrix, extent = laid.to_patch, laid.extent
    spread(
        lambda a, b: _patch_errors(mips[0], mips[level], net, level, size, j, i, matrix, extent, a, b, out),
        bands(len(j), 16),
    )
    return out
