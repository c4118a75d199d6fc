"""A teacher and two pupils in real browsers: code, copies, wall, compare, collect, projector (SPEC E60, L75)."""

from __future__ import annotations

import io
import json
import time
import zipfile
from pathlib import Path

from PIL import Image

from tests.e2e.conftest import Server, Visitor, Visitors
from tests.e2e.hands import arch, draw, on_screen, wait, wait_settled

CARD = """number => {
  const root = document.querySelector('esk-wall').shadowRoot;
  const canvas = root.querySelector(`canvas[data-copy="${number}"]`);
  if (!canvas || !canvas.classList.contains('drawn')) return null;
  const pixels = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
  const colours = new Set();
  for (let i = 0; i < pixels.length; i += 4) colours.add((pixels[i] << 16) | (pixels[i + 1] << 8) | pixels[i + 2]);
  return colours.size;
}"""
"""How many colours a card of the wall has: flat ground has one."""


def _press(page: Visitor, selector: str, words: str) -> None:
    page.page.locator(selector).get_by_role("button", name=words, exact=True).click()


def _pupil(visitors: Visitors, server: Server, code: str, name: str) -> Visitor:
    """Types the code on the start page, then a name, and works on the map."""
    pupil = visitors(on_map=True)
    pupil.page.goto(server.url)
    pupil.page.locator("esk-landing").get_by_label("Join code or link").fill(code)
    _press(pupil, "esk-landing", "Join")
    pupil.page.locator("esk-join").get_by_label("What are you called?").fill(name)
    _press(pupil, "esk-join", "Start")
    wait(pupil, "() => window.esker?.status?.().online ?? window.esker !== undefined")
    return pupil


def _many(page: Visitor, number: int) -> None:
    wait(page, f"() => (({CARD})({number}) ?? 0) > 40")


def _pictures(page: Visitor) -> list[bytes]:
    """The two pictures of a comparison as they are on the screen."""
    figures = page.page.locator("esk-wall-compare .picture")
    return [figures.nth(k).screenshot() for k in (0, 1)]


def _both_change(page: Visitor, seen: list[bytes]) -> list[bytes]:
    """Waits until both pictures are others than those seen, and show land: what they are then."""
    ends = time.monotonic() + 60
    while time.monotonic() < ends:
        now = _pictures(page)
        colours = [Image.open(io.BytesIO(each)).convert("RGB").getcolors(40) for each in now]
        if all(a != b for a, b in zip(now, seen, strict=True)) and colours == [None, None]:
            return now
        time.sleep(0.3)
    raise AssertionError("one of the two pictures stayed as it was")


def _compare(teacher: Visitor) -> None:
    """Two copies in 3D: a drag on one moves both, and the difference is on both."""
    _press(teacher, "esk-wall", "Compare")
    compared = teacher.page.locator("esk-wall-compare")
    compared.get_by_text("Ben", exact=True).wait_for()
    seen = _both_change(teacher, [b"", b""])
    assert seen[0] != seen[1]
    box = compared.locator(".picture").first.bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    teacher.page.mouse.move(x, y)
    teacher.page.mouse.down()
    teacher.page.mouse.move(x + 160, y - 30, steps=3)
    teacher.page.mouse.up()
    seen = _both_change(teacher, seen)
    teacher.shot("2-compare")
    compared.get_by_role("radio", name="Difference").click()
    compared.get_by_text("higher than the other").wait_for()
    _both_change(teacher, seen)
    teacher.shot("2-compare-difference")
    assert teacher.errors == []
    _press(teacher, "esk-wall-compare", "Back to the wall")
    wait(teacher, "() => window.__compared === null")


def _the_projector(page: Visitor, server: Server, code: str, one: Visitor) -> None:
    """SPEC U670: address, code, its picture and how many are in, also when one goes."""
    page.page.goto(f"{server.url}/room#{code}")
    room = page.page.locator("esk-room")
    room.get_by_role("heading", name="Build a mountain").wait_for()
    assert room.locator(".address").inner_text() == server.url
    assert "".join(room.locator(".code").inner_text().split()) == code
    assert room.locator("wa-qr-code").evaluate("e => e.value") == f"{server.url}/join#{code}"
    room.get_by_text("2 are in", exact=True).wait_for()
    page.shot("4-projector")
    one.page.goto("about:blank")
    room.get_by_text("1 is in", exact=True).wait_for()


def test_a_lesson_with_copies(visitors: Visitors, server: Server) -> None:
    """SPEC E60, L156, L157."""
    terrain, secret = server.create(title="Build a mountain")
    made = json.loads(server.request("POST", f"/api/terrains/{terrain}/classes", {}, secret))
    teacher = visitors(seen=True)
    teacher.page.goto(f"{server.url}/wall/{terrain}/{made['id']}#{secret}")
    teacher.page.locator("esk-wall").get_by_text("Nobody is here yet.").wait_for()
    code = made["code"]
    assert teacher.page.locator("esk-wall .letters").first.inner_text().replace(" ", "") == code
    ada = _pupil(visitors, server, code, "Ada")
    ben = _pupil(visitors, server, code, "Ben")
    assert ada.page.url != ben.page.url
    for pupil, height in ((ada, 120), (ben, 60)):
        draw(pupil, "b", arch(on_screen(pupil, 1000, 2000), on_screen(pupil, 2600, 2200), height))
    for number in (1, 2):
        _many(teacher, number)
    teacher.shot("1-wall")
    own = ada.page.url
    ada.page.reload()
    wait(ada, "() => window.esker !== undefined && window.esker.strokes().length === 1")
    assert ada.page.url == own
    wall = teacher.page.locator("esk-wall")
    wall.get_by_role("button", name="Ada, here").click()
    with teacher.page.context.expect_page() as opened:
        _press(teacher, "esk-wall", "Open")
    opened.value.wait_for_url("**/t/**")
    opened.value.close()
    wall.get_by_role("button", name="Ben, here").click()
    with teacher.page.context.expect_page() as opened:
        _press(teacher, "esk-wall", "Put together")
    opened.value.wait_for_url("**/t/**")
    both = opened.value.url
    opened.value.close()
    path, _, fragment = both.partition("#")
    together = path.rsplit("/", 1)[1]
    document = json.loads(server.request("GET", f"/api/terrains/{together}/document", None, fragment))
    assert len(document["strokes"]) == 2
    _compare(teacher)
    with teacher.page.expect_download() as file:
        _press(teacher, "esk-wall", "Collect")
    with zipfile.ZipFile(io.BytesIO(Path(file.value.path()).read_bytes())) as collected:
        assert {"01-ada.esker", "01-ada.png", "02-ben.esker", "02-ben.png", "class.csv"} == set(collected.namelist())
    teacher.page.set_viewport_size({"width": 720, "height": 900})
    teacher.shot("3-narrow")
    wait_settled(ada)
    _the_projector(teacher, server, code, ben)


def test_everybody_looks_and_comes_back(visitors: Visitors, server: Server) -> None:
    """SPEC L75 in the page."""
    terrain, secret = server.create(title="Look at this")
    made = json.loads(server.request("POST", f"/api/terrains/{terrain}/classes", {}, secret))
    ada = _pupil(visitors, server, made["code"], "Ada")
    ben = _pupil(visitors, server, made["code"], "Ben")
    draw(ada, "b", arch(on_screen(ada, 1000, 2000), on_screen(ada, 2600, 2200), 80))
    own, path = ben.page.url, f"/api/terrains/{terrain}/classes/{made['id']}/show"
    server.request("POST", path, {"number": 1}, secret)
    wait(ben, "own => location.href !== own && window.esker?.strokes().length === 1", own)
    server.request("POST", path, {"number": None}, secret)
    wait(ben, "own => location.href === own && window.esker !== undefined", own)
