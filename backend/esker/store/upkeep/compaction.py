"""Folds old gestures of histories behind snapshots, a stretch at a time (docs/decisions/0038-folding.md).

A stretch is of at most ``PIECE`` clocks, lies before the newest snapshot, and ends with a snapshot where there is one.
It is read and folded (``document.history.folding``) in the caller's thread; only when the folded ops make of the
document before the stretch what the ops make of it are they put in their place, in one commit of the journal's
writer: a kill leaves the stretch as it was or folded. A stretch that does not fold is written down as one that keeps
all of its ops.
"""

from __future__ import annotations

import logging
import time
from bisect import bisect_right
from collections.abc import Callable, Iterator
from typing import Final, NamedTuple

from esker.document.former import read_op
from esker.document.history.folding import UNLIMITED, Dated, Folded, fold, same
from esker.document.ops import Refusal, StrokeSet
from esker.document.wire import op_json
from esker.store import timestamps
from esker.store.engine.ports import Connection
from esker.store.journal import DamagedTerrain, Journal, Row, Unwritable
from esker.store.upkeep import folds

log = logging.getLogger("esker.compaction")

PIECE: Final = 500
"""Clocks of a stretch: so many ops are read, and at most so many removed in one commit."""
FOLD_AFTER: Final = 7 * 86_400.0
"""Operations are folded when they are this old, seconds."""
CROWDED_AFTER: Final = 3_600.0
"""Operations of a terrain whose history takes more than half of what it may are folded when they are this old."""
ROUND_SECONDS: Final = 60.0
"""How long one round folds; the next one goes on where it ended."""


class Stretch(NamedTuple):
    """A stretch of a history that was folded but is not written. ``ids``: (client, counter, upto, clock)."""

    terrain: str
    first: int
    last: int
    kept: int
    gone: list[int]
    changed: list[tuple[str, int]]
    ids: list[tuple[str, int, int, int]]
    moments: list[int]
    """Clocks of moments in which nothing that is left was done."""
    freed: int
    """Characters of operations that it takes less."""


class Compaction:
    """Folds the histories of one journal. For one thread, which is not the journal's writer."""

    def __init__(
        self,
        journal: Journal,
        now: Callable[[], float] = time.time,
        *,
        fold_after: float = FOLD_AFTER,
        crowded_after: float = CROWDED_AFTER,
        pause: Callable[[float], object] = time.sleep,
    ) -> None:
        """``pause``: called with seconds between two stretches, so that others have as much of the machine."""
        self._journal, self._now, self._pause = journal, now, pause
        self._fold_after, self._crowded_after = fold_after, crowded_after

    def round(self, seconds: float = ROUND_SECONDS, stopped: Callable[[], bool] = lambda: False) -> int:
        """Folds what is old enough, of all terrains, for at most so long. Returns how many ops went.

        A terrain that cannot be read is left as it is. Raises store.journal.Unwritable.
        """
        end, gone = time.monotonic() + seconds, 0
        for terrain in self._due():
            for removed in self._fold(terrain):
                gone += removed
                if stopped() or time.monotonic() >= end:
                    return gone
        return gone

    def terrain(self, terrain: str) -> int:
        """Folds all of one terrain that is old enough. Returns how many ops went."""
        return sum(self._fold(terrain))

    def _due(self) -> list[str]:
        rows = self._journal.reader().execute(
            "SELECT s.terrain FROM (SELECT terrain, max(clock) AS newest FROM snapshots GROUP BY terrain) s"
            " JOIN terrains t ON t.id = s.terrain WHERE t.deleted IS NULL"
            " AND s.newest > coalesce((SELECT max(last) FROM folds WHERE terrain = s.terrain), 0)"
        )
        return [str(row[0]) for row in rows]

    def _fold(self, terrain: str) -> Iterator[int]:
        """Folds stretch after stretch of a terrain; gives how many ops went with each."""
        journal = self._journal
        document: StrokeSet | None = None
        try:
            while (last := self._end(terrain)) is not None:
                began = time.monotonic()
                start = folds.folded_upto(journal.reader(), terrain)
                if document is None or document.clock != start:
                    document = journal.document(terrain, start)
                    if document is None or document.clock > start:
                        return
                stretch, document = self._stretch(document, last)
                if not journal.submit(self._write(stretch), terrain).result():
                    return
                yield len(stretch.gone)
                self._pause(time.monotonic() - began)
        except (DamagedTerrain, Refusal, ValueError) as error:
            log.error("the history of terrain %s is left as it is: %s", terrain, error)
        except Unwritable as error:
            log.warning("nothing more of terrain %s is folded now: %s", terrain, error)

    def _end(self, terrain: str) -> int | None:
        """The last clock of the next stretch; None when nothing is old enough, or not behind a snapshot."""
        db = self._journal.reader()
        done = folds.folded_upto(db, terrain)
        clocks = "SELECT min(clock), max(clock) FROM snapshots WHERE terrain=? AND clock>?"
        following, newest = db.execute(clocks, (terrain, done)).fetchone()
        if newest is None:
            return None
        after = self._crowded_after if self._journal.crowded(terrain) else self._fold_after
        young = db.execute(
            "SELECT min(clock) FROM moments WHERE terrain=? AND clock>? AND at>?", (terrain, done, self._now() - after)
        ).fetchone()[0]
        end = min(int(following), done + PIECE)
        return None if young is not None and end >= int(young) else end

    def _stretch(self, start: StrokeSet, last: int) -> tuple[Stretch, StrokeSet]:
        """The stretch from after ``start`` to ``last`` folded, and the document after it.

        Raises DamagedTerrain, Refusal, ValueError for what does not replay.
        """
        terrain, db = start.id, self._journal.reader()
        rows = self._journal.rows(terrain, start.clock, last)
        if [row.clock for row in rows] != list(range(start.clock + 1, last + 1)):
            raise DamagedTerrain(f"ops between {start.clock} and {last} are missing")
        known = timestamps.read_timestamps(db, terrain, start.clock, last)
        times = [clock for clock, _ in known]
        history = []
        for row in rows:
            at = bisect_right(times, row.clock)
            history.append(Dated(row.clock, row.client, row.author, read_op(row.op), known[at - 1][1] if at else None))
        after = start
        for dated in history:
            after, _ = after.apply(dated.op, UNLIMITED)
        folded = fold(history)
        if not same(start, after, history, folded):
            log.debug("ops %d to %d of terrain %s do not fold", start.clock + 1, last, terrain)
            folded = Folded({}, {})
        return _made(terrain, rows, folded, times), after

    def _write(self, stretch: Stretch) -> Callable[[Connection], bool]:
        """Puts a stretch in the place of its ops, unless its terrain was deleted meanwhile; says whether it did."""

        def write(db: Connection) -> bool:
            there = db.execute("SELECT 1 FROM terrains WHERE id=? AND deleted IS NULL", (stretch.terrain,)).fetchone()
            if there is None:
                return False
            name = stretch.terrain
            gone = [(name, clock) for clock in stretch.gone]
            db.executemany("DELETE FROM ops WHERE terrain=? AND clock=?", gone)
            db.executemany(
                "UPDATE ops SET op=? WHERE terrain=? AND clock=?", [(op, name, clock) for op, clock in stretch.changed]
            )
            db.executemany("INSERT INTO folded_ids VALUES (?,?,?,?,?)", [(name, *run) for run in stretch.ids])
            db.executemany("DELETE FROM moments WHERE terrain=? AND clock=?", [(name, at) for at in stretch.moments])
            db.execute("INSERT INTO folds VALUES (?,?,?,?)", (name, stretch.last, stretch.first, stretch.kept))
            self._journal.shrunk(name, stretch.freed)
            return True

        return write


def _made(terrain: str, rows: list[Row], folded: Folded, times: list[int]) -> Stretch:
    texts = {clock: op_json(op) for clock, op in folded.changed.items()}
    gone = sorted(folded.into)
    left = [row.clock for row in rows if row.clock not in folded.into]
    freed = sum(len(row.op) for row in rows if row.clock in folded.into)
    freed += sum(len(row.op) - len(texts[row.clock]) for row in rows if row.clock in texts)
    # The moment of an op is the last one at or before its clock. The last of the stretch is that of what follows, too.
    needed = {times[at - 1] for clock in left if (at := bisect_right(times, clock))} | set(times[-1:])
    first = rows[0].clock
    idle = [clock for clock in times if clock >= first and clock not in needed]
    changed = [(text, clock) for clock, text in sorted(texts.items())]
    return Stretch(terrain, first, rows[-1].clock, len(left), gone, changed, _runs(rows, folded), idle, freed)


def _runs(rows: list[Row], folded: Folded) -> list[tuple[str, int, int, int]]:
    """The ids of ops that went, those that follow each other and went into the same op as one row."""
    out: list[tuple[str, int, int, int]] = []
    ids = sorted((row.client, row.counter, folded.into[row.clock]) for row in rows if row.clock in folded.into)
    for client, counter, clock in ids:
        if out and out[-1][0] == client and out[-1][2] == counter - 1 and out[-1][3] == clock:
            out[-1] = (client, out[-1][1], counter, clock)
        else:
            out.append((client, counter, counter, clock))
    return out
