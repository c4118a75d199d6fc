"""Workspaces stay within their bound at every moment, blank terrains need none (SPEC S30, S223, S224)."""

from __future__ import annotations

import time
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from esker import grid
from esker.api.terrain import Stroke as Make
from esker.contract import Channel, Stroke, TerrainSettings
from esker.events import Done, Level
from esker.solve.constraints.packing import Shape, pack_one
from esker.solve.pool.pool import PACKED, SPARE_SECONDS, TRIM_SECONDS, best_packed
from esker.solve.solver import Solver
from tests.solver.bases import hills
from tests.solver.scenes import PINNED, SCENES, SETTINGS, mixed

HIDDEN = SCENES["one"][0].model_copy(update={"hidden": True})
BARE = SCENES["one"][0].model_copy(update={"curve": ()})


@pytest.fixture
def solver() -> Solver:
    return Solver()


def named(prefix: str) -> list[Stroke]:
    return [s.model_copy(update={"id": f"{prefix}-{s.id}"}) for s in SCENES["five"]]


@pytest.mark.parametrize("settings", [SETTINGS, PINNED, TerrainSettings(reach_m=None)])
@pytest.mark.parametrize("strokes", [[], [HIDDEN, BARE]], ids=["empty", "without effect"])
@pytest.mark.parametrize("based", [False, True])
@pytest.mark.parametrize("device", ["numpy", None])
def test_a_blank_terrain_is_what_its_equations_give_and_takes_no_workspace(
    device: str | None, strokes: list[Stroke], settings: TerrainSettings, based: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    solver, base = Solver(device), hills() if based else None
    *events, done = solver.steps(strokes, settings, 1, basis=True, base=base)
    results = [r for r in events if isinstance(r, Level)]
    assert solver._pool.held == 0
    heights = {r.level: r.heights for r in results if r.channel == Channel.HEIGHT}
    assert [r.settled for r in results] == [True] * len(results)
    assert isinstance(done, Done)
    assert done.basis is not None
    monkeypatch.setattr("esker.solve.solver.is_blank", lambda _: False)
    *events, again = solver.steps(strokes, settings, 1, basis=True, base=base)
    solved = [r for r in events if isinstance(r, Level) and r.settled]
    assert solver._pool.held > 0
    for result in solved:
        if result.channel == Channel.HEIGHT:
            assert np.array_equal(result.heights, heights[result.level])
            assert not np.signbit(heights[result.level]).any()
    assert isinstance(again, Done)
    assert np.array_equal(again.basis.gradient, done.basis.gradient)
    assert {r.channel for r in solved} == {r.channel for r in results}


def test_paint_on_blank_ground_is_painted(solver: Solver) -> None:
    snow = Make.paint([(900, 900), (2000, 2000)], "snow", 1.0, radius_m=80, id="snow")
    found = [r for r in solver.steps([snow], SETTINGS, 2) if isinstance(r, Level) and r.channel == Channel.SNOW]
    assert found[-1].heights.max() > 0.9
    assert solver._pool.held == 0


def test_the_bound_holds_at_every_moment_with_solves_in_progress(solver: Solver) -> None:
    """58 terrains that had been opened and left held 7.4 GB where a fifth of the machine was the bound."""
    solver._pool.bound = 4 * grid.solve_bytes(1)
    most, running = 0, []
    for n in range(12):
        steps = solver.steps(named(str(n)), SETTINGS, 1)
        next(steps)
        running.append(steps)
        if len(running) > 2:
            for _ in running.pop(0):
                most = max(most, solver._pool.held)
        most = max(most, solver._pool.held)
    for steps in running:
        steps.close()
    assert most <= 4 * grid.solve_bytes(1)
    assert solver._pool.held == sum(w.bytes for w in solver._pool.idle) + solver._pool.residency.bytes


def test_what_solves_freed_goes_back_to_the_system_while_others_follow(
    solver: Solver, monkeypatch: pytest.MonkeyPatch
) -> None:
    """SPEC S591: now and then while there are solves, and not again while there are none."""
    given: list[float] = []
    now = time.monotonic()
    monkeypatch.setattr("esker.solve.pool.pool.system.give_memory_back", lambda: given.append(now))
    for seconds in (0.5 * TRIM_SECONDS, TRIM_SECONDS, 1.5 * TRIM_SECONDS, 2 * TRIM_SECONDS, 3 * TRIM_SECONDS):
        if seconds < 2.5 * TRIM_SECONDS:
            solver.solve(mixed(3, 4), SETTINGS, 1)
        for workspace in solver._pool.idle:
            solver._pool.since[workspace] = now + seconds  # none rests so long that it goes
        solver._pool.tidy(now + seconds)
    assert len(given) == 2


def test_who_comes_back_is_rasterised_and_not_packed_again(solver: Solver, monkeypatch: pytest.MonkeyPatch) -> None:
    strokes = mixed(20, 4)
    expected = solver.solve(strokes, SETTINGS, 1)[1]
    [workspace] = solver._pool.idle
    assert solver.tidy(solver._pool.since[workspace] + SPARE_SECONDS) == 1
    del workspace
    assert solver._pool.held == 0
    packed: list[str] = []

    def counted(shape: Shape, *given: Any) -> Any:
        packed.append(shape.crest.stroke.id)
        return pack_one(shape, *given)

    monkeypatch.setattr("esker.solve.constraints.constraints.pack_one", counted)
    changed = strokes[0].model_copy(update={"last": (2000.0, 2000.0, 0.0)})
    assert np.array_equal(solver.solve(strokes, SETTINGS, 1)[1], expected)
    assert packed == []
    found = solver.solve([changed, *strokes[1:]], SETTINGS, 1)[1]
    assert np.array_equal(found, Solver().solve([changed, *strokes[1:]], SETTINGS, 1)[1])


def test_only_so_much_is_kept_of_rooms_that_left(solver: Solver) -> None:
    for n in range(PACKED + 3):
        solver.solve(named(str(n)), SETTINGS, 0)
        solver.tidy(1e12)
    assert len(solver._pool._packed) == PACKED
    solver.tidy(1e13)
    assert solver._pool._packed == []


def remembering(unchanged: int, shared: int) -> Any:
    """A packer without a device: what it would answer to whoever asks how much it knows of a set."""
    return SimpleNamespace(unchanged_count=lambda *_: unchanged, shared_ids=lambda *_: shared)


@pytest.mark.parametrize(
    ("known", "count", "chosen"),
    [
        ([], 4, None),
        ([(0, 0)], 4, None),
        ([(1, 1)], 4, None),
        ([(2, 2)], 4, 0),
        ([(1, 1), (3, 3)], 4, 1),
        ([(2, 4), (3, 3)], 4, 1),
        ([(1, 4), (0, 1)], 4, 0),
        ([(-1, 1), (-1, 3)], 4, 1),
        ([(3, 3), (3, 4)], 4, 0),
        ([(-1, 0)], 0, 0),
    ],
    ids=[
        "nothing is idle",
        "another room's",
        "too little of it",
        "half of it",
        "most of it",
        "unchanged strokes count more than shared ids",
        "everybody draws at once",
        "other settings",
        "the longest idle of equals",
        "an empty set",
    ],
)
def test_who_solves_takes_over_what_was_packed_of_its_room(
    known: list[tuple[int, int]], count: int, chosen: int | None
) -> None:
    """SPEC S445: the choice of a workspace, without one."""
    packers = [remembering(*each) for each in known]
    found = best_packed(packers, SCENES["five"][:count], SETTINGS)
    assert found is (None if chosen is None else packers[chosen])
