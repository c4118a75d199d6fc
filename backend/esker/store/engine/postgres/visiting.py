"""A shared database for a program that passes by: it reads, writes now and then, and has no terrain."""

from __future__ import annotations

from esker.store.engine.ports import BadDatabase
from esker.store.engine.postgres import migrations
from esker.store.engine.postgres.connections import connect, place_of
from esker.store.engine.postgres.engine import Postgres
from esker.store.upkeep.migrations import FORMAT


class _Nobody:
    """Whoever passes by owns no terrain."""

    def right(self, terrain: str) -> None:
        """Returns None."""

    def fenced(self, terrain: str) -> None:
        """Nothing was taken from who had nothing."""


def visited(url: str) -> Postgres:
    """The engine, for writes that no lease fences: those that name no terrain.

    Servers bring a database to their format; a visit changes nothing of one that has another. Raises BadDatabase,
    engine.ports.Unreachable.
    """
    with connect(url) as db:
        found = migrations.format_of(db)
    place = place_of(url)
    if found == 0:
        raise BadDatabase(f"No server has kept anything in the database {place}.")
    if found < FORMAT:
        raise BadDatabase(f"The database {place} is of an older Esker: start the server once.")
    if found > FORMAT:
        raise BadDatabase(f"The database {place} is of a newer Esker.")
    return Postgres(url, _Nobody())
