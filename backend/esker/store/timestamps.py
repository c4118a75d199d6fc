"""When ops were done and by whom: what the history needs beside the journal's ops (docs/decisions/0021-history.md).

``moments`` (terrain, clock, at): ops from ``clock`` on were committed at ``at``, or at most TIMESTAMP_SECONDS later,
until the next row; a second of drawing is one row. ``people`` (terrain, client, name, colour, person, conducts): how an
author of ops was last called there, who that was over reloads of the page, and whether they conducted a lesson. A
journal from before these tables has ops without a time, by authors without a name.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final, NamedTuple

from esker.store.engine.ports import Connection

TIMESTAMP_SECONDS: Final = 1.0


class Person(NamedTuple):
    """An author of ops as the others saw them."""

    client: str
    name: str
    colour: str
    person: str = ""
    """Who it was, the same over reloads of the page; empty where that was not written down."""
    conducts: bool = True


class Timestamps:
    """Writes both, in the commits of the ops; for the journal's writer thread."""

    def __init__(self) -> None:
        self._last: dict[str, float] = {}

    def note(self, db: Connection, terrain: str, clock: int, now: float) -> None:
        """Ops from ``clock`` on are committed at ``now``, seconds since 1970."""
        if self.is_due(terrain, now):
            db.execute("INSERT INTO moments VALUES (?,?,?) ON CONFLICT DO NOTHING", (terrain, clock, now))
            self._last[terrain] = now
            if len(self._last) > 10_000:
                self._last.clear()

    def is_due(self, terrain: str, now: float) -> bool:
        """Returns whether ``note`` will write."""
        last = self._last.get(terrain)
        # A clock that was set back must not leave ops without a moment for as long.
        return last is None or not last <= now < last + TIMESTAMP_SECONDS

    def clear(self) -> None:
        """Forgets all last moments."""
        self._last.clear()

    def forget(self, terrain: str) -> None:
        """Forgets the last moment of a terrain."""
        self._last.pop(terrain, None)


def keep(db: Connection, terrain: str, people: Iterable[Person]) -> None:
    """Stores what these people are called now."""
    db.executemany(
        "INSERT INTO people VALUES (?,?,?,?,?,?) ON CONFLICT (terrain, client) DO UPDATE SET name=excluded.name,"
        " colour=excluded.colour, person=excluded.person, conducts=excluded.conducts",
        [(terrain, *person[:4], int(person.conducts)) for person in people],
    )


def read_timestamps(db: Connection, terrain: str, after: int, upto: int) -> list[tuple[int, float]]:
    """Clock and time of the moments that ops with after < clock <= upto need, in order; the first may be earlier."""
    rows = db.execute(
        "SELECT clock, at FROM moments WHERE terrain=?1 AND clock<=?3 AND clock >= coalesce("
        "(SELECT max(clock) FROM moments WHERE terrain=?1 AND clock<=?2), 0) ORDER BY clock",
        (terrain, after + 1, upto),
    )
    return [(int(clock), float(at)) for clock, at in rows]


def read_people(db: Connection, terrain: str) -> dict[str, Person]:
    """Everybody who is the author of an op of the terrain, by client."""
    rows = db.execute("SELECT client, name, colour, person, conducts FROM people WHERE terrain=?", (terrain,))
    return {
        str(client): Person(str(client), str(name), str(colour), person or "", conducts is None or bool(conducts))
        for client, name, colour, person, conducts in rows
    }
