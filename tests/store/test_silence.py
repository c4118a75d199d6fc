"""A database that is frozen, not gone, and one that says nothing to one connection (SPEC J560 to J563)."""

from __future__ import annotations

import asyncio
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from esker.server.routes.answers import SILENT
from esker.store.engine.ports import Unreachable
from esker.store.engine.postgres.connections import Readers
from tests.store.engines import Database
from tests.store.proxy import Proxy
from tests.sync.harness import LiveServer

QUICK = 1.0
"""Seconds within which whoever watches a server is answered."""


@contextmanager
def frozen(database: Database) -> Iterator[None]:
    """The database's processes stand still, its sockets stay open."""
    database.server.signal(signal.SIGSTOP)
    try:
        yield
    finally:
        database.server.signal(signal.SIGCONT)


def titled(title: str) -> dict[str, Any]:
    """The op that gives a terrain its title."""
    return {"type": "terrain.set", "fields": {"title": title}}


def asked(server: LiveServer, path: str, secret: str | None = None) -> tuple[float, int, Any]:
    """Asks a server; returns the seconds that it took, the status and the answer."""
    began = time.monotonic()
    status, answer = server.http("GET", path, secret=secret)
    return time.monotonic() - began, status, answer


def until(holds: Any) -> None:
    """Waits until something is true."""
    end = time.monotonic() + 30
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.05)


def test_a_frozen_database_does_not_freeze_the_server(database: Database, tmp_path: Path) -> None:
    """SPEC J560, J561: whoever watches is told within a second; what is drawn meanwhile is saved later."""
    with LiveServer(tmp_path, database=database.new()) as server:
        terrain, secret = server.create()
        ada = server.join(terrain, secret, "ada")
        ada.ops(("ada:1", titled("one")))
        ada.wait("ack")
        with frozen(database):
            ada.ops(("ada:2", titled("two")))  # it is shown to everybody, and saved when that can be done
            took, status, answer = asked(server, f"/api/terrains/{terrain}", secret)
            assert (status, answer) == (503, {"code": "unavailable", "message": SILENT})
            times = [took]
            for _ in range(5):
                took, status, answer = asked(server, "/healthz")
                times.append(took)
                assert (status, answer["database"]) == (200, "does not answer")
                took, status, answer = asked(server, "/readyz")
                times.append(took)
                assert (status, answer["reasons"]) == (503, ["database"])
                took, status, answer = asked(server, f"/api/terrains/{terrain}", secret)
                times.append(took)
                assert status == 503
            assert max(times) < QUICK, times
            assert sorted(times)[-2] < 0.3, "only one request waits for the database"
            ada.say("ping", t=1)
            ada.wait("pong", timeout=QUICK)
        assert ada.wait("ack")["clocks"] == [2]
        until(lambda: asked(server, "/readyz")[1] == 200)
        assert asked(server, f"/api/terrains/{terrain}", secret)[1] == 200


def test_a_silent_connection_of_a_reader_stops_nobody_who_draws(database: Database, tmp_path: Path) -> None:
    """SPEC J560: only the line by which links are read swallows everything: what people draw is saved meanwhile."""
    line = Proxy(tmp_path / "line", database.server.folder / ".s.PGSQL.5432")
    url = database.new().replace(str(database.server.folder), str(tmp_path / "line"))
    try:
        with LiveServer(tmp_path / "data", database=url) as server:
            terrain, secret = server.create()
            ada = server.join(terrain, secret, "ada")
            line.hush_at = b"esker.links"
            assert asked(server, f"/api/terrains/{terrain}", secret)[1] == 503
            began = time.monotonic()
            for k in range(1, 6):
                ada.ops((f"ada:{k}", titled(str(k))))
                ada.wait("ack", timeout=5)
            assert time.monotonic() - began < 5
            line.hush_at = None
            until(lambda: asked(server, f"/api/terrains/{terrain}", secret)[1] == 200)
    finally:
        line.close()


def test_the_event_loop_waits_once_and_threads_wait_longer(database: Database) -> None:
    """SPEC J562: the first read in a loop ends after half a second, all others at once; it comes back."""
    readers = Readers(database.new(), 3)
    took: list[float] = []

    def read() -> None:
        began = time.monotonic()
        with pytest.raises(Unreachable):
            readers.reader().execute("SELECT 1")
        took.append(time.monotonic() - began)

    async def in_a_loop() -> None:
        for _ in range(10):
            read()

    try:
        assert readers.reader().execute("SELECT 1").fetchone() == (1,)
        asyncio.run(_one(readers))
        with frozen(database):
            asyncio.run(in_a_loop())
            assert 0.4 < took[0] < QUICK
            assert max(took[1:]) < 0.1
            thread = threading.Thread(target=read)
            thread.start()
            thread.join(QUICK)
            assert not thread.is_alive()
            assert not readers.answers
        until(lambda: readers.answers)
        assert readers.reader().execute("SELECT 1").fetchone() == (1,)
        asyncio.run(_one(readers))
    finally:
        readers.close()


async def _one(readers: Readers) -> None:
    assert readers.reader().execute("SELECT 1").fetchone() == (1,)


def test_the_loop_waits_for_no_thread_that_reads(database: Database) -> None:
    """SPEC J563: threads hold all connections that they may have, and the event loop reads all the same."""
    readers = Readers(database.new(), 2)
    begun, ended = threading.Barrier(3), threading.Event()

    def hold() -> None:
        with readers.at_one_moment():
            begun.wait(10)
            ended.wait(10)

    threads = [threading.Thread(target=hold) for _ in range(2)]
    try:
        for thread in threads:
            thread.start()
        begun.wait(10)
        began = time.monotonic()
        asyncio.run(_one(readers))
        assert time.monotonic() - began < QUICK
    finally:
        ended.set()
        for thread in threads:
            thread.join()
        readers.close()
