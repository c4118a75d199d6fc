"""A server's writer that stops in the middle of a commit: ``python -m tests.store.zombie_child URL``.

A line of its standard input names what it writes, ``append``, ``snapshot``, ``link`` or ``lesson``, and the clock. It
takes the terrain for a moment, says ``inside`` when the statement is given and the COMMIT is not, waits for a line, and
says what came of it.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from typing import Any, TypeVar

from esker import contract as c
from esker.document.wire import op_json
from esker.store.access import Access
from esker.store.engine.leases import Lease
from esker.store.engine.ports import Connection
from esker.store.engine.postgres.engine import Postgres
from esker.store.engine.postgres.leases import PostgresLeases
from esker.store.journal import Journal, Row
from tests.store.engines import Holding

T = TypeVar("T")
SECONDS = 0.3
OP = op_json(c.SetTerrain(fields=c.TerrainFields(title="x")))


class Stopping(Postgres):
    """Says when it is inside of a commit, and waits there."""

    stops = False

    def submit(self, write: Callable[[Connection], T], terrain: str | None = None) -> Future[T]:
        def inside(db: Connection) -> T:
            done = write(db)
            if self.stops:
                db.execute("SELECT 1").fetchone()  # what was written is with the database now
                self.stops = False
                print("inside", flush=True)
                sys.stdin.readline()
            return done

        return super().submit(inside, terrain)


def main() -> None:
    url = sys.argv[1]
    holding, leases = Holding(), PostgresLeases(url)
    engine = Stopping(url, holding)
    with tempfile.TemporaryDirectory() as folder:
        journal = Journal(Path(folder), engine=engine)
        print("ready", flush=True)
        for line in sys.stdin:
            what, _, clock = line.strip().partition(" ")
            row = Row(int(clock), "zombie", int(clock), "zombie", OP)
            document = c.Document(id="t", clock=int(clock))
            lease = leases.take("t", "a", SECONDS)
            assert isinstance(lease, Lease)
            holding.leases["t"] = lease
            engine.stops = True
            future: Future[Any]
            match what:
                case "append":
                    future = journal.append("t", [row])
                case "snapshot":
                    future = journal.append("t", [row], document)
                case "link":
                    future = Access(journal).add("t", "edit", "zombie")
                case _:
                    future = journal.keep_lesson("t", "zombie")
            error = future.exception()
            print(type(error).__name__ if error is not None else "done", flush=True)
        journal.close()
    leases.close()


if __name__ == "__main__":
    main()
