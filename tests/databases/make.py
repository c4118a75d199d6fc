"""Writes a small database of the format that this checkout makes, as SQL: ``python -m tests.databases.make FILE``.

Run it at each release that raises the format. The files are never written again: they are what was released.
"""

from __future__ import annotations

import sqlite3
import sys
import tempfile
from contextlib import closing
from pathlib import Path

from esker import contract as c
from esker.document.wire import Compressed, op_json
from esker.store.access import Access
from esker.store.classes import Class, ClassStore
from esker.store.journal import Journal, Row
from esker.store.upkeep.inspection import DATABASE_NAME

ROLES: tuple[c.Role, ...] = ("owner", "edit", "view")


def _stroke(i: int) -> c.Stroke:
    ends = {"first": (1000, 1000 + i, 0), "last": (3000, 1000, 5)}
    return c.Stroke.model_validate({"id": f"s{i}", "kind": "profile", "curve": ((0, 0), (9, 50)), **ends})


def main(target: Path) -> None:
    """One terrain "t" of seven ops by client "c", a link of each role, and a class "k" that begins as a stroke."""
    with tempfile.TemporaryDirectory() as folder:
        journal = Journal(Path(folder))
        journal.create(c.Document(id="t")).result()
        ops: list[c.Op] = [c.BeginStroke(stroke=_stroke(i)) for i in range(5)]
        ops += [c.SetTerrain(fields=c.TerrainFields(title="An old one")), c.DeleteStroke(stroke="s3")]
        journal.append("t", [Row(i + 1, "c", i + 1, "c", op_json(op)) for i, op in enumerate(ops)]).result()
        access = Access(journal)
        secrets = [access.add("t", role, role).result()[1] for role in ROLES]
        begins = c.Document(id="t", clock=1, strokes=(_stroke(0),))
        made = Class("k", "t", "A class", journal.now(), 1, 1, 30, None, 0.0, None)
        ClassStore(journal).make(made, Compressed.of(begins), 1, 1).result()
        journal.close()
        with closing(sqlite3.connect(Path(folder) / DATABASE_NAME)) as db:
            version = db.execute("PRAGMA user_version").fetchone()[0]
            lines = [f"-- secrets: {' '.join(secrets)}", f"PRAGMA user_version={version};", *db.iterdump()]
    target.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
