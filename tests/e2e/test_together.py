"""Two people on one terrain, with real pointer events, a killed server and pictures of every step (SPEC E1..E4)."""

from __future__ import annotations

import io
import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from esker.api.terrain import Terrain
from esker.contract import DEFAULT_LEVEL
from esker.grid import quantum, spacing
from tests.e2e.conftest import LEVEL, Server, Visitor, Visitors, serving
from tests.e2e.hands import (
    COARSE,
    arch,
    draw,
    ellipse,
    heights,
    levels,
    on_screen,
    polyline,
    press_and_move,
    wait,
    wait_settled,
    wait_whole,
)

SIZE = 4096.0


@pytest.fixture
def server(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Server]:
    """A server that may be killed, and solves all that the product's does unless a test asks for another level."""
    yield from serving(tmp_path, getattr(request, "param", DEFAULT_LEVEL))


def two_people(visitors: Visitors, server: Server, watched_on_map: bool = False) -> tuple[Visitor, Visitor, str, str]:
    """Ada owns the terrain, Ben has an edit link; both see it, Ben on the map where he only watches."""
    terrain, secret = server.create(title="Together")
    link = json.loads(server.request("POST", f"/api/terrains/{terrain}/links", {"role": "edit", "name": "Ben"}, secret))
    ada, ben = visitors(seen=True), visitors(on_map=watched_on_map)
    ada.open(f"/t/{terrain}#{secret}")
    ben.open(f"/t/{terrain}#{link['secret']}")
    return ada, ben, terrain, secret


def same_ground(ada: Visitor, ben: Visitor, server: Server, terrain: str, secret: str, folder: Path) -> None:
    """Both pages show the same heights exactly, and those of the offline solve within one quantisation step."""
    wait_whole(ada, ben, level=DEFAULT_LEVEL)
    here, there = heights(ada, COARSE), heights(ben, COARSE)
    assert here == there
    archive = folder / "now.esker"
    archive.write_bytes(server.request("GET", f"/api/terrains/{terrain}/archive", secret=secret))
    truth = Terrain.load(archive).heights(level=DEFAULT_LEVEL)
    held = levels(ada, COARSE)
    s = spacing(DEFAULT_LEVEL, SIZE)
    for (x, y), height, level in zip(COARSE, here, held, strict=True):
        assert level >= 0
        assert abs(height - truth[round(y / s), round(x / s)]) <= quantum(level, SIZE) + 1e-4


def test_two_people_sketch_one_terrain(visitors: Visitors, server: Server, tmp_path: Path) -> None:
    ada, ben, terrain, secret = two_people(visitors, server)
    ada.shot("1-blank")

    left, right = on_screen(ada, 900, 2200), on_screen(ada, 2300, 2500)
    mountain = draw(ada, "b", arch(left, right, 110))
    left, right = on_screen(ada, 2500, 1500), on_screen(ada, 3500, 1700)
    crevice = draw(ada, "c", arch(left, right, -40))
    plateau = draw(ada, "p", ellipse(on_screen(ada, 1500, 1100), 70, 34))
    wait_settled(ada, ben)
    ada.shot("2-drawn-ada")
    ben.shot("2-drawn-ben")
    strokes = {s["id"]: s for s in ben.js("() => window.esker.strokes()")}
    assert strokes.keys() == {mountain, crevice, plateau}
    same_ground(ada, ben, server, terrain, secret, tmp_path)
    ground = np.array(heights(ben, COARSE))
    assert ground.max() > 60, "the mountain rose"
    assert ground.min() < -10, "the crevice was cut"
    assert strokes[plateau]["kind"] == "level"

    # Ben drags an end handle of Ada's mountain: the whole stroke is projected anew, for both.
    top = max(strokes[mountain]["curve"], key=lambda p: p[1])
    first, last = strokes[mountain]["first"], strokes[mountain]["last"]
    crest = [a + top[0] * (b - a) for a, b in zip(first, last, strict=True)]
    ben.page.keyboard.press("v")
    ben.page.mouse.click(*on_screen(ben, crest[0], crest[1], crest[2] + top[1]))
    wait(ben, "id => window.esker.selection() === id", mountain)
    ben.shot("3-selected-ben")
    goal = on_screen(ben, 3000, 3000, 0)
    press_and_move(ben.page, polyline([on_screen(ben, *last), goal], 12))
    ben.page.mouse.up()
    wait(ben, "() => window.esker.pending() === 0")
    wait_settled(ada, ben)
    moved = {s["id"]: s for s in ada.js("() => window.esker.strokes()")}[mountain]
    assert moved["last"][1] > last[1] + 200
    assert moved["first"] == first
    ada.shot("4-handle-dragged-ada")
    same_ground(ada, ben, server, terrain, secret, tmp_path)

    # Ada undoes her last stroke: the plateau goes, Ben's drag stays.
    ada.page.keyboard.press("Control+z")
    wait(ada, "() => window.esker.strokes().length === 2 && window.esker.pending() === 0")
    wait_settled(ada, ben)
    after = {s["id"]: s for s in ben.js("() => window.esker.strokes()")}
    assert after.keys() == {mountain, crevice}
    assert after[mountain]["last"] == moved["last"]
    ada.shot("5-undone-ada")

    # The server dies in the middle of a stroke and comes back: both resume by themselves, nothing acknowledged is lost.
    acknowledged = {s["id"] for s in ben.js("() => window.esker.strokes()")}
    path = arch(on_screen(ada, 2600, 2600), on_screen(ada, 3500, 2800), 90)
    ada.page.keyboard.press("b")
    press_and_move(ada.page, path[: len(path) // 2])
    wait(ada, "() => window.esker.strokes().length === 3")
    server.kill()
    for x, y in path[len(path) // 2 :]:
        ada.page.mouse.move(x, y)
    wait(ada, "() => window.esker.connection() !== 'online'")
    offline = ada.page.get_by_text("The server makes the ground: it stays as it is until the connection is back.")
    offline.wait_for()  # SPEC U348: in words, in a window of 720 pixels
    said = offline.bounding_box()
    assert said is not None
    assert 0 <= said["x"] < said["x"] + said["width"] <= 720
    ada.shot("6-server-gone-ada")
    ada.page.mouse.up()
    assert ada.js("() => window.esker.pending()") > 0, "the page does not claim to have saved what it could not send"
    server.start()
    for person in (ada, ben):
        wait(person, "() => window.esker.connection() === 'online' && window.esker.pending() === 0", timeout=90)
    wait_settled(ada, ben)
    assert acknowledged < {s["id"] for s in ben.js("() => window.esker.strokes()")}
    assert ada.js("() => window.esker.strokes()") == ben.js("() => window.esker.strokes()")
    ada.shot("7-resumed-ada")
    ben.shot("7-resumed-ben")
    same_ground(ada, ben, server, terrain, secret, tmp_path)

    for person in (ada, ben):
        assert person.foreign == []
        unexpected = [e for e in person.errors if "ERR_CONNECTION_REFUSED" not in e and "WebSocket connection" not in e]
        assert unexpected == []


@pytest.mark.parametrize("server", [LEVEL], indirect=True)
def test_the_ground_morphs_under_the_pen_for_both(visitors: Visitors, server: Server) -> None:
    """SPEC E1: while the stroke is still being drawn, the other page's ground has already risen."""
    ada, ben, _, _ = two_people(visitors, server, watched_on_map=True)
    path = arch(on_screen(ada, 1000, 2000), on_screen(ada, 3000, 2200), 140, steps=40)
    ada.page.keyboard.press("b")
    press_and_move(ada.page, path[:28])
    wait(ben, "ps => Math.max(...ps.map(([x, y]) => window.esker.heightAt(x, y))) > 50", [list(p) for p in COARSE])
    ben.shot("morph-ben-while-ada-draws")
    assert not ada.js("() => window.esker.strokes()[0].finished")
    ada.page.mouse.up()
    wait_settled(ada, ben)
    picture = Image.open(io.BytesIO(ada.page.screenshot()))
    assert len(picture.convert("L").getcolors(256) or []) > 60, "the picture is not blank"
