"""Heights of a profile's crest, at ever coarser scales (docs/decisions/0011-natural-flanks.md). NumPy float64.

What a sample far from the crest sees of a jagged silhouette is a smooth one: else every tooth runs down the whole flank
as a streak. The scales are octaves: a pyramid of binomial filters whose values are controls of cubic B-splines.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from esker.solve.constraints.crest import Crest
from esker.solve.constraints.tables import FAN, FIRST_OCTAVE, OCTAVE_SHARE

Floats = NDArray[np.float64]

BLOCKS = 48
"""Parts of a crest for which it is known how high it can seem from anywhere."""
_B_SPLINE = np.array([[1, 4, 1, 0], [-3, 0, 3, 0], [3, -6, 3, 0], [-1, 3, -3, 1]]) / 6
_WITHIN = (np.arange(8) + 0.5) / 8 - 0.5
"""Where a crest is sampled for one control of the first octave, as shares of the distance between two."""
_MARGIN = 3
"""Controls beyond the ends that the filter needs; two of them stay."""


@dataclass(frozen=True)
class Silhouette:
    """A profile's crest. Lengths in metres, arrays float64.

    start, unit: where it begins and its direction in plan; length in plan; t (n,): distances of the knots from the
    start, rising; z (n,): their heights; octaves: per octave o the controls at multiples of 2^o first ones from
    ``middle``, the first one before piece ``firsts[o]``; a crest is constant beyond its ends. datum: from where
    ``blocks`` measures heights. edition: of the rules (CURRENT_EDITION).
    """

    start: Floats
    unit: Floats
    length: float
    t: Floats
    z: Floats
    octaves: tuple[Floats, ...]
    octave_m: float
    datum: float = 0.0
    middle: float = 0.0
    firsts: tuple[int, ...] = ()
    edition: int = 1

    @cached_property
    def pieces(self) -> tuple[Floats, ...]:
        """Per octave the cubics (m, 4) between its controls: coefficients of 1, f, f^2, f^3, f the share of a piece."""
        if not self.octaves:
            return ()
        c, starts = self._behind_each_other
        table = (_B_SPLINE @ np.array([c[:-3], c[1:-2], c[2:-1], c[3:]])).T
        return tuple(table[at : at + len(o) - 3] for at, o in zip(starts, self.octaves, strict=True))

    @cached_property
    def _behind_each_other(self) -> tuple[Floats, NDArray[np.int64]]:
        """The controls of all octaves and where each begins: one pass of array calls serves them all."""
        lengths = np.array([len(o) for o in self.octaves])
        return np.concatenate(self.octaves), np.cumsum(lengths) - lengths

    @cached_property
    def blocks(self) -> tuple[Floats, Floats]:
        """Borders (m + 1,) of parts of the crest, metres, and the most (m,) that each can seem apart from the datum."""
        count = min(max(math.ceil(self.length / (4 * self.octave_m)), 1), BLOCKS)
        edges = np.arange(count + 1, dtype=np.float64) * (self.length / count)
        high = np.abs(np.interp(edges, self.t, self.z) - self.datum)
        tops: Floats = np.maximum(high[:-1], high[1:])
        place = np.minimum(edges.searchsorted(self.t, side="right") - 1, count - 1)
        np.maximum.at(tops, place, np.abs(self.z - self.datum))
        if self.octaves:
            controls, starts = self._behind_each_other
            c = np.abs(controls - self.datum)
            seen = np.maximum(np.maximum(c[:-3], c[1:-2]), np.maximum(c[2:-1], c[3:]))
            steps = self.octave_m * 2.0 ** np.arange(len(starts))[:, None]
            piece = np.floor((edges - self.middle) / steps).astype(int) - np.array(self.firsts)[:, None]
            at = starts[:, None] + np.minimum(np.maximum(piece, 0), np.diff(starts, append=len(c))[:, None] - 4)
            between = np.maximum.reduceat(seen, at[:, :-1].ravel()).reshape(len(starts), -1)
            tops = np.maximum(tops, np.maximum(between, seen[at[:, 1:]]).max(axis=0))
        return edges, tops


def silhouette(crest: Crest, size_m: float, farthest_m: float, datum: float = 0.0, edition: int = 1) -> Silhouette:
    """The silhouette of a profile; octaves only as far as samples ``farthest_m`` from the plateau can see them.

    ``edition``: 1 counts controls from the first end, 2 from the middle, so that from the other end it is the same.
    """
    points, base = crest.points, size_m * FIRST_OCTAVE
    start = points[0, :2]
    axis = points[-1, :2] - start
    length = float(np.hypot(*axis))
    unit = axis / length if length > 0 else np.array([1.0, 0.0])
    t = np.minimum(np.maximum((points[:, :2] - start) @ unit, 0.0), length)
    t[-1] = length
    rising = np.append(np.maximum.accumulate(t)[:-1] < t[1:], True) if len(t) > 1 else np.ones(1, dtype=bool)
    t, z = t[rising], points[rising, 2]
    count = 0
    while base * 2**count <= length * OCTAVE_SHARE and FAN * base * (2**count - 1) < farthest_m:
        count += 1
    if edition == 1:
        return Silhouette(start, unit, length, t, z, tuple(_octaves(t, z, base, count)), base, datum, 0.0, (0,) * count)
    middle = 0.5 * length
    halves = [math.floor(middle / (base * 2**o)) + 1 for o in range(count)]
    octaves = tuple(_mirrored_octaves(t, z, base, middle, halves))
    return Silhouette(start, unit, length, t, z, octaves, base, datum, middle, tuple(-half for half in halves), edition)


def _octaves(t: Floats, z: Floats, base: float, count: int) -> list[Floats]:
    """Controls of ``count`` octaves of a polyline (t, z), see ``Silhouette``."""
    if count == 0:
        return []
    last = math.floor(t[-1] / base) + 1
    nodes = np.arange(-_MARGIN, last + _MARGIN + 1)[:, None]
    # Means of samples, not differences of a running integral: what lies far along the crest changes no bit here.
    level = np.interp((nodes + _WITHIN) * base, t, z).mean(axis=1)
    out = [level[_MARGIN - 1 : len(level) - _MARGIN + 2]]
    while len(out) < count:
        blurred = _blurred(level)
        last = last // 2 + 1
        index = np.minimum(np.maximum(np.arange(-_MARGIN, 2 * (last + _MARGIN) + _MARGIN + 1, 2), 0), len(blurred) - 1)
        level = blurred[index]
        out.append(level[_MARGIN - 1 : len(level) - _MARGIN + 2])
    return out


def _mirrored_octaves(t: Floats, z: Floats, base: float, middle: float, halves: list[int]) -> list[Floats]:
    """Computes the octaves with controls counted from ``middle``, ``halves[o]`` pieces on each side of it."""
    out: list[Floats] = []
    level = np.zeros(0)
    for o, half in enumerate(halves):
        if o == 0:
            nodes = np.arange(-half - _MARGIN, half + _MARGIN + 1)[:, None]
            level = np.interp(middle + (nodes + _WITHIN) * base, t, z).mean(axis=1)
        else:
            index = 2 * np.arange(-half - _MARGIN, half + _MARGIN + 1) + halves[o - 1] + _MARGIN
            level = _blurred(level)[np.minimum(np.maximum(index, 0), len(level) - 1)]
        out.append(level[_MARGIN - 1 : len(level) - _MARGIN + 2])  # one to spare, as rounding may reach the end
    return out


def _blurred(level: Floats) -> Floats:
    """Binomial means of five, with the ends repeated."""
    wide = np.concatenate([level[:1], level[:1], level, level[-1:], level[-1:]])
    return np.asarray((wide[:-4] + wide[4:] + 4 * (wide[1:-3] + wide[3:-1]) + 6 * wide[2:-2]) / 16)
