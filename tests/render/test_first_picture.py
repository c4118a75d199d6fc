"""The first picture after the landing page: empty land under a morning sky, measured by eye's measures (SPEC R310)."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from esker import grid
from esker.contract import TerrainSettings
from esker.render.camera import home
from esker.render.frame import Scene
from esker.render.reference import Reference
from esker.render.surface import Surface
from esker.synthesis.detailed import DetailedTerrain
from esker.synthesis.site import Site

SIZE = 4096.0
WIDTH, HEIGHT = 900, 600
BLUR = 17
"""Pixels of the window that parts fine marks from broad ones: some 150 m of land."""


@pytest.fixture(scope="module")
def picture() -> NDArray[np.float64]:
    levels = tuple(np.zeros((grid.samples(level),) * 2, dtype=np.float32) for level in range(5))
    surface = Surface.of(DetailedTerrain(Site(SIZE, 1, levels)), 8)
    scene = Scene(TerrainSettings(size_m=SIZE), home(SIZE, WIDTH, HEIGHT), 2.0)
    return Reference("plain").draw(surface, scene).pixels[..., :3].astype(float)


def blurred(grey: NDArray[np.float64]) -> NDArray[np.float64]:
    sums = np.pad(grey, ((1, 0), (1, 0))).cumsum(0).cumsum(1)
    k = BLUR
    return np.asarray((sums[k:, k:] - sums[:-k, k:] - sums[k:, :-k] + sums[:-k, :-k]) / k**2)


def test_the_land_is_meadow_and_wood_and_no_fur(picture: NDArray[np.float64]) -> None:
    """What one sees first is what lies where: before, marks of 50 m that repeat were twice as strong as that."""
    grey = picture[330:440, 330:620].mean(axis=2)
    broad = blurred(grey)
    half = BLUR // 2
    fine = grey[half:-half, half:-half] - broad
    assert broad.std() > 0.58 * fine.std()


def test_the_country_is_no_khaki_and_lies_in_light_mist(picture: NDArray[np.float64]) -> None:
    """Green leads in the foreground, and far lowlands are lighter than the land; the sky grows warm at the horizon."""
    red, green, blue = picture[540:590, 500:860].mean(axis=(0, 1))
    assert green > red
    assert blue > 0.75 * red
    mist = picture[150:200, 300:600].mean()
    assert mist > 160
    assert mist > picture[330:440, 330:620].mean() + 60
    low, high = picture[38:44].mean(axis=(0, 1)), picture[2:8].mean(axis=(0, 1))
    assert low[0] / low[2] > high[0] / high[2] + 0.08
