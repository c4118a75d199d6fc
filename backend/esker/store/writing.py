"""What the journal's writer puts into the database beside ops: snapshots, names of grids.

A snapshot is encoded and compressed in a thread of its own, and written after the ops that it stands for. Of a heavy
document that takes as long as many commits, and whoever draws anywhere on the server waits for commits.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Iterable
from concurrent.futures import Future
from functools import partial
from typing import Final

from esker import contract as c
from esker.document.former import read_op
from esker.document.wire import Compressed
from esker.store.engine.ports import Connection

log = logging.getLogger("esker.store")

SNAPSHOT_EVERY: Final = 500
"""Ops between snapshots: opening a terrain replays about this many; twice as many where a kill took the last one."""
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


def put_snapshot(db: Connection, terrain: str, clock: int, kept: Compressed) -> None:
    """Keeps a document as a snapshot, and thins out those before it. The title of the terrain is that of its newest
    snapshot: who lists terrains reads no document for it."""
    db.execute(
        "INSERT INTO snapshots VALUES (?,?,?) ON CONFLICT (terrain, clock) DO UPDATE SET document=excluded.document",
        (terrain, clock, kept.data),
    )
    db.execute("UPDATE terrains SET title=? WHERE id=?", (kept.title, terrain))
    # The first snapshot (the terrain's birth) stays for ever, the two newest do, and between them one in each stretch
    # of the history: no clock is much farther than a stretch from a snapshot before it. Stretches double as it grows.
    stretch = SNAPSHOT_EVERY
    while stretch * MILESTONES < clock:
        stretch *= 2
    db.execute(
        "DELETE FROM snapshots WHERE terrain=?1 AND clock > (SELECT min(clock) FROM snapshots WHERE terrain=?1)"
        " AND clock NOT IN (SELECT clock FROM snapshots WHERE terrain=?1 ORDER BY clock DESC LIMIT 2)"
        " AND clock NOT IN (SELECT min(clock) FROM snapshots WHERE terrain=?1 AND clock >= ?2 GROUP BY clock / ?2)",
        (terrain, stretch),
    )


class Snapshots:
    """Has documents compressed and written, one after another. A kill takes what waits: it only shortens a replay."""

    def __init__(self, write: Callable[[str, int, Compressed], Future[None]]) -> None:
        """``write``: has the document of a terrain at a clock written."""
        self._write = write
        self._waiting: dict[str, tuple[c.Document, Future[None]]] = {}
        self._changed = threading.Condition()
        self._closed = False
        self._thread = threading.Thread(target=self._run, name="snapshots", daemon=True)
        self._thread.start()

    def keep(self, document: c.Document) -> Future[None]:
        """The future is done once the document is written, or once a newer one of its terrain took its place."""
        kept: Future[None] = Future()
        with self._changed:
            before = self._waiting.pop(document.id, None)
            self._waiting[document.id] = (document, kept)
            self._changed.notify()
        if before is not None:
            before[1].set_result(None)
        return kept

    def close(self) -> None:
        """Ends the thread once what waits was given to the writer."""
        with self._changed:
            self._closed = True
            self._changed.notify()
        self._thread.join()

    def _run(self) -> None:
        while (following := self._next()) is not None:
            document, kept = following
            try:
                written = self._write(document.id, document.clock, Compressed.of(document))
            except Exception as error:
                log.exception("no snapshot of %s", document.id)
                kept.set_exception(error)
            else:
                written.add_done_callback(partial(_hand_on, kept))
            del following, document, kept  # nothing of a room is held while this waits

    def _next(self) -> tuple[c.Document, Future[None]] | None:
        with self._changed:
            while not self._waiting:
                if self._closed:
                    return None
                self._changed.wait()
            return self._waiting.pop(next(iter(self._waiting)))


def _hand_on(to: Future[None], done: Future[None]) -> None:
    """What became of ``done`` becomes of ``to``."""
    error = done.exception()
    if error is None:
        to.set_result(None)
    else:
        to.set_exception(error)
