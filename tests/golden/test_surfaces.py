"""What lies on the ground and on the sea, seen in small pictures on the software adapter (SPEC R60, R63)."""

from __future__ import annotations

import base64
import io
import re
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from playwright.sync_api import Page, Route

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


def test_the_seas_meet_without_a_gap(page: Page) -> None:
    """R63: no pixel of the bed or of the sky between them. That they overlap is not seen, so that more of it is the
    same: where they only touch, 18 pixels of this view show what lies behind, by 140 of 255."""
    shot = {
        "world": "island",
        "levels": 1,
        "width": 480,
        "height": 270,
        "tau": 2,
        "eye": [1900, -150, 60],
        "target": [2300, 600, 0],
        "settings": {"sea_level_m": 0},
    }
    shown = picture(page, shot)
    page.route("**/water.wgsl*", overlapping)
    try:
        again(page)
        off = np.abs(picture(page, shot) - shown).max(axis=2)
    finally:
        page.unroute_all()
        again(page)
    assert (off > 40).sum() == 0


def again(page: Page) -> None:
    page.reload()
    page.wait_for_function("globalThis.esker !== undefined", timeout=60_000)


def overlapping(route: Route) -> None:
    """Answers with a shader whose open sea reaches ten times as far into the domain."""
    answer = route.fetch()
    lap = re.compile(r"let lap = [\d.]+;")
    assert lap.search(answer.text())
    route.fulfill(response=answer, body=lap.sub("let lap = 0.01;", answer.text()))


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
