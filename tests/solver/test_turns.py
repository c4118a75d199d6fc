"""However many strokes a terrain has, its solve can be left every few of them (SPEC S222)."""

from __future__ import annotations

import numpy as np
import pytest

from esker import grid
from esker.events import PAUSE, Level, Preview
from esker.solve import solving
from esker.solve.constraints.constraints import AT_A_STRETCH, Packer
from esker.solve.solver import Solver
from tests.solver.scenes import SETTINGS, flank, mixed, ridge

COUNT = 10 * AT_A_STRETCH + 1
STROKES = [ridge((20.0 * k, 100.0), (20.0 * k + 300, 900.0), 50.0, flank(), f"s{k:03}") for k in range(COUNT)]


def test_packing_is_left_every_few_strokes_and_changes_nothing_before_its_end() -> None:
    packer = Packer(2)
    work = packer.packing(STROKES, SETTINGS)
    pauses = sum(1 for _ in work)
    assert pauses == COUNT // AT_A_STRETCH
    first, window = packer.pack(STROKES, SETTINGS)
    assert window is None, "all of it is packed"
    other = SETTINGS.model_copy(update={"reach_m": 99.0})
    half = packer.packing(STROKES, other)
    for _ in range(3):
        next(half)
    half.close()
    again, window = packer.pack(STROKES, SETTINGS)
    assert window is None, "it is still the set of before"
    assert np.array_equal(first.knots, again.knots)
    assert sum(1 for _ in packer.packing(STROKES, other)) == pauses, "another reach is another set"
    assert sum(1 for _ in packer.packing([*STROKES[1:], STROKES[0]], other)) == 0


@pytest.mark.parametrize("device", ["numpy", None])
def test_a_solve_of_many_strokes_can_be_left_before_anything_is_shown(device: str | None) -> None:
    solver = Solver(device, 1)
    pauses = 0
    for result in (steps := solver.steps(STROKES, SETTINGS)):
        if isinstance(result, Level):
            break
        pauses += 1
    steps.close()
    assert pauses >= COUNT // AT_A_STRETCH


@pytest.mark.parametrize("device", ["numpy", None])
def test_a_solve_left_while_it_packs_leaves_no_trace(device: str | None) -> None:
    solver, other = Solver(device, 1), SETTINGS.model_copy(update={"reach_m": 77.0})
    strokes = mixed(40, 5)
    expected = Solver(device, 1).solve(strokes, other)[1]
    solver.solve(strokes, SETTINGS)
    steps = solver.steps(strokes, other)
    assert next(steps) == PAUSE
    steps.close()
    assert np.array_equal(solver.solve(strokes, other)[1], expected)


def test_channels_of_many_strokes_can_be_left_and_others_use_their_solver_meanwhile() -> None:
    solver = Solver("numpy", 0)
    loud = [s.model_copy(update={"amplitude_m": 3.0}) for s in STROKES]
    quiet = [s.model_copy(update={"amplitude_m": 1.0}) for s in STROKES[:5]]
    mine = solver.channels(loud, SETTINGS)
    assert next(mine) == PAUSE
    [theirs] = [r.heights for r in solver.channels(quiet, SETTINGS) if isinstance(r, Level) and r.channel == 1]
    [found] = [r.heights for r in mine if isinstance(r, Level) and r.channel == 1]
    [alone] = [
        r.heights for r in Solver("numpy", 0).channels(loud, SETTINGS) if isinstance(r, Level) and r.channel == 1
    ]
    assert np.array_equal(found, alone)
    assert not np.array_equal(found, theirs)


def test_an_early_preview_that_would_take_longer_than_a_turn_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    solver = Solver(None, 4)
    steps = solver.steps(STROKES[:40], SETTINGS)
    while not isinstance(result := next(steps), Level) or result.level < 1:
        pass
    moved = [s.model_copy(update={"first": (s.first[0], s.first[1], 5.0)}) for s in STROKES[:3]]
    assert steps.early_preview([*moved, *STROKES[3:40]], SETTINGS) is not None
    monkeypatch.setattr(solving, "EARLY_STROKES", 2)
    assert steps.early_preview([*moved, *STROKES[3:40]], SETTINGS) is not None, "they are known by now"
    assert steps.early_preview(STROKES[:40], SETTINGS.model_copy(update={"reach_m": 50.0})) is None
    steps.close()


def test_a_preview_from_the_ground_before_is_left_between_its_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC S507: after the raster, the gradient and a cycle of the heights."""
    monkeypatch.setattr(grid, "PREVIEW_WORKSPACE_FROM", 2)
    monkeypatch.setattr(grid, "PREVIEW_WORKSPACE_LEVEL", 1)
    solver, strokes = Solver(max_level=2), mixed(20, 4)
    if solver.device is None:
        pytest.skip("NumPy queues nothing")
    solver.solve(strokes, SETTINGS)
    moved = [strokes[0].model_copy(update={"last": (2000.0, 2000.0, 40.0)}), *strokes[1:]]
    events = []
    for event in solver.steps(moved, SETTINGS):
        events.append(event)
        if isinstance(event, Preview) and event.level == 2:
            break
    assert isinstance(events[0], Preview), "the coarsest comes first"
    after_channels = max(k for k, event in enumerate(events[:-1]) if isinstance(event, Level))
    pauses = events[after_channels + 1 : -1]
    assert pauses == [PAUSE] * len(pauses)
    assert len(pauses) >= 4, "one of the channels, and three of its own"
