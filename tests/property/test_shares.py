"""Fair shares, whatever is asked for in whatever order (SPEC P280 to P283)."""

from __future__ import annotations

import asyncio
from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from esker.fairness.shares import (
    EDITOR,
    OWNER,
    RANK,
    VIEWER,
    Full,
    Line,
    Place,
    Places,
    Rate,
    Rates,
    Share,
    Who,
    homes,
)
from esker.fairness.turns import FairThreads, Turns

ADDRESSES = st.one_of(
    st.integers(0, 5).map(lambda n: f"192.0.2.{n}"),
    st.tuples(st.integers(0, 2), st.integers(0, 2), st.integers(0, 3)).map(lambda t: f"2001:db8:{t[0]}:{t[1]}::{t[2]}"),
)
WHO = st.builds(Who, ADDRESSES, st.sampled_from(["", "a", "b", "c"]), st.sampled_from([VIEWER, EDITOR, OWNER]))
SHARE = Share(total=12, address=5, network=7, link=4, reserve=(4, 2))


@pytest.mark.parametrize(
    ("address", "home", "site"),
    [
        ("192.0.2.7", "192.0.2.7", "192.0.2.7"),
        ("::ffff:192.0.2.7", "192.0.2.7", "192.0.2.7"),
        ("2001:db8:1:2:3:4:5:6", "2001:db8:1:2::/64", "2001:db8:1::/48"),
        ("fe80::1%eth0", "fe80::/64", "fe80::/48"),
        ("unknown", "unknown", "unknown"),
        ("", "", ""),
    ],
)
def test_what_an_address_counts_as(address: str, home: str, site: str) -> None:
    """SPEC P280."""
    assert homes(address) == (home, site)


@given(st.lists(st.one_of(WHO, st.integers(0, 30)), max_size=80))
def test_no_order_of_asking_and_leaving_breaks_a_share(steps: list[Who | int]) -> None:
    """SPEC P280: a number gives a place back, anybody else asks for one."""
    places, held = Places(SHARE), list[Place]()
    for step in steps:
        if isinstance(step, int):
            if held:
                gone = held.pop(step % len(held))
                gone.release()
                gone.release()
            continue
        refused = places.refusal(step)
        before = len(held)
        if refused is not None:
            with pytest.raises(Full) as full:
                places.take(step)
            assert full.value.kind == refused
            assert refused != "total" or before >= SHARE.total - SHARE.left_free(step.rank)
        else:
            held.append(places.take(step))
            for kind, key in step.counted():
                same = [p for p in held if (kind, key) in p.who.counted() and p.who.rank == VIEWER]
                assert len(same) <= SHARE.most(kind)
        assert len(places) == len(held)
    for place in held:
        place.release()
    assert not len(places)
    assert not places._counts, "nothing is remembered of who has left"


def test_viewers_leave_places_to_those_who_draw_and_these_to_owners() -> None:
    """SPEC P281."""
    places = Places(Share(total=20, reserve=(6, 2)))
    for count, rank in ((14, VIEWER), (4, EDITOR), (2, OWNER)):
        for _ in range(count):
            places.take(Who("192.0.2.1", "one", rank))
        with pytest.raises(Full):
            places.take(Who("192.0.2.2", "two", rank))
    assert RANK == {"view": VIEWER, "edit": EDITOR, "owner": OWNER}


def test_a_lower_rank_behind_the_same_address_keeps_nobody_out() -> None:
    """SPEC P281: the teacher's address is that of the class."""
    places = Places(Share(total=20, address=5, link=5, reserve=(6, 2)))
    for _ in range(5):
        places.take(Who("192.0.2.1", "view", VIEWER))
    with pytest.raises(Full) as full:
        places.take(Who("192.0.2.1", "other", VIEWER))
    assert full.value.yours
    places.take(Who("192.0.2.1", "owner", OWNER))


@given(st.lists(WHO, min_size=1, max_size=60), WHO)
def test_who_yields_has_more_than_who_comes(askers: list[Who], newcomer: Who) -> None:
    """SPEC P280: giving way never leaves the giver with less than the newcomer has then."""
    places = Places(Share(total=8))
    for who in askers:
        try:
            places.take(who)
        except Full:
            break
    victim = places.yielding(newcomer)
    loads = Counter(place.who.site for place in places)
    if victim is None:
        assert max(loads.values()) < loads[newcomer.site] + 2
    else:
        assert loads[victim.who.site] == max(loads.values())
        assert loads[victim.who.site] - 1 >= loads[newcomer.site] + 1


def test_of_several_the_one_in_use_longest_ago_goes() -> None:
    """SPEC P280."""
    places = Places(Share(total=3))
    first, second, _ = (places.take(Who("192.0.2.1")) for _ in range(3))
    first.touch()
    assert places.yielding(Who("192.0.2.2")) is second


@given(st.lists(st.tuples(WHO, st.floats(0, 3)), min_size=1, max_size=120))
def test_no_rate_is_exceeded(asked: list[tuple[Who, float]]) -> None:
    """SPEC P282: of any stretch of time, by address, /48, link and in all."""
    rates = {"address": Rate(1, 4), "network": Rate(2, 6), "link": Rate(1, 3), "total": Rate(3, 9)}
    buckets = Rates(rates["address"], network=rates["network"], link=rates["link"], total=rates["total"])
    taken: list[tuple[float, Who]] = []
    now = 0.0
    for who, pause in asked:
        now += pause
        if buckets.take(who, now):
            taken.append((now, who))
    for kind, rate in rates.items():
        for key in {k for _, who in taken for k in (*who.counted(), ("total", ""))}:
            if key[0] == kind:
                times = [at for at, who in taken if key in (*who.counted(), ("total", ""))]
                for i, start in enumerate(times):
                    for j in range(i, len(times)):
                        assert j - i + 1 <= rate.burst + (times[j] - start) * rate.per_second + 1e-6


def test_a_refusal_costs_nobody_anything() -> None:
    """SPEC P282: who is refused for the own address does not use up what the server has for all."""
    buckets = Rates(Rate(0, 1), total=Rate(0, 3))
    assert [buckets.take(Who("192.0.2.1"), 0.0) for _ in range(9)].count(True) == 1
    assert buckets.take(Who("192.0.2.2"), 0.0)
    assert buckets.take(Who("192.0.2.3"), 0.0)
    assert not buckets.take(Who("192.0.2.4"), 0.0)


def test_keys_that_are_forgotten_do_not_free_the_whole() -> None:
    """SPEC P282: a flood of addresses does not reset what all share."""
    buckets = Rates(Rate(0, 1), total=Rate(0, 10), most_keys=3)
    assert sum(buckets.take(Who(f"192.0.2.{n}"), 0.0) for n in range(50)) == 10


@given(st.lists(st.tuples(st.sampled_from("abc"), st.integers(0, 9)), max_size=60), st.integers(1, 4))
def test_whoever_waits_is_served_after_one_of_each(steps: list[tuple[str, int]], each: int) -> None:
    """SPEC P283."""
    line: Line[tuple[str, int]] = Line(most=each + 1, each=each)
    running: list[str] = []
    for number, (key, then) in enumerate(steps):
        line.join(key, (key, number))
        if running and then % 2:
            line.done(running.pop(then % len(running)))
        while (found := line.next()) is not None:
            running.append(found[0])
        assert line.running == len(running) <= each + 1
        assert max(Counter(running).values()) <= each
    order = []
    while len(line):
        line.done(running.pop(0))
        while (found := line.next()) is not None:
            running.append(found[0])
            order.append(found)
    for key in "abc":
        mine = [number for k, number in order if k == key]
        assert mine == sorted(mine)


def test_a_long_line_of_one_does_not_stand_before_another() -> None:
    """SPEC P283."""
    line: Line[str] = Line(most=1)
    for n in range(100):
        line.join("stranger", f"stranger {n}")
    line.join("somebody", "somebody")
    assert line.next() == "stranger 0"
    line.done("stranger")
    assert line.next() == "somebody"


def test_turns_survive_being_given_up() -> None:
    """SPEC P283: whoever is cancelled, waiting or served, leaves the turn to the next."""

    async def run() -> None:
        turns, served = Turns(1, waiting=3), list[str]()
        begun, go_on = asyncio.Event(), asyncio.Event()

        async def holder() -> None:
            async with turns.turn(Who("192.0.2.1")):
                begun.set()
                await go_on.wait()

        async def quick(name: str) -> None:
            async with turns.turn(Who("192.0.2.1")):
                served.append(name)

        first = asyncio.create_task(holder())
        await begun.wait()
        waiting = [asyncio.create_task(quick(name)) for name in "abc"]
        await asyncio.sleep(0)
        assert turns.locked()
        with pytest.raises(Full):
            await quick("d")
        waiting[0].cancel()
        first.cancel()
        await asyncio.gather(first, *waiting, return_exceptions=True)
        assert served == ["b", "c"]
        assert not turns.locked()

    asyncio.run(run())


def test_one_address_takes_half_of_the_threads() -> None:
    """SPEC P283: beside forty slow jobs of a stranger another's job is done at once."""
    import threading

    async def run() -> None:
        threads, release = FairThreads(4, "test"), threading.Event()
        slow = [asyncio.create_task(threads.run(Who("192.0.2.1"), release.wait)) for _ in range(40)]
        await asyncio.sleep(0)
        try:
            assert await asyncio.wait_for(threads.run(Who("192.0.2.2"), lambda: 7), 60) == 7
        finally:
            release.set()
            await asyncio.gather(*slow)
            threads.shutdown()

    asyncio.run(run())
