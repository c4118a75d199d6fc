"""Connections to PostgreSQL: how a database is named, who waits how long, and the store's ``Connection`` over psycopg.

No statement is prepared and nothing is set for a session: a pooler that shares sessions out by transactions does no
harm. Names and passwords never stand in a message of ours.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from typing import Any, Final

import psycopg
from psycopg import RawCursor, conninfo
from psycopg_pool import ConnectionPool, PoolTimeout

from esker.store.engine.ports import BadDatabase, Connection, Unreachable
from esker.store.engine.postgres.dialect import of_many, translated
from esker.store.engine.postgres.patience import LOOP_SECONDS, SILENT_SECONDS, Patient, Silent, Watch, is_in_loop

CONNECT_SECONDS: Final = 3
POOL_SECONDS: Final = 5.0
ASKING_SECONDS: Final = 1.0
"""Whoever asks a silent database for a word waits so long for it."""
RECONNECT_SECONDS: Final = 1.5
"""A pool that cannot connect tries for so long, and again when somebody wants a connection: with longer pauses it would
find a database late that is there again."""
LOOP_CONNECTIONS: Final = 2
"""The event loop reads by one at a time; the other stands for one that was lost."""
ROWS_AT_ONCE: Final = 256
"""Rows of one INSERT. Statements of more would be planned anew for every count."""
PATIENCE: Final = {
    "connect_timeout": CONNECT_SECONDS,
    "keepalives_idle": 2,
    "keepalives_interval": 1,
    "keepalives_count": 3,
    "tcp_user_timeout": 4000,
}
"""After so long a network that swallows everything is taken for what it is."""
Database = psycopg.Connection[tuple[Any, ...]]


def place_of(url: str) -> str:
    """Where a database lies, for people: without user and password. Raises BadDatabase for what names none.

    >>> place_of("postgresql://esker:secret@db.example.org:5432/esker")
    'db.example.org:5432/esker'
    """
    try:
        found = conninfo.conninfo_to_dict(url)
    except psycopg.Error:
        raise BadDatabase("ESKER_DATABASE does not name a PostgreSQL database: postgresql://user@host/name.") from None
    port = f":{found['port']}" if "port" in found else ""
    return f"{found.get('host', 'this machine')}{port}/{found.get('dbname', found.get('user', ''))}"


def parameters(url: str) -> dict[str, Any]:
    """How connections are made. What the url says goes before what is said here."""
    return {
        "conninfo": conninfo.make_conninfo(url, **{key: value for key, value in PATIENCE.items() if key not in url}),
        "autocommit": True,
        "prepare_threshold": None,
        "cursor_factory": RawCursor,
    }


def connect(url: str) -> Database:
    """One connection. Raises Unreachable."""
    try:
        return Patient.connect(**parameters(url))
    except psycopg.OperationalError as error:
        raise Unreachable(f"the database {place_of(url)} does not answer ({first_line(error)})") from None


def pool(
    url: str, name: str, most: int, *, checked: bool = False, patience: float = SILENT_SECONDS
) -> ConnectionPool[Patient]:
    """Connections that are shared by threads. ``checked``: whether each is asked for a word before it is given out;
    ``patience``: seconds that each waits for a database that says nothing."""
    more = parameters(url)

    def configure(db: Patient) -> None:
        db.patience = patience

    return ConnectionPool(
        more.pop("conninfo"),
        connection_class=Patient,
        configure=configure,
        reconnect_timeout=RECONNECT_SECONDS,
        kwargs=more,
        min_size=1,
        max_size=most,
        timeout=POOL_SECONDS,
        name=name,
        open=True,
        check=ConnectionPool.check_connection if checked else None,
    )


def first_line(error: BaseException) -> str:
    """What went wrong in one line. Messages of the server and of libpq name hosts and users, never a password."""
    return (str(error).strip() or type(error).__name__).splitlines()[0]


class Found:
    """The rows that a statement gave, all of them."""

    def __init__(self, rows: list[tuple[Any, ...]], rowcount: int) -> None:
        self._rows, self._at, self.rowcount = rows, 0, rowcount

    def fetchone(self) -> Any:
        if self._at >= len(self._rows):
            return None
        self._at += 1
        return self._rows[self._at - 1]

    def fetchall(self) -> list[Any]:
        rows, self._at = self._rows[self._at :], len(self._rows)
        return rows

    def __iter__(self) -> Iterator[Any]:
        return iter(self.fetchall())

    def close(self) -> None:
        self._at = len(self._rows)


class Writing:
    """The connection of a commit. Statements wait in a pipeline until somebody asks what one gave.

    Plain INSERTs wait longer, those into one table together, until another statement comes: a commit of many rooms is
    a few statements. What they may not insert is found out all the same, for the whole of them.
    """

    IntegrityError: type[Exception] = psycopg.IntegrityError

    def __init__(self, db: Database, pipeline: psycopg.Pipeline, together: bool) -> None:
        """``together``: whether INSERTs may wait for those of other items."""
        self._db, self._pipeline, self._together = db, pipeline, together
        self._inserts: dict[str, list[Sequence[Any]]] = {}
        self.statements = 0
        """Statements that may have written."""

    def execute(self, sql: str, values: Sequence[Any] = (), /) -> Coming:
        if self._together and of_many(sql, 1) is not None:
            self.executemany(sql, (values,))
            return Coming(None, self._pipeline)
        self.flush()
        return self._run(translated(sql), values)

    def executemany(self, sql: str, rows: Iterable[Sequence[Any]], /) -> None:
        if of_many(sql, 1) is None:
            self.flush()
            for row in rows:
                self._run(translated(sql), row)
            return
        self.statements += 1
        self._inserts.setdefault(sql, []).extend(rows)
        if not self._together:
            self.flush()

    def flush(self) -> None:
        """Gives the INSERTs that wait to the pipeline."""
        inserts, self._inserts = self._inserts, {}
        for sql, rows in inserts.items():
            for start in range(0, len(rows), ROWS_AT_ONCE):
                some = rows[start : start + ROWS_AT_ONCE]
                whole = of_many(sql, len(some))
                assert whole is not None, "only plain INSERTs wait"
                self._run(whole, [value for row in some for value in row])

    def _run(self, sql: str, values: Sequence[Any]) -> Coming:
        self.statements += not sql.startswith("SELECT")
        cursor = self._db.cursor()
        cursor.execute(sql, _storable(values))
        return Coming(cursor, self._pipeline)


class Coming:
    """Rows that a statement will have given once the pipeline was emptied."""

    def __init__(self, cursor: psycopg.Cursor[tuple[Any, ...]] | None, pipeline: psycopg.Pipeline) -> None:
        """``cursor``: None for a plain INSERT, which gives nothing."""
        self._cursor, self._pipeline = cursor, pipeline

    @property
    def rowcount(self) -> int:
        self._pipeline.sync()
        return self._given.rowcount

    def fetchone(self) -> Any:
        return self._given.fetchone()

    def fetchall(self) -> list[Any]:
        return self._given.fetchall()

    def __iter__(self) -> Iterator[Any]:
        return iter(self._given.fetchall())

    def close(self) -> None:
        self._given.close()

    @property
    def _given(self) -> psycopg.Cursor[tuple[Any, ...]]:
        if self._cursor is None:
            raise TypeError("what a plain INSERT did is known when its commit is")
        return self._cursor


class Reading:
    """Reads by statements of their own, each by a connection of a pool."""

    IntegrityError: type[Exception] = psycopg.IntegrityError

    def __init__(self, connections: ConnectionPool[Patient], watch: Watch, seconds: float) -> None:
        """``seconds``: for how long a connection of the pool is waited for."""
        self._pool, self._watch, self._seconds = connections, watch, seconds

    def execute(self, sql: str, values: Sequence[Any] = (), /) -> Found:
        """Raises Unreachable; at once where the database is known to say nothing."""
        self._watch.demand()
        try:
            return self.asked(sql, values, self._seconds)
        except Unreachable as error:
            if isinstance(error.__cause__, Silent | PoolTimeout):
                self._watch.fell_silent()
            raise

    def asked(self, sql: str, values: Sequence[Any], seconds: float) -> Found:
        """Asks, whether the database answers or not. Raises Unreachable."""
        end = time.monotonic() + seconds
        with reached():
            for _ in range(self._pool.max_size):
                try:
                    with self._pool.connection(max(0.05, end - time.monotonic())) as db:
                        return run(db, sql, values)
                except psycopg.OperationalError as error:
                    # One of before the database was started again tells nothing, and so may others of the pool.
                    if isinstance(error, Silent | PoolTimeout) or not db.closed:
                        raise
            with self._pool.connection(max(0.05, end - time.monotonic())) as db:
                return run(db, sql, values)

    def executemany(self, _sql: str, _rows: Iterable[Sequence[Any]], /) -> None:
        raise TypeError("a connection that reads writes nothing")


class Pinned:
    """Reads by one connection, within one transaction."""

    IntegrityError: type[Exception] = psycopg.IntegrityError

    def __init__(self, db: Database) -> None:
        self._db = db

    def execute(self, sql: str, values: Sequence[Any] = (), /) -> Found:
        with reached():
            return run(self._db, sql, values)

    def executemany(self, _sql: str, _rows: Iterable[Sequence[Any]], /) -> None:
        raise TypeError("a connection that reads writes nothing")


class Readers:
    """The connections that read: those for threads, and those of the event loop, which waits for no thread."""

    def __init__(self, url: str, most: int) -> None:
        self._pool = pool(url, "readers", most)
        self._own = pool(url, "loop", LOOP_CONNECTIONS, patience=ASKING_SECONDS)
        self._watch = Watch(self._ask)
        self._free = Reading(self._pool, self._watch, POOL_SECONDS)
        self._quick = Reading(self._own, self._watch, LOOP_SECONDS)
        self._pinned = threading.local()

    def _ask(self) -> None:
        self._quick.asked("SELECT 1", (), ASKING_SECONDS)

    @property
    def answers(self) -> bool:
        """Whether the database answered whoever read last."""
        return self._watch.answers

    def reader(self) -> Connection:
        """What this thread reads by."""
        pinned: Pinned | None = getattr(self._pinned, "db", None)
        if pinned is not None:
            return pinned
        return self._quick if is_in_loop() else self._free

    @contextmanager
    def at_one_moment(self) -> Iterator[Connection]:
        """Everything that this thread reads within is of the same commit. Raises Unreachable."""
        if getattr(self._pinned, "db", None) is not None:
            yield self._pinned.db
            return
        self._watch.demand()
        with reached(), ExitStack() as stack:
            self._pinned.db = Pinned(self._begun(stack))
            try:
                yield self._pinned.db
            finally:
                self._pinned.db = None

    def _begun(self, stack: ExitStack) -> Database:
        """A connection in a transaction, whichever of the pool lives. Raises psycopg.OperationalError."""
        for _ in range(self._pool.max_size):
            try:
                return self._begin(stack)
            except Silent:
                self._watch.fell_silent()
                raise
            except psycopg.OperationalError as error:
                if isinstance(error, PoolTimeout):
                    raise
        return self._begin(stack)

    def _begin(self, stack: ExitStack) -> Database:
        """A connection in a transaction, until the stack is left."""
        with ExitStack() as tried:
            db = tried.enter_context(self._pool.connection())
            tried.enter_context(db.transaction())
            db.execute("SET TRANSACTION ISOLATION LEVEL REPEATABLE READ READ ONLY")
            stack.push(tried.pop_all())
        return db

    def close(self) -> None:
        """Closes the connections."""
        self._watch.close()
        self._pool.close()
        self._own.close()


def _storable(values: Sequence[Any]) -> Sequence[Any]:
    """The values without the one character that PostgreSQL's texts cannot have."""
    if any(type(value) is str and "\0" in value for value in values):
        return [value.replace("\0", "\ufffd") if type(value) is str else value for value in values]
    return values


def run(db: Database, sql: str, values: Sequence[Any]) -> Found:
    """Runs a statement of the store and takes all that it gives."""
    cursor = db.execute(translated(sql), _storable(values))
    return Found(cursor.fetchall() if cursor.description is not None else [], cursor.rowcount)


@contextmanager
def reached() -> Iterator[None]:
    """Turns the driver's words for a database that does not answer into the port's."""
    try:
        yield
    except (psycopg.OperationalError, PoolTimeout) as error:
        raise Unreachable(f"the database does not answer ({first_line(error)})") from error
