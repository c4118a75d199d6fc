"""Rivers in the server's pictures, by the page's own shader (SPEC R601 to R603)."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from esker import grid
from esker.contract import TerrainSettings
from esker.render.camera import look_at
from esker.render.frame import Scene
from esker.render.reference import Reference
from esker.render.surface import Surface

SIZE = 4096.0
DRY = TerrainSettings(size_m=SIZE, rivers=0.0)
WET = DRY.model_copy(update={"rivers": 1.0, "wetness": 10.0})
WIDTH, HEIGHT = 160, 120


def valley(top: int) -> list[NDArray[np.float32]]:
    """A valley along x = 2048 that falls to the south."""
    levels = []
    for level in range(top + 1):
        at = np.linspace(0, SIZE, grid.samples(level))
        levels.append((0.3 * np.abs(at[None, :] - 2048) + 0.06 * at[:, None]).astype(np.float32))
    return levels


@pytest.fixture(scope="module")
def drawer() -> Reference:
    return Reference("plain", clear=(1.0, 0.0, 1.0))


@pytest.fixture(scope="module")
def surface() -> Surface:
    return Surface(SIZE, valley(4))


def pictures(drawer: Reference, surface: Surface, away_m: float) -> list[NDArray[np.int64]]:
    """The same view without rivers and with them, from above the valley's end."""
    eye, target = (2048.0, 700.0, 42.0 + away_m), (2048.0, 705.0, 42.0)
    scenes = (Scene(settings, look_at(eye, target, SIZE, WIDTH, HEIGHT), 1.5) for settings in (DRY, WET))
    return [drawer.draw(surface, scene, bare=True).pixels.astype(np.int64) for scene in scenes]


def test_a_river_runs_down_the_middle_of_its_valley(drawer: Reference, surface: Surface) -> None:
    """SPEC R601: in the middle of the picture from top to bottom, and the ground beside its banks is as it was."""
    dry, wet = pictures(drawer, surface, 120.0)
    changed = np.abs(wet - dry).max(axis=2) > 12
    middle = changed[:, WIDTH // 2 - 2 : WIDTH // 2 + 2]
    assert middle.any(axis=1).mean() > 0.95
    assert changed[:, :20].mean() < 0.02
    assert changed[:, -20:].mean() < 0.02


def test_a_thin_river_is_still_a_line_from_afar(drawer: Reference, surface: Surface) -> None:
    """SPEC R602: it is a pixel and a half wide, and no wider."""
    dry, wet = pictures(drawer, surface, 2500.0)
    changed = np.abs(wet - dry).max(axis=2) > 6
    rows = changed[20:-20]
    assert (rows.sum(axis=1) > 0).mean() > 0.9
    assert np.median(rows.sum(axis=1)) <= 5


def test_beds_leave_no_gap_between_patches(drawer: Reference, surface: Surface) -> None:
    """SPEC R603: near the eye the ground is lowered into the bed; nothing of what lies behind it shows."""
    _, wet = pictures(drawer, surface, 6.0)
    assert not (wet == (255, 0, 255)).all(axis=2).any()
    eye, target = (2046.0, 690.0, 44.5), (2048.0, 720.0, 42.5)
    low = drawer.draw(surface, Scene(WET, look_at(eye, target, SIZE, WIDTH, HEIGHT), 1.5), bare=True).pixels
    assert not (low[HEIGHT // 2 :] == (255, 0, 255)).all(axis=2).any()
