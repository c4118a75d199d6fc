"""Terrains that tests synthesise on."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from esker import grid
from esker.synthesis.site import Biases, Grid, Site
from esker.synthesis.state import State

SIZE = 4096.0
TOP = 13
"""Cells of half a centimetre on 4,096 m, the finest of this size."""


def heights(level: int, size: float = SIZE, periodic: bool = False) -> Grid:
    """A mountain, a valley and a plain below the sea; or waves that fit the domain."""
    n = grid.samples(level)
    y, x = np.mgrid[0:n, 0:n] / (n - 1)
    if periodic:
        z = 160 * np.sin(2 * np.pi * (x + 0.2)) * np.cos(4 * np.pi * y) + 90 * np.sin(6 * np.pi * x)
        z[:, -1], z[-1, :] = z[:, 0], z[0, :]
    else:
        z = 900 * np.exp(-(((x - 0.45) / 0.2) ** 2) - ((y - 0.4) / 0.15) ** 2) - 60 * np.cos(7 * x + 3 * y) + 120 * y
    q = grid.quantum(level, size)
    return np.asarray(np.rint(z * size / SIZE / q) * q, dtype=np.float32)


def tilt(slope: float, level: int = 0, height: float = 0.0) -> Grid:
    """A plane that rises to the north."""
    n = grid.samples(level)
    y = np.arange(n)[:, None] * (SIZE / (n - 1)) * np.ones(n)
    return np.asarray(height + slope * y, dtype=np.float32)


def channels(seed: int = 5) -> dict[str, Grid]:
    """Something of every channel, on grids of several sizes."""
    rng = np.random.default_rng(seed)
    out = {}
    ranges = {"amplitude": (-2.0, 20.0), "roughness": (0.0, 1.0), "survey": (-1.0, 4.0), "far": (0.0, 1.0)}
    for side, name in zip((2, 3, 5, 9, 17, 5, 9, 3, 65), Biases._fields, strict=True):
        low, high = ranges.get(name, (-1.0, 1.0))
        out[name] = rng.uniform(low, high, (side, side)).astype(np.float32)
    return out


def hill(solved: int = 2, **fields: Any) -> Site:
    """The mountain by the sea."""
    return Site(SIZE, fields.pop("seed", 1), tuple(heights(k) for k in range(solved + 1)), **fields)


def plane(slope: float, height: float = 0.0, **fields: Any) -> Site:
    """Ground of one slope."""
    return Site(SIZE, fields.pop("seed", 1), (tilt(slope, 0, height),), **fields)


def everywhere(**values: float) -> dict[str, Grid]:
    """Channels that ask the same everywhere."""
    return {name: np.full((2, 2), value, dtype=np.float32) for name, value in values.items()}


def same(a: State, b: State, at: tuple[slice, slice], there: tuple[slice, slice]) -> bool:
    """Whether two states hold the same bits where they overlap."""
    return all(np.array_equal(x[at], y[there]) for x, y in zip(a, b, strict=True))


def rms(z: NDArray[np.floating]) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(np.square(z, dtype=np.float64))))
