"""Moving a whole store from one engine to another: terrain by terrain, verified, and resumed where it was cut off.

The source is read and never changed. A terrain is copied in pieces, then read from both sides and compared by digest,
then marked as done in the target; one that was cut off is begun anew. Until all is done the target says that it is
half moved, and no server starts on it (``refuse_half_moved``). Both must be of the present format.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any, Final, NamedTuple

from esker.store.engine.ports import Connection
from esker.store.journal import Journal
from esker.store.upkeep import migrations

MOVING: Final = "moving"
"""The fact that says from where a store is being moved here."""
MARK: Final = "moved:"
"""Before the id of a terrain: the fact that it is here, with its digest."""
ROWS: Final = 1_000
CHANGED: Final = "is not in the target as it is in the source. Has something changed it meanwhile? Run it again."


class Table(NamedTuple):
    """A table with its columns, what comes after the terrain in its key, and the column that names the terrain."""

    name: str
    columns: str
    key: str
    of: str | None = "terrain"
    """None for a table that is copied as a whole."""


TABLES: Final = (
    Table("terrains", "id,created,deleted,title", "id", "id"),
    Table("ops", "terrain,clock,client,counter,author,op", "clock"),
    Table("snapshots", "terrain,clock,document", "clock"),
    Table("links", "id,terrain,role,name,hash,created,revoked,parent", "id"),
    Table("grids", "terrain,digest", "digest"),
    Table("moments", "terrain,clock,at", "clock"),
    Table("people", "terrain,client,name,colour,person,conducts", "client"),
    Table("previews", "terrain,token,shown", "terrain"),
    Table("folds", "terrain,last,first,kept", "last"),
    Table("folded_ids", "terrain,client,counter,upto,clock", "client,counter"),
    Table("lessons", "terrain,state", "terrain"),
    Table("makers", "terrain,thing,client", "thing"),
    Table("classes", "id,terrain,title,created,clock,document,together,places,code,code_until,ended", "id", None),
    Table("copies", "class,number,terrain,frozen", "class,number", None),
    Table("pupils", "link,class,number,name,joined", "link", None),
)
"""In the order in which rows are written: operations before what says that some were folded."""


class CannotMove(Exception):
    """Nothing more was moved; the message says why."""


class Moved(NamedTuple):
    """What a move did: terrains that are there now, those of them that were there before, and rows that were copied."""

    terrains: int
    before: int
    rows: int


def refuse_half_moved(journal: Journal) -> None:
    """Raises CannotMove where a move into this store has not come to its end."""
    source = migrations.fact(journal.reader(), MOVING)
    if source is not None:
        raise CannotMove(f"A move from {source} to here has not come to its end. Run `esker move` again: it goes on.")


def move(source: Journal, target: Journal, name: str, tell: Callable[[int, int], object] = lambda *_: None) -> Moved:
    """Copies everything. ``name``: of the source, in words; ``tell``: called with terrains that are done, and all.

    Call ``finish`` when grids are there, too. Raises CannotMove, store.journal.Unwritable.
    """
    refuse_half_moved(source)
    under_way = migrations.fact(target.reader(), MOVING)
    there = int(target.reader().execute("SELECT count(*) FROM terrains").fetchone()[0])
    if under_way is None and there:
        raise CannotMove(f"The target keeps {there} terrains already. Choose one that is empty.")
    if under_way not in (None, name):
        raise CannotMove(f"A move from {under_way} into this target has not come to its end. Go on with that one.")
    _state(target, MOVING, name)
    terrains = [str(row[0]) for row in source.reader().execute("SELECT id FROM terrains ORDER BY id")]
    before, rows = 0, 0
    for done, terrain in enumerate(terrains):
        tell(done, len(terrains))
        digest = digest_of(source, terrain)
        if migrations.fact(target.reader(), MARK + terrain) == digest:
            before += 1
            continue
        rows += _copy(source, target, terrain)
        if digest_of(target, terrain) != digest:
            raise CannotMove(f"Terrain {terrain} {CHANGED}")
        _state(target, MARK + terrain, digest)
    tell(len(terrains), len(terrains))
    rows += _copy(source, target, None)
    if digest_of(target, None) != digest_of(source, None):
        raise CannotMove(f"What belongs to classes {CHANGED}")
    return Moved(len(terrains), before, rows)


def finish(source: Journal, target: Journal) -> None:
    """The target is whole: a server may start on it."""
    since = migrations.fact(source.reader(), "swept_from")

    def write(db: Connection) -> None:
        if since is not None:
            migrations.state(db, "swept_from", since)
        db.execute("DELETE FROM server WHERE key=? OR key LIKE ?", (MOVING, f"{MARK}%"))

    target.submit(write).result()


def digest_of(journal: Journal, terrain: str | None) -> str:
    """A digest over all rows of a terrain, or (None) over those of no terrain: the same in every engine.

    Engines order texts differently, so it is the sum of the digests of the rows.
    """
    total = 0
    with journal.at_one_moment() as db:
        for table in _tables(terrain):
            for row in _rows(db, table, terrain):
                plain = f"{table.name} {list(row)!r}".encode()
                total += int.from_bytes(hashlib.sha256(plain).digest())
    return f"{total % 2**256:064x}"


def _state(journal: Journal, key: str, value: str) -> None:
    journal.submit(lambda db: migrations.state(db, key, value)).result()


def _tables(terrain: str | None) -> list[Table]:
    return [table for table in TABLES if (table.of is None) == (terrain is None)]


def _copy(source: Journal, target: Journal, terrain: str | None) -> int:
    """Puts the rows of the source in the place of those that are there; returns how many."""
    count = 0
    for table in _tables(terrain):
        where, values = ("", ()) if terrain is None else (f" WHERE {table.of}=?", (terrain,))
        target.submit(partial(_run, f"DELETE FROM {table.name}{where}", values)).result()
    with source.at_one_moment() as db:
        for table in _tables(terrain):
            piece: list[Sequence[Any]] = []
            for row in _rows(db, table, terrain):
                piece.append(row)
                if len(piece) == ROWS:
                    count += _put(target, table, piece)
                    piece = []
            count += _put(target, table, piece)
    return count


def _run(sql: str, values: Sequence[Any], db: Connection) -> None:
    db.execute(sql, values)


def _put(target: Journal, table: Table, rows: list[Sequence[Any]]) -> int:
    if rows:
        marks = ",".join("?" * len(rows[0]))
        sql = f"INSERT INTO {table.name} ({table.columns}) VALUES ({marks})"
        target.submit(lambda db: db.executemany(sql, rows)).result()
    return len(rows)


def _rows(db: Connection, table: Table, terrain: str | None) -> Iterator[Sequence[Any]]:
    """All rows, a piece at a time, in the engine's own order."""
    key = table.key.split(",")
    places = [table.columns.split(",").index(name) for name in key]
    last: list[Any] | None = None
    while True:
        conditions = [] if terrain is None else [f"{table.of}=?"]
        values = [] if terrain is None else [terrain]
        if last is not None:
            conditions.append(f"({table.key}) > ({','.join('?' * len(key))})")
            values += last
        where = f" WHERE {' AND '.join(conditions)}" if conditions else ""
        sql = f"SELECT {table.columns} FROM {table.name}{where} ORDER BY {table.key} LIMIT {ROWS}"
        found = db.execute(sql, values).fetchall()
        yield from found
        if len(found) < ROWS:
            return
        last = [found[-1][place] for place in places]
