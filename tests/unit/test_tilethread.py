"""Levels before frames in the tile thread (SPEC P59)."""

from __future__ import annotations

import threading
from concurrent.futures import CancelledError

import pytest

from esker.fairness.rounds import Rounds
from esker.session.ground.frames.tilethread import Lane, TileThread


def test_what_is_first_runs_before_what_waits_and_each_in_its_order() -> None:
    thread, gate, log = TileThread(), threading.Event(), list[str]()
    thread.submit(gate.wait)
    for name in ("a", "b"):
        thread.submit(log.append, name)
    for name in ("1", "2"):
        thread.first(log.append, name)
    gate.set()
    thread.shutdown()
    assert log == ["1", "2", "a", "b"]


def test_results_and_errors_arrive_and_a_stopped_thread_takes_nothing() -> None:
    thread = TileThread()
    assert thread.submit(lambda x, y: x + y, 1, y=2).result(60) == 3
    with pytest.raises(ZeroDivisionError):
        thread.first(lambda: 1 // 0).result(60)
    thread.shutdown()
    with pytest.raises(RuntimeError):
        thread.submit(print)


def test_shutting_down_may_drop_what_waits() -> None:
    thread, gate, started = TileThread(), threading.Event(), threading.Event()

    def hold() -> None:
        started.set()
        gate.wait()

    running = thread.submit(hold)
    assert started.wait(60)
    waiting = thread.submit(print)
    thread.shutdown(wait=False, cancel_futures=True)
    gate.set()
    running.result(60)
    with pytest.raises(CancelledError):
        waiting.result(60)


class Held:
    """A thread that is held while work is given to it, and what it then did."""

    def __init__(self) -> None:
        self.log: list[str] = []
        self.now = 0.0
        self.thread, self._gate = TileThread(now=lambda: self.now), threading.Event()
        started = threading.Event()

        def hold() -> None:
            started.set()
            self._gate.wait()

        self.thread.first(hold)
        assert started.wait(60)

    def lane(self, home: str) -> Lane:
        lane = self.thread.lane()
        lane.home = home
        return lane

    def done(self) -> list[str]:
        self._gate.set()
        self.thread.shutdown()
        return self.log


def test_sixty_rooms_of_one_address_have_one_turn_before_the_next() -> None:
    """SPEC A445: levels of sixty new rooms lay before the one that somebody waited for."""
    held = Held()
    for k in range(60):
        held.lane("stranger").first(held.log.append, f"s{k}")
    mine = held.lane("me")
    for name in ("m0", "m1"):
        mine.first(held.log.append, name)
    done = held.done()
    assert max(done.index("m0"), done.index("m1")) <= 3
    assert len(done) == 62
    assert [name for name in done if name[0] == "s"] == [f"s{k}" for k in range(60)]


def test_frames_come_while_levels_of_another_address_come_without_end() -> None:
    """SPEC A445: frames were made only when no level of anybody waited, or had waited for a tenth of a second each."""
    held = Held()
    stranger, mine = held.lane("stranger"), held.lane("me")
    for k in range(6):
        stranger.first(held.log.append, f"s{k}")
    for name in ("f0", "f1"):
        mine.submit(held.log.append, name)
    assert held.done() == ["s0", "f0", "s1", "f1", "s2", "s3", "s4", "s5"]


def test_frames_of_who_has_levels_wait_for_these() -> None:
    """SPEC A445, P59: within one address levels go first, however long frames have waited."""
    held = Held()
    lane = held.lane("me")
    lane.submit(held.log.append, "f")
    lane.first(held.log.append, "l")
    assert held.done() == ["l", "f"]


def test_newcomers_come_behind_others_and_each_address_has_its_turn() -> None:
    """SPEC P642: the first views of two hundred seats of one stranger lay before the frames of those who draw."""
    held = Held()
    lane = held.lane("room")

    def work(name: str, milliseconds: int) -> None:
        held.log.append(name)
        held.now += milliseconds / 1000

    for k in range(20):
        lane.behind("stranger", work, f"s{k}", 12)
    for k in range(4):
        lane.behind("pupil", work, f"p{k}", 1)
    for k in range(40):
        lane.submit(work, f"m{k}", 3)
    done = held.done()
    assert [name for name in done if name[0] == "m"] == [f"m{k}" for k in range(40)]
    # 120 ms of others' work: 40 for newcomers, whose addresses have turns of 12 and of 1.
    assert sum(name[0] == "s" for name in done[: done.index("m39")]) == 4, "a quarter of the time, not of the turns"
    assert done.index("p3") < done.index("s4"), "of newcomers each address has its turn"
    assert len(done) == 64


def test_newcomers_have_all_turns_where_nobody_else_has_work() -> None:
    """SPEC P642."""
    held = Held()
    for k in range(3):
        held.thread.behind("me", held.log.append, f"n{k}")
    assert held.done() == ["n0", "n1", "n2"]


def test_what_newcomers_wait_for_may_be_dropped() -> None:
    """SPEC P642."""
    held = Held()
    waiting = held.thread.behind("me", print)
    held.thread.shutdown(wait=False, cancel_futures=True)
    held.done()
    with pytest.raises(CancelledError):
        waiting.result(60)


def test_who_had_a_turn_longest_ago_is_next_and_only_so_many_are_remembered() -> None:
    """SPEC P641."""
    rounds = Rounds(most=3)
    for key in "abca":
        rounds.took(key)
    assert sorted("abcd", key=rounds.last) == ["d", "b", "c", "a"]
    for k in range(100):
        rounds.took(k)
    assert len(rounds) == 3
    assert rounds.last("a") == 0
    assert rounds.last(99) > rounds.last(98) > 0
