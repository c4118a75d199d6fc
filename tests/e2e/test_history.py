"""The history with two people: the list, the terrain as it was, a time lapse, a copy (SPEC HI15 to HI19)."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from esker import contract as c
from esker.api.terrain import Terrain
from esker.grid import quantum, spacing
from tests.e2e.conftest import LEVEL, Server, Visitor, Visitors
from tests.e2e.hands import (
    COARSE,
    arch,
    draw,
    ellipse,
    heights,
    levels,
    on_screen,
    wait,
    wait_settled,
    wait_still,
    wait_whole,
)

SIZE = 4096.0
HISTORY = "() => window.esker.history()"


def as_it_was(visitor: Visitor, server: Server, terrain: str, secret: str, clock: int) -> None:
    """The page shows the ground of that clock: that of an offline solve, within a quantisation step."""
    wait(visitor, "c => window.esker.historyClock() === c && window.esker.settled()", clock, timeout=90)
    text = server.request("GET", f"/api/terrains/{terrain}/document?at={clock}", secret=secret)
    document = c.Document.model_validate_json(text)
    assert {s["id"] for s in visitor.js("() => window.esker.strokes()")} == {s.id for s in document.strokes}
    truth, s = Terrain.from_document(document).heights(level=LEVEL), spacing(LEVEL, SIZE)
    places = COARSE[::7]
    for (x, y), height, level in zip(places, heights(visitor, places), levels(visitor, places), strict=True):
        assert abs(height - truth[round(y / s), round(x / s)]) <= quantum(level, SIZE) + 1e-4


def entry(visitor: Visitor, text: str) -> Any:
    return visitor.page.locator("esk-history-panel .item").filter(has_text=text).first


def test_two_people_look_back(visitors: Visitors, server: Server, tmp_path: Path) -> None:
    terrain, secret = server.create(title="Looking back")
    link = json.loads(server.request("POST", f"/api/terrains/{terrain}/links", {"role": "edit", "name": "Ben"}, secret))
    ada, ben = visitors(820, 520), visitors(420, 320, on_map=True)
    ada.open(f"/t/{terrain}#{secret}")
    ben.open(f"/t/{terrain}#{link['secret']}")
    ada.page.keyboard.press("Shift+H")
    assert "Nothing has happened here yet" in ada.page.locator("esk-history-panel .empty").inner_text()
    wait_still(ada)  # the view makes room for the panel

    first = draw(ada, "b", arch(on_screen(ada, 900, 900), on_screen(ada, 2300, 1000), 90))
    drawn = ada.js("() => window.esker.clock()")
    wait_settled(ada, ben)  # what Ada drew hides none of the place any more
    draw(ben, "p", ellipse(on_screen(ben, 3000, 2600), 36, 9))
    wait(ada, "() => window.esker.history().length === 2")
    says = ada.js(HISTORY)
    assert [line.endswith(what) for line, what in zip(says, ("drew a plateau", "drew a mountain"), strict=True)]
    wait_settled(ada, ben)
    wait_whole(ben)
    now, clock = heights(ben, COARSE), ben.js("() => window.esker.clock()")
    ada.shot("history-list")

    entry(ada, "drew a mountain").click()
    as_it_was(ada, server, terrain, secret, drawn)
    ada.shot("history-as-it-was")
    assert heights(ben, COARSE) == now
    ada.page.keyboard.press("b")
    ada.page.mouse.move(300, 390)
    ada.page.mouse.down()
    ada.page.mouse.move(400, 360, steps=4)
    ada.page.mouse.up()
    assert len(ada.js("() => window.esker.strokes()")) == 1
    assert ben.js("() => window.esker.clock()") == clock

    draw(ben, "b", arch(on_screen(ben, 2600, 500), on_screen(ben, 3600, 600), 20))
    wait(ada, "() => window.esker.history().length === 3")
    assert ada.js("() => window.esker.historyClock()") == drawn
    ada.page.get_by_role("button", name="Back to now").first.click()
    wait(ada, "() => window.esker.historyClock() === null && window.esker.strokes().length === 3")
    wait_settled(ada)

    ada.page.get_by_role("button", name="Watch it come to be").click()
    wait(ada, "() => window.esker.historyClock() !== null && window.esker.strokes().length === 1")
    ada.shot("history-lapse")
    wait(ada, "() => window.esker.historyClock() === window.esker.clock()")
    ada.page.keyboard.press("Escape")
    wait(ada, "() => window.esker.historyClock() === null")

    ada.page.locator("esk-history-panel .item").last.click()
    wait(ada, "c => window.esker.historyClock() === c", drawn)
    ada.page.get_by_role("button", name="Make a copy").click()
    wait(ada, "t => !location.pathname.endsWith(t) && window.esker?.ready()", terrain, timeout=90)
    assert [s["id"] for s in ada.js("() => window.esker.strokes()")] == [first]
    assert ada.js("() => window.esker.title()") == "Copy of Looking back"
    assert len(ben.js("() => window.esker.strokes()")) == 3
    for person in (ada, ben):
        assert person.errors == []
