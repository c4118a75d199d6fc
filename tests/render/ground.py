"""A rough ground for tests, without a solver."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from esker import grid


def rough_levels(
    top: int, size_m: float, seed: int = 3, disagree: float = 0.0, octaves: int = 9
) -> list[NDArray[np.float32]]:
    """Levels 0..``top`` of a sum of waves, (N, N) metres. ``disagree``: by how much of its height a level may differ
    from the others, as levels of previews do."""
    rng = np.random.default_rng(seed)
    waves = [
        (0.03 * size_m * 0.62**k, *rng.normal(0, 2.2 * 1.75**k, 2), *rng.uniform(0, 6.28, 1)) for k in range(octaves)
    ]
    out = []
    for level in range(top + 1):
        at = np.linspace(0, 2 * np.pi, grid.samples(level))
        z = sum(a * np.sin(fx * at[None, :] + fy * at[:, None] + turn) for a, fx, fy, turn in waves)
        out.append((np.asarray(z) * (1 + disagree * np.sin(7 * level))).astype(np.float32))
    return out
