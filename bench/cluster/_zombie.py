"""A server's writer that stops in the middle of a commit: ``python -m bench.cluster._zombie URL TERRAIN SECONDS``.

A line of its standard input names what it writes, ``append``, ``snapshot``, ``link`` or ``lesson``, and the clock. It
takes the terrain for so many seconds, says ``inside`` when the statement is given and the COMMIT is not, waits for a
line, and says what came of it. ``Zombie`` is such a process, to be frozen and woken.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from typing import Any, Final, TypeVar

import psycopg

from esker import contract as c
from esker.document.wire import op_json
from esker.store.access import Access
from esker.store.engine.leases import Lease
from esker.store.engine.ports import Connection
from esker.store.engine.postgres.engine import Postgres
from esker.store.engine.postgres.leases import PostgresLeases
from esker.store.journal import Journal, Row

T = TypeVar("T")
ROOT: Final = Path(__file__).parents[2]
KINDS: Final = ("append", "snapshot", "link", "lesson")
OP: Final = op_json(c.SetTerrain(fields=c.TerrainFields(title="x")))
_WRITTEN: Final = (
    "SELECT count(*) FROM esker.ops WHERE client='zombie'",
    "SELECT count(*) FROM esker.snapshots WHERE clock > 0",
    "SELECT count(*) FROM esker.links WHERE name='zombie'",
    "SELECT count(*) FROM esker.lessons WHERE state='zombie'",
)


class One:
    """Has one terrain."""

    def __init__(self) -> None:
        self.lease: Lease | None = None

    def right(self, terrain: str) -> tuple[str, int] | None:
        return None if self.lease is None or self.lease.terrain != terrain else (terrain, self.lease.epoch)

    def fenced(self, terrain: str) -> None:
        pass


class Stopping(Postgres):
    """Says when it is inside of a commit, and waits there."""

    stops = False

    def submit(self, write: Callable[[Connection], T], terrain: str | None = None) -> Future[T]:
        def inside(db: Connection) -> T:
            done = write(db)
            if self.stops:
                db.execute("SELECT 1").fetchone()  # what was written is with the database now
                self.stops = False
                sys.stdout.write("inside\n")
                sys.stdout.flush()
                sys.stdin.readline()
            return done

        return super().submit(inside, terrain)


class Zombie:
    """Such a process."""

    def __init__(self, url: str, terrain: str = "t", seconds: float = 0.3) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-m", "bench.cluster._zombie", url, terrain, str(seconds)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            cwd=ROOT,
            env={**os.environ, "PYTHONPATH": f"{ROOT / 'backend'}{os.pathsep}{ROOT}"},
        )
        if self.hears() != "ready":
            raise RuntimeError("a server's writer did not start")

    def says(self, line: str) -> None:
        """Gives it a line."""
        assert self._process.stdin is not None
        self._process.stdin.write(f"{line}\n")
        self._process.stdin.flush()

    def hears(self) -> str:
        """Its next line."""
        assert self._process.stdout is not None
        return self._process.stdout.readline().strip()

    def freeze(self) -> None:
        """Stops it where it is."""
        self._process.send_signal(signal.SIGSTOP)

    def wake(self) -> None:
        """Lets it go on."""
        self._process.send_signal(signal.SIGCONT)

    def close(self) -> None:
        """Ends it."""
        self.wake()
        self._process.kill()
        self._process.wait()
        for stream in (self._process.stdin, self._process.stdout):
            if stream is not None:
                stream.close()


def written(url: str) -> list[int]:
    """Rows that zombies wrote: operations, snapshots, links, lessons."""
    with psycopg.connect(url) as db:
        return [found[0] for question in _WRITTEN if (found := db.execute(question).fetchone()) is not None]


def main() -> None:
    """Runs until its standard input ends."""
    url, terrain, seconds = sys.argv[1], sys.argv[2], float(sys.argv[3])
    holder, leases = One(), PostgresLeases(url)
    engine = Stopping(url, holder)
    with tempfile.TemporaryDirectory() as folder:
        journal = Journal(Path(folder), engine=engine)
        sys.stdout.write("ready\n")
        sys.stdout.flush()
        for line in sys.stdin:
            what, _, clock = line.strip().partition(" ")
            lease = leases.take(terrain, "zombie", seconds)
            assert isinstance(lease, Lease)
            holder.lease, engine.stops = lease, True
            row = Row(int(clock), "zombie", int(clock), "zombie", OP)
            future: Future[Any]
            match what:
                case "append":
                    future = journal.append(terrain, [row])
                case "snapshot":
                    future = journal.keep_snapshot(c.Document(id=terrain, clock=int(clock)))
                case "link":
                    future = Access(journal).add(terrain, "edit", "zombie")
                case _:
                    future = journal.keep_lesson(terrain, "zombie")
            error = future.exception()
            sys.stdout.write(f"{'done' if error is None else type(error).__name__}\n")
            sys.stdout.flush()
        journal.close()
    leases.close()


if __name__ == "__main__":
    main()
