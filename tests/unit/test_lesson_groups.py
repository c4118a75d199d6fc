"""Groups of a lesson by themselves (SPEC L160, L161, L164)."""

from __future__ import annotations

import json
from typing import Any

import pytest

from esker import contract as c
from esker.session.lesson.rules import Lesson
from esker.session.lesson.state import Removed, State, read
from esker.session.room.entry import Caller


def order(group: str | None, **changes: Any) -> c.Grouping:
    return c.Grouping.model_validate_json(json.dumps({"type": "grouping", "group": group, **changes}))


def after(lesson: Lesson, *orders: c.Grouping) -> State:
    """The state of a lesson after orders that it takes."""
    for each in orders:
        state = lesson.grouped(each)
        assert isinstance(state, State)
        lesson.state = state
    return lesson.state


def people(state: State) -> dict[str, tuple[str, ...]]:
    return {each.id: each.people for each in state.groups}


def a_lesson() -> Lesson:
    """Red with Ada and Ben, blue with Cho."""
    lesson = Lesson(State())
    after(
        lesson,
        order("red", name="Red", put=["ada"]),
        order("blue", name="Blue", put=["cho"]),
        order("red", put=["ben"]),
    )
    return lesson


def test_a_group_is_made_by_its_name_and_forgotten() -> None:
    """SPEC L161."""
    lesson = a_lesson()
    assert [each.name for each in lesson.state.groups] == ["Red", "Blue"]
    assert people(lesson.state) == {"red": ("ada", "ben"), "blue": ("cho",)}
    after(lesson, order("green", put=["ada"]), order("green", pen=True), order("green", forget=True))
    assert people(lesson.state) == {"red": ("ada", "ben"), "blue": ("cho",)}, "nobody has made it"
    after(lesson, order("red", name="Rot"), order("blue", forget=True), order("blue", put=["cho"]))
    assert [(each.id, each.name) for each in lesson.state.groups] == [("red", "Rot")]


def test_pens_follow_the_group() -> None:
    """SPEC L160: pens that were given by hand stay."""
    lesson = a_lesson()
    lesson.state = lesson.turned(c.People(action="pen", people=("eve",)))
    assert after(lesson, order("red", pen=True)).pens == ("eve", "ada", "ben")
    assert after(lesson, order("red", put=["dan"])).pens == ("eve", "ada", "ben", "dan")
    assert after(lesson, order("blue", put=["dan"])).pens == ("eve", "ada", "ben")
    assert people(lesson.state) == {"red": ("ada", "ben"), "blue": ("cho", "dan")}, "nobody is in two groups"
    assert after(lesson, order("red", out=["ben"])).pens == ("eve", "ada")
    lesson.state = lesson.turned(c.People(action="no_pen", people=("ada",)))
    assert after(lesson, order("red", name="Rot")).pens == ("eve",), "what was taken by hand does not come back"
    assert after(lesson, order(None, pen=True)).pens == ("eve", "cho", "dan")
    assert [each.pen for each in lesson.state.groups] == [True, True]
    assert after(lesson, order("red", put=["cho"])).pens == ("eve", "cho", "dan"), "from pens to pens"
    assert after(lesson, order("red", forget=True)).pens == ("eve", "dan")
    assert after(lesson, order(None, pen=False)).pens == ("eve",)


def test_one_order_puts_in_and_takes_out() -> None:
    lesson = a_lesson()
    state = after(lesson, order("red", pen=True, put=["dan", "dan", "cho"], out=["ada"], name="R"))
    assert people(state) == {"red": ("ben", "dan", "cho"), "blue": ()}
    assert sorted(state.pens) == ["ben", "cho", "dan"]


def test_who_is_sent_out_is_in_no_group() -> None:
    """SPEC L164."""
    lesson = a_lesson()
    after(lesson, order(None, pen=True))
    lesson.state = lesson.sent_out([Removed(person="ben", name="Ben", address="", at=0)])
    assert people(lesson.state) == {"red": ("ada",), "blue": ("cho",)}
    assert lesson.state.pens == ("ada", "cho")


def test_groups_have_bounds() -> None:
    """SPEC L164: how many there are, and how many people are in all of them."""
    lesson = Lesson(State())
    after(lesson, *(order(f"g{k}", name="\u00e9" * c.MAX_GROUP_NAME) for k in range(c.MAX_GROUPS)))
    assert lesson.grouped(order("more", name="More")) == "too_many_groups"
    crowd = [[f"{half}-{k:038}" for k in range(c.MAX_PEOPLE)] for half in range(3)]
    after(lesson, order("g0", put=crowd[0]), order("g0", put=crowd[1]), order("g1", put=crowd[1]))
    assert sum(map(len, people(lesson.state).values())) == c.MAX_GROUPED
    assert lesson.grouped(order("g2", put=crowd[2][:1])) == "too_many_grouped"
    after(lesson, order("g2", put=crowd[1]))
    text = lesson.state.model_dump_json()
    assert read(text, "t") == lesson.state
    assert len(text.encode()) < 32 * 1024
    for wrong in ({"name": "n" * 41}, {"put": ["p"] * 201}, {"put": ["two words"]}):
        with pytest.raises(ValueError, match="validation error"):
            order("g0", **wrong)


def test_only_who_leads_is_told_of_groups() -> None:
    """SPEC L161."""
    lesson = a_lesson()
    lesson.state = lesson.turned(c.People(action="conductor", people=("ada",)))
    roles: tuple[tuple[str, c.Role], ...] = (("ray", "owner"), ("ada", "edit"), ("ben", "edit"), ("ada", "view"))
    told = [lesson.message_for(Caller(role, person, "", None), None).groups for person, role in roles]
    assert told == [lesson.state.groups, lesson.state.groups, (), ()]


def test_a_state_from_before_there_were_groups_is_read() -> None:
    """SPEC L161, J255."""
    before = State(hands_off=True, pens=("anne",)).model_dump(mode="json")
    del before["groups"]
    assert read(json.dumps(before), "t") == State(hands_off=True, pens=("anne",))
