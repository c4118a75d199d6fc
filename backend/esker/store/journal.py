"""The journal: append-only ops with the clock as key, in SQLite (DESIGN 13).

WAL mode, ``synchronous=FULL``. One writer thread serves all rooms: whatever is queued when a commit ends goes into
the next one (group commit), each item under its own savepoint, so one refused item does not undo the others. An op is
acknowledged after the commit that holds it, so ``kill -9`` loses nothing that was acknowledged.

Tables: ``terrains`` (id, created), ``ops`` (terrain, clock, client, counter, author, op), ``snapshots`` (terrain,
clock, document), ``grids`` (terrain, digest: every grid that a layer of the terrain ever was, written in the same
commit as the op or the birth that names it); ``store/access.py`` and ``store/moments.py`` add their own. Ops are never
removed: any clock can be opened again.
"""

from __future__ import annotations

import os
import queue
import sqlite3
import threading
import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Future
from contextlib import closing, suppress
from pathlib import Path
from typing import Any, Final, NamedTuple, TypeVar

from esker import contract as c
from esker.document.ops import Limits, Refusal, StrokeSet
from esker.store import moments
from esker.store.backup import last_backup, write_backup

T = TypeVar("T")

DATABASE_NAME: Final = "esker.db"
SNAPSHOT_EVERY: Final = 500
"""Ops between snapshots: opening a terrain replays at most this many."""
MILESTONES: Final = 8
"""Snapshots that stay, spread over the history: an earlier clock is opened without replaying all before it."""
GROUP_LIMIT: Final = 256
"""Most queued items that one commit takes."""
LOG_BYTES: Final = 5 << 20
"""How long the write-ahead log is from the start: more than the 1,000 pages after which it is begun anew."""
_SCHEMA_VERSION: Final = 2
"""1 knew no elevation layers; it becomes 2 by itself."""
_SCHEMA: Final = """
CREATE TABLE IF NOT EXISTS terrains (id TEXT PRIMARY KEY, created REAL NOT NULL) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS ops (
  terrain TEXT NOT NULL, clock INTEGER NOT NULL, client TEXT NOT NULL, counter INTEGER NOT NULL,
  author TEXT NOT NULL, op TEXT NOT NULL, PRIMARY KEY (terrain, clock)) WITHOUT ROWID;
CREATE UNIQUE INDEX IF NOT EXISTS ops_by_id ON ops (terrain, client, counter);
CREATE TABLE IF NOT EXISTS snapshots (
  terrain TEXT NOT NULL, clock INTEGER NOT NULL, document TEXT NOT NULL, PRIMARY KEY (terrain, clock)) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS grids (
  terrain TEXT NOT NULL, digest TEXT NOT NULL, PRIMARY KEY (terrain, digest)) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS links (
  id TEXT PRIMARY KEY, terrain TEXT NOT NULL, role TEXT NOT NULL, name TEXT NOT NULL, hash BLOB NOT NULL,
  created REAL NOT NULL, revoked REAL) WITHOUT ROWID;
CREATE INDEX IF NOT EXISTS links_by_terrain ON links (terrain, created);
CREATE UNIQUE INDEX IF NOT EXISTS links_by_hash ON links (hash);
"""


class CorruptDatabase(Exception):
    """The database file is damaged. It is left exactly as it is; the message names the last good copy."""


class Unwritable(Exception):
    """The database cannot be written to at present. Of what was asked nothing was done; it may be asked again later."""

    def __init__(self, error: sqlite3.OperationalError) -> None:
        super().__init__(str(error))
        self.full = error.sqlite_errorcode == sqlite3.SQLITE_FULL
        """Whether it is for want of room."""


class DamagedTerrain(Exception):
    """The journal of one terrain does not replay (a gap, or an op that does not apply)."""


class Row(NamedTuple):
    """One op as it is stored. ``op`` is its JSON text; the op's id is ``client:counter``."""

    clock: int
    client: str
    counter: int
    author: str
    op: str

    def ordered_json(self) -> str:
        """The JSON text of the ``OrderedOp``."""
        return ordered_json(self.clock, f"{self.client}:{self.counter}", self.author, self.op)


def ordered_json(clock: int, op_id: str, author: str, op: str) -> str:
    """The JSON text of an ``OrderedOp`` around the already encoded op: ids and authors are plain client ids."""
    return f'{{"clock":{clock},"id":"{op_id}","author":"{author}","op":{op}}}'


class Loaded(NamedTuple):
    """A terrain as the journal holds it: the document, the rows since the snapshot it came from, the counters."""

    document: StrokeSet
    recent: list[Row]
    counters: dict[str, int]


class Journal:
    """The database of one server. Reads may come from any thread; writes are queued to the one writer."""

    def __init__(self, directory: Path, now: Callable[[], float] = time.time) -> None:
        """Opens or creates ``directory/esker.db``. Raises CorruptDatabase, OSError."""
        self.directory, self.path = directory, directory / DATABASE_NAME
        self._now, self._moments = now, moments.Moments()
        directory.mkdir(parents=True, exist_ok=True)
        check(self.path, directory)
        self._writer_db = connect(self.path)
        self._writer_db.executescript(_SCHEMA + moments.SCHEMA)
        self._writer_db.execute(f"PRAGMA user_version={_SCHEMA_VERSION}")
        _lengthen(directory / f"{DATABASE_NAME}-wal")
        self._readers = threading.local()
        self._open_readers: list[sqlite3.Connection] = []
        self._queue: queue.SimpleQueue[tuple[Callable[[sqlite3.Connection], Any], Future[Any]] | None]
        self._queue = queue.SimpleQueue()
        self._closed = False
        self._thread = threading.Thread(target=self._write_all, name="journal", daemon=True)
        self._thread.start()

    # --- writing ------------------------------------------------------------------------------------------------

    def submit(self, write: Callable[[sqlite3.Connection], T]) -> Future[T]:
        """Runs ``write`` in the next commit; the future resolves after the commit is on disk.

        It fails with Unwritable when that cannot be, and with whatever ``write`` raises.
        """
        if self._closed:
            raise RuntimeError("the journal is closed")
        future: Future[T] = Future()
        self._queue.put((write, future))
        return future

    def append(
        self,
        terrain: str,
        rows: Sequence[Row],
        snapshot: c.Document | None = None,
        people: Sequence[moments.Person] = (),
    ) -> Future[None]:
        """Appends ops (a snapshot after them, and what their authors are called, where that is new).

        Fails with sqlite3.IntegrityError on a clock or id used before.
        """

        def write(db: sqlite3.Connection) -> None:
            db.executemany("INSERT INTO ops VALUES (?,?,?,?,?,?)", ((terrain, *row) for row in rows))
            if rows:
                self._moments.note(db, terrain, rows[0].clock, self._now())
            if people:
                moments.keep(db, terrain, people)
            if digests := [digest for row in rows for digest in _contents(row.op)]:
                _name_grids(db, terrain, digests)
            if snapshot is not None:
                _put_snapshot(db, snapshot)

        return self.submit(write)

    def create(self, document: c.Document, also: Callable[[sqlite3.Connection], Any] | None = None) -> Future[None]:
        """A new terrain, born as ``document``, with what ``also`` writes, or neither.

        Fails with sqlite3.IntegrityError when the id exists.
        """

        def write(db: sqlite3.Connection) -> None:
            db.execute("INSERT INTO terrains VALUES (?,?)", (document.id, self._now()))
            _name_grids(db, document.id, (layer.content for layer in (*document.layers, *document.deleted_layers)))
            _put_snapshot(db, document)
            if also is not None:
                also(db)

        return self.submit(write)

    def _write_all(self) -> None:
        while True:
            item = self._queue.get()
            if item is None:
                return
            batch, stop = [item], False
            while len(batch) < GROUP_LIMIT:
                try:
                    more = self._queue.get_nowait()
                except queue.Empty:
                    break
                if more is None:
                    stop = True
                    break
                batch.append(more)
            self._commit(batch)
            if stop:
                return

    def _commit(self, batch: list[tuple[Callable[[sqlite3.Connection], Any], Future[Any]]]) -> None:
        db = self._writer_db
        # From here on an item cannot be cancelled any more; one that was (its HTTP client hung up) is not written.
        batch = [(write, future) for write, future in batch if future.set_running_or_notify_cancel()]
        outcomes: list[tuple[Future[Any], Any, Exception | None]] = []
        # Every statement gives the interpreter's lock away and waits to have it back: an item alone has no savepoint.
        alone = len(batch) == 1
        try:
            db.execute("BEGIN IMMEDIATE")
            for write, future in batch:
                if not alone:
                    db.execute("SAVEPOINT item")
                try:
                    outcomes.append((future, write(db), None))
                except Exception as error:
                    if not db.in_transaction:  # SQLite gave the whole transaction up: a full disk, an I/O error
                        raise
                    db.execute("ROLLBACK" if alone else "ROLLBACK TO item")
                    outcomes.append((future, None, error))
                if not alone:
                    db.execute("RELEASE item")
            if not alone or outcomes[0][2] is None:
                db.execute("COMMIT")
        except sqlite3.Error as error:  # nothing of this batch is durable
            if db.in_transaction:
                db.execute("ROLLBACK")
            outcomes = [(future, None, error) for _, future in batch]
        for future, value, failure in outcomes:
            if failure is None:
                future.set_result(value)
            else:
                future.set_exception(Unwritable(failure) if isinstance(failure, sqlite3.OperationalError) else failure)

    # --- reading ------------------------------------------------------------------------------------------------

    def reader(self) -> sqlite3.Connection:
        """This thread's own read connection."""
        db: sqlite3.Connection | None = getattr(self._readers, "db", None)
        if db is None:
            db = self._readers.db = connect(self.path)
            self._open_readers.append(db)
        return db

    def exists(self, terrain: str) -> bool:
        """True when the terrain was created."""
        return self.reader().execute("SELECT 1 FROM terrains WHERE id=?", (terrain,)).fetchone() is not None

    def find(self, terrain: str, client: str, counter: int) -> int | None:
        """The clock of an op that is in the journal already, by its id."""
        row = self.reader().execute(
            "SELECT clock FROM ops WHERE terrain=? AND client=? AND counter=?", (terrain, client, counter)
        )
        found = row.fetchone()
        return None if found is None else int(found[0])

    def newest(self, terrain: str) -> int:
        """Clock of the terrain's last op; 0 where there is none."""
        row = self.reader().execute("SELECT max(clock) FROM ops WHERE terrain=?", (terrain,)).fetchone()
        return int(row[0] or 0)

    def rows(self, terrain: str, after: int, upto: int | None = None) -> list[Row]:
        """The ops with after < clock <= upto, in order."""
        cursor = self.reader().execute(
            "SELECT clock,client,counter,author,op FROM ops WHERE terrain=? AND clock>? AND clock<=? ORDER BY clock",
            (terrain, after, 2**62 if upto is None else upto),
        )
        return [Row(*row) for row in cursor]

    def load(self, terrain: str, upto: int | None = None) -> Loaded | None:
        """The terrain at clock ``upto`` (default: now), or None. Raises DamagedTerrain when it does not replay."""
        db = self.reader()
        snapshot = db.execute(
            "SELECT document FROM snapshots WHERE terrain=? AND clock<=? ORDER BY clock DESC LIMIT 1",
            (terrain, 2**62 if upto is None else upto),
        ).fetchone()
        if snapshot is None:
            return None
        document = StrokeSet.from_document(c.Document.model_validate_json(snapshot[0]))
        rows = self.rows(terrain, document.clock, upto)
        counters = db.execute("SELECT client, max(counter) FROM ops WHERE terrain=? GROUP BY client", (terrain,))
        return Loaded(replay(document, rows), rows, dict(counters))

    def grids(self, terrain: str | None = None) -> set[str]:
        """Digests of the grids that were ever layers of a terrain (default: of any), deleted ones too."""
        where, values = ("", ()) if terrain is None else (" WHERE terrain=?", (terrain,))
        return {str(row[0]) for row in self.reader().execute(f"SELECT DISTINCT digest FROM grids{where}", values)}

    # --- care ---------------------------------------------------------------------------------------------------

    def backup(self) -> Path:
        """Copies the live database to ``backup/``; readers and the writer go on meanwhile."""
        return write_backup(self.path, self.directory, self._now())

    def close(self) -> None:
        """Commits what is queued, then closes every connection."""
        if self._closed:
            return
        self._closed = True
        self._queue.put(None)
        self._thread.join()
        for db in self._open_readers:
            db.close()
        self._writer_db.close()


def connect(path: Path) -> sqlite3.Connection:
    """A connection with the journal's pragmas, in autocommit mode (transactions are explicit)."""
    db = sqlite3.connect(path, isolation_level=None, check_same_thread=False, timeout=10)
    db.execute("PRAGMA journal_mode=WAL")
    db.execute("PRAGMA synchronous=FULL")
    db.execute("PRAGMA foreign_keys=ON")
    return db


def _lengthen(log: Path) -> None:
    """Gives a write-ahead log its length at once, by zeros that no reader takes for its frames.

    To sync a file that has grown a file system waits for its own journal, and so for what others have just written: on
    a busy disk hundreds of milliseconds, now and then, for a commit that takes one where the log is written over.
    """
    with suppress(OSError), log.open("ab") as file:  # without room it only takes longer
        file.write(bytes(max(0, LOG_BYTES - file.tell())))
        file.flush()
        os.fsync(file.fileno())


def check(path: Path, directory: Path) -> None:
    """Reads the whole file without writing to it. Raises CorruptDatabase with a sentence that says what to do."""
    if not path.exists():
        return
    problem = ""
    try:
        with closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True)) as db:
            result = db.execute("PRAGMA quick_check(1)").fetchone()[0]
            problem = "" if result == "ok" else str(result)
            version = int(db.execute("PRAGMA user_version").fetchone()[0])
            if not problem and version > _SCHEMA_VERSION:
                problem = f"it was written by a newer Esker (format {version})"
    except sqlite3.DatabaseError as error:
        problem = str(error)
    if problem:
        good = last_backup(directory)
        hint = f"The last good copy is {good}." if good else "There is no earlier copy in the backup folder."
        raise CorruptDatabase(
            f"The database {path} cannot be read ({problem}). It was left untouched. {hint} "
            "To go on with the copy, move the damaged file away and put the copy in its place."
        )


def replay(document: StrokeSet, rows: Iterable[Row]) -> StrokeSet:
    """The document after ``rows``. Raises DamagedTerrain on a gap in the clocks or an op that does not apply."""
    unlimited = Limits(strokes=2**31, points=2**31, layers=2**31, all_points=2**31)
    for row in rows:
        if row.clock != document.clock + 1:
            raise DamagedTerrain(f"op {row.clock} follows op {document.clock} in the journal of {document.id}")
        try:
            document, _ = document.apply(c.OP.validate_json(row.op), unlimited)
        except (Refusal, ValueError) as error:
            raise DamagedTerrain(f"op {row.clock} of {document.id} does not apply: {error}") from error
    return document


def _contents(op: str) -> list[str]:
    """Digests of the grids that an op, as JSON text, names first."""
    if '"layer.add"' not in op:
        return []
    parsed = c.OP.validate_json(op)
    parts = parsed.ops if isinstance(parsed, c.Group) else (parsed,)
    return [part.layer.content for part in parts if isinstance(part, c.AddLayer)]


def _name_grids(db: sqlite3.Connection, terrain: str, digests: Iterable[str]) -> None:
    db.executemany("INSERT OR IGNORE INTO grids VALUES (?,?)", ((terrain, digest) for digest in digests))


def _put_snapshot(db: sqlite3.Connection, document: c.Document) -> None:
    db.execute(
        "INSERT OR REPLACE INTO snapshots VALUES (?,?,?)", (document.id, document.clock, document.model_dump_json())
    )
    # The first snapshot (the terrain's birth) stays for ever, the two newest do, and between them one in each stretch
    # of the history: no clock is much farther than a stretch from a snapshot before it. Stretches double as it grows.
    stretch = SNAPSHOT_EVERY
    while stretch * MILESTONES < document.clock:
        stretch *= 2
    db.execute(
        "DELETE FROM snapshots WHERE terrain=?1 AND clock > (SELECT min(clock) FROM snapshots WHERE terrain=?1)"
        " AND clock NOT IN (SELECT clock FROM snapshots WHERE terrain=?1 ORDER BY clock DESC LIMIT 2)"
        " AND clock NOT IN (SELECT min(clock) FROM snapshots WHERE terrain=?1 AND clock >= ?2 GROUP BY clock / ?2)",
        (document.id, stretch),
    )
