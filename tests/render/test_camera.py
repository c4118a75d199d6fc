"""The cameras are those of the page (frontend/test/core/camera.test.ts; SPEC I1)."""

from __future__ import annotations

import pytest

from esker.render.camera import home


def test_home_on_a_tall_picture_is_that_of_the_page() -> None:
    camera = home(4096.0, 390, 844)
    assert (*camera.eye, *camera.target) == pytest.approx((-2235, -7137, 4725.8, 2048, 2048, 1432.9), abs=0.06)
