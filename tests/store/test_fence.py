"""Only who has a terrain writes for it: frozen and woken servers, with processes (SPEC J464 to J468)."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import pytest

from bench.cluster._zombie import KINDS, OP, Zombie, written
from esker import contract as c
from esker.store.access import Access
from esker.store.engine.leases import Lease, Node
from esker.store.engine.ports import Moved, UsedTwice
from esker.store.engine.postgres import leases
from esker.store.engine.postgres.engine import Postgres
from esker.store.engine.postgres.leases import PostgresLeases
from esker.store.journal import Journal, Row
from tests.store.engines import Database, Holding


class Server:
    """A server's part of a database, in this process."""

    def __init__(self, url: str, folder: Path) -> None:
        self.url = url
        self.holding = Holding()
        self.engine = Postgres(url, self.holding)
        self.journal = Journal(folder, engine=self.engine)
        self.leases = PostgresLeases(url)

    def take(self, terrain: str, node: str, seconds: float = 60.0) -> Lease:
        """Takes a terrain, when it can be had."""
        while isinstance(found := self.leases.take(terrain, node, seconds), Node):
            time.sleep(0.02)
        self.holding.leases[terrain] = found
        return found

    def close(self) -> None:
        self.journal.close()
        self.leases.close()


@pytest.fixture
def server(database: Database, tmp_path: Path) -> Iterator[Server]:
    made = Server(database.new(), tmp_path)
    made.journal.create(c.Document(id="t")).result()
    yield made
    made.close()


def row(clock: int, client: str = "c") -> Row:
    return Row(clock, client, clock, client, OP)


def test_nobody_writes_under_a_lease_that_is_not_the_last(server: Server) -> None:
    """SPEC J464: neither under an older epoch nor under one that ended, and beside it others of the batch do."""
    first = server.take("t", "a")
    server.journal.append("t", [row(1)]).result()
    server.take("t", "a")
    server.holding.leases["t"] = first
    server.journal.create(c.Document(id="u")).result()
    gate = threading.Event()
    held = server.journal.submit(lambda _: gate.wait(60))
    late, beside = server.journal.append("t", [row(2)]), server.journal.append("u", [row(1)])
    gate.set()
    held.result()
    assert isinstance(late.exception(), Moved)
    assert beside.exception() is None
    assert server.holding.lost == ["t"]
    server.take("t", "a", -1.0)
    assert isinstance(server.journal.append("t", [row(2)]).exception(), Moved)
    assert [r.clock for r in server.journal.rows("t", 0)] == [1]


def test_what_nobody_has_anybody_may_write_and_what_another_has_nobody_else(server: Server) -> None:
    """SPEC J465: a link is made without opening the terrain."""
    access = Access(server.journal)
    access.add("t", "edit", "free").result()
    server.take("t", "b")
    del server.holding.leases["t"]
    assert isinstance(access.add("t", "edit", "late").exception(), Moved)
    assert [link.name for link in access.links("t")] == ["free"]


def test_a_failure_of_one_item_is_its_own(server: Server) -> None:
    """SPEC J466: statements that fail only when they are run, and refusals after something was written."""
    access = Access(server.journal)
    server.take("t", "a")
    link, secret = access.add("t", "edit", "").result()
    gate = threading.Event()
    held = server.journal.submit(lambda _: gate.wait(60))
    futures: list[Future[Any]] = [
        server.journal.append("t", [row(1)]),
        server.journal.append("t", [row(1, "d")]),
        access.add("t", "edit", "", by="nobody's"),
        access.rotate("t", link.id, secret=secret),
        server.journal.append("t", [row(2)]),
    ]
    gate.set()
    held.result()
    failures = [type(future.exception()).__name__ for future in futures]
    assert failures == ["NoneType", "UsedTwice", "Ended", "NoneType", "NoneType"]
    other, _ = access.add("t", "edit", "").result()
    assert type(access.rotate("t", other.id, secret=secret).exception()).__name__ == "SecretTaken"
    assert [r.clock for r in server.journal.rows("t", 0)] == [1, 2]
    assert isinstance(server.journal.create(c.Document(id="t")).exception(), UsedTwice)


def test_a_server_that_was_frozen_in_a_commit_writes_nothing_when_it_wakes(
    server: Server, monkeypatch: pytest.MonkeyPatch
) -> None:
    """SPEC J467: in an append, a snapshot, a link change and a lesson; who takes over does not wait for it."""
    monkeypatch.setattr(leases, "STRANDED_SECONDS", 0.1)
    zombie = Zombie(server.url)
    try:
        for clock, what in enumerate(KINDS, 1):
            zombie.says(f"{what} {clock}")
            assert zombie.hears() == "inside"
            zombie.freeze()
            taken = server.take("t", "b")
            assert taken.epoch == 2 * clock
            server.journal.append("t", [row(clock)]).result()
            server.leases.release([taken])
            zombie.wake()
            zombie.says("go on")
            assert zombie.hears() == "Moved"
            assert written(server.url) == [0, 0, 0, 0]
    finally:
        zombie.close()
    assert [r.clock for r in server.journal.rows("t", 0)] == [1, 2, 3, 4]
