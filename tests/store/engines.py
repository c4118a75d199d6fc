"""Engines under journals: for tests that ask both the same, and for those that look below the ports."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import psycopg

from bench.cluster._postgres import Postgres as Server
from esker.store.engine.leases import Lease
from esker.store.engine.postgres import dialect, migrations
from esker.store.engine.postgres.engine import Postgres
from esker.store.engine.sqlite import Sqlite
from esker.store.journal import Journal
from esker.store.upkeep.migrations import FORMAT

ENGINES: Final = ("sqlite", "postgres")


class Database:
    """A PostgreSQL server that gives databases of the present format."""

    def __init__(self) -> None:
        self.server = Server()
        self._made = self.server.database()
        self._free: list[str] = []
        self._given: list[str] = []
        migrations.migrate(self._made, 0.0)

    def __enter__(self) -> Database:
        return self

    def __exit__(self, *_: object) -> None:
        self.server.close()

    def new(self) -> str:
        """An empty database of the present format, that is old enough to sweep."""
        url = self._free.pop() if self._free else self.server.database(like=self._made)
        self._given.append(url)
        return url

    def take_back(self) -> None:
        """Empties the databases that were given: one of hundreds of files takes long to make and to remove."""
        tables = ", ".join(f"{dialect.SCHEMA}.{name}" for name in (*dialect.TABLES, "nodes", "leases"))
        while self._given:
            url = self._given.pop()
            with psycopg.connect(url, autocommit=True) as db:
                db.execute("SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE datname = current_database()"
                           " AND pid <> pg_backend_pid()")  # fmt: skip
                db.execute(f"TRUNCATE {tables}".encode())
                facts = [("format", str(FORMAT)), ("swept_from", "0")]
                db.cursor().executemany("INSERT INTO esker.server VALUES (%s, %s)", facts)
            self._free.append(url)


class Holding:
    """The terrains that a test says a server owns."""

    def __init__(self) -> None:
        self.leases: dict[str, Lease] = {}
        self.lost: list[str] = []

    def right(self, terrain: str) -> tuple[str, int] | None:
        found = self.leases.get(terrain)
        return None if found is None else (terrain, found.epoch)

    def fenced(self, terrain: str) -> None:
        self.lost.append(terrain)


class Store:
    """Journals over one place, one after the other."""

    def __init__(self, folder: Path, database: Database | None) -> None:
        """``database``: None for SQLite in the folder."""
        self.folder = folder
        self.url = None if database is None else database.new()
        self._open: list[Journal] = []

    def open(self, now: Callable[[], float] = time.time, **more: Any) -> Journal:
        """A journal over what is there. Close it before another one is opened."""
        engine = None if self.url is None else Postgres(self.url, Holding())
        self._open.append(Journal(self.folder, now, engine=engine, **more))
        return self._open[-1]

    def close(self) -> None:
        """Closes what a test left open."""
        for journal in self._open:
            journal.close()


def sqlite(journal: Journal) -> Sqlite:
    """The engine of a journal that lies in a folder."""
    assert isinstance(journal.engine, Sqlite)
    return journal.engine


def copied(journal: Journal) -> Path:
    """A copy of such a journal."""
    made = journal.backup()
    assert made is not None
    return made


def postgres(journal: Journal) -> Postgres:
    """The engine of a journal that lies in a shared database."""
    assert isinstance(journal.engine, Postgres)
    return journal.engine
