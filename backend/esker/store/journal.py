"""The journal: append-only ops with the clock as key, in SQLite (DESIGN 13).

WAL mode, ``synchronous=FULL``. One writer thread serves all rooms: whatever is queued when a commit ends goes into
the next one (group commit), each item under its own savepoint, so one refused item does not undo the others. An op is
acknowledged after the commit that holds it, so ``kill -9`` loses nothing that was acknowledged.

Tables (``upkeep/migrations.py``): ``terrains`` (id, created), ``ops`` (terrain, clock, client, counter, author, op),
``snapshots`` (terrain, clock, document), ``grids`` (terrain, digest: every grid that a layer of the terrain ever was,
written in the same commit as the op or the birth that names it); ``store/access.py``, ``store/timestamps.py`` and
``store/upkeep/folds.py`` use others. Any clock can be opened again; of old gestures only the last op stays
(``store/upkeep/compaction.py``).
"""

from __future__ import annotations

import queue
import sqlite3
import threading
import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Future
from pathlib import Path
from typing import Any, Final, NamedTuple, TypeVar

from esker import contract as c
from esker.document.former import read_document, read_op
from esker.document.history.folding import SILENT, UNLIMITED, silent
from esker.document.ops import Refusal, StrokeSet
from esker.document.wire import op_json
from esker.store import lessons, timestamps
from esker.store.row import Row as Row
from esker.store.row import ordered_json as ordered_json
from esker.store.space import NoSpace, Space
from esker.store.upkeep import folds, migrations
from esker.store.upkeep.backup import keep_copy, write_backup
from esker.store.upkeep.inspection import DATABASE_NAME, check
from esker.store.writing import LOG_BYTES, contents, lengthen, name_grids, put_snapshot

T = TypeVar("T")

GROUP_LIMIT: Final = 256
"""Most queued items that one commit takes."""
HISTORY_BYTES: Final = 256 << 20
"""What the operations of one terrain may take: some 200 hours of drawing without a pause."""
COUNTED_TERRAINS: Final = 10_000
SWEEP_AFTER: Final = 30 * 86_400.0
"""Seconds for which a new or restored database lets every stored grid be (``store/grids.py``)."""


class Unwritable(Exception):
    """The database cannot be written to at present. Of what was asked nothing was done; it may be asked again later."""

    def __init__(self, error: sqlite3.OperationalError | NoSpace) -> None:
        super().__init__(str(error))
        self.full = isinstance(error, NoSpace) or error.sqlite_errorcode == sqlite3.SQLITE_FULL
        """Whether it is for want of room."""


class HistoryFull(Exception):
    """The history of one terrain takes as much of the disk as it may; the message says what to do."""


class DamagedTerrain(Exception):
    """The journal of one terrain does not replay (a gap, or an op that does not apply)."""


class Loaded(NamedTuple):
    """A terrain as the journal holds it: the document, the rows since the snapshot it came from, the counters."""

    document: StrokeSet
    recent: list[Row]
    counters: dict[str, int]


class Journal:
    """The database of one server. Reads may come from any thread; writes are queued to the one writer."""

    def __init__(
        self,
        directory: Path,
        now: Callable[[], float] = time.time,
        *,
        space: Space | None = None,
        quota: int = HISTORY_BYTES,
    ) -> None:
        """Opens or creates ``directory/esker.db``. Raises CorruptDatabase, OSError.

        ``space``: the disk that the server may use; ``quota``: bytes that the operations of one terrain may take.
        """
        self.directory, self.path = directory, directory / DATABASE_NAME
        self._quota = quota
        self._sizes: dict[str, int] = {}
        """Bytes of the operations of terrains that were appended to."""
        self._now, self._timestamps = now, timestamps.Timestamps()
        directory.mkdir(parents=True, exist_ok=True)
        self.space = Space(directory) if space is None else space
        check(self.path, directory)
        new = not self.path.exists()
        self._writer_db = connect(self.path)
        migrations.migrate(self._writer_db, lambda old: keep_copy(self.path, directory, f"format-{old}", now()))
        if new:
            migrations.state(self._writer_db, "swept_from", str(now() + SWEEP_AFTER))
        lengthen(directory / f"{DATABASE_NAME}-wal")
        self._readers = threading.local()
        self._open_readers: list[sqlite3.Connection] = []
        self._queue: queue.SimpleQueue[tuple[Callable[[sqlite3.Connection], Any], Future[Any]] | None]
        self._queue = queue.SimpleQueue()
        self._closed = False
        self.writable = True
        """Whether the last commit could be written."""
        self.hear_of_full: Callable[[str], object] = lambda _: None
        """Called in the writer's thread with a terrain whose history has no room left."""
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

    @property
    def waiting(self) -> int:
        """Items that wait for a commit, about."""
        return self._queue.qsize()

    def append(
        self,
        terrain: str,
        rows: Sequence[Row],
        snapshot: c.Document | None = None,
        people: Sequence[timestamps.Person] = (),
    ) -> Future[None]:
        """Appends ops (a snapshot after them, and what their authors are called, where that is new).

        Fails with sqlite3.IntegrityError on a clock or id used before, with Unwritable and HistoryFull.
        """
        more = sum(len(row.op) for row in rows)

        def write(db: sqlite3.Connection) -> None:
            self._make_room(db, terrain, more)
            db.executemany("INSERT INTO ops VALUES (?,?,?,?,?,?)", ((terrain, *row) for row in rows))
            if rows:
                self._timestamps.note(db, terrain, rows[0].clock, self._now())
            if people:
                timestamps.keep(db, terrain, people)
            if made := [(thing, row.author) for row in rows for thing in lessons.begun(row.op)]:
                lessons.keep_makers(db, terrain, made)
            if digests := [digest for row in rows for digest in contents(row.op)]:
                name_grids(db, terrain, digests)
            if snapshot is not None:
                put_snapshot(db, snapshot)

        return self.submit(write)

    def keep_lesson(self, terrain: str, state: str) -> Future[None]:
        """Keeps how the lesson of a terrain stands. Fails with Unwritable."""
        return self.submit(lambda db: lessons.keep_state(db, terrain, state))

    def _make_room(self, db: sqlite3.Connection, terrain: str, more: int) -> None:
        """Counts ``more`` characters of operations. Raises NoSpace, HistoryFull."""
        if terrain not in self._sizes:
            if len(self._sizes) >= COUNTED_TERRAINS:
                self._sizes.clear()
            found = db.execute("SELECT coalesce(sum(length(op)), 0) FROM ops WHERE terrain=?", (terrain,)).fetchone()
            self._sizes[terrain] = int(found[0])
        if self._sizes[terrain] + more > self._quota:
            self.hear_of_full(terrain)
            raise HistoryFull(
                f"The history of this terrain takes {self._quota >> 20} MiB, which is the most on this server. "
                "Try again in a few minutes: what can be folded of it is. A copy of the terrain begins with an empty "
                "history."
            )
        self.space.need(more, drawing=True)
        self._sizes[terrain] += more

    def shrunk(self, terrain: str, less: int) -> None:
        """``less`` characters of operations were folded away. For the writer's thread, within the commit."""
        if terrain in self._sizes:
            self._sizes[terrain] -= less

    def crowded(self, terrain: str) -> bool:
        """Returns whether the operations of a terrain take more than half of what they may, as far as that was
        counted."""
        return self._sizes.get(terrain, 0) > self._quota // 2

    def create(self, document: c.Document, also: Callable[[sqlite3.Connection], Any] | None = None) -> Future[None]:
        """A new terrain, born as ``document``, with what ``also`` writes, or neither.

        Fails with sqlite3.IntegrityError when the id exists.
        """

        def write(db: sqlite3.Connection) -> None:
            self.space.need()
            db.execute("INSERT INTO terrains (id,created) VALUES (?,?)", (document.id, self._now()))
            name_grids(db, document.id, (layer.content for layer in (*document.layers, *document.deleted_layers)))
            put_snapshot(db, document)
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
        # From here on an item cannot be cancelled. An item whose HTTP client hung up before is not written.
        batch = [(write, future) for write, future in batch if future.set_running_or_notify_cancel()]
        outcomes: list[tuple[Future[Any], Any, Exception | None]] = []
        # Every statement gives the interpreter's lock away and waits for it, so an item that is alone has no savepoint.
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
            # A statement that finds the disk full may end alone, and leave the transaction to the others of its batch.
            self.writable = not any(isinstance(failure, sqlite3.OperationalError) for _, _, failure in outcomes)
        except sqlite3.Error as error:  # nothing of this batch is durable
            if db.in_transaction:
                db.execute("ROLLBACK")
            self.writable = False
            outcomes = [(future, None, error) for _, future in batch]
        for future, value, failure in outcomes:
            if failure is None:
                future.set_result(value)
            else:
                if isinstance(failure, (sqlite3.OperationalError, NoSpace)):
                    failure = Unwritable(failure)
                future.set_exception(failure)

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
        return folds.find(self.reader(), terrain, client, counter) if found is None else int(found[0])

    def first_by(self, terrain: str, clients: Sequence[str]) -> int | None:
        """Clock of the first op of which one of these clients is the author; None where there is none."""
        marks = ",".join("?" * len(clients))
        sql = f"SELECT min(clock) FROM ops WHERE terrain=? AND author IN ({marks})"
        found = self.reader().execute(sql, (terrain, *clients)).fetchone()
        return None if found[0] is None else int(found[0])

    def newest(self, terrain: str) -> int:
        """Clock of the terrain's last op; 0 where there is none."""
        row = self.reader().execute("SELECT max(clock) FROM ops WHERE terrain=?", (terrain,)).fetchone()
        return int(row[0] or 0)

    def rows(self, terrain: str, after: int, upto: int | None = None) -> list[Row]:
        """The ops with after < clock <= upto that are stored, in order: there is none at a clock that was folded."""
        cursor = self.reader().execute(
            "SELECT clock,client,counter,author,op FROM ops WHERE terrain=? AND clock>? AND clock<=? ORDER BY clock",
            (terrain, after, 2**62 if upto is None else upto),
        )
        return [Row(*row) for row in cursor]

    def steps(self, terrain: str, after: int, upto: int | None = None) -> list[Row]:
        """Returns a row for every clock: one that changes nothing (``SILENT``) where a gesture was folded.

        Raises DamagedTerrain when ops of a folded stretch are missing.
        """
        db = self.reader()
        with folds.at_one_moment(db):
            rows = self.rows(terrain, after, upto)
            last = folds.folded_upto(db, terrain)
            end = last if upto is None else min(last, upto)
            if end <= after:
                return rows
            try:
                folds.check(db, terrain, after, end)
            except folds.MissingOps as error:
                raise DamagedTerrain(f"the journal of {terrain}: {error}") from error
        return folds.filled(rows, Row(0, "-", 0, "", SILENT), after, end)

    def load(self, terrain: str, upto: int | None = None) -> Loaded | None:
        """The terrain at clock ``upto`` (default: now), or None. Raises DamagedTerrain when it does not replay."""
        db = self.reader()
        with folds.at_one_moment(db):  # what is being folded meanwhile is, or is not
            snapshot = db.execute(
                "SELECT clock, document FROM snapshots WHERE terrain=? AND clock<=? ORDER BY clock DESC LIMIT 1",
                (terrain, 2**62 if upto is None else upto),
            ).fetchone()
            if snapshot is None:
                return None
            rows = self.steps(terrain, int(snapshot[0]), upto)
            counters = db.execute("SELECT client, max(counter) FROM ops WHERE terrain=? GROUP BY client", (terrain,))
            known = dict(counters.fetchall())
        document = StrokeSet.from_document(read_document(snapshot[1]))
        return Loaded(replay(document, rows), [_as_read(row) for row in rows], known)

    def grids(self, terrain: str | None = None) -> set[str]:
        """Digests of the grids that were ever layers of a terrain (default: of any), deleted ones too."""
        where, values = ("", ()) if terrain is None else (" WHERE terrain=?", (terrain,))
        return {str(row[0]) for row in self.reader().execute(f"SELECT DISTINCT digest FROM grids{where}", values)}

    def may_sweep(self) -> bool:
        """Returns whether a stored grid that this database does not name is one that nobody needs.

        A database that is new or was restored does not know all that people brought.
        """
        since = migrations.fact(self.reader(), "swept_from")
        return since is None or self._now() >= float(since)

    # --- care ---------------------------------------------------------------------------------------------------

    def backup(self) -> Path:
        """Copies the live database to ``backup/``; readers and the writer go on meanwhile.

        Raises NoSpace, store.backup.BadCopy, OSError, sqlite3.Error.
        """
        self.space.need(self.path.stat().st_size)
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
    db.execute(f"PRAGMA journal_size_limit={LOG_BYTES}")
    return db


def replay(document: StrokeSet, rows: Iterable[Row]) -> StrokeSet:
    """The document after ``rows``. Raises DamagedTerrain on a gap in the clocks or an op that does not apply."""
    for row in rows:
        if row.clock != document.clock + 1:
            raise DamagedTerrain(f"op {row.clock} follows op {document.clock} in the journal of {document.id}")
        if row.op == SILENT:
            document = silent(document)
            continue
        try:
            document, _ = document.apply(read_op(row.op), UNLIMITED)
        except (Refusal, ValueError) as error:
            raise DamagedTerrain(f"op {row.clock} of {document.id} does not apply: {error}") from error
    return document


def _as_read(row: Row) -> Row:
    """The row with its op as it was understood: clients that resume get the numbers that the document has."""
    return row if row.op == SILENT else row._replace(op=op_json(read_op(row.op)))
