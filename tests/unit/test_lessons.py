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
