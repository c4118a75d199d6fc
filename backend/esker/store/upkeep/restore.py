"""Putting a copy of the database in the place of one that is damaged or lost (``esker restore``).

SQLite keeps the newest pages of a database in a log beside it (``esker.db-wal``). A copy that is put in the place of
the database alone meets the old log, whose pages are then played over it: all three files go aside together.
"""

from __future__ import annotations

import shutil
import sqlite3
import time
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from esker.process import system
from esker.store.engine.lock import DataLock
from esker.store.grids import GridStore
from esker.store.upkeep import migrations
from esker.store.upkeep.backup import FOLDER, GRIDS, STAMP, copies_of, named_grids, take
from esker.store.upkeep.inspection import DATABASE_NAME, problem_of


class CannotRestore(Exception):
    """Nothing was changed; the message says why."""


@dataclass(frozen=True)
class Restored:
    """What a restore did. ``aside``: the folder with the files that were there before, or None where none were."""

    copy: Path
    aside: Path | None
    terrains: int
    ops: int
    missing_grids: tuple[str, ...]


def restore(data: Path, copy: Path | None = None, now: float | None = None) -> Restored:
    """Puts ``copy`` (default: the newest that can be read) in the place of the database of the folder ``data``.

    The files of the present database are moved to ``data/aside-<time>``; nothing is deleted. Grids that the copy names
    come back from the backup or the trash. Killed at any moment it can be called again: without a database the server
    does not start. Raises CannotRestore, store.engine.lock.InUse, OSError.
    """
    now = time.time() if now is None else now
    if not data.is_dir():
        raise CannotRestore(f"There is no folder {data}.")
    lock = DataLock(data)
    try:
        chosen = _chosen(data, copy)
        part = data / f"{DATABASE_NAME}.part"
        # With what a killed restore left beside it: SQLite would take its journal for that of the new copy.
        for left in data.glob(f"{part.name}*"):
            left.unlink(missing_ok=True)
        shutil.copyfile(chosen, part)
        with closing(sqlite3.connect(part, isolation_level=None)) as db:
            migrations.migrate(db, lambda _: None)
            migrations.state(db, "swept_from", str(now + migrations.SWEEP_AFTER))
            terrains, ops = (db.execute(f"SELECT count(*) FROM {table}").fetchone()[0] for table in ("terrains", "ops"))
        if problem := problem_of(part):
            raise CannotRestore(f"What was made of {chosen} cannot be read ({problem}).")
        system.sync(part)
        aside = _put_aside(data, now)
        part.replace(data / DATABASE_NAME)
        system.sync(data)
        return Restored(chosen, aside, terrains, ops, tuple(_grids_back(data, named_grids(data / DATABASE_NAME))))
    finally:
        lock.release()


def _chosen(data: Path, copy: Path | None) -> Path:
    if copy is not None:
        if not copy.is_file():
            raise CannotRestore(f"There is no file {copy}.")
        if problem := problem_of(copy):
            raise CannotRestore(f"{copy} cannot be used: {problem}.")
        return copy
    refused = []
    for candidate in reversed(copies_of(data)):
        if not (problem := problem_of(candidate)):
            return candidate
        refused.append(f"{candidate.name} ({problem})")
    there = f": {', '.join(refused)}" if refused else ""
    raise CannotRestore(f"There is no copy in {data / FOLDER} that can be read{there}.")


def _put_aside(data: Path, now: float) -> Path | None:
    """Moves the three files of the present database to a folder of their own."""
    present = [path for suffix in ("", "-wal", "-shm") if (path := data / (DATABASE_NAME + suffix)).exists()]
    if not present:
        return None
    stamp, number = time.strftime(STAMP, time.gmtime(now)), 1
    aside = data / f"aside-{stamp}"
    while aside.exists():
        number += 1
        aside = data / f"aside-{stamp}-{number}"
    aside.mkdir()
    # The log goes first: a kill in between leaves a database without its newest ops, never a log over another database.
    for path in reversed(present):
        path.rename(aside / path.name)
    system.sync(aside)
    system.sync(data)
    return aside


def _grids_back(data: Path, named: set[str]) -> list[str]:
    """Brings back what the database names; the digests that are nowhere."""
    store = GridStore(data)
    store.bring_back(named)
    for digest in named:
        take(data / FOLDER / GRIDS / digest, store.path(digest))
    return sorted(digest for digest in named if not store.has(digest))
