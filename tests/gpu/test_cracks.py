"""No crack pixel and no NaN, random trees and cameras, real selection and shaders (SPEC R8, R9)."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from playwright.sync_api import Page

from tests.gpu.page import open_harness


@pytest.fixture(scope="module")
def page() -> Iterator[Page]:
    with open_harness() as opened:
        yield opened


@pytest.mark.parametrize("seed", [1, 77])
def test_no_crack_shows_from_above_below_and_the_side(page: Page, seed: int) -> None:
    """R8, R9: not one pixel of the clear colour where ground must be."""
    report = page.evaluate("seed => esker.crackTest(seed, 20)", seed)
    assert report["failures"] == []
    assert report["cracks"] == 0
    assert report["nans"] == 0
    # There was something to crack: pictures full of ground, of several levels.
    assert report["covered"] > 20 * 256 * 192 * 0.7
    assert report["mixed"] >= 10


def test_without_edge_bits_cracks_do_show(page: Page) -> None:
    """The test can fail: the same views without edge bits and corner weights crack."""
    assert page.evaluate("() => esker.crackTest(1, 8, true)")["cracks"] > 0
