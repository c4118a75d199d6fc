"""The lesson of any terrain of a server, whether its room is open or not (DESIGN 19)."""

from __future__ import annotations

from collections.abc import Callable

from esker.fairness.shares import homes
from esker.session.lesson import state as lesson_state
from esker.session.lesson.rules import Hand, Lesson
from esker.session.room.entry import Caller, Denied, caller_of
from esker.session.room.room import Room
from esker.store import timestamps
from esker.store.access import Link
from esker.store.claims import Claims
from esker.store.journal import Journal
from esker.store.lessons import read_makers, read_state


class Lessons:
    """Reads lessons from the database where no open room has them."""

    def __init__(self, journal: Journal, claims: Claims, open_room: Callable[[str], Room | None]) -> None:
        self._journal, self._claims, self._open_room = journal, claims, open_room

    def load(self, terrain: str) -> Lesson:
        """The lesson of a terrain as the database has it, for a room that opens."""
        db = self._journal.reader()
        state = lesson_state.read(read_state(db, terrain), terrain)
        people = timestamps.read_people(db, terrain).values()
        return Lesson(state, read_makers(db, terrain), {p.client: Hand(p.person, p.conducts) for p in people})

    def of(self, terrain: str) -> Lesson:
        """The lesson of a terrain; of one that is not open, without who made what."""
        room = self._open_room(terrain)
        if room is not None:
            return room.core.lesson
        return Lesson(lesson_state.read(read_state(self._journal.reader(), terrain), terrain))

    def caller(self, link: Link, ticket: str | None, address: str) -> Caller:
        """Who asks beside a room, by a link and with a ticket. Raises Denied (removed)."""
        caller = caller_of(self._claims, link.terrain, link.role, ticket)
        kept_out = self.of(link.terrain).door(caller, caller.since, homes(address)[0])
        if kept_out is not None:
            raise Denied("removed", kept_out, caller.ticket)
        return caller
