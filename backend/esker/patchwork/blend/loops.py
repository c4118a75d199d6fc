"""The blend's compiled loops (see ``blend``): which patches meet which bin, and the sums over a bin's patches.

Columns of a bin that a patch reaches are known before they are visited. All is exact IEEE arithmetic in a fixed order.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from esker.contract import PATCH_MARGIN_CELLS, PATCH_SAMPLES
from esker.patchwork.blend.splines import STRIDE, prefilter
from esker.patchwork.jit import kernel
from esker.patchwork.raster.samples import cut

BIN: Final = 32
"""Samples along one side of a bin."""
_SLACK: Final = 1e-6
"""Patch cells by which bins are met more generously than needed: a patch too many changes nothing."""


@kernel
def bin_patches(
    to_patch: NDArray[np.float64],
    domain: NDArray[np.float64],
    pitch: float,
    reach: float,
    r0: int,
    r1: int,
    c0: int,
    c1: int,
    at: NDArray[np.int64],
    patch: NDArray[np.int32],
    origin: NDArray[np.float32],
) -> None:
    """Count patches a bin into ``at[1:]``, or, where ``patch`` has room, write them behind ``at``, in order."""
    write = patch.size > 0
    for k in range(to_patch.shape[0]):
        a, b, c = to_patch[k, 0, 0], to_patch[k, 0, 1], to_patch[k, 0, 2]
        d, e, f = to_patch[k, 1, 0], to_patch[k, 1, 1], to_patch[k, 1, 2]
        u0, u1 = domain[k, 0] - _SLACK, domain[k, 1] + _SLACK
        v0, v1 = domain[k, 2] - _SLACK, domain[k, 3] + _SLACK
        det = a * e - b * d
        low_x, high_x, low_y, high_y = np.inf, -np.inf, np.inf, -np.inf
        for corner in range(4):
            u = (u0 if corner < 2 else u1) - c
            v = (v0 if corner % 2 == 0 else v1) - f
            x, y = (e * u - b * v) / det, (a * v - d * u) / det
            low_x, high_x, low_y, high_y = min(low_x, x), max(high_x, x), min(low_y, y), max(high_y, y)
        # Extents of a bin in the patch's frame: for the separating axes that are the patch's own.
        wide_u, wide_v = (abs(a) + abs(b)) * reach / 2, (abs(d) + abs(e)) * reach / 2
        first_row = max(r0, int(np.floor((low_y - reach) / pitch)))
        last_row = min(r1 - 1, int(np.floor(high_y / pitch)))
        first_col = max(c0, int(np.floor((low_x - reach) / pitch)))
        last_col = min(c1 - 1, int(np.floor(high_x / pitch)))
        for row in range(first_row, last_row + 1):
            for col in range(first_col, last_col + 1):
                x, y = col * pitch, row * pitch
                mid_u = a * (x + reach / 2) + b * (y + reach / 2) + c
                mid_v = d * (x + reach / 2) + e * (y + reach / 2) + f
                if mid_u + wide_u < u0 or mid_u - wide_u > u1 or mid_v + wide_v < v0 or mid_v - wide_v > v1:
                    continue
                place = (row - r0) * (c1 - c0) + col - c0
                if write:
                    patch[at[place]] = k
                    origin[at[place], 0] = a * x + b * y + c
                    origin[at[place], 1] = d * x + e * y + f
                    at[place] += 1
                else:
                    at[place + 1] += 1


@kernel
def fill_patches(
    mip: NDArray[np.float32],
    rows: NDArray[np.int32],
    cols: NDArray[np.int32],
    sides: NDArray[np.int8],
    places: NDArray[np.int64],
    scale: float,
    lift: float,
    smooth: bool,
    bent: bool,
    stored: NDArray[np.float32],
    start: int,
    stop: int,
) -> None:
    """Coefficients ``stored[places[k]]`` of the patches start..stop of one mipmap level."""
    heights = np.empty((PATCH_SAMPLES, PATCH_SAMPLES))
    for k in range(start, stop):
        side = int(sides[k])
        if not _plain_patch(mip, rows[k], cols[k], side, scale, lift, heights):
            samples = np.empty((side, side), np.float32)
            cut(mip, rows[k], cols[k], samples, bent)
            for r in range(side):
                for c in range(side):
                    heights[r, c] = np.float64(samples[r, c]) * scale + lift
        if smooth:
            prefilter(heights, side, stored[places[k]])
        else:
            for r in range(side):
                for c in range(side):
                    stored[places[k], r, c] = heights[r, c]


@kernel
def _plain_patch(
    mip: NDArray[np.float32], row: int, col: int, side: int, scale: float, lift: float, heights: NDArray[np.float64]
) -> bool:
    """The samples of a patch that lies inside its level and holds no nodata; False for any other."""
    if row < 0 or col < 0 or row + side > mip.shape[0] or col + side > mip.shape[1]:
        return False
    total = np.float32(0)
    for r in range(side):
        source, out = mip[row + r], heights[r]
        for c in range(side):
            total += np.float32(0) * source[col + c]
            out[c] = source[col + c] * scale + lift
    return not np.isnan(total)


@kernel
def fade(outside: np.float32) -> np.float32:
    """1 where ``outside`` (distance from the kernel over the margin) <= 0, 0 from 1 on; a quintic smoothstep."""
    t = min(max(np.float32(1) - outside, np.float32(0)), np.float32(1))
    return t * t * t * (t * (t * np.float32(6) - np.float32(15)) + np.float32(10))


@kernel
def _span(at: np.float32, step: np.float32, middle: np.float32, per: np.float32) -> tuple[int, int]:
    """Columns of a bin's row, half open and one to spare, where |at + step * col - middle| * per < 1."""
    reach = np.float32(1) / per
    if abs(step) * np.float32(BIN) < np.float32(1e-6):
        return (0, BIN) if abs(at - middle) <= reach * np.float32(1.001) else (0, 0)
    a, b = (middle - reach - at) / step, (middle + reach - at) / step
    low, high = min(a, b), max(a, b)
    first = int(min(max(low, np.float32(0)), np.float32(BIN)))
    last = int(min(max(high + np.float32(2), np.float32(0)), np.float32(BIN)))
    return (first, last) if last > first else (0, 0)


@kernel
def columns(
    u: np.float32, v: np.float32, du: np.float32, dv: np.float32, constants: NDArray[np.float32]
) -> tuple[int, int]:
    """Columns of a bin's row that a patch reaches, half open."""
    a, b = _span(u, du, constants[0], constants[2])
    c, d = _span(v, dv, constants[1], constants[3])
    return max(a, c), min(b, d)


@kernel
def copy_bin(source: NDArray[np.float32], target: NDArray[np.float32]) -> None:
    """Copy values of a bin. Numba takes seconds to compile the assignment of one array to a slice of another."""
    for row in range(BIN):
        for col in range(BIN):
            target[row, col] = source[row, col]


@kernel
def smooth_bins(
    start: NDArray[np.int32],
    patch: NDArray[np.int32],
    origin: NDArray[np.float32],
    step: NDArray[np.float32],
    coefficients: NDArray[np.float32],
    constants: NDArray[np.float32],
    side: NDArray[np.int32],
    rank: NDArray[np.int32],
    cols: int,
    first: int,
    last: int,
    heights: NDArray[np.float32],
    cover: NDArray[np.float32],
) -> None:
    """Bicubic patches: bins ``first`` to ``last`` of a lattice with ``cols`` bins a row."""
    one, three = np.float32(1), np.float32(3)
    zero, margin = np.float32(0), np.float32(1.0 / PATCH_MARGIN_CELLS)
    above = np.empty((BIN, BIN), np.float32)
    below = np.empty((BIN, BIN), np.float32)
    bare = np.empty((BIN, BIN), np.float32)
    veil = np.empty((BIN, BIN), np.float32)
    z = np.empty(BIN, np.float32)
    for at in range(first, last):
        above[:], below[:], bare[:], veil[:] = 0, 0, 1, 1
        for entry in range(start[at], start[at + 1]):
            k = patch[entry]
            if entry > start[at] and rank[k] != rank[patch[entry - 1]]:
                copy_bin(bare, veil)
            c = coefficients[k].ravel()
            mid_u, mid_v, per_u, per_v, ku0, ku1, kv0, kv1, volume = constants[k]
            du, dv = step[k, 0], step[k, 1]
            for row in range(BIN):
                u_row = origin[entry, 0] + step[k, 2] * np.float32(row)
                v_row = origin[entry, 1] + step[k, 3] * np.float32(row)
                begin, done = columns(u_row, v_row, du, dv, constants[k])
                _smooth_row(c, u_row, v_row, du, dv, np.int32(side[k] - 2), begin, done, z)
                over, under, free, lets = above[row], below[row], bare[row], veil[row]
                for col in range(begin, done):
                    u, v = u_row + du * np.float32(col), v_row + dv * np.float32(col)
                    tu, tv = abs(u - mid_u) * per_u, abs(v - mid_v) * per_v
                    su, sv = max(one - tu, zero), max(one - tv, zero)
                    weight = su * su * su * (three * tu + one) * volume
                    weight *= sv * sv * sv * (three * tv + one) * lets[col]
                    over[col] += weight * z[col]
                    under[col] += weight
                    free[col] *= one - fade(max(ku0 - u, u - ku1) * margin) * fade(max(kv0 - v, v - kv1) * margin)
        _finish(at, cols, above, below, bare, heights, cover)


@kernel
def _smooth_row(
    c: NDArray[np.float32],
    u_row: np.float32,
    v_row: np.float32,
    du: np.float32,
    dv: np.float32,
    end: np.int32,
    begin: int,
    done: int,
    z: NDArray[np.float32],
) -> None:
    """Heights of a bicubic patch with coefficients ``c`` at the columns of a bin's row."""
    zero, one, half, sixth = np.int32(0), np.float32(1), np.float32(0.5), np.float32(1.0 / 6.0)
    two_thirds = np.float32(2.0 / 3.0)
    for col in range(begin, done):
        u, v = u_row + du * np.float32(col), v_row + dv * np.float32(col)
        i, j = min(max(np.int32(u), zero), end), min(max(np.int32(v), zero), end)
        f, g = u - np.float32(i), v - np.float32(j)
        fi, gi = one - f, one - g
        a0, a3 = fi * fi * fi * sixth, f * f * f * sixth
        a1 = two_thirds - f * f * (one - half * f)
        a2 = one - a0 - a1 - a3
        b0, b3 = gi * gi * gi * sixth, g * g * g * sixth
        b1 = two_thirds - g * g * (one - half * g)
        b2 = one - b0 - b1 - b3
        p = j * np.int32(STRIDE) + i
        q, r, t = p + np.int32(STRIDE), p + np.int32(2 * STRIDE), p + np.int32(3 * STRIDE)
        low = b0 * (a0 * c[p] + a1 * c[p + 1] + a2 * c[p + 2] + a3 * c[p + 3])
        low += b1 * (a0 * c[q] + a1 * c[q + 1] + a2 * c[q + 2] + a3 * c[q + 3])
        high = b2 * (a0 * c[r] + a1 * c[r + 1] + a2 * c[r + 2] + a3 * c[r + 3])
        high += b3 * (a0 * c[t] + a1 * c[t + 1] + a2 * c[t + 2] + a3 * c[t + 3])
        z[col] = low + high


@kernel
def linear_bins(
    start: NDArray[np.int32],
    patch: NDArray[np.int32],
    origin: NDArray[np.float32],
    step: NDArray[np.float32],
    coefficients: NDArray[np.float32],
    constants: NDArray[np.float32],
    side: NDArray[np.int32],
    rank: NDArray[np.int32],
    cols: int,
    first: int,
    last: int,
    heights: NDArray[np.float32],
    cover: NDArray[np.float32],
) -> None:
    """Bilinear patches: bins ``first`` to ``last`` of a lattice with ``cols`` bins a row."""
    zero, one, margin = np.float32(0), np.float32(1), np.float32(1.0 / PATCH_MARGIN_CELLS)
    above = np.empty((BIN, BIN), np.float32)
    below = np.empty((BIN, BIN), np.float32)
    bare = np.empty((BIN, BIN), np.float32)
    veil = np.empty((BIN, BIN), np.float32)
    for at in range(first, last):
        above[:], below[:], bare[:], veil[:] = 0, 0, 1, 1
        for entry in range(start[at], start[at + 1]):
            k = patch[entry]
            if entry > start[at] and rank[k] != rank[patch[entry - 1]]:
                copy_bin(bare, veil)
            c = coefficients[k].ravel()
            mid_u, mid_v, per_u, per_v, ku0, ku1, kv0, kv1, volume = constants[k]
            end, du, dv = np.int32(side[k] - 2), step[k, 0], step[k, 1]
            for row in range(BIN):
                u_row = origin[entry, 0] + step[k, 2] * np.float32(row)
                v_row = origin[entry, 1] + step[k, 3] * np.float32(row)
                begin, done = columns(u_row, v_row, du, dv, constants[k])
                for col in range(begin, done):
                    u, v = u_row + du * np.float32(col), v_row + dv * np.float32(col)
                    weight = max(one - abs(u - mid_u) * per_u, zero) * volume
                    weight *= max(one - abs(v - mid_v) * per_v, zero) * veil[row, col]
                    i, j = min(max(np.int32(u), np.int32(0)), end), min(max(np.int32(v), np.int32(0)), end)
                    f, g = u - np.float32(i), v - np.float32(j)
                    p = j * np.int32(STRIDE) + i
                    q = p + np.int32(STRIDE)
                    low = c[p] + (c[p + 1] - c[p]) * f
                    high = c[q] + (c[q + 1] - c[q]) * f
                    above[row, col] += weight * (low + (high - low) * g)
                    below[row, col] += weight
                    near = fade(max(ku0 - u, u - ku1) * margin) * fade(max(kv0 - v, v - kv1) * margin)
                    bare[row, col] *= one - near
        _finish(at, cols, above, below, bare, heights, cover)


@kernel
def _finish(
    at: int,
    cols: int,
    above: NDArray[np.float32],
    below: NDArray[np.float32],
    bare: NDArray[np.float32],
    heights: NDArray[np.float32],
    cover: NDArray[np.float32],
) -> None:
    """Write a bin's heights and cover in its place."""
    top, left = at // cols * BIN, at % cols * BIN
    for row in range(BIN):
        for col in range(BIN):
            empty = below[row, col] <= np.float32(0)
            heights[top + row, left + col] = np.float32(0) if empty else above[row, col] / below[row, col]
            cover[top + row, left + col] = np.float32(0) if empty else np.float32(1) - bare[row, col]
