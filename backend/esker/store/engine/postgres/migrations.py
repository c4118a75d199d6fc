"""Numbered migrations of the shared database: the tables of ``upkeep/migrations.py``, and the leases.

The numbers are those of SQLite's formats, so a store goes from one engine to the other without a change. All steps that
are missing run in one transaction under a lock of the database, so two servers that start at once wait for each other,
and a kill leaves the format before. An older release refuses a newer format, and changes nothing.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Final

import psycopg

from esker.document.wire import compressed
from esker.store.engine.ports import BadDatabase
from esker.store.engine.postgres.connections import Database, connect, first_line, place_of
from esker.store.engine.postgres.dialect import SCHEMA, translated
from esker.store.upkeep.migrations import FORMAT, SWEEP_AFTER

LOCK: Final = 0x65736B6572
"""The key of the lock: "esker" in ASCII."""
FIRST: Final = 8
"""The first format that PostgreSQL has had; what came before was SQLite's alone."""

_FORMAT_8: Final = """
CREATE TABLE esker.server (key text PRIMARY KEY, value text NOT NULL);
CREATE TABLE esker.terrains (id text PRIMARY KEY, created float8 NOT NULL, deleted float8);
CREATE INDEX terrains_deleted ON esker.terrains (deleted) WHERE deleted IS NOT NULL;
CREATE TABLE esker.ops (
  terrain text NOT NULL, clock int8 NOT NULL, client text NOT NULL, counter int8 NOT NULL, author text NOT NULL,
  op text NOT NULL, PRIMARY KEY (terrain, clock));
CREATE UNIQUE INDEX ops_by_id ON esker.ops (terrain, client, counter);
CREATE TABLE esker.snapshots (
  terrain text NOT NULL, clock int8 NOT NULL, document text NOT NULL, PRIMARY KEY (terrain, clock));
CREATE TABLE esker.links (
  id text PRIMARY KEY, terrain text NOT NULL, role text NOT NULL, name text NOT NULL, hash bytea NOT NULL,
  created float8 NOT NULL, revoked float8, parent text);
CREATE INDEX links_by_terrain ON esker.links (terrain, created);
CREATE UNIQUE INDEX links_by_hash ON esker.links (hash);
CREATE INDEX links_by_parent ON esker.links (parent) WHERE parent IS NOT NULL;
CREATE TABLE esker.grids (terrain text NOT NULL, digest text NOT NULL, PRIMARY KEY (terrain, digest));
CREATE TABLE esker.moments (
  terrain text NOT NULL, clock int8 NOT NULL, at float8 NOT NULL, PRIMARY KEY (terrain, clock));
CREATE TABLE esker.people (
  terrain text NOT NULL, client text NOT NULL, name text NOT NULL, colour text NOT NULL, person text, conducts int8,
  PRIMARY KEY (terrain, client));
CREATE TABLE esker.previews (terrain text PRIMARY KEY, token text NOT NULL UNIQUE, shown int8 NOT NULL);
CREATE TABLE esker.folds (
  terrain text NOT NULL, last int8 NOT NULL, first int8 NOT NULL, kept int8 NOT NULL, PRIMARY KEY (terrain, last));
CREATE TABLE esker.folded_ids (
  terrain text NOT NULL, client text NOT NULL, counter int8 NOT NULL, upto int8 NOT NULL, clock int8 NOT NULL,
  PRIMARY KEY (terrain, client, counter));
CREATE TABLE esker.classes (
  id text PRIMARY KEY, terrain text NOT NULL, title text NOT NULL, created float8 NOT NULL, clock int8 NOT NULL,
  document text NOT NULL, together int8 NOT NULL, places int8 NOT NULL, code text, code_until float8, ended float8);
CREATE INDEX classes_by_terrain ON esker.classes (terrain);
CREATE UNIQUE INDEX classes_by_code ON esker.classes (code) WHERE code IS NOT NULL;
CREATE TABLE esker.copies (
  class text NOT NULL, number int8 NOT NULL, terrain text NOT NULL UNIQUE, frozen int8 NOT NULL,
  PRIMARY KEY (class, number));
CREATE TABLE esker.pupils (
  link text PRIMARY KEY, class text NOT NULL, number int8 NOT NULL, name text NOT NULL, joined float8 NOT NULL);
CREATE INDEX pupils_by_class ON esker.pupils (class, number);
CREATE TABLE esker.lessons (terrain text PRIMARY KEY, state text NOT NULL);
CREATE TABLE esker.makers (
  terrain text NOT NULL, thing text NOT NULL, client text NOT NULL, PRIMARY KEY (terrain, thing));
CREATE TABLE esker.codes (
  hash bytea PRIMARY KEY, terrain text NOT NULL, role text NOT NULL, link text NOT NULL, expires float8 NOT NULL,
  until float8 NOT NULL);
CREATE INDEX codes_by_link ON esker.codes (link);
CREATE TABLE esker.nodes (
  name text PRIMARY KEY, address text NOT NULL, weight float8 NOT NULL, until timestamptz NOT NULL);
CREATE TABLE esker.leases (
  terrain text PRIMARY KEY, node text NOT NULL, epoch int8 NOT NULL, until timestamptz NOT NULL)
  WITH (fillfactor = 50);

CREATE FUNCTION esker.json_extract(document text, path text) RETURNS text LANGUAGE sql IMMUTABLE AS
  $$ SELECT replace(document, '\\u0000', '\\ufffd')::json #>> string_to_array(substr(path, 3), '.') $$;

CREATE FUNCTION esker.ops_used_once() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
  IF NEW.clock <= (SELECT last FROM esker.folds WHERE terrain = NEW.terrain ORDER BY last DESC LIMIT 1)
    OR NEW.counter <= (SELECT upto FROM esker.folded_ids WHERE terrain = NEW.terrain AND client = NEW.client
      AND counter <= NEW.counter ORDER BY counter DESC LIMIT 1) THEN
    RAISE unique_violation USING MESSAGE = 'a folded clock or id is used again';
  END IF;
  RETURN NEW;
END $$;
CREATE TRIGGER ops_used_once BEFORE INSERT ON esker.ops FOR EACH ROW EXECUTE FUNCTION esker.ops_used_once();

CREATE FUNCTION esker.terrain_born() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
  INSERT INTO esker.leases VALUES (NEW.id, '', 0, '-infinity') ON CONFLICT DO NOTHING;
  RETURN NEW;
END $$;
CREATE TRIGGER terrain_born AFTER INSERT ON esker.terrains FOR EACH ROW EXECUTE FUNCTION esker.terrain_born();
CREATE FUNCTION esker.terrain_gone() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
  DELETE FROM esker.leases WHERE terrain = OLD.id;
  RETURN OLD;
END $$;
CREATE TRIGGER terrain_gone AFTER DELETE ON esker.terrains FOR EACH ROW EXECUTE FUNCTION esker.terrain_gone();
"""
"""``leases``: who has a terrain, in which taking, and until when by the database's clock; a row for every terrain, so
that a write for one that nobody has can lock it. ``nodes``: the servers."""

_FORMAT_9: Final = ""
"""No table changes (``upkeep/migrations.py``)."""

_FORMAT_10: Final = """
ALTER TABLE esker.terrains ADD title text;
UPDATE esker.terrains t SET title = (
  SELECT esker.json_extract(document, '$.settings.title') FROM esker.snapshots s WHERE s.terrain = t.id
  ORDER BY clock DESC LIMIT 1);
DROP FUNCTION esker.json_extract;
ALTER TABLE esker.snapshots ALTER document TYPE bytea USING convert_to(document, 'UTF8');
ALTER TABLE esker.classes ALTER document TYPE bytea USING convert_to(document, 'UTF8');
"""


def _compress(db: Database) -> None:
    """Compresses documents one by one: there may be gigabytes of them."""
    _script(db, _FORMAT_10)
    for table, key in (("snapshots", "terrain,clock"), ("classes", "id")):
        where = f"({key}) = ({','.join('?' * len(key.split(',')))})"
        read = translated(f"SELECT document FROM {table} WHERE {where}")
        write = translated(f"UPDATE {table} SET document=? WHERE {where}")
        for row in db.execute(translated(f"SELECT {key} FROM {table}")).fetchall():
            (text,) = db.execute(read, row).fetchall()[0]
            db.execute(write, (compressed(text.decode()), *row))


Step = str | Callable[[Database], None]
STEPS: Final[dict[int, Step]] = {FIRST: _FORMAT_8, 9: _FORMAT_9, 10: _compress}
"""What makes the format of this number of the one before, statements or a function; the first makes it of nothing."""


def format_of(db: Database) -> int:
    """The format of a database; 0 where there is none of Esker's."""
    there = db.execute("SELECT to_regclass($1)", (f"{SCHEMA}.server",)).fetchone()
    if there is None or there[0] is None:
        return 0
    row = db.execute(f"SELECT value FROM {SCHEMA}.server WHERE key='format'").fetchone()
    return 0 if row is None else int(row[0])


def migrate(url: str, now: float | None = None) -> None:
    """Brings a database to the present format. Raises Unreachable, BadDatabase."""
    with connect(url) as db:
        try:
            with db.transaction():
                db.execute("SELECT pg_advisory_xact_lock($1)", (LOCK,))
                _migrate(db, url, time.time() if now is None else now)
        except psycopg.Error as error:
            raise BadDatabase(f"The database {place_of(url)} cannot be prepared: {first_line(error)}.") from error


def _migrate(db: Database, url: str, now: float) -> None:
    present = format_of(db)
    if present > FORMAT:
        raise BadDatabase(
            f"The database {place_of(url)} is of a newer Esker (format {present}, this one knows {FORMAT}). Nothing "
            "was changed. Start the newer release, or name another database."
        )
    if present == FORMAT:
        return
    if not present:
        db.execute(f"CREATE SCHEMA IF NOT EXISTS {SCHEMA}")
    for number, step in sorted(STEPS.items()):
        if number > present and step:
            _script(db, step) if isinstance(step, str) else step(db)
    state = f"INSERT INTO {SCHEMA}.server VALUES ($1,$2) ON CONFLICT (key) DO UPDATE SET value=excluded.value"
    db.execute(state, ("format", str(FORMAT)))
    if not present:
        db.execute(state, ("swept_from", str(now + SWEEP_AFTER)))


def _script(db: Database, text: str) -> None:
    """Runs statements that take no values, all of them at once."""
    psycopg.Cursor(db).execute(text.encode())
