"""What the journal's writer puts into the database beside ops: snapshots, names of grids."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from esker import contract as c
from esker.document.former import read_op
from esker.document.wire import document_json
from esker.store.engine.ports import Connection

SNAPSHOT_EVERY: Final = 500
"""Ops between snapshots: opening a terrain replays at most this many."""
MILESTONES: Final = 8
"""Snapshots that stay, spread over the history: an earlier clock is opened without replaying all before it."""


def contents(op: str) -> list[str]:
    """Digests of the grids that an op, as JSON text, names first."""
    if '"layer.add"' not in op:
        return []
    parsed = read_op(op)
    parts = parsed.ops if isinstance(parsed, c.Group) else (parsed,)
    return [part.layer.content for part in parts if isinstance(part, c.AddLayer)]


def name_grids(db: Connection, terrain: str, digests: Iterable[str]) -> None:
    """Writes down that a terrain has these grids, so that nobody sweeps them."""
    db.executemany(
        "INSERT INTO grids VALUES (?,?) ON CONFLICT DO NOTHING", [(terrain, digest) for digest in sorted(set(digests))]
    )


def put_snapshot(db: Connection, document: c.Document, text: str | None = None) -> None:
    """Keeps a document as a snapshot, and thins out those before it. ``text``: the document as JSON, where it was
    encoded before: of a heavy one that takes as long as many commits."""
    text = document_json(document) if text is None else text
    db.execute(
        "INSERT INTO snapshots VALUES (?,?,?) ON CONFLICT (terrain, clock) DO UPDATE SET document=excluded.document",
        (document.id, document.clock, text),
    )
    # The first snapshot (the terrain's birth) stays for ever, the two newest do, and between them one in each stretch
    # of the history: no clock is much farther than a stretch from a snapshot before it. Stretches double as it grows.
    stretch = SNAPSHOT_EVERY
    while stretch * MILESTONES < document.clock:
        stretch *= 2
    db.execute(
        "DELETE FROM snapshots WHERE terrain=?1 AND clock > (SELECT min(clock) FROM snapshots WHERE terrain=?1)"
        " AND clock NOT IN (SELECT clock FROM snapshots WHERE terrain=?1 ORDER BY clock DESC LIMIT 2)"
        " AND clock NOT IN (SELECT min(clock) FROM snapshots WHERE terrain=?1 AND clock >= ?2 GROUP BY clock / ?2)",
        (document.id, stretch),
    )
