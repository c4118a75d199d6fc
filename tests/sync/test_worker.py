"""The states of a room's ground: what each event leads to, and what is done then (SPEC P461; DESIGN 8).

Nothing runs here: a ground, an event and a time go in, a ground and effects come out.
"""

from __future__ import annotations

import math
from dataclasses import fields, replace
from typing import Any, get_args

import numpy as np
import pytest

from esker import contract as c
from esker.events import BaseLevel, ChannelLevel, Done, Pause, Preview, Settled
from esker.session.ground import effects as does
from esker.session.ground import machine, states
from esker.session.ground.effects import Effect, Event
from esker.session.ground.jobs import Attempt, Job
from esker.session.ground.states import (
    Channels,
    ChannelsOnly,
    Early,
    Failed,
    Ground,
    Idle,
    Jobs,
    Previewing,
    Refining,
    Settling,
    Shown,
    State,
    Waiting,
)
from esker.session.ground.tally import Favour, Home, Tally, Time, Used

NOW = 10.0
TOP = 2
FLAT = np.zeros((1, 1), dtype=np.float32)
SETTINGS = c.TerrainSettings()
JOB = Job(1, (), SETTINGS, heights_rev=1, paint_rev=1, number=1)
DRAWN = Job(2, (), SETTINGS, heights_rev=2, paint_rev=1, number=2)
PAINTED = Job(3, (), SETTINGS, heights_rev=1, paint_rev=2, number=3)
SNOW = ChannelLevel(0, FLAT, c.Channel.SNOW)
AT_HAND = ChannelLevel(0, FLAT, c.Channel.SNOW, more=True)
"""SPEC S585: a level that was not computed, behind which the next event comes with the same turn."""
GROUND = BaseLevel(0, FLAT, c.Channel.BASE)
SOON = Shown(lead={0: 0.1, 1: 0.05}, finest_at=NOW - 0.1)
SETTLED = Shown(heights=((1, 0), TOP), clock=1)
OF_JOB = Channels(paint_rev=1)
MAKING = Channels(beside=PAINTED, making=True, paint_rev=2)


def ground(state: State, wanted: Job | None = None, tries: int = 0, asked_at: float = math.inf, **more: Any) -> Ground:
    """A ground whose job JOB was begun, unless nothing ever was."""
    begun = None if state in (Idle(), Waiting()) else Attempt(JOB, tries)
    jobs = Jobs(None if wanted is None else Attempt(wanted), begun, asked_at)
    return Ground(TOP, state, jobs, **{"channels": OF_JOB, **more})


def opens(job: Job, *, coarsest: bool = True, keeps: bool = False) -> tuple[Effect, ...]:
    return does.Leave(keeps), does.OpenSolve(job, TOP, coarsest=coarsest, base=False)


def shows(level: Any, *, shown: bool = True, wait: float = 0.0, job: Job = JOB) -> tuple[Effect, ...]:
    brings = does.Deliver(job, level) if shown else does.Note(job, level)
    return (brings, *((does.Yield(wait),) if wait else ()), does.GiveBack())


NONE: tuple[Effect, ...] = ()
COARSE, MIDDLE, FINEST = (Preview(level, FLAT) for level in range(3))
EXACT = Settled(0, FLAT)
EARLY = Previewing(JOB, 0, {0: NOW}, previews_early=True)
TRIED, SHOWN = Early(DRAWN.number), Early(DRAWN.number, made=True)

TABLE: list[tuple[Ground, Event, State, tuple[Effect, ...]]] = [
    # a job comes
    (ground(Idle()), does.Requested(JOB), Waiting(), NONE),
    (ground(Idle(refines=True)), does.Requested(JOB), Waiting(refines=True), NONE),
    (ground(Waiting(), JOB), does.Requested(DRAWN), Waiting(), NONE),
    (ground(Previewing(JOB)), does.Requested(DRAWN), Previewing(JOB), NONE),
    (ground(Settling(JOB)), does.Requested(DRAWN), Settling(JOB), NONE),
    (ground(Refining()), does.Requested(DRAWN), Refining(), NONE),
    (ground(ChannelsOnly(JOB)), does.Requested(DRAWN), ChannelsOnly(JOB), NONE),
    (ground(Failed(11.0)), does.Requested(DRAWN), Waiting(), NONE),
    # its solve is begun, and what was open is left
    (ground(Waiting(), JOB), does.Turn(begins=True), Previewing(JOB), opens(JOB)),
    (ground(Settling(JOB), DRAWN), does.Turn(begins=True), Previewing(DRAWN), opens(DRAWN)),
    (ground(Refining(), DRAWN, shown=SETTLED), does.Turn(begins=True), Previewing(DRAWN), opens(DRAWN)),
    (ground(ChannelsOnly(JOB), DRAWN), does.Turn(begins=True), Previewing(DRAWN), opens(DRAWN, keeps=True)),
    (
        ground(Settling(JOB), DRAWN, early=Early(DRAWN.number, made=True)),
        does.Turn(begins=True),
        Previewing(DRAWN, 0, {0: NOW}),
        opens(DRAWN, coarsest=False),
    ),
    (ground(Previewing(JOB)), does.Opened(True), Previewing(JOB, previews_early=True), (does.Step(),)),
    # previews
    (ground(Previewing(JOB)), does.Turn(begins=False), Previewing(JOB), (does.Step(),)),
    (ground(Previewing(JOB)), Pause(), Previewing(JOB), NONE),
    (ground(Previewing(JOB)), GROUND, Previewing(JOB), shows(GROUND)),
    (ground(Previewing(JOB)), does.BaseShown(), Previewing(JOB), NONE),
    (ground(Previewing(JOB)), COARSE, Previewing(JOB, 0, {0: NOW}), shows(COARSE, wait=0.002)),
    (ground(Previewing(JOB)), MIDDLE, Previewing(JOB, 1, {1: NOW}), shows(MIDDLE)),
    (ground(Previewing(JOB), shown=SOON), MIDDLE, Previewing(JOB, 1, {1: NOW}), shows(MIDDLE, shown=False)),
    (ground(Previewing(JOB)), FINEST, Settling(JOB), shows(FINEST, wait=0.020)),
    (ground(Previewing(JOB)), SNOW, Previewing(JOB), shows(SNOW)),
    (ground(Previewing(JOB)), AT_HAND, Previewing(JOB), (*shows(AT_HAND), does.Step())),
    (ground(Previewing(JOB)), EXACT, Previewing(JOB), shows(EXACT)),
    # an early preview of a newer job
    (ground(EARLY, DRAWN), does.Turn(begins=False), EARLY, (does.PreviewEarly(DRAWN),)),
    (ground(EARLY, DRAWN), does.EarlyMade(DRAWN, COARSE), EARLY, (does.Deliver(DRAWN, COARSE),)),
    (ground(EARLY, DRAWN), does.EarlyMade(DRAWN, None), EARLY, NONE),
    (ground(EARLY, DRAWN, early=TRIED), does.Turn(begins=False), replace(EARLY, finer=True), (does.Step(),)),
    # settling
    (ground(Settling(JOB)), does.Turn(begins=False), Settling(JOB), (does.Step(),)),
    (ground(Settling(JOB)), COARSE, Settling(JOB), shows(COARSE, wait=0.002)),
    (ground(Settling(JOB)), EXACT, Settling(JOB), shows(EXACT)),
    (ground(Settling(JOB)), Done(), Idle(), (does.NoteSolved(),)),
    (ground(Settling(JOB)), Done("basis"), Refining(), (does.OpenRefinement("basis"), does.NoteSolved())),
    (ground(Settling(JOB), PAINTED), Done(), Waiting(), (does.NoteSolved(),)),
    # channels beside a solve
    (
        ground(Settling(JOB), PAINTED),
        does.Turn(begins=False),
        Settling(JOB),
        (does.OpenChannels(PAINTED, TOP, beside=True), does.StepBeside()),
    ),
    (ground(Settling(JOB), PAINTED, channels=MAKING), does.Turn(begins=False), Settling(JOB), (does.StepBeside(),)),
    (
        ground(Settling(JOB), PAINTED, channels=replace(MAKING, solved_since=False)),
        does.Turn(begins=False),
        Settling(JOB),
        (does.Step(),),
    ),
    (ground(Settling(JOB), channels=MAKING), does.Beside(SNOW), Settling(JOB), (does.Deliver(PAINTED, SNOW),)),
    (ground(Settling(JOB), channels=MAKING), does.Beside(Pause()), Settling(JOB), NONE),
    (ground(Settling(JOB), channels=MAKING), does.Beside(Done()), Settling(JOB), NONE),
    # SPEC P120; a newer job's channels came already
    (ground(Settling(JOB), channels=MAKING), SNOW, Settling(JOB), (does.GiveBack(),)),
    (ground(Idle(), channels=MAKING), does.Turn(begins=False), Idle(), (does.StepBeside(),)),
    # channels only
    (
        ground(Refining(), PAINTED, shown=SETTLED),
        does.Turn(begins=True),
        ChannelsOnly(PAINTED, refines=True, looking=True),
        (does.OpenChannels(PAINTED, TOP), does.Step()),
    ),
    (
        ground(Waiting(refines=True), PAINTED, shown=SETTLED, channels=MAKING),
        does.Turn(begins=True),
        ChannelsOnly(PAINTED, refines=True),
        (does.AdoptChannels(), does.Step()),
    ),
    (ground(ChannelsOnly(JOB)), SNOW, ChannelsOnly(JOB), shows(SNOW)),
    (ground(ChannelsOnly(JOB)), Done(), Idle(), (does.Confirm(JOB, TOP),)),
    (ground(ChannelsOnly(JOB, refines=True)), Done(), Idle(refines=True), (does.Confirm(JOB, TOP),)),
    (ground(ChannelsOnly(JOB, refines=True, looking=True)), Done(), Refining(), (does.Confirm(JOB, TOP),)),
    (ground(ChannelsOnly(JOB, refines=True)), does.Nudged(), ChannelsOnly(JOB, refines=True, looking=True), NONE),
    # refinement
    (ground(Refining()), does.Turn(begins=False), Refining(), (does.Refine(),)),
    (ground(Refining()), does.NothingRequested(), Idle(refines=True), NONE),
    (ground(Refining(), DRAWN), does.NothingRequested(), Waiting(refines=True), NONE),
    (ground(Idle(refines=True)), does.Nudged(), Refining(), NONE),
    (ground(Waiting(refines=True), PAINTED), does.Nudged(), Refining(), NONE),
    (ground(Idle()), does.Nudged(), Idle(), NONE),
    # ended for another room's sake, or for another device's
    (ground(Settling(JOB)), does.Dropped(), Idle(), NONE),
    (ground(Settling(JOB), DRAWN), does.Dropped(), Waiting(), NONE),
    (ground(Idle(refines=True)), does.Again(), Waiting(refines=True), NONE),
    (ground(Idle()), does.Again(), Idle(), NONE),
    # failures
    (ground(Idle(refines=True)), does.Unsolved(), Failed(NOW + machine.AGAIN_AFTER), (does.Apologise(again=True),)),
    (ground(Idle(refines=True), tries=2), does.Unsolved(), Failed(math.inf), (does.Apologise(again=False),)),
    (ground(Waiting(refines=True), DRAWN), does.Unsolved(), Waiting(), (does.Apologise(again=True),)),
    (ground(Idle(refines=True)), does.Unsolvable(), Failed(math.inf), NONE),
    (ground(Waiting(refines=True), DRAWN), does.Unsolvable(), Waiting(), NONE),
    (ground(Failed(11.0)), does.Again(), Waiting(), NONE),
    (ground(Failed(11.0)), does.Turn(begins=False), Failed(11.0), NONE),
    (ground(Idle(refines=True)), does.Coarser(), Waiting(refines=True), NONE),
    (ground(Idle(refines=True)), does.Finer(3), Waiting(refines=True), NONE),
]


def named(row: tuple[Ground, Event, State, tuple[Effect, ...]]) -> str:
    before, event, after, _ = row
    return f"{type(before.state).__name__}-{type(event).__name__}-{type(after).__name__}"


@pytest.mark.parametrize(("before", "event", "state", "effects"), TABLE, ids=map(named, TABLE))
def test_an_event_leads_to_a_state_and_effects(
    before: Ground, event: Event, state: State, effects: tuple[Effect, ...]
) -> None:
    """SPEC P461."""
    after, found = machine.next(before, event, NOW)
    assert after.state == state
    assert found == effects


def test_the_table_has_every_state_event_and_effect() -> None:
    """SPEC P461: a new one that nobody wrote down is found."""
    assert {type(before.state) for before, _, _, _ in TABLE} == set(get_args(State))
    assert {type(event) for _, event, _, _ in TABLE} == set(get_args(Event))
    assert {type(effect) for *_, effects in TABLE for effect in effects} == set(get_args(Effect))


def test_states_are_small_values() -> None:
    """SPEC P461: at most six fields each, none of which is ever assigned to."""
    for kind in (*get_args(State), Ground, Jobs, Channels, Shown, Early, Used, Time, Home, Favour, Tally):
        assert len(fields(kind)) <= 6, kind
        assert kind.__dataclass_params__.frozen, kind


PASS = Previewing(JOB, 1, {0: NOW, 1: NOW})
OTHERS = replace(PAINTED, number=4)
NEW, OLD = replace(SOON, lead={1: 1.0}), replace(SOON, finest_at=NOW - 1.0, lead={1: 1.0})
BEGINS: list[tuple[str, Ground, bool]] = [
    ("nothing is wanted", ground(Settling(JOB)), False),
    ("it was shown early while a pass waited for its turn", ground(EARLY, DRAWN, shown=OLD, early=SHOWN), True),
    ("its pass had its turn", ground(replace(EARLY, finer=True), DRAWN, shown=OLD, early=SHOWN), False),
    ("another one was shown early", ground(EARLY, DRAWN, shown=OLD, early=Early(DRAWN.number - 1, made=True)), False),
    ("it could not be shown early", ground(EARLY, DRAWN, shown=OLD, early=TRIED), False),
    ("nothing runs", ground(Waiting(), JOB), True),
    ("it only settles", ground(Settling(JOB), DRAWN), True),
    ("it refines", ground(Refining(), DRAWN), True),
    ("the heights are the same", ground(Settling(JOB), PAINTED), False),
    ("a pass of which nothing is known", ground(PASS, DRAWN, shown=Shown(finest_at=NOW)), True),
    ("a pass that takes long", ground(PASS, DRAWN, shown=NEW), True),
    ("a pass that ends soon", ground(PASS, DRAWN, shown=SOON), False),
    ("a pass whose finest level has been out for long", ground(PASS, DRAWN, shown=OLD), False),
    (
        "other channels are made first",
        ground(Idle(), OTHERS, shown=SETTLED, channels=MAKING),
        False,
    ),
    ("its own channels are made", ground(Idle(), PAINTED, shown=SETTLED, channels=MAKING), True),
    ("channels came long ago", ground(ChannelsOnly(JOB), PAINTED, channels=Channels(complete_at=NOW - 1)), False),
    ("channels came just now", ground(ChannelsOnly(JOB), PAINTED, channels=Channels(complete_at=NOW)), True),
]


@pytest.mark.parametrize(("before", "begins"), [row[1:] for row in BEGINS], ids=[row[0] for row in BEGINS])
def test_when_the_newest_job_is_begun(before: Ground, begins: bool) -> None:
    """SPEC P57, P58, S549: at once, but for a preview pass that should end first."""
    assert states.starts(before, NOW) == begins


SLOW = Shown(lead={0: 0.15}, finest_at=NOW)
RESTS: list[tuple[str, Ground, float]] = [
    ("its finer levels take 50 ms more than a quick pass", ground(EARLY, shown=SLOW), 0.100),
    ("they take longer than that", ground(EARLY, shown=replace(SLOW, lead={0: 0.9})), states.REST_MOST),
    ("the pass is quick", ground(EARLY, shown=replace(SLOW, lead={0: states.QUICK_PASS})), 0.0),
    ("the finest level came a while ago", ground(EARLY, shown=replace(SLOW, finest_at=NOW - 0.05)), 0.050),
    ("nobody draws any more", ground(EARLY, shown=SLOW, asked_at=NOW - 0.05), 0.030),
    ("nothing is known of its passes", ground(EARLY, shown=Shown()), -math.inf),
    ("its coarsest level is not out", ground(Previewing(JOB, previews_early=True), shown=SLOW), -math.inf),
    ("it could not show newer strokes", ground(Previewing(JOB, 0, {0: NOW}), shown=SLOW), -math.inf),
    ("a finer level was begun", ground(replace(EARLY, finer=True), shown=SLOW), -math.inf),
    ("it settles", ground(Settling(JOB), shown=SLOW), -math.inf),
    ("a newer job was shown early", ground(EARLY, DRAWN, shown=SLOW, early=SHOWN), 0.100),
    ("a newer job stands on other layers", ground(EARLY, replace(DRAWN, layers_rev=1), shown=SLOW), -math.inf),
    ("one could not be shown early", ground(EARLY, DRAWN, shown=SLOW, early=TRIED), -math.inf),
]


@pytest.mark.parametrize(("before", "seconds"), [row[1:] for row in RESTS], ids=[row[0] for row in RESTS])
def test_how_long_finer_levels_wait(before: Ground, seconds: float) -> None:
    """SPEC S598: while somebody draws, and as long as they lately took."""
    assert states.rests_until(before) - NOW == pytest.approx(seconds)
    assert states.is_resting(before, NOW) == (seconds > 0)
    assert not states.is_resting(before, NOW + max(0.0, seconds) + 1e-9)


def test_a_pass_takes_no_time_while_it_rests() -> None:
    """SPEC S598: what is known of the next one would grow with each rest."""
    resting = ground(EARLY, shown=SLOW)
    for waits, took in ((0.1, 0.06), (0.5, 0.46)):  # until it may go on; for 0.4 s more, behind other rooms
        after, _ = machine.next(resting, does.Turn(begins=False), NOW + waits)
        after, _ = machine.next(after, FINEST, NOW + waits + 0.06)
        assert after.shown.lead[0] == pytest.approx(took)


def test_what_is_kept_beside_the_state() -> None:
    """SPEC P461: what was shown, which channels came, how often a job has failed."""
    after, _ = machine.next(ground(Settling(JOB)), Done(), NOW)
    assert (after.shown.heights, after.channels.complete_at) == ((JOB.heights, TOP), NOW)
    after, _ = machine.next(after, does.Dropped(settled=True), NOW)
    assert after.shown.heights is not None
    after, _ = machine.next(after, does.Dropped(), NOW)
    assert after.shown.heights is None
    after, _ = machine.next(ground(Previewing(JOB)), SNOW, NOW)
    assert after.channels.came == {(int(c.Channel.SNOW), 0): JOB.number}
    after, _ = machine.next(ground(Previewing(JOB, 1, {0: 9.0, 1: 9.5})), FINEST, NOW)
    assert (after.shown.lead, after.shown.finest_at, after.shown.previewed) == ({0: 1.0, 1: 0.5}, NOW, JOB.number)
    after, _ = machine.next(ground(Previewing(JOB)), GROUND, NOW)
    assert after.shown.base == (0, -2), "half a base is nobody's"
    after, _ = machine.next(after, does.BaseShown(), NOW)
    assert after.shown.base == (JOB.layers_rev, TOP)
    after, _ = machine.next(after, does.Coarser(), NOW)
    assert (after.top, after.shown.base) == (TOP - 1, (JOB.layers_rev, TOP - 1))
    after, _ = machine.next(ground(Idle(refines=True)), does.Unsolved(), NOW)
    after, _ = machine.next(after, does.Again(), NOW)
    assert after.jobs.wanted == Attempt(JOB, tries=1)
