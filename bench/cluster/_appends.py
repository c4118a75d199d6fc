"""Fenced appends a second through the engine, beside plain INSERTs into the same table."""

from __future__ import annotations

import tempfile
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable
from concurrent.futures import Future
from pathlib import Path
from typing import Any, Final

import psycopg

from bench.cluster._postgres import Postgres as Server
from esker import contract as c
from esker.document.wire import op_json
from esker.store.engine.leases import Lease, Node
from esker.store.engine.postgres.engine import Postgres
from esker.store.engine.postgres.leases import PostgresLeases
from esker.store.journal import Journal, Row

ROOMS: Final = 64
AHEAD: Final = 512
"""Appends that wait for their commit at a time."""
TAKES: Final = 1_000
"""Leases that are taken one by one, and by one statement."""
OP: Final = op_json(c.AppendPoints(stroke="s", start=0, points=((0.1, 1.0),) * 4, last=(0.0, 0.0, 0.0)))


class _Holder:
    def __init__(self) -> None:
        self.leases: dict[str, Lease] = {}

    def right(self, terrain: str) -> tuple[str, int] | None:
        found = self.leases.get(terrain)
        return None if found is None else (terrain, found.epoch)

    def fenced(self, terrain: str) -> None:
        raise AssertionError(f"nobody else takes {terrain}")


def measure(server: Server, seconds: float) -> dict[str, Any]:
    """Appends of one operation each, in many rooms, as fast as they are committed."""
    url = server.database()
    holder = _Holder()
    engine, leases = Postgres(url, holder), PostgresLeases(url)
    with tempfile.TemporaryDirectory() as folder:
        journal = Journal(Path(folder), engine=engine)
        names = [f"t{n}" for n in range(ROOMS)]
        for name in names:
            journal.create(c.Document(id=name)).result()
            found = leases.take(name, "bench", 600.0)
            assert isinstance(found, Lease)
            holder.leases[name] = found
        clocks, waiting, count = dict.fromkeys(names, 0), deque[Future[None]](), 0
        began = time.perf_counter()
        while time.perf_counter() - began < seconds:
            name = names[count % ROOMS]
            clocks[name] += 1
            waiting.append(journal.append(name, [Row(clocks[name], "c", clocks[name], "c", OP)]))
            count += 1
            if len(waiting) >= AHEAD:
                waiting.popleft().result()
        for future in waiting:
            future.result()
        fenced = count / (time.perf_counter() - began)
        names = [f"taken-{n}" for n in range(TAKES)]
        held = _leased(leases.take(name, "bench", 600.0) for name in names)
        leases.release(held)
        took = _timed(lambda: held.extend(_leased(leases.take(name, "bench", 600.0) for name in names)))
        leases.release(held)
        together = _timed(lambda: held.extend(_leased(leases.take_all(names, "bench", 600.0).values())))
        held = held[-TAKES:]
        renewals = [_timed(lambda: leases.renew(held, 600.0)) for _ in range(9)]
        journal.close()
        leases.close()
    return {
        "rooms": ROOMS,
        "fenced_per_s": round(fenced),
        "takes_per_s": round(TAKES / took),
        "take_1000_ms": round(together * 1000, 2),
        "renew_1000_ms": round(sorted(renewals)[4] * 1000, 2),
        "inserts_one_commit_each_per_s": round(_inserts(url, seconds / 2, 1)),
        "inserts_256_a_commit_per_s": round(_inserts(url, seconds / 2, 256)),
    }


def _leased(found: Iterable[Lease | Node]) -> list[Lease]:
    """What was taken, which must be all."""
    taken = [each for each in found if isinstance(each, Lease)]
    assert len(taken) == TAKES
    return taken


def _timed(work: Callable[[], object]) -> float:
    began = time.perf_counter()
    work()
    return time.perf_counter() - began


def _inserts(url: str, seconds: float, together: int) -> float:
    count, statement = 0, "INSERT INTO esker.ops VALUES (%s,%s,%s,%s,%s,%s)"
    with psycopg.connect(url) as db:
        began = time.perf_counter()
        name = f"raw{together}-{threading.get_ident()}"
        while time.perf_counter() - began < seconds:
            rows = [(name, count + n, "c", count + n, "c", OP) for n in range(1, together + 1)]
            db.cursor().executemany(statement, rows)
            db.commit()
            count += together
        return count / (time.perf_counter() - began)
