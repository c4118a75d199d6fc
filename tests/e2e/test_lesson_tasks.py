"""A whole lesson: a teacher and three pupils, one by touch, one without WebGPU (SPEC L120)."""

from __future__ import annotations

import csv
import io
import json
import zipfile
from pathlib import Path

from tests.e2e.conftest import Server, Visitor, Visitors
from tests.e2e.hands import Pixel, arch, draw, on_screen, wait, wait_apart, wait_settled, wait_still
from tests.e2e.test_everyone import Fingers


def press(visitor: Visitor, words: str, within: str = "body") -> None:
    visitor.page.locator(within).get_by_role("button", name=words, exact=True).click()


def tab(visitor: Visitor, name: str) -> None:
    visitor.page.get_by_role("radio", name=name, exact=True).click()


def points(visitor: Visitor) -> int:
    return int(visitor.js("() => window.esker.score()?.points ?? -1"))


def arrive(visitor: Visitor, server: Server, code: str, name: str) -> Visitor:
    """Types the code on the start page, then a name."""
    visitor.page.goto(server.url)
    visitor.page.locator("esk-landing").get_by_label("Join code or link").fill(code)
    press(visitor, "Join", "esk-landing")
    visitor.page.locator("esk-join").get_by_label("What are you called?").fill(name)
    press(visitor, "Start", "esk-join")
    wait(visitor, "() => window.esker !== undefined && window.esker.ready()")
    return visitor


def mountain(visitor: Visitor, height: float) -> list[Pixel]:
    """A silhouette whose top stands so many metres high, whatever the window."""
    middle, top = on_screen(visitor, 2050, 2050), on_screen(visitor, 2050, 2050, height)
    return arch(on_screen(visitor, 900, 2000), on_screen(visitor, 3200, 2100), middle[1] - top[1])


def write_the_task(teacher: Visitor) -> None:
    """Draws the target, takes it, undoes it, and sets the task."""
    draw(teacher, "b", mountain(teacher, 600))
    wait_settled(teacher)
    press(teacher, "Inspector")
    tab(teacher, "Task")
    press(teacher, "Write a task")
    form = teacher.page.locator("esk-task-form")
    form.get_by_label("Title").fill("Build this mountain")
    form.get_by_label("Text").fill("From west to east one mountain stands.\n\nLook at red and blue, then draw again.")
    form.get_by_label("Goal").select_option("terrain")
    press(teacher, "Set the task", "esk-task-form")
    assert "Use this terrain as the target" in form.get_by_role("alert").inner_text()
    press(teacher, "Use this terrain as the target", "esk-task-form")
    form.get_by_text("Taken.").wait_for()
    press(teacher, "Undo")
    wait(teacher, "() => window.esker.strokes().length === 0 && window.esker.pending() === 0")
    wait_settled(teacher)
    press(teacher, "Set the task", "esk-task-form")
    wait(teacher, "() => (window.esker.score()?.points ?? -1) >= 0")


def test_a_whole_lesson(visitors: Visitors, server: Server) -> None:
    """SPEC L120, U690, U691."""
    terrain, secret = server.create(title="One mountain")
    teacher = visitors(1100, 720)
    teacher.open(f"/t/{terrain}#{secret}")
    write_the_task(teacher)
    begun = points(teacher)
    assert 0 <= begun < 100
    teacher.page.keyboard.press("y")
    wait_apart(teacher, "esk-measure", "aside.side.leads")
    teacher.page.keyboard.press("y")

    made = json.loads(server.request("POST", f"/api/terrains/{terrain}/classes", {}, secret))
    wall = visitors(1100, 720, on_map=True)
    wall.page.goto(f"{server.url}/wall/{terrain}/{made['id']}#{secret}")
    ada = arrive(visitors(900, 640, seen=True), server, made["code"], "Ada")
    ben = arrive(visitors(390, 780, has_touch=True, is_mobile=True), server, made["code"], "Ben")
    cleo = arrive(visitors(720, 540, on_map=True), server, made["code"], "Cleo")

    # Ada draws what is asked, by the difference; Ben by touch, somewhere else; Cleo on the map.
    press(ada, f"Task: Build this mountain, {begun} of 100 points", "esk-task-chip")
    differs = ada.page.locator("esk-task-panel wa-switch", has_text="Red and blue")
    differs.click(position={"x": 14, "y": 12})  # the knob: the row is wider than what is hit
    assert differs.evaluate("e => e.checked")
    for width in (1100, 900):
        ada.page.set_viewport_size({"width": width, "height": 640})
        wait_apart(ada, ".hint", "esk-legend")
        wait_apart(ada, ".hint", "aside.side")
        wait_apart(ada, ".hint", "esk-tools")
        wait_apart(ada, ".hint", "esk-task-chip")
    ada.shot("task-1-blue")
    wait_still(ada)  # the view makes room in the narrower window
    draw(ada, "b", mountain(ada, 520))
    wait(ada, "begun => window.esker.score().points > begun", begun)
    wait_settled(ada)
    ada.shot("task-2-difference")
    fingers = Fingers(ben)
    ben.page.get_by_role("radio", name="Mountain").tap()
    line = arch(on_screen(ben, 1200, 800), on_screen(ben, 2800, 900), 60)
    fingers("touchStart", line[0])
    for at in line[1:]:
        fingers("touchMove", at)
    fingers("touchEnd")
    wait(ben, "() => window.esker.strokes().length === 1 && window.esker.pending() === 0")
    draw(cleo, "m", arch(on_screen(cleo, 1000, 1500), on_screen(cleo, 2600, 1700), 40))

    # The wall: names, ground and scores of all.
    page = wall.page.locator("esk-wall")
    for name in ("Ada", "Ben", "Cleo"):
        page.get_by_role("button", name=f"{name}, here").wait_for()
    page.get_by_role("radio", name="By score").click()
    best = page.locator("li .name").first
    wait(wall, FIRST, "Ada")
    assert "Ada" in best.inner_text()
    wall.shot("task-3-wall")

    # Hands off and look here, in a pupil's copy that the teacher opened.
    page.get_by_role("button", name="Ada, here").click()
    with wall.page.context.expect_page() as opened:
        press(wall, "Open", "esk-wall")
    lead = Visitor(wall.context, opened.value, server.url)
    wait(lead, "() => window.esker !== undefined && window.esker.ready()")
    press(lead, "Inspector")
    tab(lead, "Lesson")
    for switch, says in (("Hands off", "Hands off: drawing is paused"), ("Look here", "is showing")):
        lead.page.locator("esk-lesson-panel wa-switch", has_text=switch).click()
        ada.page.locator("esk-lesson-bar", has_text=says).wait_for()
    assert ada.page.get_by_role("radio", name="Mountain").is_disabled()
    lead.page.close()

    # Show to all, put together, collect.
    own = ben.page.url
    press(wall, "Show to all", "esk-wall")
    wait(ben, "own => location.href !== own && window.esker?.strokes().length === 1", own)
    press(wall, "Stop showing", "esk-wall")
    wait(ben, "own => location.href === own && window.esker !== undefined", own)
    for name in ("Ben", "Cleo"):
        page.get_by_role("button", name=f"{name}, here").click()
    with wall.page.context.expect_page() as opened:
        press(wall, "Put together", "esk-wall")
    opened.value.wait_for_url("**/t/**")
    path, _, fragment = opened.value.url.partition("#")
    together = json.loads(server.request("GET", f"/api/terrains/{path.rsplit('/', 1)[1]}/document", None, fragment))
    assert len(together["strokes"]) == 3
    opened.value.close()
    with wall.page.expect_download() as file:
        press(wall, "Collect", "esk-wall")
    with zipfile.ZipFile(io.BytesIO(Path(file.value.path()).read_bytes())) as collected:
        rows = {
            row["names"]: row for row in csv.DictReader(io.StringIO(collected.read("class.csv").decode("utf-8-sig")))
        }
    assert int(rows["Ada"]["score"]) > begun
    assert all(row["score_text"].startswith(f"{row['score']} of 100: ") for row in rows.values())
    assert [each.errors for each in (teacher, ada, ben, cleo, wall)] == [[], [], [], [], []]


FIRST = """name => {
  const root = document.querySelector('esk-wall').shadowRoot;
  const first = root.querySelector('li');
  return first?.textContent.includes(name) && root.querySelectorAll('.points').length === 3;
}"""
