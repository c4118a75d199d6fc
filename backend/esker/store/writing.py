"""What the journal's writer puts into the database beside ops: snapshots, names of grids; and the length of its log."""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Final

from esker import contract as c
from esker.document.former import read_op
from esker.document.wire import document_json

SNAPSHOT_EVERY: Final = 500
"""Ops between snapshots: opening a terrain replays at most this many."""
MILESTONES: Final = 8
"""Snapshots that stay, spread over the history: an earlier clock is opened without replaying all before it."""
LOG_BYTES: Final = 5 << 20
"""How long the write-ahead log is from the start: more than the 1,000 pages after which it is begun anew. One that a
large commit made longer is cut to this when it is begun anew."""


def lengthen(log: Path) -> None:
    """Gives a write-ahead log its length at once, by zeros that no reader takes for its frames.

    To sync a file that has grown a file system waits for its own journal, and so for what others have just written: on
    a busy disk hundreds of milliseconds, now and then, for a commit that takes one where the log is written over.
    """
    with suppress(OSError), log.open("ab") as file:  # where the disk has no room, commits only take longer
        file.write(bytes(max(0, LOG_BYTES - file.tell())))
        file.flush()
        os.fsync(file.fileno())


def contents(op: str) -> list[str]:
    """Digests of the grids that an op, as JSON text, names first."""
    if '"layer.add"' not in op:
        return []
    parsed = read_op(op)
    parts = parsed.ops if isinstance(parsed, c.Group) else (parsed,)
    return [part.layer.content for part in parts if isinstance(part, c.AddLayer)]


def name_grids(db: sqlite3.Connection, terrain: str, digests: Iterable[str]) -> None:
    """Writes down that a terrain has these grids, so that nobody sweeps them."""
    db.executemany("INSERT OR IGNORE INTO grids VALUES (?,?)", ((terrain, digest) for digest in digests))


def put_snapshot(db: sqlite3.Connection, document: c.Document) -> None:
    """Keeps a document as a snapshot, and thins out those before it."""
    db.execute(
        "INSERT OR REPLACE INTO snapshots VALUES (?,?,?)", (document.id, document.clock, document_json(document))
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
