"""The border round the picture in which triangles are not cut (SPEC R70), on the software adapter that needs it.

Two pairs of triangles that the crack test found (crackTest(1010, 110) view 109, crackTest(3012, 74) view 73), clip
positions as the vertex shader gave them. Each pair covers one pixel at the picture's border together. SwiftShader
leaves it out: of the second triangle's whole, snapped to 1/16 pixel, the area is 0 or below, of what the border leaves
of it above.
"""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from playwright.sync_api import Page

from tests.gpu.page import open_harness

WEST = (
    (-1605.52563, 1076.73584, 0.947937727, 1562.8175),
    (-1566.18152, 1015.56519, 0.94975847, 1508.19702),
    (-1496.52686, 1096.72644, 0.94726783, 1582.91321),
    (-1496.52686, 1096.72644, 0.94726783, 1582.91321),
    (-1566.18152, 1015.56519, 0.94975847, 1508.19702),
    (-1457.18274, 1053.02466, 0.949194431, 1525.11719),
)
EAST = (
    (1552.06665, 479.301361, 0.948196292, 1555.06128),
    (1528.54126, 457.218323, 0.948435605, 1547.88159),
    (1548.75745, 459.828735, 0.94850862, 1545.69128),
    (1548.75745, 459.828735, 0.94850862, 1545.69128),
    (1528.54126, 457.218323, 0.948435605, 1547.88159),
    (1536.99475, 457.28064, 0.948660374, 1541.13977),
)


@pytest.fixture(scope="module")
def page() -> Iterator[Page]:
    with open_harness() as opened:
        yield opened


@pytest.mark.parametrize(("corners", "pixel"), [(WEST, [0, 30]), (EAST, [255, 67])])
def test_what_leaves_the_view_is_drawn_to_its_border(
    page: Page, corners: tuple[tuple[float, ...], ...], pixel: list[int]
) -> None:
    """R70. Without the border the same triangles leave the pixel out, so this can fail."""
    flat = [value for corner in corners for value in corner]
    filled, cut = (page.evaluate("([c, wide]) => esker.guardTest(c, wide)", [flat, wide]) for wide in (True, False))
    assert pixel in filled
    assert pixel not in cut
    # Nothing else moves by more than the adapter's grain.
    assert len({(x, y) for x, y in filled} ^ {(x, y) for x, y in cut}) <= 2
