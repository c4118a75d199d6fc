"""The solver's thread with a solver that waits for the test: the newest job wins, nobody starves (SPEC P57 to P59)."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
import pytest

from esker import contract as c
from esker.document.revisions import revision
from esker.events import BaseLevel, ChannelLevel, Preview, Settled, SolveEvent
from esker.session.ground import schedule, states, worker
from esker.session.ground.worker import TIDY_EVERY, Job, Worker

SETTINGS = c.TerrainSettings()
FLAT = np.zeros((65, 65), dtype=np.float32)


class Permits:
    """How many levels may still be made, and whether somebody waits to make one."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._left = 0
        self._waits = False

    def acquire(self) -> None:
        with self._changed:
            self._waits = True
            self._changed.wait_for(lambda: self._left > 0)
            self._left, self._waits = self._left - 1, False

    def release(self, count: int = 1) -> None:
        with self._changed:
            self._left += count
            self._changed.notify()

    def spent(self) -> bool:
        """Returns whether somebody waits for the next one."""
        with self._changed:
            return self._waits and self._left == 0


class Turnstile:
    """A solver that makes one level each time the test lets it."""

    device_name = "turnstile"

    def __init__(self) -> None:
        self.permits = Permits()
        self.closed: list[int] = []
        self.speaks = False
        self.previews_early = False
        self.tidied = threading.Event()

    def tidy(self) -> int:
        self.tidied.set()
        return 0

    def steps(self, *what: Any, **more: Any) -> Iterator[SolveEvent]:
        made = self._steps(*what, **more)
        return WithEarlyPreviews(made) if self.previews_early else made

    def _steps(
        self, strokes: Sequence[c.Stroke], settings: c.TerrainSettings, levels: int | None = None, **_: Any
    ) -> Iterator[SolveEvent]:
        assert settings == SETTINGS
        try:
            for settled in (False, True):
                for level in range((levels or 0) + 1):
                    self.permits.acquire()
                    yield Settled(level, FLAT) if settled else Preview(level, FLAT)
                    if self.speaks and level == 0 and not settled:
                        yield from self.channels()
        finally:
            self.closed.append(len(strokes))

    def channels(self, *_: Any, **__: Any) -> Iterator[SolveEvent]:
        self.permits.acquire()
        yield ChannelLevel(0, FLAT, c.Channel.SNOW)

    def base_levels(self, base: Any, levels: int) -> Iterator[BaseLevel]:
        for level in range(levels + 1):
            self.permits.acquire()
            yield BaseLevel(level, base.level(level), c.Channel.BASE)

    def refiner(self, basis: object) -> Any:
        raise AssertionError(f"nobody was given {basis}")


class WithEarlyPreviews:
    """A solve that can show the coarsest level of newer strokes."""

    def __init__(self, made: Iterator[SolveEvent]) -> None:
        self._made = made

    def __iter__(self) -> Iterator[SolveEvent]:
        return self

    def __next__(self) -> SolveEvent:
        return next(self._made)

    def early_preview(self, *_: Any) -> Preview:
        return Preview(0, FLAT)


class Bench:
    """A worker whose time is a number and whose deliveries are written down."""

    def __init__(self) -> None:
        self.now = 0.0
        self.solver = Turnstile()
        self.worker = Worker(lambda _: self.solver, now=lambda: self.now)
        self.worker.start()
        self.got: list[tuple[str, int, int, bool]] = []
        self.confirmed: list[tuple[int, int]] = []
        self._arrived = threading.Condition()

    def room(self, name: str, levels: int = 2) -> Any:
        def deliver(clock: int, result: Any) -> None:
            what = name if result.channel == c.Channel.HEIGHT else f"{name}.snow"
            with self._arrived:
                self.got.append((what, clock, result.level, result.settled))
                self._arrived.notify()

        def confirm(clock: int, level: int) -> None:
            with self._arrived:
                self.confirmed.append((clock, level))
                self._arrived.notify()

        return self.worker.add(levels, deliver, _unexpected, confirm=confirm, note=deliver)

    def let(self, count: int) -> list[tuple[str, int, int, bool]]:
        """Lets ``count`` levels be made; returns the deliveries so far."""
        goal = len(self.got) + count
        for _ in range(count):
            self.solver.permits.release()
        with self._arrived:
            assert self._arrived.wait_for(lambda: len(self.got) >= goal, 60), self.got
        return self.got

    def confirms(self, clock: int, level: int) -> None:
        """Waits until the newest confirmation is this one: it follows the state in which nothing is to be done."""
        with self._arrived:
            assert self._arrived.wait_for(lambda: self.confirmed[-1:] == [(clock, level)], 60), self.confirmed

    def idle(self) -> None:
        """Waits until the worker stands at the turnstile or has nothing to do."""
        deadline = time.monotonic() + 60
        while not (self.solver.permits.spent() or self._rests()):
            assert time.monotonic() < deadline
            time.sleep(0.001)

    def _rests(self) -> bool:
        with self.worker._changed:
            return all(states.stage(ground, self.now) is None for ground in self.worker._grounds.values())

    def stop(self) -> None:
        self.solver.permits.release(100)
        self.worker.stop()


def _unexpected(note: str) -> None:
    raise AssertionError(note)


def _job(clock: int, heights_rev: int = 0, paint_rev: int = 0) -> Job:
    """Jobs with one revision of their heights have the same heights; 0 for heights of their own."""
    return Job(clock, (), SETTINGS, heights_rev or revision(), paint_rev=paint_rev)


def _bench(test: Callable[[Bench], None]) -> None:
    bench = Bench()
    try:
        test(bench)
    finally:
        bench.stop()


def test_levels_come_coarse_to_fine_then_settled() -> None:
    def run(bench: Bench) -> None:
        room = bench.room("a")
        bench.worker.request(room, _job(1))
        got = bench.let(6)
        assert got == [("a", 1, level, settled) for settled in (False, True) for level in (0, 1, 2)]

    _bench(run)


def test_a_newer_job_stops_the_old_one_at_the_next_level() -> None:
    def run(bench: Bench) -> None:
        room = bench.room("a")
        bench.worker.request(room, _job(1))
        bench.let(4)  # the preview pass is through: the finest level was delivered just now
        bench.idle()
        bench.worker.request(room, _job(2))
        bench.worker.request(room, _job(3))
        got = bench.let(2)
        # The level that was being made is delivered; then the newest job starts, the one between is skipped.
        assert got[4:] == [("a", 1, 1, True), ("a", 3, 0, False)]

    _bench(run)


def test_drawing_without_a_pause_does_not_starve_the_fine_levels() -> None:
    def run(bench: Bench) -> None:
        room = bench.room("a")
        bench.worker.request(room, _job(1))
        bench.let(3)
        finest: list[float] = [bench.now]
        for clock in range(2, 40):
            bench.worker.request(room, _job(clock))
            bench.idle()
            bench.now += 0.033
            [*_, (_, _, level, _)] = bench.let(1)
            if level == 2:
                finest.append(bench.now)
        gaps = np.diff(finest)
        assert len(gaps) >= 4
        assert max(gaps) <= states.FINEST_WITHIN + 4 * 0.033
        coarse = [entry for entry in bench.got if entry[2] == 0]
        assert len(coarse) > len(finest), "coarse levels still come more often than fine ones"

    _bench(run)


def test_a_pass_that_rests_goes_on_by_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC S598: nothing happens meanwhile that would wake the thread."""
    monkeypatch.setattr(worker, "IDLE_CHECK", 600.0)
    rests, rested_in = threading.Event(), schedule.rested_in

    def told(*of: Any) -> float | None:
        seconds = rested_in(*of)
        if seconds is not None:
            rests.set()
        return seconds

    monkeypatch.setattr(schedule, "rested_in", told)

    def run(bench: Bench) -> None:
        bench.solver.previews_early = True
        room = bench.room("a")
        bench.worker.request(room, _job(1))
        bench.let(1)
        bench.idle()
        bench.now += 0.2
        bench.let(2)
        bench.idle()
        bench.worker.request(room, _job(2))
        assert bench.let(2)[4:] == [("a", 2, 0, False)]
        assert rests.wait(60)
        with bench.worker._changed:  # until the thread waits
            bench.now += states.PEN_STILL
        assert bench.let(1)[5:] == [("a", 2, 1, False)]

    _bench(run)


def test_paint_leaves_settled_heights_alone() -> None:
    """SPEC P81."""

    def run(bench: Bench) -> None:
        room = bench.room("a")
        bench.worker.request(room, _job(1, -1))
        bench.let(6)
        bench.idle()
        for clock in (2, 3):
            bench.worker.request(room, _job(clock, -1))
            assert bench.let(1)[-1] == ("a.snow", clock, 0, True)
            bench.confirms(clock, 2)
        bench.worker.request(room, _job(4, -2))
        assert bench.let(1)[-1] == ("a", 4, 0, False)

    _bench(run)


def test_paint_does_not_stop_heights_that_settle() -> None:
    """SPEC P81: it is solved in between, the newest alone, and confirmed when the heights are final."""

    def run(bench: Bench) -> None:
        room = bench.room("a")
        bench.worker.request(room, _job(1, -1))
        bench.let(1)
        bench.idle()
        bench.worker.request(room, _job(2, -1))
        assert [entry[:3] for entry in bench.let(2)[1:]] == [("a", 1, 1), ("a", 1, 2)], "the preview goes on"
        assert bench.let(1)[-1] == ("a.snow", 2, 0, True)
        bench.let(1)
        bench.idle()
        bench.worker.request(room, _job(3, -1))
        bench.worker.request(room, _job(4, -1))
        assert bench.let(2)[-2:] == [("a", 1, 1, True), ("a.snow", 4, 0, True)]
        assert bench.let(1)[-1] == ("a", 1, 2, True)
        assert bench.confirmed == []
        assert bench.let(1)[-1] == ("a.snow", 4, 0, True)
        bench.confirms(4, 2)
        assert len(bench.confirmed) == 1

    _bench(run)


def test_paint_does_not_wait_for_a_pen_that_never_rests() -> None:
    """SPEC P81: between two levels of somebody's stroke; and older channels of that one come no more."""

    def run(bench: Bench) -> None:
        room = bench.room("a")
        bench.solver.speaks = True
        bench.worker.request(room, _job(1))
        assert bench.let(1) == [("a", 1, 0, False)]
        bench.idle()
        bench.worker.request(room, _job(2))
        bench.worker.request(room, _job(3, paint_rev=1))
        assert bench.let(2)[1:] == [("a.snow", 1, 0, True), ("a.snow", 3, 0, True)]
        bench.idle()
        assert bench.let(1)[-1] == ("a", 1, 1, False)
        bench.worker.request(room, _job(4, paint_rev=1))
        assert bench.let(1)[-1] == ("a", 1, 2, False)
        bench.idle()
        assert bench.let(1)[-1] == ("a", 4, 0, False), "no more paint, no more of it"
        assert bench.let(1)[-1] == ("a.snow", 4, 0, True)

    _bench(run)


def test_older_paint_does_not_come_after_newer() -> None:
    """SPEC P81."""

    def run(bench: Bench) -> None:
        room = bench.room("a")
        bench.solver.speaks = True
        bench.worker.request(room, _job(1))
        bench.idle()  # at level 0
        bench.worker.request(room, _job(2, paint_rev=1))
        assert bench.let(2) == [("a", 1, 0, False), ("a.snow", 2, 0, True)]
        bench.solver.permits.release()  # for the channels of the first job
        assert bench.let(1)[2:] == [("a", 1, 1, False)]

    _bench(run)


def test_a_stroke_amid_paint_starts_the_heights_anew() -> None:
    """SPEC P81: heights that were not finished are nobody's ground."""

    def run(bench: Bench) -> None:
        room = bench.room("a")
        bench.worker.request(room, _job(1, -1))
        bench.let(4)
        bench.idle()
        bench.worker.request(room, _job(2, -2))
        assert bench.let(2)[-1] == ("a", 2, 0, False)
        bench.idle()
        bench.worker.request(room, _job(3, -1))
        got = bench.let(5)
        assert ("a.snow", 3, 0, True) not in got

    _bench(run)


def test_rooms_take_turns() -> None:
    def run(bench: Bench) -> None:
        rooms = {name: bench.room(name) for name in "abc"}
        for room in rooms.values():
            bench.worker.request(room, _job(1))
        got = bench.let(18)
        assert [settled for *_, settled in got] == [False] * 9 + [True] * 9, "previews of all come first"
        assert {name for name, *_ in got[:4]} == set(rooms), "the first room may be a level ahead, as it asked first"
        for part in (got[:9], got[9:]):
            assert sorted(name for name, *_ in part) == [*"aaabbbccc"]
        assert [name for name, *_ in got[9:]] == [*"aaabbbccc"], "what was begun is settled before the next"

    _bench(run)


def test_a_solver_tidies_up_while_there_is_nothing_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC S30."""
    monkeypatch.setattr("esker.session.ground.worker.IDLE_CHECK", 0.01)

    def run(bench: Bench) -> None:
        assert bench.solver.tidied.wait(60)

    _bench(run)


def test_a_solver_tidies_up_on_a_server_that_never_rests(monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC S30: between two steps of a solve, every half minute."""
    monkeypatch.setattr("esker.session.ground.worker.IDLE_CHECK", 1000.0)

    def run(bench: Bench) -> None:
        bench.worker.request(bench.room("a"), _job(1))
        bench.let(2)
        assert not bench.solver.tidied.is_set()
        bench.now += TIDY_EVERY
        bench.let(2)
        assert bench.solver.tidied.is_set()

    _bench(run)


def test_what_a_solve_left_is_given_back_behind_the_first_level_of_the_next() -> None:
    def test(bench: Bench) -> None:
        room = bench.room("one")
        bench.worker.request(room, _job(1))
        bench.let(6)
        bench.idle()
        room.work.refiner = left = object()
        bench.worker.request(room, _job(2))
        bench.idle()
        assert (room.work.refiner, room.work.retained) == (None, left)
        bench.let(2)
        bench.idle()
        assert room.work.retained is None
        assert bench.got[-2:] == [("one", 2, 0, False), ("one", 2, 1, False)]

    _bench(test)


def test_a_closed_room_gets_nothing_more() -> None:
    def run(bench: Bench) -> None:
        room, other = bench.room("a"), bench.room("b")
        bench.worker.request(room, _job(1))
        bench.let(1)
        bench.idle()
        bench.worker.remove(room)
        bench.solver.permits.release()
        bench.idle()
        bench.worker.request(other, _job(1))
        bench.let(2)
        assert [entry[0] for entry in bench.got] == ["a", "b", "b"]

    _bench(run)


def test_a_solver_that_cannot_be_made_is_an_error_at_the_start() -> None:
    def broken(_: str | None) -> Any:
        raise RuntimeError("no device")

    with pytest.raises(RuntimeError, match="no device"):
        Worker(broken).start()
