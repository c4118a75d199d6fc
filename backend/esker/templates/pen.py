"""A sure hand for drawing starting terrains in code: ridges, crevices, plateaux and rings as strokes.

A profile stroke lies in one vertical plane, so a chain that bends is drawn leg by leg, as a person would.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np
from scipy.interpolate import PchipInterpolator

from esker.contract import Document, Flank, FlankShape, Stroke, StrokeKind, TerrainSettings
from esker.document.strokes import level_curve

Point = tuple[float, float, float]
Side = tuple[float, float] | None


class Pen:
    """Collects strokes. Every wobble comes from the seed, so drawing twice gives the same document."""

    def __init__(self, name: str, seed: int, shape: FlankShape = "concave") -> None:
        self.name, self.shape = name, shape
        self.rng = np.random.default_rng(seed)
        self.strokes: list[Stroke] = []

    def chain(
        self, points: Sequence[Point], left: Side, right: Side, *, wobble: float = 0.025, label: str = ""
    ) -> None:
        """A mountain chain or a crevice through ``points`` (x, y, height in metres), one profile stroke a leg.

        Heights follow a monotone spline along the whole chain; ``wobble`` roughens the silhouette by that part of the
        local height, less towards the joints, so that legs meet. Flanks are (slope in degrees, extent in metres).
        """
        pts = np.asarray(points, dtype=np.float64)
        run = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(pts[:, :2], axis=0).T))])
        height = PchipInterpolator(run, pts[:, 2])
        for i in range(len(pts) - 1):
            n = max(6, round(float(run[i + 1] - run[i]) / 40))
            u = np.linspace(0, 1, n + 1)
            z = height(run[i] + u * (run[i + 1] - run[i]))
            z += z * wobble * self._noise(u) * np.sin(math.pi * u) ** 0.5
            ends = tuple((round(float(pts[j, 0]), 2), round(float(pts[j, 1]), 2), 0.0) for j in (i, i + 1))
            curve = tuple((round(float(a), 5), round(float(b), 2)) for a, b in zip(u, z, strict=True))
            self._put("profile", ends[0], ends[1], curve, left, right, label=label)

    def massif(
        self,
        crest: Sequence[Point],
        slope: float,
        *,
        spacing: float = 420.0,
        reach: float = 1.35,
        spurs: int = 2,
        foot: float = 0.0,
        label: str = "",
        meander: float = 0.1,
    ) -> None:
        """A ridge with spurs that branch off on both sides, again with spurs of their own (``spurs`` generations).

        A spur falls more gently than the flank it stands on, so that it stays above it: ``reach`` is its length over
        the width of that flank. ``foot`` is the height at which a spur ends, as a share of that at which it begins. A
        spur that runs into a sea ends at 0. One that ends in a valley must end above the valley's ground: a tip below
        that ground is a pit, in which water stands.
        """
        path = self._bent(crest, meander)
        self.chain(path, (slope, 4000), (slope, 4000), wobble=0.025, label=label)
        self._branch(path, slope, spacing, reach, spurs, foot, label)

    def _branch(
        self, path: Sequence[Point], slope: float, spacing: float, reach: float, left: int, foot: float, label: str
    ) -> None:
        pts = np.asarray(path)
        run = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(pts[:, :2], axis=0).T))])
        side = float(self.rng.choice([-1.0, 1.0]))
        at = spacing * self.rng.uniform(0.35, 0.7)
        while left > 0 and at < run[-1] - 0.3 * spacing:
            x, y, z = (float(np.interp(at, run, pts[:, i])) for i in range(3))
            ahead = min(at + 60, run[-1])
            tx, ty = (float(np.interp(ahead, run, pts[:, i]) - np.interp(ahead - 120, run, pts[:, i])) for i in (0, 1))
            length = reach * z / math.tan(math.radians(slope)) * float(self.rng.uniform(0.85, 1.15))
            if length > 0.5 * spacing:
                angle = math.atan2(ty, tx) + side * math.radians(float(self.rng.uniform(58, 84)))
                spur = self.spur((x, y, z * 0.985), angle, length, foot)
                self.chain(spur, (slope, 4000), (slope, 4000), wobble=0.03, label=f"{label} spur")
                self._branch(spur, slope, spacing * 0.72, reach * 0.9, left - 1, foot, label)
            side = -side
            at += 0.5 * spacing * float(self.rng.uniform(0.75, 1.3))

    def spur(self, root: Point, angle: float, length: float, foot: float = 0.0, legs: int = 0) -> list[Point]:
        """A spur in a few legs that wander off the straight line, from the root down to ``foot`` times its height."""
        legs = legs or max(3, round(length / 260))
        out = [root]
        x, y, _ = root
        for i in range(1, legs + 1):
            angle += math.radians(float(self.rng.normal(0, 11)))
            x, y = x + length / legs * math.cos(angle), y + length / legs * math.sin(angle)
            t = i / legs
            above = root[2] * (1 - t) ** 1.12 * (1 if i == legs else float(self.rng.uniform(0.93, 1.07)))
            out.append((x, y, foot * root[2] + (1 - foot) * above))
        return out

    def _bent(self, points: Sequence[Point], meander: float) -> list[Point]:
        """The chain with every leg split in two, its middle moved sideways and a little up or down."""
        out: list[Point] = [points[0]]
        for (ax, ay, az), (bx, by, bz) in itertools.pairwise(points):
            q = meander * float(self.rng.uniform(-1, 1))
            mid = (0.5 * (az + bz)) * float(self.rng.uniform(0.92, 1.06))
            out += [(0.5 * (ax + bx) - q * (by - ay), 0.5 * (ay + by) + q * (bx - ax), mid), (bx, by, bz)]
        return out

    def plateau(
        self,
        outline: Sequence[tuple[float, float]],
        height: float,
        flank: Side,
        *,
        radius: float = 0.0,
        closed: bool = True,
        label: str = "",
        smooth: int = 8,
    ) -> None:
        """A plateau at ``height`` metres along a smooth curve through ``outline``; a closed one is flat inside."""
        path = smooth_path(outline, closed, smooth)
        first = (round(float(path[0, 0]), 2), round(float(path[0, 1]), 2), height)
        far = int(np.argmax(np.hypot(*(path - path[0]).T))) if closed else len(path) - 1
        last = (round(float(path[far, 0]), 2), round(float(path[far, 1]), 2), height)
        curve = tuple((round(a, 5), round(b, 5)) for a, b in level_curve(path, first, last))
        self._put("level", first, last, curve, flank, flank, radius=radius, label=label)

    def ring(
        self, x: float, y: float, r: float, height: float, flank: Side, *, uneven: float = 0.12, n: int = 9
    ) -> None:
        """A roughly round closed plateau."""
        angle = np.linspace(0, 2 * math.pi, n, endpoint=False) + self.rng.uniform(0, 1)
        radius = r * (1 + uneven * self.rng.uniform(-1, 1, n))
        self.plateau(
            [(x + q * math.cos(a), y + q * math.sin(a)) for a, q in zip(angle, radius, strict=True)], height, flank
        )

    def _noise(self, u: np.ndarray) -> np.ndarray:
        """Fractal wobble in -1..1 along a leg."""
        out = np.zeros_like(u)
        for octave in range(1, 5):
            out += np.sin(2 * math.pi * (u * 1.7 * 2**octave / 2 + self.rng.uniform())) / 1.8**octave
        return out

    def _put(
        self,
        kind: StrokeKind,
        first: Point,
        last: Point,
        curve: tuple[tuple[float, float], ...],
        left: Side,
        right: Side,
        *,
        radius: float = 0.0,
        label: str = "",
    ) -> None:
        flanks = [
            Flank(slope_deg=float(s[0]), extent_m=float(s[1]), shape=self.shape) if s is not None else None
            for s in (left, right)
        ]
        self.strokes.append(
            Stroke(
                id=f"{self.name}-{len(self.strokes) + 1:03d}",
                author="Esker",
                kind=kind,
                first=first,
                last=last,
                curve=curve,
                left=flanks[0],
                right=flanks[1],
                plateau_radius_m=radius,
                label=label,
                finished=True,
            )
        )

    def document(self, settings: TerrainSettings) -> Document:
        """The drawing as a document at clock 0."""
        return Document(id=self.name, clock=0, settings=settings, strokes=tuple(self.strokes))


def smooth_path(points: Sequence[tuple[float, float]], closed: bool, each: int) -> np.ndarray:
    """Centripetal Catmull-Rom curve through the points, shape (n, 2), ``each`` samples a span."""
    p = np.asarray(points, dtype=np.float64)
    p = np.vstack([p[-1], p, p[0], p[1]]) if closed else np.vstack([2 * p[0] - p[1], p, 2 * p[-1] - p[-2]])
    out = []
    for a, b, c, d in zip(p, p[1:], p[2:], p[3:], strict=False):
        knots = np.concatenate(
            [[0.0], np.cumsum([max(np.hypot(*(q - r)), 1e-9) ** 0.5 for q, r in ((b, a), (c, b), (d, c))])]
        )
        t = np.linspace(knots[1], knots[2], each, endpoint=False)[:, None]
        a1 = (knots[1] - t) / (knots[1] - knots[0]) * a + (t - knots[0]) / (knots[1] - knots[0]) * b
        a2 = (knots[2] - t) / (knots[2] - knots[1]) * b + (t - knots[1]) / (knots[2] - knots[1]) * c
        a3 = (knots[3] - t) / (knots[3] - knots[2]) * c + (t - knots[2]) / (knots[3] - knots[2]) * d
        b1 = (knots[2] - t) / (knots[2] - knots[0]) * a1 + (t - knots[0]) / (knots[2] - knots[0]) * a2
        b2 = (knots[3] - t) / (knots[3] - knots[1]) * a2 + (t - knots[1]) / (knots[3] - knots[1]) * a3
        out.append((knots[2] - t) / (knots[2] - knots[1]) * b1 + (t - knots[1]) / (knots[2] - knots[1]) * b2)
    path = np.vstack(out)
    return np.vstack([path, path[0] if closed else p[-2]])
