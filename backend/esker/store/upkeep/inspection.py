"""Whether a database can be used: looked at before it is opened, without writing to it."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Final

from esker.store.upkeep import migrations
from esker.store.upkeep.backup import FOLDER as BACKUPS
from esker.store.upkeep.backup import copies_of, last_backup

DATABASE_NAME: Final = "esker.db"


class CorruptDatabase(Exception):
    """The database file is damaged. It is left exactly as it is; the message names the last good copy."""


class MissingDatabase(CorruptDatabase):
    """There is no database, but what one left behind. Nothing is made or removed; the message says what to do."""


def check(path: Path, directory: Path) -> None:
    """Reads the whole file without writing to it.

    Raises CorruptDatabase, with a sentence that says what to do: also where there is no file, but copies or grids are.
    """
    if not path.exists():
        if left := left_behind(directory):
            advice = (
                f"`esker restore --data {directory}` goes on with the newest good copy. "
                if last_backup(directory)
                else ""
            )
            raise MissingDatabase(
                f"There is no database {path}, but {left}. Nothing was made or removed. {advice}"
                "To begin anew, choose another folder with --data, or move what is there away."
            )
        return
    if problem := problem_of(path):
        good = last_backup(directory)
        hint = f"The last good copy is {good}." if good else "There is no earlier copy in the backup folder."
        advice = f"`esker restore --data {directory}` keeps the file aside and goes on with the copy." if good else ""
        raise CorruptDatabase(f"The database {path} cannot be read ({problem}). It was left untouched. {hint} {advice}")


def left_behind(directory: Path) -> str:
    """Returns what a lost database left in its folder, in words; empty when there is nothing."""
    grids = sum(1 for path in (directory / "grids").glob("*") if path.is_dir() and not path.name.startswith("."))
    copies = len(copies_of(directory))
    log = directory / f"{DATABASE_NAME}-wal"
    found = [
        f"{copies} cop{'y' if copies == 1 else 'ies'} of one in {directory / BACKUPS}" if copies else "",
        f"{grids} elevation grid{'' if grids == 1 else 's'}" if grids else "",
        "the write-ahead log of one" if log.exists() and log.read_bytes().strip(b"\0") else "",
    ]
    return " and ".join(part for part in found if part)


def problem_of(path: Path) -> str:
    """Returns what is wrong with a database file, in words; empty when it can be used. Reads it, and writes nothing."""
    try:
        with closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True)) as db:
            result = db.execute("PRAGMA quick_check(1)").fetchone()[0]
            version = migrations.format_of(db)
    except sqlite3.DatabaseError as error:
        return str(error)
    if result != "ok":
        return str(result)
    return f"it was written by a newer Esker (format {version})" if version > migrations.FORMAT else ""
