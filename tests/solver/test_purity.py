"""The terrain is a pure function of its strokes, and solving can be watched and stopped (SPEC S15 to S18)."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from esker import grid
from esker.api.terrain import Stroke as Make
from esker.contract import Channel, Stroke
from esker.events import Level, Preview, Settled
from esker.solve.constraints.channel_targets import BASES
from esker.solve.constraints.tables import Tables, Window
from esker.solve.opencl.device_workspace import DeviceWorkspace
from esker.solve.solver import Solver
from tests.solver.scenes import PINNED, SCENES, SETTINGS, SIZE, flank, mixed, ridge

TOP = 3
"""Level 3 keeps the twenty orders under ten seconds on two slow cores; level 4 is covered once."""


def edited(order: np.random.Generator, strokes: list[Stroke], solver: Solver, level: int) -> np.ndarray:
    """The final set reached by a random walk: strokes come in any order, some drawn in pieces, some twice."""
    now: dict[str, Stroke] = {}
    for k in order.permutation(len(strokes)):
        s = strokes[k]
        now[s.id] = s.model_copy(update={"curve": s.curve[: max(1, len(s.curve) // 2)]})
        if order.random() < 0.2:
            now["passing"] = ridge((500, 500), (3000, 3000), 300, flank(), "passing")
        if order.random() < 0.08:
            solver.solve(list(now.values()), SETTINGS, level, should_stop=lambda: order.random() < 0.3)
        now.pop("passing", None)
        now[s.id] = s
    return solver.solve(list(now.values()), SETTINGS, level)[level]


def test_any_order_of_edits(solver: Solver) -> None:
    """SPEC S15: twenty random edit orders of fifty strokes, bit by bit."""
    strokes = mixed(50, 11)
    fresh = Solver().solve(strokes, SETTINGS, TOP)[TOP]
    for seed in range(20):
        assert np.array_equal(edited(np.random.default_rng(seed), strokes, solver, TOP), fresh)


def test_numpy_after_an_edit() -> None:
    """SPEC S15, S19: the workspace without OpenCL keeps what it knew outside of the bins that an edit reaches."""
    strokes, solver = SCENES["fifty"], Solver("numpy")
    solver.solve(strokes[1:], SETTINGS, 1)
    assert np.array_equal(solver.solve(strokes, SETTINGS, 1)[1], Solver("numpy").solve(strokes, SETTINGS, 1)[1])


def test_order_at_level_four(solver: Solver) -> None:
    strokes = mixed(50, 11)
    a, b = solver.solve(strokes, SETTINGS, 4)[4], Solver().solve(strokes[::-1], SETTINGS, 4)[4]
    assert np.array_equal(a, b)


@pytest.mark.parametrize("scene", ["five", "loops", "bare"])
def test_warm_start(solver: Solver, scene: str) -> None:
    """SPEC S15: a start from a wrong guess ends within one quantisation step."""
    strokes = SCENES[scene]
    cold = solver.solve(strokes, SETTINGS, TOP)
    guess = solver.solve([*strokes, ridge((600, 3000), (3300, 600), 350, flank(), "gone")], SETTINGS, TOP)
    warm = solver.solve(strokes, SETTINGS, TOP, guess=guess)
    assert warm.settled
    assert np.abs(warm[TOP] - cold[TOP]).max() < grid.quantum(TOP, SIZE)


def test_steps_of_a_solve(solver: Solver) -> None:
    """SPEC S16."""
    results = [r for r in solver.steps(SCENES["five"], SETTINGS, TOP) if isinstance(r, Preview | Settled)]
    previews = [r for r in results if not r.settled]
    settled = [r for r in results if r.settled]
    assert [r.level for r in previews] == list(range(TOP + 1))
    assert [r.level for r in settled] == list(range(TOP + 1))
    for r in results:
        assert r.heights.dtype == np.float32
        assert r.heights.shape == (grid.samples(r.level),) * 2
        assert r.heights.flags.c_contiguous
        with pytest.raises(ValueError, match="read-only"):
            r.heights[0, 0] = 1
    for coarse, fine in pairwise(settled):
        assert np.array_equal(coarse.heights, fine.heights[::2, ::2])


def test_the_coarsest_preview_waits_for_no_fine_raster(solver: Solver, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC S16: it comes from strokes rasterised on level 2 alone; each level's preview comes once, with the same bits
    whatever was solved before."""
    rasterised: list[int] = []
    whole = DeviceWorkspace.rasterise

    def counted(self: DeviceWorkspace[Any], tables: Tables, window: Window) -> None:
        rasterised.append(tables.level)
        whole(self, tables, window)

    monkeypatch.setattr(DeviceWorkspace, "rasterise", counted)
    strokes = [*SCENES["fifty"], Make.paint([(900, 900), (2000, 2000)], "snow", 1.0, radius_m=80, id="snow")]
    first = []
    for one in (Solver(), solver):
        for before in [] if one is not solver else [strokes[3:], strokes[:9]]:
            shown: list[object] = []
            one.solve(before, SETTINGS, 4, on_level=shown.append, should_stop=lambda: len(shown) > 0)  # noqa: B023
        rasterised.clear()
        steps = one.steps(strokes, SETTINGS, 4)
        first.append(next(r for r in steps if isinstance(r, Level)))
        paint = [next(steps) for _ in range(3 * len(BASES))]
        assert Channel.SNOW in {r.channel for r in paint if isinstance(r, Level)}
        assert rasterised == [2]
        previews = [
            first[-1],
            *(r for r in steps if isinstance(r, Preview | Settled) and not r.settled),
        ]
        assert [r.level for r in previews if isinstance(r, Level)] == [0, 1, 2, 3, 4]
        assert 4 in rasterised
    a, b = (r.heights for r in first if isinstance(r, Level))
    assert np.array_equal(a, b)
    kept = solver._pool.idle[-1].packer
    stopped = solver.steps(strokes[1:], SETTINGS, 4)
    next(r for r in stopped if isinstance(r, Level))
    stopped.close()
    assert kept.unchanged_count(strokes, SETTINGS) == len(strokes), "the fine raster is as it was: nothing of it began"
    settled = solver.solve(strokes, SETTINGS, 4)[0]
    assert np.sqrt(np.mean((a - settled) ** 2)) < 0.05 * np.ptp(settled)


def test_an_early_preview_of_newer_strokes_changes_nothing_of_a_solve(solver: Solver) -> None:
    """SPEC S17: it is what their own solve begins with, to the bit, and that may then begin without it."""
    older, newer = SCENES["fifty"][3:], SCENES["fifty"]
    first = Solver()
    for one in (first, solver):  # both know the same ground of before
        one.solve(older[9:], SETTINGS, 4)
    plain = [r.heights for r in first.steps(older, SETTINGS, 4) if isinstance(r, Level) and r.level == 4]
    own = next(first.steps(newer, SETTINGS, 4))
    steps, early, levels = solver.steps(older, SETTINGS, 4), [], []
    assert steps.early_preview(newer, SETTINGS) is None, "it has not begun"
    for r in steps:
        early.append(steps.early_preview(newer, SETTINGS))
        if isinstance(r, Preview | Settled) and r.level == 4:
            levels.append(r.heights)
    assert steps.early_preview(newer, SETTINGS) is None, "it has ended"
    assert isinstance(own, Level)
    assert len(early) > 8
    for preview in early:
        assert preview is not None
        assert np.array_equal(preview.heights, own.heights)
    assert [np.array_equal(a, b) for a, b in zip(plain, levels, strict=True)] == [True, True]
    rest = [r for r in solver.steps(newer, SETTINGS, 4, coarsest=False) if isinstance(r, Level) and not r.settled]
    assert sorted(r.level for r in rest if r.channel == Channel.HEIGHT) == [1, 2, 3, 4]


def previewed(solver: Solver, strokes: list[Stroke]) -> tuple[list[int], np.ndarray, np.ndarray]:
    """Levels of the previews in order, the finest one, and the settled ground."""
    results = [r for r in solver.steps(strokes, SETTINGS, 4) if isinstance(r, Preview | Settled)]
    preview, settled = (r.heights for r in results if r.level == 4)
    return [r.level for r in results if not r.settled], preview, settled


def test_an_edit_is_shown_from_the_ground_before_it(solver: Solver) -> None:
    """SPEC S18: the finest preview of a segment needs none of the others; segments may follow each other before any of
    them settles, and what settles then has the bits of a solver that knew nothing."""
    *others, pen = SCENES["fifty"]
    solver.solve(others, SETTINGS, 4)
    count = len(pen.curve)
    assert count >= 8
    for end in range(count - 6, count):
        part = [*others, pen.model_copy(update={"curve": pen.curve[:end]})]
        steps = solver.steps(part, SETTINGS, 4)
        previews = (r for r in steps if isinstance(r, Preview | Settled))
        assert [next(previews).level for _ in range(2)] == [0, 4]
        steps.close()
    levels, preview, settled = previewed(solver, SCENES["fifty"])
    assert levels == [0, 4, 1, 2, 3]
    assert np.abs(preview - settled).max() <= 1e-3 * np.ptp(settled)
    levels, _, fresh = previewed(Solver(), SCENES["fifty"])
    assert levels == [0, 1, 2, 3, 4]
    assert np.array_equal(settled, fresh)


def test_ground_that_is_not_what_it_was_is_not_begun_with() -> None:
    """Other settings, many other strokes, or a solve that was left in the middle of the finest level."""
    strokes, whole, solver = SCENES["fifty"], [0, 1, 2, 3, 4], Solver()
    solver.solve(strokes, PINNED, 4)
    assert previewed(solver, strokes)[0] == whole
    assert previewed(solver, strokes[9:])[0] == [0, 4, 1, 2, 3], "fewer are what there were"
    assert previewed(solver, strokes)[0] == whole, "nine more are not"
    left = solver.steps(strokes, SETTINGS, 4)
    for result in left:  # up to the step after the last coarse level, in which the finest is begun again
        if isinstance(result, Level) and result.channel == Channel.HEIGHT and result.level == 3:
            break
    next(left)
    left.close()
    assert previewed(solver, strokes[1:])[0] == whole


@pytest.mark.parametrize("scene", list(SCENES))
def test_previews_are_close(solver: Solver, scene: str) -> None:
    """SPEC S18."""
    results = [r for r in solver.steps(SCENES[scene], SETTINGS, TOP) if isinstance(r, Level) and r.level == TOP]
    preview, settled = results
    relief = max(float(np.ptp(settled.heights)), 1.0)
    assert np.abs(preview.heights - settled.heights).max() <= 1e-3 * relief
    assert np.sqrt(np.mean((preview.heights - settled.heights) ** 2)) < 1e-4 * relief


def test_close_and_go_on(solver: Solver) -> None:
    """SPEC S17: closing at every possible moment."""
    whole = solver.solve(SCENES["five"], SETTINGS, 2)[2]
    count = len(list(solver.steps(SCENES["five"], SETTINGS, 2)))
    for stop in range(count):
        run = solver.steps(SCENES["cross"], SETTINGS, 2)
        for _ in range(stop):
            next(run)
        run.close()
        assert np.array_equal(solver.solve(SCENES["five"], SETTINGS, 2)[2], whole)


def test_interleaved_solves(solver: Solver) -> None:
    """SPEC S15, S17: many rooms, round robin by level, of different sets, settings and sizes."""
    jobs = [(SCENES[n], s, level) for n, s, level in
            (("five", SETTINGS, 2), ("fifty", SETTINGS, 3), ("cross", PINNED, 2), ("tiny", SETTINGS, 1),
             ("loops", SETTINGS, 3), ("one", SETTINGS, 0))]  # fmt: skip
    alone = [Solver().solve(*job)[job[2]] for job in jobs]
    running = {k: solver.steps(*job) for k, job in enumerate(jobs)}
    last: dict[int, Level] = {}
    while running:
        for k in list(running):
            try:
                result = next(running[k])
            except StopIteration:
                del running[k]
                continue
            if isinstance(result, Level):
                last[k] = result  # heights of the finest level come last
    for k, heights in enumerate(alone):
        assert np.array_equal(last[k].heights, heights)


def test_stop_between_levels(solver: Solver) -> None:
    seen: list[Level] = []
    pyramid = solver.solve(SCENES["five"], SETTINGS, 3, on_level=seen.append, should_stop=lambda: len(seen) == 2)
    assert not pyramid.settled
    assert len(pyramid) == 2
    assert [r.level for r in seen] == [0, 1]


def test_levels_are_checked(solver: Solver) -> None:
    for level in (-1, 7):
        with pytest.raises(ValueError, match=r"0\.\.6"):
            solver.steps([], SETTINGS, level)
    with pytest.raises(ValueError, match="max_level"):
        Solver(device="numpy", max_level=9)


def test_an_error_while_loading_is_not_remembered(solver: Solver, monkeypatch: pytest.MonkeyPatch) -> None:
    """A raster that failed half-way is done again in full."""
    good = solver.solve(SCENES["five"], SETTINGS, 2)[2]

    def fail(*_: object) -> None:
        raise RuntimeError("lost the device")

    with monkeypatch.context() as patch:
        patch.setattr("esker.solve.opencl.levels.ClSystem.coarsen", fail)
        patch.setattr("esker.solve.opencl.gpu_levels.GpuSystem.coarsen", fail)
        patch.setattr("esker.solve.reference.coarsen", fail)
        with pytest.raises(RuntimeError):
            solver.solve(SCENES["five"][1:], SETTINGS, 2)
    assert np.array_equal(solver.solve(SCENES["five"], SETTINGS, 2)[2], good)
