"""Leases in the shared database. Its clock is the only one that counts; rows are locked in order of id."""

from __future__ import annotations

import threading
from collections.abc import Collection, Iterator
from contextlib import contextmanager, suppress
from typing import Any, Final

from esker.store.engine.leases import Lease, Node
from esker.store.engine.ports import Unreachable
from esker.store.engine.postgres.connections import Database, pool, reached

CONNECTIONS: Final = 6
PATIENCE_SECONDS: Final = 4.5
"""A database that says nothing for so long is given up: longer than the locks of ``_WAIT`` are waited for, and shorter
than a lease lives."""
STRANDED_SECONDS: Final = 1.0
"""Whoever takes a terrain waits so long for a transaction of a server whose lease has ended, and ends it then."""
_WAIT: Final = "SELECT set_config('lock_timeout', '4s', true), pg_backend_pid()"
_TAKE: Final = """
UPDATE esker.leases SET node = $2, epoch = epoch + 1, until = clock_timestamp() + make_interval(secs => $3)
WHERE terrain = $1 AND (until <= clock_timestamp() OR node = $2) RETURNING epoch
"""
"""Waits for a commit under a lease that has ended. No upsert: that would lock the row of whoever has the terrain, and
wait for their commits."""
_FIRST: Final = """
INSERT INTO esker.leases VALUES ($1, $2, 1, clock_timestamp() + make_interval(secs => $3))
ON CONFLICT DO NOTHING RETURNING epoch
"""
_TAKE_ALL: Final = """
WITH free AS (
  SELECT terrain FROM esker.leases WHERE terrain = ANY($1::text[]) AND (until <= clock_timestamp() OR node = $2)
  ORDER BY terrain FOR NO KEY UPDATE SKIP LOCKED)
UPDATE esker.leases l SET node = $2, epoch = epoch + 1, until = clock_timestamp() + make_interval(secs => $3)
FROM free WHERE l.terrain = free.terrain RETURNING l.terrain, l.epoch
"""
"""Waits for no row that anybody has locked: one frozen server would hold up all terrains of the statement."""
_RENEW: Final = """
WITH held AS (
  SELECT l.terrain FROM esker.leases l JOIN unnest($1::text[], $2::bigint[]) AS w(terrain, epoch)
    ON l.terrain = w.terrain
  WHERE l.epoch = w.epoch AND l.until > clock_timestamp() ORDER BY l.terrain FOR NO KEY UPDATE OF l)
UPDATE esker.leases l SET until = {until} FROM held WHERE l.terrain = held.terrain RETURNING l.terrain
"""
_UNTIL: Final = "clock_timestamp() + make_interval(secs => $3)"
_END: Final = """
SELECT pg_terminate_backend(blocker) FROM unnest(pg_blocking_pids($1)) AS blocker
WHERE EXISTS (SELECT 1 FROM esker.leases WHERE terrain = $2 AND until <= clock_timestamp())
"""
_OWNERS: Final = """
SELECT l.terrain, l.node, n.address, n.weight FROM esker.leases l
LEFT JOIN esker.nodes n ON n.name = l.node WHERE l.terrain = ANY($1::text[]) AND l.until > clock_timestamp()
"""


class PostgresLeases:
    """``Leases`` by a few connections of their own: neither a slow query nor a long commit keeps a renewal waiting."""

    def __init__(self, url: str) -> None:
        self._pool = pool(url, "leases", CONNECTIONS, checked=True, patience=PATIENCE_SECONDS)

    def register(self, node: Node, seconds: float) -> None:
        with self._connection() as db:
            db.execute(
                "INSERT INTO esker.nodes VALUES ($1, $2, $3, clock_timestamp() + make_interval(secs => $4))"
                " ON CONFLICT (name) DO UPDATE SET address = excluded.address, weight = excluded.weight,"
                " until = excluded.until",
                (node.name, node.address, float(node.weight), float(seconds)),
            )

    def withdraw(self, name: str) -> None:
        with self._connection() as db:
            db.execute("DELETE FROM esker.nodes WHERE name = $1", (name,))

    def nodes(self) -> tuple[Node, ...]:
        with self._connection() as db:
            found = db.execute("SELECT name, address, weight FROM esker.nodes WHERE until > clock_timestamp()")
            return tuple(sorted((Node(*row) for row in found), key=lambda node: node.name))

    def take(self, terrain: str, node: str, seconds: float) -> Lease | Node:
        for _ in range(3):
            found = self.take_all([terrain], node, seconds)
            if terrain in found:
                return found[terrain]
            with self._connection() as db, self._unblocked(db, terrain):
                row = db.execute(_TAKE, (terrain, node, float(seconds))).fetchone()
            if row is None:
                with self._connection() as db:
                    row = db.execute(_FIRST, (terrain, node, float(seconds))).fetchone()
            if row is not None:
                return Lease(terrain, node, int(row[0]))
        return Node("", "", 0.0)  # it changes hands faster than it can be asked for

    def take_all(self, terrains: Collection[str], node: str, seconds: float) -> dict[str, Lease | Node]:
        with self._connection() as db:
            rows = db.execute(_TAKE_ALL, (sorted(terrains), node, float(seconds))).fetchall()
        taken = {str(terrain): Lease(str(terrain), node, int(epoch)) for terrain, epoch in rows}
        return {**taken, **self._owners([terrain for terrain in terrains if terrain not in taken])}

    def renew(self, leases: Collection[Lease], seconds: float) -> frozenset[str]:
        if not leases:
            return frozenset()
        with self._connection() as db, db.transaction():
            db.execute(_WAIT)
            rows = db.execute(_RENEW.format(until=_UNTIL), (*_columns(leases), float(seconds)))
            return frozenset(str(row[0]) for row in rows)

    def release(self, leases: Collection[Lease]) -> None:
        if leases:
            with self._connection() as db, db.transaction():
                db.execute(_WAIT)
                db.execute(_RENEW.format(until="'-infinity'"), _columns(leases))

    def owner(self, terrain: str) -> Node | None:
        return self._owners([terrain]).get(terrain)

    def _owners(self, terrains: list[str]) -> dict[str, Node]:
        if not terrains:
            return {}
        with self._connection() as db:
            rows = db.execute(_OWNERS, (terrains,)).fetchall()
        return {
            str(terrain): Node(str(name), address or "", float(weight or 0.0))
            for terrain, name, address, weight in rows
        }

    def close(self) -> None:
        """Closes the connections."""
        self._pool.close()

    @contextmanager
    def _connection(self) -> Iterator[Database]:
        with reached(), self._pool.connection() as db:
            yield db

    @contextmanager
    def _unblocked(self, db: Database, terrain: str) -> Iterator[None]:
        """A transaction that does not wait for a frozen server: behind a Flush a database waits for ever."""
        with db.transaction():
            row = db.execute(_WAIT).fetchone()
            assert row is not None
            done = threading.Event()
            helper = threading.Thread(target=self._end, args=(int(row[1]), terrain, done), daemon=True)
            helper.start()
            try:
                yield
            finally:
                done.set()
                helper.join()  # later this connection may wait for somebody who is in nobody's way

    def _end(self, waiting: int, terrain: str, done: threading.Event) -> None:
        while not done.wait(STRANDED_SECONDS):
            with suppress(Unreachable), self._connection() as db:
                db.execute(_END, (waiting, terrain))


def _columns(leases: Collection[Lease]) -> tuple[list[Any], list[Any]]:
    ordered = sorted(leases, key=lambda lease: lease.terrain)
    return [lease.terrain for lease in ordered], [lease.epoch for lease in ordered]
