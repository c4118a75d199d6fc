"""No crack pixel and no NaN, random trees and cameras, real selection and shaders (SPEC R8, R9, R20, R22)."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from playwright.sync_api import Page

from tests.gpu.page import open_harness


@pytest.fixture(scope="module")
def page() -> Iterator[Page]:
    with open_harness() as opened:
        yield opened


@pytest.mark.parametrize("seed", [1, 78])
def test_no_crack_shows_from_above_below_and_the_side(page: Page, seed: int) -> None:
    """R8, R9: not one pixel of the clear colour where ground must be; one in four in its look, for NaNs too."""
    report = page.evaluate("seed => esker.crackTest(seed, 24, { full: 4 })", seed)
    assert report["failures"] == []
    assert report["cracks"] == 0
    assert report["nans"] == 0
    # There was something to crack: pictures full of ground, of several levels.
    assert report["covered"] > 24 * 256 * 192 * 0.85
    assert report["mixed"] >= 14
    assert (report["full"], report["blind"]) == (6, 0)


def test_no_crack_shows_where_heights_are_drawn_larger(page: Page) -> None:
    """N25, R8, R9: heights three times as large: nothing opens, and nothing that is seen is culled."""
    report = page.evaluate("() => esker.crackTest(1, 8, { full: 8, exaggeration: 3 })")
    assert report["failures"] == []
    assert report["cracks"] == 0
    assert report["nans"] == 0
    assert report["covered"] > 8 * 256 * 192 * 0.8
    assert report["mixed"] >= 4


def test_no_crack_shows_near_the_ground_of_the_largest_terrain(page: Page) -> None:
    """R8, R20, R22, R50: metres from a ground 65 km wide, refined around the place only, tiles still entering."""
    report = page.evaluate("() => esker.deepCrackTest(5, 12, { full: 6 })")
    assert report["failures"] == []
    assert report["nans"] == 0
    assert report["covered"] > 12 * 256 * 192 * 0.75
    assert report["deepest"] > 10
    assert report["mixed"] >= 7
    assert (report["full"], report["blind"]) == (2, 0)


def test_no_crack_shows_a_metre_from_the_ground(page: Page) -> None:
    """R8, R50, R51: levels without an end, beside refined tiles that come and go."""
    report = page.evaluate("() => esker.walkCrackTest(3, 20, { full: 10 })")
    assert report["failures"] == []
    assert report["nans"] == 0
    assert report["covered"] == 20 * 256 * 192
    assert report["deepest"] >= 15
    assert report["mixed"] >= 4
    assert report["full"] == 2


@pytest.mark.parametrize(("test", "views"), [("crackTest", 3), ("deepCrackTest", 4), ("walkCrackTest", 14)])
def test_without_edge_bits_cracks_do_show(page: Page, test: str, views: int) -> None:
    """Each of the tests can fail: the same views without edge bits and corner weights crack."""
    call = f"views => esker.{test}(1001, views, {{ spoil: true }})"
    assert page.evaluate(call, views)["cracks"] > 0
