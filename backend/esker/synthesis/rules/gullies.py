"""Gullies: one octave a level of waves whose lines run down the slope (docs/synthesis.md, "Gullies").

A wave is a sum over a lattice of pivots: each cell carries a plane wave through its pivot, across the slope at the
sample. Cosine and sine are summed both, so the phase is known, and the profile across a gully is free. Polynomials
stand for sine and arc tangent: no library decides what any twin of this makes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from esker import grid
from esker.contract import MAX_EROSION
from esker.contract import fractal as f
from esker.synthesis import hash as noise
from esker.synthesis.interpolate import Window
from esker.synthesis.rules import octave as loop
from esker.synthesis.rules.targets import smoothstep
from esker.synthesis.site import Biases, Ground, Site
from esker.synthesis.state import Array


class Wear(NamedTuple):
    """How much gullies there are at each sample. ``strength``: 0..2; ``steep``: 0..GULLY_STEEP, by the slope of the
    drawn ground; ``held``: share of the height that what strokes fix keeps, 0..1."""

    strength: Array
    steep: Array
    held: Array


def wear(site: Site, ground: Ground, biases: Biases) -> Wear:
    """What settings, paint and distance say of gullies at the samples of ``ground``."""
    painted = site.erosion * (1 + np.minimum(biases.erosion, 0)) + np.maximum(biases.erosion, 0)
    away = np.maximum(0, site.far_m * biases.far - site.far_margin_m) / wave_m(site, ground.level)
    return Wear(
        np.minimum(painted, MAX_EROSION),
        smoothstep(f.GULLY_FLAT, ground.guide_slope) * np.minimum(ground.guide_slope, f.GULLY_STEEP),
        site.hold * (1 - smoothstep(f.GULLY_HOLD, away)),
    )


def wave_m(site: Site, level: int) -> float:
    """Wavelength of the octave of a level, metres."""
    return site.gully_side / f.GULLY_CELL * site.spacing(level)


def depth_m(site: Site, level: int) -> float:
    """Depth of the octave of a level on a slope of 1, metres, at strength 1."""
    return float(f.GULLY_DEPTH * f.GULLY_GAIN ** (level - 1) * wave_m(site, level))


def calm(level: int, worn: Wear) -> Array:
    """Share of the noise of d that is left where gullies are, and where strokes fix the ground."""
    strength = np.minimum(worn.strength, 1)
    back = f.GULLY_CALM_GAIN * smoothstep(f.GULLY_CALM_LEVELS, np.array(float(level)))
    less = (f.GULLY_CALM - back) / f.GULLY_STEEP * strength * worn.steep
    quiet = (1 - smoothstep(f.GULLY_QUIET_LEVELS, np.array(float(level)))) * strength * worn.held
    share: Array = (1 - less) * (1 - quiet)
    return share.astype(worn.steep.dtype)


def depth(site: Site, ground: Ground, worn: Wear) -> Array:
    """Depth of the octave of the ground's level at its samples, metres: none on level 0, which has none of its own."""
    if ground.level == 0:
        return np.zeros_like(ground.height)
    crest = 1 - site.hold * smoothstep(f.GULLY_CREST, -ground.concavity)
    foot = 1 - f.GULLY_FOOT_SHARE * smoothstep(f.GULLY_FOOT, ground.concavity)
    size: Array = depth_m(site, ground.level) * worn.strength * worn.steep * crest * foot * (1 - worn.held)
    return size


class Lattice(NamedTuple):
    """Pivots about a window. ``row``, ``v``: cell and place in it of its rows; ``col``, ``u``: of its columns;
    ``east``, ``north``: where the pivots of cells lie, from one before the first cell to one behind the last."""

    row: NDArray[np.int64]
    v: Array
    col: NDArray[np.int64]
    u: Array
    east: Array
    north: Array


def lattice(site: Site, window: Window) -> Lattice:
    """The pivots about a window, and where its samples lie among them."""
    side = site.gully_side
    j, i = window.rows // side, window.cols // side
    v, u = ((a - side * b).astype(site.dtype) * (1.0 / side) for a, b in ((window.rows, j), (window.cols, i)))
    east, north = _pivots(site, window.level, (int(j.min()), int(j.max())), (int(i.min()), int(i.max())))
    return Lattice(j - j.min(), v, i - i.min(), u, east, north)


def octave(site: Site, ground: Ground, window: Window, where: Array) -> Array:
    """The octave of a window's level for a depth of 1: -0.55 in beds to 0.45 on ridges. 0 where ``where`` is 0.

    In double precision whatever the site's is: there it is ``octave_reference`` to the bit.
    """
    at, out = lattice(site, window), np.empty(window.shape)
    marks, slope_x, slope_y = (np.ascontiguousarray(a, np.float64) for a in (where, ground.slope_x, ground.slope_y))
    v, u, east, north = (a.astype(np.float64) for a in (at.v, at.u, at.east, at.north))
    loop.fill(out, marks, slope_x, slope_y, at.row, v, at.col, u, east, north, loop.SINE, loop.ARC, loop.SHAPE)
    octave: Array = out.astype(site.dtype)
    return octave


def octave_reference(site: Site, ground: Ground, window: Window, where: Array) -> Array:
    """The twin of ``octave`` in NumPy, in the site's precision."""
    out = np.zeros_like(ground.height)
    at = np.nonzero(where)
    if not len(at[0]):
        return out
    there = lattice(site, window)
    gx, gy = ground.slope_x[at], ground.slope_y[at]
    turn = 1 / np.sqrt(gx * gx + gy * gy + f.GULLY_TURN**2)
    nx, ny = -gy * turn, gx * turn
    row, col = there.row[at[0]], there.col[at[1]]
    u, v = there.u[at[1]], there.v[at[0]]
    cosine, sine, weights = (np.zeros_like(gx) for _ in range(3))
    for dj in (-1, 0, 1):
        for di in (-1, 0, 1):
            pivot = row + (dj + 1), col + (di + 1)
            qx, qy = u - (di + there.east[pivot]), v - (dj + there.north[pivot])
            w = np.maximum(0, 1 - (qx * qx + qy * qy))
            s, c = turned(f.GULLY_CELL * (qx * nx + qy * ny))
            cosine += w * w * c
            sine += w * w * s
            weights += w * w
    length = np.sqrt(cosine * cosine + sine * sine)
    agree = np.minimum(1, length / (f.GULLY_AGREEMENT * weights + f.GULLY_AGREEMENT_LEAST))
    out[at] = agree * agree * (3 - 2 * agree) * profile(half_turns(sine, cosine))
    return out


def _pivots(site: Site, level: int, rows: tuple[int, int], cols: tuple[int, int]) -> tuple[Array, Array]:
    """Where pivots lie in their cells, 0..1 east and north, of lattice cells from one before ``rows`` and ``cols`` to
    one behind them. A cyclic domain has a whole number of cells."""
    j, i = (np.arange(first - 1, last + 2, dtype=np.int64) for first, last in (rows, cols))
    if site.cyclic:
        j, i = (cells % (grid.cells(level) // site.gully_side) for cells in (j, i))
    word = noise.hashed(site.seed, level, f.GULLY_STREAM, j, i)
    return 0.5 + f.GULLY_JITTER * noise.low(word, site.dtype), 0.5 + f.GULLY_JITTER * noise.high(word, site.dtype)


def turned(t: Array) -> tuple[Array, Array]:
    """Sine and cosine of a phase in turns."""
    t = t - np.floor(t + 0.5)
    return _sine(np.where(np.abs(t) <= 0.25, t, np.copysign(0.5, t) - t)), _sine(0.25 - np.abs(t))


def _sine(a: Array) -> Array:
    p = a * a
    inner = f.GULLY_SINE_5 + p * (f.GULLY_SINE_7 + p * f.GULLY_SINE_9)
    sine: Array = a * (f.GULLY_SINE_1 + p * (f.GULLY_SINE_3 + p * inner))
    return sine


def half_turns(s: Array, c: Array) -> Array:
    """How far a phase is from 0, in half turns: |atan2(s, c)| / pi."""
    high, low = np.maximum(np.abs(s), np.abs(c)), np.minimum(np.abs(s), np.abs(c))
    x = low / np.maximum(high, 1e-20)
    p = x * x
    inner = f.GULLY_ARC_7 + p * (f.GULLY_ARC_9 + p * f.GULLY_ARC_11)
    a = x * (f.GULLY_ARC_1 + p * (f.GULLY_ARC_3 + p * (f.GULLY_ARC_5 + p * inner)))
    a = np.where(np.abs(s) > np.abs(c), 0.5 - a, a)
    turned_back: Array = np.where(c < 0, 1 - a, a)
    return turned_back


def profile(t: Array) -> Array:
    """Height across a gully of depth 1, at ``t`` from its ridge, 0, to its bed, 1: hyperbolas at both ends."""
    low = _rounded(t, f.GULLY_RIDGE)
    high = 1 - _rounded(1 - t, f.GULLY_BED)
    height: Array = f.GULLY_MIDDLE - (low * (1 - t) + high * t)
    return height


def _rounded(t: Array, radius: float) -> Array:
    least, most = radius, np.sqrt(1 + radius * radius)
    rounded: Array = (np.sqrt(t * t + radius * radius) - least) / (most - least)
    return rounded
