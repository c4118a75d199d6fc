"""The correction of refinement on a coarse grid (SPEC S545..S548): what it moves, how far it sees, what it is worth."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from bench.ground.refine import scene_of
from esker import grid
from esker.solve import reference
from esker.solve.opencl.device import Device
from esker.solve.refine import engine
from esker.solve.refine.cache import FieldCache
from esker.solve.refine.cl_engine import ClEngine
from esker.solve.refine.correction import corrected
from esker.solve.refine.pocket import COARSENINGS, REACH
from esker.solve.refine.refinement import Refiner
from esker.solve.solver import Solver
from tests.solver.test_refine import settled

Field = NDArray[np.float64]
SIDE = 241
SCREENING = 1e-4


def crest(n: int) -> Field:
    """Stiffness of a level that a crooked crest, one sample wide, cuts into a west and an east."""
    d, y = np.zeros((n, n)), np.arange(n + 1)
    x = np.round(n / 2 + 0.2 * n * np.sin(y / 17) + 0.13 * y).astype(int)
    for row in range(n):
        d[row, min(x[row], x[row + 1]) : max(x[row], x[row + 1], x[row] + 1)] = -1
    return d


def sides(d: Field) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """The samples west and east of it."""
    fixed = d < 0
    west = np.cumsum(fixed, axis=1) == 0
    east = np.cumsum(fixed[:, ::-1], axis=1)[:, ::-1] == 0
    return west, east


def test_nothing_crosses_a_crest_and_a_crest_stays() -> None:
    """SPEC S545: on no grid, however narrow the crest, and to the last bit."""
    d = crest(SIDE)
    west, east = sides(d)
    residual = np.where(west, np.random.default_rng(3).normal(size=d.shape), 0.0)
    found = corrected(np.zeros_like(d), residual, d, SCREENING)
    assert np.abs(found[west]).max() > 0.1
    assert not found[east].any()
    assert not found[d < 0].any()


def test_a_correction_depends_on_what_is_near() -> None:
    """SPEC S546: on residuals within REACH of a sample, wherever it lies between the nodes."""
    d, rng = np.where(np.random.default_rng(5).random((SIDE, SIDE)) < 2e-3, -1.0, 0.0), np.random.default_rng(6)
    farthest = 0
    for _ in range(12):
        at = rng.integers(REACH, SIDE - REACH, 2)
        residual = np.zeros_like(d)
        residual[tuple(at)] = 1
        moved = np.argwhere(corrected(np.zeros_like(d), residual, d, SCREENING))
        if len(moved):
            farthest = max(farthest, int(np.abs(moved - at).max()))
    assert REACH - (1 << COARSENINGS) < farthest <= REACH


def test_a_pocket_of_ground_moves_as_a_whole() -> None:
    """SPEC S547: a smooth error between crests sixty samples apart, of which sweeps see little, is mostly gone."""
    d = np.zeros((SIDE, SIDE))
    d[90, 60:180] = d[150, 60:180] = d[90:151, 60] = d[90:151, 180] = -1
    y, x = np.clip((np.indices(d.shape) - [[[90]], [[60]]]) / [[[60]], [[120]]], 0, 1)
    error = (np.sin(np.pi * y) * np.sin(np.pi * x))[None]
    rhs = np.zeros_like(error)
    swept = engine.sweeps(error, rhs, d[None], SCREENING, engine.height_weights(70))
    found = engine.relaxed(error, rhs, d[None], SCREENING)
    assert np.abs(swept).max() > 0.15
    assert np.abs(found).max() < 0.06
    residual = reference.residual(error, rhs, d[None], SCREENING)
    assert np.abs(corrected(error[0], residual[0], d, SCREENING)).max() < 0.2


@pytest.mark.parametrize("seed", [12, 101])
def test_scenes_that_nothing_was_tuned_for(solver: Solver, device: Device, seed: int) -> None:
    """SPEC S548: forty random strokes against a solve of the finer level, 1025 samples a side."""
    strokes, settings = scene_of(f"unseen-{seed}").strokes, scene_of(f"unseen-{seed}").settings
    refiner = Refiner(settled(solver, strokes, settings, 3), ClEngine(device), FieldCache())
    exact, n = solver.solve(strokes, settings, 4)[4], grid.samples(4)
    error = (refiner.window(4, slice(0, n), slice(0, n)) - exact).astype(np.float64) / np.ptp(exact)
    assert np.abs(error).max() < 5e-3
    assert np.sqrt((error**2).mean()) < 2.15e-4
