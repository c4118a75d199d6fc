"""The ports between what a store keeps and the database under it.

All SQL stands once, in the files that know what the rows mean. It is written in what SQLite and PostgreSQL share:
``?`` and ``?1`` for values, ``ON CONFLICT`` for upserts, whole numbers for yes and no. An engine runs it: ``sqlite.py``
in a file beside the data, ``postgres/`` in a database that several servers share (docs/decisions/0065-two-engines.md).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, Protocol, TypeVar

T = TypeVar("T")


class Rows(Protocol):
    """What a statement gave."""

    @property
    def rowcount(self) -> int:
        """Rows that the statement changed."""

    def fetchone(self) -> Any:
        """The next row, or None."""

    def fetchall(self) -> list[Any]:
        """All rows that are left."""

    def close(self) -> None:
        """Wants no more rows."""

    def __iter__(self) -> Iterator[Any]: ...


class Connection(Protocol):
    """What runs statements: within a commit, or of a thread that reads. ``sqlite3.Connection`` is one."""

    @property
    def IntegrityError(self) -> type[Exception]:
        """Raised where a key is used twice."""

    def execute(self, sql: str, values: Sequence[Any] = ..., /) -> Rows:
        """Runs a statement."""

    def executemany(self, sql: str, rows: Iterable[Sequence[Any]], /) -> object:
        """Runs a statement for each row of values."""


@dataclass(frozen=True)
class Write(Generic[T]):
    """What is written in a commit, with what an engine may ask of it just before."""

    run: Callable[[Connection], T]
    is_one_statement: Callable[[], bool]
    """Whether ``run`` will run no more than one statement, which is a commit by itself where nothing else waits."""

    def __call__(self, db: Connection) -> T:
        """Returns what ``run`` returns."""
        return self.run(db)


class Unwritable(Exception):
    """The database cannot be written to at present. Of what was asked nothing was done; it may be asked again later."""

    def __init__(self, message: str, *, full: bool = False) -> None:
        """``full``: whether it is for want of room."""
        super().__init__(message)
        self.full = full


class Unreachable(Unwritable):
    """The database does not answer. What was asked of leases may have been done, or not."""


class Unknown(Exception):
    """The database went away while it committed: what was asked was done, or was not. What is there must be read."""


class Moved(Exception):
    """Another server has this terrain. Nothing was written."""


class UsedTwice(Exception):
    """A key of the database was used before: a clock, an id. Nothing was written."""


class BadDatabase(Exception):
    """The database cannot be used by this release; the message says why and what to do. Nothing was changed."""


class Reads(Protocol):
    """What can be read: the journal of a running server, or a visit by another program."""

    def reader(self) -> Connection:
        """A connection for this thread."""


class Database(Reads, Protocol):
    """What can be written, too."""

    def submit(self, write: Callable[[Connection], T], terrain: str | None = None) -> Future[T]:
        """Runs ``write`` in the next commit; the future resolves after the commit is on disk.

        ``terrain``: whose rows are written. Where several servers share the database, only the one that has the terrain
        writes them. It fails with Unwritable, Unknown, Moved, UsedTwice, and with whatever ``write`` raises.
        """


class Engine(Database, Protocol):
    """A database with its one writer."""

    is_local: bool
    """Whether it lies on the disk of the data folder, and takes of its room."""
    writable: bool
    """Whether the last commit could be written."""

    @property
    def answers(self) -> bool:
        """Whether the database answered when it was asked last. While it does not, reads raise Unreachable."""

    hear_of_again: Callable[[], object]
    """Called in the writer's thread before items are run again that were run before in vain."""

    @property
    def waiting(self) -> int:
        """Items that wait for a commit, about."""

    def at_one_moment(self) -> AbstractContextManager[Connection]:
        """Everything that this thread reads within is of the same commit."""

    def backup(self, now: float) -> Path | None:
        """Copies the database, and returns the copy. None where others keep copies of it."""

    def close(self) -> None:
        """Commits what is queued, then closes every connection."""
