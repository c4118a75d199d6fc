"""Stroke scenes for the solver's tests: seeded, resolution independent, 4096 m wide unless told otherwise."""

from __future__ import annotations

import math

import numpy as np

from esker.api.terrain import Stroke as Make
from esker.contract import Flank, FlankShape, Stroke, TerrainSettings

SIZE = 4096.0
SETTINGS = TerrainSettings()
ENDLESS = TerrainSettings(reach_m=None)
PINNED = TerrainSettings(border="pinned")


def flank(slope: float = 35.0, extent: float = 512.0, shape: FlankShape = "concave") -> Flank:
    return Flank(slope_deg=slope, extent_m=extent, shape=shape)


def ridge(
    a: tuple[float, float],
    b: tuple[float, float],
    height: float = 225.0,
    side: Flank | None = None,
    name: str = "ridge",
) -> Stroke:
    """A mountain from a to b with a round silhouette."""
    u = np.linspace(0, 1, 40)
    points = np.column_stack([a[0] + u * (b[0] - a[0]), a[1] + u * (b[1] - a[1]), height * np.sin(math.pi * u)])
    return Make.profile(points, left=side, right=side, id=name)


def wall(angle_deg: float, height: float, length: float, side: Flank | None, size: float = SIZE) -> Stroke:
    """A crest of one height through the middle of the domain."""
    t = np.array([math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))])
    a, b = size / 2 - t * length / 2, size / 2 + t * length / 2
    return Make.profile([(*a, height), (*b, height)], left=side, right=side, id="wall")


def loop(x: float, y: float, radius: float, height: float, side: Flank | None = None, name: str = "loop") -> Stroke:
    """A plateau outline, counter-clockwise, not quite closed."""
    a = np.linspace(0, 2 * math.pi * 0.98, 60)
    points = np.column_stack([x + radius * np.cos(a), y + radius * np.sin(a), np.full(60, height)])
    return Make.level(points, left=side, right=side, id=name)


def mixed(count: int, seed: int = 1) -> list[Stroke]:
    """Ridges, crevices and plateaux of all sizes and directions, crossing each other."""
    rng = np.random.default_rng(seed)
    shapes: tuple[FlankShape, ...] = ("straight", "concave", "convex")
    out = []
    for k in range(count):
        x, y = rng.uniform(0.05, 0.95, 2) * SIZE
        angle, length = rng.uniform(0, 2 * math.pi), rng.uniform(0.08, 0.3) * SIZE
        side = flank(float(rng.uniform(20, 50)), float(rng.uniform(150, 600)), shapes[k % 3]) if k % 5 else None
        height = float(rng.uniform(40, 400)) * (-0.5 if k % 4 == 3 else 1)
        if k % 6 == 5:
            out.append(loop(x, y, length / 4, height, side, f"s{k}"))
        else:
            end = x + length * math.cos(angle), y + length * math.sin(angle)
            out.append(ridge((x, y), end, height, side, f"s{k}"))
    return out


SCENES = {
    "one": [ridge((1200, 1500), (2800, 2400), 225, flank())],
    "five": mixed(5, 3),
    "fifty": mixed(50, 2),
    "cross": [
        ridge((600, 1300), (3500, 2700), 500, flank(30), "a"),
        ridge((700, 3100), (3400, 900), -200, flank(40, shape="straight"), "b"),
    ],
    "loops": [loop(1500, 1600, 500, 200, flank(), "a"), loop(2700, 2500, 700, -120, flank(45), "b")],
    "tiny": [ridge((1680, 1510), (1700, 1524), 40, None, "tiny")],
    "bare": [ridge((900, 900), (3200, 2900), 300, None, "a"), ridge((900, 3000), (3000, 1200), 100, None, "b")],
}
