"""Rule ``plain``: no detail; every channel is its target. docs/synthesis.md, "Plain"."""

from __future__ import annotations

import numpy as np

from esker.contract import fractal as f
from esker.synthesis.interpolate import Window
from esker.synthesis.rules.targets import painted, targets
from esker.synthesis.site import Biases, Ground, Site
from esker.synthesis.state import State


def plain(site: Site, ground: Ground, _before: State, _window: Window, biases: Biases) -> State:
    """See the module."""
    wanted = targets(site, ground)
    snow, wet, grass, forest = (
        painted(np.clip(target, 0, 1), bias)
        for target, bias in (
            (wanted.snow, biases.snow),
            (wanted.wet, biases.wetness),
            (wanted.grass, biases.grass),
            (wanted.forest, biases.forest),
        )
    )
    h = np.clip(wanted.h, f.SMOOTHNESS_MIN, f.SMOOTHNESS_MAX)
    return State(np.zeros_like(h), h, snow, wet, grass, forest, wanted.foam)
