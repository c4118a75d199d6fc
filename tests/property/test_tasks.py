"""Scores of tasks: equal ground has all points, nearer ground never fewer (SPEC L97 to L104)."""

from __future__ import annotations

import base64
import zlib
from typing import Any

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings
from numpy.typing import NDArray

from esker import contract as c
from esker.tasks.ground import Ground
from esker.tasks.score import score
from esker.tasks.target import BadTarget, decode, encode

SIDE = 65
SIZE = 4096.0
SETTINGS = c.TerrainSettings()
seeds = st.integers(0, 2**32 - 1)
tolerances = st.floats(c.MIN_TOLERANCE_M, 200)
FIGURES = {
    "terrain": {4},
    "contours": {4},
    "profile": {4},
    "volume": {2, 4},
    "slope": {3},
    "area": {3},
    "watershed": {2},
}
"""How many numbers the sentence of each goal has."""


def land(seed: int, side: int = SIDE, high: float = 400.0) -> NDArray[np.float32]:
    """Hills of any number and height."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[0 : 1 : side * 1j, 0 : 1 : side * 1j]
    z = np.zeros((side, side))
    for _ in range(rng.integers(1, 9)):
        a, b, wide = rng.uniform(0, 1), rng.uniform(0, 1), rng.uniform(0.02, 0.4)
        z += rng.uniform(-high, high) * np.exp(-((x - a) ** 2 + (y - b) ** 2) / wide**2)
    return z.astype(np.float32)


def goals(seed: int, tolerance: float) -> list[c.Goal]:
    """A goal of each kind."""
    rng = np.random.default_rng(seed)
    at, to = tuple(rng.uniform(0, SIZE, 2)), tuple(rng.uniform(0, SIZE, 2))
    heights = tuple(Ground(land(seed), SIZE).along(np.linspace(at, to, 33)))
    wanted = encode(land(seed), SIZE)
    amount = float(rng.uniform(1, 1e7))
    return [
        c.TerrainGoal(target=wanted, tolerance_m=tolerance),
        c.ContoursGoal(target=wanted, tolerance_m=tolerance, interval_m=50),
        c.ProfileGoal(first=at, last=to, heights=heights, tolerance_m=tolerance),
        c.VolumeGoal(point=at, level_m=float(rng.uniform(-200, 200)), at_least_m3=amount),
        c.SlopeGoal(path=(at, to, at), at_most=float(rng.uniform(0.01, 1))),
        c.AreaGoal(level_m=float(rng.uniform(-200, 200)), at_least_m2=amount, dry=bool(seed % 2)),
        c.WatershedGoal(point=at, at_least_m2=amount),
    ]


@given(seeds, seeds, tolerances)
@settings(max_examples=60, deadline=None)
def test_every_ground_has_whole_points_and_a_sentence(seed: int, other: int, tolerance: float) -> None:
    """SPEC L97."""
    for goal in goals(seed, tolerance):
        found = score(goal, land(other), SETTINGS)
        assert isinstance(found.points, int)
        assert 0 <= found.points <= 100
        assert found.text.startswith(f"{found.points} of 100: ")
        assert "nan" not in found.text
        c.Score(clock=0, points=found.points, text=found.text, figures=found.figures)
        assert len(found.figures) in FIGURES[goal.type], "SPEC U653"


@given(seeds, tolerances)
@settings(max_examples=60, deadline=None)
def test_the_ground_that_a_target_was_made_of_has_all_points(seed: int, tolerance: float) -> None:
    """SPEC L98: whatever the tolerance."""
    for goal in goals(seed, tolerance)[:3]:
        assert score(goal, land(seed), SETTINGS).points == 100


@given(seeds, seeds, tolerances, st.floats(0, 1), st.floats(0, 1))
@settings(max_examples=60, deadline=None)
def test_nearer_ground_never_has_fewer_points(seed: int, other: int, tolerance: float, a: float, b: float) -> None:
    """SPEC L99."""
    near, far = sorted((a, b))
    for goal in goals(seed, tolerance)[:3]:
        wanted = land(seed)
        points = [
            score(goal, wanted + np.float32(share) * (land(other) - wanted), SETTINGS).points for share in (near, far)
        ]
        assert points[0] >= points[1] - (1 if near == far else 0)


@given(seeds, st.floats(0, 300), st.floats(0, 300))
@settings(max_examples=60, deadline=None)
def test_more_is_never_fewer_points(seed: int, a: float, b: float) -> None:
    """SPEC L100: ground that is raised has no less land, a path that is flattened is no steeper, and a goal that asks
    for less has no fewer points."""
    low, high = sorted((a, b))
    *_, volume, slope, area, watershed = goals(seed, 1.0)
    assert isinstance(area, c.AreaGoal)
    ground = land(seed)
    assert (
        score(area, ground + np.float32(high), SETTINGS).points
        >= score(area, ground + np.float32(low), SETTINGS).points
    )
    flat = [score(slope, ground * np.float32(1 / (1 + share)), SETTINGS).points for share in (high, low)]
    assert flat[0] >= flat[1]
    for goal, field in ((volume, "at_least_m3"), (area, "at_least_m2"), (watershed, "at_least_m2")):
        less = goal.model_copy(update={field: getattr(goal, field) / 2})
        assert score(less, ground, SETTINGS).points >= score(goal, ground, SETTINGS).points


def bowl(rim: float = 100.0) -> NDArray[np.float32]:
    """A square pit a quarter of the terrain wide, 80 m deep, in ground of 100 m; ``rim``: the height of one gap."""
    z = np.full((SIDE, SIDE), 100, np.float32)
    z[24:41, 24:41] = 20
    z[32, :24] = rim
    return z


@pytest.mark.parametrize(("rim", "level", "stands"), [(100, 90, 90), (100, 400, 100), (60, 90, 60), (20, 90, 20)])
def test_a_lake_holds_what_its_outlet_lets_it(rim: float, level: float, stands: float) -> None:
    """SPEC L101: to the lowest of its brim and the level that is asked for, and no more."""
    held, at = Ground(bowl(rim), SIZE).held((2048, 2048), level)
    assert at == stands
    # The gap is as deep as the lake where it is lower than the water.
    gap = 24 * max(0.0, stands - rim) * (SIZE / 64) ** 2
    assert held == pytest.approx(17 * 17 * (stands - 20) * (SIZE / 64) ** 2 + gap)


def test_a_dyke_keeps_land_dry() -> None:
    """SPEC L102: land below the sea counts as dry where the sea does not come, and else not."""
    ground = Ground(bowl(), SIZE)
    assert ground.land(50, dry=True) == SIZE**2
    assert ground.land(50, dry=False) == pytest.approx(SIZE**2 * (1 - 17 * 17 / SIDE**2))
    assert Ground(bowl(20), SIZE).land(50, dry=True) < ground.land(50, dry=False)


def test_a_watershed_is_all_that_runs_through_a_point() -> None:
    """SPEC L102: of a valley, all of it at its mouth."""
    y, x = np.mgrid[0:SIDE, 0:SIDE].astype(np.float32)
    valley = y + 3 * np.abs(x - 32)
    whole = Ground(valley, SIZE).watershed((2048, 0))
    assert 0.9 * SIZE**2 < whole <= SIZE**2
    assert Ground(valley, SIZE).watershed((2048, 2048)) < whole


def test_the_slope_of_a_path_counts_along_it() -> None:
    """SPEC L102."""
    y, _ = np.mgrid[0:SIDE, 0:SIDE].astype(np.float32)
    ground = np.where(y < 32, 0, (y - 32) * 64 * 0.2).astype(np.float32)
    goal = c.SlopeGoal(path=((100, 0), (100, SIZE)), at_most=0.1)
    found = score(goal, ground, SETTINGS)
    assert found.points == 50
    assert found.text == "50 of 100: half of the path is no steeper than 10 %; the steepest place has 20 %."
    assert score(goal, ground * np.float32(0.5), SETTINGS).points == 100


@given(seeds, st.sampled_from((65, 129, 257)), st.floats(0.001, 20_000))
@settings(max_examples=40, deadline=None)
def test_a_target_is_its_ground_within_half_a_step(seed: int, side: int, high: float) -> None:
    """SPEC L103: on the level that fits a message."""
    ground = land(seed, side, high)
    made = encode(ground, SIZE)
    assert len(made.data) <= c.MAX_TARGET_CHARACTERS
    back = decode(made)
    every = (side - 1) // (len(back) - 1)
    assert np.abs(back - ground[::every, ::every]).max() <= made.step_m * 0.5001 + np.abs(ground).max() * 1e-6


def test_rough_ground_is_a_coarser_target() -> None:
    """SPEC L103."""
    rough = np.random.default_rng(3).normal(size=(257, 257)).astype(np.float32)
    made = encode(rough, SIZE)
    assert made.level == 1
    assert score(c.TerrainGoal(target=made, tolerance_m=0.1), rough, SETTINGS).points == 100


def forged(data: bytes, **over: Any) -> c.Target:
    fields = {"size_m": SIZE, "level": 0, "low_m": 0.0, "step_m": 1.0, "data": base64.b64encode(data).decode()}
    return c.Target.model_validate(fields | over)


@pytest.mark.parametrize(
    "target",
    [
        forged(b"abcd"),
        forged(zlib.compress(bytes(2 * SIDE * SIDE - 1))),
        forged(zlib.compress(bytes(2 * SIDE * SIDE + 1))),
        forged(zlib.compress(bytes(20_000_000))),
        forged(b"x").model_copy(update={"data": "AAA"}),
    ],
)
def test_a_target_that_is_none_has_a_sentence(target: c.Target) -> None:
    """SPEC L104: nothing is unpacked beyond what a level holds, and a task with such a target has no points."""
    with pytest.raises(BadTarget):
        decode(target)
    found = score(c.TerrainGoal(target=target, tolerance_m=1), land(1), SETTINGS)
    assert (found.points, found.text) == (0, "The target of this task is damaged.")


def test_a_target_of_another_size_has_no_points() -> None:
    """SPEC L104: it is not stretched in silence."""
    found = score(c.TerrainGoal(target=encode(land(1), 8192.0), tolerance_m=1), land(1), SETTINGS)
    assert found.points == 0
    assert "made for a terrain 8,192 m wide" in found.text


@given(st.lists(st.floats(-1e5, 1e5), min_size=4, max_size=4))
@settings(deadline=None)
def test_places_beyond_the_border_do_no_harm(at: list[float]) -> None:
    """SPEC L97."""
    first, last = (at[0], at[1]), (at[2], at[3])
    for goal in (
        c.ProfileGoal(first=first, last=last, heights=(0, 1), tolerance_m=1),
        c.VolumeGoal(point=first, level_m=10, at_least_m3=1),
        c.SlopeGoal(path=(first, last), at_most=0.1),
        c.WatershedGoal(point=last, at_least_m2=1),
    ):
        assert 0 <= score(goal, land(5), SETTINGS).points <= 100
