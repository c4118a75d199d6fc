"""Tops, floors and distances of patches as they are defined, in plain Python float64: the twin of ``cover``.

Kernels are lists of corners; what greater patches leave of one is a list of convex polygons. No index, no shortcuts:
every patch is held against every other.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from esker.patchwork.lod.layer_patches import affine, mapped
from esker.patchwork.lod.precedence import precedence
from esker.patchwork.lod.space import Model
from esker.patchwork.raster.errors_reference import bilinear
from esker.patchwork.raster.patches import warped

Point = tuple[float, float]
Polygon = list[Point]

COVERED = 1e-7


def key(model: Model, p: int) -> tuple[int, float, int, str, int]:
    """The total order of patches: area, accuracy, priority, layer, place."""
    layer = model.placed[model.owner[p]].layer
    return int(model.area[p]), -float(model.min_z[p]), layer.priority, layer.id, p


def area(polygon: Polygon) -> float:
    """Area of a counter-clockwise polygon."""
    turned = polygon[1:] + polygon[:1]
    return sum(a[0] * b[1] - a[1] * b[0] for a, b in zip(polygon, turned, strict=True)) / 2


def _cut(polygon: Polygon, a: Point, b: Point, slack: float, sign: float) -> Polygon:
    """The part of a polygon on one side of the line a -> b, moved outwards by ``slack``."""
    length = math.dist(a, b)

    def depth(p: Point) -> float:
        return sign * ((b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]) + slack * length)

    out: Polygon = []
    for p, q in zip(polygon, polygon[1:] + polygon[:1], strict=True):
        dp, dq = depth(p), depth(q)
        if dp >= 0:
            out.append(p)
        if dp * dq < 0:
            t = dp / (dp - dq)
            out.append((p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1])))
    return out if len(out) > 2 else []


def minus(polygons: list[Polygon], quad: Polygon, slack: float) -> list[Polygon]:
    """Polygons without what a quad, grown by ``slack``, holds of them."""
    out = []
    for polygon in polygons:
        rest = polygon
        for a, b in zip(quad, quad[1:] + quad[:1], strict=True):
            out.append(_cut(rest, a, b, slack, -1.0))
            rest = _cut(rest, a, b, slack, 1.0)
    return [polygon for polygon in out if polygon and area(polygon) > 0]


def _quad(model: Model, p: int, origin: NDArray[np.float64]) -> Polygon:
    return [(float(x), float(y)) for x, y in model.kernel[p] - origin]


def uncovered(model: Model, p: int, by: list[int]) -> float:
    """Share of the kernel of p, drawn in by its slack, that the kernels of other patches leave."""
    origin = model.kernel[p].mean(axis=0)
    quad = _quad(model, p, origin)
    whole = area(quad)
    inner = quad
    for a, b in zip(quad, quad[1:] + quad[:1], strict=True):
        inner = _cut(inner, a, b, -float(model.slack[p]), 1.0)
    rest = [inner]
    for q in by:
        rest = minus(rest, _quad(model, q, origin), float(model.slack[q]))
    return sum(area(polygon) for polygon in rest) / whole


def _near(model: Model, p: int) -> list[int]:
    """Patches whose kernels' bounds touch those of p."""
    low, high = model.kernel.min(axis=1), model.kernel.max(axis=1)
    edge = model.slack[:, None]
    touch = ((low - edge <= high[p]) & (high + edge >= low[p])).all(axis=1)
    return [int(q) for q in np.flatnonzero(touch) if q != p]


def top(model: Model, p: int) -> float:
    """Smallest z at which greater patches with min z <= z cover the kernel of p."""
    rivals = sorted((q for q in _near(model, p) if key(model, q) > key(model, p)), key=lambda q: float(model.min_z[q]))
    for k, q in enumerate(rivals):
        if uncovered(model, p, rivals[: k + 1]) <= COVERED:
            return float(model.min_z[q])
    return math.inf


def floor(model: Model, p: int) -> bool:
    """Returns whether p is not wiped out and more accurate patches (of equal ones the greater) leave some of its
    kernel."""
    if model.max_z[p] <= model.min_z[p]:
        return False
    mine = float(model.min_z[p])
    better = [
        q
        for q in _near(model, p)
        if model.min_z[q] < mine or (model.min_z[q] == mine and key(model, q) > key(model, p))
    ]
    return uncovered(model, p, better) > COVERED


def error(model: Model, p: int) -> float:
    """min z of a patch from nothing but samples: of its own layer, and of every layer that is trusted more."""
    own = model.placed[model.owner[p]]
    worst = float(own.layer.accuracy_m)
    m, extent = model.to_patch[p], model.extent[p]
    samples = model.samples(p).astype(np.float64)
    for other in model.placed:
        if other is not own and precedence(other.layer) < precedence(own.layer):
            continue
        rows, cols = other.raster.heights.shape
        v, u = (index.ravel().astype(np.float64) for index in np.indices((rows, cols)))
        place = mapped(affine(other.layer), warped(other.raster.warp, rows, cols, np.stack([u, v], 1)))
        at = place @ m[:, :2].T + m[:, 2]
        heights = other.layer.scale * other.raster.heights.ravel().astype(np.float64) + other.layer.lift_m
        inside = (at >= 0).all(axis=1) & (at <= extent).all(axis=1) & ~np.isnan(heights)
        if inside.any():
            distance = np.abs(heights[inside] - bilinear(samples, at[inside, 0], at[inside, 1])).max()
            worst = max(worst, float(other.layer.accuracy_m + distance))
    return worst
