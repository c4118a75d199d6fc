"""Requests are paid by their address in processor time, and wait for it (SPEC P451)."""

from __future__ import annotations

import asyncio
import itertools
import time
from pathlib import Path
from typing import Any

import pytest

from esker.fairness.laps import Laps
from esker.fairness.shares import Who
from esker.fairness.spending import MUCH, PACE, PAYS, SHARED_PACE, USUAL_SECONDS, Accounts, Pace
from esker.fairness.turns import FairThreads
from esker.server.wire import pacing
from esker.server.wire.pacing import Paced, _Metered
from tests.sync.harness import LiveServer


@pytest.fixture
def ticks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Between two looks at the processor time of any thread a second of it passes."""
    count = itertools.count()
    monkeypatch.setattr(time, "thread_time", lambda: float(next(count)))


async def _app(scope: Any, receive: Any, send: Any) -> None:
    assert receive is not None
    await send({"type": "http.response.start", "status": 200, "headers": [], "path": scope.get("path")})
    await send({"type": "http.response.body", "body": b""})


def _status(paced: Paced, address: str) -> int:
    said: list[Any] = []

    async def send(message: Any) -> None:
        said.append(message)

    asyncio.run(paced({"type": "http", "client": (address, 1), "method": "GET", "path": "/"}, object(), send))
    return int(said[0]["status"])


def test_an_address_that_has_spent_its_share_waits_and_others_do_not(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pacing, "PATIENCE_SECONDS", 0.0)
    paced = Paced(_app)
    assert _status(paced, "192.0.2.7") == 200
    for address in ("192.0.2.7", "2001:db8::7"):
        for purse in paced._accounts.asker(address):
            purse.pay(0.0, 1e9)
    assert _status(paced, "192.0.2.7") == 429
    assert _status(paced, "::ffff:192.0.2.7") == 429
    assert _status(paced, "2001:db8::ffff:1") == 429, "of the same /64"
    assert _status(paced, "2001:db8:0:1::1") == 429, "of the same /48, whose share is three times as large"
    assert _status(paced, "192.0.2.8") == 200
    assert _status(paced, "2001:db8:1::1") == 200


def test_a_request_that_need_not_wait_long_waits(monkeypatch: pytest.MonkeyPatch) -> None:
    waits: list[float] = []

    async def sleep(seconds: float) -> None:
        waits.append(seconds)

    monkeypatch.setattr(asyncio, "sleep", sleep)
    paced = Paced(_app)
    (purse,) = paced._accounts.asker("192.0.2.7")
    purse.pay(time.monotonic(), purse.left + 1.0)
    assert _status(paced, "192.0.2.7") == 200
    assert len(waits) == 1
    assert 0 < waits[0] <= pacing.PATIENCE_SECONDS


def test_requests_of_who_asks_for_much_come_one_after_another(monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC P644: sixteen requests at a time of one address lay before each tile of those who draw."""
    waits: list[float] = []

    async def sleep(seconds: float) -> None:
        waits.append(seconds)

    monkeypatch.setattr(asyncio, "sleep", sleep)
    paced = Paced(_app)
    for _ in range(5):
        assert _status(paced, "192.0.2.7") == 200
    assert waits == [], "whoever opens a page waits for nothing"
    (purse,) = paced._accounts.asker("192.0.2.7")
    purse.pay(time.monotonic(), purse.left * (1.01 - MUCH))
    for _ in range(5):
        assert _status(paced, "192.0.2.7") == 200
    assert len(waits) == 5
    assert max(waits) < 0.1
    assert _status(paced, "192.0.2.8") == 200
    assert len(waits) == 5


def test_requests_follow_each_other_by_how_long_they_held_the_loop_up() -> None:
    """SPEC P644: beside threads that compute, most of it is no processor time. Nobody pays for that."""

    async def held(scope: Any, receive: Any, send: Any) -> None:
        time.sleep(0.1)
        await _app(scope, receive, send)

    paced = Paced(held)
    (purse,) = paced._accounts.asker("192.0.2.7")
    assert _status(paced, "192.0.2.7") == 200
    assert paced._accounts.pace("192.0.2.7").begin(time.monotonic())[0] > 0.09 / PACE.per_second
    assert purse.share > MUCH


def test_what_threads_do_for_a_request_and_whoever_is_refused_hold_nobody_up(monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC P644: the pace is one of the event loop. A teacher's export of a minute is no reason for pupils to wait."""

    async def works(scope: Any, receive: Any, send: Any) -> None:
        pays = PAYS.get()
        assert pays is not None
        pays(1.0)
        await _app(scope, receive, send)

    paced = Paced(works)
    assert _status(paced, "192.0.2.7") == 200
    assert paced._accounts.pace("192.0.2.7").begin(time.monotonic())[0] < 0.1
    (purse,) = paced._accounts.asker("192.0.2.8")
    purse.pay(time.monotonic(), 1e9)
    monkeypatch.setattr(pacing, "PATIENCE_SECONDS", 0.0)
    for _ in range(1000):
        assert _status(paced, "192.0.2.8") == 429
    assert paced._accounts.pace("192.0.2.8").begin(time.monotonic())[0] < 500 * USUAL_SECONDS / PACE.per_second


def test_requests_at_once_wait_for_each_other() -> None:
    """SPEC P644: what each costs is known when it is done, which is too late for those that came with it."""
    pace = Pace()
    waits = [pace.begin(10.0) for _ in range(4)]
    assert [wait for wait, _ in waits] == pytest.approx([k * USUAL_SECONDS / PACE.per_second for k in range(4)])
    for _, counted in waits:
        pace.end(10.0, counted, 0.01)
    assert pace.begin(10.0)[0] == pytest.approx(0.04 / PACE.per_second)
    assert pace.begin(12.0)[0] == 0.0


def test_beside_people_of_another_address_requests_come_at_a_slower_pace() -> None:
    """SPEC P668: acknowledgements waited behind what a stranger had asked for; those of one address are alone."""

    async def run() -> None:
        laps = Laps()
        sockets, requests = Accounts(laps=laps), Accounts(laps=laps)
        loop = asyncio.get_running_loop()

        def wait(address: str) -> float:
            pace = requests.pace(address)
            counted = pace.begin(loop.time() + 1e6)[1]
            pace.end(loop.time() + 1e6, counted, 0.1)
            return pace.begin(loop.time() + 1e6)[0]

        assert wait("192.0.2.1") == pytest.approx(0.1 / PACE.per_second, rel=0.01)
        sockets.member("192.0.2.2").took(0.0001, 0.0001)
        assert wait("192.0.2.2") == pytest.approx(0.1 / PACE.per_second, rel=0.01), "a class that opens the page"
        assert wait("192.0.2.3") == pytest.approx(0.1 / SHARED_PACE.per_second, rel=0.01)

    asyncio.run(run())


def test_requests_and_sockets_of_a_server_have_the_same_laps(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC P668: of requests it is asked who is there, of what was read from sockets it is known."""
    told, asked = set[Laps](), set[Laps]()
    taken, is_shared = Laps.taken, Laps.is_shared

    def noted(laps: Laps, home: str) -> None:
        told.add(laps)
        taken(laps, home)

    def looked(laps: Laps, home: str) -> bool:
        asked.add(laps)
        return is_shared(laps, home)

    monkeypatch.setattr(Laps, "taken", noted)
    monkeypatch.setattr(Laps, "is_shared", looked)
    with LiveServer(tmp_path) as server:
        server.join(*server.create()).close()
        assert server.http("GET", "/healthz")[0] == 200
    assert len(asked) == 1
    assert asked <= told, "a socket that nobody has been asked about yet has laps of its own"


@pytest.mark.usefixtures("ticks")
def test_every_step_is_paid_however_it_ends() -> None:
    paid: list[float] = []

    def step(seconds: float, _held: float) -> None:
        paid.append(seconds)

    async def fails() -> None:
        await asyncio.sleep(0)
        raise ValueError("so it does")

    async def hangs() -> None:
        try:
            await asyncio.Event().wait()
        finally:
            await asyncio.sleep(0)

    async def all_of_them() -> None:
        await _Metered(asyncio.sleep(0), step)
        with pytest.raises(ValueError, match="so it does"):
            await _Metered(fails(), step)
        task = asyncio.ensure_future(_waits(_Metered(hangs(), step)))
        await asyncio.sleep(0)
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task

    asyncio.run(all_of_them())
    assert paid == [1.0] * 7, "two steps, two, and three: to the wait, to the pause after it, to the end"


async def _waits(what: Any) -> None:
    await what


@pytest.mark.usefixtures("ticks")
def test_what_other_threads_do_for_a_request_is_paid_too() -> None:
    paid: list[float] = []

    async def ask() -> None:
        threads = FairThreads(1, "asked")
        token = PAYS.set(paid.append)
        assert await threads.run(Who("192.0.2.7"), lambda: 4) == 4
        PAYS.reset(token)
        assert await threads.run(Who(""), lambda: 5) == 5, "and where nobody pays it is done as well"
        threads.shutdown()

    asyncio.run(ask())
    assert paid == [1.0]


def test_the_server_paces_requests_and_not_sockets(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with LiveServer(tmp_path) as server:
        assert server.http("GET", "/healthz")[0] == 200
        terrain, secret = server.create()
        monkeypatch.setattr(pacing, "REQUEST_SECONDS", 1e9)
        monkeypatch.setattr(pacing, "PATIENCE_SECONDS", 0.0)
        status, told = server.http("GET", "/healthz")
        assert (status, told["code"]) == (429, "rate_limited")
        server.join(terrain, secret).close()
