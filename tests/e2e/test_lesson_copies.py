"""A teacher and two pupils in real browsers: code, copies, wall, put together, collect (SPEC E60, L75)."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.e2e.conftest import Server, Visitor, Visitors, serving
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


@pytest.fixture
def server(tmp_path: Path) -> Iterator[Server]:
    """A server of its own."""
    yield from serving(tmp_path)


def _press(page: Visitor, selector: str, words: str) -> None:
    page.page.locator(selector).get_by_role("button", name=words, exact=True).click()


def _pupil(visitors: Visitors, server: Server, code: str, name: str) -> Visitor:
    """Types the code on the start page, then a name."""
    pupil = visitors(seen=True)
    pupil.page.goto(server.url)
    pupil.page.locator("esk-landing").get_by_label("Join code or link").fill(code)
    _press(pupil, "esk-landing", "Join")
    pupil.page.locator("esk-join").get_by_label("What are you called?").fill(name)
    _press(pupil, "esk-join", "Start")
    wait(pupil, "() => window.esker?.status?.().online ?? window.esker !== undefined")
    return pupil


def _many(page: Visitor, number: int) -> None:
    wait(page, f"() => (({CARD})({number}) ?? 0) > 40")


def test_a_lesson_with_copies(visitors: Visitors, server: Server) -> None:
    terrain, secret = server.create(title="Build a mountain")
    made = json.loads(server.request("POST", f"/api/terrains/{terrain}/classes", {}, secret))
    teacher = visitors()
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
    _press(teacher, "esk-wall", "Compare")
    wall.locator("esk-wall-compare figcaption").first.wait_for()
    teacher.shot("2-compare")
    _press(teacher, "esk-wall-compare", "Back to the wall")
    with teacher.page.expect_download() as file:
        _press(teacher, "esk-wall", "Collect")
    with zipfile.ZipFile(io.BytesIO(Path(file.value.path()).read_bytes())) as collected:
        assert {"01-ada.esker", "01-ada.png", "02-ben.esker", "02-ben.png", "class.csv"} == set(collected.namelist())
    teacher.page.set_viewport_size({"width": 720, "height": 900})
    teacher.shot("3-narrow")
    wait_settled(ada)


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
