"""Patches that were chosen to be blended, and which bins of samples they meet: arrays for loops and kernels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Pack:
    """Chosen patches, ready to be evaluated, in the order of their identities.

    ``coefficients``: float32 (n, 34, 34), of B-splines if ``smooth``, else samples in the first 32 x 32 places;
    ``to_patch``: float64 (n, 2, 3), world to samples of the patch; ``domain``, ``kernel``: float64 (n, 4) as u0, u1,
    v0, v1 in samples; ``volume``: float64 (n,), one over the product of the domain's half sides in metres;
    ``side``: int32 (n,), samples along a side; ``rank``: int32 (n,), ascending, equal for patches that stand equal;
    ``owner``: int32 (n,), the layer's index in ``model.placed``.
    """

    smooth: bool
    coefficients: NDArray[np.float32]
    to_patch: NDArray[np.float64]
    domain: NDArray[np.float64]
    kernel: NDArray[np.float64]
    volume: NDArray[np.float64]
    side: NDArray[np.int32]
    rank: NDArray[np.int32]
    owner: NDArray[np.int32]

    def __len__(self) -> int:
        return len(self.side)


class Bins(NamedTuple):
    """A table of the patches that meet each bin (CSR), and of where the bin's first sample lies in them.

    Patches of bin b (row by row) are ``patch[start[b]:start[b + 1]]``; ``origin`` float32 (entries, 2) are u and v of
    the bin's first sample; ``step`` float32 (n, 4) u and v a column, then u and v a row, of every patch.
    """

    start: NDArray[np.int32]
    patch: NDArray[np.int32]
    origin: NDArray[np.float32]
    step: NDArray[np.float32]
