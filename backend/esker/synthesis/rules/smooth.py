"""Rule ``smooth``: no detail; channels go to their targets without noise, and ground that was never solved is a bicubic
B-spline (paper 1, section 4: smooth surfaces). docs/synthesis.md, "Smooth"."""

from __future__ import annotations

import numpy as np

from esker.contract import fractal as f
from esker.synthesis.interpolate import Window
from esker.synthesis.rules.targets import blended, painted, targets
from esker.synthesis.site import Biases, Ground, Site
from esker.synthesis.state import State


def smooth(site: Site, ground: Ground, before: State, window: Window, biases: Biases) -> State:
    """See the module."""
    level, wanted = window.level, targets(site, ground)
    h = np.clip(blended(before.h, wanted.h, level), f.SMOOTHNESS_MIN, f.SMOOTHNESS_MAX)
    snow, wet, grass, forest = (
        painted(np.clip(blended(x, target, level), 0, 1), bias)
        for x, target, bias in (
            (before.snow, wanted.snow, biases.snow),
            (before.wet, wanted.wet, biases.wetness),
            (before.grass, wanted.grass, biases.grass),
            (before.forest, wanted.forest, biases.forest),
        )
    )
    foam = np.clip(blended(before.foam, wanted.foam, level), 0, 1)
    return State(np.zeros_like(h), h, snow, wet, grass, forest, foam)
