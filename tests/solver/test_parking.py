"""Workspaces that lend their memory to others and go on where they were (SPEC S500 to S505; decision 57)."""

from __future__ import annotations

import os
from collections.abc import Iterator
from itertools import chain, product
from typing import Any

import numpy as np
import pytest

from esker import grid
from esker.contract import Stroke, TerrainSettings
from esker.events import BaseLevel, Done, Level, SolveEvent
from esker.solve.base import Base
from esker.solve.constraints.tables import Tables, Window
from esker.solve.opencl import parking
from esker.solve.opencl.device_workspace import DeviceWorkspace
from esker.solve.opencl.parking import Spares
from esker.solve.solver import Solver
from tests.solver.bases import hills
from tests.solver.scenes import PINNED, SCENES, SETTINGS
from tests.solver.twins import small_tiles

ROOMS = ("a", "b", "c")
TOP = 2
WAYS = [
    pytest.param(base, settings, basis, id="-".join(("hills" if hilly else "flat", border, later)))
    for (hilly, base), (border, settings), (later, basis) in product(
        enumerate((None, hills())),
        (("free", SETTINGS), ("pinned", PINNED)),
        (("refined later", True), ("not refined", False)),
    )
    # Of three things two ways each, four cases have every pair of them; `ESKER_LONG` has all eight.
    if bool(hilly) == (basis == (border == "free")) or os.environ.get("ESKER_LONG")
]


def of_room(room: str, name: str = "five") -> list[Stroke]:
    return [s.model_copy(update={"id": f"{room}-{s.id}"}) for s in SCENES[name]]


def edited(strokes: list[Stroke], by: float) -> list[Stroke]:
    """One stroke has moved: the others keep their packing, and the first preview comes from the ground before."""
    last = strokes[0].last
    return [strokes[0].model_copy(update={"last": (last[0] + by, last[1], last[2])}), *strokes[1:]]


def shown(event: SolveEvent) -> list[np.ndarray]:
    """All heights and gradients of an event."""
    if isinstance(event, Done) and event.basis is not None:
        return [event.basis.heights, event.basis.gradient]
    return [event.heights] if isinstance(event, Level) and not isinstance(event, BaseLevel) else []


@pytest.fixture(autouse=True)
def previews_on_small_levels(monkeypatch: pytest.MonkeyPatch) -> None:
    """Level 2 has a preview workspace, as level 4 has where nothing is tested."""
    previews_from(TOP, monkeypatch)


def previews_from(level: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(grid, "PREVIEW_WORKSPACE_FROM", level)
    monkeypatch.setattr(grid, "PREVIEW_WORKSPACE_LEVEL", level - 1)


def one_arena(solver: Solver) -> Solver:
    """From now on one workspace of each kind has memory at a time."""
    solver._pool.residency.bound = 0
    return solver


def on_device(solver: Solver) -> list[DeviceWorkspace[Any]]:
    """The workspaces that rest."""
    return [w for w in solver._pool.idle if isinstance(w, DeviceWorkspace)]


@pytest.fixture(params=["rows", "tiles"])
def kernels(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Solver:
    monkeypatch.setenv("ESKER_KERNELS", request.param)
    made = small_tiles(Solver())
    if made._device is None:
        pytest.skip("no OpenCL device")
    return made


@pytest.fixture
def heavy(monkeypatch: pytest.MonkeyPatch) -> None:
    """No strokes are so few that they are rasterised again."""
    monkeypatch.setattr(parking, "LIGHT", -1.0)


def sets(room: str) -> list[list[Stroke]]:
    """What is drawn in a room, one after the other. Rooms differ, so that ground of another room is noticed.

    A third set would find what the second finds: a workspace that rests with ground of nearly the same strokes.
    """
    first = edited(of_room(room), 100.0 * ROOMS.index(room))
    return [first, edited(first, 40.0)]


def begins(solver: Solver, room: str, level: int) -> None:
    """Another room begins to draw, which takes the memory of who rests, and leaves off."""
    steps = solver.steps(of_room(room), SETTINGS, level)
    next(steps)
    steps.close()


def top_for(solver: Solver, base: Base | None, basis: bool) -> int:
    """Tile kernels take ten times as long as row-wise ones on a CPU. Both kinds park by the same code, so the levels
    between the finest and the coarsest are there in one of the ways of tile kernels, and in all ways of the others."""
    assert solver._device is not None
    return TOP if solver._device.plan is None or (base is not None and basis) else TOP - 1


def drawn(solver: Solver, room: str, top: int, settings: TerrainSettings, **more: Any) -> Iterator[list[np.ndarray]]:
    """What is shown in a room at every pause of a solver while the sets of the room are drawn."""
    for strokes in sets(room):
        for event in solver.steps(strokes, settings, top, **more):
            yield shown(event)


@pytest.mark.parametrize(("base", "settings", "basis"), WAYS)
def test_solves_that_take_each_others_memory_at_every_pause_give_the_bits_of_solves_alone(
    kernels: Solver,
    settings: TerrainSettings,
    base: Base | None,
    basis: bool,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """SPEC S500, S581: previews, previews from the ground before, settled levels, gradients. In half of the cases
    constraints are copied, in the others they are rasterised again."""
    monkeypatch.setattr(parking, "LIGHT", parking.LIGHT if basis == (settings is PINNED) else -1.0)
    top, more = top_for(kernels, base, basis), {"base": base, "basis": basis}
    previews_from(top, monkeypatch)
    expected = {}
    for room in ROOMS[:2]:
        by_itself = small_tiles(Solver(kernels.device_name))
        expected[room] = list(chain(*drawn(by_itself, room, top, settings, **more)))
    solver, got = one_arena(kernels), {room: list[Any]() for room in ROOMS[:2]}
    running = {room: drawn(solver, room, top, settings, **more) for room in ROOMS[:2]}
    while running:
        for room, steps in list(running.items()):
            found = next(steps, None)
            if found is None:
                del running[room]
            else:
                got[room] += found
    for room, found in expected.items():
        assert len(got[room]) == len(found)
        assert all(np.array_equal(one, other) for one, other in zip(found, got[room], strict=True)), room
    assert sum(not w.is_parked for w in on_device(solver)) == 1


def test_what_was_in_the_memory_before_does_not_matter(kernels: Solver) -> None:
    """SPEC S500: not even numbers that are none."""
    expected = kernels.solve(of_room("b"), SETTINGS, 2)[2]
    kernels._pool.clear()
    one_arena(kernels).solve(of_room("a"), SETTINGS, 2)
    kernels.solve(of_room("b"), SETTINGS, 2)
    residency, (first, second) = kernels._pool.residency, on_device(kernels)
    assert first.is_parked
    arena = second.park(residency.spares)
    for system in (arena.gradient, arena.height):
        assert system is not None
        for buffer in system.fields.values():
            nothing = np.full(1, np.nan, dtype=np.float32)
            system.launch.cl.enqueue_fill_buffer(system.launch.queue, buffer, nothing, 0, buffer.size)
    second.resume(arena, residency.spares)
    moved = edited(of_room("b"), 1.0)
    assert np.array_equal(kernels.solve(of_room("b"), SETTINGS, 2)[2], expected)
    assert np.array_equal(kernels.solve(moved, SETTINGS, 2)[2], Solver().solve(moved, SETTINGS, 2)[2])


def test_many_strokes_of_a_parked_workspace_are_not_rasterised_again(
    kernels: Solver, monkeypatch: pytest.MonkeyPatch, heavy: None
) -> None:
    """SPEC S501."""
    solver = one_arena(kernels)
    for room in ROOMS:
        solver.solve(of_room(room), SETTINGS, 2)
    done: list[int] = []
    whole = DeviceWorkspace.rasterise

    def counted(self: DeviceWorkspace[Any], tables: Tables, window: Window) -> None:
        done.append(self.top)
        whole(self, tables, window)

    monkeypatch.setattr(DeviceWorkspace, "rasterise", counted)
    for room in ROOMS:
        solver.solve(of_room(room), SETTINGS, 2)
    assert done == []


def test_few_have_memory_and_the_least_recent_that_rests_gives_it(kernels: Solver) -> None:
    """SPEC S502: not one in the middle of a solve, while another rests."""
    kernels._pool.residency.bound = 2 * grid.arena_bytes(1)
    running = kernels.steps(of_room("a"), SETTINGS, 1)
    next(running)
    kernels.solve(of_room("b"), SETTINGS, 1)
    [rests] = on_device(kernels)
    kernels.solve(of_room("c"), SETTINGS, 1)
    held = {w.top: w for w in kernels._pool.residency._turns}
    assert len(kernels._pool.residency._turns) == 2
    assert rests.is_parked
    assert set(held) == {1}
    running.close()


def test_a_workspace_at_rest_with_few_strokes_keeps_nothing(kernels: Solver) -> None:
    """SPEC S581: what is rasterised again as quickly as it is copied is not copied, nor are kept sums of a stroke that
    is drawn no longer; in the middle of a solve its ground and its progress are."""
    solver = one_arena(kernels)
    for _ in solver.steps(of_room("a"), SETTINGS, 3, basis=True):
        pass
    begins(solver, "b", 3)
    parked = next(w for w in on_device(solver) if w.is_parked and w.top == 3)
    assert parked.bytes == 0
    assert parked.packer.shared_ids(of_room("a")) == len(of_room("a")), "it is known again"
    steps = solver.steps(of_room("a"), SETTINGS, 3)
    while not isinstance(event := next(steps), Level) or event.level < 3:
        pass
    begins(solver, "b", 3)
    [amid] = [w for w in solver._pool._made if isinstance(w, DeviceWorkspace) and w.in_progress]
    assert amid.is_parked
    kept = 0 if amid._kept is None else amid._kept.bytes
    assert 0.1 * grid.arena_bytes(3) < amid.bytes - kept < 0.6 * grid.parked_bytes(3)
    steps.close()


def test_a_workspace_at_rest_that_was_given_out_keeps_the_constraints_alone(kernels: Solver, heavy: None) -> None:
    """SPEC S503: a quarter of what it solves with; in the middle of a solve, and with a ground of its own, half."""
    solver = one_arena(kernels)
    whole = grid.arena_bytes(3)
    for basis, most in ((True, 0.3), (False, 0.45)):
        for _ in solver.steps(of_room("a"), SETTINGS, 3, basis=basis):
            pass
        begins(solver, "b", 3)
        parked = next(w for w in on_device(solver) if w.is_parked)
        assert 0.1 * whole < parked.bytes - (0 if parked._kept is None else parked._kept.bytes) < most * whole
        solver._pool.clear()
    steps = solver.steps(of_room("a"), SETTINGS, 3)
    while not isinstance(event := next(steps), Level) or event.level < 3:
        pass
    begins(solver, "b", 3)
    [amid] = [w for w in solver._pool._made if isinstance(w, DeviceWorkspace) and w.in_progress]
    assert amid.is_parked
    assert amid.bytes <= 1.1 * grid.parked_bytes(3)
    steps.close()


def test_a_solve_whose_memory_is_refused_ends_and_leaves_nothing_behind(
    kernels: Solver, monkeypatch: pytest.MonkeyPatch
) -> None:
    """SPEC S504: a device may fail while contents come back."""
    solver = one_arena(kernels)
    expected = solver.solve(of_room("a"), SETTINGS, 2)[2]
    running = solver.steps(of_room("a"), SETTINGS, 2)
    next(running)
    solver.solve(of_room("b"), SETTINGS, 2)
    with monkeypatch.context() as patch:

        def refused(*_: object) -> None:
            raise RuntimeError("the copy fails")

        patch.setattr("esker.solve.opencl.device_workspace.restored", refused)
        with pytest.raises(RuntimeError, match="the copy fails"):
            list(running)
    assert np.array_equal(solver.solve(of_room("a"), SETTINGS, 2)[2], expected)


def test_copies_come_from_memory_that_is_kept_and_that_has_a_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC S505."""
    monkeypatch.setattr(parking, "SPARE_BYTES", 100)
    spares = Spares()
    first = spares.take(60)
    spares.give(first)
    assert spares.bytes == 60
    spares.give(np.empty(60, dtype=np.uint8))
    assert spares.bytes == 60, "no more than that is kept"
    assert spares.take(30) is not first
    assert spares.take(60) is first
    assert spares.bytes == 0
    spares.give(first)
    spares.clear()
    assert spares.bytes == 0


def test_memory_that_is_not_wanted_goes_with_the_last_that_rests(kernels: Solver) -> None:
    """SPEC S30: arenas and spare copies, too."""
    solver = one_arena(kernels)
    for room in ROOMS:
        solver.solve(of_room(room, "one"), SETTINGS, 2)
    assert solver._pool.held > 0
    assert solver.tidy(1e12) == len(ROOMS)
    assert solver._pool.held == 0
