"""The six lessons of the gallery: each begins with its task, can be solved, and has a plan (SPEC L130, L131)."""

from __future__ import annotations

import json

import numpy as np
import pytest

from esker import templates
from esker.contract import ContoursGoal, TerrainGoal
from esker.tasks.score import score
from esker.tasks.target import decode
from esker.templates import teaching

DRAWN = [lesson for lesson in teaching.lessons() if not lesson.layers]


def test_there_are_six_in_the_order_of_their_sheets() -> None:
    """SPEC L130."""
    assert [lesson.id for lesson in templates.lessons()] == [lesson.id for lesson in teaching.lessons()]
    assert list(templates.plans()) == [lesson.id for lesson in teaching.lessons()]
    assert len(templates.lessons()) == 6


@pytest.mark.parametrize("lesson", templates.lessons(), ids=lambda lesson: str(lesson.id))
def test_a_lesson_begins_with_its_task(lesson: templates.Template) -> None:
    """SPEC L130: its title, its text and a goal; a target that can be read."""
    plan = templates.plans()[lesson.id]
    task = lesson.document.settings.task
    assert task is not None
    assert (task.title, task.text) == (plan.title, plan.task)
    assert task.goal is not None
    assert templates.load(lesson.id) is lesson
    if isinstance(task.goal, TerrainGoal | ContoursGoal):
        assert task.goal.target.size_m == lesson.document.settings.size_m
        assert np.ptp(decode(task.goal.target)) > 100


@pytest.mark.parametrize("name", list(templates.plans()))
def test_a_sheet_is_whole(name: str) -> None:
    """SPEC L131: its minutes are those of its steps; nothing is empty."""
    plan = templates.plans()[name]
    assert sum(step["minutes"] for step in plan.steps) == plan.minutes
    assert all((plan.goal, plan.ages, plan.truth, plan.before, len(plan.ask) >= 3))
    assert all(each["question"].endswith("?") and each["answer"] for each in plan.ask)


@pytest.mark.parametrize("name", list(templates.plans()))
def test_a_plan_is_the_same_in_german(name: str) -> None:
    """SPEC L162: each part has its translation, minutes are the same, and nothing is left in English."""
    english, german = templates.plans()[name], templates.plans("de")[name]
    assert list(templates.plans("de")) == list(templates.plans())
    assert german.minutes == english.minutes
    assert [step["minutes"] for step in german.steps] == [step["minutes"] for step in english.steps]
    for one, other in ((english.before, german.before), (english.ask, german.ask)):
        assert len(one) == len(other)
    assert english.task.count("\n\n") == german.task.count("\n\n")
    assert not sentences(english) & sentences(german)


def sentences(plan: templates.Plan) -> set[str]:
    """Everything that a plan says."""
    parts = [plan.title, plan.description, plan.ages, plan.goal, *plan.task.split("\n\n"), *plan.before, plan.truth]
    return {*parts, *(step["what"] for step in plan.steps), *(text for each in plan.ask for text in each.values())}


@pytest.mark.parametrize("name", list(templates.plans()))
def test_a_lesson_begins_in_the_language_of_the_page(name: str) -> None:
    """SPEC L163: title and task; ground, goal and everything else are the same."""
    english, german = templates.document(name), templates.document(name, "de")
    plan = templates.plans("de")[name]
    assert english == templates.load(name).document
    assert german.settings.task is not None
    assert (german.settings.title, german.settings.task.title, german.settings.task.text) == (
        plan.title, plan.title, plan.task,
    )  # fmt: skip
    back = {"title": english.settings.title, "task": english.settings.task}
    assert german.model_copy(update={"settings": german.settings.model_copy(update=back)}) == english
    assert german.settings.task.goal == getattr(english.settings.task, "goal", None)


def test_a_starting_terrain_without_a_lesson_has_one_language() -> None:
    """SPEC L163."""
    assert templates.document("canyon", "de") == templates.load("canyon").document
    with pytest.raises(KeyError):
        templates.document("none", "de")


@pytest.mark.parametrize("lesson", DRAWN, ids=lambda lesson: str(lesson.id))
def test_a_lesson_can_be_solved(lesson: teaching.Lesson) -> None:
    """SPEC L130: with far fewer points before than after."""
    kept = json.loads((teaching.PLACE / f"{lesson.id}.json").read_text(encoding="utf-8"))
    settings = templates.load(lesson.id).document.settings
    assert kept["document"]["strokes"] == json.loads(lesson.document().model_dump_json())["strokes"]
    assert settings.task is not None
    assert settings.task.goal is not None
    assert score(settings.task.goal, lesson.heights(), settings).points < 70
    assert score(settings.task.goal, lesson.heights(*lesson.answer), settings).points >= 99
