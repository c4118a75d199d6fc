"""What lies on the ground and on the sea, seen in small pictures on the software adapter (SPEC R60, R63)."""

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

from tests.gpu.page import open_harness

SMALL = {"levels": 1, "width": 160, "height": 120, "tau": 4}
MEADOW = {**SMALL, "world": "flat", "eye": [2048, 1200, 500], "target": [2048, 2048, 0]}


@pytest.fixture(scope="module")
def page() -> Iterator[Page]:
    with open_harness() as opened:
        yield opened


def picture(page: Page, shot: dict[str, Any]) -> NDArray[np.int64]:
    data = page.evaluate("shot => esker.picture(shot)", shot)
    image = Image.open(io.BytesIO(base64.b64decode(data.split(",")[1]))).convert("RGB")
    return np.asarray(image).astype(np.int64)


def test_painted_channels_show(page: Page) -> None:
    """R63: paint turns meadow into snow (bright, no colour), woods (darker) and bare ground (less green)."""
    middle = np.s_[40:110, 30:130]
    plain = picture(page, MEADOW)[middle].mean(axis=(0, 1))
    snow = picture(page, {**MEADOW, "paint": {"snow": 1}})[middle].mean(axis=(0, 1))
    woods = picture(page, {**MEADOW, "paint": {"forest": 1}})[middle].mean(axis=(0, 1))
    bare = picture(page, {**MEADOW, "paint": {"grass": -1, "forest": -1}})[middle].mean(axis=(0, 1))
    assert snow.min() > plain.max() + 40
    assert np.ptp(snow) < 40
    assert woods.sum() < 0.85 * plain.sum()
    assert bare[1] - bare[0] < plain[1] - plain[0] - 5


def test_the_seas_meet_without_a_step(page: Page) -> None:
    """R63: straight down on the domain's border under 40 m of water, the strips on both sides look alike."""
    shot = {
        **SMALL,
        "world": "flat",
        "eye": [0, 0, 0],
        "target": [0, 2048, 0],
        "map": 600,
        "settings": {"sea_level_m": 40},
    }
    seen = picture(page, shot)
    inside, outside = seen[:, 82:96].mean(axis=(0, 1)), seen[:, 64:78].mean(axis=(0, 1))
    assert np.abs(inside - outside).max() < 3
    assert np.abs(seen[:, 81].mean(axis=0) - seen[:, 78].mean(axis=0)).max() < 3


def test_index_contours_are_labelled(page: Page) -> None:
    """R60: with the overlay letters show, bright halos round dark ink, not there without it."""
    shot = {
        **SMALL,
        "width": 480,
        "height": 320,
        "world": "smooth",
        "eye": [2048, -900, 1500],
        "target": [2048, 2200, 150],
    }
    plain, lines = picture(page, shot), picture(page, {**shot, "overlay": "contours"})
    halo = (lines.min(axis=2) > plain.min(axis=2) + 60) & (lines.min(axis=2) > 170)
    assert halo.sum() > 60
