"""SQLite as the engine of a store: one file in the data folder, one writer thread, readers beside it.

WAL mode, ``synchronous=FULL``. Whatever is queued when a commit ends goes into the next one (group commit), each item
under its own savepoint, so one refused item does not undo the others; one that is alone and a single statement is its
own commit, as each statement gives the interpreter's lock away and waits for it. The lock of the data folder keeps
other servers away, so nothing is fenced.
"""

from __future__ import annotations

import os
import queue
import sqlite3
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Final, TypeVar

from esker.store.engine.checkpoints import WRITERS_PAGES, Checkpoints
from esker.store.engine.ports import Connection, Unwritable, UsedTwice, Write
from esker.store.engine.writer import write_all
from esker.store.space import NoSpace, Space
from esker.store.upkeep import migrations
from esker.store.upkeep.backup import keep_copy, write_backup
from esker.store.upkeep.inspection import DATABASE_NAME, check

T = TypeVar("T")
Item = tuple[Callable[[sqlite3.Connection], Any], "Future[Any]"]
Outcome = tuple["Future[Any]", Any, Exception | None]
"""The future of an item, with what its write returned or raised."""

LOG_BYTES: Final = 9 << 20
"""How long the write-ahead log is from the start: more than the ``WRITERS_PAGES`` after which it is begun anew at the
latest. One that a large commit made longer is cut to this then."""


class Sqlite:
    """The database file of one server. Reads may come from any thread; writes are queued to the one writer."""

    def __init__(self, directory: Path, now: float, space: Space) -> None:
        """Opens or creates ``directory/esker.db``. Raises CorruptDatabase, OSError."""
        self.directory, self.path, self._space = directory, directory / DATABASE_NAME, space
        check(self.path, directory)
        new = not self.path.exists()
        self.writer_db = connect(self.path)
        with closed_on_failure(self.writer_db):
            migrations.migrate(self.writer_db, lambda old: keep_copy(self.path, directory, f"format-{old}", now))
            if new:
                migrations.state(self.writer_db, "swept_from", str(now + migrations.SWEEP_AFTER))
            self.writer_db.execute(f"PRAGMA wal_autocheckpoint={WRITERS_PAGES}")
            self._checkpoints = Checkpoints(connect(self.path))
        lengthen(directory / f"{DATABASE_NAME}-wal")
        self._readers = threading.local()
        self._open_readers: list[sqlite3.Connection] = []
        self._queue: queue.SimpleQueue[Item | None] = queue.SimpleQueue()
        self._closed = False
        self.is_local = self.writable = self.answers = True
        self.hear_of_again: Callable[[], object] = lambda: None
        self._thread = threading.Thread(target=write_all, args=(self._queue, self._commit), name="journal", daemon=True)
        self._thread.start()

    # --- writing ------------------------------------------------------------------------------------------------

    def submit(self, write: Callable[[Connection], T], terrain: str | None = None) -> Future[T]:  # noqa: ARG002
        """Runs ``write`` in the next commit; nobody else writes into this file."""
        if self._closed:
            raise RuntimeError("the journal is closed")
        future: Future[T] = Future()
        self._queue.put((write, future))
        return future

    @property
    def waiting(self) -> int:
        return self._queue.qsize()

    def _commit(self, batch: list[Item]) -> None:
        db = self.writer_db
        # From here on an item cannot be cancelled. An item whose HTTP client hung up before is not written.
        batch = [(write, future) for write, future in batch if future.set_running_or_notify_cancel()]
        changes = db.total_changes
        try:
            outcomes = self._by_itself(*batch[0]) if _is_one_statement(batch) else self._in_a_transaction(batch)
            # A statement that finds the disk full may end alone, and leave the transaction to the others of its batch.
            # A batch that found nothing to change is no sign that there is room again.
            if any(isinstance(failure, sqlite3.OperationalError) for _, _, failure in outcomes):
                self.writable = False
            elif db.total_changes > changes:
                self.writable = True
                self._checkpoints.committed()
        except sqlite3.Error as error:  # nothing of this batch is durable
            if db.in_transaction:
                db.execute("ROLLBACK")
            self.writable = False
            outcomes = [(future, None, error) for _, future in batch]
        for future, value, failure in outcomes:
            if failure is None:
                future.set_result(value)
            else:
                future.set_exception(_as_asked(failure))

    def _by_itself(self, write: Callable[[sqlite3.Connection], Any], future: Future[Any]) -> list[Outcome]:
        """Runs a write whose one statement is its commit."""
        try:
            return [(future, write(self.writer_db), None)]
        except Exception as error:
            return [(future, None, error)]

    def _in_a_transaction(self, batch: list[Item]) -> list[Outcome]:
        """Runs writes in one commit. Raises sqlite3.Error where none of them is durable."""
        db, outcomes = self.writer_db, list[Outcome]()
        # Every statement gives the interpreter's lock away and waits for it, so an item that is alone has no savepoint.
        alone = len(batch) == 1
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
        return outcomes

    # --- reading ------------------------------------------------------------------------------------------------

    def reader(self) -> sqlite3.Connection:
        """This thread's own read connection."""
        db: sqlite3.Connection | None = getattr(self._readers, "db", None)
        if db is None:
            db = self._readers.db = connect(self.path)
            self._open_readers.append(db)
        return db

    @contextmanager
    def at_one_moment(self) -> Iterator[Connection]:
        """Everything that this thread reads within is of the same commit."""
        db = self.reader()
        if db.in_transaction:
            yield db
            return
        db.execute("BEGIN")
        try:
            yield db
        finally:
            db.execute("COMMIT")

    # --- care ---------------------------------------------------------------------------------------------------

    def backup(self, now: float) -> Path:
        """Copies the live database to ``backup/``; readers and the writer go on meanwhile.

        Raises NoSpace, store.backup.BadCopy, OSError, sqlite3.Error.
        """
        self._space.need(self.path.stat().st_size)
        return write_backup(self.path, self.directory, now)

    def close(self) -> None:
        """Commits what is queued, then closes every connection."""
        if self._closed:
            return
        self._closed = True
        self._queue.put(None)
        self._thread.join()
        self._checkpoints.close()
        for db in self._open_readers:
            db.close()
        self.writer_db.close()


def _is_one_statement(batch: list[Item]) -> bool:
    return len(batch) == 1 and isinstance(batch[0][0], Write) and batch[0][0].is_one_statement()


def connect(path: Path) -> sqlite3.Connection:
    """A connection with the journal's pragmas, in autocommit mode (transactions are explicit)."""
    db = sqlite3.connect(path, isolation_level=None, check_same_thread=False, timeout=10)
    with closed_on_failure(db):
        db.execute("PRAGMA journal_mode=WAL")
        db.execute("PRAGMA synchronous=FULL")
        db.execute("PRAGMA foreign_keys=ON")
        db.execute(f"PRAGMA journal_size_limit={LOG_BYTES}")
    return db


@contextmanager
def closed_on_failure(db: sqlite3.Connection) -> Iterator[None]:
    """Closes the connection when what is done with it fails: whoever was to own it never gets it."""
    try:
        yield
    except BaseException:
        db.close()
        raise


def lengthen(log: Path) -> None:
    """Gives a write-ahead log its length at once, by zeros that no reader takes for its frames.

    To sync a file that has grown a file system waits for its own journal, and so for what others have just written: on
    a busy disk hundreds of milliseconds, now and then, for a commit that takes one where the log is written over.
    """
    with suppress(OSError), log.open("ab") as file:  # where the disk has no room, commits only take longer
        file.write(bytes(max(0, LOG_BYTES - file.tell())))
        file.flush()
        os.fsync(file.fileno())


def _as_asked(failure: Exception) -> Exception:
    """The failure as whoever asked knows it."""
    if isinstance(failure, NoSpace):
        return Unwritable(str(failure), full=True)
    if isinstance(failure, sqlite3.OperationalError):
        return Unwritable(str(failure), full=failure.sqlite_errorcode == sqlite3.SQLITE_FULL)
    return UsedTwice(str(failure)) if isinstance(failure, sqlite3.IntegrityError) else failure
