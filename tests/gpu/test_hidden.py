"""Patches that nearer ground hides, found on the device by a depth pyramid (SPEC R58, R59)."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from playwright.sync_api import Page

from tests.gpu.page import open_harness


@pytest.fixture(scope="module")
def page() -> Iterator[Page]:
    with open_harness("bench") as opened:
        yield opened


@pytest.mark.parametrize(("seed", "samples"), [(1, 1), (2, 4)])
def test_both_rounds_agree_with_their_twin(page: Page, seed: int, samples: int) -> None:
    """R59: the pyramid, what is left out and what each round draws, against float64 on made-up depths."""
    report = page.evaluate("([seed, samples]) => bench.hiddenTwin(seed, samples)", [seed, samples])
    assert report["pyramid"] < 1e-6
    assert report["hidden"] > 0.05 * report["patches"]
    assert (report["lost"], report["missed"], report["misplaced"]) == (0, 0, 0)


def test_pictures_are_the_same_with_and_without(page: Page) -> None:
    """R58: low views among ridges, from the air and the map, just turned to and seen again."""
    options = {"width": 192, "height": 144, "shading": "lambert", "levels": 3, "tauPx": 0.7}
    page.evaluate("o => bench.ridges.open(o)", options)
    report = page.evaluate("() => bench.ridges.compare(5, 5)")
    assert report["differing"] == 0
    assert report["patches"] - report["drawn"] > 15, "nothing was hidden, so nothing was tested"
