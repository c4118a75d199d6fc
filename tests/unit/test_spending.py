"""Processor time of the event loop is shared by connection and by address (SPEC P222, P223)."""

from __future__ import annotations

import asyncio
import json
import struct
import time
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import pytest

from esker import contract as c
from esker.fairness.laps import LAP_REST
from esker.fairness.spending import (
    CALM_REST,
    DOUBT,
    MEMBER,
    MEMBERS,
    MUCH,
    NETWORK,
    PACE,
    STRAINED_PRICE,
    STRAINED_REST,
    STRANGER,
    STRANGERS,
    Account,
    Accounts,
    Purse,
)
from esker.server.wire import websocket
from esker.session.room import protocol
from tests.unit.test_websocket import Wire, settle

MASK = b"\0\0\0\0"
EMPTY = b"\x00\x80" + MASK
"""A continuation frame without end and without anything in it."""
PING = b"\x89\x80" + MASK


def text_frame(text: str, fin: bool = True) -> bytes:
    data, first = text.encode(), (0x80 if fin else 0) | 1
    head = bytes([first, 0x80 | len(data)]) if len(data) < 126 else struct.pack("!BBH", first, 0x80 | 126, len(data))
    return head + MASK + data


# --- the purses -----------------------------------------------------------------------------------------------------


def test_a_purse_pays_what_it_has_and_fills_again() -> None:
    purse = Purse(STRANGER)
    assert purse.pay(5.0, STRANGER.burst)
    assert not purse.pay(5.0, 0.001)
    assert purse.pay(5.0 + 2 * 0.001 / STRANGER.per_second, 0.0005)
    assert purse.pay(1e6, STRANGER.burst)
    assert not purse.pay(1e6, 0.001), "no more is saved up than the burst"


def test_who_draws_for_hours_never_runs_out() -> None:
    account = Accounts().member("192.0.2.1")
    for n in range(100_000):  # an hour of thirty messages a second at a third of a millisecond
        assert account.pay(n / 30, 0.0003)


def test_a_stranger_ends_far_sooner() -> None:
    spent = {}
    for name, account in (("stranger", Accounts().stranger("a")), ("member", Accounts().member("a"))):
        n = 0
        while account.pay(0.0, 0.001):
            n += 1
        spent[name] = n
    assert spent["stranger"] == pytest.approx(STRANGER.burst * 1000, abs=1)
    assert spent["member"] == pytest.approx(MEMBER.burst * 1000, abs=1)
    assert spent["member"] >= 9 * spent["stranger"]


def test_an_address_has_no_more_for_many_connections_than_for_some() -> None:
    accounts = Accounts()
    calm = accounts.stranger("192.0.2.1")
    assert calm.pay(0.0, 0.001)
    spent = 0.0
    for _ in range(1000):
        account = accounts.stranger("192.0.2.1")
        while account.pay(0.0, 0.001):
            spent += 0.001
    assert spent < STRANGERS.burst + 1000 * DOUBT * STRANGER.burst
    # After the purse of the address is empty a connection gets less than half of its own, and the calm one goes on.
    late = accounts.stranger("192.0.2.1")
    n = 0
    while late.pay(0.0, 0.001):
        n += 1
    assert n == pytest.approx((1 - DOUBT) * STRANGER.burst * 1000, abs=1)
    assert calm.pay(0.0, 0.001)
    assert accounts.stranger("192.0.2.2").pay(0.0, STRANGER.burst), "another address has its own"
    assert accounts.member("192.0.2.1").pay(0.0, MEMBER.burst), "and members of the same one too"


def test_connections_of_an_address_that_have_taken_much_share_one_pace() -> None:
    """SPEC P647: forty pages of one address had a turn each in one lap of the event loop, 80 ms together."""
    accounts = Accounts()
    greedy = [accounts.member("192.0.2.1") for _ in range(4)]
    for account in greedy:
        assert account.pay(0.0, 0.2)
    assert all(account.is_strained for account in greedy)
    rests = [account.rest(0.0, 0.002) for account in greedy]
    assert rests == pytest.approx([n * 0.002 / PACE.per_second for n in (1, 2, 3, 4)]), "one after another"
    calm = accounts.member("192.0.2.1")
    calm.pay(0.0, 0.0001)
    assert calm.rest(0.0, 0.0001) == pytest.approx(0.0001 * CALM_REST), "a pupil at the same school draws on"
    fresh = accounts.member("192.0.2.1")
    assert fresh.rest(0.0, 0.002) > 0.04, "one of forty that have taken little each does not"
    other = accounts.member("192.0.2.2")
    other.pay(0.0, 0.0001)
    assert other.rest(0.0, 0.0001) == pytest.approx(0.0001)


def test_a_network_is_counted_as_one_whatever_its_addresses() -> None:
    accounts = Accounts()
    for n in range(200):
        account = accounts.member(f"2001:db8:1:{n:x}::1")
        while account.pay(0.0, 0.05):
            pass
    last = accounts.member("2001:db8:1:ffff::1")
    assert not all(last.pay(0.0, MEMBER.burst * DOUBT / 4) for _ in range(6))
    assert MEMBERS.burst * NETWORK < 200 * MEMBER.burst


def test_purses_of_addresses_are_forgotten_in_order() -> None:
    accounts = Accounts(most_keys=2)
    for address in ("a", "b", "c"):
        accounts.stranger(address)
    assert len(accounts._purses) == 2


# --- the wire -------------------------------------------------------------------------------------------------------


class Clock:
    """Processor time that stands still but for what the test adds."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.used = 0.0
        monkeypatch.setattr("esker.server.wire.websocket.time.thread_time", lambda: self.used)


async def _member(account: Account | None = None) -> tuple[Wire, list[str | bytes], list[bool]]:
    wire = Wire()
    await settle()
    wire.take()
    heard: list[str | bytes] = []
    broke: list[bool] = []
    wire.server.charge(account or Accounts().member("a"), lambda: broke.append(True))
    wire.server.listen(heard.append)
    return wire, heard, broke


def test_messages_that_take_long_end_the_connection_and_no_more_of_it_is_read(monkeypatch: pytest.MonkeyPatch) -> None:
    async def run() -> None:
        clock = Clock(monkeypatch)
        wire, _, broke = await _member()
        heard = []

        def slow(text: str | bytes) -> None:
            heard.append(text)
            clock.used += 0.012

        wire.server.listen(slow)
        for _ in range(200):
            wire.server.data_received(text_frame("x"))
            await rested(wire)
        assert broke == [True]
        calm, strained = (1 - MUCH) * MEMBER.burst, MUCH * MEMBER.burst
        assert len(heard) == pytest.approx(calm / 0.012 + strained / (0.012 * STRAINED_PRICE), abs=2)
        wire.transport.pause_reading.assert_called()
        wire.server.connection_lost(None)

    asyncio.run(run())


async def rested(wire: Wire) -> None:
    """Ends what the connection waits for, a lap of the event loop after the other."""
    await asyncio.sleep(0)
    while wire.server._turn is not None:
        wire.server._turn.cancel()
        wire.server._go_on()
        await asyncio.sleep(0)


class Noting:
    """An event loop that notes for how long it was asked to wait."""

    def __init__(self) -> None:
        self.loop, self.asked = asyncio.get_running_loop(), [0.0]

    def __getattr__(self, name: str) -> Any:
        return getattr(self.loop, name)

    def call_later(self, seconds: float, *arguments: Any) -> asyncio.TimerHandle:
        self.asked.append(seconds)
        return self.loop.call_later(seconds, *arguments)


def test_a_connection_that_has_taken_much_rests_longer_and_after_less(monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC P647: a thousand pings at a time, each with an answer, took every second turn of the event loop."""

    async def run() -> None:
        clock = Clock(monkeypatch)
        wire, _, broke = await _member()

        def slow(_: str | bytes) -> None:
            clock.used += 0.0025

        wire.server.listen(slow)
        noting = Noting()
        monkeypatch.setattr(wire.server, "loop", noting)
        rests = []
        while not broke:
            wire.server.data_received(text_frame("x"))
            await rested(wire)
            rests.append(max(noting.asked))
            noting.asked = [0.0]
        calm = int((1 - MUCH) * MEMBER.burst / 0.0025)
        assert rests[: calm - 1] == [0.0] * (calm - 1), "somebody who draws much, or comes again"
        strained = rests[calm + 1 : -1]
        assert strained[:40] == pytest.approx([0.0025 * STRAINED_REST] * 40), "one a turn"
        assert min(strained) >= 0.99 * 0.0025 * STRAINED_REST, "and longer yet when the address has taken much as well"
        wire.server.connection_lost(None)

    asyncio.run(run())


@pytest.mark.parametrize(("seconds", "least", "most"), [(0.002, 1, 1), (0.0005, 6, 9)])
def test_connections_of_an_address_share_each_lap_of_the_event_loop(
    seconds: float, least: int, most: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """SPEC P661, P666: what forty pages of one address send at once took 100 ms of one lap."""

    async def run() -> None:
        clock, accounts, heard = Clock(monkeypatch), Accounts(), []
        pages = [(await _member(accounts.member("192.0.2.1")))[0] for _ in range(40)]
        other, others, _ = await _member(accounts.member("192.0.2.2"))

        def slow(page: int) -> Callable[[str | bytes], None]:
            def listen(_: str | bytes) -> None:
                heard.append(page)
                clock.used += seconds

            return listen

        for n, page in enumerate(pages):
            page.server.listen(slow(n))
        await asyncio.sleep(0)
        for n in range(2):
            for page in pages:
                page.server.data_received(text_frame("x"))
            assert n == 0 or least <= len(heard) <= most, "what a page takes is known from the first time"
            other.server.data_received(text_frame("y"))
            assert len(others) == n + 1, "another address does not wait for them"
            while len(heard) < 40:
                before = len(heard)
                await asyncio.sleep(0)
                assert n == 0 or len(heard) - before <= most
            assert heard == list(range(40)), "in the order in which they came"
            heard.clear()
            await asyncio.sleep(0)
        for wire in (*pages, other):
            wire.server.connection_lost(None)

    asyncio.run(run())


def test_a_long_read_is_worked_off_in_turns(monkeypatch: pytest.MonkeyPatch) -> None:
    """What one read brings holds the loop for one turn, then others have as long."""

    async def run() -> None:
        clock = Clock(monkeypatch)
        wire, heard, broke = await _member()
        sizes: list[int] = []

        def slow(text: str | bytes) -> None:
            heard.append(text)
            clock.used += 0.001

        wire.server.listen(slow)
        wire.server.data_received(b"".join(text_frame(str(n)) for n in range(40)))
        while len(heard) < 40:
            sizes.append(len(heard))
            assert wire.transport.pause_reading.called
            wire.server.data_received(text_frame(str(100 + len(sizes)))) if len(sizes) == 2 else None
            before = len(heard)
            while len(heard) == before:
                await asyncio.sleep(0.001)
        assert sizes[0] <= 6
        assert max(b - a for a, b in pairwise(sizes)) <= 6
        while len(heard) < 41:
            await asyncio.sleep(0.001)
        assert heard == [*(str(n) for n in range(40)), "102"], "in order, with what came meanwhile"
        assert not broke
        assert wire.transport.resume_reading.called
        wire.server.connection_lost(None)

    asyncio.run(run())


def test_a_turn_of_who_takes_much_ends_with_what_others_wait(monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC P661: its processor time alone would be a turn of 40 texts."""

    async def run() -> None:
        Clock(monkeypatch)
        accounts = Accounts()
        wire, heard, _ = await _member(accounts.member("a"))
        wire.server._account.took(0.002, 0.002)
        await asyncio.sleep(2 * LAP_REST)

        def waits(text: str | bytes) -> None:
            heard.append(text)
            time.sleep(0.0015)  # another thread has the interpreter

        wire.server.listen(waits)
        wire.server.data_received(b"".join(text_frame(str(n)) for n in range(40)))
        assert 0 < len(heard) <= 5
        wire.server.connection_lost(None)

    asyncio.run(run())


@pytest.mark.parametrize("frames", [PING, text_frame("a", fin=False) + EMPTY * 100], ids=["pings", "empty"])
def test_frames_that_say_nothing_are_paid_for_too(frames: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    async def run() -> None:
        clock = Clock(monkeypatch)
        wire, _, broke = await _member(Accounts().stranger("a"))
        parse = wire.server.conn.receive_data
        parsed = 0

        def costly(data: bytes) -> None:
            nonlocal parsed
            parsed += len(data)
            clock.used += 1.5e-6 * len(data)
            parse(data)

        monkeypatch.setattr(wire.server.conn, "receive_data", costly)
        flood = frames * (4_000_000 // len(frames))
        for at in range(0, len(flood), 65536):
            wire.server.data_received(flood[at : at + 65536])
            await asyncio.sleep(0.01)
            if broke or wire.server._deaf:
                break
        assert broke or wire.server._deaf
        assert parsed < 200_000
        assert len(wire.server.frames) <= websocket.MAX_FRAGMENTS
        wire.server.connection_lost(None)

    asyncio.run(run())


def test_before_anybody_listens_a_connection_that_cannot_pay_is_dropped(monkeypatch: pytest.MonkeyPatch) -> None:
    async def run() -> None:
        Clock(monkeypatch)
        wire = Wire()
        await settle()
        wire.server.pay(2 * STRANGER.burst)
        assert wire.transport.abort.called
        wire.server.data_received(PING * 1000)
        wire.server.connection_lost(None)

    asyncio.run(run())


def test_a_message_has_only_so_many_frames() -> None:
    async def run() -> None:
        wire, heard, _ = await _member()
        whole = text_frame("a", fin=False) + b"\x00\x81" + MASK + b"b" + b"\x80\x81" + MASK + b"c"
        wire.server.data_received(whole)
        assert heard == ["abc"]
        wire.server.data_received(text_frame("a", fin=False) + EMPTY * 300)
        assert wire.server._deaf
        assert wire.server.frames == []
        assert heard == ["abc"]
        wire.server.connection_lost(None)

    asyncio.run(run())


# --- ops that cannot be read ----------------------------------------------------------------------------------------


def test_ops_that_cannot_be_read_count_like_others() -> None:
    """256 of them a message took 12 ms each, outside of the rate."""
    connection = protocol.Connection(0.0, c.SUBPROTOCOL)
    hello = {"type": "hello", "protocol": c.PROTOCOL_VERSION, "terrain": "t", "secret": "s", "client": "c1"}
    connection.text(json.dumps(hello), 0.0)
    bad: list[dict[str, Any]] = [{"id": f"c1:{n}", "op": {"type": "stroke.begin"}} for n in range(256)]
    events: list[protocol.Event] = []
    messages = 0
    while not any(isinstance(event, protocol.Close) for event in events):
        events = connection.text(json.dumps({"type": "ops", "ops": bad}), 0.0)
        messages += 1
        assert messages < 10
    assert messages == 5
    [close] = [event for event in events if isinstance(event, protocol.Close)]
    assert close.code == "rate_limited"


def test_some_ops_that_cannot_be_read_are_refused_one_by_one() -> None:
    connection = protocol.Connection(0.0, c.SUBPROTOCOL)
    hello = {"type": "hello", "protocol": c.PROTOCOL_VERSION, "terrain": "t", "secret": "s", "client": "c1"}
    connection.text(json.dumps(hello), 0.0)
    for second in range(60):
        text = json.dumps({"type": "ops", "ops": [{"id": f"c1:{second}", "op": {"type": "stroke.begin"}}] * 100})
        assert {type(event) for event in connection.text(text, float(second))} == {protocol.Refused}


def test_the_clock_of_a_thread_does_not_count_others() -> None:
    """Waiting for the interpreter's lock is not work of the connection that waits."""
    began = time.thread_time()
    time.sleep(0.05)
    assert time.thread_time() - began < 0.04
