"""The constants of detail synthesis (docs/synthesis.md): one source for every language.

``contract/emit.py`` writes them, with ``SYNTH_`` before their names, beside those of ``contract``; change a number
here, run ``make generate``, commit both. Nothing here does I/O.

Units: slopes are metres per metre; elevations are shares of ``relief_m`` above ``zero_m``; concavity is the second
difference of the ground over its spacing, positive in a valley. A pair is the interval over which a smoothstep rises.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

# --- noise: a hash of the global sample index (docs/synthesis.md, "Noise") ------------------------------------------

HASH_STEP: Final = 0x9E3779B9
HASH_MULTIPLIER_1: Final = 0x7FEB352D
HASH_MULTIPLIER_2: Final = 0x846CA68B
HASH_STREAMS: Final = 8
"""Streams of numbers that a level may have; four are used, two half-words each but the first."""

# --- detail height --------------------------------------------------------------------------------------------------

ALPHA: Final = 1.0 / 3.0
"""Amplitude of the coarsest octave on steep ground, in cells of level 0."""
FLAT_SHARE: Final = 0.08
"""Share of ``ALPHA`` that is left on level ground."""
AMPLITUDE_SLOPE: Final = (0.03, 0.5)
ROUGHNESS_TO_H: Final = 1.1
"""Fall of the exponent from roughness 0 (smooth) to roughness 1. Roughness in the middle leaves it as it is."""
SNOW_TO_H: Final = 0.8
"""Thick snow damps detail: what full snow adds to the exponent (paper 1, section 4)."""
H_RANGE: Final = (0.75, 2.5)
"""Exponents that an octave can have; the first bounds what may be added on a level, by which boxes grow."""
PAINT_MORE: Final = 2.0
PAINT_LESS: Final = 1.0
"""Amplitude that paint of value 1 adds, and of value -1 takes away, both times ALPHA s_0: the latter all there is."""

# --- smoothness exponent h, a fractal itself ------------------------------------------------------------------------

SMOOTHNESS: Final = 1.05
SMOOTHNESS_MIN: Final = 0.72
SMOOTHNESS_MAX: Final = 1.8
SMOOTHNESS_FLAT: Final = 0.30
SMOOTHNESS_FLAT_SLOPE: Final = (0.05, 0.35)
SMOOTHNESS_STEEP: Final = 0.17
SMOOTHNESS_STEEP_SLOPE: Final = (0.5, 1.1)
SMOOTHNESS_VALLEY: Final = 0.15
SMOOTHNESS_VALLEY_CONCAVITY: Final = (0.0, 0.3)
SMOOTHNESS_LOW: Final = 0.10
SMOOTHNESS_LOW_ELEVATION: Final = (0.0, 0.10)
SMOOTHNESS_NOISE: Final = 0.24
SMOOTHNESS_NOISE_DECAY: Final = 0.2
"""Noise of h on level l: SMOOTHNESS_NOISE * 2^(-SMOOTHNESS_NOISE_DECAY * l)."""

# --- how strictly channels follow height and slope: strictly on coarse levels, loosely on fine ones -----------------

TIE: Final = 0.9
TIE_DECAY: Final = 0.7
TIE_MIN: Final = 0.06
CHANNEL_NOISE: Final = 0.25
CHANNEL_NOISE_DECAY: Final = 0.3
CHANNEL_NOISE_PURE: Final = 0.1
"""Share of a channel's noise where its target is 0 or 1; where it is x, 4 (1 - this) x (1 - x) is added."""
CONCAVITY_SCALE: Final = 2.0

# --- snow, plants, wetness ------------------------------------------------------------------------------------------

SNOW_NORTH: Final = 0.02
SNOW_VALLEY: Final = 0.02
SNOW_EDGE: Final = (-0.015, 0.025)
SNOW_SLOPE: Final = (0.8, 1.3)
GRASS_SLOPE: Final = (0.55, 0.95)
GRASS_ABOVE_TREES: Final = 1.6
FOREST: Final = 0.5
FOREST_VALLEY: Final = 0.3
FOREST_SLOPE: Final = (0.7, 1.0)
FOREST_THINS: Final = 0.7
WET_SHORE: Final = (0.0, 0.006)
WET_VALLEY: Final = 0.6
WET_CONCAVITY: Final = (0.05, 0.5)
WET_SLOPE: Final = (0.3, 0.8)
FOAM: Final = 0.5

FINEST_CELL_M: Final = 0.01
"""Detail ends where cells are this small: at most ``contract.MAX_SYNTHESIS_LEVEL`` levels."""

SNOW_LINE_M: Final = 5200.0
"""Height of the snow line at the equator; it falls by the square of the cosine of the latitude."""
LEAST_SNOW_LINE_M: Final = 300.0
SNOW_SHARE: Final = 0.7
"""Share of the relief of laid ground without a place on Earth above which the natural look's snow lies."""
SHORE_M: Final = 4096.0
"""Metres of which the shore's elevations are shares on real ground, since waves are as high everywhere."""


class LookRule(NamedTuple):
    """What a look makes of height. ``snow_line``, ``tree_line``: elevations; ``plants``: 0 none, 1 as they grow."""

    snow_line: float
    tree_line: float
    plants: float


LOOKS: Final[dict[str, LookRule]] = {
    "natural": LookRule(0.150, 0.085, 1.0),
    "alpine": LookRule(-0.05, 0.06, 1.0),
    "desert": LookRule(9.0, 0.1, 0.05),
    "paper": LookRule(9.0, 0.085, 1.0),
}


def zero_m(lat_deg: float | None, sea_level_m: float | None, ground_m: tuple[float, float] | None) -> float:
    """Returns where elevations count from, metres: the sea; without one the lowest sample of elevation layers on a
    terrain without a place on Earth, else 0. ``ground_m``: lowest and highest sample of the layers, None without
    any."""
    if sea_level_m is not None:
        return sea_level_m
    return 0.0 if lat_deg is not None or ground_m is None else ground_m[0]


def relief_m(size_m: float, lat_deg: float | None, above_m: float = 0.0) -> float:
    """Returns what elevations are shares of, metres: the domain's side, so that a sketch of any size has its own
    climate.

    Where the terrain has a place on Earth, that of which the natural look's snow line is the real one's height there.
    Without a place, ground of elevation layers that reaches ``above_m`` over ``zero_m`` has the snow line at
    ``SNOW_SHARE`` of that at least.
    """
    if lat_deg is None:
        return max(size_m, SNOW_SHARE * above_m / LOOKS["natural"].snow_line)
    line = SNOW_LINE_M * math.cos(math.radians(lat_deg)) ** 2
    return max(LEAST_SNOW_LINE_M, line) / LOOKS["natural"].snow_line


def shore_m(size_m: float, lat_deg: float | None) -> float:
    """Returns what the elevation of wet shores is a share of, metres."""
    return size_m if lat_deg is None else SHORE_M
