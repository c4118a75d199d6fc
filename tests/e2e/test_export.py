"""A heightmap leaves the page, and is the ground (SPEC X32)."""

from __future__ import annotations

import io
import json
import os
import zipfile

import numpy as np
from PIL import Image

from esker import Terrain
from esker.document import archive
from tests.e2e.conftest import Server, Visitors


def test_a_heightmap_is_saved_from_the_page(visitors: Visitors, server: Server) -> None:
    terrain, secret = server.create(template="figure-six")
    someone = visitors(390, 640, on_map=True)
    someone.open(f"/t/{terrain}#{secret}")
    page = someone.page
    page.keyboard.press("Shift+E")
    dialog = page.locator("esk-export")
    dialog.get_by_label("Samples a side").select_option("257")
    dialog.get_by_text("With the fine detail").click()
    dialog.get_by_text("About").wait_for()
    with page.expect_download() as coming:
        dialog.get_by_role("button", name="Export", exact=True).press("Enter")
    dialog.get_by_text("Unreal: scale").wait_for()
    assert coming.value.suggested_filename == "figure-six-257.png"
    with Image.open(coming.value.path()) as picture:
        steps, told = np.asarray(picture), json.loads(picture.info["Esker"])
    document = archive.loads(server.request("GET", f"/api/terrains/{terrain}/archive", secret=secret))
    heights = Terrain.from_document(document).heights(2)
    low, high = float(heights.min()), float(heights.max())
    assert (told["low_m"], told["high_m"]) == (low, high)
    off = np.abs(low + steps[::-1].astype(np.float64) * ((high - low) / 65535) - heights).max()
    assert off <= 0.5001 * (high - low) / 65535
    page.keyboard.press("Escape")
    assert someone.errors == []


def test_masks_that_sum_to_one_are_saved_from_the_page(visitors: Visitors, server: Server) -> None:
    """SPEC X380: the switch stands with masks alone, and the file holds what it says."""
    terrain, secret = server.create(template="figure-six")
    someone = visitors(640, 720, on_map=True)
    someone.open(f"/t/{terrain}#{secret}")
    page = someone.page
    page.keyboard.press("Shift+E")
    dialog = page.locator("esk-export")
    dialog.get_by_label("Samples a side").select_option("257")
    assert dialog.get_by_text("They sum to one").count() == 0
    dialog.locator("label.card", has_text="Masks").click()
    dialog.get_by_text("They sum to one").click()
    dialog.get_by_text("About").wait_for()
    if shots := os.environ.get("ESKER_SHOTS"):
        page.screenshot(path=f"{shots}/masks.png")
    with page.expect_download() as coming:
        dialog.get_by_role("button", name="Export", exact=True).press("Enter")
    with zipfile.ZipFile(coming.value.path()) as archive:
        names = [name for name in archive.namelist() if name.endswith(".png")]
        masks = [np.asarray(Image.open(io.BytesIO(archive.read(name)))).astype(int) for name in names]
    assert "ground.png" in names
    np.testing.assert_array_equal(np.sum(masks, axis=0), 255)
    assert someone.errors == []
