"""A heightmap of Esker's own comes back as it was, without a question (SPEC G340)."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image, PngImagePlugin

from esker import contract as c
from esker.exporting.ground import Ground
from esker.exporting.heightmaps import write_png
from esker.importing.placement.placing import Terrain
from esker.importing.run import suggest_size
from tests.importing.conftest import look, take

SIZE_M = 2048.0
SPACING_M = 16.0


def _ground(place: c.Place | None = None, corner: tuple[float, float] = (0.0, 0.0), samples: int = 129) -> Ground:
    rows, cols = np.mgrid[0:samples, 0:samples].astype(np.float32)
    heights = (300.0 * np.sin(cols / 20.0) + 2.0 * rows - 40.0).astype(np.float32)
    heights[5:30, 5:30] = heights.min()  # flat and lowest: 0 in the picture, which is no hole
    settings = c.TerrainSettings(size_m=SIZE_M, reach_m=64.0, place=place)
    return Ground(heights=heights, settings=settings, x_m=corner[0], y_m=corner[1], spacing_m=SPACING_M)


@pytest.mark.parametrize("place", [None, c.Place(lat_deg=46.2, lon_deg=-122.19)])
@pytest.mark.parametrize("corner", [(0.0, 0.0), (256.0, 512.0)])
def test_it_comes_back_as_it_was(tmp_path: Path, place: c.Place | None, corner: tuple[float, float]) -> None:
    ground = _ground(place, corner, 129 if corner == (0.0, 0.0) else 65)
    path = tmp_path / "a.png"
    write_png(path, ground)
    report = look(path, terrain=Terrain(place, SIZE_M)).report
    assert (report.verdict, report.questions) == ("good", ())
    layer, raster = take(path, tmp_path / "raster", place=place, size_m=SIZE_M)
    assert layer.anchor == pytest.approx(corner, abs=0.02)
    assert layer.rotation_deg == pytest.approx(0.0, abs=1e-6)
    assert layer.spacing_m == pytest.approx((SPACING_M, SPACING_M), rel=1e-6)
    low, high = ground.range_m
    assert np.abs(raster.heights - ground.heights).max() <= 0.51 * (high - low) / 65535 + 1e-3


def test_as_a_terrain_of_its_own_it_has_its_own_size(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    write_png(path, _ground())
    report = look(path).report
    assert report.verdict == "good"
    assert suggest_size(report) == SIZE_M, "and not a rounder one"


def test_in_a_smaller_terrain_it_lies_in_the_middle(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    write_png(path, _ground(corner=(1024.0, 1024.0), samples=65))
    layer, _ = take(path, tmp_path / "raster", place=None, size_m=1200.0)
    assert layer.anchor == pytest.approx((88.0, 88.0))


@pytest.mark.parametrize(
    "facts",
    [
        {"low_m": 1e300},
        {"low_m": "low"},
        {"high_m": -1e6},
        {"spacing_m": 0},
        {"spacing_m": True},
        {"samples": [5, 5]},
        {"south_west_m": None},
        {"south_west_m": [1, None]},
        "no object",
        "[" * 5000,
    ],
)
def test_a_text_that_cannot_be_so_is_passed_over(tmp_path: Path, facts: Any) -> None:
    """Then it is a picture like any other: its heights and its size are asked about."""
    path, changed = tmp_path / "a.png", tmp_path / "b.png"
    write_png(path, _ground())
    with Image.open(path) as picture:
        told = json.loads(picture.info["Esker"])
        info = PngImagePlugin.PngInfo()
        info.add_itxt("Esker", json.dumps(told | facts) if isinstance(facts, dict) else facts)
        picture.save(changed, pnginfo=info)
    asked = {question.id for question in look(changed, terrain=Terrain(None, SIZE_M)).report.questions}
    assert {"range", "size"} <= asked
