"""Deleting terrains: marked first, by an owner or because nobody ever drew on one; removed after a time of grace.

A deleted terrain opens for nobody, and within ``GRACE_SECONDS`` its owners bring it back whole. After that its rows go,
a few at a time so that nobody's commit waits for them; the grids that only it named are swept at the next start
(``store/grids.py``), and copies of the database hold it until they are dropped.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import Future
from typing import Final

from esker.store import classes
from esker.store.engine.ports import Connection
from esker.store.journal import Journal

GRACE_SECONDS: Final = 7 * 86_400.0
UNTOUCHED_SECONDS: Final = 30 * 86_400.0
"""A terrain without one operation and without real ground is nobody's after this time."""
ROWS_AT_A_TIME: Final = 500
TABLES: Final = (
    "ops", "snapshots", "folds", "folded_ids", "grids", "links", "moments", "people", "previews", "lessons", "makers"
)  # fmt: skip
"""All that has rows by terrain; ``terrains`` itself goes last."""


class Deletion:
    """Marks, brings back and removes terrains of one journal."""

    def __init__(self, journal: Journal, now: Callable[[], float] = time.time) -> None:
        self._journal, self._now = journal, now

    def deleted(self, terrain: str) -> float | None:
        """Returns when a terrain was deleted, seconds since 1970; None when it was not, or is not there."""
        row = self._journal.reader().execute("SELECT deleted FROM terrains WHERE id=?", (terrain,)).fetchone()
        return None if row is None or row[0] is None else float(row[0])

    def delete(self, terrain: str) -> Future[float]:
        """Marks a terrain; the future gives when it will be gone. It fails with store.journal.Unwritable."""
        now = self._now()

        def write(db: Connection) -> float:
            db.execute("UPDATE terrains SET deleted=? WHERE id=? AND deleted IS NULL", (now, terrain))
            row = db.execute("SELECT deleted FROM terrains WHERE id=?", (terrain,)).fetchone()
            return GRACE_SECONDS + (now if row is None else float(row[0]))

        return self._journal.submit(write, terrain)

    def bring_back(self, terrain: str) -> Future[bool]:
        """Takes the mark away; the future gives False when there was none. It fails with store.journal.Unwritable."""

        def write(db: Connection) -> bool:
            changed = db.execute("UPDATE terrains SET deleted=NULL WHERE id=? AND deleted IS NOT NULL", (terrain,))
            return changed.rowcount > 0

        return self._journal.submit(write, terrain)

    def expire(self) -> Future[int]:
        """Marks terrains that nobody ever drew on; the future gives how many. Classes without copies go for good."""
        now = self._now()

        def write(db: Connection) -> int:
            classes.forget_empty(db, now - GRACE_SECONDS)
            changed = db.execute(
                "UPDATE terrains SET deleted=?1 WHERE deleted IS NULL AND created < ?2"
                " AND NOT EXISTS (SELECT 1 FROM ops WHERE ops.terrain = terrains.id)"
                " AND NOT EXISTS (SELECT 1 FROM grids WHERE grids.terrain = terrains.id)",
                (now, now - UNTOUCHED_SECONDS),
            )
            return changed.rowcount

        return self._journal.submit(write)

    def remove_old(self) -> list[str]:
        """Removes what was deleted longer ago than the grace; blocks until it is done. Returns the terrains' ids."""
        overdue = self._journal.reader().execute(
            "SELECT id FROM terrains WHERE deleted < ? ORDER BY deleted", (self._now() - GRACE_SECONDS,)
        )
        gone = [str(row[0]) for row in overdue.fetchall()]
        for terrain in gone:
            for table in TABLES:
                while self._journal.submit(_some(table, terrain), terrain).result():
                    pass
            self._journal.submit(_last(terrain), terrain).result()
        return gone


def _last(terrain: str) -> Callable[[Connection], None]:
    """Removes what says that a terrain was there."""

    def write(db: Connection) -> None:
        classes.forget(db, terrain)
        db.execute("DELETE FROM terrains WHERE id=?", (terrain,))

    return write


def _some(table: str, terrain: str) -> Callable[[Connection], int]:
    """Removes a few rows of a table without row ids, by its primary key; says how many."""
    key = {"ops": "clock", "snapshots": "clock", "folds": "last", "grids": "digest", "links": "id", "moments": "clock"}
    key |= {"makers": "thing", "previews": "terrain", "lessons": "terrain"}
    column = key.get(table, "client")
    sql = (
        f"DELETE FROM {table} WHERE terrain=?1 AND {column} IN"
        f" (SELECT {column} FROM {table} WHERE terrain=?1 LIMIT {ROWS_AT_A_TIME})"
    )
    return lambda db: db.execute(sql, (terrain,)).rowcount
