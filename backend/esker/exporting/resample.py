"""A square grid with a few samples less a side, by cubic convolution: for engines whose terrains are not 2^n + 1."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

BLOCK_ROWS: Final = 256
"""Rows that are made at a time."""


def taps(samples: int, wanted: int) -> tuple[NDArray[np.intp], NDArray[np.float32]]:
    """(wanted, 4) indices into a row with two samples more at its beginning and end, and their weights.

    Keys, "Cubic convolution interpolation for digital image processing", IEEE ASSP 29 (1981), a = -1/2: third order,
    so that quadratics come out as they are.
    """
    at = np.arange(wanted, dtype=np.float64) * ((samples - 1) / (wanted - 1))
    first = np.minimum(np.floor(at).astype(np.intp), samples - 2)
    t = at - first
    weights = np.stack(
        [
            ((-0.5 * t + 1.0) * t - 0.5) * t,
            (1.5 * t - 2.5) * t * t + 1.0,
            ((-1.5 * t + 2.0) * t + 0.5) * t,
            (0.5 * t - 0.5) * t * t,
        ],
        axis=1,
    )
    return first[:, None] + np.arange(4), weights.astype(np.float32)


def resampled(values: NDArray[Any], wanted: int) -> NDArray[np.float32]:
    """A square (n, n) grid as (wanted, wanted) float32; corner samples stay where they are. Beyond its border the grid
    goes on as the quadratic of its last three samples. Raises ValueError for fewer than three samples a side."""
    n = values.shape[0]
    if n < 3 or wanted < 2 or values.shape != (n, n):
        raise ValueError(f"a grid of shape {values.shape} cannot be given {wanted} samples a side")
    index, weights = taps(n, wanted)
    out = np.empty((wanted, wanted), dtype=np.float32)
    rows = _extended(values.astype(np.float32, copy=False))
    for start in range(0, wanted, BLOCK_ROWS):
        block = slice(start, min(start + BLOCK_ROWS, wanted))
        mixed = np.zeros((block.stop - start, n), dtype=np.float32)
        for k in range(4):
            mixed += weights[block, k, None] * rows[index[block, k]]
        columns = _extended(np.ascontiguousarray(mixed.T))
        made = np.zeros((wanted, block.stop - start), dtype=np.float32)
        for k in range(4):
            made += weights[:, k, None] * columns[index[:, k]]
        out[block] = made.T
    return out


def _extended(rows: NDArray[np.float32]) -> NDArray[np.float32]:
    """One row more at either end."""
    before = 3.0 * rows[0] - 3.0 * rows[1] + rows[2]
    after = 3.0 * rows[-1] - 3.0 * rows[-2] + rows[-3]
    return np.concatenate([before[None], rows, after[None]])
