"""How far a ground is with a task: 0 to 100 points, and the sentence that says why (docs/tasks.md).

Equal ground has 100; ground that is nearer to a target everywhere, holds more, or is less steep never has fewer points.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from esker import contract as c
from esker.tasks.ground import Ground
from esker.tasks.target import BadTarget, decode

SLACK: Final = 1e-9
"""So little may be missing of a whole point: sums of shares are not exact."""
EVEN: Final = 1.001
"""A path that is steeper by so little is not: heights of the ground have as many digits as float32."""
HECTARE_M2, KM2 = 1e4, 1e6


@dataclass(frozen=True)
class Points:
    """What a ground has, and why."""

    points: int
    text: str
    figures: tuple[float, ...] = ()
    """What the sentence says in numbers (docs/tasks.md); empty where it has none."""


def score(goal: c.Goal, heights: NDArray[Any], settings: c.TerrainSettings) -> Points:
    """The points of settled heights of TASK_LEVEL or a coarser level, metres, row 0 south.

    >>> ramp = np.linspace(0, 100, 65)[None, :].repeat(65, axis=0)
    >>> score(c.AreaGoal(level_m=50, at_least_m2=16e6), ramp, c.TerrainSettings()).text
    '53 of 100: 8.52 km² of the 16 km² asked for are above 50 m.'
    """
    if not np.isfinite(heights).all():
        return Points(0, "0 of 100: the ground has no heights yet.")
    ground = Ground(heights, settings.size_m, settings.sea_level_m)
    measure: Callable[[Any, Ground], Points] = MEASURES[type(goal)]
    try:
        return measure(goal, ground)
    except BadTarget as error:
        return Points(0, error.message)


def _nearness(goal: c.TerrainGoal | c.ContoursGoal, ground: Ground) -> Points:
    target, size = goal.target, ground.size_m
    if target.size_m != size:
        sentence = f"0 of 100: this task was made for a terrain {_metres(target.size_m)} wide."
        return Points(0, f"{sentence} This one is {_metres(size)} wide.")
    wanted = decode(target)
    skip = (len(wanted) - 1) // (len(ground.heights) - 1) if len(wanted) > len(ground.heights) else 1
    step = (len(ground.heights) - 1) // (len(wanted) - 1) if len(ground.heights) > len(wanted) else 1
    wanted = wanted[::skip, ::skip].astype(np.float64)
    off = np.abs(ground.heights[::step, ::step] - wanted)
    shaped = np.abs(wanted - np.median(wanted)) > goal.tolerance_m
    return _within(np.maximum(off - target.step_m / 2, 0), goal.tolerance_m, "the ground", "the target", shaped)


def _profile(goal: c.ProfileGoal, ground: Ground) -> Points:
    share = np.linspace(0, 1, len(goal.heights))[:, None]
    points = np.asarray(goal.first) * (1 - share) + np.asarray(goal.last) * share
    off = np.abs(ground.along(points) - np.asarray(goal.heights))
    return _within(off, goal.tolerance_m, "the line", "the profile")


def _within(
    off: NDArray[Any], tolerance: float, what: str, whose: str, shaped: NDArray[np.bool_] | None = None
) -> Points:
    """Points for differences: within the tolerance ground counts whole, off by TOLERANCES_OFF of them nothing.

    ``shaped``: where the target stands out. The plain around it is given for nothing, so it gives no points; what is
    wrong there costs some. A target that is level everywhere is shaped everywhere.
    """
    counted = np.clip((c.TOLERANCES_OFF * tolerance - off) / ((c.TOLERANCES_OFF - 1) * tolerance), 0, 1)
    if shaped is None or not shaped.any():
        shaped = np.ones(off.shape, np.bool_)
    spoilt = float((1 - counted[~shaped]).sum())
    points = _whole(float(counted[shaped].sum()) / (float(shaped.sum()) + spoilt))
    near = math.floor(100 * float((off[shaped] <= tolerance).mean()) + SLACK)
    partly = not shaped.all()
    where = f"{what} that is to be shaped" if partly else what
    mean = float(off[shaped].mean())
    return Points(
        points,
        f"{points} of 100: {_share(near)} of {where} is within {_metres(tolerance)} of {whose}; "
        f"the mean difference is {_metres(mean)}.",
        (near, tolerance, mean, float(partly)),
    )


def _volume(goal: c.VolumeGoal, ground: Ground) -> Points:
    held, level = ground.held(goal.point, goal.level_m)
    points = _whole(held / goal.at_least_m3)
    if held <= 0:
        return Points(points, f"{points} of 100: no water stays at the point; it runs away.", (0.0, goal.at_least_m3))
    over = "where it would run over" if level < goal.level_m - 0.5 else "as high as it may"
    return Points(
        points,
        f"{points} of 100: the lake holds {_volume_text(held)} of the {_volume_text(goal.at_least_m3)} asked for. "
        f"It stands at {_metres(level)}, {over}.",
        (held, goal.at_least_m3, level, float(level < goal.level_m - 0.5)),
    )


def _slope(goal: c.SlopeGoal, ground: Ground) -> Points:
    grades, lengths = ground.grades(goal.path)
    if not len(grades):
        return Points(0, "0 of 100: the path of this task has no length.")
    # A step beyond the limit counts as far as it is too steep: twice the limit counts nothing.
    counted = np.clip(1 + EVEN - grades / goal.at_most, 0, 1)
    points = _whole(float((counted * lengths).sum() / lengths.sum()))
    fine = math.floor(100 * float(lengths[grades <= goal.at_most * EVEN].sum() / lengths.sum()) + SLACK)
    steepest = float(grades.max())
    return Points(
        points,
        f"{points} of 100: {_share(fine)} of the path is no steeper than {100 * goal.at_most:.3g} %; "
        f"the steepest place has {100 * steepest:.3g} %.",
        (fine, goal.at_most, steepest),
    )


def _area(goal: c.AreaGoal, ground: Ground) -> Points:
    found = ground.land(goal.level_m, goal.dry)
    points = _whole(found / goal.at_least_m2)
    where = f"stay dry with the sea at {_metres(goal.level_m)}" if goal.dry else f"are above {_metres(goal.level_m)}"
    asked = _area_text(goal.at_least_m2)
    return Points(
        points,
        f"{points} of 100: {_area_text(found)} of the {asked} asked for {where}.",
        (found, goal.at_least_m2, goal.level_m),
    )


def _watershed(goal: c.WatershedGoal, ground: Ground) -> Points:
    found = ground.watershed(goal.point)
    points = _whole(found / goal.at_least_m2)
    asked = _area_text(goal.at_least_m2)
    rain = f"rain from {_area_text(found)} of the {asked} asked for runs through the point"
    return Points(points, f"{points} of 100: {rain}.", (found, goal.at_least_m2))


MEASURES: Final[dict[type, Callable[[Any, Ground], Points]]] = {
    c.TerrainGoal: _nearness,
    c.ContoursGoal: _nearness,
    c.ProfileGoal: _profile,
    c.VolumeGoal: _volume,
    c.SlopeGoal: _slope,
    c.AreaGoal: _area,
    c.WatershedGoal: _watershed,
}


def _whole(share: float) -> int:
    """Whole points of a share: all of them only where nothing is missing."""
    return math.floor(100 * min(max(share, 0.0), 1.0) + SLACK)


def _share(percent: int) -> str:
    return "all" if percent == 100 else "nothing" if percent == 0 else "half" if percent == 50 else f"{percent} %"


def _metres(value: float) -> str:
    if abs(value) >= 10_000:
        return f"{value / 1000:,.1f} km"
    return f"{value:,.0f} m" if abs(value) >= 10 else f"{value:.1f} m"


def _area_text(value: float) -> str:
    return f"{value / KM2:,.3g} km²" if value >= KM2 / 10 else f"{value / HECTARE_M2:,.3g} ha"


def _volume_text(value: float) -> str:
    return f"{value / 1e6:,.3g} million m³" if value >= 1e6 else f"{value:,.0f} m³"
