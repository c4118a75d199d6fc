"""The blend in NumPy float64, as plainly as its definition reads: the twin of the compiled loops and of the kernel."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from esker.contract import PATCH_MARGIN_CELLS
from esker.patchwork.blend.lattice import extents
from esker.patchwork.lod.space import Model

Floats = NDArray[np.float64]


def coefficients(samples: Floats) -> Floats:
    """B-spline coefficients (n + 2, n + 2) of the natural bicubic spline through ``samples`` (n, n)."""
    n = len(samples)
    matrix = np.zeros((n + 2, n + 2))
    for k in range(n):
        matrix[k + 1, k : k + 3] = np.array([1, 4, 1]) / 6
    matrix[0, :3] = matrix[-1, -3:] = [1, -2, 1]
    right = np.zeros((n + 2, n))
    right[1:-1] = samples
    by_rows = np.linalg.solve(matrix, right)
    right = np.zeros((n + 2, n + 2))
    right[1:-1] = by_rows.T
    return np.asarray(np.linalg.solve(matrix, right).T)


def spline(t: Floats) -> Floats:
    """The cubic B-spline around 0."""
    t = np.abs(t)
    return np.where(t < 1, 2 / 3 - t**2 + t**3 / 2, np.where(t < 2, (2 - t) ** 3 / 6, 0.0))


def patch_heights(samples: Floats, u: Floats, v: Floats, smooth: bool) -> Floats:
    """Heights of one patch at sample coordinates u (along a row) and v, each (points,), within 0..n-1."""
    n = len(samples)
    if smooth:
        knots = np.arange(-1, n + 1)
        along, across = spline(u[:, None] - knots), spline(v[:, None] - knots)
        return np.asarray(np.einsum("pi,ij,pj->p", across, coefficients(samples), along))
    knots = np.arange(n)
    along, across = (np.maximum(1 - np.abs(t[:, None] - knots), 0) for t in (u, v))
    return np.asarray(np.einsum("pi,ij,pj->p", across, samples, along))


def taper(t: Floats, smooth: bool) -> Floats:
    """The weight of one axis at t from -1 to 1 (paper 2, section 4.1)."""
    t = np.minimum(np.abs(t), 1)
    return (1 - t) ** 3 * (3 * t + 1) if smooth else 1 - t


def fade(outside: Floats) -> Floats:
    """1 up to 0, 0 from 1 on, a quintic smoothstep between."""
    t = np.clip(1 - outside, 0, 1)
    return np.asarray(t**3 * (t * (6 * t - 15) + 10))


def evaluate(
    model: Model, index: NDArray[np.int32], points: Floats, smooth: bool, tolerance: float = np.inf
) -> tuple[Floats, Floats, NDArray[np.int64]]:
    """Heights, cover and number of patches at world points (n, 2); heights NaN where no patch reaches."""
    above, below, bare = np.zeros(len(points)), np.zeros(len(points)), np.ones(len(points))
    count = np.zeros(len(points), dtype=np.int64)
    veil, at = bare.copy(), -np.inf
    for k in index[np.argsort(np.maximum(model.min_z[index], tolerance), kind="stable")]:
        if max(model.min_z[k], tolerance) > at:  # it stands higher: lower ones go before
            veil, at = bare.copy(), max(model.min_z[k], tolerance)
        to_patch, side = model.to_patch[k : k + 1], model.side[k : k + 1].astype(np.int32)
        inner, domain = (e[0] for e in extents(model.kernel[k : k + 1], to_patch, side))
        u, v = to_patch[0, :, :2] @ points.T + to_patch[0, :, 2:]
        near = np.flatnonzero((u > domain[0]) & (u < domain[1]) & (v > domain[2]) & (v < domain[3]))
        u, v = u[near], v[near]
        half = (domain[1] - domain[0]) / 2, (domain[3] - domain[2]) / 2
        world = np.linalg.inv(to_patch[0, :, :2])
        area = half[0] * half[1] * abs(np.linalg.det(world))
        weight = taper((u - domain[:2].mean()) / half[0], smooth) * taper((v - domain[2:].mean()) / half[1], smooth)
        weight = weight / area * veil[near]
        above[near] += weight * patch_heights(model.samples(int(k)).astype(np.float64), u, v, smooth)
        below[near] += weight
        miss_u, miss_v = np.maximum(inner[0] - u, u - inner[1]), np.maximum(inner[2] - v, v - inner[3])
        bare[near] *= 1 - fade(miss_u / PATCH_MARGIN_CELLS) * fade(miss_v / PATCH_MARGIN_CELLS)
        count[near] += 1
    with np.errstate(invalid="ignore"):
        return above / below, 1 - bare, count
