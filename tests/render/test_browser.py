"""The browser's picture against the reference's: two programs, two drivers, one set of shaders (SPEC V2)."""

from __future__ import annotations

import base64
import io
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from playwright.sync_api import Page

from esker.contract import TerrainSettings
from esker.render.camera import Camera
from esker.render.frame import Scene
from esker.render.reference import Reference
from esker.render.surface import Surface
from esker.synthesis.detailed import DetailedTerrain
from esker.synthesis.site import Site
from esker.synthesis.subdivide import finest_level
from tests.gpu.page import open_harness
from tests.render.ground import rough_levels

SIZE, LEVELS = 4096.0, 3
WIDTH, HEIGHT = 640, 400
EYE, TARGET = (3300.0, -200.0, 700.0), (2000.0, 2400.0, 150.0)
TAU = 0.5
RESTING = 1.5
"""Factor on the screen error of a picture at rest on a software adapter (frontend/src/gpu/quality.ts)."""
SCENES: dict[str, dict[str, Any]] = {
    "natural": {"look": "natural"},
    "sea": {"look": "natural", "sea_level_m": 20.0},
    "paper": {"look": "paper"},
    "lakes": {"look": "natural", "lakes_m": 2.0},
}


@pytest.fixture(scope="module")
def levels() -> list[NDArray[np.float32]]:
    return rough_levels(LEVELS, SIZE, octaves=3)


@pytest.fixture(scope="module")
def page(levels: list[NDArray[np.float32]]) -> Iterator[Page]:
    data = base64.b64encode(levels[-1].astype("<f4").tobytes()).decode()
    with open_harness() as opened:
        url = f"data:application/octet-stream;base64,{data}"
        opened.evaluate("([url, levels, size]) => esker.load('same', url, levels, size)", [url, LEVELS, SIZE])
        yield opened


@pytest.fixture(scope="module")
def drawer() -> Reference:
    return Reference("plain", factor=2)


@pytest.mark.parametrize("name", list(SCENES))
def test_pictures_agree(page: Page, drawer: Reference, levels: list[NDArray[np.float32]], name: str) -> None:
    """V2."""
    change = {"rule": "plain", "detail": 0.0, "sea_level_m": None, **SCENES[name]}
    shot = {
        "world": "same",
        "levels": LEVELS,
        "width": WIDTH,
        "height": HEIGHT,
        "tau": TAU,
        "eye": EYE,
        "target": TARGET,
    }
    url = page.evaluate("shot => esker.picture(shot)", {**shot, "settings": change})
    shown = np.asarray(Image.open(io.BytesIO(base64.b64decode(url.split(",")[1]))).convert("RGB")).astype(int)
    settings = TerrainSettings(size_m=SIZE, reach_m=128, seed=1, sun_azimuth_deg=115, sun_elevation_deg=24, **change)
    site = Site(SIZE, 1, tuple(levels), {}, 0.0, "plain", settings.look, settings.sea_level_m)
    surface = Surface.of(DetailedTerrain(site), finest_level(SIZE))
    scene = Scene(settings, Camera(EYE, TARGET, WIDTH, HEIGHT, 2, 30000), TAU * RESTING)
    drawn = drawer.draw(surface, scene).pixels.astype(int)
    off = np.abs(shown - drawn)
    share = (off.max(axis=2) > 8).mean()
    print(f"{name}: mean {off.mean():.3f} of 255, {share:.2%} off by more than 8")
    # Materials take the plane of the drawn triangle, and along ridges the two have other triangles.
    assert off.mean() <= 0.4
    assert share <= 0.006
