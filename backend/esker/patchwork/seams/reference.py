"""The seam blend in NumPy float64, as plainly as its definition reads: the twin of the compiled loops, for small
scenes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from esker.patchwork.blend.reference import fade, spline
from esker.patchwork.seams.loops import AGREED, FAR, NEAR, PEAK, RUN, SOFT, SPREAD

Floats = NDArray[np.float64]


def _sums(points: Floats, weight: Floats, pitch: float, at: Floats) -> Floats:
    """Kernel sums (k,) of weighted points (n, 2) at places (k, 2), by way of the nodes of a level."""
    low = np.floor(np.minimum(points.min(axis=0), at.min(axis=0)) / pitch) - 2
    high = np.floor(np.maximum(points.max(axis=0), at.max(axis=0)) / pitch) + 3
    across, along = (np.arange(low[axis], high[axis] + 1) for axis in (0, 1))

    def splines(places: Floats) -> tuple[Floats, Floats]:
        return spline(places[:, :1] / pitch - across), spline(places[:, 1:] / pitch - along)

    x, y = splines(points)
    nodes = np.einsum("p,pj,pi->ji", weight / pitch, y, x)
    x, y = splines(at)
    return np.asarray(np.einsum("pj,ji,pi->p", y, nodes, x))


def corrections(
    points: Floats, weight: Floats, difference: Floats, pitch: tuple[float, ...], cell: float, cap: float, at: Floats
) -> Floats:
    """Correction u (k,) at places (k, 2) of a border: points (n, 2), their weights in metres and differences (n,)."""
    left, mean, square = np.ones(len(at)), np.zeros(len(at)), np.zeros(len(at))
    for h in pitch:
        density = _sums(points, weight, h, at)
        moment = _sums(points, weight * difference, h, at)
        with np.errstate(divide="ignore", invalid="ignore"):
            q = -SPREAD * np.log(density / PEAK)
            believed = np.where(q < FAR, left * (1 - fade((FAR - q) / (FAR - NEAR))), 0.0)
            mean += np.where(believed > 0, believed * moment / density, 0.0)
            square += np.where(believed > 0, believed * (q + np.sqrt(q * q + SOFT**2)) / 2 * h * h, 0.0)
        left = left - believed
    square += left * FAR * pitch[-1] ** 2
    mean = np.divide(mean, 1 - left, out=np.zeros_like(mean), where=left < 1)
    size, least = np.abs(mean), AGREED * cell
    with np.errstate(divide="ignore"):
        s = np.maximum(1 - square * (1 / (RUN * size) ** 2 + 1 / cap**2), 0)
    return np.asarray(np.where(size > least, mean * (1 - fade(size / least - 1)) * s**3, 0.0))
