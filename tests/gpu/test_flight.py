"""A flight on the device: memory stays bounded, a picture at rest is still (SPEC R49, R56)."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from playwright.sync_api import Page

from tests.gpu.page import open_harness


@pytest.fixture(scope="module")
def page() -> Iterator[Page]:
    with open_harness("bench") as opened:
        yield opened


def test_memory_of_the_device_stays_bounded(page: Page) -> None:
    """R49: after the first frames a flight whose detail is made on the way holds no more than before."""
    path = page.evaluate("() => bench.flight({ frames: 10, seconds: 0, moments: 6, stepM: 40 })")
    assert sum(moment["uploads"] for moment in path[1:]) > 10, "tiles were made on the way"
    assert min(moment["patches"] for moment in path[2:]) > 50
    held = [moment["deviceBytes"] / 2**20 for moment in path]
    assert 10 < held[2] < 400
    # Records of a larger cut may take a little more.
    assert held[-1] - held[2] < 1


def test_a_picture_at_rest_is_still(page: Page) -> None:
    """R56: once settled, consecutive frames do not differ in a single pixel."""
    page.evaluate("() => bench.hills()")
    still = page.evaluate("() => bench.flicker(3)")
    assert still == {"differing": 0, "largest": 0}
