"""Sizes of refinement's correction on a coarse grid: what the kernels (shaders/opencl/pockets.cl), their host and their
twin (``refine/correction.py``) agree on."""

from __future__ import annotations

from typing import Final

COARSENINGS: Final = 3
"""From a level to the grid on which it is corrected: every eighth sample."""
SUBDOMAIN: Final = 7
"""Nodes of a subdomain on each side of its middle."""
BEYOND: Final = 0.92
"""The correction outside a subdomain, as a share of that at its border."""
RELAXATIONS: Final = 24
"""Red-black over-relaxations of a subdomain."""
OVER_RELAXATION: Final = 1.7
MARGIN: Final = SUBDOMAIN + 2
"""Nodes of nothing around the coarsest grid: subdomains at its ends reach into them."""
REACH: Final = ((SUBDOMAIN + 1) << COARSENINGS) + 2 * ((1 << COARSENINGS) - 1)
"""Samples around one whose residuals its correction depends on: half a subdomain, the way to its middle, and what
restriction and interpolation look at beside them."""


def defines() -> dict[str, float | int]:
    """Constants of pockets.cl."""
    return {
        "SUBDOMAIN": SUBDOMAIN,
        "BEYOND": BEYOND,
        "RELAXATIONS": RELAXATIONS,
        "OVER_RELAXATION": OVER_RELAXATION,
        "MARGIN": MARGIN,
    }
