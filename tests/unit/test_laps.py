"""SPEC P661: connections of one address share each lap of the event loop."""

from __future__ import annotations

import asyncio
import gc
import sys
from functools import partial
from typing import Any

import pytest

from esker.fairness import laps as laps_module
from esker.fairness.laps import (
    LAP_REST,
    LAP_SECONDS,
    SHARED_LAP_REST,
    SHARED_LAP_SECONDS,
    SMALL_LAPS,
    WAITED,
    Laps,
    LapShare,
)
from esker.fairness.spending import Accounts


def in_loop(run: Any) -> None:
    asyncio.run(run())


def test_a_lap_is_one_until_the_loop_has_come_round() -> None:
    async def run() -> None:
        laps = Laps()
        first = laps.now()
        assert laps.now() == first
        await asyncio.sleep(0)
        assert laps.now() == first + 1

    in_loop(run)


def test_laps_are_counted_in_another_loop_after_one_that_ended_in_the_middle() -> None:
    laps, seen = Laps(), list[int]()

    async def run() -> None:
        for _ in range(2):
            seen.append(laps.now())
            await asyncio.sleep(0)
        seen.append(laps.now())

    in_loop(run)
    in_loop(run)
    assert seen[5] > seen[4] > seen[3], "a server that starts again in one process goes on"


def test_who_waits_comes_in_order_so_many_a_lap() -> None:
    async def run() -> None:
        share, came = LapShare(Laps()), list[int]()

        def come(number: int) -> None:
            came.append(number)
            share.take(LAP_SECONDS / 2)

        share.take(LAP_SECONDS * SMALL_LAPS)
        assert share.left(is_small=True) == 0
        for number in range(9):
            share.wait(is_small=True, call=partial(come, number))
        lengths = []
        while len(came) < 9:
            await asyncio.sleep(0)
            lengths.append(len(came))
        assert came == list(range(9))
        assert lengths == [3, 6, 9]

    in_loop(run)


def test_who_comes_waits_behind_those_who_wait() -> None:
    async def run() -> None:
        share = LapShare(Laps())
        share.take(1.0)
        waiting = share.wait(is_small=False, call=lambda: None)
        await asyncio.sleep(0)
        assert share.left(is_small=False) == 0, "though nothing of this lap is taken"
        assert share.left(is_small=True) > 0, "who takes little has a line of its own"
        waiting.cancel()
        await asyncio.sleep(2 * LAP_REST)
        assert share.left(is_small=False) == pytest.approx(LAP_SECONDS)

    in_loop(run)


def test_those_that_take_much_pay_for_what_others_wait() -> None:
    """SPEC P661: beside threads that compute, a millisecond of the loop's own is five of everybody's."""

    async def run() -> None:
        share = LapShare(Laps())
        share.take(LAP_SECONDS / 5, LAP_SECONDS / WAITED)
        assert share.left(is_small=False) == 0
        assert share.left(is_small=True) == pytest.approx(LAP_SECONDS * (SMALL_LAPS - 0.2)), "people who draw do not"

    in_loop(run)


def test_beside_another_address_those_that_take_much_have_less(monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC P666: people who draw have as much as before, and a crowd that is alone does."""

    async def run() -> None:
        laps = Laps()
        crowd, other = LapShare(laps, "a"), LapShare(laps, "b")
        for _ in range(3):
            crowd.take(0.0)
            assert crowd.left(is_small=False) == pytest.approx(LAP_SECONDS), "it is alone"
        other.take(0.0001)
        crowd.take(0.0)
        assert crowd.left(is_small=False) == pytest.approx(SHARED_LAP_SECONDS)
        assert crowd.left(is_small=True) == pytest.approx(LAP_SECONDS * SMALL_LAPS)
        assert other.left(is_small=False) < SHARED_LAP_SECONDS, "and so has the other"
        third = LapShare(laps, "c")
        assert third.left(is_small=False) == pytest.approx(SHARED_LAP_SECONDS)
        crowd.take(1.0)
        began, came = asyncio.get_running_loop().time(), asyncio.Event()
        crowd.wait(is_small=False, call=came.set)
        await came.wait()
        assert asyncio.get_running_loop().time() - began >= SHARED_LAP_REST * 0.9
        monkeypatch.setattr(laps_module, "OF_LATE", 0.0)
        crowd.take(0.0)
        assert crowd.left(is_small=False) == pytest.approx(LAP_SECONDS), "the other went"

    in_loop(run)


def test_who_left_is_not_called() -> None:
    async def run() -> None:
        share, came = LapShare(Laps()), list[str]()
        share.take(1.0)
        gone = share.wait(is_small=True, call=lambda: came.append("gone"))
        share.wait(is_small=True, call=lambda: came.append("here"))
        gone.cancel()
        await asyncio.sleep(0)
        await asyncio.sleep(0)
        assert came == ["here"]

    in_loop(run)


def test_shares_are_freed_the_moment_that_nobody_holds_them() -> None:
    """SPEC S595: each connection has one until it is known whose it is."""

    async def run() -> None:
        gc.collect()
        gc.disable()
        try:
            account = Accounts().member("192.0.2.1")
            account.took(1.0, 1.0)
            account.wait(lambda: None).cancel()
            await asyncio.sleep(2 * LAP_REST)
            share = account._crowd.lap
            del account
            assert sys.getrefcount(share) == 2
        finally:
            gc.enable()

    in_loop(run)


def test_tasks_wait_for_their_turn_and_do_not_all_begin_in_one_lap() -> None:
    async def run() -> None:
        accounts, begun = Accounts(), list[int]()
        each = [accounts.member("192.0.2.1") for _ in range(8)]
        for account in each:
            account.took(0.002, 0.002)

        async def work(number: int) -> None:
            await each[number].turn()
            begun.append(number)
            each[number].took(0.002, 0.002)

        tasks = [asyncio.create_task(work(number)) for number in range(8)]
        await asyncio.sleep(0)
        assert begun == [0, 1]
        tasks[2].cancel()
        most = 0
        while len(begun) < 7 and most <= 2:
            before = len(begun)
            await asyncio.sleep(0)
            most = max(most, len(begun) - before)
        assert begun == [0, 1, *range(3, 8)]
        assert most <= 2

    in_loop(run)


def test_pages_that_have_just_come_do_not_all_begin_in_one_lap_either() -> None:
    """What they take is not known yet."""

    async def run() -> None:
        accounts, begun = Accounts(), list[int]()

        async def work(number: int) -> None:
            await accounts.member("192.0.2.1").turn()
            begun.append(number)

        tasks = [asyncio.create_task(work(number)) for number in range(20)]
        asyncio.get_running_loop().call_soon(accounts.member("192.0.2.1").took, 1.0, 1.0)
        late = [asyncio.create_task(work(number)) for number in range(20, 40)]
        other = asyncio.create_task(accounts.member("192.0.2.2").turn())
        await asyncio.sleep(0)
        assert begun == list(range(20)), "before anybody took much"
        await asyncio.sleep(0)
        assert other.done(), "another address does not wait for them"
        while len(begun) < 40:
            before = len(begun)
            await asyncio.sleep(0)
            assert len(begun) - before <= 5
        await asyncio.gather(*tasks, *late)

    in_loop(run)


def test_who_is_cancelled_in_the_lap_before_its_turn_is_passed_over() -> None:
    async def run() -> None:
        accounts, wrong = Accounts(), list[Any]()
        loop = asyncio.get_running_loop()
        loop.set_exception_handler(lambda _, context: wrong.append(context))
        loop.call_soon(accounts.member("192.0.2.1").took, 1.0, 1.0)
        waiting = asyncio.create_task(accounts.member("192.0.2.1").turn())
        await asyncio.sleep(0)
        waiting.cancel()  # it hears of that in the next lap, after it was served
        await asyncio.sleep(0)
        await asyncio.sleep(0)
        assert waiting.cancelled()
        assert wrong == []

    in_loop(run)
