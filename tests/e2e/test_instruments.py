"""The profile in real browsers: drawn with pointer events, it changes while somebody else draws (SPEC N3, N17)."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from esker.api.terrain import Terrain
from esker.grid import quantum
from tests.e2e.conftest import Server, Visitors
from tests.e2e.hands import arch, draw, on_screen, polyline, press_and_move, wait, wait_settled, wait_still

SIZE = 4096.0
PROFILE = "() => window.esker.profile()"


def test_a_profile_follows_what_somebody_else_draws(visitors: Visitors, server: Server, tmp_path: Path) -> None:
    terrain, secret = server.create(title="Section")
    link = json.loads(server.request("POST", f"/api/terrains/{terrain}/links", {"role": "edit", "name": "Ben"}, secret))
    ada, ben = visitors(1180, 760, device_scale_factor=0.5), visitors(640, 480)
    ada.open(f"/t/{terrain}#{secret}")
    ben.open(f"/t/{terrain}#{link['secret']}")
    draw(ben, "b", arch(on_screen(ben, 900, 1700), on_screen(ben, 3200, 1900), 60))
    wait_settled(ada, ben)

    # A line across the ridge, drawn in one go; the panel shows its section.
    ada.page.keyboard.press("t")  # from above nothing hides what is behind it
    wait_still(ada)
    ada.page.keyboard.press("y")
    assert "Draw a line over the land" in ada.page.locator("esk-measure .empty").inner_text()
    press_and_move(ada.page, polyline([on_screen(ada, 2000, 700), on_screen(ada, 2100, 3200)]))
    ada.page.mouse.up()
    wait(ada, "() => window.esker.profile() !== null")
    before = ada.js(PROFILE)
    assert before["lengthM"] > 1500
    ada.page.keyboard.press("o")
    wait_still(ada)
    assert before["points"] >= 2
    assert ada.page.locator("esk-measure svg.chart path.crest").get_attribute("d")
    assert len(ada.js("() => window.esker.strokes()")) == 1, "measuring draws nothing"
    ada.shot("profile")

    # Somebody else draws across it: the section rises, and the ground of before is dashed.
    draw(ben, "b", arch(on_screen(ben, 1200, 900), on_screen(ben, 3000, 1000), 90))
    wait(ada, "high => window.esker.profile().max > high + 4", before["max"])
    wait_settled(ada, ben)
    assert ada.page.locator("esk-measure svg.chart path.before").count() == 1
    ada.page.locator("esk-measure svg.chart").hover()
    ada.shot("profile-changed")

    # The figures are those of the tiles, which are an offline solve's within a step.
    with ada.page.expect_download() as saved:
        ada.page.locator("esk-measure").get_by_role("button", name="CSV").click()
    path = tmp_path / "profile.csv"
    saved.value.save_as(path)
    table = np.genfromtxt(path, delimiter=",", names=True)
    text = server.request("GET", f"/api/terrains/{terrain}/archive", secret=secret)
    (tmp_path / "a.esker").write_bytes(text)
    truth = Terrain.load(tmp_path / "a.esker").heights(4)
    s = SIZE / 1024
    x, y = table["x_m"] / s, table["y_m"] / s
    i, j = np.minimum(y.astype(int), 1023), np.minimum(x.astype(int), 1023)
    u, v = x - j, y - i
    south = truth[i, j] * (1 - u) + truth[i, j + 1] * u
    north = truth[i + 1, j] * (1 - u) + truth[i + 1, j + 1] * u
    # Where this page holds coarser tiles it has their surface: most places are near the finest.
    off = np.abs(south * (1 - v) + north * v - table["height_m"])
    assert np.median(off) <= 4 * quantum(2, SIZE)
    assert table["height_m"].max() == np.float64(table["height_m"]).max() > 50

    # An area, by its corners.
    ada.page.keyboard.press("t")
    wait_still(ada)
    ada.page.keyboard.press("Backspace")
    ada.page.locator("esk-measure").get_by_role("button", name="Begin anew").click()
    ada.page.keyboard.press("Shift+Y")
    for place in ((1400, 600), (2800, 600), (2800, 1500), (1400, 1500)):
        ada.page.mouse.click(*on_screen(ada, *place))
    wait(ada, "() => window.esker.area() !== null")
    area = ada.js("() => window.esker.area()")
    assert abs(area["areaM2"] / (1400 * 900) - 1) < 0.1
    assert area["aboveM3"] > 0
    ada.shot("area")
    ada.page.keyboard.press("Escape")
    assert ada.page.locator("esk-measure").count() == 0
