"""Sizes of the fused level visit's working set (shaders/opencl/visit.cl): what the kernel and its host agree on."""

from __future__ import annotations

from esker.contract import TILE_CELLS

PAD = 16
"""Floats before sample 0 of every row, and at least as many behind the last: vectors run past the ends."""
BLOCK = 256
"""Columns of a block: the rows that a wave needs of so many stay in a core's first cache."""
HALO = 16
"""Columns that a block repeats on either side: at least the stages of a wave (sweeps + 2), and whole vectors."""
SLOTS = 7
"""Rows entered that the stages still need, and the one that enters meanwhile: sweeps + 3."""
SLOT_LANES = 6
"""Lanes of a slot: two of the operator, two for each of two channels."""
OWN_LANES = 12
"""Lanes of a channel: two rows of each of four sweeps, four of the residual."""
LANE = BLOCK + 2 * HALO + 4 * PAD


def scratch_floats() -> int:
    """Scratch of one work-item."""
    return (SLOTS * SLOT_LANES + 2 * OWN_LANES) * LANE


def defines() -> dict[str, float | int]:
    """Constants of visit.cl."""
    return {
        "PAD": PAD,
        "BLOCK": BLOCK,
        "HALO": HALO,
        "LANE": LANE,
        "SLOTS": SLOTS,
        "SLOT_LANES": SLOT_LANES,
        "OWN_LANES": OWN_LANES,
        "TILE_CELLS": TILE_CELLS,
    }
