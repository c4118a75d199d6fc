"""Strokes drawn by an adversary: on the lattice, at both ends of every range, coincident, folded, without length.

Where float32 and float64 decide otherwise, what they decide about lies on a border: a sample on a crest line, at the
end of a band, as far from two segments, at a crest of no height. Round numbers put it there.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from esker.api.terrain import Stroke as Make
from esker.contract import Border, Flank, FlankShape, Stroke, TerrainSettings
from tests.solver.scenes import SIZE

LATTICE = (0.0, 64.0, 256.0, 512.0, 1000.0, 1024.0, SIZE / 3, 2048.0, 2560.0, 3072.0, SIZE, -100.0, 4200.0)
HEIGHTS = (0.0, 1e-9, -1e-9, 1.0, 10.0, 100.0, -100.0, 300.0, -300.0, 1000.0)
SLOPES = (0.0, 1e-3, 5.0, 30.0, 45.0, 60.0, 85.0)
EXTENTS = (0.0, 1e-3, 1.0, 64.0, 90.0, 256.0, 512.0, SIZE, 65536.0)
PLATEAUX = (0.0, 0.0, 0.0, 0.0, 1e-3, 16.0, 64.0, 100.0)
REACHES = (128.0, 128.0, None, 32.0, 1000.0, SIZE)
SHAPES: tuple[FlankShape, ...] = ("straight", "concave", "convex")
Points = NDArray[np.float64]


class Adversary:
    """Scenes of a seed. Any number is one of a few awkward ones, or any of its range."""

    def __init__(self, seed: int) -> None:
        self.rng = np.random.default_rng(seed)

    def scene(self, count: int | None = None) -> tuple[list[Stroke], TerrainSettings]:
        strokes: list[Stroke] = []
        for k in range(count or int(self.rng.integers(1, 5))):
            again = bool(strokes) and self._chance(0.2)
            strokes.append(self._again(strokes[-1], f"s{k}") if again else self._stroke(f"s{k}"))
        border: Border = "pinned" if self._chance(0.3) else "free"
        return strokes, TerrainSettings(reach_m=REACHES[self.rng.integers(len(REACHES))], border=border)

    def _chance(self, share: float) -> bool:
        return bool(self.rng.random() < share)

    def _one(self, awkward: tuple[float, ...], low: float, high: float) -> float:
        """One of these, a number between two bounds, or a whole one."""
        kind = self.rng.random()
        any_ = float(self.rng.uniform(low, high))
        return float(self.rng.choice(awkward)) if kind < 0.75 else any_ if kind < 0.9 else float(round(any_))

    def _place(self) -> Points:
        return np.array([self._one(LATTICE, 0, SIZE) for _ in range(2)])

    def _flank(self) -> Flank | None:
        if self._chance(0.25):
            return None
        slope, extent = self._one(SLOPES, 1, 80), self._one(EXTENTS, 10, 1000)
        return Flank(slope_deg=slope, extent_m=extent, shape=SHAPES[self.rng.integers(3)])

    def _again(self, stroke: Stroke, name: str) -> Stroke:
        """A stroke on another one, with the same flanks or with others."""
        fields = {"left": self._flank(), "right": self._flank()} if self._chance(0.7) else {}
        return stroke.model_copy(update={"id": name, **fields})

    def _stroke(self, name: str) -> Stroke:
        left = self._flank()
        right = left if self._chance(0.4) else self._flank()
        plateau = self._one(PLATEAUX, 0, 300)
        profile = self._chance(0.5)
        make, points = (Make.profile, self._profile()) if profile else (Make.level, self._outline())
        return make(points, left=left, right=right, id=name, plateau_radius_m=plateau)

    def _profile(self) -> Points:
        """Along the lattice, a diagonal or any line, or without length; folded, with walls, of one height."""
        a, b, kind = self._place(), self._place(), self.rng.random()
        if kind < 0.6:
            b[int(kind < 0.3)] = a[int(kind < 0.3)]
        elif kind < 0.8:
            b = a + (b - a)[0] if kind < 0.7 else a + (0.0 if kind < 0.75 else 1e-9)
        u = self.rng.random(int(self.rng.integers(2, 7)))
        u = np.concatenate([[0], np.sort(u), [1]]) if self._chance(0.8) else u
        u = np.round(u * 4) / 4 if self._chance(0.3) else u
        if self._chance(0.15):
            u[-1] = u[-2] + 1e-8
        z = [self._one(HEIGHTS, -500, 500) for _ in u]
        z = z if self._chance(0.7) else [z[0]] * len(u)
        return np.column_stack([a + u[:, None] * (b - a), z])

    def _outline(self) -> Points:
        """Any points of the lattice, part of a rectangle, an arc, a circle once or twice, a line there and back."""
        kind, at, count = self.rng.random(), self._place(), int(self.rng.integers(1, 9))
        if kind < 0.4:
            line = np.array([self._place() for _ in range(count)])
        elif kind < 0.6:
            sides = self.rng.choice([64.0, 256.0, 500.0, 1000.0], 2)
            line = at + (sides * [[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]])[: int(self.rng.integers(3, 6))]
        elif kind < 0.8:
            angle = np.linspace(0, 2 * math.pi * self.rng.choice([0.5, 0.98, 1, 2]), 40)[:, None]
            line = at + self.rng.uniform(50, 800) * np.hstack([np.cos(angle), np.sin(angle)])
        else:
            line = np.array([self._place() for _ in range(count)])
            line = np.vstack([line, line[::-1]])
        line = np.repeat(line, 2, axis=0) if self._chance(0.3) else line
        return np.column_stack([line, np.full(len(line), self._one(HEIGHTS, -500, 500))])
