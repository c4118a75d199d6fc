"""Small layers for the tests of queries, blending and bases: analytic and rough ground, laid at any angle."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from esker.contract import Layer
from esker.patchwork.lod import space
from esker.patchwork.lod.space import Model, Placed
from esker.patchwork.raster import rasters

Floats = NDArray[np.float64]
Ground = Callable[[Floats, Floats], Floats]


def placed(heights: NDArray[Any], name: str = "layer001", warp: Floats | None = None, **fields: Any) -> Placed:
    """A layer of these heights; ``fields`` are those of the layer, its accuracy 0 unless given."""
    raster = rasters.build(heights, warp)
    place: dict[str, Any] = {"anchor": (0.0, 0.0), "spacing_m": (10.0, 10.0), "accuracy_m": 0.0} | fields
    return Placed(Layer(id=name, content=raster.digest, facts=raster.facts(), **place), raster)


def sampled(ground: Ground, rows: int, cols: int, name: str = "layer001", **fields: Any) -> Placed:
    """A layer of samples of a function of world x, y."""
    x, y = places(rows, cols, **fields)
    return placed(ground(x, y), name, **fields)


def places(rows: int, cols: int, **fields: Any) -> tuple[Floats, Floats]:
    """World x and y (rows, cols) of the samples of a layer without a bend."""
    turn, (sx, sy) = np.radians(fields.get("rotation_deg", 0.0)), fields.get("spacing_m", (10.0, 10.0))
    row, col = np.mgrid[0:rows, 0:cols]
    u, v = col * sx, row * sy
    anchor = fields.get("anchor", (0.0, 0.0))
    return anchor[0] + np.cos(turn) * u - np.sin(turn) * v, anchor[1] + np.sin(turn) * u + np.cos(turn) * v


def shifted(points: Floats, x: float, y: float) -> Floats:
    """Points (n, 2) moved by x, y."""
    return np.asarray(points + np.array([x, y]))


def rough(x: Floats, y: Floats) -> Floats:
    """Hills of many sizes, some 400 m high: nothing that a spline could represent."""
    out = 300 + 0 * x
    for k in range(1, 9):
        a = 2.4 * k
        out += 140 / k * np.sin(k * (np.cos(a) * x + np.sin(a) * y) / 190 + k * k)
    return out


def plane(x: Floats, y: Floats) -> Floats:
    """Tilted, 1 in 5 and 1 in 8."""
    return 120 + 0.2 * x - 0.125 * y


def three_layers(ground: Ground = rough) -> Model:
    """A wide coarse grid, a finer one across it at 27 degrees, and a survey with a hole at -40."""
    wide = sampled(ground, 100, 90, "aaaaaaaa", anchor=(-300.0, -200.0), spacing_m=(40.0, 40.0), accuracy_m=4.0)
    fine = sampled(
        ground, 80, 120, "bbbbbbbb", anchor=(1000.0, 300.0), rotation_deg=27.0, spacing_m=(12.0, 18.0), accuracy_m=1.0
    )
    place: dict[str, Any] = {"anchor": (900.0, 2100.0), "rotation_deg": -40.0, "spacing_m": (10.0, 10.0)}
    x, y = places(70, 70, **place)
    heights = ground(x, y)
    heights[20:30, 40:55] = np.nan
    survey = placed(heights, "cccccccc", accuracy_m=0.0, priority=1, **place)
    return space.build([wide, fine, survey])
