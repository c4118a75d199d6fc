"""Copies of the database, made while it is in use (SQLite's online backup), with the grids that they name.

``backup/esker-<time>.db`` is a copy; ``backup/grids/<digest>`` is a grid that some copy names. The grids there are hard
links to the stored ones where the file system has them: a grid never changes, so a second name for it is a copy that
costs nothing and outlives whatever removes the first name.
"""

from __future__ import annotations

import calendar
import logging
import math
import os
import shutil
import sqlite3
import time
from contextlib import closing, suppress
from pathlib import Path
from typing import Final

log = logging.getLogger("esker.backup")

FOLDER: Final = "backup"
GRIDS: Final = "grids"
KEPT: Final = 5
KEPT_BEFORE: Final = 2
"""Copies of one format that stay from before migrations: one that fails at every start makes a copy each time."""
STAMP: Final = "%Y%m%d-%H%M%S"


class BadCopy(Exception):
    """A copy that was just written cannot be read; it was removed. The message says what is wrong with it."""


def last_backup(directory: Path) -> Path | None:
    """The newest copy, or None."""
    copies = copies_of(directory)
    return copies[-1] if copies else None


def copies_of(directory: Path) -> list[Path]:
    """Every copy of the database in ``directory``, oldest first."""
    return sorted((directory / FOLDER).glob("esker-*.db"))


def write_backup(source: Path, directory: Path, now: float) -> Path:
    """Writes ``backup/esker-<time>.db``, complete or not at all, and keeps the newest five. Raises sqlite3.Error.

    The time in the name is later than that of the copy before, also when the date was set back: the newest copy is the
    last by name, and never the one that is dropped. The copy is opened and read before an older one is dropped: raises
    BadCopy. Raises OSError where a grid cannot be kept.
    """
    folder = directory / FOLDER
    folder.mkdir(exist_ok=True)
    for left in folder.glob("*.part*"):  # a backup that was killed leaves such files, and SQLite its own beside
        left.unlink(missing_ok=True)
    stamp = time.strftime(STAMP, time.gmtime(max(now, _time_of(last_backup(directory)) + 1)))
    target, part = folder / f"esker-{stamp}.db", folder / f"esker-{stamp}.part"
    _copy(source, part)
    try:
        named = _verified(part)
    except sqlite3.Error as error:
        part.unlink(missing_ok=True)
        raise BadCopy(f"the copy {target.name} cannot be read: {error}") from error
    for digest in named:
        take(directory / GRIDS / digest, folder / GRIDS / digest)
    part.replace(target)
    for old in copies_of(directory)[:-KEPT]:
        old.unlink(missing_ok=True)
    _forget_grids(directory)
    return target


def keep_copy(source: Path, directory: Path, reason: str, now: float) -> Path:
    """Copies the database to ``backup/before-<reason>-<time>.db``, which no later backup drops.

    Raises sqlite3.Error.
    """
    folder = directory / FOLDER
    folder.mkdir(exist_ok=True)
    target = folder / f"before-{reason}-{time.strftime(STAMP, time.gmtime(now))}.db"
    part = target.with_suffix(".part")
    _copy(source, part)
    part.replace(target)
    for old in sorted(folder.glob(f"before-{reason}-*.db"))[:-KEPT_BEFORE]:
        old.unlink(missing_ok=True)
    return target


def named_grids(copy: Path) -> set[str]:
    """Digests of the grids that a copy of the database names. Raises sqlite3.Error."""
    with closing(sqlite3.connect(f"{copy.absolute().as_uri()}?mode=ro", uri=True)) as db:
        tables = {str(row[0]) for row in db.execute("SELECT name FROM sqlite_master WHERE type='table'")}
        return {str(row[0]) for row in db.execute("SELECT digest FROM grids")} if "grids" in tables else set()


def take(stored: Path, target: Path) -> None:
    """Gives the files of a stored grid a second name, or copies them where that cannot be. Raises OSError.

    Does nothing when the target is there already, or the stored grid is not: a terrain may lack one.
    """
    if target.is_dir() or not stored.is_dir():
        return
    target.parent.mkdir(parents=True, exist_ok=True)
    part = target.with_name(f".part-{target.name}")
    shutil.rmtree(part, ignore_errors=True)
    part.mkdir()
    for file in stored.iterdir():
        try:
            os.link(file, part / file.name)
        except OSError:
            shutil.copy2(file, part / file.name)
    part.replace(target)


def _copy(source: Path, part: Path) -> None:
    _drop(part)
    try:
        with closing(sqlite3.connect(source)) as live, closing(sqlite3.connect(part)) as copy:
            live.backup(copy)
            # A copy must be one file. Without this line SQLite would want a -wal beside the copy when it is opened.
            copy.execute("PRAGMA journal_mode=DELETE")
    except BaseException:
        _drop(part)  # on a full disk the half would take the room that people need
        raise


def _drop(part: Path) -> None:
    """Removes a half-written copy with SQLite's own files beside it, which would be taken for those of the next."""
    for left in part.parent.glob(f"{part.name}*"):
        left.unlink(missing_ok=True)


def _verified(copy: Path) -> set[str]:
    """The grids that a copy names, once every page of it was read. Raises sqlite3.Error."""
    with closing(sqlite3.connect(f"{copy.absolute().as_uri()}?mode=ro", uri=True)) as db:
        result = str(db.execute("PRAGMA quick_check(1)").fetchone()[0])
    if result != "ok":
        raise sqlite3.DatabaseError(result)
    return named_grids(copy)


def _forget_grids(directory: Path) -> None:
    """Removes the grids of the backup that no copy names any more."""
    folder = directory / FOLDER / GRIDS
    if not folder.is_dir():
        return
    named: set[str] = set()
    for copy in (directory / FOLDER).glob("*.db"):
        try:
            named |= named_grids(copy)
        except sqlite3.Error as error:  # nobody knows which grids a damaged copy named, so all of them stay
            log.warning("%s cannot be read: %s", copy, error)
            return
    for path in folder.iterdir():
        if path.name not in named:
            shutil.rmtree(path, ignore_errors=True)


def _time_of(copy: Path | None) -> float:
    """Seconds since 1970 that the name of a copy says; minus infinity when it says none."""
    with suppress(ValueError):
        if copy is not None:
            return calendar.timegm(time.strptime(copy.stem, f"esker-{STAMP}"))
    return -math.inf
