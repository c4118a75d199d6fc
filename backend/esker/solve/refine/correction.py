"""The correction of refinement on a coarse grid, in NumPy float64: the twin of ``shaders/opencl/pockets.cl``.

Sweeps of a window see no farther than they are many, while ground between strokes moves as a whole where a finer level
knows better where crests run and bands end. So what the first sweeps leave is corrected on every eighth sample, where a
few nodes reach as far.

A crest is a line one sample wide, and no coarse grid may lose it. So a node knows its four *arms* (Shortley and Weller
1938): how far it is along the grid to the nearest fixed sample, 0 at one, as a share of the way to the next node, and
more than 1 where none comes first. An arm of less than 1 holds a node as a spring of 1 / arm and hides the neighbour
behind it. Interpolation goes along arms too, and never across a crest; restriction is its transpose.

On the last grid the nodes around every second node of every second row are a *subdomain*, relaxed by itself as if the
correction went on outside with BEYOND of its value at the border (overlapping Schwarz with a Robin condition: Cai and
Sarkis 1999, Gander 2006). A node takes the mean of the subdomains in which it lies beside the middle. All that is fixed
on the level's own grid, so that windows agree on what they share.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from esker.contract import SATURATION
from esker.solve.refine.pocket import BEYOND, COARSENINGS, MARGIN, OVER_RELAXATION, RELAXATIONS, SUBDOMAIN

NONE: Final = 2.0
"""An arm that meets nothing fixed."""

Field = NDArray[np.float64]
EAST, WEST, NORTH, SOUTH = range(4)
_SIDES: Final = ((0, 1), (0, -1), (1, 0), (-1, 0))


@dataclass(frozen=True)
class Grid:
    """One grid of a window: arms (4, rows, columns), springs and right-hand side (rows, columns)."""

    arms: Field
    spring: Field
    right: Field


def corrected(u: Field, residual: Field, d: Field, screening: float) -> Field:
    """Returns u with the correction of its residual, (rows, columns) each; ``d`` is less than zero at fixed samples."""
    grids = [Grid(_first_arms(d < 0), np.maximum(d, 0), residual)]
    for _ in range(COARSENINGS):
        grids.append(_coarser(grids[-1]))
    e = _blended(_relaxed(_couplings(grids[-1], screening * 4.0**COARSENINGS)), grids[-1].right.shape)
    for fine, coarse in zip(grids[-2::-1], grids[:0:-1], strict=True):
        e = _interpolated(e, coarse.arms, fine.arms)
    return u + e


def _first_arms(fixed: NDArray[np.bool_]) -> Field:
    around = np.pad(fixed, 1, mode="reflect")
    rows, columns = fixed.shape
    sides = [around[1 + dy : 1 + dy + rows, 1 + dx : 1 + dx + columns] for dy, dx in _SIDES]
    return np.where(fixed, 0.0, np.where(np.stack(sides), 1.0, NONE))


def _around(arms: Field) -> Field:
    """Arms with a ring of their mirror images, which point the other way."""
    out = np.pad(arms, ((0, 0), (1, 1), (1, 1)), mode="reflect")
    for ring, pair in ((np.s_[:, 0], (NORTH, SOUTH)), (np.s_[:, -1], (NORTH, SOUTH))):
        out[(pair, *ring[1:])] = out[(pair[::-1], *ring[1:])]
    for column in (0, -1):
        out[[EAST, WEST], :, column] = out[[WEST, EAST], :, column]
    return out


def _coarser(fine: Grid) -> Grid:
    """The grid of every second row and column."""
    arms, rows, columns = fine.arms, *fine.right.shape
    near, ring = arms[:, ::2, ::2], _around(arms)
    beyond = np.stack(
        [
            ring[k, 1 + dy : 1 + dy + rows : 2, 1 + dx : 1 + dx + columns : 2]
            for k, (dy, dx) in enumerate(_SIDES)
        ]
    )  # fmt: skip
    longer = np.where(near <= 1, near / 2, (1 + beyond) / 2)
    s = np.pad(fine.spring, 1, mode="reflect")
    across = s[:, 1:-1:2] + (s[:, :-2:2] + s[:, 2::2]) / 2
    total = across[1:-1:2] + (across[:-2:2] + across[2::2]) / 2
    return Grid(longer, total / (1 + SATURATION * total), _restricted(fine, longer))


def _share(arm: Field) -> Field:
    """What a node's value counts for the sample midway along an arm."""
    return np.where(arm > 0.5, 1 - 0.5 / np.maximum(np.minimum(arm, 1), 0.5), 0.0)


def _held(arms: Field) -> Field:
    """How stiffly arms hold a sample amid four others."""
    return np.asarray((1 / np.maximum(np.minimum(arms, 1), 1e-9)).sum(axis=0))


def _restricted(fine: Grid, arms: Field) -> Field:
    """The transpose of ``_interpolated``: right-hand side of the nodes with these arms."""
    rows, columns = fine.right.shape
    ring, right = _around(fine.arms), np.pad(fine.right, 1, mode="reflect")
    given = np.where(ring >= 1, right / _held(ring), 0.0)

    def at(field: Field, dy: int, dx: int) -> Field:
        return field[1 + dy : 1 + dy + rows : 2, 1 + dx : 1 + dx + columns : 2]

    out = at(right, 0, 0).copy()
    for k, (dy, dx) in enumerate(_SIDES):
        aside = ((1, SOUTH), (-1, NORTH)) if dx else ((1, WEST), (-1, EAST))
        beside = sum(at(given[arm], *((side, dx) if dx else (dy, side))) for side, arm in aside)
        out += _share(arms[k]) * (at(right, dy, dx) + beside)
    return out


def _interpolated(e: Field, arms: Field, fine: Field) -> Field:
    """Values of a grid with arms ``fine`` from those of the next coarser one, with ``arms``."""
    rows, columns = fine.shape[1:]
    north, east = np.pad(e, ((0, 1), (0, 0)), mode="edge")[1:], np.pad(e, ((0, 0), (0, 1)), mode="edge")[:, 1:]
    arms_north = np.pad(arms, ((0, 0), (0, 1), (0, 0)), mode="edge")[:, 1:]
    arms_east = np.pad(arms, ((0, 0), (0, 0), (0, 1)), mode="edge")[:, :, 1:]
    out = np.zeros((2 * e.shape[0], 2 * e.shape[1]))
    out[::2, ::2] = e
    out[::2, 1::2] = _share(arms[EAST]) * e + _share(arms_east[WEST]) * east
    out[1::2, ::2] = _share(arms[NORTH]) * e + _share(arms_north[SOUTH]) * north
    out = np.pad(out[:rows, :columns], ((0, 1), (0, 1)))
    amid, sides = fine[:, 1::2, 1::2], np.zeros_like(fine[0, 1::2, 1::2])
    for k, (dy, dx) in enumerate(_SIDES):
        sides += np.where(amid[k] >= 1, out[1 + dy : 1 + dy + rows - 1 : 2, 1 + dx : 1 + dx + columns - 1 : 2], 0.0)
    out[1:rows:2, 1:columns:2] = sides / _held(amid)
    return np.where(fine[EAST] > 0, out[:rows, :columns], 0.0)


def _couplings(grid: Grid, screening: float) -> Field:
    """(5, rows, columns) with MARGIN zeros around: couplings to the four neighbours and right-hand side, each divided
    by what holds the node."""
    open_ = (grid.arms >= 1).astype(np.float64)
    held = np.where(grid.arms < 1, 1 / np.maximum(grid.arms, 1e-9), open_).sum(axis=0) + grid.spring + screening
    q = np.where(grid.arms[EAST] > 0, 1 / held, 0.0)
    for inward, outward, at in (
        (EAST, WEST, np.s_[:, 0]),
        (WEST, EAST, np.s_[:, -1]),
        (NORTH, SOUTH, np.s_[0]),
        (SOUTH, NORTH, np.s_[-1]),
    ):
        open_[inward][at] += open_[outward][at]
        open_[outward][at] = 0
    return np.pad(np.concatenate([open_, grid.right[None]]) * q, ((0, 0), (MARGIN, MARGIN), (MARGIN, MARGIN)))


def _relaxed(c: Field) -> Field:
    """The values of subdomains: (rows of subdomains, columns, 3, 3), the middle and the eight nodes around it."""
    side, first = 2 * SUBDOMAIN + 1, MARGIN - SUBDOMAIN
    windows = np.lib.stride_tricks.sliding_window_view(c, (side, side), axis=(1, 2))
    ends = [first + n - 2 * MARGIN for n in c.shape[1:]]
    c = windows[:, first : ends[0] : 2, first : ends[1] : 2].copy()
    out = np.zeros(c.shape[1:])
    out[..., -1] += c[EAST, ..., -1]
    out[..., 0] += c[WEST, ..., 0]
    out[..., -1, :] += c[NORTH, ..., -1, :]
    out[..., 0, :] += c[SOUTH, ..., 0, :]
    c /= 1 - BEYOND * out
    e = np.zeros((*c.shape[1:3], side + 2, side + 2))
    inner = e[..., 1:-1, 1:-1]
    red = np.indices((side, side)).sum(axis=0) % 2 == 0
    for half in range(2 * RELAXATIONS):
        new = c[4] + c[EAST] * e[..., 1:-1, 2:] + c[WEST] * e[..., 1:-1, :-2]
        new += c[NORTH] * e[..., 2:, 1:-1] + c[SOUTH] * e[..., :-2, 1:-1]
        inner += np.where(red == (half % 2 == 0), OVER_RELAXATION * (new - inner), 0.0)
    middle = slice(SUBDOMAIN, SUBDOMAIN + 3)
    return e[..., middle, middle]


def _blended(subdomains: Field, shape: tuple[int, int]) -> Field:
    """The nodes' values from those of subdomains; subdomains beyond the grid count as the last ones."""
    out = np.zeros(shape)
    last = subdomains.shape[0] - 1, subdomains.shape[1] - 1
    y, x = np.indices(shape)
    for up in (0, 1):
        for right in (0, 1):
            py, px = np.minimum(y // 2 + up * (y % 2), last[0]), np.minimum(x // 2 + right * (x % 2), last[1])
            dy, dx = np.where(y % 2, 1 - 2 * up, 0), np.where(x % 2, 1 - 2 * right, 0)
            out += subdomains[py, px, 1 + dy, 1 + dx]
    return out / 4
