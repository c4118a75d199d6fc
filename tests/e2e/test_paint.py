"""Two people paint one terrain with real pointer events, live, and take it back (SPEC U23..U25)."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from esker.api.terrain import Terrain
from tests.e2e.conftest import Server, Visitor, Visitors
from tests.e2e.hands import (
    COARSE,
    arch,
    draw,
    heights,
    on_screen,
    polyline,
    press_and_move,
    wait,
    wait_settled,
    wait_still,
    wait_whole,
)

CHANNEL = "([name, x, y]) => window.esker.channelAt(name, x, y)"


def channel(visitor: Visitor, name: str, x: float, y: float) -> float:
    """What strokes ask of a channel at a place, as the page has it."""
    return float(visitor.js(CHANNEL, [name, x, y]))


def middle(stroke: dict[str, Any]) -> tuple[float, float]:
    """The middle point of a line of paint. (What is straight on the screen bends over a hill.)"""
    (x0, y0, _), (x1, y1, _), (u, v) = stroke["first"], stroke["last"], stroke["curve"][len(stroke["curve"]) // 2]
    return x0 + u * (x1 - x0) - v * (y1 - y0), y0 + u * (y1 - y0) + v * (x1 - x0)


def two_people(visitors: Visitors, server: Server) -> tuple[Visitor, Visitor, str, str]:
    """Ada owns the terrain, Ben has an edit link and the map."""
    terrain, secret = server.create(title="Painted")
    link = json.loads(server.request("POST", f"/api/terrains/{terrain}/links", {"role": "edit", "name": "Ben"}, secret))
    ada, ben = visitors(), visitors(on_map=True)
    ada.open(f"/t/{terrain}#{secret}")
    ben.open(f"/t/{terrain}#{link['secret']}")
    return ada, ben, terrain, secret


def test_paint_reaches_everybody_live_and_touches_no_height(visitors: Visitors, server: Server, tmp_path: Path) -> None:
    ada, ben, terrain, secret = two_people(visitors, server)
    draw(ada, "b", arch(on_screen(ada, 900, 2300), on_screen(ada, 3100, 2500), 110))
    wait_settled(ada, ben)
    wait_whole(ben)
    ground = heights(ben, COARSE)
    assert max(ground) > 60

    # Ada brushes snow over the foot of the mountain: Ben has it while her pointer is still down.
    ada.page.keyboard.press("k")
    wait(ada, "() => window.esker.tool() === 'paint'")
    start, end = on_screen(ada, 1200, 1400), on_screen(ada, 2600, 1400)
    press_and_move(ada.page, polyline([start, end], 16))
    wait(ben, f"a => ({CHANNEL})(a) > 0.3", ["snow", 1300, 1400])
    assert not ada.js("() => window.esker.strokes()[1].finished")
    ada.shot("paint-1-brushing-ada")
    ada.page.mouse.up()

    # At the same time Ben takes forest away with Alt, elsewhere.
    ben.page.keyboard.press("k")
    ben.page.keyboard.press("u")
    ben.page.keyboard.down("Alt")
    press_and_move(ben.page, polyline([on_screen(ben, 3000, 900), on_screen(ben, 3700, 1500)], 12))
    ben.page.mouse.up()
    ben.page.keyboard.up("Alt")
    wait(ben, "() => window.esker.strokes().length === 3 && window.esker.pending() === 0")
    wait_settled(ada, ben)
    made = {s["paint"]["channel"]: s for s in ada.js("() => window.esker.strokes()") if s["paint"]}
    assert {name: s["paint"]["value"] for name, s in made.items()} == {"snow": 0.8, "forest": -0.8}
    snow, forest = middle(made["snow"]), middle(made["forest"])
    for person in (ada, ben):
        wait(person, f"a => Math.abs(({CHANNEL})(a)) > 0.3", ["forest", *forest])
        assert channel(person, "snow", *snow) > 0.3
        assert abs(channel(person, "snow", 3900, 3900)) < 0.05
        assert channel(person, "forest", *forest) < -0.3
    wait_whole(ben)
    assert heights(ben, COARSE) == ground
    assert ada.js("([x, y]) => window.esker.attributesAt(x, y).snow", list(snow)) > 0.5
    ben.shot("paint-2-painted-ben")

    # A copy of the terrain carries the paint.
    archive = tmp_path / "now.esker"
    archive.write_bytes(server.request("GET", f"/api/terrains/{terrain}/archive", secret=secret))
    kinds = [s.kind for s in Terrain.load(archive).document.strokes]
    assert kinds == ["profile", "paint", "paint"]

    # Ada undoes her snow; Ben's clearing stays.
    ada.page.keyboard.press("Control+z")
    wait(ada, "() => window.esker.strokes().length === 2 && window.esker.pending() === 0")
    wait_settled(ada, ben)
    for person in (ada, ben):
        wait(person, f"a => Math.abs(({CHANNEL})(a)) < 0.02", ["snow", *snow])
        assert channel(person, "forest", *forest) < -0.3
    ben.shot("paint-3-undone-ben")
    for person in (ada, ben):
        assert person.foreign == []
        assert person.errors == []


def test_paint_is_a_stroke_that_can_be_taken_in_hand(visitors: Visitors, server: Server) -> None:
    terrain, secret = server.create(title="In hand")
    ada = visitors(width=1000, height=640)
    ada.open(f"/t/{terrain}#{secret}")
    ada.page.keyboard.press("k")
    ada.page.keyboard.press("i")
    wait_still(ada)
    press_and_move(ada.page, polyline([on_screen(ada, 1000, 1500), on_screen(ada, 2300, 1500)], 12))
    ada.page.mouse.up()
    wait(ada, "() => window.esker.strokes().length === 1 && window.esker.pending() === 0")
    paint = ada.js("() => window.esker.strokes()[0].paint")

    # Keys change the brush, not what lies there; a click on the line takes it, then they change that.
    wait_still(ada)
    ada.page.keyboard.press("]")
    assert ada.js("() => window.esker.strokes()[0].paint") == paint
    ada.page.mouse.click(*on_screen(ada, 1700, 1500))
    wait(ada, "() => window.esker.selection() === window.esker.strokes()[0].id")
    ada.page.keyboard.press("[")
    wait(ada, "r => window.esker.strokes()[0].paint.radius_m < r && window.esker.pending() === 0", paint["radius_m"])
    ada.page.keyboard.press("Control+z")
    wait(ada, "r => window.esker.strokes()[0].paint.radius_m === r", paint["radius_m"])

    # The inspector: meadow instead of snow, taken away.
    panel = ada.page.locator("esk-paint-form")
    panel.get_by_role("radio", name="Meadow").click()
    panel.get_by_role("radio", name="Remove").click()
    wait(ada, "() => window.esker.strokes()[0].paint.channel === 'grass' && window.esker.strokes()[0].paint.value < 0")
    ada.shot("paint-4-inspector")

    # A click beside all lines is a dab; its overlay shows on the ground.
    ada.page.keyboard.press("Escape")
    wait_still(ada)
    ada.page.mouse.click(*on_screen(ada, 2600, 2600))
    wait(ada, "() => window.esker.strokes().length === 2 && window.esker.pending() === 0")
    wait_settled(ada)
    wait(ada, f"a => ({CHANNEL})(a) < -0.1", ["grass", 1700, 1500])

    # Rule and strength of the detail are settings that everybody shares.
    def spread() -> float:
        rows = ada.js("() => Array.from({length: 40}, (_, k) => window.esker.shownAt(1500 + 10 * k, 2000, 2))")
        return float(max(rows) - min(rows))

    assert spread() > 0.01
    ada.page.get_by_role("radio", name="Terrain").click()
    ada.page.get_by_role("radio", name="Plain").click()
    wait(ada, "() => window.esker.pending() === 0")
    assert spread() < 1e-6
    ada.shot("paint-5-plain")
    assert ada.errors == []
