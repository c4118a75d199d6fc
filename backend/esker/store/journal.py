"""The journal: append-only ops with the clock as key (DESIGN 13).

One writer serves all rooms: whatever is queued when a commit ends goes into the next one (group commit). An op is
acknowledged after the commit that holds it, so ``kill -9`` loses nothing that was acknowledged. What a commit is, and
on what it lies, is the engine's (``engine/``): SQLite in the data folder, or PostgreSQL.

Tables (``upkeep/migrations.py``): ``terrains`` (id, title), ``ops`` (terrain, clock, client, counter, author, op),
``snapshots`` (terrain, clock, document as ``document.wire.Compressed``), ``grids`` (terrain, digest: every grid that a
layer of the terrain ever was, written in the same commit as the op or the birth that names it); ``store/access.py``,
``store/timestamps.py`` and ``store/upkeep/folds.py`` use others. Any clock can be opened again; of old gestures only
the last op stays (``store/upkeep/compaction.py``).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Future
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, Final, NamedTuple, TypeVar

from esker import contract as c
from esker.document.former import read_document, read_op
from esker.document.history.folding import SILENT, UNLIMITED, silent
from esker.document.ops import Refusal, StrokeSet
from esker.document.wire import Compressed, decompressed, op_json
from esker.store import lessons, timestamps
from esker.store.engine.ports import Connection, Engine, Write
from esker.store.engine.ports import Unwritable as Unwritable
from esker.store.engine.sqlite import Sqlite
from esker.store.row import Row as Row
from esker.store.row import ordered_json as ordered_json
from esker.store.space import Space
from esker.store.upkeep import folds, migrations
from esker.store.writing import Snapshots, contents, name_grids, put_snapshot

T = TypeVar("T")

HISTORY_BYTES: Final = 256 << 20
"""What the operations of one terrain may take: some 200 hours of drawing without a pause."""
COUNTED_TERRAINS: Final = 10_000


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
        engine: Engine | None = None,
    ) -> None:
        """``directory``: the data folder; ``space``: the disk that the server may use; ``quota``: bytes that the
        operations of one terrain may take; ``engine``: the database (default: ``directory/esker.db``, which is opened
        or created). Raises CorruptDatabase, OSError.
        """
        self.directory = directory
        self._quota = quota
        self._sizes: dict[str, int] = {}
        """Bytes of the operations of terrains that were appended to."""
        self._now, self._timestamps = now, timestamps.Timestamps()
        directory.mkdir(parents=True, exist_ok=True)
        self.space = Space(directory) if space is None else space
        self.engine: Engine = Sqlite(directory, now(), self.space) if engine is None else engine
        self.engine.hear_of_again = self._recount
        self._snapshots = Snapshots(self._write_snapshot)
        self.hear_of_full: Callable[[str], object] = lambda _: None
        """Called in the writer's thread with a terrain whose history has no room left."""

    # --- writing ------------------------------------------------------------------------------------------------

    def submit(self, write: Callable[[Connection], T], terrain: str | None = None) -> Future[T]:
        """Runs ``write`` in the next commit (``engine.ports.Database``)."""
        return self.engine.submit(write, terrain)

    @property
    def writable(self) -> bool:
        """Whether the last commit could be written."""
        return self.engine.writable

    @property
    def now(self) -> Callable[[], float]:
        """The date of what is written: this machine's, or the one that several servers have together."""
        return self._now

    @property
    def waiting(self) -> int:
        """Items that wait for a commit, about."""
        return self.engine.waiting

    def need(self, more: int = 0, *, drawing: bool = False) -> None:
        """Asks for room for what is written (``Space.need``); a database elsewhere says itself when it is full."""
        if self.engine.is_local:
            self.space.need(more, drawing=drawing)

    def _recount(self) -> None:
        """What was counted of a commit that is done again is counted again."""
        self._sizes.clear()
        self._timestamps.clear()

    def forget(self, terrain: str) -> None:
        """Forgets what was counted of a terrain: another server may have written meanwhile."""
        self._sizes.pop(terrain, None)
        self._timestamps.forget(terrain)

    def append(
        self,
        terrain: str,
        rows: Sequence[Row],
        people: Sequence[timestamps.Person] = (),
    ) -> Future[None]:
        """Appends ops (and what their authors are called, where that is new).

        Fails with UsedTwice on a clock or id used before, with Unwritable, Unknown, Moved and HistoryFull.
        """
        more, now = sum(len(row.op) for row in rows), self._now()
        made = [(thing, row.author) for row in rows for thing in lessons.begun(row.op)]
        digests = [digest for row in rows for digest in contents(row.op)]

        def write(db: Connection) -> None:
            self._make_room(db, terrain, more)
            db.executemany("INSERT INTO ops VALUES (?,?,?,?,?,?)", ((terrain, *row) for row in rows))
            if rows:
                self._timestamps.note(db, terrain, rows[0].clock, now)
            if people:
                timestamps.keep(db, terrain, people)
            if made:
                lessons.keep_makers(db, terrain, made)
            if digests:
                name_grids(db, terrain, digests)

        def is_one_statement() -> bool:
            return len(rows) == 1 and not (people or made or digests or self._timestamps.is_due(terrain, now))

        return self.submit(Write(write, is_one_statement), terrain)

    def keep_snapshot(self, document: c.Document) -> Future[None]:
        """Has a document that the terrain has now, all of whose ops are committed, written beside them, soon.

        The future fails as that of ``append`` does; nothing that was acknowledged is lost then.
        """
        return self._snapshots.keep(document)

    def _write_snapshot(self, terrain: str, clock: int, kept: Compressed) -> Future[None]:
        def write(db: Connection) -> None:
            if db.execute("SELECT 1 FROM terrains WHERE id=?", (terrain,)).fetchone() is not None:
                self.need(len(kept.data))
                put_snapshot(db, terrain, clock, kept)

        return self.submit(write, terrain)

    def keep_lesson(self, terrain: str, state: str) -> Future[None]:
        """Keeps how the lesson of a terrain stands. Fails with Unwritable."""
        return self.submit(lambda db: lessons.keep_state(db, terrain, state), terrain)

    def _make_room(self, db: Connection, terrain: str, more: int) -> None:
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
        self.need(more, drawing=True)
        self._sizes[terrain] += more

    def shrunk(self, terrain: str, less: int) -> None:
        """``less`` characters of operations were folded away. For the writer's thread, within the commit."""
        if terrain in self._sizes:
            self._sizes[terrain] -= less

    def crowded(self, terrain: str) -> bool:
        """Returns whether the operations of a terrain take more than half of what they may, as far as that was
        counted."""
        return self._sizes.get(terrain, 0) > self._quota // 2

    def create(
        self,
        document: c.Document,
        also: Callable[[Connection], Any] | None = None,
        by: str | None = None,
        kept: Compressed | None = None,
    ) -> Future[None]:
        """A new terrain, born as ``document``, with what ``also`` writes, or neither.

        ``by``: the terrain whose rows ``also`` writes beside those of the new one. ``kept``: the document as it is
        written, where somebody compressed it before; else this does. Fails with UsedTwice when the id exists.
        """
        written = Compressed.of(document) if kept is None else kept

        def write(db: Connection) -> None:
            self.need(len(written.data))
            db.execute("INSERT INTO terrains (id,created) VALUES (?,?)", (document.id, self._now()))
            name_grids(db, document.id, (layer.content for layer in (*document.layers, *document.deleted_layers)))
            put_snapshot(db, document.id, document.clock, written)
            if also is not None:
                also(db)

        return self.submit(write, by)

    # --- reading ------------------------------------------------------------------------------------------------

    def reader(self) -> Connection:
        """This thread's own read connection."""
        return self.engine.reader()

    def at_one_moment(self) -> AbstractContextManager[Connection]:
        """Everything that this thread reads within is of the same commit."""
        return self.engine.at_one_moment()

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
        with self.at_one_moment() as db:
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

    def document(self, terrain: str, upto: int | None = None) -> StrokeSet | None:
        """The document at clock ``upto`` (default: now), or None. Raises DamagedTerrain when it does not replay."""
        found = self._stored(terrain, upto)
        return None if found is None else _replayed(terrain, *found)

    def load(self, terrain: str, upto: int | None = None) -> Loaded | None:
        """What a room begins with at clock ``upto`` (default: now), or None. Raises DamagedTerrain as ``document``."""
        with self.at_one_moment() as db:
            found = self._stored(terrain, upto)
            if found is None:
                return None
            counters = db.execute("SELECT client, max(counter) FROM ops WHERE terrain=? GROUP BY client", (terrain,))
            known = dict(counters.fetchall())
        return Loaded(_replayed(terrain, *found), [_as_read(row) for row in found[1]], known)

    def _stored(self, terrain: str, upto: int | None) -> tuple[tuple[int, bytes], list[Row]] | None:
        """The newest snapshot up to a clock, with its own, and the rows since. Raises DamagedTerrain."""
        with self.at_one_moment() as db:  # what is being folded meanwhile is, or is not
            snapshot = db.execute(
                "SELECT clock, document FROM snapshots WHERE terrain=? AND clock<=? ORDER BY clock DESC LIMIT 1",
                (terrain, 2**62 if upto is None else upto),
            ).fetchone()
            if snapshot is None:
                return None
            clock = int(snapshot[0])
            return (clock, snapshot[1]), self.steps(terrain, clock, upto)

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

    def backup(self) -> Path | None:
        """Copies the live database; readers and the writer go on meanwhile. None where others keep copies of it.

        Raises NoSpace, store.backup.BadCopy, OSError, sqlite3.Error.
        """
        return self.engine.backup(self._now())

    def close(self) -> None:
        """Commits what is queued, then closes every connection."""
        self._snapshots.close()
        self.engine.close()


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


def _replayed(terrain: str, snapshot: tuple[int, bytes], rows: Sequence[Row]) -> StrokeSet:
    clock, kept = snapshot
    try:
        text = decompressed(kept)
    except ValueError as error:
        raise DamagedTerrain(f"the journal of {terrain} at op {clock}: {error}") from error
    return replay(StrokeSet.from_document(read_document(text)), rows)


def _as_read(row: Row) -> Row:
    """The row with its op as it was understood: clients that resume get the numbers that the document has."""
    return row if row.op == SILENT else row._replace(op=op_json(read_op(row.op)))
