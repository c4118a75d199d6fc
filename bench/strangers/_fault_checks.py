"""What must hold after servers were killed: nothing acknowledged is lost, every file opens."""

from __future__ import annotations

import sqlite3
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import Any, Final

from esker import contract as c
from esker.document.wire import decompressed, op_json
from esker.patchwork.raster import rasters
from esker.store.access import Access
from esker.store.grids import GridStore
from esker.store.journal import Journal, Row
from esker.store.upkeep import folds, migrations
from esker.store.upkeep.backup import copies_of
from esker.store.upkeep.inspection import DATABASE_NAME, problem_of

OLD_FORMAT: Final = 5
OLD_OPS: Final = 20_000
OLD_DOCUMENTS: Final = 30


class Checks:
    """Looks for what was acknowledged, while a server runs."""

    def __init__(self, data: Path) -> None:
        self._path = data / DATABASE_NAME
        self._seen: set[str] = set()
        self.lost: dict[str, int] = {}
        self.problems: list[str] = []

    def look(self, acked: Sequence[dict[str, int]], *, everything: bool = False) -> None:
        """Finds each id at its clock, or folded into a later one."""
        with closing(sqlite3.connect(self._path, timeout=30)) as db:
            for each in acked:
                for op_id, clock in list(each.items()):
                    if op_id in self._seen and not everything:
                        continue
                    self._seen.add(op_id)
                    client, _, counter = op_id.partition(":")
                    row = db.execute(
                        "SELECT clock FROM ops WHERE terrain='t' AND client=? AND counter=?", (client, int(counter))
                    ).fetchone()
                    found = row[0] if row else folds.find(db, "t", client, int(counter))
                    # Sent again after it was folded, it was acknowledged with the clock that it stands at now.
                    if found is None or found < clock:
                        self.lost[op_id] = clock


def old_database(data: Path) -> None:
    """A database of an earlier format, OLD_FORMAT: a terrain of many ops, and some of heavy documents."""
    journal = Journal(data)
    journal.create(c.Document(id="t")).result()
    for k in range(OLD_DOCUMENTS):
        journal.create(_heavy(f"u{k}")).result()
    for start in range(0, OLD_OPS, 1000):
        rows = [
            Row(k + 1, "c", k, "c", op_json(c.SetTerrain(fields=c.TerrainFields(title=f"title {k}"))))
            for k in range(start, start + 1000)
        ]
        journal.append("t", rows).result()
    Access(journal).add("t", "owner", "o").result()
    journal.close()
    with closing(sqlite3.connect(data / DATABASE_NAME, isolation_level=None)) as db:
        db.execute("DROP TRIGGER ops_used_once")
        for table in ("folds", "folded_ids", "lessons", "makers", "pupils", "copies", "classes"):
            db.execute(f"DROP TABLE {table}")
        for table, column in (("people", "person"), ("people", "conducts"), ("terrains", "title")):
            db.execute(f"ALTER TABLE {table} DROP COLUMN {column}")
        db.create_function("text_of", 1, decompressed, deterministic=True)
        db.execute("UPDATE snapshots SET document=text_of(document)")
        db.execute(f"PRAGMA user_version={OLD_FORMAT}")


def _heavy(terrain: str) -> c.Document:
    ends = {"first": (0.0, 0.0, 0.0), "last": (900.0, 0.0, 5.0)}
    curve = tuple((float(k), k * k % 97 / 3) for k in range(40))
    made = [c.Stroke.model_validate({"id": f"s{k}", "kind": "profile", "curve": curve, **ends}) for k in range(200)]
    return c.Document(id=terrain, strokes=tuple(made))


def opens(data: Path) -> list[str]:
    """What is wrong with a database whose migration was killed, once it was opened again."""
    out = []
    with closing(sqlite3.connect(data / DATABASE_NAME)) as db:
        if migrations.format_of(db) not in range(OLD_FORMAT, migrations.FORMAT + 1):
            out.append(f"a migration left the format {migrations.format_of(db)}")
    journal = Journal(data)
    try:
        loaded = journal.load("t")
        if loaded is None or loaded.document.clock != OLD_OPS or len(journal.rows("t", 0)) != OLD_OPS:
            out.append("a migration lost operations")
        for k in range(OLD_DOCUMENTS):
            heavy = journal.load(f"u{k}")
            if heavy is None or heavy.document.to_document() != _heavy(f"u{k}"):
                out.append(f"a migration lost document {k}")
    finally:
        journal.close()
    return out


def final(data: Path, terrain: str, doomed: Sequence[str]) -> dict[str, Any]:
    """The data folder of a server that was stopped well: its document, and what is wrong with its files."""
    problems = [
        f"{path.name}: {text}" for path in (data / DATABASE_NAME, *copies_of(data)) if (text := problem_of(path))
    ]
    journal, grids = Journal(data), GridStore(data)
    try:
        loaded = journal.load(terrain)
        assert loaded is not None
        document = loaded.document.to_document()
        steps = journal.steps(terrain, 0)
        if [row.clock for row in steps] != list(range(1, document.clock + 1)):
            problems.append("a clock is missing")
        layers = (*document.layers, *document.deleted_layers)
        problems += [f"{a.id}: its grid is damaged" for a in layers if not rasters.verify(grids.read(a.content))]
        db = journal.reader()
        for table in ("terrains", "ops", "snapshots", "links"):
            column = "id" if table == "terrains" else "terrain"
            left = db.execute(f"SELECT count(*) FROM {table} WHERE {column} LIKE 'doomed-%'").fetchone()[0]
            if left:
                problems.append(f"{left} rows of {len(doomed)} deleted terrains are left in {table}")
        folded = document.clock - len(journal.rows(terrain, 0))
    finally:
        journal.close()
    left_over = [path.name for path in data.rglob("*") if path.name.startswith(".work-") or path.suffix == ".part"]
    grids.sweep(set(grids_named(data)))
    after = [path.name for path in data.rglob("*") if path.name.startswith(".work-") or path.suffix == ".part"]
    if after:
        problems.append(f"left over: {left_over}")
    return {
        "document": document, "clock": document.clock, "folded": folded, "layers": len(layers), "problems": problems,
    }  # fmt: skip


def grids_named(data: Path) -> set[str]:
    """Digests that the database names."""
    with closing(sqlite3.connect(data / DATABASE_NAME)) as db:
        return {str(row[0]) for row in db.execute("SELECT digest FROM grids")}
