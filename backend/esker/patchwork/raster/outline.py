"""How the edge of a grid bends beyond the straight lines between its corners, for whoever draws its outline."""

from __future__ import annotations

import itertools
from typing import Final

import numpy as np
from numpy.typing import NDArray

from esker.contract import EDGE_POINTS, CurvePoint
from esker.patchwork.raster.patches import warped

LEAST_BEND: Final = 0.25
"""An edge that bends less than this share of a step of the lattice is as good as straight."""
DIGITS: Final = 3


def bent_edge(rows: int, cols: int, warp: NDArray[np.float64] | None) -> tuple[CurvePoint, ...]:
    """``GridFacts.edge`` of a (rows, cols) grid with a control net (m, n, 2) in lattice units; () if straight."""
    if warp is None:
        return ()
    corners = np.array([[0, 0], [cols - 1, 0], [cols - 1, rows - 1], [0, rows - 1], [0, 0]], dtype=np.float64)
    side = EDGE_POINTS // 4
    share = np.arange(side)[:, None] / side
    straight = np.concatenate([a + (b - a) * share for a, b in itertools.pairwise(corners)])
    moved = np.round(warped(warp, rows, cols, straight) - straight, DIGITS) + 0.0  # makes 0.0 of -0.0
    if np.abs(moved).max() < LEAST_BEND:
        return ()
    return tuple((float(u), float(v)) for u, v in moved)
