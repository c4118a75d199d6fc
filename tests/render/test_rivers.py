"""Rivers in the server's pictures, by the page's own shader (SPEC R601 to R603, R650, R651)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from numpy.typing import NDArray

from esker import grid
from esker.contract import TerrainSettings
from esker.flow.rivers import River
from esker.render import reference
from esker.render.camera import look_at
from esker.render.frame import Scene
from esker.render.reference import Reference
from esker.render.rivers import CELLS, LATTICES, river_map
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
    """SPEC R602: it is about two pixels wide, and no wider."""
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


def test_a_thin_river_has_no_gaps_where_pixels_are_long(drawer: Reference) -> None:
    """SPEC R650: at a low angle a river across a plain is one line, though a pixel reaches fifty metres."""
    at = np.linspace(0, SIZE, grid.samples(4))
    plain = (0.02 * np.abs(at[None, :] - 2048) + 0.012 * at[:, None]).astype(np.float32)
    levels = [plain[:: 1 << 4 - level, :: 1 << 4 - level] for level in range(5)]
    camera = look_at((3900.0, 2600.0, 430.0), (2048.0, 1500.0, 18.0), SIZE, WIDTH, HEIGHT)
    scenes = (Scene(settings, camera, 1.5) for settings in (DRY, WET.model_copy(update={"wetness": 1.0})))
    dry, wet = (drawer.draw(Surface(SIZE, levels), scene, bare=True).pixels.astype(np.int64) for scene in scenes)
    seen = np.abs(wet - dry).max(axis=2).max(axis=0)[WIDTH // 5 : -WIDTH // 5]
    assert seen.min() > 0.6 * np.median(seen), seen.tolist()


def test_a_river_that_fades_into_another_is_one_line(
    drawer: Reference, surface: Surface, monkeypatch: pytest.MonkeyPatch
) -> None:
    """SPEC R651: of two lines that cross again and again the one that is shown more is seen as if it were alone."""
    steps = np.arange(0.0, 4097.0, 64.0)
    sway = np.where(np.arange(len(steps)) % 4 < 2, 2.0, -2.0)
    going, coming = (
        River(np.column_stack((2050.0 + side * sway, steps)), (area, area), (0.0, 0.0), (0.0, 0.0), None)
        for side, area in ((1.0, 4e5), (-1.0, 5e5))
    )
    shown = [coming]

    def shares(found: Sequence[River], *_: object) -> NDArray[np.float32] | None:
        texels = river_map(shown if found else [], SIZE, 1.0)
        if texels is not None:
            pieces = texels.reshape(-1, 4)[sum((CELLS >> k) ** 2 for k in range(LATTICES)) :].reshape(-1, 8)
            pieces[:, 7] = np.where(pieces[:, 4] > half_of(going) + 1e-3, 0.7, 0.3)
        return texels

    monkeypatch.setattr(reference, "river_map", shares)
    dry, alone = pictures(drawer, surface, 1500.0)
    shown.append(going)
    _, both = pictures(drawer, surface, 1500.0)
    seen, before = (np.abs(one - dry).max(axis=2).max(axis=1)[30:-30] for one in (both, alone))
    assert before.min() > 8
    assert (seen > 0.8 * before).all(), (seen / before).round(2).tolist()


def half_of(river: River) -> float:
    """Half the width of a river of one area, metres, by Bieger et al. 2015."""
    return float(0.5 * 2.7 * (river.area_m2[0] / 1e6) ** 0.352)
