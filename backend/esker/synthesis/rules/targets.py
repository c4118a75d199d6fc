"""What the ground asks of the channels (docs/synthesis.md, "Targets"), and the ways to follow it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from esker.contract import fractal as f
from esker.synthesis.site import Ground, Site
from esker.synthesis.state import Array


class Targets(NamedTuple):
    """h*, snow*, wet*, grass*, forest*, foam* at each sample."""

    h: Array
    snow: Array
    wet: Array
    grass: Array
    forest: Array
    foam: Array


def smoothstep(interval: tuple[float, float], x: Array) -> Array:
    """0 below the interval, 1 above it, 3t^2 - 2t^3 in it."""
    t: Array = np.clip((x - interval[0]) / (interval[1] - interval[0]), 0, 1)
    return t * t * (3 - 2 * t)


class Lie(NamedTuple):
    """How a sample lies: its height above the sea as a share of the relief, and its slope."""

    elevation: Array
    slope: Array


def lie(site: Site, ground: Ground) -> Lie:
    """Elevation and slope at each sample."""
    t2 = ground.slope_x * ground.slope_x + ground.slope_y * ground.slope_y
    return Lie((ground.height - site.zero_m) / site.relief_m, np.sqrt(t2))


def relief_targets(site: Site, ground: Ground, lies: Lie) -> tuple[Array, Array]:
    """h* and snow* at each sample: what heights follow from."""
    (e, t), v = lies, ground.concavity
    north = -ground.slope_y / np.sqrt(1 + (ground.slope_x * ground.slope_x + ground.slope_y * ground.slope_y))
    h = (
        f.SMOOTHNESS
        + f.SMOOTHNESS_FLAT * (1 - smoothstep(f.SMOOTHNESS_FLAT_SLOPE, t))
        - f.SMOOTHNESS_STEEP * smoothstep(f.SMOOTHNESS_STEEP_SLOPE, t)
        + f.SMOOTHNESS_VALLEY * smoothstep(f.SMOOTHNESS_VALLEY_CONCAVITY, v)
        + f.SMOOTHNESS_LOW * (1 - smoothstep(f.SMOOTHNESS_LOW_ELEVATION, e))
    )
    line = site.look_rule.snow_line - f.SNOW_NORTH * north - f.SNOW_VALLEY * v
    return h, smoothstep(f.SNOW_EDGE, e - line) * (1 - smoothstep(f.SNOW_SLOPE, t))


def targets(site: Site, ground: Ground) -> Targets:
    """Paper 1, section 4: smoother in valleys and low down, rougher where steep; plants and snow by height, slope."""
    look, lies = site.look_rule, lie(site, ground)
    (e, t), v = lies, ground.concavity
    h, snow = relief_targets(site, ground, lies)
    bare, tree = 1 - snow, look.tree_line
    grass = (
        look.plants
        * (1 - smoothstep(f.GRASS_SLOPE, t))
        * (1 - smoothstep((tree, f.GRASS_ABOVE_TREES * tree), e))
        * bare
    )
    forest = (
        look.plants
        * (f.FOREST + f.FOREST_VALLEY * v)
        * (1 - smoothstep(f.FOREST_SLOPE, t))
        * (1 - smoothstep((f.FOREST_THINS * tree, tree), e))
        * bare
    )
    wet = f.WET_VALLEY * smoothstep(f.WET_CONCAVITY, v) * (1 - smoothstep(f.WET_SLOPE, t))
    if site.sea_level_m is not None:
        wet = np.maximum(wet, 1 - smoothstep(f.WET_SHORE, (ground.height - site.zero_m) / site.shore_m))
    return Targets(h, snow, wet, grass, forest, np.full_like(e, f.FOAM))


def tie(level: int) -> float:
    """How strictly a level's channels follow their targets: strictly on coarse levels, loosely on fine ones."""
    return max(f.TIE_MIN, f.TIE * math.pow(2.0, -f.TIE_DECAY * level))


def blended(before: Array, target: Array, level: int) -> Array:
    """A channel on its way to its target."""
    w = tie(level)
    return before * (1 - w) + target * w


def painted(x: Array, bias: Array) -> Array:
    """A channel 0..1 under a stroke's bias: +1 makes it 1, -1 makes it 0."""
    strength: Array = np.abs(bias)
    return x * (1 - strength) + np.where(bias > 0, strength, 0)
