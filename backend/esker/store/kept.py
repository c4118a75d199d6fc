"""What a server keeps: its terrains, with what their journals say of them, without opening them."""

from __future__ import annotations

import json
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import closing
from pathlib import Path
from typing import Any, Final, NamedTuple, Protocol, TypeVar

from esker.store.engine.ports import BadDatabase, Connection, Database, Reads
from esker.store.engine.sqlite import closed_on_failure, connect
from esker.store.upkeep.inspection import DATABASE_NAME
from esker.store.upkeep.migrations import FORMAT
from esker.store.upkeep.place import NO_DRIVER

T = TypeVar("T")
MOST: Final = 100
"""Terrains of one answer."""

_SELECT: Final = """
SELECT t.id, t.created,
  coalesce((SELECT at FROM moments WHERE terrain=t.id ORDER BY clock DESC LIMIT 1), t.created) AS changed,
  coalesce((SELECT max(clock) FROM ops WHERE terrain=t.id), 0),
  (SELECT count(*) FROM links WHERE terrain=t.id AND revoked IS NULL),
  t.title
FROM terrains t
"""


class Kept(NamedTuple):
    """One terrain of a server. Times are seconds since 1970."""

    id: str
    created: float
    changed: float
    """When the last op came; when it was made, where none has come."""
    clock: int
    links: int
    """Links that work."""
    title: str


class Visit:
    """Another program on the database of a server that may be running. It reads, and writes links; it orders no op.

    >>> import tempfile
    >>> from esker.store.journal import Journal
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     Journal(Path(folder)).close()
    ...     with Visit(Path(folder)) as visit:
    ...         [terrain.title for terrain in all_kept(visit)]
    []
    """

    def __init__(self, data: Path, database: str = "") -> None:
        """``database``: the url of a shared one; empty: the file in ``data``.

        Raises FileNotFoundError where nothing was kept yet, ValueError where the format is another one; of a shared
        database BadDatabase and Unreachable.
        """
        self._store: Store = _shared(database) if database else _File(data)

    def __enter__(self) -> Visit:
        return self

    def __exit__(self, *_: object) -> None:
        self._store.close()

    def reader(self) -> Connection:
        """What statements are read by."""
        return self._store.reader()

    def submit(self, write: Callable[[Connection], T], terrain: str | None = None) -> Future[T]:  # noqa: ARG002
        """Runs ``write`` in a transaction. The future holds what it returned or raised.

        No lease fences it, whoever has the terrain: a new link is read by all servers, and takes nothing from one.
        """
        return self._store.submit(write)


class Store(Database, Protocol):
    """What a visit needs of an engine."""

    def close(self) -> None:
        """Ends every connection."""


def _shared(database: str) -> Store:
    try:
        from esker.store.engine.postgres.visiting import visited
    except ImportError:
        raise BadDatabase(NO_DRIVER) from None
    return visited(database)


class _File:
    """The database file of a data folder."""

    def __init__(self, data: Path) -> None:
        path = data / DATABASE_NAME
        if not path.is_file():
            raise FileNotFoundError(f"There is no {DATABASE_NAME} in {data}: no server has kept anything there.")
        self._db = connect(path)
        with closed_on_failure(self._db):
            found = int(self._db.execute("PRAGMA user_version").fetchone()[0])
            if found != FORMAT:
                older = "an older Esker: start the server once" if found < FORMAT else "a newer Esker"
                raise ValueError(f"{path} is of {older} (format {found}, not {FORMAT}).")

    def close(self) -> None:
        self._db.close()

    def reader(self) -> Connection:
        return self._db

    def submit(self, write: Callable[[Connection], T], terrain: str | None = None) -> Future[T]:  # noqa: ARG002
        """Runs ``write`` now: the future is done."""
        future: Future[T] = Future()
        try:
            self._db.execute("BEGIN IMMEDIATE")
            try:
                result = write(self._db)
            except BaseException:
                self._db.execute("ROLLBACK")
                raise
            self._db.execute("COMMIT")
            future.set_result(result)
        except Exception as error:
            future.set_exception(error)
        return future


def all_kept(store: Reads, skip: int = 0, most: int = MOST) -> list[Kept]:
    """The terrains that were changed last come first. ``skip``: so many of them are left out."""
    ordered = _SELECT + " ORDER BY changed DESC, t.id LIMIT ? OFFSET ?"
    return [_kept(store, row) for row in store.reader().execute(ordered, (most, skip)).fetchall()]


def kept_one(store: Reads, terrain: str) -> Kept | None:
    """Returns one terrain that the server keeps, or None."""
    row = store.reader().execute(_SELECT + " WHERE t.id=?", (terrain,)).fetchone()
    return None if row is None else _kept(store, row)


def count_kept(store: Reads) -> int:
    """Returns the number of terrains that the server keeps."""
    return int(store.reader().execute("SELECT count(*) FROM terrains").fetchone()[0])


def _kept(store: Reads, row: tuple[Any, ...]) -> Kept:
    terrain, created, changed, clock, links, title = row
    later = _title_since(store.reader(), terrain)
    return Kept(terrain, created, changed, clock, links, (title or "") if later is None else later)


def _title_since(db: Connection, terrain: str) -> str | None:
    """The title that ops gave the terrain after its newest snapshot, or None where none did."""
    with closing(
        db.execute(
            "SELECT op FROM ops WHERE terrain=?1 AND clock > (SELECT max(clock) FROM snapshots WHERE terrain=?1)"
            " AND op LIKE '%\"terrain.set\"%' ORDER BY clock DESC",
            (terrain,),
        )
    ) as rows:
        for (text,) in rows:
            title = _title_of(json.loads(text))
            if title is not None:
                return title
    return None


def _title_of(op: dict[str, Any]) -> str | None:
    """The title that an op sets last."""
    if op["type"] == "group":
        titles = [_title_of(part) for part in op["ops"]]
        return next((title for title in reversed(titles) if title is not None), None)
    title = op["fields"].get("title") if op["type"] == "terrain.set" else None
    return title if isinstance(title, str) else None
