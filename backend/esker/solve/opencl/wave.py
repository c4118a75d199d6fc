"""Sizes of the fused level visit's working set (shaders/opencl/visit.cl): what the kernel and its host agree on."""

from __future__ import annotations

from esker.contract import TILE_CELLS

PAD = 16
"""Floats before sample 0 of every row, and at least as many behind the last: vectors run past the ends."""
BLOCK = 256
"""Columns of a block: the rows that a wave needs of so many stay in a core's first cache."""
HALO = 16
"""Columns that a block repeats on either side: at least the stages of a wave (sweeps + 2), and whole vectors."""
SLOTS = 6
"""Rows entered that the stages still need: sweeps + 2."""
LANES = 3 * SLOTS + 14
"""Rows of a block that a wave works on: see visit.cl."""
LANE = BLOCK + 2 * HALO + 48
"""Floats of a lane: the block, its halo, what vectors read beyond, and an odd number of cache lines."""


def scratch_floats() -> int:
    """Scratch of one work-item."""
    return LANES * LANE


def defines() -> dict[str, float | int]:
    """Constants of visit.cl."""
    return {
        "PAD": PAD,
        "BLOCK": BLOCK,
        "HALO": HALO,
        "LANE": LANE,
        "SLOTS": SLOTS,
        "TILE_CELLS": TILE_CELLS,
    }
