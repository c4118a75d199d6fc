"""Water in two real browsers: a valley, its river, a dam, the lake behind it, a road, rain (SPEC W54)."""

from __future__ import annotations

import json

from tests.e2e.conftest import Server, Visitors
from tests.e2e.hands import arch, draw, on_screen, polyline, press_and_move, wait, wait_settled, wait_still

WATER = "() => window.esker.water()"
# A river that runs a long way down the middle of the valley.
RIVER = """([west, east, south]) => {
  const found = window.esker.rivers();
  if (!found?.settled || found.clock !== window.esker.clock()) return false;
  const inside = found.lines.flat().filter(([x, y]) => x > west && x < east && y > 300);
  return inside.length > 3 && Math.min(...inside.map(([, y]) => y)) < south;
}"""


def test_a_valley_is_drawn_dammed_crossed_by_a_road_and_rained_on(visitors: Visitors, server: Server) -> None:
    terrain, secret = server.create(title="Water")
    link = json.loads(server.request("POST", f"/api/terrains/{terrain}/links", {"role": "edit", "name": "Ben"}, secret))
    ada, ben = visitors(1000, 700), visitors(640, 480)
    ada.open(f"/t/{terrain}#{secret}")
    ben.open(f"/t/{terrain}#{link['secret']}")

    # Ada draws a horseshoe of mountains that is open to the south: both see a river in it.
    draw(ada, "b", arch(on_screen(ada, 1000, 3300), on_screen(ada, 3000, 3300), 130))
    draw(ada, "b", arch(on_screen(ada, 700, 900), on_screen(ada, 1000, 3400), 120))
    draw(ada, "b", arch(on_screen(ada, 3300, 900), on_screen(ada, 3000, 3400), 120))
    wait_settled(ada, ben)
    for visitor in (ada, ben):
        wait(visitor, RIVER, [1100, 2900, 1400], timeout=90)

    # Ben dams it. A drop that falls behind the dam meets a lake, and leaves over its brim to the border.
    draw(ben, "b", arch(on_screen(ben, 600, 1300), on_screen(ben, 3400, 1300), 45))
    wait_settled(ada, ben)
    ada.page.keyboard.press("t")
    wait_still(ada)
    ada.page.keyboard.press("z")
    wait_still(ada)  # home makes room for the panel
    ada.page.mouse.click(*on_screen(ada, 2000, 1700))
    wait(ada, "() => window.esker.water()?.way?.lakes > 0 && window.esker.water().depthM > 2")
    drop = ada.js(WATER)
    assert drop["way"]["ends"] == "border"
    assert drop["way"]["lengthM"] > 1000
    assert drop["shedM2"] > 1e5
    assert drop["peak"] > 0
    panel = ada.page.locator("esk-water")
    assert panel.locator("svg.chart path.before").count() == 1, "the section shows where water stands"
    wait(ben, RIVER, [300, 3800, 1200], timeout=90)

    # A flood that is smaller than the lake: none of it runs off, and it stands lower.
    panel.get_by_text("Flood", exact=True).first.click()
    wait(ada, "() => window.esker.water().flood !== null")
    flood = ada.js(WATER)["flood"]
    assert flood["volumeM3"] > 0
    assert flood["runsOffM3"] >= 0

    # Rain: drops run, the gauge tells.
    panel.get_by_text("Rain", exact=True).first.click()
    wait(ada, "() => window.esker.water().drops > 100")
    assert ada.js(WATER)["peak"] > 0
    panel.get_by_role("button", name="Put the water away").click()
    wait(ada, "() => window.esker.water() === null")
    assert panel.count() == 0

    # A road along the valley, with what it cuts and fills.
    ada.page.keyboard.press("j")
    ada.page.keyboard.press("i")
    ada.page.locator("esk-course-form").get_by_text("Road", exact=True).first.click()
    wait_still(ada)
    path = polyline([on_screen(ada, 1500, 2000), on_screen(ada, 2500, 2600)])
    press_and_move(ada.page, path)
    ada.page.mouse.up()
    wait(ben, "() => window.esker.strokes().some((s) => s.course?.use === 'road')")
    wait_settled(ada, ben)
    ada.page.keyboard.press("v")
    facts = ada.page.locator("esk-course-form dl")
    assert "Cut" in facts.inner_text()
    assert "m³" in facts.inner_text()
    assert ada.errors == ben.errors == []
