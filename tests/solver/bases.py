"""Bases for the solver's tests: grounds without strokes given by a formula, the same at every level."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from esker import grid

Floats = NDArray[np.float64]
Formula = Callable[[Floats, Floats], Floats]


@dataclass(frozen=True, eq=False)
class Analytic:
    """A base by its formula of x and y in metres."""

    name: str
    formula: Formula
    low: float
    high: float
    size_m: float = 4096.0
    kept: dict[int, NDArray[np.float32]] = field(default_factory=dict)

    @property
    def digest(self) -> bytes:
        return hashlib.sha256(repr((self.name, self.size_m)).encode()).digest()

    def level(self, level: int, device: Any = None) -> NDArray[np.float32]:  # noqa: ARG002
        if level not in self.kept:
            self.kept[level] = self.window(level, slice(None), slice(None))
        return self.kept[level]

    def window(self, level: int, rows: slice, cols: slice, device: Any = None) -> NDArray[np.float32]:  # noqa: ARG002
        n, s = grid.samples(level), grid.spacing(level, self.size_m)
        y, x = (np.arange(n, dtype=np.float64)[part] * s for part in (rows, cols))
        out = np.broadcast_to(self.formula(x[None, :], y[:, None]), (len(y), len(x))).astype(np.float32)
        assert self.low <= out.min()
        assert out.max() <= self.high
        out.flags.writeable = False
        return out

    def survey(self, level: int) -> NDArray[np.float32]:
        n = grid.samples(level)
        return np.full((n, n), 3.5, dtype=np.float32)

    def changed(self, other: Any) -> grid.Rect | None:
        """As samples of level 4 tell."""
        rows, columns = np.nonzero(self.level(4) != other.level(4))
        if len(rows) == 0:
            return None
        s = grid.spacing(4, self.size_m)
        return grid.Rect(columns.min() * s, rows.min() * s, columns.max() * s, rows.max() * s).grown(s)


def plane(east: float, north: float, at: float = 0.0, size_m: float = 4096.0) -> Analytic:
    """Rises ``east`` metres a metre eastwards and ``north`` northwards, ``at`` metres high in the middle."""
    half = 0.5 * size_m * (abs(east) + abs(north)) + 1
    middle = size_m / 2
    return Analytic(
        f"plane {east} {north} {at}",
        lambda x, y: at + east * (x - middle) + north * (y - middle),
        at - half,
        at + half,
        size_m,
    )


def hills(amplitude: float = 150.0, wave: float = 1400.0, at: float = 300.0) -> Analytic:
    """Smooth hills and hollows."""
    k = 2 * math.pi / wave
    return Analytic(
        f"hills {amplitude} {wave} {at}",
        lambda x, y: at + amplitude * np.sin(k * x + 0.7) * np.cos(0.8 * k * y - 0.3),
        at - amplitude - 1,
        at + amplitude + 1,
    )


def hashed(i: NDArray[np.int64], j: NDArray[np.int64]) -> Floats:
    """Noise -1..1 by place."""
    h = (i * np.int64(73856093)) ^ (j * np.int64(19349663))
    h = (h ^ (h >> 13)) * np.int64(1274126177) & np.int64(0x7FFFFFFF)
    return np.asarray((h % 65536) / 32767.5 - 1)


def rough(amplitude: float = 6.0, cell: float = 8.0, under: Analytic | None = None) -> Analytic:
    """Hills with noise on them, a value every ``cell`` metres, bilinear between."""
    ground = under or hills()

    def noise(x: Floats, y: Floats) -> Floats:
        i, j = np.floor(x / cell).astype(np.int64), np.floor(y / cell).astype(np.int64)
        u, v = x / cell - i, y / cell - j
        south = (1 - u) * hashed(i, j) + u * hashed(i + 1, j)
        north = (1 - u) * hashed(i, j + 1) + u * hashed(i + 1, j + 1)
        return np.asarray((1 - v) * south + v * north)

    return Analytic(
        f"rough {amplitude} {cell} {ground.name}",
        lambda x, y: ground.formula(x, y) + amplitude * noise(x, y),
        ground.low - amplitude,
        ground.high + amplitude,
        ground.size_m,
    )


def mound(x0: float, y0: float, radius: float, height: float, on: Analytic) -> Analytic:
    """A base that differs from another within a circle."""

    def formula(x: Floats, y: Floats) -> Floats:
        share = np.maximum(1 - ((x - x0) ** 2 + (y - y0) ** 2) / radius**2, 0.0)
        return np.asarray(on.formula(x, y) + height * share**2)

    return Analytic(
        f"mound {x0} {y0} {radius} {height} on {on.name}",
        formula,
        min(on.low, on.low + height),
        max(on.high, on.high + height),
        on.size_m,
    )


def mirrored(base: Analytic) -> Analytic:
    """West for east."""
    return Analytic(
        f"mirror of {base.name}", lambda x, y: base.formula(base.size_m - x, y), base.low, base.high, base.size_m
    )
