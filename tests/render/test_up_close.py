"""The ground from half a metre to 500 (SPEC R611)."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from esker.contract import TerrainSettings
from esker.render.camera import look_at
from esker.render.frame import Scene
from esker.render.reference import Reference
from esker.render.surface import Surface
from tests.render.ground import rough_levels

SIZE = 4096.0
DISTANCES = (0.5, 2.0, 10.0, 50.0, 500.0)


@pytest.fixture(scope="module")
def drawer() -> Reference:
    return Reference("plain")


@pytest.fixture(scope="module")
def slope() -> Surface:
    """An even flank of 50 degrees: all that is seen on it is material."""
    x = np.linspace(0, SIZE, rough_levels(0, SIZE)[0].shape[0])
    flank = np.broadcast_to(1.2 * (x - SIZE / 2), (len(x), len(x))).astype(np.float32)
    return Surface(SIZE, [flank])


def texture(drawer: Reference, slope: Surface, distance: float) -> NDArray[np.float64]:
    """How much neighbouring pixels differ, by the number of pixels they are apart, in parts of the mean."""
    at = (SIZE / 2, SIZE / 2, 0.0)
    eye = (at[0] - 0.77 * distance, at[1], 0.64 * distance)
    settings = TerrainSettings(size_m=SIZE, sun_azimuth_deg=250.0, sun_elevation_deg=30.0)
    grey = drawer.draw(slope, Scene(settings, look_at(eye, at, SIZE, 240, 160))).pixels.mean(axis=2)
    middle = grey[30:130, 40:200]
    apart = np.array([np.abs(middle[:, k:] - middle[:, :-k]).mean() for k in (2, 8, 24)])
    return np.asarray(apart / middle.mean(), dtype=np.float64)


def test_rock_is_rough_at_every_distance(drawer: Reference, slope: Surface) -> None:
    """R611: features of some pixels, of some ten and of dozens, as strong at half a metre as at 500."""
    seen = np.array([texture(drawer, slope, d) for d in DISTANCES])
    assert seen.min() > 0.03
    assert (seen.max(axis=0) / seen.min(axis=0)).max() < 3


def test_nothing_jumps_between_scales(drawer: Reference, slope: Surface) -> None:
    """R611: while the eye comes nearer through one scale into the next, the picture changes evenly."""
    at = (SIZE / 2, SIZE / 2, 0.0)
    settings = TerrainSettings(size_m=SIZE, sun_azimuth_deg=250.0, sun_elevation_deg=30.0)
    steps = []
    last: NDArray[np.float64] | None = None
    for k in range(25):
        distance = 20.0 * 1.002 ** (-k * 29)
        pair = []
        for d in (distance, distance / 1.002):
            eye = (at[0] - 0.77 * d, at[1], 0.64 * d)
            pair.append(drawer.draw(slope, Scene(settings, look_at(eye, at, SIZE, 120, 80))).pixels.astype(float))
        steps.append(float(np.abs(pair[0] - pair[1]).mean()))
        last = pair[1]
    assert last is not None
    assert max(steps) < 3 * float(np.median(steps)) + 0.5
