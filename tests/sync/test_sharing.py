"""Whose turn it is on the solver, and what is ended for whom (SPEC P57 to P59, P70, P71; DESIGN 8).

Nothing runs here: grounds, tally and time are values.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from esker import contract as c
from esker.events import Done, Preview, Settled
from esker.grid import parked_bytes
from esker.session.ground import effects as does
from esker.session.ground import machine, schedule, states
from esker.session.ground.effects import Effect, Event
from esker.session.ground.jobs import Job
from esker.session.ground.states import Early, Ground, Idle, Previewing, Refining, Settling
from esker.session.ground.tally import PATIENCE, Tally

SETTINGS = c.TerrainSettings()
FLAT = np.zeros((1, 1), dtype=np.float32)


class Desk:
    """Rooms by number, driven by hand: every slice is one level of a solve with levels 0..2."""

    def __init__(self, budget: int = schedule.BUDGET, early: bool = False) -> None:
        self.now, self.early = 0.0, early
        self.tally: Tally[int] = Tally(budget)
        self.grounds: dict[int, Ground] = {}
        self.left: dict[int, list[Preview | Settled]] = {}
        """What the solve of each room has yet to give."""
        self.log: list[tuple[int, str]] = []
        self.times: list[float] = []
        """When each entry of ``log`` was written."""
        self.pace: dict[int, float] = {}

    def room(self, levels: int = 2) -> int:
        room = len(self.grounds)
        self.grounds[room], self.tally = Ground(levels), self.tally.opened(room)
        return room

    def happen(self, room: int, event: Event) -> tuple[Effect, ...]:
        rested = states.is_at_rest(self.grounds[room])
        self.grounds[room], effects = machine.next(self.grounds[room], event, self.now)
        if rested and not states.is_at_rest(self.grounds[room]):
            self.tally = self.tally.noted(room, ran_at=self.now)
        return effects

    def ask(self, room: int, clock: int = 1) -> None:
        self.happen(room, does.Requested(Job(clock, (), SETTINGS)))

    def slice(self, seconds: float = 0.001) -> int | None:
        """One turn, as the worker takes it."""
        room, self.tally = schedule.choose(self.grounds, self.now, self.tally)
        if room is None:
            return None
        begins, gone, self.tally = schedule.begin(room, self.grounds, self.now, self.tally)
        for other in gone:
            self.happen(other, does.Dropped())
            self.happen(other, does.Again())
        for effect in self.happen(room, does.Turn(begins)):
            if isinstance(effect, does.OpenSolve):
                self.left[room] = _levels(effect.top)
                self.happen(room, does.Opened(self.early))
            if isinstance(effect, does.PreviewEarly):
                self.now += seconds
                self.tally = self.tally.ended(room, self.now)
                self.happen(room, does.EarlyMade(effect.job, Preview(0, FLAT)))
                self._note(room, f"early {effect.job.clock}")
                return room
        result = self.left[room].pop(0) if self.left[room] else None
        self.now += self.pace.get(room, seconds)
        self.tally = self.tally.ended(room, self.now)
        self.happen(room, Done() if result is None else result)
        if result is not None:
            self._note(room, f"{result.level}{'s' if result.settled else ''}")
        return room

    def _note(self, room: int, what: str) -> None:
        self.log.append((room, what))
        self.times.append(self.now)

    def until(self, room: int, what: str, most: int = 200) -> int:
        """Slices until a room has got something."""
        for count in range(1, most):
            self.slice()
            if (room, what) in self.log:
                return count
        raise AssertionError((what, self.log))

    def solving(self) -> list[int]:
        return [room for room, ground in self.grounds.items() if states.is_solving(ground)]


def _levels(top: int) -> list[Preview | Settled]:
    return [kind(level, FLAT) for kind in (Preview, Settled) for level in range(top + 1)]


def test_a_coarse_preview_goes_before_finer_ones_and_before_settling() -> None:
    desk = Desk()
    first, second, third = (desk.room() for _ in range(3))
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
    drawing, settling = desk.room(), desk.room()
    desk.ask(settling)
    desk.until(settling, "2")
    for clock in range(1, 400):
        desk.ask(drawing, clock)
        desk.slice(0.02)
        if (settling, "2s") in desk.log:
            break
    assert desk.now < 4 * 3 * PATIENCE


def test_a_coarse_preview_waits_for_one_slice_of_a_big_terrain_however_long_they_are() -> None:
    desk = Desk()
    big = desk.room(6)
    desk.pace[big] = 4 * PATIENCE
    desk.ask(big)
    desk.until(big, "6")
    small = [desk.room() for _ in range(4)]
    for clock in range(1, 40):
        for client in small:
            desk.ask(client, clock)
        begun, out_of_turn = len(desk.log), 0
        while len([1 for x, what in desk.log[begun:] if x in small and what == "0"]) < len(small):
            out_of_turn += desk.slice() is big
        assert out_of_turn <= 1
        desk.slice()


def test_a_coarse_preview_ends_the_settling_solve_that_began_last_and_that_settles_later() -> None:
    desk = Desk(budget=2 * parked_bytes(4))
    early, late, new = (desk.room(4) for _ in range(3))
    for client in (early, late):
        desk.ask(client)
        desk.until(client, "4")
    desk.ask(new)
    assert desk.until(new, "0") == 1
    assert desk.solving() == [early, new]
    assert desk.grounds[late].jobs.wanted is not None
    for client in (early, new, late):
        desk.until(client, "4s")


def test_previews_are_not_ended_for_a_coarse_one_and_never_more_solves_run_than_fit() -> None:
    desk = Desk(budget=3 * parked_bytes(4))
    clients = [desk.room(4) for _ in range(12)]
    for client in clients:
        desk.ask(client)
    most = 0
    while desk.slice() is not None:
        most = max(most, len(desk.solving()))
    assert most == 3
    for client in clients:
        assert [what for x, what in desk.log if x is client].count("4s") == 1
        got = [what for x, what in desk.log if x is client]
        assert got.count("0") == got.count("4"), "a preview that was begun is shown whole"


def test_what_settles_is_settled_room_by_room_the_smallest_terrain_first() -> None:
    """SPEC S506: interleaved, all of them would come late."""
    desk = Desk()
    rooms = {levels: desk.room(levels) for levels in (4, 2, 3)}
    for room in rooms.values():
        desk.ask(room)
    desk.until(rooms[4], "4s")
    settled = [room for room, what in desk.log if what.endswith("s")]
    assert settled == [rooms[levels] for levels in (2, 3, 4) for _ in range(levels + 1)]


def test_of_terrains_of_one_size_the_one_that_was_begun_first_settles_first() -> None:
    """SPEC S506."""
    desk = Desk()
    first, second = desk.room(), desk.room()
    desk.ask(first)
    desk.until(first, "0s")
    desk.ask(second)
    desk.until(second, "2s")
    settled = [room for room, what in desk.log if what.endswith("s")]
    assert settled == [first] * 3 + [second] * 3


def test_a_solve_bigger_than_the_budget_still_runs_alone() -> None:
    desk = Desk(budget=parked_bytes(4))
    big, small = desk.room(6), desk.room(4)
    desk.ask(big)
    desk.until(big, "6")
    desk.ask(small)
    desk.until(small, "4s")
    desk.until(big, "6s")


def _passing(ground: Ground, clock: int, at: float, takes: tuple[float, ...]) -> tuple[Ground, list[bool]]:
    """A job is begun, and its previews come after so many seconds each. Returns also which of them are shown."""
    now, shown = at, []
    ground, _ = machine.next(ground, does.Requested(Job(clock, (), SETTINGS)), now)
    ground, _ = machine.next(ground, does.Turn(begins=True), now)
    for level, seconds in enumerate(takes):
        now += seconds
        ground, effects = machine.next(ground, Preview(level, FLAT), now)
        shown += [
            isinstance(effect, does.Deliver) for effect in effects if isinstance(effect, does.Deliver | does.Note)
        ]
    return ground, shown


def test_a_preview_that_is_about_to_end_is_shown_whole_and_not_left() -> None:
    ground, first = _passing(Ground(2), 1, 0.1, (0.005, 0.4, 0.02))
    ended, second = _passing(ground, 2, 0.625, (0.005, 0.4, 0.02))
    # Nothing is known of the first pass; in the second, level 1 comes 20 ms before the finest and is not worth a look.
    assert (first, second) == ([True, True, True], [True, False, True])
    for level, leaves in ((1, True), (2, False)):
        amid, _ = _passing(replace(ground, shown=replace(ground.shown, finest_at=0.6)), 2, 0.6, (0.005, 0.1)[:level])
        amid, _ = machine.next(amid, does.Requested(Job(9, (), SETTINGS)), 0.71)
        assert states.starts(amid, 0.71) == leaves, "0.42 s before the end, but not 0.02 s before it"
    assert isinstance(ended.state, Settling)


def test_the_finest_preview_has_time_to_be_sent() -> None:
    """A newer preview of a level between would bar it; the coarsest alone is shown at any time (SPEC P71)."""
    ground, shown = _passing(Ground(2), 1, 10.0, (0.0, 0.001, 0.099))
    assert shown == [True, True, True], "the first is shown at once"
    for clock, at, expected in ((2, 10.12, False), (3, 10.15, False), (4, 10.17, True)):
        assert _passing(ground, clock, at, (0.0, 0.001))[1] == [True, expected]


def test_a_newer_job_shows_its_coarsest_level_while_a_pass_goes_on() -> None:
    """SPEC P92: once for each job, and not before the pass has shown its own; then its pass begins without it."""
    ground, _ = machine.next(Ground(2), does.Requested(Job(1, (), SETTINGS)), 0.0)
    ground = replace(ground, shown=replace(ground.shown, finest_at=-1.0, lead={0: 0.1, 1: 0.05}))
    ground, _ = machine.next(ground, does.Turn(begins=True), 0.0)
    ground, _ = machine.next(ground, does.Opened(previews_early=True), 0.0)
    newer = Job(2, (), SETTINGS)
    ground, _ = machine.next(ground, does.Requested(newer), 0.01)
    assert not states.early_preview_is_due(ground, 0.01), "the first level of the pass comes as soon"
    ground, _ = machine.next(ground, Preview(0, FLAT), 0.01)
    assert states.stage(ground, 0.01) == states.COARSE
    ground, effects = machine.next(ground, does.Turn(begins=False), 0.01)
    assert effects == (does.PreviewEarly(newer),)
    ground, effects = machine.next(ground, does.EarlyMade(newer, Preview(0, FLAT)), 0.01)
    assert [type(effect) for effect in effects] == [does.Deliver]
    assert states.stage(ground, 0.01) == states.FINER, "the pass goes on"
    for level in (1, 2):
        ground, _ = machine.next(ground, Preview(level, FLAT), 0.02)
    ground, effects = machine.next(ground, does.Turn(begins=True), 0.02)
    assert effects[1] == does.OpenSolve(newer, 2, coarsest=False, base=False)
    ground, _ = machine.next(ground, does.Requested(Job(3, (), SETTINGS)), 0.03)
    ground = replace(ground, state=Previewing(newer, reached=0, previews_early=True))
    assert not states.early_preview_is_due(ground, 0.03), "the pass has not gone on since the last"
    # SPEC S590: it waits for others.
    assert states.early_preview_is_due(ground, 0.03 + states.EARLY_EVERY)
    ground = replace(ground, early=Early(newer.number, made=True))
    assert states.early_preview_is_due(ground, 0.03), "its coarsest level is out"


def test_who_saw_a_finest_preview_a_moment_ago_waits_for_the_settling_of_others() -> None:
    """SPEC S583: after PACE the pass comes before settling again; the coarsest preview always does."""
    ground, _ = machine.next(Ground(2), does.Requested(Job(1, (), SETTINGS)), 0.0)
    ground, _ = machine.next(ground, does.Turn(begins=True), 0.0)
    ground = replace(ground, shown=replace(ground.shown, finest_at=0.0))
    assert states.stage(ground, 0.01) == states.COARSE
    ground, _ = machine.next(ground, Preview(0, FLAT), 0.01)
    assert states.stage(ground, 0.9 * states.PACE) == states.SETTLE
    assert states.stage(ground, 1.1 * states.PACE) == states.FINER


def test_a_coarsest_preview_comes_before_others_that_had_less_time() -> None:
    """SPEC S584: up to AHEAD_COARSE; where its last one took long it waits from AHEAD on."""
    desk = Desk()
    quiet, draws = desk.room(), desk.room()
    desk.ask(quiet)
    desk.until(quiet, "2")
    desk.ask(draws)
    had = desk.tally.rooms[draws]
    amid, beyond, slow = 0.9 * schedule.AHEAD_COARSE, 1.1 * schedule.AHEAD_COARSE, 2 * schedule.QUICK
    for seconds, took, first in ((amid, 0.01, draws), (beyond, 0.01, quiet), (amid, slow, quiet)):
        time = replace(had.time, seconds=desk.tally.rooms[quiet].time.seconds + seconds, is_busy=True, coarsest_s=took)
        tally = desk.tally.noted(draws, time=time)
        homes = {**tally.homes, draws: replace(tally.homes[draws], time=time)}
        tally = replace(tally, homes=homes)
        assert schedule.choose(desk.grounds, desk.now, tally)[0] == first


def test_a_pass_that_waits_for_its_turn_is_made_of_the_newest_strokes() -> None:
    """SPEC S549: and the room keeps its place among those that wait, however often it is asked."""
    desk = Desk(early=True)
    busy, room = [desk.room() for _ in range(3)], desk.room()
    for other in (*busy, room):
        desk.ask(other)
        desk.until(other, "0")
    began = desk.tally.rooms[room].began
    desk.ask(room, 2)
    assert desk.until(room, "early 2") == 1, "a coarse preview comes first"
    assert states.stage(desk.grounds[room], desk.now) == states.FINER
    while (busy[-1], "2") not in desk.log:
        assert desk.slice() in busy, "others have waited for longer"
    last = desk.room()
    desk.ask(last)
    desk.until(last, "0")
    assert desk.slice() == room, "it keeps its place before who came later"
    desk.ask(room, 3)
    desk.until(room, "2")
    state = desk.grounds[room].state
    assert isinstance(state, Settling)
    assert state.job.clock == 2, "the newest when its turn came"
    assert desk.tally.rooms[room].began == began


def _drawn_on(desk: Desk, room: int, clock: int, slices: int, pass_s: float) -> int:
    """Somebody draws a segment every 50 ms for so many slices; a pass takes ``pass_s``. Returns the next clock."""
    due = desk.now
    for _ in range(slices):
        if desk.now >= due:
            desk.ask(room, clock)
            clock, due = clock + 1, desk.now + 0.05
        desk.pace[room] = 0.002 if desk.left.get(room, [None])[0] in (None, Preview(0, FLAT)) else pass_s / 2
        if desk.slice(0.002) is None:
            desk.now += 0.005
    return clock


def _gaps(desk: Desk, room: int, what: str) -> list[float]:
    came = [at for at, (who, got) in zip(desk.times, desk.log, strict=True) if who == room and got == what]
    return [after - before for before, after in pairwise(came)]


def test_slow_passes_rest_while_somebody_draws() -> None:
    """SPEC S598: the coarsest level of the newest strokes comes all the while, and the rest ends with the drawing."""
    desk = Desk(early=True)
    room = desk.room()
    clock = _drawn_on(desk, room, 1, 300, pass_s=0.2)
    gaps = _gaps(desk, room, "2")[2:]
    rest = states.REST * (0.2 - states.QUICK_PASS)
    assert len(gaps) > 4
    assert min(gaps) >= rest + 0.2
    assert max(gaps) < rest + 0.2 + 0.08, "and no longer"
    coarsest = [at for at, (_, got) in zip(desk.times, desk.log, strict=True) if got[:5] in ("0", "early")]
    assert max(after - before for before, after in pairwise(coarsest)) < 0.25, "two slices of the pass at most"
    desk.ask(room, clock)
    wanted, last = desk.grounds[room].jobs.wanted, desk.now
    assert wanted is not None
    while desk.grounds[room].shown.previewed != wanted.job.number:
        if desk.slice(0.002) is None:
            desk.now += 0.005
    assert desk.now < last + 0.2 + states.PEN_STILL + 0.2 + 0.03, "a pass that goes on, a still pen, and the last pass"


def test_quick_passes_follow_each_other() -> None:
    """SPEC S598."""
    desk = Desk(early=True)
    room = desk.room()
    _drawn_on(desk, room, 1, 300, pass_s=0.03)
    assert max(_gaps(desk, room, "2")[2:]) < 0.1


def _resting(desk: Desk) -> int:
    """A room whose pass rests."""
    room = desk.room(4)
    desk.ask(room)
    desk.until(room, "4")
    ground = desk.grounds[room]
    slow = replace(ground.shown, lead={0: 0.2}, finest_at=desk.now)
    desk.grounds[room] = replace(ground, shown=slow)
    desk.ask(room, 2)
    while desk.slice() is not None:
        pass
    assert states.is_resting(desk.grounds[room], desk.now)
    return room


def test_whoever_draws_is_shown_each_stroke_while_a_pass_rests() -> None:
    """SPEC S598: also within EARLY_EVERY, as there are no finer levels to keep rooms from."""
    desk = Desk(early=True)
    room = _resting(desk)
    for clock in (3, 4):
        desk.ask(room, clock)
        assert desk.slice() == room
        assert desk.log[-1] == (room, f"early {clock}")
        assert desk.slice() is None
    assert desk.times[-1] - desk.times[-2] < states.EARLY_EVERY / 2
    desk.now += states.PEN_STILL
    assert desk.slice() == room
    state = desk.grounds[room].state
    assert isinstance(state, Previewing)
    assert state.job.clock == 4, "the newest strokes have the pass"


def test_who_rests_is_woken_and_nothing_is_refined_meanwhile() -> None:
    """SPEC S598."""
    desk = Desk(early=True)
    room, refines = _resting(desk), desk.room()
    desk.grounds[refines] = Ground(2, Refining())
    assert desk.slice() is None
    assert schedule.rested_in(desk.grounds, desk.now) == pytest.approx(states.PEN_STILL, abs=0.005)
    assert desk.tally.rooms[room].time.is_busy, "it goes on where it was among those who share the solver"
    desk.now += states.PEN_STILL
    assert schedule.rested_in(desk.grounds, desk.now) is None
    assert desk.slice() == room


@pytest.mark.parametrize(("budget", "levels"), [(schedule.BUDGET, 5), (parked_bytes(4), 0)], ids=["turn", "memory"])
def test_nobody_rests_while_another_room_waits(budget: int, levels: int) -> None:
    """SPEC S598: else whoever has many rooms would have the solver meanwhile."""
    desk = Desk(budget, early=True)
    room, other = _resting(desk), desk.room(4)
    desk.ask(other)
    assert [desk.slice() for _ in range(levels)] == [other] * levels
    assert states.is_resting(desk.grounds[room], desk.now), "it might"
    assert desk.slice() == room


def test_nobody_waits_while_something_else_is_to_be_done() -> None:
    """SPEC P94."""
    desk = Desk()
    first, second = desk.room(), desk.room()
    assert not schedule.has_something_else(first, desk.grounds)
    desk.ask(first)
    assert schedule.has_something_else(first, desk.grounds), "a newer job of its own"
    desk.slice()
    assert not schedule.has_something_else(first, desk.grounds), "its own solve can wait"
    assert schedule.has_something_else(second, desk.grounds), "for others it is work"
    desk.ask(second)
    assert schedule.has_something_else(first, desk.grounds)
    assert desk.grounds[second].state == states.Waiting()
    assert Ground(2).state == Idle()
