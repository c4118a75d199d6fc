"""The engine over PostgreSQL: group commits that are fenced, and readers beside them (DESIGN 18).

One thread writes. Whatever is queued when a commit ends goes into the next one. A commit has two round trips: the first
locks the lease rows of all terrains that it writes for, those that this server still has, in order of id; the second
carries all statements and the COMMIT. Nobody takes a terrain over while its row is locked, so what is written belongs
before the take-over, and a server that lost a terrain without knowing finds no row to lock and writes nothing.

A batch is first tried without savepoints. Where a statement of it fails, all of it is rolled back and done again with
one savepoint an item, so one refused item does not undo the others.
"""

from __future__ import annotations

import logging
import queue
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import AbstractContextManager, suppress
from pathlib import Path
from typing import Any, Final, NamedTuple, Protocol, TypeVar

import psycopg
from psycopg import errors

from esker.store.engine.ports import Connection, Moved, Unknown, Unreachable, Unwritable, UsedTwice
from esker.store.engine.postgres import migrations
from esker.store.engine.postgres.connections import Database, Readers, Writing, connect, first_line
from esker.store.engine.writer import write_all
from esker.store.space import NoSpace

log = logging.getLogger("esker.postgres")

T = TypeVar("T")
READERS: Final = 8
PATIENCE_SECONDS: Final = 2.0
"""A database that is away for so long, as one that is started again, costs nobody an operation."""
AGAIN_SECONDS: Final = 0.1
STRANDED_SECONDS: Final = 5
"""A transaction whose client has said nothing for so long is ended by the database. Whoever takes a terrain over does
not wait for that (``leases.py``)."""
_BEGIN: Final = (
    "BEGIN",
    "SELECT set_config('synchronous_commit', 'on', true), set_config('lock_timeout', '8s', true),"
    f" set_config('idle_in_transaction_session_timeout', '{STRANDED_SECONDS}s', true)",
)
"""Settings of the transaction, not of the session."""
_FENCE: Final = """
SELECT w.terrain, w.lease, w.epoch FROM unnest($1::text[], $2::text[], $3::bigint[]) AS w(terrain, lease, epoch)
JOIN esker.leases l ON l.terrain = w.lease
WHERE CASE WHEN w.epoch < 0 THEN l.until <= clock_timestamp()
  ELSE l.epoch = w.epoch AND l.until > clock_timestamp() END
ORDER BY l.terrain FOR NO KEY UPDATE OF l
"""
"""An epoch below 0 stands for a terrain that this server does not have: it may be written while nobody has it."""
NOBODYS: Final = -1


class Holder(Protocol):
    """The terrains that this server owns."""

    def right(self, terrain: str) -> tuple[str, int] | None:
        """The name and the epoch of the lease under which this server writes for a terrain; None where it has none."""

    def fenced(self, terrain: str) -> None:
        """The database refused a write: another server has the terrain. Called in the writer's thread."""


class Item(NamedTuple):
    """One write that waits. ``right``: the terrain, the lease and the epoch under which it was asked for."""

    write: Callable[[Connection], Any]
    future: Future[Any]
    right: tuple[str, str, int] | None


class _Again(Exception):
    """Something of the batch failed: it is to be done again, each item by itself."""


class Postgres:
    """One server's part of a database. Reads may come from any thread; writes are queued to the one writer."""

    def __init__(self, url: str, holder: Holder, now: Callable[[], float] = time.time) -> None:
        """Raises Unreachable, BadDatabase."""
        self._url, self._holder = url, holder
        migrations.migrate(url, now())
        self._db: Database | None = connect(url)
        self._readers = Readers(url, READERS)
        self._queue: queue.SimpleQueue[Item | None] = queue.SimpleQueue()
        self._closed = False
        self.is_local, self.writable = False, True
        self.hear_of_again: Callable[[], object] = lambda: None
        """Called in the writer's thread before items are run again."""
        self._thread = threading.Thread(target=write_all, args=(self._queue, self._commit), name="journal", daemon=True)
        self._thread.start()

    # --- writing ------------------------------------------------------------------------------------------------

    def submit(self, write: Callable[[Connection], T], terrain: str | None = None) -> Future[T]:
        """Runs ``write`` in the next commit, under the lease that this server has now."""
        if self._closed:
            raise RuntimeError("the journal is closed")
        future: Future[T] = Future()
        right = None
        if terrain is not None:
            right = (terrain, *(self._holder.right(terrain) or (terrain, NOBODYS)))
        self._queue.put(Item(write, future, right))
        return future

    @property
    def waiting(self) -> int:
        return self._queue.qsize()

    @property
    def answers(self) -> bool:
        """Whether the database answered whoever read last."""
        return self._readers.answers

    def _commit(self, batch: list[Item]) -> None:
        """Commits a batch and resolves its futures."""
        batch = [item for item in batch if item.future.set_running_or_notify_cancel()]
        outcomes: list[tuple[Any, Exception | None]]
        try:
            outcomes = self._committed(batch)
            late = [k for k, (_, error) in enumerate(outcomes) if isinstance(error, Moved)]
            if late and any(item.right is None for item in batch):  # terrains that were born in this very commit
                for k, outcome in zip(late, self._committed([batch[k] for k in late]), strict=True):
                    outcomes[k] = outcome
            self.writable = not any(isinstance(error, Unwritable) for _, error in outcomes)
        except (Unwritable, Unknown) as error:
            log.error("nothing can be written: %s", error)
            self.writable = False
            outcomes = [(None, error)] * len(batch)
        except Exception as error:  # a future that nobody resolves would hold its room for ever
            log.exception("a commit failed")
            self._drop()
            outcomes = [(None, Unwritable(str(error)))] * len(batch)
        for item, (value, failure) in zip(batch, outcomes, strict=True):
            if failure is None:
                item.future.set_result(value)
            else:
                if isinstance(failure, Moved) and item.right is not None:
                    self._holder.fenced(item.right[0])
                item.future.set_exception(failure)

    def _committed(self, batch: list[Item]) -> list[tuple[Any, Exception | None]]:
        """Tries until the database has answered. Raises Unwritable: nothing was done; Unknown."""
        end, careful, tries = time.monotonic() + PATIENCE_SECONDS, False, 0
        while True:
            attempt = Attempt(batch, careful)
            try:
                return attempt.run(self._connection())
            except _Again:
                self._drop_unless_idle()
                careful = True
            except (errors.DiskFull, errors.OutOfMemory) as error:
                self._drop_unless_idle()
                raise Unwritable(first_line(error), full=isinstance(error, errors.DiskFull)) from None
            except (psycopg.OperationalError, Unreachable) as error:
                self._drop()
                if attempt.sent and self._has_committed(attempt, error, end):
                    return attempt.outcomes
                if time.monotonic() >= end:
                    raise Unwritable(f"the database does not answer ({first_line(error)})") from None
                if tries:
                    time.sleep(AGAIN_SECONDS)
            self.hear_of_again()
            tries += 1

    def _has_committed(self, attempt: Attempt, error: Exception, end: float) -> bool:
        """The connection ended while it committed: asks the database, once it answers, whether it did.

        Raises Unknown.
        """
        while time.monotonic() < end:
            with suppress(psycopg.Error, Unreachable):
                found = self._connection().execute("SELECT pg_xact_status($1::xid8)", (attempt.transaction,)).fetchone()
                status = None if found is None else found[0]
                if status in ("committed", "aborted"):
                    return bool(status == "committed")
            self._drop()
            time.sleep(AGAIN_SECONDS)
        raise Unknown(f"the database went away while it committed ({first_line(error)})")

    def _connection(self) -> Database:
        if self._db is None or self._db.closed:
            self._db = connect(self._url)
        return self._db

    def _drop(self) -> None:
        if self._db is not None:
            with suppress(psycopg.Error):
                self._db.close()
        self._db = None

    def _drop_unless_idle(self) -> None:
        """Leaves a transaction that failed; the connection goes where that fails too."""
        try:
            assert self._db is not None
            self._db.execute("ROLLBACK")
        except (psycopg.Error, AssertionError):
            self._drop()

    # --- reading ------------------------------------------------------------------------------------------------

    def reader(self) -> Connection:
        """What this thread reads by."""
        return self._readers.reader()

    def at_one_moment(self) -> AbstractContextManager[Connection]:
        """Everything that this thread reads within is of the same commit."""
        return self._readers.at_one_moment()

    # --- care ---------------------------------------------------------------------------------------------------

    def backup(self, now: float) -> Path | None:  # noqa: ARG002
        """Copies of a shared database are for whoever keeps it."""
        return None

    def close(self) -> None:
        """Commits what is queued, then closes every connection."""
        if self._closed:
            return
        self._closed = True
        self._queue.put(None)
        self._thread.join()
        self._drop()
        self._readers.close()


class Attempt:
    """One try to commit a batch."""

    def __init__(self, batch: list[Item], careful: bool) -> None:
        self._batch, self._careful = batch, careful
        self.sent = False
        """Whether the COMMIT was given to the connection: from then on its outcome is the database's."""
        self.transaction = ""
        self.outcomes: list[tuple[Any, Exception | None]] = []

    def run(self, db: Database) -> list[tuple[Any, Exception | None]]:
        """Raises _Again, psycopg.Error."""
        with db.pipeline() as pipeline:
            for statement in _BEGIN:
                db.execute(statement)
            rights = sorted({item.right for item in self._batch if item.right is not None})
            columns = [list(column) for column in zip(*rights, strict=True)] or [[], [], []]
            fence = db.execute(_FENCE, columns)
            number = db.execute("SELECT pg_current_xact_id()::text")
            # A Sync, not only a Flush: the database counts a transaction as idle only behind one.
            pipeline.sync()
            held = {tuple(row) for row in fence.fetchall()}
            self.transaction = str((number.fetchone() or ("",))[0])
            writing = Writing(db, pipeline, not self._careful)
            for item in self._batch:
                self.outcomes.append(self._one(writing, pipeline, item, held))
            self._end(db, writing, pipeline)
        return self.outcomes

    def _end(self, db: Database, writing: Writing, pipeline: psycopg.Pipeline) -> None:
        """Commits.

        What a statement before was refused for may come up in any call here: as soon as its answer has arrived.
        """
        try:
            writing.flush()
            self.sent = True
            done = db.execute("COMMIT")
            pipeline.sync()
        except psycopg.OperationalError:
            if not db.closed:  # the server refused a statement, and said so
                self.sent = False
            raise
        except psycopg.Error as error:
            self.sent = False
            raise _Again from error
        if done.statusmessage != "COMMIT":
            self.sent = False
            raise _Again

    def _one(
        self, writing: Writing, pipeline: psycopg.Pipeline, item: Item, held: set[tuple[Any, ...]]
    ) -> tuple[Any, Exception | None]:
        if item.right is not None and item.right not in held:
            return None, Moved("another server has this terrain now")
        if self._careful:
            writing.execute("SAVEPOINT item")
            pipeline.sync()
        before = writing.statements
        try:
            value = item.write(writing)
            if self._careful:
                writing.execute("RELEASE item")
                pipeline.sync()
            return value, None
        except psycopg.OperationalError as error:
            if not self._careful or _is_lost(error):
                raise
            failure: Exception = _as_asked(error)
        except psycopg.Error as error:
            if not self._careful:
                raise _Again from error
            failure = _as_asked(error)
        except Exception as error:
            if not self._careful and writing.statements > before:
                raise _Again from error
            failure = _as_asked(error)
        if self._careful:
            with suppress(psycopg.Error):
                pipeline.sync()
            writing.execute("ROLLBACK TO item")
            pipeline.sync()
        return None, failure


def _is_lost(error: psycopg.OperationalError) -> bool:
    """Whether the connection is at its end, and not one statement."""
    return error.sqlstate is None or error.sqlstate[:2] in ("08", "57")


def _as_asked(failure: Exception) -> Exception:
    """The failure as whoever asked knows it."""
    if isinstance(failure, NoSpace):
        return Unwritable(str(failure), full=True)
    if isinstance(failure, psycopg.IntegrityError):
        return UsedTwice(first_line(failure))
    if isinstance(failure, psycopg.OperationalError):
        return Unwritable(first_line(failure), full=isinstance(failure, errors.DiskFull))
    return failure
