"""A function's value and derivatives at a place, carried through products and quotients (compiled).

A jet is (f, f_x, f_y, f_xx, f_xy, f_yy).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from esker.patchwork.jit import kernel

Jet = tuple[float, float, float, float, float, float]
Line = tuple[float, float, float]
"""(f, f', f'') along one axis."""


@kernel
def tensor(g: Line, h: Line) -> Jet:
    """Returns the jet of g(u) h(v), in u and v."""
    return g[0] * h[0], g[1] * h[0], g[0] * h[1], g[2] * h[0], g[1] * h[1], g[0] * h[2]


@kernel
def turned(f: Jet, to: NDArray[np.float64]) -> Jet:
    """Takes a jet from u, v to x, y, where (u, v) = ``to`` (2, 3) (x, y, 1)."""
    a, b, d, e = to[0, 0], to[0, 1], to[1, 0], to[1, 1]
    return (
        f[0],
        f[1] * a + f[2] * d,
        f[1] * b + f[2] * e,
        f[3] * a * a + 2 * f[4] * a * d + f[5] * d * d,
        f[3] * a * b + f[4] * (a * e + b * d) + f[5] * d * e,
        f[3] * b * b + 2 * f[4] * b * e + f[5] * e * e,
    )


@kernel
def product(f: Jet, g: Jet) -> Jet:
    """Returns the jet of f g."""
    return (
        f[0] * g[0],
        f[1] * g[0] + f[0] * g[1],
        f[2] * g[0] + f[0] * g[2],
        f[3] * g[0] + 2 * f[1] * g[1] + f[0] * g[3],
        f[4] * g[0] + f[1] * g[2] + f[2] * g[1] + f[0] * g[4],
        f[5] * g[0] + 2 * f[2] * g[2] + f[0] * g[5],
    )


@kernel
def quotient(f: Jet, g: Jet) -> Jet:
    """Returns the jet of f / g, g not 0."""
    q = f[0] / g[0]
    x, y = (f[1] - q * g[1]) / g[0], (f[2] - q * g[2]) / g[0]
    return (
        q,
        x,
        y,
        (f[3] - 2 * x * g[1] - q * g[3]) / g[0],
        (f[4] - x * g[2] - y * g[1] - q * g[4]) / g[0],
        (f[5] - 2 * y * g[2] - q * g[5]) / g[0],
    )


@kernel
def total(f: Jet, g: Jet) -> Jet:
    """Returns the jet of f + g."""
    return f[0] + g[0], f[1] + g[1], f[2] + g[2], f[3] + g[3], f[4] + g[4], f[5] + g[5]


@kernel
def scaled(f: Jet, by: float) -> Jet:
    """Returns the jet of f times a number."""
    return by * f[0], by * f[1], by * f[2], by * f[3], by * f[4], by * f[5]


@kernel
def rest(f: Jet) -> Jet:
    """Returns the jet of 1 - f."""
    return 1 - f[0], -f[1], -f[2], -f[3], -f[4], -f[5]


@kernel
def composed(f: Jet, g: Line) -> Jet:
    """Returns the jet of g(f), where ``g`` is the value and the derivatives of g at f."""
    return (
        g[0],
        g[1] * f[1],
        g[1] * f[2],
        g[1] * f[3] + g[2] * f[1] * f[1],
        g[1] * f[4] + g[2] * f[1] * f[2],
        g[1] * f[5] + g[2] * f[2] * f[2],
    )


@kernel
def spline_jet(c: NDArray[np.float32], u: float, v: float, end: int) -> Jet:
    """Returns the jet of a cubic spline with B-spline coefficients ``c``, ``c[1, 1]`` at u = v = 0; cells 0..``end`` a
    side."""
    i, j = min(max(int(u), 0), end), min(max(int(v), 0), end)
    f, g = u - i, v - j
    a, b = weights(f), weights(g)
    value, across, twice = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for m in range(4):
        row = c[j + m]
        p = a[0][0] * row[i] + a[1][0] * row[i + 1] + a[2][0] * row[i + 2] + a[3][0] * row[i + 3]
        q = a[0][1] * row[i] + a[1][1] * row[i + 1] + a[2][1] * row[i + 2] + a[3][1] * row[i + 3]
        r = a[0][2] * row[i] + a[1][2] * row[i + 1] + a[2][2] * row[i + 2] + a[3][2] * row[i + 3]
        w = b[m]
        value = (value[0] + w[0] * p, value[1] + w[1] * p, value[2] + w[2] * p)
        across = (across[0] + w[0] * q, across[1] + w[1] * q, across[2])
        twice = (twice[0] + w[0] * r, twice[1], twice[2])
    return value[0], across[0], value[1], twice[0], across[1], value[2]


@kernel
def weights(f: float) -> tuple[Line, Line, Line, Line]:
    """The four cubic B-splines over a cell with their derivatives."""
    g = 1 - f
    return (
        (g * g * g / 6, -g * g / 2, g),
        (2 / 3 - f * f * (1 - f / 2), f * (1.5 * f - 2), 3 * f - 2),
        (2 / 3 - g * g * (1 - g / 2), -g * (1.5 * g - 2), 3 * g - 2),
        (f * f * f / 6, f * f / 2, f),
    )


@kernel
def linear_jet(c: NDArray[np.float32], u: float, v: float, end: int) -> Jet:
    """Returns the jet of a bilinear patch with samples ``c``."""
    i, j = min(max(int(u), 0), end), min(max(int(v), 0), end)
    f, g = u - i, v - j
    south, north = c[j, i + 1] - c[j, i], c[j + 1, i + 1] - c[j + 1, i]
    low, high = c[j, i] + south * f, c[j + 1, i] + north * f
    return low + (high - low) * g, south + (north - south) * g, high - low, 0.0, north - south, 0.0


@kernel
def taper_line(offset: float, per: float, smooth: bool) -> Line:
    """The weight of one axis at ``offset`` samples from the domain's middle, ``per`` one over its half side."""
    t = abs(offset) * per
    if t >= 1:
        return 0.0, 0.0, 0.0
    sign = per if offset >= 0 else -per
    s = 1 - t
    if smooth:
        return s * s * s * (3 * t + 1), -12 * t * s * s * sign, 12 * s * (3 * t - 1) * per * per
    return s, -sign, 0.0


@kernel
def fade_line(at: float, low: float, high: float, margin: float) -> Line:
    """1 from ``low`` to ``high``, 0 from ``margin`` beyond them on, a quintic smoothstep between."""
    out = max(low - at, at - high)
    if out <= 0:
        return 1.0, 0.0, 0.0
    if out >= margin:
        return 0.0, 0.0, 0.0
    t = 1 - out / margin
    sign = (1 if at < low else -1) / margin
    return (
        t * t * t * (t * (6 * t - 15) + 10),
        30 * t * t * (1 - t) * (1 - t) * sign,
        60 * t * (1 - t) * (1 - 2 * t) / (margin * margin),
    )
