"""Copies of the database, made while it is in use (SQLite's online backup)."""

from __future__ import annotations

import sqlite3
import time
from contextlib import closing
from pathlib import Path
from typing import Final

FOLDER: Final = "backup"
KEPT: Final = 5


def last_backup(directory: Path) -> Path | None:
    """The newest copy, or None."""
    copies = _copies(directory)
    return copies[-1] if copies else None


def write_backup(source: Path, directory: Path, now: float) -> Path:
    """Writes ``backup/esker-<time>.db``, complete or not at all, and keeps the newest five. Raises sqlite3.Error."""
    folder = directory / FOLDER
    folder.mkdir(exist_ok=True)
    stamp = time.strftime("%Y%m%d-%H%M%S", time.gmtime(now))
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


def _copies(directory: Path) -> list[Path]:
    return sorted((directory / FOLDER).glob("esker-*.db"))
