"""Memory of a device that ends, and what solves need of it (SPEC S26, S30)."""

from __future__ import annotations

import gc
import time
from dataclasses import replace
from typing import Any

import numpy as np
import pyopencl as cl
import pytest

from esker import grid
from esker.contract import MAX_LEVEL
from esker.events import Done
from esker.grid import TileKey
from esker.solve.opencl import workspaces
from esker.solve.opencl.faults import OutOfDeviceMemoryError
from esker.solve.pool.pool import SPARE_SECONDS
from esker.solve.refine.cl_engine import ClEngine
from esker.solve.refine.refinement import SPARE_SECONDS as REFINED_SECONDS
from esker.solve.solver import Solver
from tests.solver.bases import Analytic, hills
from tests.solver.failing import INVALID_VALUE, NO_MEMORY, STROKES, Failing, heights, held
from tests.solver.scenes import SETTINGS


def test_idle_workspaces_make_room(used: Solver, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC S26: out of memory once, with idle workspaces around: they are dropped and the solve succeeds."""
    expected = heights(used, 1)
    assert len(used._pool.idle) == 2
    used._pool.idle = [w for w in used._pool.idle if w.top == 2]
    with monkeypatch.context() as patch:
        failing = Failing(cl.Buffer, NO_MEMORY, after=9, times=1)
        patch.setattr(cl, "Buffer", failing)
        assert np.array_equal(heights(used, 1), expected)
    assert failing.calls > 10
    assert [w.top for w in used._pool.idle] == [1]


def test_a_room_where_everybody_draws_keeps_its_workspace() -> None:
    """SPEC S30: other points of the same strokes are no other terrain."""
    solver = Solver()
    for step in range(4):
        moved = [s.model_copy(update={"last": (s.last[0], s.last[1], s.last[2] + step)}) for s in STROKES]
        again = solver.solve(moved, SETTINGS, 1)
        assert len(solver._pool.idle) == 1
    fresh = Solver().solve(moved, SETTINGS, 1)
    assert all(np.array_equal(a, b) for a, b in zip(again.levels, fresh.levels, strict=True))
    others = [s.model_copy(update={"id": f"other-{s.id}"}) for s in STROKES]
    solver.solve(others, SETTINGS, 1)
    assert len(solver._pool.idle) == 2, "another terrain does not take the raster of the first"


def test_workspaces_that_nobody_uses_are_given_back(used: Solver) -> None:
    """SPEC S30: those idle for long go, with their memory; the next solve gives the same bits."""
    expected = heights(used, 1)
    before = held(used)
    assert used.tidy() == 0
    assert held(used) == before > 0
    later = time.monotonic() + SPARE_SECONDS + 1
    used._pool.since[used._pool.idle[0]] = later
    assert used.tidy(later) == 1
    assert 0 < held(used) < before
    assert used.tidy(2 * later) == 1
    assert held(used) == 0
    assert np.array_equal(heights(used, 1), expected)


def test_memory_of_refinement_is_given_back(fresh: Solver) -> None:
    """SPEC S550: when no step was begun for long and none is under way; the next one gives the same bits."""
    *_, done = fresh.steps(STROKES, SETTINGS, 1, basis=True)
    assert isinstance(done, Done)
    refiner, now, key = fresh.refiner(done.basis), time.monotonic(), TileKey(3, 4, 3)
    assert fresh._refinery is not None

    def made() -> list[bytes]:
        return [tile.heights.tobytes() for tile in refiner.tiles([key]) if tile is not None]

    expected, engine = made(), fresh._refinery._engine
    assert isinstance(engine, ClEngine)
    for seconds, empty in ((0, False), (REFINED_SECONDS - 1, False), (REFINED_SECONDS + 1, True)):
        fresh.tidy(now + seconds)
        assert engine.is_empty == empty == (len(refiner.cache) == 0)
    under_way = refiner.tiles([TileKey(3, 1, 1), TileKey(3, 7, 7)], lambda: True)
    while next(under_way) is None and not any(room.is_busy for room in engine._rooms):
        pass
    fresh.tidy(now + 2 * REFINED_SECONDS)
    fresh.tidy(now + 4 * REFINED_SECONDS)
    assert not engine.is_empty
    under_way.close()  # type: ignore[attr-defined]
    assert made() == expected


def test_out_of_memory_in_the_middle_of_a_solve(fresh: Solver, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC S26: many drivers allocate when a kernel first touches a buffer. Tried again while there is what to drop."""
    expected = heights(fresh)
    run = fresh.steps(STROKES, SETTINGS, 1)
    next(run)  # keeps a workspace of its own, so that there is an idle one beside that of the solve that fails
    with monkeypatch.context() as patch:
        failing = Failing(cl.enqueue_nd_range_kernel, NO_MEMORY, after=10, times=1)
        patch.setattr(cl, "enqueue_nd_range_kernel", failing)
        for _ in run:
            pass
        assert failing.calls > 30
    assert [w.top for w in fresh._pool.idle] == [1]
    with monkeypatch.context() as patch:
        fresh._pool.idle.clear()
        patch.setattr(cl, "enqueue_nd_range_kernel", Failing(cl.enqueue_nd_range_kernel, NO_MEMORY, after=30))
        with pytest.raises(OutOfDeviceMemoryError):
            heights(fresh)
    assert np.array_equal(heights(fresh), expected)


def test_out_of_memory_without_anything_to_drop(fresh: Solver, monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as patch:
        failing = Failing(cl.Buffer, NO_MEMORY, after=9)
        patch.setattr(cl, "Buffer", failing)
        with pytest.raises(OutOfDeviceMemoryError, match="too little memory"):
            heights(fresh)
    assert held(fresh) == 0
    assert heights(fresh).max() > 0


@pytest.mark.parametrize("limit", ["memory", "largest"])
def test_a_plan_that_cannot_fit_allocates_nothing(fresh: Solver, monkeypatch: pytest.MonkeyPatch, limit: str) -> None:
    """SPEC S26."""
    assert fresh._device is not None
    limits = {"memory": fresh._device.memory, "largest": fresh._device.largest} | {limit: 40 << 20}
    small = replace(fresh._device, name="small one", memory=limits["memory"], largest=limits["largest"])
    monkeypatch.setattr(fresh, "_device", small)
    assert heights(fresh, 1).max() > 0
    with monkeypatch.context() as patch:
        patch.setattr(cl, "Buffer", Failing(cl.Buffer, INVALID_VALUE))
        with pytest.raises(OutOfDeviceMemoryError, match=r"4097².*small one.* MiB"):
            workspaces.new_workspace(small, 6)
    assert held(fresh) == workspaces.planned_bytes(small, 1)[0]


def test_what_is_held_counts(fresh: Solver, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC S26: two workspaces do not fit where one does; when the first is gone the second does."""
    assert fresh._device is not None
    needed = workspaces.planned_bytes(fresh._device, 2)[0]
    tight = replace(fresh._device, name="tight one", memory=int(1.8 * needed / workspaces.SHARE))
    first = workspaces.new_workspace(tight, 2)
    with pytest.raises(OutOfDeviceMemoryError, match="left"):
        workspaces.new_workspace(tight, 2)
    del first
    gc.collect()
    workspaces.new_workspace(tight, 2)


@pytest.mark.parametrize("top", [0, 1, 3])
def test_the_plan_is_what_is_allocated(fresh: Solver, monkeypatch: pytest.MonkeyPatch, top: int) -> None:
    """SPEC S26: within the tables and weights, a few kilobytes."""
    assert fresh._device is not None
    sizes = []

    def counted(context: Any, flags: int, size: int = 0, hostbuf: Any = None) -> Any:
        sizes.append(size)
        return cl._cl.Buffer(context, flags, size, hostbuf)

    monkeypatch.setattr(cl, "Buffer", counted)
    workspaces.new_workspace(fresh._device, top)
    planned, largest = workspaces.planned_bytes(fresh._device, top)
    assert 0 <= sum(sizes) - planned < 100_000
    assert largest == max(sizes)


@pytest.mark.parametrize("level", range(3, MAX_LEVEL + 1))
@pytest.mark.parametrize("strips", [1, 8])
@pytest.mark.parametrize("based", [False, True])
def test_what_solves_are_shared_out_by_is_about_the_plan(fresh: Solver, strips: int, level: int, based: bool) -> None:
    """SPEC S26: a base and a preview workspace included."""
    assert fresh._device is not None
    device = replace(fresh._device, strips=strips)
    planned = workspaces.planned_bytes(device, level, based)[0]
    planned += (
        workspaces.planned_bytes(device, grid.PREVIEW_WORKSPACE_LEVEL, based)[0]
        if level >= grid.PREVIEW_WORKSPACE_FROM
        else 0
    )
    assert grid.solve_bytes(level, based) == pytest.approx(planned, rel=0.1)


@pytest.mark.parametrize("base", [None, hills()], ids=["flat", "hills"])
def test_what_solves_are_shared_out_by_is_what_they_allocate(
    monkeypatch: pytest.MonkeyPatch, base: Analytic | None
) -> None:
    """SPEC S26: the buffers of a solve of level 4 that is the first of its solver."""
    fresh, sizes = Solver(max_level=4), []

    def counted(context: Any, flags: int, size: int = 0, hostbuf: Any = None) -> Any:
        sizes.append(size)
        return cl._cl.Buffer(context, flags, size, hostbuf)

    monkeypatch.setattr(cl, "Buffer", counted)
    steps = fresh.steps(STROKES, SETTINGS, base=base)
    assert next(steps) is not None
    assert sum(sizes) == pytest.approx(grid.solve_bytes(4, base is not None), rel=0.1)
    steps.close()
