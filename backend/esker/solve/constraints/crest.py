"""From strokes to crest polylines that the rasteriser can read (DESIGN 4, 5.2). Pure NumPy, float64.

Every awkward stroke is made ordinary here, once, for both back ends: repeated points are dropped, a folded profile
becomes single-valued, a closed plateau outline gets its closing segment, a point stays a point.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from esker.contract import Stroke
from esker.document.strokes import world_points
from esker.solve.constraints.computable import CLOSEST_M

Points = NDArray[np.float64]
Under = Callable[[Points], Points]


def on_blank_ground(places: Points) -> Points:
    """Flat ground: 0 at all places (n, 2)."""
    return np.zeros(len(places))


CLOSED_FRACTION = 0.15
"""A level stroke whose ends are nearer than this share of its length encloses a plateau."""
_ENVELOPE_BLOCK = 1 << 20
_LEAST_STEP = 1e-300
"""Two knots nearer than this share of a profile stand upright over each other: a quotient by it overflows."""


@dataclass(frozen=True)
class Crest:
    """A crest line ready to be rasterised.

    points: (n, 3) float64, metres, no two neighbours within CLOSEST_M in plan; n = 1 is a single summit.
    closed: the last point joins the first and the inside is plateau.
    """

    stroke: Stroke
    points: Points
    closed: bool


def crest_of(stroke: Stroke, under: Under = on_blank_ground) -> Crest | None:
    """The crest line of a stroke, or None for one that constrains no height (hidden, without points, or paint).

    ``under``: the base at places (n, 2), metres.
    """
    if stroke.hidden or not stroke.curve or stroke.kind == "paint":
        return None
    points = world_points(stroke)
    if stroke.kind == "profile":
        return Crest(stroke, _single_valued(points, stroke, under), closed=False)
    points = _without_repeats(points)
    closed = stroke.kind != "course" and is_closed(points)
    if closed and np.hypot(*(points[0, :2] - points[-1, :2])) < CLOSEST_M:
        points = points[:-1]
    return Crest(stroke, points, closed)


def line_of(stroke: Stroke) -> Crest | None:
    """The line of a brush, heights zero, or None for one that paints nothing (hidden, or without points)."""
    if stroke.hidden or not stroke.curve:
        return None
    points = _without_repeats(world_points(stroke))
    points[:, 2] = 0.0
    return Crest(stroke, points, closed=False)


def is_closed(points: Points) -> bool:
    """True for an outline of three corners or more whose ends are within CLOSED_FRACTION of its length."""
    if len(points) < 3:
        return False
    steps = np.diff(points[:, :2], axis=0)
    length = float(np.hypot(steps[:, 0], steps[:, 1]).sum())
    gap = float(np.hypot(*(points[-1, :2] - points[0, :2])))
    corners = len(np.unique(points[:, :2], axis=0))
    return corners >= 3 and gap <= CLOSED_FRACTION * length


def _without_repeats(points: Points) -> Points:
    """Points of which each is at least CLOSEST_M away from the one before it, in plan."""
    steps = np.diff(points[:, :2], axis=0)
    apart = np.hypot(steps[:, 0], steps[:, 1]) >= CLOSEST_M
    if apart.all():
        return points
    kept = [0]
    for k in range(1, len(points)):
        if np.hypot(*(points[k, :2] - points[kept[-1], :2])) >= CLOSEST_M:
            kept.append(k)
    return points[kept]


def _single_valued(points: Points, stroke: Stroke, under: Under) -> Points:
    """The part of a profile that the ground can have: over each place the height farthest from the base.

    A pen that goes back over its own line would make an overhang. Knots are the profile's own; where several
    branches cover a knot the one farthest above or below the base stays. Direction: from first towards last.
    """
    first, last = np.array(stroke.first[:2]), np.array(stroke.last[:2])
    axis = last - first
    u = np.array([p for p, _ in stroke.curve])
    if np.hypot(*axis) * np.ptp(u) < CLOSEST_M:
        return points[[int(np.argmax(np.abs(points[:, 2] - under(points[:, :2]))))]]
    steps = np.diff(u)
    if (steps > 0).all():
        return _without_repeats(points)
    if (steps < 0).all():
        return _without_repeats(points)
    knots = np.unique(u)
    places = first + knots[:, None] * axis
    heights = _envelope(u, points[:, 2], knots, under(places))
    line = np.column_stack([places, heights])
    return _without_repeats(line[::-1] if u[-1] < u[0] else line)


def _envelope(u: Points, z: Points, knots: Points, base: Points) -> Points:
    """Per knot the height farthest from the base there among all segments (u_i, z_i)-(u_i+1, z_i+1) that cover it."""
    if len(u) == 1:
        return z.copy()
    low, high = np.minimum(u[:-1], u[1:]), np.maximum(u[:-1], u[1:])
    upright = np.abs(u[1:] - u[:-1]) < _LEAST_STEP
    run = np.where(upright, 1.0, u[1:] - u[:-1])
    out = np.zeros(len(knots))
    block = max(1, _ENVELOPE_BLOCK // len(low))
    for k in range(0, len(knots), block):
        at, there = knots[k : k + block, None], base[k : k + block, None]
        value = z[:-1] + np.clip((at - u[:-1]) / run, 0, 1) * (z[1:] - z[:-1])
        farther = np.where(np.abs(z[1:] - there) > np.abs(z[:-1] - there), z[1:], z[:-1])
        value = np.where(upright, farther, value)
        value = np.where((at >= low) & (at <= high), value, there)
        best = np.argmax(np.abs(value - there), axis=1)
        out[k : k + block] = value[np.arange(len(best)), best]
    return out
