"""A thousand take-overs: a server is frozen inside of a commit, another takes its terrain, and then it is woken.

Each round a process takes a terrain for a moment and begins an append, a snapshot, a link or a lesson; between the
statements and the COMMIT it is stopped (SIGSTOP). This process waits for the end of the lease, takes the terrain,
appends an operation, gives the terrain back and wakes the other, which must be told that it has lost the terrain. In
the end rows of the frozen ones are counted, and whether every acknowledged operation is there once.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Any, Final

import numpy as np

from bench.cluster._postgres import Postgres as DatabaseServer
from bench.cluster._zombie import KINDS, OP, One, Zombie, written
from esker import contract as c
from esker.store.engine.leases import Lease
from esker.store.engine.postgres import leases as postgres_leases
from esker.store.engine.postgres.engine import Postgres
from esker.store.engine.postgres.leases import PostgresLeases
from esker.store.journal import Journal, Row
from esker.version import VERSION

SECONDS: Final = 0.25
"""Length of a lease here."""


class Side:
    """One terrain, its frozen server and the one that takes over."""

    def __init__(self, url: str, folder: Path, terrain: str) -> None:
        self.url, self.terrain = url, terrain
        self.holder = One()
        self.journal = Journal(folder, engine=Postgres(url, self.holder))
        self.leases = PostgresLeases(url)
        self.waited: list[float] = []
        self.answers: dict[str, int] = {}
        self.acked: list[int] = []

    def run(self, rounds: int) -> None:
        """Does take-overs one after the other."""
        self.journal.create(c.Document(id=self.terrain)).result()
        zombie = Zombie(self.url, self.terrain, SECONDS)
        try:
            for clock in range(1, rounds + 1):
                zombie.says(f"{KINDS[clock % len(KINDS)]} {clock}")
                began = time.monotonic()
                inside = zombie.hears()
                zombie.freeze()
                self._take_over(clock)
                self.waited.append(time.monotonic() - began - SECONDS)
                zombie.wake()
                zombie.says("go on")
                answer = zombie.hears() if inside == "inside" else inside
                self.answers[answer] = self.answers.get(answer, 0) + 1
        finally:
            zombie.close()

    def _take_over(self, clock: int) -> None:
        while not isinstance(found := self.leases.take(self.terrain, "heir", 30.0), Lease):
            time.sleep(0.005)
        self.holder.lease = found
        self.journal.append(self.terrain, [Row(clock, "heir", clock, "heir", OP)]).result()
        self.acked.append(clock)
        self.leases.release([found])

    def close(self) -> dict[str, int]:
        """What is there of what was acknowledged."""
        there = [row.clock for row in self.journal.rows(self.terrain, 0) if row.client == "heir"]
        self.journal.close()
        self.leases.close()
        return {"lost": len(set(self.acked) - set(there)), "doubled": len(there) - len(set(there))}


def measure(rounds: int, terrains: int, stranded: float) -> dict[str, Any]:
    """All rounds, shared out to terrains that go on side by side."""
    postgres_leases.STRANDED_SECONDS = stranded  # type: ignore[misc]
    server = DatabaseServer(fsync="on")
    try:
        url = server.database()
        with tempfile.TemporaryDirectory() as folder:
            sides = [Side(url, Path(folder) / str(k), f"t{k}") for k in range(terrains)]
            began = time.monotonic()
            threads = [threading.Thread(target=side.run, args=(rounds // terrains,)) for side in sides]
            for thread in threads:
                thread.start()
            for thread in threads:
                thread.join()
            took = time.monotonic() - began
            rows = written(url)
            kept = [side.close() for side in sides]
    finally:
        server.close()
    waited = np.array([each for side in sides for each in side.waited]) * 1000
    answers: dict[str, int] = {}
    for side in sides:
        for answer, count in side.answers.items():
            answers[answer] = answers.get(answer, 0) + count
    return {
        "version": VERSION,
        "takeovers": sum(len(side.acked) for side in sides),
        "rows_of_frozen_servers": dict(zip(("ops", "snapshots", "links", "lessons"), rows, strict=True)),
        "acknowledged_lost": sum(each["lost"] for each in kept),
        "acknowledged_doubled": sum(each["doubled"] for each in kept),
        "answers_of_the_woken": answers,
        "lease_s": SECONDS,
        "stranded_s": stranded,
        "wait_after_the_lease_ms": {
            "p50": round(float(np.percentile(waited, 50)), 1), "p99": round(float(np.percentile(waited, 99)), 1),
        },
        "seconds": round(took, 1),
    }  # fmt: skip


def main(argv: list[str] | None = None) -> int:
    """Runs the benchmark; returns the exit status."""
    parser = argparse.ArgumentParser(prog="esker bench takeovers", description=__doc__)
    parser.add_argument("--json", action="store_true", help="print the figures as JSON")
    parser.add_argument("--rounds", type=int, default=1000, help="take-overs in all (default 1000)")
    parser.add_argument("--terrains", type=int, default=8, help="so many go on side by side (default 8)")
    parser.add_argument("--stranded", type=float, default=0.05, help="seconds after which a frozen one is ended "
                        "(default 0.05; a server takes 1)")  # fmt: skip
    parsed = parser.parse_args(argv)
    found = measure(parsed.rounds, parsed.terrains, parsed.stranded)
    text = json.dumps(found, indent=2 if parsed.json else None)
    sys.stdout.write(f"{text}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
