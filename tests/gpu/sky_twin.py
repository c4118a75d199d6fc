"""Scattering in the atmosphere in float64: twin of shaders/wgsl/sky/atmosphere.wgsl, with the integral that it fits.

Hillaire, "A Scalable and Production Ready Sky and Atmosphere Rendering Technique" (2020): coefficients of table 1,
multiple scattering by equations 5 to 10. Kilometres; radiance for a sun of irradiance 10 outside the atmosphere.
"""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

FLOATS = NDArray[np.float64]
PLANET, TOP, VIEWER, SUN = 6360.0, 6460.0, 0.6, 10.0
RAYLEIGH = np.array([5.802e-3, 13.558e-3, 33.1e-3])
MIE_SCATTER, MIE_EXTINCTION = 3.996e-3, 8.396e-3
OZONE = np.array([0.650e-3, 1.881e-3, 0.085e-3])
GROUND_ALBEDO = 0.3


def densities(z: ArrayLike) -> tuple[FLOATS, FLOATS, FLOATS]:
    """Rayleigh, Mie and ozone densities at altitudes, relative to their maximum."""
    z = np.maximum(np.asarray(z, np.float64), 0)
    return np.exp(-z / 8), np.exp(-z / 1.2), np.maximum(0, 1 - np.abs(z - 25) / 15)


def extinction(z: ArrayLike) -> FLOATS:
    """Per kilometre, (..., 3)."""
    r, m, o = densities(z)
    out: FLOATS = r[..., None] * RAYLEIGH + m[..., None] * MIE_EXTINCTION + o[..., None] * OZONE
    return out


def to_top(z: FLOATS, up: FLOATS) -> FLOATS:
    """Distance to the top of the atmosphere along a direction with this sine of elevation."""
    r = PLANET + z
    reach: FLOATS = -r * up + np.sqrt(np.maximum(0, r * r * (up * up - 1) + TOP * TOP))
    return reach


def altitude(z: ArrayLike, up: ArrayLike, t: ArrayLike) -> FLOATS:
    """Altitude after a distance t."""
    r, t = PLANET + np.asarray(z), np.asarray(t)
    out: FLOATS = np.sqrt(r * r + t * t + 2 * r * t * up) - PLANET
    return out


def transmittance(z: ArrayLike, up: ArrayLike, steps: int = 64) -> FLOATS:
    """Of the way to the sun, (..., 3); 0 in the planet's shadow, whose edge is as soft as the shader's."""
    z, up = np.broadcast_arrays(np.asarray(z, np.float64), np.asarray(up, np.float64))
    reach = to_top(z, up)
    edges = (np.arange(steps + 1) / steps) ** 2
    depth = np.zeros((*z.shape, 3))
    for a, b in pairwise(edges):
        depth += extinction(altitude(z, up, reach * (a + b) / 2)) * (reach * (b - a))[..., None]
    horizon = -np.sqrt(np.maximum(0, 1 - (PLANET / (PLANET + z + 1e-3)) ** 2))
    x = np.clip((up - horizon + 0.02) / 0.04, 0, 1)
    out: FLOATS = np.exp(-depth) * (x * x * (3 - 2 * x))[..., None]
    return out


@cache
def _table() -> FLOATS:
    """Transmittance on 60 altitudes (denser near the ground) and 401 sines of elevation."""
    z = np.linspace(0, 1, 60) ** 2 * (TOP - PLANET - 0.1)
    return transmittance(z[:, None], np.linspace(-1, 1, 401)[None, :], steps=40)


def quick_transmittance(z: FLOATS, up: FLOATS) -> FLOATS:
    """`transmittance` between the values of a table."""
    table = _table()
    a = np.sqrt(np.clip(z, 0, TOP - PLANET - 0.1) / (TOP - PLANET - 0.1)) * 59
    b = (np.clip(up, -1, 1) + 1) * 200
    i, j = np.minimum(a.astype(int), 58), np.minimum(b.astype(int), 399)
    f, g = (a - i)[..., None], (b - j)[..., None]
    low = table[i, j] * (1 - f) + table[i + 1, j] * f
    high = table[i, j + 1] * (1 - f) + table[i + 1, j + 1] * f
    out: FLOATS = low * (1 - g) + high * g
    return out


@cache
def multiple_scattering(z: float, sun_up: float) -> tuple[float, float, float]:
    """Psi_ms: light of all orders from the second on, from every side, for a sun of irradiance 1 (equations 5-10)."""
    second, passed = np.zeros(3), np.zeros(3)
    ups = (np.arange(24) + 0.5) / 12 - 1
    turns = (np.arange(8) + 0.5) / 8 * np.pi
    for up in ups:
        flat = np.sqrt(1 - up * up)
        r = PLANET + z
        square = r * r * (up * up - 1) + PLANET**2
        hits = up < 0 and square > 0
        reach = -r * up - np.sqrt(square) if hits else float(to_top(np.array(z), np.array(up)))
        edges = (np.arange(41) / 40) ** 2 * reach
        t, length = (edges[1:] + edges[:-1]) / 2, np.diff(edges)
        at = altitude(z, up, t)
        loss = extinction(at)
        through = np.exp(-np.cumsum(np.vstack([np.zeros(3), (loss * length[:, None])[:-1]]), axis=0))
        rayleigh, mie, _ = densities(at)
        scatter = rayleigh[:, None] * RAYLEIGH + (mie * MIE_SCATTER)[:, None]
        share = through * scatter * (1 - np.exp(-loss * length[:, None])) / loss
        passed += share.sum(0) / len(ups)
        c = up * sun_up + flat * np.cos(turns) * np.sqrt(1 - sun_up * sun_up)
        ups_there = (sun_up * r + t[:, None] * c) / (PLANET + at)[:, None]
        lit = quick_transmittance(np.broadcast_to(at[:, None], ups_there.shape), ups_there)
        second += (share[:, None] * lit).sum(0).mean(0) / (4 * np.pi) / len(ups)
        if hits:
            ground_up = (sun_up * r + reach * c) / PLANET
            back = quick_transmittance(np.zeros_like(c), ground_up) * np.maximum(ground_up, 0)[:, None]
            second += np.exp(-(loss * length[:, None]).sum(0)) * (GROUND_ALBEDO / np.pi) * back.mean(0) / len(ups)
    red, green, blue = second / (1 - passed)
    return float(red), float(green), float(blue)


def radiance(direction: FLOATS, sun: FLOATS, steps: int = 96) -> FLOATS:
    """Radiance of the sky along one unit vector, (3,)."""
    up, c = max(float(direction[2]), 0.0), float(direction @ sun)
    reach = float(to_top(np.array(VIEWER), np.array(up)))
    edges = (np.arange(steps + 1) / steps) ** 2 * reach
    t, length = (edges[1:] + edges[:-1]) / 2, np.diff(edges)
    at = altitude(VIEWER, up, t)
    sun_up = (sun[2] * (PLANET + VIEWER) + t * c) / (PLANET + at)
    rayleigh, mie, _ = densities(at)
    g = 0.78
    phase_r = 3 / (16 * np.pi) * (1 + c * c)
    phase_m = 3 / (8 * np.pi) * (1 - g * g) / (2 + g * g) * (1 + c * c) / (1 + g * g - 2 * g * c) ** 1.5
    scatter_r, scatter_m = rayleigh[:, None] * RAYLEIGH, (mie * MIE_SCATTER)[:, None]
    # The integral is smooth along the ray: a few places of it are enough.
    few = np.linspace(0, steps - 1, 9).round().astype(int)
    known = np.array([multiple_scattering(float(at[k]), float(np.clip(sun_up[k], -1, 1))) for k in few])
    psi = np.stack([np.interp(np.arange(steps), few, known[:, k]) for k in range(3)], axis=-1)
    source = transmittance(at, sun_up) * (scatter_r * phase_r + scatter_m * phase_m) + psi * (scatter_r + scatter_m)
    loss = extinction(at)
    through = np.exp(-np.cumsum(np.vstack([np.zeros(3), (loss * length[:, None])[:-1]]), axis=0))
    out: FLOATS = (through * source * (1 - np.exp(-loss * length[:, None])) / loss).sum(0) * SUN
    return out
