"""SPEC P648: what many have waited for is not done for all of them in one turn of the event loop."""

from __future__ import annotations

import asyncio
import threading
import time
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from esker.fairness.shares import Who
from esker.fairness.turns import Turnstile
from esker.session.room.hub import Hub
from tests.sync.harness import LiveServer

HERE, THERE = Who("192.0.2.1"), Who("192.0.2.2")


def busy(seconds: float) -> None:
    """Takes so much processor time."""
    until = time.thread_time() + seconds
    while time.thread_time() < until:
        pass


def test_pieces_follow_each_other_in_turns_of_addresses_with_rests() -> None:
    done: list[tuple[str, float, float]] = []

    async def run() -> None:
        turnstile, loop = Turnstile(), asyncio.get_running_loop()

        def piece(name: str) -> str:
            began = loop.time()
            busy(0.01)
            done.append((name, began, loop.time()))
            return name

        runs = [turnstile.run(HERE, piece, f"here {n}") for n in range(4)] + [turnstile.run(THERE, piece, "there")]
        assert await asyncio.gather(*runs) == [f"here {n}" for n in range(4)] + ["there"]

    asyncio.run(run())
    assert [name for name, _, _ in done] == ["here 0", "here 1", "there", "here 2", "here 3"], "after one of each"
    assert all(after - before >= 0.008 for (_, _, before), (_, after, _) in pairwise(done)), "others have as long"


def test_a_rest_is_as_long_as_others_waited() -> None:
    """SPEC P648: beside threads that compute, most of it is no processor time."""

    async def run() -> float:
        turnstile = Turnstile()
        await turnstile.run(HERE, time.sleep, 0.05)
        began = time.monotonic()
        await turnstile.run(THERE, lambda: None)
        return time.monotonic() - began

    assert asyncio.run(run()) >= 0.04


def test_what_fails_or_is_left_holds_nobody_up() -> None:
    async def run() -> None:
        turnstile = Turnstile()

        def fails() -> None:
            raise ValueError("no")

        failing = asyncio.ensure_future(turnstile.run(HERE, fails))
        left = asyncio.ensure_future(turnstile.run(HERE, fails))
        last = asyncio.ensure_future(turnstile.run(HERE, lambda: "yes"))
        await asyncio.sleep(0)
        left.cancel()
        with pytest.raises(ValueError, match="no"):
            await failing
        assert await last == "yes"
        assert left.cancelled()

    asyncio.run(asyncio.wait_for(run(), 10))


def test_a_crowd_that_waited_for_one_room_comes_in_one_by_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two hundred people whose heavy document was encoded at last were let in at once, which took half a second."""
    came: list[tuple[float, float]] = []
    joined = Hub._joined

    def slowly(self: Hub, *arguments: Any) -> Any:
        began = time.monotonic()
        busy(0.02)
        found = joined(self, *arguments)
        came.append((began, time.monotonic()))
        return found

    monkeypatch.setattr(Hub, "_joined", slowly)
    with LiveServer(tmp_path) as server:
        terrain, secret = server.create()
        everybody: list[Any] = []
        threads = [
            threading.Thread(target=lambda n=n: everybody.append(server.join(terrain, secret, f"c{n}")))
            for n in range(8)
        ]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        for each in everybody:
            each.close()
    assert len(came) == 8
    assert all(after - before > 0.01 for (_, before), (after, _) in pairwise(came))
