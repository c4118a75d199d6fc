"""The same ground on every level, whatever overlaps (SPEC S13)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from esker.bench import gallery
from esker.contract import Channel
from esker.solve.solver import Solver


def settled(solver: Solver, level: int) -> NDArray[np.float32]:
    """Heights at rest of the scene of fifty strokes, many of them across another's flank, wide and narrow ones."""
    document = gallery.load("fifty")
    found = None
    for result in solver.steps(document.strokes, document.settings, level):
        if result is not None and result.settled and result.level == level and result.channel == Channel.HEIGHT:
            found = result.heights.copy()
    assert found is not None
    return found


def test_levels_agree_where_strokes_overlap(solver: Solver) -> None:
    """S13: a finer level does not weigh strokes anew. Only beside crests and walls, which it resolves better, may it
    differ: with weights by the cell it did on 14 % of the ground."""
    fine = settled(solver, 5)
    relief = float(np.ptp(fine))
    apart = np.abs(settled(solver, 4) - fine[::2, ::2])
    assert float((apart > 0.005 * relief).mean()) < 0.02
    assert float(np.median(apart)) < 3e-4 * relief
