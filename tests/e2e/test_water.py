"""Water in two real browsers: a valley, its river, a dam, the lake behind it, a road, rain (SPEC W54)."""

from __future__ import annotations

import json

from tests.e2e.conftest import Server, Visitor, Visitors
from tests.e2e.hands import arch, draw, on_screen, polyline, press_and_move, wait, wait_settled, wait_still

WATER = "() => window.esker.water()"
# A river that runs a long way down the middle of the valley.
RIVER = """([west, east, south]) => {
  const found = window.esker.rivers();
  if (!found?.settled || found.clock !== window.esker.clock()) return false;
  const inside = found.lines.flat().filter(([x, y]) => x > west && x < east && y > 300);
  return inside.length > 3 && Math.min(...inside.map(([, y]) => y)) < south;
}"""
# Where the valley is lowest behind the dam.
LOWEST = """() => {
  let lowest = [0, 0, Infinity];
  for (let x = 1300; x <= 2700; x += 50)
    for (let y = 1600; y <= 2800; y += 50) {
      const z = window.esker.heightAt(x, y);
      if (z < lowest[2]) lowest = [x, y, z];
    }
  return lowest;
}"""
VALLEY = [1100, 2900, 1400]
BELOW_THE_DAM = [300, 3800, 1200]


def test_a_valley_is_drawn_dammed_rained_on_and_crossed_by_a_road(visitors: Visitors, server: Server) -> None:
    terrain, secret = server.create(title="Water")
    link = json.loads(server.request("POST", f"/api/terrains/{terrain}/links", {"role": "edit", "name": "Ben"}, secret))
    ada, ben = visitors(1000, 700), visitors(640, 480)
    ada.open(f"/t/{terrain}#{secret}")
    ben.open(f"/t/{terrain}#{link['secret']}")

    # Ada draws a horseshoe of mountains that is open to the south: both see a river in it.
    draw(ada, "b", arch(on_screen(ada, 400, 3200), on_screen(ada, 3600, 3200), 130, steps=12))
    draw(ada, "b", arch(on_screen(ada, 700, 600), on_screen(ada, 900, 3900), 120, steps=12))
    draw(ada, "b", arch(on_screen(ada, 3400, 600), on_screen(ada, 3200, 3900), 120, steps=12))
    for visitor in (ada, ben):
        wait(visitor, RIVER, VALLEY)

    # Ben dams it. The river leaves over the brim, for both.
    draw(ben, "b", arch(on_screen(ben, 600, 1300), on_screen(ben, 3400, 1300), 45, steps=12))
    for visitor in (ada, ben):
        wait(visitor, RIVER, BELOW_THE_DAM)
    lake_and_rain(ada)
    road(ada, ben)
    assert ada.errors == ben.errors == []


def lake_and_rain(ada: Visitor) -> None:
    """Ada lets a drop fall behind the dam, pours water out there, and lets it rain."""
    ada.page.keyboard.press("t")
    wait_still(ada)
    ada.page.keyboard.press("z")
    wait_still(ada)
    ada.page.mouse.click(*on_screen(ada, *ada.js(LOWEST)))
    wait(ada, "() => window.esker.water()?.way?.lakes > 0 && window.esker.water().depthM > 2")
    drop = ada.js(WATER)
    assert drop["way"]["ends"] == "border", "it leaves the lake over the brim"
    assert drop["way"]["lengthM"] > 1000
    assert drop["shedM2"] > 0
    assert drop["peak"] > 0
    panel = ada.page.locator("esk-water")
    assert panel.locator("svg.chart path.before").count() == 1, "the section shows where water stands"

    panel.get_by_text("Flood", exact=True).first.click()
    wait(ada, "() => window.esker.water().flood !== null")
    flood = ada.js(WATER)["flood"]
    assert flood["volumeM3"] > 0
    assert flood["runsOffM3"] >= 0

    panel.get_by_text("Rain", exact=True).first.click()
    wait(ada, "() => window.esker.water().drops > 20")
    assert ada.js(WATER)["peak"] > 0
    panel.get_by_role("button", name="Put the water away").click()
    wait(ada, "() => window.esker.water() === null")


def road(ada: Visitor, ben: Visitor) -> None:
    """Ada lays a road along the valley's side: both have it, and she reads what it cuts and fills."""
    ada.page.keyboard.press("Escape")
    ada.page.keyboard.press("Escape")
    wait(ada, "() => window.esker.selection() === null")
    ada.page.keyboard.press("j")
    ada.page.keyboard.press("i")
    ada.page.get_by_role("radio", name="Stroke", exact=True).click()
    ada.page.get_by_role("radio", name="Road", exact=True).click()
    wait_still(ada)
    press_and_move(ada.page, polyline([on_screen(ada, 1500, 2000), on_screen(ada, 2500, 2600)]))
    ada.page.mouse.up()
    wait(ben, "() => window.esker.strokes().some((s) => s.course?.use === 'road')")
    wait_settled(ada, ben)
    ada.page.keyboard.press("v")
    facts = ada.page.locator("esk-course-form dl")
    facts.wait_for()
    words = facts.inner_text()
    assert "Cut" in words
    assert "m³" in words
