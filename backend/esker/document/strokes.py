"""Strokes as geometry: frames, world points, bounds (DESIGN 4, 5.2; paper 0, III-B). Pure functions of a Stroke."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import chain, pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from esker.contract import MAX_COURSE_POINTS, CurvePoint, Flank, Stroke, Vec3
from esker.grid import Rect

Points = NDArray[np.float64]

ROUNDING = 1e-12
"""Relative: more than what the few operations of a bound and of a point may differ by."""


def world_points(stroke: Stroke) -> Points:
    """The crest polyline, shape (n, 3), float64, metres: the curve taken out of the frame of the anchors."""
    count = len(stroke.curve)
    # from one flat run of numbers numpy makes an array in half the time
    curve = np.fromiter(chain.from_iterable(stroke.curve), dtype=np.float64, count=2 * count).reshape(count, 2)
    first, last = np.asarray(stroke.first, dtype=np.float64), np.asarray(stroke.last, dtype=np.float64)
    out = np.empty((count, 3))
    if stroke.kind == "profile":
        out[:] = first + curve[:, :1] * (last - first)
        out[:, 2] += curve[:, 1]
        return out
    d = last[:2] - first[:2]
    perp = np.array([-d[1], d[0]])
    out[:, :2] = first[:2] + curve[:, :1] * d + curve[:, 1:] * perp
    out[:, 2] = first[2]
    if stroke.course is not None and stroke.course.rises:
        rises = stroke.course.rises
        out[:, 2] += np.asarray((*rises, *(rises[-1:] * (count - len(rises)))))[:count]
    return out


def profile_curve(points: Points, first: Vec3, last: Vec3) -> tuple[CurvePoint, ...]:
    """World points, shape (n, 3), seen in the profile frame of the anchors: the inverse of ``world_points``.

    Points off the plane are projected on it along its horizontal normal. A zero-length frame puts all u at 0.
    """
    a, b = np.asarray(first, dtype=np.float64), np.asarray(last, dtype=np.float64)
    d = b[:2] - a[:2]
    length2 = float(d @ d)
    u = (points[:, :2] - a[:2]) @ d / length2 if length2 > 0 else np.zeros(len(points))
    w = points[:, 2] - (a[2] + u * (b[2] - a[2]))
    return tuple((float(p), float(q)) for p, q in zip(u, w, strict=True))


def level_curve(points: Points, first: Vec3, last: Vec3) -> tuple[CurvePoint, ...]:
    """World points, shape (n, 2) or (n, 3), in the similarity frame of the anchors (heights are dropped)."""
    a, b = np.asarray(first, dtype=np.float64), np.asarray(last, dtype=np.float64)
    d = b[:2] - a[:2]
    length2 = float(d @ d)
    if length2 == 0:
        return tuple((0.0, 0.0) for _ in points)
    q = points[:, :2] - a[:2]
    u, v = q @ d / length2, q @ np.array([-d[1], d[0]]) / length2
    return tuple((float(p), float(r)) for p, r in zip(u, v, strict=True))


def misfit(stroke: Stroke) -> str | None:
    """Returns a sentence about what is wrong with the fields of a stroke of its kind; None when nothing is."""
    if (stroke.kind == "paint") != (stroke.paint is not None):
        return "A paint stroke needs 'paint' (channel, value, radius), and only a paint stroke."
    if (stroke.kind == "course") != (stroke.course is not None):
        return "A course needs 'course' (use, heights), and only a course."
    if stroke.course is None:
        return None
    if len(stroke.curve) > MAX_COURSE_POINTS:
        return f"A course holds at most {MAX_COURSE_POINTS} points."
    if stroke.course.use == "river" and any(b > a for a, b in pairwise(stroke.course.rises)):
        return "A river never rises along its way."
    return None


def influence_extent(stroke: Stroke) -> float:
    """Farthest horizontal distance from the crest at which the stroke constrains anything, metres."""
    if stroke.paint is not None:
        return stroke.paint.radius_m
    sides: Sequence[Flank | None] = (stroke.left, stroke.right)
    return stroke.plateau_radius_m + max((f.extent_m for f in sides if f is not None), default=0.0)


class CurveBox(NamedTuple):
    """Least and greatest coordinates of the points of a curve, in the frame of its anchors."""

    u0: float
    u1: float
    v0: float
    v1: float


def curve_box(curve: Iterable[CurvePoint], known: CurveBox | None = None) -> CurveBox | None:
    """The box of these points and of those in ``known``; None when there are none.

    Arithmetic of plain numbers: most curves that are looked at have few points, or few that are new.
    """
    points = chain(curve, () if known is None else (known[::2], known[1::2]))
    u, v = next(columns := zip(*points, strict=True), ()), next(columns, ())
    return CurveBox(min(u), max(u), min(v), max(v)) if u else None


def reach(stroke: Stroke, box: CurveBox) -> float:
    """No coordinate of a point of ``world_points`` is farther from zero, metres; ``box``: of its curve."""
    (ax, ay, az), (bx, by, bz) = stroke.first, stroke.last
    dx, dy = abs(bx - ax), abs(by - ay)
    u, v = max(box.u1, -box.u0), max(box.v1, -box.v0)
    if stroke.kind == "profile":
        far = max(abs(ax) + u * dx, abs(ay) + u * dy, abs(az) + u * abs(bz - az) + v)
    else:
        rises = () if stroke.course is None else stroke.course.rises
        highest = abs(az) + max(map(abs, rises), default=0.0)
        far = max(abs(ax) + u * dx + v * dy, abs(ay) + u * dy + v * dx, highest)
    return far * (1 + ROUNDING)


def bounds(stroke: Stroke, box: CurveBox | None = None) -> Rect | None:
    """The rectangle outside which the stroke constrains nothing, of any channel; None for a stroke without effect.

    ``box``: of its curve, where the caller has it already.
    """
    if stroke.hidden or not stroke.curve:
        return None
    if stroke.kind == "profile":  # its points lie on the line through the anchors: the ends of u are the ends of all
        ends = box or curve_box(stroke.curve)
        assert ends is not None
        (ax, ay, _), (bx, by, _) = stroke.first, stroke.last
        xs, ys = ((a + ends.u0 * (b - a), a + ends.u1 * (b - a)) for a, b in ((ax, bx), (ay, by)))
        rect = Rect(min(xs), min(ys), max(xs), max(ys))
    else:
        xy = world_points(stroke)[:, :2]
        low, high = xy.min(axis=0), xy.max(axis=0)
        rect = Rect(float(low[0]), float(low[1]), float(high[0]), float(high[1]))
    return rect.grown(influence_extent(stroke))
