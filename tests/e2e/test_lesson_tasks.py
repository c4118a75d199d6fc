"""A task from a teacher to three pupils, one by touch, one without WebGPU (SPEC L120)."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.e2e.conftest import Server, Visitor, Visitors, serving
from tests.e2e.hands import Pixel, arch, draw, on_screen, wait, wait_settled
from tests.e2e.test_everyone import NO_WEBGPU


@pytest.fixture
def server(tmp_path: Path) -> Iterator[Server]:
    """A server of its own."""
    yield from serving(tmp_path)


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


def test_a_task_reaches_a_class(visitors: Visitors, server: Server) -> None:
    terrain, secret = server.create(title="One mountain")
    teacher = visitors(1100, 720, seen=True)
    teacher.open(f"/t/{terrain}#{secret}")
    write_the_task(teacher)
    begun = points(teacher)
    assert 0 <= begun < 100

    made = json.loads(server.request("POST", f"/api/terrains/{terrain}/classes", {}, secret))
    ada = arrive(visitors(900, 640, seen=True), server, made["code"], "Ada")
    arrive(visitors(390, 780, has_touch=True, is_mobile=True), server, made["code"], "Ben")
    cleo = visitors(720, 540)
    cleo.context.add_init_script(NO_WEBGPU)
    arrive(cleo, server, made["code"], "Cleo")

    # The task is in every copy, and what Ada draws is scored.
    for pupil in (ada, cleo):
        wait(pupil, "begun => window.esker.score()?.points === begun", begun)
    press(ada, f"Task: Build this mountain, {begun} of 100 points", "esk-task-chip")
    ada.page.locator("esk-task-panel").get_by_text("Look at red and blue, then draw again.").wait_for()
    ada.shot("task-panel")
    draw(ada, "b", mountain(ada, 520))
    wait(ada, "begun => window.esker.score().points !== begun", begun)
