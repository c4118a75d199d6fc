"""Ground beyond the data: the data's border continued as a membrane, free at the domain's border.

Where the cover m of the patches (see ``blend``) is below 1 the ground is F = m f + (1 - m) O: f the blend, O a membrane
that F's neighbours span, O = mean of the four. So F is f on the data, meets it smoothly over the patches' margins, and
beyond it has no height that the data's border has not: no cliff, wherever nodata or the layer's edge lies.

It is found coarse to fine. Level ``ANCHOR`` is solved as a whole (``membrane``: restricted to ever coarser grids,
solved there, and carried back, with sweeps on each: a cascadic multigrid, Bornemann and Deuflhard 1996). Each finer
level carries the coarser one down with the interpolating 4-point scheme (Dyn, Levin and Gregory 1987), which keeps the
samples that both have, and sweeps a few times with the data that only it resolves. Finer than the data nothing is left
to resolve, and the sweeps change next to nothing: all levels show one function from there on.

Every step is the same exact arithmetic for every sample, so that windows have the bits of whole levels.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from esker.patchwork.blend.jets import spline_jet
from esker.patchwork.jit import bands, kernel, read_only, spread

Grid = NDArray[np.float32]

ANCHOR: Final = 3
"""Level (513 x 513 samples) at which the membrane is solved as a whole."""
SWEEPS: Final = 4
"""Sweeps on each level above ``ANCHOR``."""
_SMALL: Final = 600
"""Rows of a grid that one thread sweeps alone."""
_SWEEPS_BELOW: Final = (16, 64)
"""Sweeps of the cascade on ``ANCHOR``, and at most on a coarser grid: four times as many on each, as they cost that."""


@kernel
def _sweep(before: Grid, heights: Grid, cover: Grid, first: int, last: int, after: Grid) -> None:
    rows, cols = before.shape
    one, quarter = np.float32(1), np.float32(0.25)
    for row in range(first, last):
        south, north = before[max(row - 1, 0)], before[min(row + 1, rows - 1)]
        here, known, m, out = before[row], heights[row], cover[row], after[row]
        for col in range(1, cols - 1):
            mean = ((here[col - 1] + here[col + 1]) + (south[col] + north[col])) * quarter
            out[col] = m[col] * known[col] + (one - m[col]) * mean
        for col in (0, cols - 1):
            west, east = here[max(col - 1, 0)], here[min(col + 1, cols - 1)]
            mean = ((west + east) + (south[col] + north[col])) * quarter
            out[col] = m[col] * known[col] + (one - m[col]) * mean


def relax(ground: Grid, heights: Grid, cover: Grid, sweeps: int) -> Grid:
    """``ground`` after sweeps of F <- m f + (1 - m) mean of four; indices beyond the arrays are clamped."""
    other = np.empty_like(ground)
    heights, cover = read_only(heights), read_only(cover)
    for _ in range(sweeps):
        source, target = ground, other

        def some(start: int, stop: int, source: Grid = source, target: Grid = target) -> None:
            _sweep(source, heights, cover, start, stop, target)

        # Threads take longer to start than a small grid does to sweep.
        spread(some, bands(len(ground), 128) if len(ground) > _SMALL else [(0, len(ground))])
        ground, other = target, source
    return ground


@kernel
def _carry(coarse: Grid, row0: int, col0: int, side: int, r0: int, c0: int, out: Grid) -> None:
    """4-point scheme in both directions. ``coarse[0, 0]`` is sample [row0, col0] of a level of ``side`` samples."""
    near, far = np.float32(9.0 / 16.0), np.float32(-1.0 / 16.0)
    rows, cols = out.shape
    line = np.empty(coarse.shape[1], np.float32)
    for row in range(rows):
        y = (r0 + row) // 2
        if (r0 + row) % 2 == 0:
            for k in range(line.size):
                line[k] = coarse[y - row0, k]
        else:
            a, b = coarse[max(y - 1, 0) - row0], coarse[y - row0]
            c, d = coarse[min(y + 1, side - 1) - row0], coarse[min(y + 2, side - 1) - row0]
            for k in range(line.size):
                line[k] = near * (b[k] + c[k]) + far * (a[k] + d[k])
        for col in range(cols):
            x = (c0 + col) // 2
            if (c0 + col) % 2 == 0:
                out[row, col] = line[x - col0]
            else:
                inner = line[x - col0] + line[min(x + 1, side - 1) - col0]
                outer = line[max(x - 1, 0) - col0] + line[min(x + 2, side - 1) - col0]
                out[row, col] = near * inner + far * outer


def carry(coarse: Grid, row0: int, col0: int, side: int, rows: slice, cols: slice) -> Grid:
    """Samples ``[rows, cols]`` of the next finer level of a level with ``side`` samples, from a window of it.

    ``coarse[0, 0]`` is sample [row0, col0]; the window must hold what ``needed`` says.
    """
    out = np.empty((rows.stop - rows.start, cols.stop - cols.start), dtype=np.float32)
    _carry(read_only(np.ascontiguousarray(coarse)), row0, col0, side, rows.start, cols.start, out)
    return out


def needed(span: slice, side: int) -> slice:
    """Coarse samples from which ``carry`` makes the fine samples ``span``; ``side`` samples a side on the coarse."""
    return slice(max(0, span.start // 2 - 1), min(side, (span.stop - 1) // 2 + 3))


def membrane(heights: Grid, cover: Grid) -> Grid:
    """F on a whole level (2^k + 1 samples a side) from blend and cover there. Without any cover it is 0."""
    if len(heights) <= 3:
        total = cover.sum()
        mean = np.float32((heights * cover).sum() / total) if total > 0 else np.float32(0)
        start = np.full_like(heights, mean)
        return relax(start, heights, cover, _SWEEPS_BELOW[1])
    coarse = membrane(*_restricted(heights, cover))
    side = len(heights)
    whole = slice(0, side)
    fine = carry(coarse, 0, 0, len(coarse), whole, whole)
    ground = cover * heights + (np.float32(1) - cover) * fine
    least, most = _SWEEPS_BELOW
    shrink = (64 << ANCHOR) // (side - 1)
    return relax(ground, heights, cover, min(most, least * max(1, shrink * shrink)))


def _restricted(heights: Grid, cover: Grid) -> tuple[Grid, Grid]:
    """Every other sample: the mean around it weighted by cover, known as well as the best known around it."""
    side = (len(heights) + 1) // 2
    mean, known = np.empty((side, side), dtype=np.float32), np.empty((side, side), dtype=np.float32)
    _restrict(heights, cover, mean, known)
    return mean, known


@kernel
def _restrict(heights: Grid, cover: Grid, mean: Grid, known: Grid) -> None:
    last = heights.shape[0] - 1
    for row in range(mean.shape[0]):
        for col in range(mean.shape[1]):
            total, weight, best = 0.0, 0.0, np.float32(0)
            for i in range(max(2 * row - 1, 0), min(2 * row + 1, last) + 1):
                for j in range(max(2 * col - 1, 0), min(2 * col + 1, last) + 1):
                    w = (2 - abs(i - 2 * row)) * (2 - abs(j - 2 * col)) * cover[i, j]
                    total += w * heights[i, j]
                    weight += w
                    best = max(best, cover[i, j])
            mean[row, col] = total / weight if weight > 0 else 0.0
            known[row, col] = best


def smooth_jets(window: Grid, at: NDArray[np.float64], spacing: float) -> NDArray[np.float64]:
    """The continuation as a C2 function: value and derivatives (n, 6), at (n, 2) col, row of a window.

    A cubic B-spline whose coefficients are c = z - (second differences of z) / 6 along each axis: a quasi-interpolant,
    local and exact for cubic polynomials, so that places in different windows see one function. The window must hold
    three samples around each place.
    """
    values = window.astype(np.float64)
    for axis in (0, 1):
        curve = np.zeros_like(values)
        middle = [slice(None), slice(None)]
        middle[axis] = slice(1, -1)
        curve[tuple(middle)] = np.diff(values, 2, axis=axis)
        values -= curve / 6
    out = np.empty((len(at), 6))
    _spline_jets(values.astype(np.float32), np.ascontiguousarray(at) - 1.0, 1.0 / spacing, out)
    return out


@kernel
def _spline_jets(c: Grid, at: NDArray[np.float64], per: float, out: NDArray[np.float64]) -> None:
    end = min(c.shape) - 4
    for k in range(at.shape[0]):
        jet = spline_jet(c, at[k, 0], at[k, 1], end)
        out[k, 0], out[k, 1], out[k, 2] = jet[0], jet[1] * per, jet[2] * per
        out[k, 3], out[k, 4], out[k, 5] = jet[3] * per * per, jet[4] * per * per, jet[5] * per * per
