"""Cubic spline patches as B-spline coefficients (paper 2 section 4.1: interpolating bicubic splines).

Samples at 0..n-1 of a natural cubic spline (second derivative zero at both ends) and its uniform B-spline coefficients
c satisfy (c[k-1] + 4 c[k] + c[k+1]) / 6 = sample[k]. Natural ends make c[0] = sample[0], and one coefficient more lies
beyond each end by linear continuation. In two dimensions the same along rows, then along columns. Coefficients are kept
rather than samples and second derivatives: a value then takes one 4 x 4 gather. Twin: ``blend_reference.coefficients``.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from esker.contract import PATCH_SAMPLES
from esker.patchwork.jit import kernel

STRIDE: Final = PATCH_SAMPLES + 2
"""Coefficients along one side of a stored patch: one more beyond each end."""


@kernel
def _pivots(n: int) -> NDArray[np.float64]:
    """Reciprocals of the elimination's pivots of tridiag(1, 4, 1), for n samples."""
    out = np.zeros(n)
    for k in range(1, n - 1):
        out[k] = 1.0 / (4.0 - out[k - 1])
    return out


@kernel
def _solve(values: NDArray[np.float64], side: int, pivot: NDArray[np.float64]) -> None:
    """Samples to coefficients along the first axis, in place: elimination and substitution, all columns at once."""
    for row in range(1, side - 1):
        here, below, p = values[row], values[row - 1], pivot[row]
        for col in range(side):
            here[col] = (6.0 * here[col] - below[col]) * p
    for row in range(side - 2, 0, -1):
        here, above, p = values[row], values[row + 1], pivot[row]
        for col in range(side):
            here[col] -= p * above[col]


@kernel
def prefilter(samples: NDArray[np.float64], side: int, out: NDArray[np.float32]) -> None:
    """Turn ``samples[:side, :side]`` (spoilt by this) into coefficients ``out[:side + 2, :side + 2]``."""
    pivot = _pivots(side)
    _solve(samples, side, pivot)
    turned = np.empty((side, side))
    for row in range(side):
        for col in range(side):
            turned[col, row] = samples[row, col]
    _solve(turned, side, pivot)
    for row in range(side):
        for col in range(side):
            out[row + 1, col + 1] = turned[col, row]
        out[row + 1, 0] = 2.0 * turned[0, row] - turned[1, row]
        out[row + 1, side + 1] = 2.0 * turned[side - 1, row] - turned[side - 2, row]
    for col in range(side + 2):
        out[0, col] = 2.0 * out[1, col] - out[2, col]
        out[side + 1, col] = 2.0 * out[side, col] - out[side - 1, col]
