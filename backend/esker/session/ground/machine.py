"""The transitions of the ground of one room: ``next(ground, event, now)`` gives the ground after it, and effects.

Nothing here computes, waits or sends: ``worker.py`` carries the effects out, in their order.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Final

from esker.events import BaseLevel, ChannelLevel, Done, Pause, Preview, Settled
from esker.session.ground import effects as does
from esker.session.ground import states
from esker.session.ground.effects import Effect, Event
from esker.session.ground.jobs import Attempt, Job
from esker.session.ground.recovery import MAX_FAILURES
from esker.session.ground.states import (
    ChannelsOnly,
    Early,
    Failed,
    Ground,
    Idle,
    Previewing,
    Refining,
    Settling,
    State,
    Waiting,
)

HOLD: Final = 0.070
"""A preview between the coarsest and the finest that the finest follows within this time is not shown."""
FRAMES: Final = 0.060
"""The finest preview has this time to become frames before a level below it is shown again: what is coarser and newer
would bar it. The coarsest level alone is shown at any time: tiles follow it (``feed.py``, ``tiles/pyramid.py``)."""
AFTER_COARSEST: Final = 0.002
AFTER_FINEST: Final = 0.020
"""Seconds that a coarsest preview, and a finest one, has to become frames before all cores compute what comes next,
unless something else waits."""
AGAIN_AFTER: Final = 3.0
"""Seconds until a job that failed for reasons unknown is tried again without a change."""

Result = tuple[Ground, tuple[Effect, ...]]


def next(ground: Ground, event: Event, now: float) -> Result:
    """Returns the ground after an event at time ``now``, and what is to be done, in this order."""
    match event:
        case does.Turn(begins):
            begun, first = _begin(ground, now) if begins else (ground, ())
            if any(isinstance(effect, does.OpenSolve) for effect in first):
                return begun, first  # the solver says what the first slice is when the solve is open
            after, then = _slice(begun, now)
            return after, (*first, *then)
        case does.Opened(previews_early):
            if isinstance(ground.state, Previewing):
                ground = replace(ground, state=replace(ground.state, previews_early=previews_early))
            return _slice(ground, now)
        case Preview() | Settled() | ChannelLevel() | Pause() | Done():
            return _solved(ground, event, now)
        case does.Beside(inner):
            return _made_beside(ground, inner, now)
        case does.EarlyMade(job, preview):
            if preview is None:
                return ground, ()
            return replace(ground, early=replace(ground.early, made=True)), (does.Deliver(job, preview),)
        case _:
            return _changed(ground, event, now)


def _changed(ground: Ground, event: Event, now: float) -> Result:
    """Takes an event from outside of the solve."""
    match event:
        case does.Requested(job):
            return _want(replace(ground, jobs=replace(ground.jobs, asked_at=now)), Attempt(job)), ()
        case does.Again():
            jobs = ground.jobs
            return (ground if jobs.wanted or not jobs.begun else _want(ground, jobs.begun)), ()
        case does.Nudged():
            return replace(ground, state=_looking(ground, True)), ()
        case does.NothingRequested():
            return replace(ground, state=_looking(ground, False)), ()
        case does.BaseShown():
            job = _running(ground)
            return replace(ground, shown=replace(ground.shown, base=(job.layers_rev, ground.top))), ()
        case does.Dropped(settled):
            return _dropped(ground, settled), ()
        case does.Unsolved():
            return _unsolved(ground, now)
        case does.Unsolvable():
            state = Waiting() if ground.jobs.wanted is not None else Failed(math.inf)
            return replace(ground, state=state), ()
        case does.Coarser():
            revision, reached = ground.shown.base
            top = ground.top - 1
            ground = replace(ground, top=top, shown=replace(ground.shown, base=(revision, min(reached, top))))
            return _changed(ground, does.Again(), now)
        case does.Finer(top):
            return _changed(replace(ground, top=top), does.Again(), now)
        case _:
            raise AssertionError(event)


# --- jobs -----------------------------------------------------------------------------------------------------------


def _running(ground: Ground) -> Job:
    assert ground.jobs.begun is not None
    return ground.jobs.begun.job


def _want(ground: Ground, wanted: Attempt) -> Ground:
    """A newer job replaces the one that waits; a solve that runs is left at the room's next turn."""
    state = ground.state
    if isinstance(state, Idle):
        state = Waiting(state.refines)
    elif isinstance(state, Failed):
        state = Waiting()
    return replace(ground, state=state, jobs=replace(ground.jobs, wanted=wanted))


def _at_rest(ground: Ground, refines: bool, looking: bool = True) -> State:
    """The state in which nothing is solved."""
    if refines and looking:
        return Refining()
    return Waiting(refines) if ground.jobs.wanted is not None else Idle(refines)


def _begin(ground: Ground, now: float) -> Result:
    """Takes up the newest job."""
    attempt = ground.jobs.wanted
    assert attempt is not None
    job = attempt.job
    if states.needs_channels_only(ground):
        return _begin_channels(ground, attempt)
    channels, early, state = replace(ground.channels, paint_rev=job.paint_rev), ground.early, ground.state
    keeps = isinstance(state, ChannelsOnly)
    if isinstance(state, ChannelsOnly):  # channels alone that were begun are finished beside what comes next
        channels = replace(channels, beside=state.job, making=True)
    ahead = early.made and early.number == job.number
    revision, reached = ground.shown.base
    stands = revision == job.layers_rev and (reached >= ground.top or (revision == 0 and reached == -1))
    after = replace(
        ground,
        state=Previewing(job, 0, {0: now}) if ahead else Previewing(job),
        jobs=replace(ground.jobs, wanted=None, begun=attempt),
        channels=channels,
        shown=replace(ground.shown, heights=None, clock=job.clock),
    )
    return after, (does.Leave(keeps), does.OpenSolve(job, ground.top, coarsest=not ahead, base=not stands))


def _begin_channels(ground: Ground, attempt: Attempt) -> Result:
    """Takes up the newest job, whose heights are settled: its channels alone."""
    job, state, channels = attempt.job, ground.state, ground.channels
    if isinstance(state, ChannelsOnly):
        only = replace(state, job=job)
    else:
        looking = isinstance(state, Refining)
        only = ChannelsOnly(job, looking or getattr(state, "refines", False), looking)
    effect = does.AdoptChannels() if channels.making else does.OpenChannels(job, ground.top)
    after = replace(
        ground,
        state=only,
        jobs=replace(ground.jobs, wanted=None, begun=attempt),
        channels=replace(channels, making=False, paint_rev=job.paint_rev),
    )
    return after, (effect,)


def _dropped(ground: Ground, settled: bool) -> Ground:
    """Returns the ground with nothing running."""
    heights = ground.shown.heights if settled else None
    return replace(
        ground,
        state=_at_rest(ground, refines=False),
        channels=replace(ground.channels, beside=None, making=False),
        shown=replace(ground.shown, heights=heights),
    )


def _unsolved(ground: Ground, now: float) -> Result:
    """Has the job tried again soon, unless it has failed too often."""
    begun = ground.jobs.begun
    assert begun is not None
    begun = replace(begun, tries=begun.tries + 1)
    again = begun.tries < MAX_FAILURES
    state: State = Failed(now + AGAIN_AFTER if again else math.inf)
    wanted = ground.jobs.wanted
    if wanted is not None:
        state = Waiting()
        if wanted.job.number == begun.job.number:
            wanted = begun
    return replace(ground, state=state, jobs=replace(ground.jobs, wanted=wanted, begun=begun)), (does.Apologise(again),)


def _looking(ground: Ground, looking: bool) -> State:
    """Returns whether tiles may be wanted that were not made."""
    match ground.state:
        case Idle(True) | Waiting(True) | Refining():
            return _at_rest(ground, refines=True, looking=looking)
        case ChannelsOnly() as state:
            return replace(state, looking=looking)
        case state:
            return state


# --- a slice --------------------------------------------------------------------------------------------------------


def _slice(ground: Ground, now: float) -> Result:
    """Chooses what the room does with its turn."""
    if states.channels_are_next(ground):
        return _slice_beside(ground)
    if states.early_preview_is_due(ground, now):
        assert ground.jobs.wanted is not None
        job = ground.jobs.wanted.job
        return replace(ground, early=Early(job.number, solved_since=False, at=now)), (does.PreviewEarly(job),)
    if isinstance(ground.state, Previewing | Settling | ChannelsOnly):
        channels = replace(ground.channels, solved_since=True)
        early, state = replace(ground.early, solved_since=True), ground.state
        if isinstance(state, Previewing) and state.reached >= 0:
            state = replace(state, finer=True, came=_came(state, states.rests_until(ground), now))
        return replace(ground, state=state, channels=channels, early=early), (does.Step(),)
    return ground, (does.Refine(),) if isinstance(ground.state, Refining) else ()


def _came(pass_: Previewing, rested_until: float, now: float) -> Mapping[int, float]:
    """When each level came, for a pass that goes on: it took no time while it rested."""
    return pass_.came if 0 not in pass_.came else {**pass_.came, 0: max(pass_.came[0], min(now, rested_until))}


def _slice_beside(ground: Ground) -> Result:
    channels = replace(ground.channels, solved_since=False)
    opening: tuple[Effect, ...] = ()
    if not channels.making:
        assert ground.jobs.wanted is not None
        job = ground.jobs.wanted.job
        channels = replace(channels, beside=job, making=True, paint_rev=job.paint_rev)
        opening = (does.OpenChannels(job, ground.top, beside=True),)
    return replace(ground, channels=channels), (*opening, does.StepBeside())


def _made_beside(ground: Ground, event: Event, now: float) -> Result:
    """Follows the channels that are made beside a solve."""
    job = ground.channels.beside
    if isinstance(event, Done):
        return replace(ground, channels=replace(ground.channels, making=False, complete_at=now)), ()
    if job is None or not isinstance(event, ChannelLevel):
        return ground, ()
    return _channel(ground, job, event)


def _channel(ground: Ground, job: Job, event: ChannelLevel) -> Result:
    """Shows a level of a channel, unless a newer job's level has come already."""
    channels, place = ground.channels, (int(event.channel), event.level)
    newest = -1 if channels.beside is None else channels.beside.number
    if job.number < max(newest, channels.came.get(place, -1)):
        return ground, ()
    came = {**channels.came, place: job.number}
    return replace(ground, channels=replace(channels, came=came)), (does.Deliver(job, event),)


def _solved(ground: Ground, event: Event, now: float) -> Result:
    """Follows a solve, or channels alone, that went on."""
    job = _running(ground)
    match event:
        case Done(basis):
            return _ended(ground, basis, now)
        case BaseLevel():  # until all levels are delivered, the ground shown stands on neither base
            ground = replace(ground, shown=replace(ground.shown, base=(0, -2)))
            return ground, (does.Deliver(job, event), does.GiveBack())
        case ChannelLevel():
            after, effects = _channel(ground, job, event)
            return after, (*effects, does.GiveBack(), *((does.Step(),) if event.more else ()))
        case Settled():
            return ground, (does.Deliver(job, event), does.GiveBack())
        case Preview(level):
            after, shown = _previewed(ground, event, now)
            pause = AFTER_FINEST if level == ground.top else AFTER_COARSEST
            yields = (does.Yield(pause),) if level in (0, ground.top) else ()
            brings = does.Deliver(job, event) if shown else does.Note(job, event)
            return after, (brings, *yields, does.GiveBack())
        case _:
            return ground, ()


def _previewed(ground: Ground, preview: Preview, now: float) -> tuple[Ground, bool]:
    """Notes a preview, and returns also whether to show it.

    The coarsest level is always shown at once. Where the whole preview ends soon, no other level is shown: the finest
    would correct it before anybody saw it (docs/decisions/0014-consistent-previews.md).
    """
    state, shown, level = ground.state, ground.shown, preview.level
    if not isinstance(state, Previewing):
        return ground, True
    came = {**state.came, level: now}
    if level < ground.top:
        late = shown.lead.get(level, math.inf) > HOLD and now - shown.finest_at >= FRAMES
        return replace(ground, state=replace(state, reached=level, came=came)), level == 0 or late
    lead = {**shown.lead, **{coarse: now - at for coarse, at in state.came.items()}}
    shown = replace(shown, previewed=state.job.number, finest_at=now, lead=lead)
    return replace(ground, state=Settling(state.job, state.previews_early), shown=shown), True


def _ended(ground: Ground, basis: object, now: float) -> Result:
    """Follows the end of a solve, or of channels alone."""
    job, state = _running(ground), ground.state
    ground = replace(ground, channels=replace(ground.channels, complete_at=now))
    if isinstance(state, ChannelsOnly):
        after = replace(ground, state=_at_rest(ground, state.refines, state.looking))
        return after, (does.Confirm(job, ground.top),)
    shown = replace(ground.shown, heights=(job.heights, ground.top))
    after = replace(ground, state=_at_rest(ground, basis is not None), shown=shown)
    opening = (does.OpenRefinement(basis),) if basis is not None else ()
    return after, (*opening, does.NoteSolved())
