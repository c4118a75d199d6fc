"""Ground of whole numbers for the tests of running water: natural, level, broken, as large as can be."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from esker.flow.water import NO_SEA

Ints = NDArray[np.int32]

LIMIT: Final = (1 << 31) - 1


def grounds() -> dict[str, tuple[Ints, int]]:
    """Name to heights and the sea's height."""
    y, x = np.mgrid[0:13, 0:13].astype(np.int32)
    rng = np.random.default_rng(11)
    rim = np.abs(np.hypot(x - 6, y - 6) - 4)
    crater = (200 - 30 * rim).astype(np.int32)
    pits = np.where((x % 3 == 1) & (y % 3 == 1), 0, 50).astype(np.int32)
    plateau = np.where((x > 3) & (x < 9) & (y > 3) & (y < 9), 90, 10 + x).astype(np.int32)
    saddle = ((x - 6) * (y - 6)).astype(np.int32)
    # A square rim whose north-eastern corner lies across the mesh: water does not pass there.
    rim_across = np.where(np.maximum(np.abs(x - 6), np.abs(y - 6)) == 3, 80, 40).astype(np.int32)
    rim_across[6, 6], rim_across[9, 9] = 10, 20
    # And one whose north-western corner lies along it: water does.
    rim_along = rim_across.copy()
    rim_along[9, 9], rim_along[9, 3] = 80, 20
    stairs = (x // 3 * 7 + y // 4).astype(np.int32)
    ends = np.where((x + y) % 2 == 0, LIMIT, -LIMIT).astype(np.int32)
    steep = (x * x * y).astype(np.int32)
    return {
        "level all over": (np.full((9, 9), 5, np.int32), NO_SEA),
        "sea over everything": (crater, 1000),
        "one sample": (np.array([[7]], np.int32), NO_SEA),
        "one row": (np.array([[3, 1, 2, 5]], np.int32), NO_SEA),
        "two columns": (np.array([[3, 1], [2, 5], [9, 0]], np.int32), NO_SEA),
        "one sample inside": (np.array([[3, 3, 3], [3, 9, 3], [3, 3, 3]], np.int32), NO_SEA),
        "one sample of land": (np.where((x == 6) & (y == 6), 3, 0).astype(np.int32), 0),
        "one pit": (np.array([[3, 3, 3], [3, 0, 2], [3, 3, 3]], np.int32), NO_SEA),
        "pits of one sample": (pits, NO_SEA),
        "crater": (crater, NO_SEA),
        "crater in the sea": (crater, 120),
        "plateau": (plateau, NO_SEA),
        "saddle": (saddle, NO_SEA),
        "corner across the mesh": (rim_across, NO_SEA),
        "corner along the mesh": (rim_along, NO_SEA),
        "stairs": (stairs, NO_SEA),
        "ends of what 32 bits hold": (ends, NO_SEA),
        "steep": (steep, NO_SEA),
        "rough": (rng.integers(0, 1000, (13, 13)).astype(np.int32), NO_SEA),
        "rough, few heights": (rng.integers(0, 4, (13, 17)).astype(np.int32), NO_SEA),
        "rough, few heights, a sea": (rng.integers(0, 4, (17, 13)).astype(np.int32), 0),
    }
