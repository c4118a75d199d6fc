"""A lesson on the wire: what conductors switch, whom they name, and what everybody is told (DESIGN 19)."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from esker.contract.constants import MAX_PEOPLE
from esker.contract.values import Animals, Id, Line, Name, Wire

PersonAction = Literal["pen", "no_pen", "conductor", "no_conductor", "remove", "let_in", "undo"]


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


class Outsider(Wire):
    """Somebody who was removed, or who waits to be let in."""

    person: Id
    name: Name


class Notice(Wire):
    """A sentence for one person about the lesson: what became of what they asked for."""

    type: Literal["notice"] = "notice"
    text: Line


class Lesson(Wire):
    """How the lesson stands, as one member may know it. ``look``: the client that all views follow; ``draws`` and
    ``conducts`` are about the reader; ``removed`` and ``waiting`` are told to conductors only."""

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
