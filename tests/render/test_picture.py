"""Pictures of the reference (SPEC V3 to V5)."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from esker.contract import TerrainSettings
from esker.render import programs, reference
from esker.render.camera import Camera, home, look_at
from esker.render.frame import LOOKS, Scene
from esker.render.pictures.views import WALK_M, camera_of
from esker.render.reference import Reference
from esker.render.surface import Surface
from esker.render.tables import stone_mipmaps
from esker.synthesis.detailed import DetailedTerrain
from esker.synthesis.site import Site
from tests.render.ground import rough_levels

SIZE = 4096.0
SETTINGS = TerrainSettings(size_m=SIZE)
MAGENTA = np.array([255, 0, 255])
FRONTEND = Path(__file__).resolve().parents[2] / "frontend" / "src"


@pytest.fixture(scope="module")
def drawer() -> Reference:
    return Reference("plain", clear=(1.0, 0.0, 1.0))


@pytest.fixture(scope="module")
def disagreeing() -> Surface:
    """Levels that are not each other's samples: any gap between patches of two levels shows."""
    return Surface(SIZE, rough_levels(4, SIZE, disagree=0.05))


def inward(surface: Surface, seed: int, count: int) -> list[Camera]:
    """Cameras over the middle that look down on ground alone."""
    rng = np.random.default_rng(seed)
    found = []
    for _ in range(count):
        x, y = rng.uniform(0.4, 0.6, 2) * SIZE
        up = float(rng.choice([30.0, 120.0, 400.0]))
        eye = (float(x), float(y), surface.height_at(x, y) + up)
        away = rng.uniform(0.2, 1.0) * up
        turn = rng.uniform(0, 2 * np.pi)
        target = (x + away * np.cos(turn), y + away * np.sin(turn), eye[2] - 1.2 * up)
        found.append(look_at(eye, target, SIZE, 160, 120))
    return found


def cracks(drawer: Reference, surface: Surface, cameras: list[Camera]) -> int:
    """Pixels in which the background shows through."""
    count = 0
    for k, camera in enumerate(cameras):
        scene = Scene(SETTINGS, camera, tau_px=(0.5, 1.5, 4.0, 9.0)[k % 4])
        pixels = drawer.draw(surface, scene, bare=True).pixels
        count += int((pixels == MAGENTA).all(axis=2).sum())
    return count


def test_no_crack_shows(drawer: Reference, disagreeing: Surface) -> None:
    """V3."""
    assert cracks(drawer, disagreeing, inward(disagreeing, 11, 10)) == 0


def test_cracks_show_without_the_rule_of_edges(monkeypatch: pytest.MonkeyPatch, disagreeing: Surface) -> None:
    """V3: the test can fail."""
    monkeypatch.setattr(programs, "_CONTROL", re.sub(r"\(edges & \du\) != 0u \? 0.5 \* full : ", "", programs._CONTROL))
    words = reference._words

    def without_weights(*args: object) -> NDArray[np.uint32]:
        out = words(*args)  # type: ignore[arg-type]
        out[:, 0] &= 0xF0FFFFFF
        out[:, 3] = 0
        return out

    monkeypatch.setattr(reference, "_words", without_weights)
    assert cracks(Reference("plain", clear=(1.0, 0.0, 1.0)), disagreeing, inward(disagreeing, 11, 8)) > 0


def test_the_same_scene_gives_the_same_picture(drawer: Reference, disagreeing: Surface) -> None:
    """V4."""
    scene = Scene(SETTINGS, home(SIZE, 200, 120), 2.0)
    first, again = (drawer.draw(disagreeing, scene).pixels for _ in range(2))
    assert np.array_equal(first, again)
    assert len(np.unique(first.reshape(-1, 3), axis=0)) > 500


def test_a_picture_in_parts_is_the_whole(
    drawer: Reference, disagreeing: Surface, monkeypatch: pytest.MonkeyPatch
) -> None:
    """V4: off-centre projections meet without a seam. A rounding of rays may move a colour by a step."""
    scene = Scene(SETTINGS.model_copy(update={"sea_level_m": 0.0}), home(SIZE, 300, 200), 2.0)
    shares: list[float] = []
    whole = drawer.draw(disagreeing, scene).pixels.astype(int)
    monkeypatch.setattr(reference, "LARGEST_PART", 128)
    parts = drawer.draw(disagreeing, scene, progress=shares.append).pixels.astype(int)
    off = np.abs(whole - parts).max(axis=2)
    assert off.mean() < 0.02
    assert (off > 8).mean() < 0.002
    assert shares == sorted(shares)
    assert len(shares) == 7


def test_detail_goes_on_near_the_ground(drawer: Reference) -> None:
    """V5: from a metre above it the ground is drawn with cells of a centimetre or two."""
    levels = rough_levels(2, SIZE)
    terrain = DetailedTerrain(Site(SIZE, 7, tuple(levels)))
    surface = Surface.of(terrain, 13)
    z = surface.height_at(2000, 2000, 13)
    camera = look_at((2000, 2000, z + 1.0), (2000.4, 2000.3, z), SIZE, 120, 80)
    picture = drawer.draw(surface, Scene(SETTINGS, camera, 1.5), bare=True)
    assert max(level for level, _, _ in surface._made) >= 12
    assert not (picture.pixels == MAGENTA).all(axis=2).any()
    assert picture.tau_px == 1.5


def test_an_eye_without_a_height_stands_on_the_ground_that_is_drawn() -> None:
    """V5: on finer levels too, which lie metres above the solved ones at crests: the picture was one from below."""
    levels = rough_levels(2, SIZE)
    surface = Surface.of(DetailedTerrain(Site(SIZE, 7, tuple(levels))), 13)
    places = [(900.0 + 190 * k, 3100.0 - 130 * k) for k in range(8)]
    rises = []
    for x, y in places:
        camera = camera_of(f"eye:{x},{y},target:2000,2000", surface, SETTINGS, 120, 80)
        assert camera.eye[2] == pytest.approx(surface.height_at(x, y, 13) + WALK_M)
        rises.append(surface.height_at(x, y, 13) - surface.height_at(x, y))
    assert max(rises) > WALK_M  # who stood on the solved ground was under it somewhere


def test_a_tile_is_the_synthesised_window() -> None:
    """V5: tile by tile from the parents, or a window at once: the same samples."""
    terrain = DetailedTerrain(Site(SIZE, 7, tuple(rough_levels(1, SIZE))))
    surface = Surface.of(terrain, 5)
    tile = surface.slot(4, 5, 9).heights[2:-2, 2:-2]
    at = slice(64 * 9, 64 * 9 + 65), slice(64 * 5, 64 * 5 + 65)
    assert np.array_equal(tile, terrain.window(4, *at).heights)


def test_figures_of_the_looks_are_the_pages() -> None:
    """V2: exposure, haze and contours as in frontend/src/gpu/looks.ts."""
    text = (FRONTEND / "gpu" / "looks.ts").read_text()
    rows = re.findall(r"(\w+): \{ index: (\d), exposure: ([\d.]+), haze: ([\d.]+), contours: ([\d.]+) \}", text)
    assert {name: tuple(map(float, numbers)) for name, *numbers in rows} == {
        k: tuple(map(float, v)) for k, v in LOOKS.items()
    }


def test_stones_are_those_of_the_page() -> None:
    """R64: texels that frontend/test/gpu/parts.test.ts expects too, and mipmaps that fade to level ground."""
    levels = stone_mipmaps()
    at = [levels[0][row, col].tolist() for row, col in ((0, 0), (17, 300), (255, 511), (400, 33))]
    assert at == [[84, 138, 123, 103], [25, 158, 125, 115], [255, 120, 114, 138], [83, 254, 166, 119]]
    assert np.abs(levels[-1][0, 0, 2:].astype(int) - 127).max() <= 2
