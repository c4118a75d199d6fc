"""Channel targets: what strokes ask of all channels but the heights (DESIGN 5.4), as differences from the base."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

from esker.contract import (
    BASE_AMPLITUDE_M,
    BASE_BIAS,
    BASE_ROUGHNESS,
    TILE_CELLS,
    Channel,
    PaintChannel,
    Stroke,
    TerrainSettings,
)
from esker.contract.fractal import ALPHA, PAINT_LESS, PAINT_MORE

BASES: Final = {
    Channel.AMPLITUDE: BASE_AMPLITUDE_M,
    Channel.ROUGHNESS: BASE_ROUGHNESS,
    Channel.SNOW: BASE_BIAS,
    Channel.GRASS: BASE_BIAS,
    Channel.FOREST: BASE_BIAS,
    Channel.WETNESS: BASE_BIAS,
    Channel.EROSION: BASE_BIAS,
}
"""The channels in the order in which they are solved, and their values where no stroke asks for others."""
PAINTED: Final[dict[PaintChannel, Channel]] = {
    "amplitude": Channel.AMPLITUDE,
    "roughness": Channel.ROUGHNESS,
    "snow": Channel.SNOW,
    "grass": Channel.GRASS,
    "forest": Channel.FOREST,
    "wetness": Channel.WETNESS,
    "erosion": Channel.EROSION,
}
STROKES_ASK: Final = frozenset({Channel.AMPLITUDE, Channel.ROUGHNESS})
"""Channels of which every stroke of the ground asks something, not paint alone."""
PAINT_REACH_FRACTION: Final = 1 / 256
"""How far paint is felt beyond its radius, as a share of the domain: a brush paints what its ring shows."""


class Layer(NamedTuple):
    """One of the two fields that a channel is made from: what strokes of the ground ask of it, or what is painted."""

    channel: Channel
    painted: bool


GROUND_LAYERS: Final[tuple[Layer, ...]] = tuple(Layer(channel, painted=False) for channel in sorted(STROKES_ASK))


def target(stroke: Stroke, layer: Layer, settings: TerrainSettings) -> float | None:
    """Returns a stroke's target for a layer, as a difference from the layer's base in its unit; None without one.

    Paint of roughness asks for 0 (value -1) to 1; of amplitude, for PAINT_MORE times the natural detail of the terrain
    (value 1), or to take PAINT_LESS of it away (value -1); of the others, for the value itself.
    """
    channel, paint = layer.channel, stroke.paint
    if (paint is not None) != layer.painted:
        return None
    if paint is not None:
        if PAINTED[paint.channel] != channel:
            return None
        if channel == Channel.AMPLITUDE:
            return paint.value * (PAINT_MORE if paint.value > 0 else PAINT_LESS) * natural_amplitude_m(settings)
        return 0.5 * paint.value if channel == Channel.ROUGHNESS else paint.value
    if channel == Channel.AMPLITUDE:
        return stroke.amplitude_m - BASE_AMPLITUDE_M
    return stroke.roughness - BASE_ROUGHNESS if channel == Channel.ROUGHNESS else None


def natural_amplitude_m(settings: TerrainSettings) -> float:
    """Amplitude of the coarsest octave of natural detail on steep ground, metres (docs/synthesis.md)."""
    return ALPHA * settings.size_m / TILE_CELLS


@dataclass
class Contributors:
    """The visible strokes that ask something of a layer, and the least and the greatest that any asks, 0 included."""

    strokes: list[Stroke]
    low: float = 0.0
    high: float = 0.0

    @property
    def bounds(self) -> tuple[float, float]:
        """Between these lies every value of the layer, as a diffused one lies between those that were asked for."""
        return self.low, self.high


def contributors(strokes: Sequence[Stroke], settings: TerrainSettings) -> dict[Layer, Contributors]:
    """Returns the contributors of each layer of which any stroke asks anything but its base.

    Layers that are missing are their base everywhere.
    """
    crests: list[Stroke] = []
    found = {layer: Contributors(crests) for layer in GROUND_LAYERS}
    for stroke in strokes:
        if stroke.hidden or not stroke.curve:
            continue
        if stroke.paint is None:
            crests.append(stroke)
            if stroke.amplitude_m == BASE_AMPLITUDE_M and stroke.roughness == BASE_ROUGHNESS:
                continue  # most strokes
            layers = GROUND_LAYERS
        else:
            layers = (Layer(PAINTED[stroke.paint.channel], painted=True),)
            found.setdefault(layers[0], Contributors([])).strokes.append(stroke)
        for layer in layers:
            value, mine = target(stroke, layer, settings) or 0.0, found[layer]
            mine.low, mine.high = min(mine.low, value), max(mine.high, value)
    return {layer: mine for layer, mine in found.items() if mine.bounds != (0, 0)}


def reach_of(layer: Layer, settings: TerrainSettings) -> float | None:
    """How far a layer's values are felt, metres; None for everywhere.

    What strokes of the ground ask is felt as far as their heights are. Paint hardly beyond its radius: with the papers'
    endless diffusion a dab of snow would lie on everything.
    """
    if not layer.painted:
        return settings.reach_m
    most = settings.size_m * PAINT_REACH_FRACTION
    return most if settings.reach_m is None else min(settings.reach_m, most)
