"""The tiles of one client on their way (SPEC P642, P643)."""

from __future__ import annotations

import asyncio
from concurrent.futures import Future
from typing import Any

from esker import contract as c
from esker.session.ground.frames.feed import TileFeed
from esker.session.ground.frames.stream import BATCH_BYTES, FIRST_BATCH_BYTES, SEEN_BYTES, Stream


class Outlet:
    """A connection that takes what it is given."""

    closing, home = None, "10.0.0.7"

    def notify(self) -> None:
        pass

    def close(self, code: str, reason: str) -> None:
        raise AssertionError(f"{code}: {reason}")


class Later:
    """An executor that keeps what it was given, and runs it when it is told to."""

    def __init__(self) -> None:
        self.ordinary: list[Any] = []
        self.newcomers: list[tuple[object, Any]] = []

    def submit(self, fn: Any, *args: Any) -> Future[Any]:
        self.ordinary.append(lambda: fn(*args))
        return Future()

    first = submit

    def behind(self, home: object, fn: Any, *args: Any) -> Future[Any]:
        self.newcomers.append((home, lambda: fn(*args)))
        return Future()


class Plan:
    """A frame of a tile."""

    def encode(self) -> bytes:
        return b"tile"


class Client:
    """Has so many tiles to send."""

    def __init__(self, frames: int) -> None:
        self.frames = frames

    def set_view(self, view: c.View) -> None:
        pass

    def plan(self, _after_coarse: bool) -> Plan | None:
        return Plan() if self.frames else None

    def commit(self, _plan: Plan) -> None:
        self.frames -= 1


class Tiles:
    """Gives each newcomer a client with three tiles, and knows how many were made."""

    def __init__(self) -> None:
        self.made = 0

    def server(self, *_settings: float) -> Any:
        return object()

    def client(self, _server: Any) -> Client:
        self.made += 1
        return Client(3)


def _feed(tiles: Any, later: Any, loop: asyncio.AbstractEventLoop) -> TileFeed:
    return TileFeed(tiles, 4096.0, 4, 4, later, loop, lambda *_: None, lambda *_: None)


def test_a_newcomer_waits_behind_until_the_first_view_is_whole() -> None:
    """SPEC P642."""

    async def run() -> None:
        later = Later()
        feed = _feed(Tiles(), later, asyncio.get_running_loop())
        stream = feed.add(Outlet())
        for _ in range(10):
            if not later.newcomers:
                break
            home, work = later.newcomers.pop()
            assert home == "10.0.0.7"
            work()
            await asyncio.sleep(0)
            while feed.sent(stream):
                await asyncio.sleep(0)
            await asyncio.sleep(0)
        assert stream.whole
        assert stream.newcomer, "nothing of it was applied"
        assert not later.newcomers
        feed.credit(stream, stream.in_flight)
        assert not stream.newcomer
        assert not later.ordinary
        feed.view(stream, c.View(eye=(0, 0, 900), target=(100, 0, 0)))
        assert len(later.ordinary) == 1
        assert not later.newcomers

    asyncio.run(run())


def test_whoever_applies_half_a_window_is_no_newcomer_and_claims_count_only_as_far_as_they_are_true() -> None:
    """SPEC P642: ground that never stands still is never seen whole."""
    stream = Stream(Outlet())
    stream.credit(10 * SEEN_BYTES)
    assert stream.newcomer
    assert stream.in_flight == 0
    for _ in range(2):
        stream.in_flight += SEEN_BYTES // 2
        stream.credit(SEEN_BYTES // 2)
    assert not stream.newcomer


def test_whoever_has_applied_all_before_it_is_known_to_be_all_is_no_newcomer() -> None:
    """SPEC P642: a client that is quicker than the server had its first stroke behind others."""
    stream = Stream(Outlet())
    stream.made(False)
    assert stream.newcomer, "there was no ground yet"
    stream.in_flight = 100
    stream.made(True)
    stream.credit(100)
    assert stream.newcomer
    stream.made(False)
    assert not stream.newcomer


def test_little_at_a_time_is_made_for_newcomers() -> None:
    """SPEC P93, P642: a go of theirs took fifty milliseconds, and others' tiles waited."""
    stream = Stream(Outlet())
    assert stream.most == FIRST_BATCH_BYTES
    stream.newcomer = False
    assert stream.most == BATCH_BYTES
    stream.in_flight = c.BYTE_WINDOW - 7
    assert stream.most == 7


def test_nothing_is_made_for_who_left() -> None:
    """SPEC P643: frames that were made after a client had left kept its tiles for ever."""

    async def run() -> None:
        later, tiles = Later(), Tiles()
        feed = _feed(tiles, later, asyncio.get_running_loop())
        stream = feed.add(Outlet())
        feed.remove(stream)
        for work in (*later.ordinary, *(work for _, work in later.newcomers)):
            work()
        await asyncio.sleep(0)
        assert tiles.made == 0
        assert not feed.sent(stream)

    asyncio.run(run())
