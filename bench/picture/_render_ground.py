"""The ground that all renderers draw in ``esker bench render``: ridged value noise, the same bits everywhere."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

SIDE: Final = 1025
SIZE_M: Final = 4096.0
OCTAVES: Final = 9
HIGH_M: Final = 880.0


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


def places(camera: Mapping[str, Any], width: int, height: int, grid: NDArray[np.float32], step: int = 11) -> list[int]:
    """Samples of a grid over ``SIZE_M``, flat indices, at which all renderers' screen errors are measured: every
    ``step``-th of both ways that lies in the picture, whether or not nearer ground hides it there.

    ``camera``: ``eye`` and ``target`` (metres), ``fovDeg`` (vertical), ``near``.
    """
    side = grid.shape[0]
    eye, target = (np.asarray(camera[name], dtype=np.float64) for name in ("eye", "target"))
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    j, i = np.meshgrid(np.arange(3, side, step), np.arange(5, side, step), indexing="ij")
    cell = SIZE_M / (side - 1)
    away = np.stack([i * cell, j * cell, grid[j, i]], axis=-1) - eye
    depth = away @ forward
    tangent = np.tan(np.radians(camera["fovDeg"]) / 2) * np.maximum(depth, 0)
    inside = (depth > camera["near"]) & (np.abs(away @ np.cross(right, forward)) < tangent)
    inside &= np.abs(away @ right) < tangent * width / height
    flat: list[int] = (j * side + i)[inside].tolist()
    return flat
