"""The levels of a solved field: each holds every second sample of the next. Read-only arrays."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from esker.contract import TILE_CELLS

Field32 = NDArray[np.float32]


def injections(finest: Field32) -> list[Field32]:
    """Levels 0, 1, ... of a field (N, N), coarse to fine; the last is ``finest`` itself."""
    top = ((len(finest) - 1) // TILE_CELLS).bit_length() - 1
    return [*(frozen(finest[:: 1 << (top - level), :: 1 << (top - level)]) for level in range(top)), finest]


def frozen(field: Field32) -> Field32:
    """The field, contiguous and read-only; a copy only if it is not contiguous."""
    out = np.ascontiguousarray(field)
    out.flags.writeable = False
    return out
