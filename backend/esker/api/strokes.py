"""Strokes from world points: what a script draws with (DESIGN 4, 5.7)."""

from __future__ import annotations

import secrets
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from esker import contract
from esker.api.arguments import model, number, shown
from esker.api.arguments import points as checked_points
from esker.contract import Flank, Vec3
from esker.document.strokes import level_curve, misfit, profile_curve

FlankLike = tuple[float | None, float] | Flank | None
DEFAULT_FLANK: Flank = Flank()
LOOP_FRACTION = 0.25
"""A level stroke whose ends are nearer than this share of its length takes its farthest point as second anchor."""


class Stroke:
    """Makes strokes from world points; what is made is a ``contract.Stroke``.

    left, right: (slope in degrees or None, extent in metres) for a straight flank, which has that slope from the crest
    to its end; a ``Flank`` for any other; or None for no flank on that side of the direction of travel. Other keywords:
    ``plateau_radius_m``, ``amplitude_m``, ``roughness``, ``yields``, ``id``, ``label``.
    Raises ValueError for points that are not finite (n, 3), or fields out of range.
    """

    @staticmethod
    def profile(
        points: ArrayLike, left: FlankLike = DEFAULT_FLANK, right: FlankLike = DEFAULT_FLANK, **fields: Any
    ) -> contract.Stroke:
        """A mountain or a crevice: points (n, 3), metres, seen in the vertical plane through the first and the last.

        >>> from esker import Stroke
        >>> ridge = Stroke.profile([(0, 0, 0), (500, 0, 300), (1000, 0, 0)], left=(35, 400), right=None)
        >>> ridge.kind, ridge.last, ridge.right
        ('profile', (1000.0, 0.0, 0.0), None)
        """
        p = _points(points)
        first, last = _vec(p[0]), _vec(p[-1])
        return _stroke("profile", first, last, profile_curve(p, first, last), left, right, fields)

    @staticmethod
    def level(
        points: ArrayLike, left: FlankLike = DEFAULT_FLANK, right: FlankLike = DEFAULT_FLANK, **fields: Any
    ) -> contract.Stroke:
        """A plateau outline or a level ridge: points (n, 3), metres, all at the height of the first.

        >>> from esker import Stroke
        >>> Stroke.level([(0, 0, 80), (900, 300, 75)]).last
        (900.0, 300.0, 80.0)
        """
        p = _points(points)
        p[:, 2] = p[0, 2]
        first, last = _ends(p)
        return _stroke("level", first, last, level_curve(p, first, last), left, right, fields)

    @staticmethod
    def paint(
        points: ArrayLike,
        channel: contract.PaintChannel,
        value: float = 1.0,
        radius_m: float = contract.DEFAULT_SIZE_M / 50,
        **fields: Any,
    ) -> contract.Stroke:
        """A line of paint on the ground: points (n, 2), or (n, 3) whose heights do not matter.

        Within ``radius_m`` of it one channel of the detail is raised or lowered: "snow", "grass", "forest", "wetness",
        "roughness", "amplitude" or "erosion" (gullies), by ``value`` from -1 (none of it) to 1 (all of it). No height
        is constrained.

        >>> from esker import Stroke
        >>> Stroke.paint([(100, 100), (900, 500)], "snow", radius_m=80).paint.value
        1.0
        """
        xy = _points(points, (2, 3))[:, :2]
        p = np.column_stack([xy, np.zeros(len(xy))])
        first, last = _ends(p)
        said = {"channel": channel, "value": number("value", value), "radius_m": number("radius_m", radius_m)}
        paint = model(contract.Paint, said)
        return _stroke("paint", first, last, level_curve(p, first, last), None, None, {**fields, "paint": paint})

    @staticmethod
    def course(
        points: ArrayLike,
        use: contract.CourseUse = "river",
        width_m: float = 0.0,
        left: FlankLike = None,
        right: FlankLike = None,
        **fields: Any,
    ) -> contract.Stroke:
        """A river bed, a road or a ridge along a line over the ground, with a height at each of its points.

        Parameters
        ----------
        points : (n, 3) array, metres
            At most ``contract.MAX_COURSE_POINTS``. Heights are the bed's, the road's, or the ridge's own.
        use : "river", "road" or "ridge"
            A river runs from its first point to its last and never rises.
        width_m : float
            How wide the line is level across.
        left, right
            Banks: flanks down (or up) to the base. None: the ground itself leads to the line.

        Raises
        ------
        ValueError
            Too many points, points that are not finite, or a river that rises.

        >>> from esker import Stroke
        >>> road = Stroke.course([(0, 0, 80), (900, 300, 75), (1500, 300, 90)], "road", width_m=12)
        >>> road.course.rises, road.plateau_radius_m
        ((0.0, -5.0, 10.0), 6.0)
        """
        p = _points(points)
        first, last = _ends(p)
        rises = tuple(float(z) for z in p[:, 2] - p[0, 2])
        stroke = _stroke(
            "course", first, last, level_curve(p, first, last), left, right,
            {**fields, "course": model(contract.Course, {"use": use, "rises": rises}),
             "plateau_radius_m": number("width_m", width_m) / 2},
        )  # fmt: skip
        if wrong := misfit(stroke):
            raise ValueError(wrong)
        return stroke


def _ends(p: NDArray[np.float64]) -> tuple[Vec3, Vec3]:
    """Anchors of a level frame: the ends of the line, or of a loop its first point and the farthest from it."""
    steps = np.diff(p[:, :2], axis=0)
    length = float(np.hypot(steps[:, 0], steps[:, 1]).sum())
    gap = np.hypot(*(p[:, :2] - p[0, :2]).T)
    far = int(np.argmax(gap)) if gap[-1] < LOOP_FRACTION * length else -1
    return _vec(p[0]), _vec(p[far])


def _points(points: ArrayLike, columns: tuple[int, ...] = (3,)) -> NDArray[np.float64]:
    p = checked_points("points", points, columns, contract.MAX_POINTS_PER_STROKE)
    if len(p) == 0:
        raise ValueError("points must be at least one")
    return p


def _vec(p: NDArray[np.float64]) -> Vec3:
    return float(p[0]), float(p[1]), float(p[2])


def _flank(side: FlankLike) -> Flank | None:
    if side is None or isinstance(side, Flank):
        return side
    try:
        slope, extent = () if isinstance(side, str) else side
    except (TypeError, ValueError):
        raise ValueError(f"a flank is (slope in degrees or None, extent in metres), not {shown(side)}") from None
    slope_deg = None if slope is None else number("the slope of a flank", slope)
    fields = {"slope_deg": slope_deg, "extent_m": number("the extent of a flank", extent), "shape": "straight"}
    return model(Flank, fields)


def _stroke(
    kind: contract.StrokeKind,
    first: Vec3,
    last: Vec3,
    curve: tuple[contract.CurvePoint, ...],
    left: FlankLike,
    right: FlankLike,
    fields: dict[str, Any],
) -> contract.Stroke:
    values = {"id": secrets.token_hex(6), "finished": True, **fields}
    for name in ("plateau_radius_m", "amplitude_m", "roughness", "yields"):
        if name in values:
            values[name] = number(name, values[name])
    own = {"kind": kind, "first": first, "last": last, "curve": curve, "left": _flank(left), "right": _flank(right)}
    if taken := sorted(own.keys() & values.keys()):
        raise ValueError(f"{taken[0]} follows from the points and is not given")
    return model(contract.Stroke, {**own, **values})
