"""Rule ``landscape``: multi-channel fractals (paper 1, section 4), the default. docs/synthesis.md, "Landscape"."""

from __future__ import annotations

import numpy as np

from esker.contract import BASE_ROUGHNESS
from esker.contract import fractal as f
from esker.synthesis import hash as noise
from esker.synthesis.interpolate import Window
from esker.synthesis.rules import gullies
from esker.synthesis.rules.targets import blended, lie, painted, relief_targets, smoothstep, targets
from esker.synthesis.site import Biases, Ground, Site
from esker.synthesis.state import Array, Relief, State


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
    level, dtype, wanted = window.level, site.dtype, targets(site, ground)
    d, h, snow = _relief(site, ground, Relief(before.d, before.h, before.snow), window, biases, (wanted.h, wanted.snow))
    rows, cols = site.indices(window.rows, level), site.indices(window.cols, level)
    second, third = (noise.hashed(site.seed, level, stream, rows, cols) for stream in (2, 3))
    wet = painted(_mixed(level, before.wet, wanted.wet, noise.low(second, dtype)), biases.wetness)
    grass = painted(_mixed(level, before.grass, wanted.grass, noise.high(second, dtype)), biases.grass)
    forest = painted(_mixed(level, before.forest, wanted.forest, noise.low(third, dtype)), biases.forest)
    foam = _mixed(level, before.foam, wanted.foam, noise.high(third, dtype))
    return State(d, h, snow, wet, grass, forest, foam)


def landscape_relief(site: Site, ground: Ground, before: Relief, window: Window, biases: Biases) -> Relief:
    """The part of ``landscape`` that heights follow from, with the same bits: no other channel reaches them."""
    return _relief(site, ground, before, window, biases, relief_targets(site, ground, lie(site, ground)))


def _relief(
    site: Site, ground: Ground, before: Relief, window: Window, biases: Biases, wanted: tuple[Array, Array]
) -> Relief:
    level, dtype = window.level, site.dtype
    rows, cols = site.indices(window.rows, level), site.indices(window.cols, level)
    words, more = (noise.hashed(site.seed, level, stream, rows, cols) for stream in range(2))
    grain = f.SMOOTHNESS_NOISE * 2.0 ** (-f.SMOOTHNESS_NOISE_DECAY * level) * noise.low(more, dtype)
    h = np.clip(blended(before.h + grain, wanted[0], level), f.SMOOTHNESS_MIN, f.SMOOTHNESS_MAX)
    snow = painted(_mixed(level, before.snow, wanted[1], noise.high(more, dtype)), biases.snow)

    exponent = h + f.ROUGHNESS_TO_H * (BASE_ROUGHNESS - biases.roughness) + f.SNOW_TO_H * snow
    size = amplitude(site, ground.guide_slope, biases.amplitude) * np.exp2(-level * np.clip(exponent, *f.H_RANGE))
    if site.surveyed:
        size = size * audible(level, biases.survey)
    if not site.eroded:
        return Relief(before.d + size * noise.full(words, dtype), h, snow)
    wear = gullies.wear(site, ground, biases)
    d = before.d + size * gullies.calm(level, wear) * noise.full(words, dtype)
    depth = gullies.depth(site, ground, wear)
    if site.surveyed:
        depth = depth * audible(level, biases.survey)
    return Relief(d + depth * gullies.octave(site, ground, window, depth), h, snow)


def _mixed(level: int, x: Array, target: Array, g: Array) -> Array:
    strength = f.CHANNEL_NOISE * 2.0 ** (-f.CHANNEL_NOISE_DECAY * level)
    undecided = f.CHANNEL_NOISE_PURE + 4 * (1 - f.CHANNEL_NOISE_PURE) * target * (1 - target)
    return np.clip(blended(x + strength * g * undecided, target, level), 0, 1)
