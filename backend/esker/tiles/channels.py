"""Noise amplitude, roughness, what is painted, how fine data and how far strokes are: levels of integers (DESIGN 5.4).

A channel has the same quantum on every level, and its base value (what it is where no stroke says otherwise) is
subtracted, so untouched ground is all zeros. Its levels end ``CHANNEL_LEVELS_BELOW`` below those of the heights.
"""

from __future__ import annotations

from typing import ClassVar, Final

import numpy as np
from numpy.typing import NDArray

from esker import grid
from esker.contract import (
    AMPLITUDE_QUANTA_PER_M,
    BASE_AMPLITUDE_M,
    BASE_BIAS,
    BASE_FAR,
    BASE_ROUGHNESS,
    BASE_SURVEY,
    BIAS_QUANTA,
    CHANNEL_LEVELS_BELOW,
    FAR_QUANTA,
    QUANTA_PER_CELL,
    ROUGHNESS_QUANTA,
    SURVEY_QUANTA,
    TILE_CELLS,
    Channel,
)
from esker.tiles.codec.payload import Ints
from esker.tiles.pyramid import Pyramid

UNIT_SIZE_M: Final = float(TILE_CELLS * QUANTA_PER_CELL)
"""A domain of this size has a quantum of exactly 2^-l on level l: values scaled by powers of two become integers by
the rules of the heights, dead zone and steadiness included, without a rounding of their own."""
BIASES: Final = (Channel.SNOW, Channel.GRASS, Channel.FOREST, Channel.WETNESS, Channel.EROSION)
QUANTA: Final = {
    Channel.AMPLITUDE: AMPLITUDE_QUANTA_PER_M,
    Channel.ROUGHNESS: ROUGHNESS_QUANTA,
    Channel.SURVEY: SURVEY_QUANTA,
    Channel.FAR: FAR_QUANTA,
    **dict.fromkeys(BIASES, BIAS_QUANTA),
}
BASE: Final = {
    Channel.AMPLITUDE: BASE_AMPLITUDE_M,
    Channel.ROUGHNESS: BASE_ROUGHNESS,
    Channel.SURVEY: BASE_SURVEY,
    Channel.FAR: BASE_FAR,
    **dict.fromkeys(BIASES, BASE_BIAS),
}


def channel_levels(levels: int) -> int:
    """The finest level of a channel beside heights of levels 0..``levels``."""
    return max(0, levels - CHANNEL_LEVELS_BELOW)


def values(samples: Ints, channel: Channel) -> NDArray[np.float32]:
    """Samples of a channel as metres (amplitude), 0..1 (roughness), -1..1 (a bias), a level (survey) or 0..1 (far).

    float32, same shape. Raises KeyError for heights and their base.
    """
    return (samples / np.float64(QUANTA[channel]) + BASE[channel]).astype(np.float32)


class ChannelPyramid(Pyramid):
    """The newest levels of one channel; samples are ``(value - base) * quanta``, rounded half to even."""

    ratio: ClassVar[int] = 1
    preview_step: ClassVar[int] = 2

    def __init__(self, channel: Channel, levels: int) -> None:
        super().__init__(UNIT_SIZE_M, channel_levels(levels))
        self.channel = channel

    def settle(self, clock: int, level: int, heights: NDArray[np.float32]) -> int:
        """Replaces a level of the channel: (N_l, N_l) float32 in its unit. See ``Pyramid.settle``; raises the same.

        The base of a channel that was never anything else is not held: what nobody asks for is not sent.
        """
        away = self._away(clock, level, heights)
        return 0 if away is None else super().settle(clock, level, away)

    def preview(self, clock: int, level: int, heights: NDArray[np.float32]) -> int:
        """Replaces a level of the channel by a preview. See ``settle`` and ``Pyramid.preview``."""
        away = self._away(clock, level, heights)
        return 0 if away is None else super().preview(clock, level, away)

    def _away(self, clock: int, level: int, heights: NDArray[np.float32]) -> NDArray[np.float32] | None:
        """Returns the samples as heights of a pyramid; None for a base that is not held."""
        away = heights - np.float32(BASE[self.channel])
        away *= np.float32(QUANTA[self.channel] / (1 << max(0, level)))
        if 0 <= level <= self.top and self.level(level) is None:
            if heights.shape == (grid.samples(level),) * 2 and not away.any():
                return None
            self.begin(clock, level)
        return away
