"""The ground that all renderers draw in ``esker bench render``: ridged value noise, the same bits everywhere."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

SIDE = 1025
SIZE_M = 4096.0
OCTAVES = 9
HIGH_M = 880.0


def _hash(x: NDArray[np.uint32], y: NDArray[np.uint32]) -> NDArray[np.float64]:
    v = x * np.uint32(374761393) + y * np.uint32(668265263)
    v = (v ^ (v >> np.uint32(13))) * np.uint32(1274126177)
    out: NDArray[np.float64] = (v ^ (v >> np.uint32(16))).astype(np.float64) / 2**32
    return out


def heights(side: int = SIDE) -> NDArray[np.float32]:
    """(side, side) metres over a square of ``SIZE_M``, row 0 south: nine octaves, each where the last one was high."""
    at = np.arange(side, dtype=np.float64)
    out = np.zeros((side, side))
    weight = np.ones((side, side))
    frequency, gain = 4 / (side - 1), 0.5
    for octave in range(OCTAVES):
        x, y = at[None, :] * frequency + octave * 17, at[:, None] * frequency + octave * 31
        i, j = np.floor(x), np.floor(y)
        u, v = (t * t * t * (t * (t * 6 - 15) + 10) for t in (x - i, y - j))
        a, b = i.astype(np.uint32), j.astype(np.uint32)
        one = np.uint32(1)
        south = _hash(a, b) * (1 - u) + _hash(a + one, b) * u
        north = _hash(a, b + one) * (1 - u) + _hash(a + one, b + one) * u
        ridge = 1 - np.abs(2 * (south * (1 - v) + north * v) - 1)
        t = ridge * ridge * weight
        out += t * gain
        weight = np.minimum(1, t * 1.6)
        gain, frequency = gain / 2, frequency * 2
    return (out * HIGH_M).astype(np.float32)
