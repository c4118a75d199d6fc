"""The compiled loop of gullies: one octave at every sample of a window. Twin: ``gullies.octave_reference``, to the bit.

The NumPy twin makes nine planes for each of a score of steps, and takes nine tenths of the time in which the server
finds rivers; the loop makes one sample after the other (docs/synthesis.md, "Gullies").
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from esker.compiled import kernel
from esker.contract import fractal as f

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SINE: Final = (f.GULLY_SINE_1, f.GULLY_SINE_3, f.GULLY_SINE_5, f.GULLY_SINE_7, f.GULLY_SINE_9)
ARC: Final = (f.GULLY_ARC_1, f.GULLY_ARC_3, f.GULLY_ARC_5, f.GULLY_ARC_7, f.GULLY_ARC_9, f.GULLY_ARC_11)
SHAPE: Final = (
    f.GULLY_CELL, f.GULLY_TURN**2, f.GULLY_AGREEMENT, f.GULLY_AGREEMENT_LEAST, f.GULLY_RIDGE, f.GULLY_BED,
    f.GULLY_MIDDLE,
)  # fmt: skip
"""Constants go in as arguments: a loop that is kept on disk does not know when another file has changed."""


@kernel
def _sine(a: float, sine: tuple[float, ...]) -> float:
    p = a * a
    return a * (sine[0] + p * (sine[1] + p * (sine[2] + p * (sine[3] + p * sine[4]))))


@kernel
def _half_turns(s: float, c: float, arc: tuple[float, ...]) -> float:
    high, low = max(abs(s), abs(c)), min(abs(s), abs(c))
    x = low / max(high, 1e-20)
    p = x * x
    a = x * (arc[0] + p * (arc[1] + p * (arc[2] + p * (arc[3] + p * (arc[4] + p * arc[5])))))
    if abs(s) > abs(c):
        a = 0.5 - a
    return 1 - a if c < 0 else a


@kernel
def _rounded(t: float, radius: float) -> float:
    most = math.sqrt(1 + radius * radius)
    return (math.sqrt(t * t + radius * radius) - radius) / (most - radius)


@kernel
def fill(
    out: Floats, where: Floats, slope_x: Floats, slope_y: Floats, row: Ints, v: Floats, col: Ints, u: Floats,
    east: Floats, north: Floats, sine: tuple[float, ...], arc: tuple[float, ...], shape: tuple[float, ...],
) -> None:  # fmt: skip
    """Writes the octave at samples where ``where`` is not 0, and 0 elsewhere.

    ``row``, ``v``: cell of the lattice and place in it of each row of samples; ``col``, ``u``: of each column;
    ``east``, ``north``: pivots of cells, from one before the first to one behind the last.
    """
    cell, turning, agreement, least, ridge, bed, middle = shape
    for j in range(out.shape[0]):
        for i in range(out.shape[1]):
            if where[j, i] == 0:
                out[j, i] = 0
                continue
            gx, gy = slope_x[j, i], slope_y[j, i]
            turn = 1 / math.sqrt(gx * gx + gy * gy + turning)
            nx, ny = -gy * turn, gx * turn
            cosine, sines, weights = 0.0, 0.0, 0.0
            for dj in range(-1, 2):
                for di in range(-1, 2):
                    qx = u[i] - (di + east[row[j] + dj + 1, col[i] + di + 1])
                    qy = v[j] - (dj + north[row[j] + dj + 1, col[i] + di + 1])
                    w = max(0.0, 1 - (qx * qx + qy * qy))
                    if w == 0:
                        continue
                    t = cell * (qx * nx + qy * ny)
                    t = t - math.floor(t + 0.5)
                    near = t if abs(t) <= 0.25 else math.copysign(0.5, t) - t
                    cosine += w * w * _sine(0.25 - abs(t), sine)
                    sines += w * w * _sine(near, sine)
                    weights += w * w
            length = math.sqrt(cosine * cosine + sines * sines)
            agree = min(1.0, length / (agreement * weights + least))
            t = _half_turns(sines, cosine, arc)
            height = middle - (_rounded(t, ridge) * (1 - t) + (1 - _rounded(1 - t, bed)) * t)
            out[j, i] = agree * agree * (3 - 2 * agree) * height


def warm() -> None:
    """Compiles the loop, or loads it from the disk."""
    plane, place, cell = np.ones((2, 2)), np.zeros(2), np.zeros(2, dtype=np.int64)
    pivots = np.full((3, 3), 0.5)
    fill(np.empty((2, 2)), plane, plane, plane, cell, place, cell, place, pivots, pivots, SINE, ARC, SHAPE)
