"""One picture per look, and the map, compared with committed ones on the software adapter (SPEC R14, R16).

Differences allowed: the mean by which two runs on different processors may differ; a changed material, light or
camera moves far more pixels. After a wanted change: ESKER_GOLDEN=1 pytest tests/golden, look at the pictures, commit.
"""

from __future__ import annotations

import base64
import io
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from playwright.sync_api import Page

from tests.gpu.page import open_harness

HERE = Path(__file__).resolve().parent
ARTIFACTS = HERE.parent / "artifacts" / "golden"
VIEW = {"world": "rough", "levels": 3, "width": 480, "height": 320, "tau": 2}
SHOTS: dict[str, dict[str, Any]] = {
    "natural": {**VIEW, "eye": [3300, -200, 700], "target": [2000, 2400, 250]},
    "alpine": {**VIEW, "eye": [3900, 600, 700], "target": [1900, 2500, 250], "settings": {"look": "alpine"}},
    "desert": {**VIEW, "eye": [300, 600, 500], "target": [1900, 2500, 250], "settings": {"look": "desert"}},
    "paper": {**VIEW, "eye": [2048, -900, 1500], "target": [2048, 2200, 150], "settings": {"look": "paper"}},
    "island": {
        **VIEW,
        "world": "island",
        "eye": [2048, -900, 700],
        "target": [2048, 2048, 50],
        "settings": {"sea_level_m": 0},
    },
    "lake": {
        **VIEW,
        "world": "crater",
        "width": 320,
        "height": 200,
        "eye": [2200, 1100, 900],
        "target": [2048, 2080, 420],
        "settings": {"lakes_m": 4},
    },
    "strokes": {**VIEW, "world": "smooth", "eye": [2048, -600, 900], "target": [2048, 2000, 150], "strokes": True},
    "rich": {**VIEW, "rich": True, "width": 192, "height": 120, "eye": [3300, -200, 700], "target": [2000, 2400, 250]},
    "map": {**VIEW, "eye": [0, 0, 0], "target": [2048, 2048, 0], "map": 4600, "print": True, "strokes": True},
}


@pytest.fixture(scope="module")
def page() -> Iterator[Page]:
    with open_harness() as opened:
        yield opened


def _pixels(data_url: str) -> NDArray[np.int64]:
    data = base64.b64decode(data_url.split(",")[1])
    return np.asarray(Image.open(io.BytesIO(data)).convert("RGB")).astype(np.int64)


def test_sky_and_ground_take_a_look_together(page: Page) -> None:
    """R14: the sky waits for the ground, whose shader takes seconds to make (it is not made yet: this comes first)."""
    shot = {**SHOTS["natural"], "width": 160, "height": 100}
    sky = np.s_[:20]
    before = _pixels(page.evaluate("shot => esker.picture(shot)", shot))[sky]
    first = _pixels(page.evaluate("shot => esker.firstIn(shot, 'desert')", shot))[sky]
    after = _pixels(page.evaluate("shot => esker.picture(shot)", {**shot, "settings": {"look": "desert"}}))[sky]
    assert np.abs(first - before).mean() < 1  # the first picture after a change may be coarser
    assert np.abs(after - before).mean() > 2


@pytest.mark.parametrize("name", list(SHOTS))
def test_look(page: Page, name: str) -> None:
    """R14 (R16 for the map): mean difference below 2/255, fewer than 2 % of the pixels off by more than 24/255."""
    shot = page.evaluate("shot => esker.picture(shot)", SHOTS[name])
    data = base64.b64decode(shot.split(",")[1])
    ARTIFACTS.mkdir(parents=True, exist_ok=True)
    (ARTIFACTS / f"{name}.png").write_bytes(data)
    golden = HERE / f"{name}.png"
    if os.environ.get("ESKER_GOLDEN") == "1":
        golden.write_bytes(data)
    got = np.asarray(Image.open(io.BytesIO(data)).convert("RGB")).astype(int)
    want = np.asarray(Image.open(golden).convert("RGB")).astype(int)
    assert got.shape == want.shape
    off = np.abs(got - want)
    assert off.mean() < 2.0
    assert (off.max(axis=2) > 24).mean() < 0.02
