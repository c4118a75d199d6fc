"""Reads a history of which bursts of operations were folded (``document.history.folding``, ``compaction``).

``folds`` (terrain, last, first, kept): of the clocks first to last, ``kept`` still have an op; at the others nothing
happens. They follow each other without a gap from the terrain's first clock on. ``folded_ids`` (terrain, client,
counter, upto, clock): ops client:counter to client:upto, whose work the op at ``clock`` does now.
"""

from __future__ import annotations

from collections.abc import Sequence

from esker.store.engine.ports import Connection
from esker.store.row import Row


class MissingOps(Exception):
    """A folded stretch has fewer ops than were kept."""


def folded_upto(db: Connection, terrain: str) -> int:
    """The last clock of the folded part of a history; 0 where nothing is folded."""
    return int(db.execute("SELECT coalesce(max(last), 0) FROM folds WHERE terrain=?", (terrain,)).fetchone()[0])


def find(db: Connection, terrain: str, client: str, counter: int) -> int | None:
    """The clock of the op that does the work of a folded one, by its id."""
    row = db.execute(
        "SELECT upto, clock FROM folded_ids WHERE terrain=? AND client=? AND counter<=? ORDER BY counter DESC LIMIT 1",
        (terrain, client, counter),
    ).fetchone()
    return None if row is None or row[0] < counter else int(row[1])


def check(db: Connection, terrain: str, after: int, upto: int) -> None:
    """Whether all ops are there that folding kept of the stretches around after < clock <= upto. Raises MissingOps."""
    stretches = db.execute(
        "SELECT first, last, kept, (SELECT count(*) FROM ops WHERE terrain=?1 AND clock BETWEEN first AND last)"
        " FROM folds WHERE terrain=?1 AND last>?2 AND first<=?3",
        (terrain, after, upto),
    )
    for first, last, kept, found in stretches:
        if found != kept:
            raise MissingOps(f"of the ops {first} to {last}, {kept} were kept and {found} are there")


def filled(rows: Sequence[Row], silent: Row, after: int, upto: int) -> list[Row]:
    """``rows`` with a silent one for each clock from ``after`` to ``upto`` that has none."""
    out: list[Row] = []
    clock = after
    for row in rows:
        out += [silent._replace(clock=at) for at in range(clock + 1, min(row.clock, upto + 1))]
        out.append(row)
        clock = row.clock
    out += [silent._replace(clock=at) for at in range(clock + 1, upto + 1)]
    return out
