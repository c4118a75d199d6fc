"""Compiles all loops of this room: a server does it before it serves."""

from __future__ import annotations

import numpy as np

from esker.flow.pools import pool, sea
from esker.flow.reaches import find_reaches
from esker.flow.water import find_water

SIDE = 33


def warm() -> None:
    """Follows water over a small valley with a hollow, and draws its rivers and pools."""
    y, x = np.mgrid[0:SIDE, 0:SIDE].astype(np.int32)
    valley = (y * 300 + np.abs(x - 16) * 200 - 9000 * ((x == 16) & (y == 20))).astype(np.int32)
    water = find_water(valley)
    find_reaches(water, 4.0)
    index = 5 * SIDE + 16
    water.watershed(index)
    water.raindrop(index)
    pool(valley, index, int(water.filled[5, 16]))
    sea(valley, 100)
