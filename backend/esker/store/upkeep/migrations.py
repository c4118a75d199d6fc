"""Numbered migrations: how a database of any released format becomes one of the present format.

Formats only go forward. Each step runs in a transaction of its own that also writes the new number, so a kill leaves
the format before the step or the one after it. A copy of the database is kept before the first step. A database of a
newer format than this build knows is refused at the start and not one byte of it changes (``store/journal.py``).

To change what the tables are: append a step to ``STEPS``, and write a database of the present release to
``tests/databases/`` first (``tests/databases/make.py``), so that every released format stays tested.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Callable
from typing import Final

from esker.document.wire import compressed
from esker.store.engine.ports import Connection

SWEEP_AFTER: Final = 30 * 86_400.0
"""Seconds for which a new or restored database lets every stored grid be (``store/grids.py``)."""

_FORMAT_1: Final = """
CREATE TABLE IF NOT EXISTS terrains (id TEXT PRIMARY KEY, created REAL NOT NULL) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS ops (
  terrain TEXT NOT NULL, clock INTEGER NOT NULL, client TEXT NOT NULL, counter INTEGER NOT NULL,
  author TEXT NOT NULL, op TEXT NOT NULL, PRIMARY KEY (terrain, clock)) WITHOUT ROWID;
CREATE UNIQUE INDEX IF NOT EXISTS ops_by_id ON ops (terrain, client, counter);
CREATE TABLE IF NOT EXISTS snapshots (
  terrain TEXT NOT NULL, clock INTEGER NOT NULL, document TEXT NOT NULL, PRIMARY KEY (terrain, clock)) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS links (
  id TEXT PRIMARY KEY, terrain TEXT NOT NULL, role TEXT NOT NULL, name TEXT NOT NULL, hash BLOB NOT NULL,
  created REAL NOT NULL, revoked REAL) WITHOUT ROWID;
CREATE INDEX IF NOT EXISTS links_by_terrain ON links (terrain, created);
CREATE UNIQUE INDEX IF NOT EXISTS links_by_hash ON links (hash);
"""
_FORMAT_2: Final = """
CREATE TABLE IF NOT EXISTS grids (
  terrain TEXT NOT NULL, digest TEXT NOT NULL, PRIMARY KEY (terrain, digest)) WITHOUT ROWID;
"""
_FORMAT_3: Final = """
CREATE TABLE IF NOT EXISTS moments (
  terrain TEXT NOT NULL, clock INTEGER NOT NULL, at REAL NOT NULL, PRIMARY KEY (terrain, clock)) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS people (
  terrain TEXT NOT NULL, client TEXT NOT NULL, name TEXT NOT NULL, colour TEXT NOT NULL,
  PRIMARY KEY (terrain, client)) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS previews (
  terrain TEXT PRIMARY KEY, token TEXT NOT NULL UNIQUE, shown INTEGER NOT NULL) WITHOUT ROWID;
CREATE TABLE server (key TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID;
"""
"""``server``: facts about this database as a whole. ``swept_from``: seconds since 1970 before which no stored grid is
taken for forgotten (``store/grids.py``); a database that is new or restored does not know all that people brought."""

_FORMAT_4: Final = """
ALTER TABLE links ADD COLUMN parent TEXT;
CREATE INDEX links_by_parent ON links (parent) WHERE parent IS NOT NULL;
"""
"""``parent``: the id of the link through which a link was made, also by a join code; of older ones it is not known."""

_FORMAT_5: Final = """
ALTER TABLE terrains ADD COLUMN deleted REAL;
CREATE INDEX terrains_deleted ON terrains (deleted) WHERE deleted IS NOT NULL;
"""
"""``deleted``: when a terrain was deleted, seconds since 1970 (``store/upkeep/deletion.py``)."""

_FORMAT_6: Final = """
CREATE TABLE folds (
  terrain TEXT NOT NULL, last INTEGER NOT NULL, first INTEGER NOT NULL, kept INTEGER NOT NULL,
  PRIMARY KEY (terrain, last)) WITHOUT ROWID;
CREATE TABLE folded_ids (
  terrain TEXT NOT NULL, client TEXT NOT NULL, counter INTEGER NOT NULL, upto INTEGER NOT NULL, clock INTEGER NOT NULL,
  PRIMARY KEY (terrain, client, counter)) WITHOUT ROWID;
"""
_USED_ONCE: Final = """
CREATE TRIGGER ops_used_once BEFORE INSERT ON ops WHEN
  NEW.clock <= (SELECT last FROM folds WHERE terrain=NEW.terrain ORDER BY last DESC LIMIT 1)
  OR NEW.counter <= (SELECT upto FROM folded_ids WHERE terrain=NEW.terrain AND client=NEW.client
    AND counter<=NEW.counter ORDER BY counter DESC LIMIT 1)
BEGIN SELECT RAISE(ABORT, 'a folded clock or id is used again'); END
"""
"""What was folded (``store/upkeep/folds.py``). ``folds``: clocks ``first`` to ``last``, ``kept`` of which have an op.
``folded_ids``: ops ``counter`` to ``upto`` of a client, which now stand at ``clock``. The trigger keeps what the keys
of ``ops`` kept: a clock and an id are used once."""

_CLASSES: Final = """
CREATE TABLE classes (
  id TEXT PRIMARY KEY, terrain TEXT NOT NULL, title TEXT NOT NULL, created REAL NOT NULL, clock INTEGER NOT NULL,
  document TEXT NOT NULL, together INTEGER NOT NULL, places INTEGER NOT NULL, code TEXT, code_until REAL, ended REAL);
CREATE INDEX classes_by_terrain ON classes (terrain);
CREATE UNIQUE INDEX classes_by_code ON classes (code) WHERE code IS NOT NULL;
CREATE TABLE copies (
  class TEXT NOT NULL, number INTEGER NOT NULL, terrain TEXT NOT NULL UNIQUE, frozen INTEGER NOT NULL,
  PRIMARY KEY (class, number)) WITHOUT ROWID;
CREATE TABLE pupils (
  link TEXT PRIMARY KEY, class TEXT NOT NULL, number INTEGER NOT NULL, name TEXT NOT NULL, joined REAL NOT NULL)
  WITHOUT ROWID;
CREATE INDEX pupils_by_class ON pupils (class, number);
"""
"""Classes (``store/classes.py``). ``document``: what a copy begins as, at the clock ``clock`` of ``terrain``.
``code``: opens the class until ``code_until``, seconds since 1970. A pupil is a device: its link opens its copy."""


_FORMAT_7: Final = """
CREATE TABLE lessons (terrain TEXT PRIMARY KEY, state TEXT NOT NULL) WITHOUT ROWID;
CREATE TABLE makers (
  terrain TEXT NOT NULL, thing TEXT NOT NULL, client TEXT NOT NULL, PRIMARY KEY (terrain, thing)) WITHOUT ROWID;
ALTER TABLE people ADD COLUMN person TEXT;
ALTER TABLE people ADD COLUMN conducts INTEGER;
"""
"""``lessons``: how the lesson of a terrain stands. ``makers``: the client by which a stroke or a layer came
(``store/lessons.py``). ``people``: who a client is over reloads, and whether they conducted."""

_FORMAT_8: Final = ""
"""No table changes: ops and documents may hold tasks, which an Esker of before would take for damage."""

_FORMAT_9: Final = ""
"""No table changes: the state of a lesson may hold groups. An Esker of before could not read it and would lift every
switch of that lesson."""

_FORMAT_10: Final = """
ALTER TABLE terrains ADD COLUMN title TEXT;
UPDATE terrains SET title=(
  SELECT json_extract(document, '$.settings.title') FROM snapshots WHERE terrain=id ORDER BY clock DESC LIMIT 1);
UPDATE snapshots SET document=compressed(document);
UPDATE classes SET document=compressed(document);
"""
"""Documents are compressed (``document.wire``). Their columns are still declared as text: SQLite keeps bytes as bytes.
``title``: of the newest snapshot of a terrain."""


def _script(text: str) -> Callable[[sqlite3.Connection], None]:
    def run(db: sqlite3.Connection) -> None:
        for statement in text.split(";"):
            if statement.strip():
                db.execute(statement)

    return run


def _folding(db: sqlite3.Connection) -> None:
    _script(_FORMAT_6)(db)
    db.execute(_USED_ONCE)  # the statement has a semicolon inside, at which a script would be cut


def _compressing(db: sqlite3.Connection) -> None:
    db.create_function("compressed", 1, compressed, deterministic=True)
    _script(_FORMAT_10)(db)


STEPS: Final[tuple[Callable[[sqlite3.Connection], None], ...]] = (
    _script(_FORMAT_1),
    _script(_FORMAT_2),  # elevation layers
    _script(_FORMAT_3),  # what was made beside the formats before they were numbered, and facts about the whole
    _script(_FORMAT_4),  # links know their parent
    _script(_FORMAT_5),  # terrains can be deleted
    _folding,  # bursts of ops are folded
    _script(_FORMAT_7 + ";" + _CLASSES),  # lessons, classes and their copies
    _script(_FORMAT_8),  # tasks
    _script(_FORMAT_9),  # groups of a lesson
    _compressing,  # documents are compressed
)
"""``STEPS[n]`` makes format n + 1 of format n; an empty file has format 0."""
FORMAT: Final = len(STEPS)
"""The format that this build reads and writes (SQLite's ``user_version``)."""


def format_of(db: sqlite3.Connection) -> int:
    """The format of an open database; 0 for an empty file."""
    return int(db.execute("PRAGMA user_version").fetchone()[0])


def migrate(db: sqlite3.Connection, keep: Callable[[int], object]) -> None:
    """Brings the database, in autocommit mode, to the present format. Raises sqlite3.Error.

    ``keep`` is called once with the old format before a database that holds anything changes: it keeps a copy.
    """
    present = format_of(db)
    if 0 < present < FORMAT:
        keep(present)
    for number in range(present, FORMAT):
        db.execute("BEGIN IMMEDIATE")
        try:
            STEPS[number](db)
            db.execute(f"PRAGMA user_version={number + 1}")
            db.execute("COMMIT")
        except BaseException:
            if db.in_transaction:
                db.execute("ROLLBACK")
            raise


def fact(db: Connection, key: str) -> str | None:
    """A fact about the database as a whole, or None."""
    row = db.execute("SELECT value FROM server WHERE key=?", (key,)).fetchone()
    return None if row is None else str(row[0])


def state(db: Connection, key: str, value: str) -> None:
    """Writes a fact about the database as a whole."""
    db.execute("INSERT INTO server VALUES (?,?) ON CONFLICT (key) DO UPDATE SET value=excluded.value", (key, value))
