"""How the lesson of a terrain stands: values, written into the database as JSON (``store/lessons.py``)."""

from __future__ import annotations

import logging
from typing import Annotated, Final

from pydantic import Field, ValidationError

from esker import contract as c

log = logging.getLogger("esker.lesson")

MOST: Final = 1_000
"""People of whom a lesson remembers that they have a pen, conduct, were let in or are called after an animal; and who
were removed."""
People = Annotated[tuple[c.Id, ...], Field(max_length=MOST)]


class Removed(c.Wire):
    """Somebody who was removed. ``address``: what the address counts as (``fairness/shares.py``, the narrow key);
    ``at``: milliseconds since 1970."""

    person: c.Id
    name: c.Name
    address: str
    at: int


class State(c.Wire):
    """Switches, and people by their ids. ``look``: the person whose view all follow; ``named``: numbers of animals;
    ``groups``: people to whom pens are given together, in the order in which the groups were made."""

    hands_off: bool = False
    protect: bool = False
    hide: bool = False
    animals: c.Animals = ""
    look: c.Id | None = None
    held: bool = False
    pens: People = ()
    conductors: People = ()
    removed: Annotated[tuple[Removed, ...], Field(max_length=MOST)] = ()
    let_in: People = ()
    named: dict[c.Id, Annotated[int, Field(ge=0)]] = Field(default_factory=dict)
    groups: c.PenGroups = ()


def read(text: str | None, terrain: str) -> State:
    """The state of a text; that of a terrain without a lesson where there is none, or one that cannot be read."""
    if text is None:
        return State()
    try:
        return State.model_validate_json(text)
    except ValidationError as error:
        log.error("terrain %s: the state of its lesson cannot be read, so nothing is switched: %s", terrain, error)
        return State()


def with_people(known: tuple[str, ...], people: tuple[str, ...]) -> tuple[str, ...]:
    """People with more of them; the first are forgotten where they would be too many."""
    last = dict.fromkeys(people)
    return (*(each for each in known if each not in last), *last)[-MOST:]


def without(known: tuple[str, ...], people: tuple[str, ...]) -> tuple[str, ...]:
    """People but for some of them."""
    gone = frozenset(people)
    return tuple(each for each in known if each not in gone)
