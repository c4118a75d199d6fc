"""Copies of the database, made while it is in use (SQLite's online backup)."""

from __future__ import annotations

import calendar
import math
import sqlite3
import time
from contextlib import closing
from pathlib import Path
from typing import Final

FOLDER: Final = "backup"
KEPT: Final = 5
STAMP: Final = "%Y%m%d-%H%M%S"


def last_backup(directory: Path) -> Path | None:
    """The newest copy, or None."""
    copies = _copies(directory)
    return copies[-1] if copies else None


def write_backup(source: Path, directory: Path, now: float) -> Path:
    """Writes ``backup/esker-<time>.db``, complete or not at all, and keeps the newest five. Raises sqlite3.Error.

    The time in the name is later than that of the copy before, also when the date was set back: the newest copy is the
    last by name, and never the one that is dropped.
    """
    folder = directory / FOLDER
    folder.mkdir(exist_ok=True)
    stamp = time.strftime(STAMP, time.gmtime(max(now, _time_of(last_backup(directory)) + 1)))
    target, part = folder / f"esker-{stamp}.db", folder / f"esker-{stamp}.part"
    part.unlink(missing_ok=True)
    with closing(sqlite3.connect(source)) as live, closing(sqlite3.connect(part)) as copy:
        live.backup(copy)
        # A copy must be one file: without this it would want a -wal beside it when it is opened.
        copy.execute("PRAGMA journal_mode=DELETE")
    part.replace(target)
    for old in _copies(directory)[:-KEPT]:
        old.unlink(missing_ok=True)
    return target


def _time_of(copy: Path | None) -> float:
    """Seconds since 1970 that the name of a copy says; minus infinity when it says none."""
    try:
        return calendar.timegm(time.strptime(copy.stem, f"esker-{STAMP}")) if copy is not None else -math.inf
    except ValueError:
        return -math.inf


def _copies(directory: Path) -> list[Path]:
    return sorted((directory / FOLDER).glob("esker-*.db"))
