"""A lesson on the wire: what conductors switch, whom they name, and what everybody is told (DESIGN 19)."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field, StringConstraints

from esker.contract.constants import MAX_GROUP_NAME, MAX_GROUPED, MAX_GROUPS, MAX_NAME_LENGTH, MAX_NAMED, MAX_PEOPLE
from esker.contract.values import Animals, Id, Name, Wire, plain

PersonAction = Literal["pen", "no_pen", "conductor", "no_conductor", "remove", "let_in", "undo"]
GroupName = Annotated[str, StringConstraints(max_length=MAX_GROUP_NAME), AfterValidator(plain)]


class Conduct(Wire):
    """Switches of the lesson; only conductors send it. A switch that is null stays as it is.

    ``hands_off``: nobody but conductors, and who has a pen, changes the document; ``protect``: what conductors drew or
    brought, and the settings, are changed by nobody else; ``hide``: who does not conduct sees neither names nor cursors
    of the others; ``animals``: the language of the animals by which the server names everybody else, "" for own names;
    ``look``: all views follow that of whoever sends this, or nobody's; ``held``: nobody may look away meanwhile.
    """

    type: Literal["conduct"] = "conduct"
    hands_off: bool | None = None
    protect: bool | None = None
    hide: bool | None = None
    animals: Animals | None = None
    look: bool | None = None
    held: bool | None = None


class People(Wire):
    """What a conductor does about people, by their ids (``Member.person``).

    ``pen``, ``no_pen``: they may draw while hands are off, or not; ``conductor``, ``no_conductor``: they conduct too
    (owners only); ``remove``: their pages are closed and do not come back until ``let_in``; ``undo``: everything that
    they did and that still stands is taken back.
    """

    type: Literal["people"] = "people"
    action: PersonAction
    people: Annotated[tuple[Id, ...], Field(min_length=1, max_length=MAX_PEOPLE)]


class Grouping(Wire):
    """What a conductor changes of one group of people. What is null stays as it is, and of two orders the last counts.

    ``group``: its id, made by whoever makes the group; null: every group, of which only ``pen`` can be changed then.
    ``name``: what it is called; with a name an id that nobody knows makes a group. ``pen``: whether its people have
    pens; they get them, or lose them, and so does who is put into it or taken out later. ``put``: people who are in it
    from now on, and in no other; ``out``: people who are in it no more; ``forget``: there is no such group any more.
    """

    type: Literal["grouping"] = "grouping"
    group: Id | None = None
    name: GroupName | None = None
    pen: bool | None = None
    put: Annotated[tuple[Id, ...], Field(max_length=MAX_PEOPLE)] = ()
    out: Annotated[tuple[Id, ...], Field(max_length=MAX_PEOPLE)] = ()
    forget: bool = False


class PenGroup(Wire):
    """People, by their ids, to whom pens are given together. ``pen``: whether they have them."""

    id: Id
    name: GroupName = ""
    people: Annotated[tuple[Id, ...], Field(max_length=MAX_GROUPED)] = ()
    pen: bool = False


PenGroups = Annotated[tuple[PenGroup, ...], Field(max_length=MAX_GROUPS)]


class Outsider(Wire):
    """Somebody who was removed, or who waits to be let in."""

    person: Id
    name: Name


NoticeCode = Literal[
    "not_leading",
    "owners_only",
    "not_owners",
    "not_leaders",
    "not_yourself",
    "nobody",
    "unsaved",
    "undo_busy",
    "unreadable",
    "too_many_groups",
    "too_many_grouped",
    "taken_back",
    "taken_back_but",
    "nothing_stands",
    "nothing_taken_back",
    "refused",
]


class Notice(Wire):
    """A sentence for one person about the lesson: what became of what they asked for. Pages of another language make
    theirs of ``code`` and of the ``names`` of whom it tells."""

    type: Literal["notice"] = "notice"
    code: NoticeCode
    names: Annotated[tuple[Name, ...], Field(max_length=MAX_NAMED)] = ()
    text: Annotated[str, StringConstraints(max_length=MAX_NAMED * MAX_NAME_LENGTH + 240), AfterValidator(plain)]


class Lesson(Wire):
    """How the lesson stands, as one member may know it. ``look``: the client that all views follow; ``draws`` and
    ``conducts`` are about the reader; ``removed``, ``waiting`` and ``groups`` are told to conductors only."""

    type: Literal["lesson"] = "lesson"
    hands_off: bool = False
    protect: bool = False
    hide: bool = False
    animals: Animals = ""
    look: Id | None = None
    held: bool = False
    draws: bool = True
    conducts: bool = False
    removed: tuple[Outsider, ...] = ()
    waiting: tuple[Outsider, ...] = ()
    groups: PenGroups = ()
