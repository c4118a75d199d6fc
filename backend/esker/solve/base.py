"""The base that strokes are drawn over, as the solver sees it (DESIGN 5.1, 5.2), and what a stroke is to it.

The solver knows heights above the base, d = height - base. Crests are drawn at heights of the ground, so at each sample
a cross-section rises from, or sinks below, the base there: where it is lower than the crest the stroke fills, where it
is higher the stroke cuts.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from esker import grid

Floats = NDArray[np.float64]

SIDES_LEVEL: Final = 4
"""Level of the base by which it is told whether a stroke fills or cuts: one for all, so that all levels agree."""
BOUNDS_M: Final = 64.0
"""Bounds of a base are taken at multiples of this: strokes are packed anew when they change."""
SLIGHT_M: Final = 1 / 16
"""Heights above the base below this many cells of SIDES_LEVEL say nothing of filling or cutting."""
SIDES_FROM: Final = 0.05
SIDES_TO: Final = 0.25
"""A stroke that does something (fills, cuts) on less than the first share of its section counts as not doing it; from
the second share on it counts fully."""


class Base(Protocol):
    """The ground without strokes (``patchwork.base.Base``). Immutable; equal digests, equal bits."""

    @property
    def digest(self) -> bytes: ...
    @property
    def low(self) -> float: ...
    @property
    def high(self) -> float: ...

    def level(self, level: int, device: Any = None) -> NDArray[np.float32]:
        """(N, N) float32 of a level, metres, row 0 south, read-only."""

    def window(self, level: int, rows: slice, cols: slice, device: Any = None) -> NDArray[np.float32]:
        """Any samples of any level: the bits of ``level`` where it has them."""

    def survey(self, level: int) -> NDArray[np.float32]:
        """(N, N) float32: the level of detail of the data (``Channel.SURVEY``)."""

    def changed(self, other: Any) -> grid.Rect | None:
        """Where two bases differ, world metres; None: nowhere."""


@dataclass(frozen=True)
class Bound:
    """A base that is always computed on one device (None: on the CPU): kinds of devices differ in their last bits, and
    all that a solve reads of a base must agree."""

    base: Base
    device: Any

    @property
    def digest(self) -> bytes:
        """The digest of the base."""
        return self.base.digest

    @property
    def low(self) -> float:
        """The lowest height of the base."""
        return self.base.low

    @property
    def high(self) -> float:
        """The highest height of the base."""
        return self.base.high

    def level(self, level: int, device: Any = None) -> NDArray[np.float32]:  # noqa: ARG002
        """The level of the base, on the bound device."""
        return self.base.level(level, self.device)

    def window(self, level: int, rows: slice, cols: slice, device: Any = None) -> NDArray[np.float32]:  # noqa: ARG002
        """A window of the base, on the bound device."""
        return self.base.window(level, rows, cols, self.device)

    def survey(self, level: int) -> NDArray[np.float32]:
        """The data level of the base."""
        return self.base.survey(level)

    def changed(self, other: Any) -> grid.Rect | None:
        """The rectangle outside of which the two bases are equal."""
        return self.base.changed(other.base if isinstance(other, Bound) else other)


def bound(base: Base | None, device: Any) -> Bound | None:
    """A base bound to a device; None for none."""
    return None if base is None else Bound(base, device)


@dataclass(frozen=True)
class BaseUnderStroke:
    """The base under one stroke, as far as packing needs it.

    Every height of the base is within ``half`` of ``datum``, metres. fill, cut: how far the stroke's bands fill ground
    below its crest and cut ground above it, 0..1.
    """

    datum: float = 0.0
    half: float = 0.0
    fill: float = 1.0
    cut: float = 1.0

    def tops(self, heights: ArrayLike) -> Floats:
        """The most that crests of these heights can be above or below the base anywhere."""
        return np.asarray(np.abs(np.asarray(heights, dtype=np.float64) - self.datum) + self.half)


FLAT: Final = BaseUnderStroke()
"""Flat ground: a plane at 0."""


def bounds_of(base: Base) -> tuple[float, float]:
    """Bounds of a base, metres, that hardly ever change while a layer is dragged."""
    return math.floor(base.low / BOUNDS_M) * BOUNDS_M, math.ceil(base.high / BOUNDS_M) * BOUNDS_M


def ground_under(base: Base | None, points: Floats, plateau_m: float, closed: bool, size_m: float) -> BaseUnderStroke:
    """Returns the base under a stroke with this crest, (n, 3) metres; ``FLAT`` without a base."""
    if base is None:
        return FLAT
    low, high = bounds_of(base)
    datum, half = 0.5 * (high + low), 0.5 * (high - low)
    fill, cut = _sides(base, points, plateau_m, closed, size_m)
    return BaseUnderStroke(datum, half, fill, cut)


def _sides(base: Base, points: Floats, plateau_m: float, closed: bool, size_m: float) -> tuple[float, float]:
    """Does a stroke fill, cut, or do both? By the edges of its plateau, where its flanks begin, as in road building.

    Without this a ridge in a valley would cut into walls that are steeper than its flanks, far away from it.
    """
    s = grid.spacing(SIDES_LEVEL, size_m)
    line = _walked(np.vstack([points, points[:1]]) if closed else points, s)
    step = np.gradient(line[:, :2], axis=0) if len(line) > 1 else np.zeros((1, 2))
    long = np.hypot(step[:, 0], step[:, 1])[:, None]
    side = np.column_stack([-step[:, 1], step[:, 0]]) / np.maximum(long, 1e-12) * plateau_m
    edges = [line[:, :2]] if plateau_m == 0 else [line[:, :2] + side, line[:, :2] - side]
    above = np.concatenate([line[:, 2] - under(base, size_m, edge) for edge in edges])
    slight = SLIGHT_M * s
    filled, cut = (float(np.maximum(v, 0.0).mean()) + slight for v in (above, -above))
    both = filled + cut
    return _ramp(filled / both), _ramp(cut / both)


def _ramp(share: float) -> float:
    t = min(max((share - SIDES_FROM) / (SIDES_TO - SIDES_FROM), 0.0), 1.0)
    return t * t * (3 - 2 * t)


def _walked(points: Floats, step: float) -> Floats:
    """A polyline (n, 3) with a point at least every ``step`` metres in plan."""
    lengths = np.hypot(*np.diff(points[:, :2], axis=0).T) if len(points) > 1 else np.zeros(0)
    along = np.concatenate([[0.0], np.cumsum(lengths)])
    count = int(min(max(np.ceil(along[-1] / step), 1), 1 << 16))
    at = np.linspace(0, along[-1], count + 1) if along[-1] > 0 else np.zeros(1)
    return np.column_stack([np.interp(at, along, points[:, k]) for k in range(3)])


def under(base: Base, size_m: float, places: Floats) -> Floats:
    """A base at places (m, 2) in metres by its samples of SIDES_LEVEL, bilinear; beyond the domain its border's."""
    level = base.level(SIDES_LEVEL)
    last = len(level) - 1
    x, y = np.clip(places.T / grid.spacing(SIDES_LEVEL, size_m), 0, last)
    i, j = np.minimum(x.astype(int), last - 1), np.minimum(y.astype(int), last - 1)
    u, v = x - i, y - j
    south = level[j, i] + u * (level[j, i + 1] - level[j, i])
    north = level[j + 1, i] + u * (level[j + 1, i + 1] - level[j + 1, i])
    return np.asarray(south + v * (north - south), dtype=np.float64)
