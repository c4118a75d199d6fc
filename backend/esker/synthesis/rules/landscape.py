"""Rule ``landscape``: multi-channel fractals (paper 1, section 4), the default. docs/synthesis.md, "Landscape"."""

from __future__ import annotations

import numpy as np

from esker.contract import BASE_ROUGHNESS
from esker.contract import fractal as f
from esker.synthesis import hash as noise
from esker.synthesis.interpolate import Window
from esker.synthesis.rules import gullies
from esker.synthesis.rules.targets import blended, painted, smoothstep, targets
from esker.synthesis.site import Biases, Ground, Site
from esker.synthesis.state import Array, State


def amplitude(site: Site, guide_slope: Array, channel: Array) -> Array:
    """A, metres: more on steep ground, and what strokes add (or take away)."""
    share = f.FLAT_SHARE + (1 - f.FLAT_SHARE) * smoothstep(f.AMPLITUDE_SLOPE, guide_slope)
    return np.maximum(0, site.amplitude_m * share + channel)


def audible(level: int, survey: Array) -> Array:
    """Share of the detail of a level that may be heard: none down to the spacing of the data, then all of it."""
    share: Array = np.clip(level - survey, 0, 1)
    return share


def landscape(site: Site, ground: Ground, before: State, window: Window, biases: Biases) -> State:
    """Each channel is the parent's, drawn to its target, plus noise; d gets noise of amplitude A 2^(-level H), and an
    octave of gullies where the terrain has any."""
    level, dtype = window.level, site.dtype
    rows, cols = site.indices(window.rows, level), site.indices(window.cols, level)
    words = [noise.hashed(site.seed, level, stream, rows, cols) for stream in range(4)]
    wanted = targets(site, ground)

    grain = f.SMOOTHNESS_NOISE * 2.0 ** (-f.SMOOTHNESS_NOISE_DECAY * level) * noise.low(words[1], dtype)
    h = np.clip(blended(before.h + grain, wanted.h, level), f.SMOOTHNESS_MIN, f.SMOOTHNESS_MAX)

    strength = f.CHANNEL_NOISE * 2.0 ** (-f.CHANNEL_NOISE_DECAY * level)

    def mixed(x: Array, target: Array, g: Array) -> Array:
        undecided = f.CHANNEL_NOISE_PURE + 4 * (1 - f.CHANNEL_NOISE_PURE) * target * (1 - target)
        return np.clip(blended(x + strength * g * undecided, target, level), 0, 1)

    snow = painted(mixed(before.snow, wanted.snow, noise.high(words[1], dtype)), biases.snow)
    wet = painted(mixed(before.wet, wanted.wet, noise.low(words[2], dtype)), biases.wetness)
    grass = painted(mixed(before.grass, wanted.grass, noise.high(words[2], dtype)), biases.grass)
    forest = painted(mixed(before.forest, wanted.forest, noise.low(words[3], dtype)), biases.forest)
    foam = mixed(before.foam, wanted.foam, noise.high(words[3], dtype))

    exponent = h + f.ROUGHNESS_TO_H * (BASE_ROUGHNESS - biases.roughness) + f.SNOW_TO_H * snow
    size = amplitude(site, ground.guide_slope, biases.amplitude) * np.exp2(-level * np.clip(exponent, *f.H_RANGE))
    if site.surveyed:
        size = size * audible(level, biases.survey)
    if not site.eroded:
        return State(before.d + size * noise.full(words[0], dtype), h, snow, wet, grass, forest, foam)
    wear = gullies.wear(site, ground, biases)
    d = before.d + size * gullies.calm(level, wear) * noise.full(words[0], dtype)
    depth = gullies.depth(site, ground, wear)
    if site.surveyed:
        depth = depth * audible(level, biases.survey)
    return State(d + depth * gullies.octave(site, ground, window, depth), h, snow, wet, grass, forest, foam)
