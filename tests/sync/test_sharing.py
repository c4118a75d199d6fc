"""Whose turn it is on the solver, and what is ended for whom (SPEC P57 to P59, P70, P71; DESIGN 8)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from esker import contract as c
from esker.grid import solve_bytes
from esker.session import schedule as module
from esker.session.schedule import Client, Job, Schedule
from tests.sync.harness import Level

SETTINGS = c.TerrainSettings()


def ignore(*_: Any) -> None:
    """A callback that does nothing."""


class Desk:
    """A schedule driven by hand: every slice is one level of a solve with levels 0..2, or one cycle of settling."""

    def __init__(self, budget: int = module.BUDGET) -> None:
        self.now = 0.0
        self.schedule = Schedule(lambda: self.now, budget)
        self.log: list[tuple[Client, str]] = []
        self.pace: dict[Client, float] = {}

    def client(self, levels: int = 2) -> Client:
        client = Client(levels, ignore, ignore)
        self.schedule.clients.append(client)
        return client

    def ask(self, client: Client, clock: int = 1) -> None:
        client.request(Job(clock, (), SETTINGS), self.now)

    def slice(self, seconds: float = 0.001) -> Client | None:
        """One turn, as the worker takes it."""
        client = self.schedule.pick()
        if client is None:
            return None
        if self.schedule.begin(client) is not None:
            client.steps = _levels(client.top)
        assert client.steps is not None
        result = next(client.steps, None)
        self.now += self.pace.get(client, seconds)
        self.schedule.ended(client)
        if result is None:
            client.steps = None
        else:
            client.took(result, self.now)
            self.log.append((client, f"{result.level}{'s' if result.settled else ''}"))
        return client

    def until(self, client: Client, what: str, most: int = 200) -> int:
        """Slices until a client has got something."""
        for count in range(1, most):
            self.slice()
            if (client, what) in self.log:
                return count
        raise AssertionError((what, self.log))


def _levels(top: int) -> Iterator[Any]:
    for settled in (False, True):
        for level in range(top + 1):
            yield Level(level, np.zeros((1, 1), dtype=np.float32), settled)


def test_a_coarse_preview_goes_before_finer_ones_and_before_settling() -> None:
    desk = Desk()
    first, second, third = (desk.client() for _ in range(3))
    desk.ask(first)
    desk.until(first, "0s")
    desk.ask(second)
    desk.until(second, "0")
    desk.ask(third)
    assert desk.until(third, "0") == 1
    assert {desk.slice() for _ in range(4)} == {second, third}, "finer previews before settling, in turn"
    assert desk.until(first, "2s") < 10


def test_settling_gets_its_share_while_others_draw_without_end() -> None:
    desk = Desk()
    drawing, settling = desk.client(), desk.client()
    desk.ask(settling)
    desk.until(settling, "2")
    for clock in range(1, 400):
        desk.ask(drawing, clock)
        desk.slice(0.02)
        if (settling, "2s") in desk.log:
            break
    assert desk.now < 4 * 3 * module.PATIENCE


def test_a_coarse_preview_waits_for_one_slice_of_a_big_terrain_however_long_they_are() -> None:
    desk = Desk()
    big = desk.client(6)
    desk.pace[big] = 4 * module.PATIENCE
    desk.ask(big)
    desk.until(big, "6")
    small = [desk.client() for _ in range(4)]
    for clock in range(1, 40):
        for client in small:
            desk.ask(client, clock)
        begun, out_of_turn = len(desk.log), 0
        while len([1 for x, what in desk.log[begun:] if x in small and what == "0"]) < len(small):
            out_of_turn += desk.slice() is big
        assert out_of_turn <= 1
        desk.slice()


def test_a_coarse_preview_ends_the_settling_solve_that_began_last_and_that_settles_later() -> None:
    desk = Desk(budget=2 * solve_bytes(4))
    early, late, new = (desk.client(4) for _ in range(3))
    for client in (early, late):
        desk.ask(client)
        desk.until(client, "4")
    desk.ask(new)
    assert desk.until(new, "0") == 1
    assert early.steps is not None
    assert late.steps is None
    assert late.newest is not None
    for client in (early, new, late):
        desk.until(client, "4s")


def test_previews_are_not_ended_for_a_coarse_one_and_never_more_solves_run_than_fit() -> None:
    desk = Desk(budget=3 * solve_bytes(4))
    clients = [desk.client(4) for _ in range(12)]
    for client in clients:
        desk.ask(client)
    most = 0
    while desk.slice() is not None:
        most = max(most, sum(x.steps is not None for x in clients))
    assert most == 3
    for client in clients:
        assert [what for x, what in desk.log if x is client].count("4s") == 1
        got = [what for x, what in desk.log if x is client]
        assert got.count("0") == got.count("4"), "a preview that was begun is shown whole"


def test_a_solve_bigger_than_the_budget_still_runs_alone() -> None:
    desk = Desk(budget=solve_bytes(4))
    big, small = desk.client(6), desk.client(4)
    desk.ask(big)
    desk.until(big, "6")
    desk.ask(small)
    desk.until(small, "4s")
    desk.until(big, "6s")


def test_a_preview_that_is_about_to_end_is_shown_whole_and_not_stopped() -> None:
    client = Client(2, ignore, ignore)
    shown: list[list[bool]] = []
    now = 0.0
    for clock in (1, 2):
        now += 0.1
        client.request(Job(clock, (), SETTINGS), now)
        client.begin()
        client.steps = iter(())
        row = []
        for level, takes in ((0, 0.005), (1, 0.4), (2, 0.02)):
            now += takes
            row.append(client.took(Level(level, np.zeros((1, 1), dtype=np.float32), False), now))
            if clock == 2 and level < 2:
                client.request(Job(9, (), SETTINGS), now)
                assert client.starts(now) == (level == 0), "0.42 s before the end, but not 0.02 s before it"
                client.newest = None
        shown.append(row)
    # Nothing is known of the first pass; in the second, level 1 comes 20 ms before the finest and is not worth a look.
    assert shown == [[True, True, True], [True, False, True]]


def test_the_finest_preview_has_time_to_be_sent() -> None:
    """A newer preview of a level between would bar it; the coarsest alone is shown at any time (SPEC P71)."""
    client = Client(2, ignore, ignore)
    flat = np.zeros((1, 1), dtype=np.float32)

    def passing(clock: int, at: float) -> list[bool]:
        client.request(Job(clock, (), SETTINGS), at)
        client.begin()
        client.steps = iter(())
        return [client.took(Level(level, flat, False), at + 0.001 * level) for level in (0, 1)]

    assert passing(1, 10.0) == [True, True], "the first is shown at once"
    assert client.took(Level(2, flat, False), 10.1)
    assert passing(2, 10.12) == [True, False]
    assert passing(3, 10.15) == [True, False]
    assert passing(4, 10.17) == [True, True]
    assert client.took(Level(2, flat, False), 10.27)


class Seer(Iterator[Any]):
    """A solve of levels 0..2 that can tell what newer strokes look like."""

    def __init__(self) -> None:
        self._levels = _levels(2)

    def __next__(self) -> Any:
        return next(self._levels)

    def glimpse(self, *_: Any) -> Any:
        return Level(0, np.zeros((1, 1), dtype=np.float32), False)


def test_a_newer_job_shows_its_coarsest_level_while_a_pass_goes_on() -> None:
    """SPEC P92: once for each job, and not before the pass has shown its own; then its pass begins without it."""
    client = Client(2, ignore, ignore)
    client.request(Job(1, (), SETTINGS), 0.0)
    client.begin()
    client.steps, client.finest_at, client._lead = Seer(), 0.0, {0: 0.1, 1: 0.05}
    newer = Job(2, (), SETTINGS)
    client.request(newer, 0.01)
    assert not client.glimpse_due, "the first level of the pass comes as soon"
    client.took(next(client.steps), 0.01)
    assert client.glimpse_due
    assert client.stage(0.01) == module.COARSE
    client.glimpsed, client.ahead, client.stepped = newer, True, False
    assert not client.glimpse_due
    assert client.stage(0.01) == module.FINER, "the pass goes on"
    for _ in (1, 2):
        client.took(next(client.steps), 0.02)
    assert client.begin() is newer
    assert client.is_ahead(newer)
    client.steps = Seer()
    client.request(Job(3, (), SETTINGS), 0.03)
    assert not client.glimpse_due, "the pass has not gone on since the last"
    client.stepped = True
    assert client.glimpse_due, "its coarsest level is out"


def test_nobody_waits_for_a_lull() -> None:
    """SPEC P94."""
    desk = Desk()
    first, second = desk.client(), desk.client()
    assert not desk.schedule.urges(first)
    desk.ask(first)
    assert desk.schedule.urges(first), "a newer job of its own"
    desk.slice()
    assert not desk.schedule.urges(first), "its own solve can wait"
    assert desk.schedule.urges(second), "for others it is work"
    desk.ask(second)
    assert desk.schedule.urges(first)
