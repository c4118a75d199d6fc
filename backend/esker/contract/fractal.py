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
"""Streams of numbers that a level may have; five are used, two half-words each but the first."""

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

# --- gullies: one octave a level of waves that run down the slope (docs/synthesis.md, "Gullies") ---------------------

GULLY_STREAM: Final = 4
"""Stream of the hash that places the pivots of the waves."""
GULLY_CELL: Final = 1.5
"""Side of a cell of the lattice of pivots, in wavelengths."""
GULLY_CYCLIC_SIDE: Final = 16
"""Side of such a cell in samples where the domain is cyclic, whatever the scale: it divides every level's side."""
GULLY_JITTER: Final = 0.42
"""How far a pivot may lie from the middle of its cell, in cells."""
GULLY_DEPTH: Final = 0.45
"""Depth of the octave of level 1 in wavelengths, on a slope of 1."""
GULLY_GAIN: Final = 0.75
"""Depth of an octave in its own wavelengths, as a share of that of the level above it."""
GULLY_FLAT: Final = (0.04, 0.35)
"""Slopes of the drawn ground: there are no gullies below the first, all of them above the second."""
GULLY_STEEP: Final = 0.8
"""Slope from which gullies get no deeper."""
GULLY_CREST: Final = (0.3, 1.0)
"""Convexity, the negative of v, over which crests are held."""
GULLY_FOOT: Final = (0.3, 1.0)
GULLY_FOOT_SHARE: Final = 0.4
"""Concavity over which gullies lose this share of their depth, or water would stand in every one of them."""
GULLY_HOLD: Final = (0.04, 0.45)
"""Distance from what strokes fix, in wavelengths, over which gullies get their depth."""
GULLY_TURN: Final = 0.02
"""Slope below which waves stretch instead of turning, or level places were singular points of their direction."""
GULLY_RIDGE: Final = 0.1
GULLY_BED: Final = 0.05
"""Rounding of ridges and of beds, in half waves."""
GULLY_MIDDLE: Final = 0.45
"""What ridges stand above the drawn ground, in depths: an octave's mean is nearly 0."""
GULLY_AGREEMENT: Final = 0.4
GULLY_AGREEMENT_LEAST: Final = 0.05
"""Length of the sum of waves, as a share of their weights and added to it, from which an octave has its full depth.
Where waves cancel out there is no phase, and nothing is cut: such a point would hang on the last bit of a number."""
GULLY_CALM: Final = 0.85
GULLY_CALM_GAIN: Final = 0.65
GULLY_CALM_LEVELS: Final = (2.0, 6.0)
"""Share of the noise of d that gullies take away on coarse levels, and how much of it comes back between these."""
GULLY_QUIET_LEVELS: Final = (5.0, 8.0)
"""Levels between which the noise of d comes back on what strokes fix: finer noise moves no crest by a decimetre."""
GULLY_MOST: Final = 0.55
"""The most that an octave moves the ground, in its depths: the rest of ``GULLY_MIDDLE``."""
GULLY_FALL: Final = GULLY_GAIN / 2
"""What the most that an octave adds falls by from level to level, metres to metres: for bounds."""
GULLY_STEEPER: Final = 1.25
"""How much steeper the guide of finer levels is taken to be between the samples of this one: for bounds."""
GULLY_SINE_1: Final = 6.28318531
GULLY_SINE_3: Final = -41.3416962
GULLY_SINE_5: Final = 81.602208
GULLY_SINE_7: Final = -76.575127
GULLY_SINE_9: Final = 39.710612
"""Odd polynomial of the sine of a phase in turns, on a quarter of a turn; its error is at most 3e-7."""
GULLY_ARC_1: Final = 0.318302140
GULLY_ARC_3: Final = -0.105865160
GULLY_ARC_5: Final = 0.061527325
GULLY_ARC_7: Final = -0.036854605
GULLY_ARC_9: Final = 0.016527812
GULLY_ARC_11: Final = -0.003637512
"""Odd polynomial of the arc tangent in half turns, on 0..1; its error is at most 6e-7, and at 1 it is a quarter."""
FAR_SHARE: Final = 1.0 / 16.0
"""What the channel ``far`` is a share of, as a share of the domain's side: beyond it no octave of any scale is held."""

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
