"""The same ground on every level, whatever overlaps (SPEC S13, S55)."""

from __future__ import annotations

import numpy as np
import pytest

from esker import grid
from esker.events import Done
from esker.solve.solver import Basis, Solver
from esker.templates import gallery


def settled(solver: Solver, level: int) -> Basis:
    """The scene of fifty strokes at rest, many of them across another's flank, wide and narrow ones."""
    document = gallery.load("fifty")
    found: Basis | None = None
    for result in solver.steps(document.strokes, document.settings, level, basis=True):
        found = result.basis if isinstance(result, Done) else found
    assert found is not None
    return found


@pytest.fixture(scope="module")
def pair(solver: Solver) -> tuple[Basis, Basis]:
    return settled(solver, 4), settled(solver, 5)


def test_levels_agree_where_strokes_overlap(pair: tuple[Basis, Basis]) -> None:
    """S13: a finer level does not weigh strokes anew. Only beside crests and walls, which it resolves better, may it
    differ: with weights by the cell it did on 14 % of the ground."""
    coarse, fine = (basis.heights for basis in pair)
    relief = float(np.ptp(fine))
    apart = np.abs(coarse - fine[::2, ::2])
    assert float((apart > 0.005 * relief).mean()) < 0.02
    assert float(np.median(apart)) < 3e-4 * relief


def test_refined_ground_is_that_of_the_finer_level(solver: Solver, pair: tuple[Basis, Basis]) -> None:
    """S55: bands end at the same places on the ground. When their knowledge of the gradient faded by the cell the free
    ground between them moved smoothly, by 5.2e-3 of the relief, 4.2e-4 RMS: more than a window can put right."""
    coarse, fine = pair
    every = slice(0, grid.samples(5))
    error = (solver.refiner(coarse).window(5, every, every) - fine.heights) / np.ptp(fine.heights)
    assert np.abs(error).max() < 5e-3
    assert np.sqrt((error.astype(np.float64) ** 2).mean()) < 3e-4
