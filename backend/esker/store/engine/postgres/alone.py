"""A server that is alone on a shared database, as it is alone on a data folder: one lease for all terrains.

It is taken at the start and renewed until the end. A server that was killed and is started again on the same machine
takes it at once; one on another machine waits until it has ended.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from typing import Final

from esker.store.engine.leases import LEASE_SECONDS, RENEW_SECONDS, SILENT_SECONDS, Lease, Leases
from esker.store.engine.lock import InUse
from esker.store.engine.ports import Unreachable
from esker.store.engine.postgres import migrations
from esker.store.engine.postgres.connections import place_of
from esker.store.engine.postgres.engine import Postgres
from esker.store.engine.postgres.leases import PostgresLeases

log = logging.getLogger("esker.alone")

WHOLE: Final = "*"
"""The name of the lease for all terrains: no terrain has it."""
AGAIN_SECONDS: Final = 0.2
PATIENCE_SECONDS: Final = LEASE_SECONDS + 1.0
"""A server that starts waits so long for the lease of one that ended without giving it back."""


class Alone:
    """The right to write for every terrain, while this process lives and nobody else has taken it."""

    def __init__(self, leases: Leases, name: str, where: str, lost: Callable[[], object]) -> None:
        """``name``: of this server, the same after a restart; ``where``: the database, in words; ``lost``: called in a
        thread when another server has taken it.

        Raises InUse, Unreachable.
        """
        self._leases, self._name = leases, name
        self._lease = self._taken(where, time.monotonic() + PATIENCE_SECONDS)
        self._heard = time.monotonic()
        self._lost = lost
        self._stop, self._lock = threading.Event(), threading.Lock()
        self._thread = threading.Thread(target=self._renew_all, name="lease", daemon=True)
        self._thread.start()

    def _taken(self, where: str, end: float) -> Lease:
        while True:
            found = self._leases.take(WHOLE, self._name, LEASE_SECONDS)
            if isinstance(found, Lease):
                break
            if time.monotonic() >= end:
                raise InUse(
                    f"Another Esker (on {found.name or 'another machine'}) uses the database {where}. Stop it, or give "
                    "every server a name of its own with --node: then they share it."
                )
            time.sleep(AGAIN_SECONDS)
        nodes = self._leases.nodes()
        if nodes:
            self._leases.release([found])
            named = ", ".join(node.name for node in nodes)
            raise InUse(f"The nodes {named} use the database {where}. Give this server a name, too, with --node.")
        return found

    def right(self, terrain: str) -> tuple[str, int] | None:  # noqa: ARG002
        """The one lease, whichever the terrain."""
        return WHOLE, self._lease.epoch

    def fenced(self, terrain: str) -> None:
        """A write was refused: the lease had ended, or another server has it."""
        log.warning("a write for terrain %s was refused: the lease of this server had ended", terrain)
        self._renew()

    @property
    def age(self) -> float:
        """Seconds since the newest renewal was sent that was answered."""
        return time.monotonic() - self._heard

    def _renew_all(self) -> None:
        while not self._stop.wait(RENEW_SECONDS):
            self._renew()

    def _renew(self) -> None:
        """Prolongs the lease. One that has ended is taken again where nobody had the database in between."""
        with self._lock:
            asked = time.monotonic()
            try:
                renewed = self._leases.renew([self._lease], LEASE_SECONDS)
                self._heard = asked
                if renewed:
                    return
                found = self._leases.take(WHOLE, self._name, LEASE_SECONDS)
            except Unreachable as error:
                log.warning("the lease of this server could not be renewed: %s", error)
                return
            if isinstance(found, Lease) and found.epoch == self._lease.epoch + 1:
                self._lease = found
                return
        log.error("another server has taken the database; this one stops")
        self._stop.set()
        self._lost()

    def close(self) -> None:
        """Gives the database back. Call it when the last write is done."""
        self._stop.set()
        self._thread.join(timeout=10)
        try:
            self._leases.release([self._lease])
        except Unreachable as error:
            log.warning("the lease of this server ends by itself: %s", error)


class LoneEngine(Postgres):
    """The engine of a server that is alone on its database: the lease goes when the last write is done."""

    def __init__(self, url: str, name: str, lost: Callable[[], object] = lambda: None) -> None:
        """``name``: of the server, the same after a restart; ``lost``: called in a thread when another server has taken
        the database. Raises Unreachable, BadDatabase, InUse."""
        where = place_of(url)
        migrations.migrate(url)
        self._leases = PostgresLeases(url)
        try:
            self._alone = Alone(self._leases, name, where, lost)
        except BaseException:
            self._leases.close()
            raise
        super().__init__(url, self._alone)

    @property
    def answers(self) -> bool:
        """Whether the database answered whoever read last, and whoever renewed the lease."""
        return super().answers and self._alone.age < SILENT_SECONDS

    def close(self) -> None:
        super().close()
        self._alone.close()
        self._leases.close()
