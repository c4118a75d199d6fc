"""A lesson in real browsers: a teacher and two pupils (SPEC L1 to L3, L9, L13, L20, E12)."""

from __future__ import annotations

import json

from tests.e2e.conftest import Server, Visitor, Visitors
from tests.e2e.hands import arch, draw, on_screen, press_and_move, wait


def press(visitor: Visitor, label: str) -> None:
    """Presses a button by its words, wherever in the page it is."""
    visitor.page.get_by_role("button", name=label, exact=True).click()


def switch(visitor: Visitor, label: str) -> None:
    """Presses a switch of the lesson's panel."""
    visitor.page.locator("esk-lesson-panel wa-switch", has_text=label).click()


def more(visitor: Visitor, name: str, item: str) -> None:
    """Chooses what is done about a person."""
    press(visitor, f"More about {name}")
    visitor.page.locator("esk-lesson-panel wa-dropdown-item", has_text=item).locator("visible=true").click()


def says(visitor: Visitor, words: str) -> None:
    """Waits until the bar of the lesson says something."""
    visitor.page.locator("esk-lesson-bar", has_text=words).wait_for()


def authors(visitor: Visitor) -> list[str]:
    return [str(s["author"]) for s in visitor.js("() => window.esker.strokes()")]


def pupil(visitors: Visitors, name: str, path: str, width: int = 720, height: int = 540, **options: bool) -> Visitor:
    """Somebody who calls themself so."""
    made = visitors(width, height, **options)
    made.context.add_init_script(f"localStorage.setItem('esker.name', {json.dumps(name)})")
    made.open(path)
    return made


def test_a_teacher_leads_a_lesson(visitors: Visitors, server: Server) -> None:
    """SPEC E12: hands off with a line in hand, a pen for one, look here, undo all of one, send one out."""
    terrain, secret = server.create(title="Lesson")
    link = json.loads(server.request("POST", f"/api/terrains/{terrain}/links", {"role": "edit"}, secret))
    path = f"/t/{terrain}#{link['secret']}"
    teacher = pupil(visitors, "Ms Ray", f"/t/{terrain}#{secret}", width=1100, height=720, seen=True)
    anne, ben = pupil(visitors, "Anne", path), pupil(visitors, "Ben", path, 390, 780, on_map=True)
    press(teacher, "Inspector")
    teacher.page.get_by_role("radio", name="Lesson").click()
    teacher.page.get_by_text("3 people are here").wait_for()
    draw(ben, "b", arch(on_screen(ben, 1000, 1500), on_screen(ben, 2200, 1700), 60))
    teacher.shot("lesson-1-panel")

    # Anne has a line in hand when drawing is paused: it ends as it is, and what the server did not take waits for her.
    anne.page.keyboard.press("b")
    line = arch(on_screen(anne, 1800, 2200), on_screen(anne, 3000, 2500), 90)
    press_and_move(anne.page, line[: len(line) // 2])
    switch(teacher, "Hands off")
    says(anne, "Hands off: drawing is paused")
    wait(anne, "() => window.esker.strokes().length === 2 && window.esker.pending() === 0")
    for x, y in line[len(line) // 2 :]:
        anne.page.mouse.move(x, y)
    anne.page.mouse.up()
    assert anne.page.get_by_role("radio", name="Mountain").is_disabled()
    wait(anne, "() => window.esker.strokes().every((s) => s.finished)")
    anne.shot("lesson-2-hands-off")
    ben.shot("lesson-2-hands-off-phone")
    teacher.shot("lesson-2-hands-off-teacher")
    drawn = len(anne.js("() => window.esker.strokes()"))

    press(teacher, "Give a pen to Ben")
    says(ben, "You have a pen")
    draw(ben, "b", arch(on_screen(ben, 1000, 2500), on_screen(ben, 2200, 2700), 60))
    assert len(ben.js("() => window.esker.strokes()")) == drawn + 1

    switch(teacher, "Look here")
    says(anne, "Ms Ray is showing")
    says(ben, "Ms Ray is showing")
    anne.shot("lesson-3-look")
    eye = teacher.js("() => window.esker.camera().eye")
    near = "e => window.esker.camera().eye.every((v, i) => Math.abs(v - e[i]) < 30)"
    wait(anne, near, eye)
    press(anne, "Look away")
    says(anne, "Look along")
    switch(teacher, "Nobody looks away")
    wait(anne, near, eye)
    says(anne, "Ms Ray is showing")
    assert anne.page.get_by_role("button", name="Look away").count() == 0
    switch(teacher, "Look here")

    more(teacher, "Ben", "Undo all of Ben")
    wait(teacher, "() => window.esker.strokes().length === 1")
    wait(anne, "() => window.esker.strokes().length === 1")
    assert authors(anne) == ["Anne"]

    more(teacher, "Ben", "Send out Ben")
    ben.page.get_by_text("You were sent out").first.wait_for()
    ben.shot("lesson-4-sent-out")
    ben.page.goto(server.url + "/privacy")
    ben.page.goto(server.url + path)
    ben.page.get_by_text("You were sent out").first.wait_for()
    teacher.page.locator("esk-lesson-panel", has_text="sent out").wait_for()
    teacher.shot("lesson-5-outside")
    switch(teacher, "Hands off")
    wait(anne, "() => document.querySelector('esk-terrain') !== null")
    anne.page.get_by_role("radio", name="Mountain").click()
    press(teacher, "Let in")
    ben.open(path)
    assert anne.errors == []
    assert teacher.errors == []


QUIET = """() => {
  const bar = document.querySelector("esk-terrain").shadowRoot.querySelector("esk-lesson-bar");
  return !bar.shadowRoot.textContent.includes("Hands off");
}"""
SMALL = """() => {
  const panel = document.querySelector("esk-terrain").shadowRoot.querySelector("esk-lesson-panel").shadowRoot;
  const touched = [...panel.querySelectorAll("button, wa-switch")];
  return touched.map((e) => [e.textContent.trim() || e.ariaLabel, e.getBoundingClientRect().height])
    .filter(([, height]) => height < 40);
}"""


def test_groups_are_on_every_device_of_who_leads(visitors: Visitors, server: Server) -> None:
    """SPEC L160, L161: a group that is made on a laptop is given pens and a name on a tablet."""
    terrain, secret = server.create(title="Groups")
    link = json.loads(server.request("POST", f"/api/terrains/{terrain}/links", {"role": "edit"}, secret))
    laptop = pupil(visitors, "Ms Ray", f"/t/{terrain}#{secret}", width=1100, height=720, on_map=True)
    tablet = visitors(1024, 768, has_touch=True, on_map=True)
    tablet.open(f"/t/{terrain}#{secret}")
    path = f"/t/{terrain}#{link['secret']}"
    anne, ben = (pupil(visitors, name, path, on_map=True) for name in ("Anne", "Ben"))
    for each in (laptop, tablet):
        press(each, "Inspector")
        each.page.get_by_role("radio", name="Lesson").click()
        each.page.get_by_text("4 people are here").wait_for()
    groups, others = (each.page.locator("esk-lesson-groups") for each in (laptop, tablet))
    press(laptop, "Make a group")
    for name in ("Anne", "Ben"):
        groups.get_by_label(name).check()
    others.get_by_text("2 here").wait_for()
    switch(laptop, "Hands off")
    says(ben, "Hands off: drawing is paused")
    press(tablet, "Give pens to Group 1")
    for each in (anne, ben):
        says(each, "You have a pen")
    press(tablet, "Who is in Group 1")
    others.get_by_label("Name of the group").fill("Red")
    others.get_by_label("Ben").uncheck()
    says(ben, "Hands off: drawing is paused")
    groups.get_by_text("1 here").wait_for()
    groups.get_by_role("button", name="Take the pens from Red").scroll_into_view_if_needed()
    assert [groups.get_by_label(name).is_checked() for name in ("Anne", "Ben")] == [True, False]
    laptop.shot("lesson-6-groups")
    laptop.page.reload()
    wait(laptop, "() => window.esker !== undefined && window.esker.ready()")
    press(laptop, "Inspector")
    laptop.page.get_by_role("radio", name="Lesson").click()
    press(laptop, "Take the pens from Red")
    says(anne, "Hands off: drawing is paused")
    assert [each.errors for each in (laptop, tablet, anne, ben)] == [[], [], [], []]


def test_a_lesson_is_led_from_a_phone(visitors: Visitors, server: Server) -> None:
    """SPEC L28: by touch at 390 and at 720 pixels: what is pressed has 40 pixels, and nothing scrolls sideways."""
    terrain, secret = server.create(title="Phone")
    link = json.loads(server.request("POST", f"/api/terrains/{terrain}/links", {"role": "edit"}, secret))
    path = f"/t/{terrain}#{link['secret']}"
    pupils = [pupil(visitors, name, path, on_map=True) for name in ("Anne", "Ben")]
    for width, height in ((390, 780), (720, 540)):
        teacher = visitors(width, height, device_scale_factor=1, has_touch=True, is_mobile=width < 720)
        teacher.open(f"/t/{terrain}#{secret}")
        press(teacher, "More")
        teacher.page.locator("wa-dropdown-item", has_text="Lead the lesson").tap()
        teacher.page.get_by_text("people are here").wait_for()
        switch(teacher, "Hands off")
        says(teacher, "Hands off")
        press(teacher, "A pen for all")
        says(pupils[0], "You have a pen")
        assert teacher.js(SMALL) == []
        assert teacher.js("() => document.scrollingElement.scrollWidth <= window.innerWidth")
        teacher.shot(f"lesson-panel-{width}")
        # The keys do the same.
        toggle = teacher.page.locator("esk-lesson-panel wa-switch", has_text="Hands off")
        toggle.focus()
        teacher.page.keyboard.press("Space")
        wait(pupils[0], QUIET)
        teacher.context.close()
        visitors.made.remove(teacher)


def test_the_page_for_parents(visitors: Visitors, server: Server) -> None:
    """SPEC L25: it needs no link, and says that nothing leaves the server."""
    parent = visitors(seen=True, width=720, height=900)
    parent.page.goto(server.url + "/privacy")
    parent.page.get_by_text("Nothing leaves this server").wait_for()
    parent.shot("privacy")
    assert parent.foreign == []
