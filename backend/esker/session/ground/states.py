"""The states that the ground of one room can be in, and what is due in each (DESIGN 8).

``machine.py`` says what follows on what. Times are seconds of one clock. README.md beside this file has the diagram,
and says who may call what.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

from esker.session.ground.jobs import Attempt, Job

FINEST_WITHIN: Final = 0.150
"""Drawing without a pause must not starve the fine levels: a preview pass goes on whose finest level is this old."""
EARLY_EVERY: Final = 0.100
"""Early previews of a room whose pass does not go on come at most this often."""
PACE: Final = 0.500
"""Who saw a finest preview within this time is shown the next one behind the settling of others: where many rooms draw,
passes would fill all time, and rooms amid a solve, which hold memory, would pile up."""
FINISH: Final = 0.300
"""A pass that should end within this time is not left, and early previews of newer jobs are made during it."""
QUICK_PASS: Final = 0.100
"""Passes whose finer levels take no longer follow each other: the morph is fluid, and there are processors to spare."""
REST, REST_MOST = 2.0, 0.200
"""While somebody draws, finer levels wait so many times what they lately took beyond ``QUICK_PASS``, and so many
seconds at most: where passes are slow they would take all processors, and the coarsest levels, frames and everybody's
messages would come late."""
PEN_STILL: Final = 0.080
"""Where no newer job has come for so long, nobody draws, and nothing waits."""


@dataclass(frozen=True)
class Idle:
    """Nothing is to be done. refines: whether the settled heights can be refined where somebody looks."""

    refines: bool = False


@dataclass(frozen=True)
class Waiting:
    """A job waits for its turn. Nothing is open for the room but its settled heights."""

    refines: bool = False


@dataclass(frozen=True)
class Previewing:
    """The levels of a job are made, coarse to fine, for the first time.

    reached: the finest level that is out, -1 before the first. came: when each level below the finest came.
    previews_early: whether this solve can tell what newer strokes look like while it goes on. finer: whether anything
    was done for a level after the coarsest.
    """

    job: Job
    reached: int = -1
    came: Mapping[int, float] = field(default_factory=dict)
    previews_early: bool = False
    finer: bool = False


@dataclass(frozen=True)
class Settling:
    """The finest preview is out; cycles go on until every level is exact."""

    job: Job
    previews_early: bool = False


@dataclass(frozen=True)
class Refining:
    """All levels are settled, and tiles above them are made where somebody looks."""


@dataclass(frozen=True)
class ChannelsOnly:
    """The heights of the job are settled already; its other channels are made. refines, looking: see ``Channels``."""

    job: Job
    refines: bool = False
    looking: bool = False


@dataclass(frozen=True)
class Failed:
    """The job could not be computed. It is tried again at ``retry_at``; at infinity it waits for a change."""

    retry_at: float


State = Idle | Waiting | Previewing | Settling | Refining | ChannelsOnly | Failed


@dataclass(frozen=True)
class Channels:
    """Channels other than the heights, and those that are made beside a solve.

    beside: the newest job whose channels were begun beside a solve. making: whether they are being made; they are made
    to their end, whatever is begun meanwhile: who paints all the time would never see the finer levels of it.
    solved_since: whether the solve has gone on since a slice of them, as both alternate. paint_rev: of the job whose
    channels came last, or are being made. complete_at: when all channels of a job had come. came: the number of the job
    from which each (channel, level) came last.
    """

    beside: Job | None = None
    making: bool = False
    solved_since: bool = True
    paint_rev: int = 0
    complete_at: float = -math.inf
    came: Mapping[tuple[int, int], int] = field(default_factory=dict)


@dataclass(frozen=True)
class Shown:
    """The ground that people have been shown.

    heights: ``Job.heights`` and finest level of what is settled; None while that is nobody's. clock: of the job whose
    heights those are, or will be. base: ``layers_rev`` and finest level of the base that was shown whole; a terrain
    begins with none on any level. previewed: number of the job whose finest preview came last, at ``finest_at``. lead:
    by how many seconds the preview of each level came before the finest one, last time.
    """

    heights: tuple[tuple[int, int], int] | None = None
    clock: int = -1
    base: tuple[int, int] = (0, -1)
    previewed: int = -1
    finest_at: float = -math.inf
    lead: Mapping[int, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Early:
    """The early preview: the coarsest level of a newer job, made while the pass of an older one goes on.

    number: of the job that had the last one, made: unless it could not be. solved_since: whether the pass has gone on
    since: early previews without end would keep all rooms, this one too, from finer levels. at: when it was made, as
    who draws is shown the newest strokes ``EARLY_EVERY`` even where the pass waits for others.
    """

    number: int = -1
    made: bool = False
    solved_since: bool = True
    at: float = -math.inf


@dataclass(frozen=True)
class Jobs:
    """wanted: the newest job, if it was not begun. begun: the job that was begun last. asked_at: when one came last."""

    wanted: Attempt | None = None
    begun: Attempt | None = None
    asked_at: float = -math.inf


@dataclass(frozen=True)
class Ground:
    """The ground of one room. top: the finest level that is solved for it at present."""

    top: int
    state: State = field(default_factory=Idle)
    jobs: Jobs = field(default_factory=Jobs)
    channels: Channels = field(default_factory=Channels)
    shown: Shown = field(default_factory=Shown)
    early: Early = field(default_factory=Early)


# --- what is due ----------------------------------------------------------------------------------------------------

COARSE, FINER, SETTLE, REFINE = range(4)
"""Classes of what rooms wait for (``schedule.py``)."""


def is_solving(ground: Ground) -> bool:
    """Returns whether heights are being solved, which holds a workspace."""
    return isinstance(ground.state, Previewing | Settling)


def is_at_rest(ground: Ground) -> bool:
    """Returns whether the room has nothing to solve."""
    busy = is_solving(ground) or isinstance(ground.state, ChannelsOnly) or ground.channels.making
    return not busy and ground.jobs.wanted is None


def holds_device(ground: Ground) -> bool:
    """Returns whether anything of the room is open on the device."""
    resting = isinstance(ground.state, Idle | Waiting | Failed) and not getattr(ground.state, "refines", False)
    return not resting or ground.channels.making


def needs_channels_only(ground: Ground) -> bool:
    """Returns whether the newest job has the heights that are settled already."""
    wanted = ground.jobs.wanted
    return wanted is not None and ground.shown.heights == (wanted.job.heights, ground.top)


def starts_channels_beside(ground: Ground) -> bool:
    """Returns whether the channels of the newest job are to be had while a solve goes on: because they were painted on,
    which must not wait for a pass to end, or because the heights, which are the same, are settling."""
    wanted, begun, channels = ground.jobs.wanted, ground.jobs.begun, ground.channels
    if wanted is None or begun is None or not is_solving(ground) or channels.making or not channels.solved_since:
        return False
    if channels.beside is not None and wanted.job.number == channels.beside.number:
        return False
    same = wanted.job.heights == begun.job.heights and isinstance(ground.state, Settling)
    return same or wanted.job.paint_rev != channels.paint_rev


def channels_are_next(ground: Ground) -> bool:
    """Returns whether the next slice is one of channels beside a solve: those and slices of the solve alternate."""
    channels = ground.channels
    going_on = channels.making and (channels.solved_since or not is_solving(ground))
    return going_on or starts_channels_beside(ground)


def early_preview_is_due(ground: Ground, now: float) -> bool:
    """Returns whether the coarsest preview of the newest job is to be had while the pass of an older one goes on."""
    wanted, state, early = ground.jobs.wanted, ground.state, ground.early
    if wanted is None or not isinstance(state, Previewing) or not state.previews_early:
        return False
    spaced = early.solved_since or now - early.at >= EARLY_EVERY or is_resting(ground, now)
    if wanted.job.number == early.number or not spaced:
        return False
    return state.reached >= 0 and wanted.job.layers_rev == state.job.layers_rev


def rests_until(ground: Ground) -> float:
    """Returns until when the finer levels of a pass wait whose coarsest level is out, and that can show newer ones."""
    state, shown = ground.state, ground.shown
    if not isinstance(state, Previewing) or not state.previews_early or state.finer or state.reached != 0:
        return -math.inf
    wanted, early = ground.jobs.wanted, ground.early
    if wanted is not None and wanted.job.layers_rev != state.job.layers_rev:
        return -math.inf  # its coarsest level cannot be made beside this pass
    if wanted is not None and early.number == wanted.job.number and not early.made:
        return -math.inf  # it could not be made
    rest = min(REST * max(0.0, shown.lead.get(0, 0.0) - QUICK_PASS), REST_MOST)
    return min(shown.finest_at + rest, ground.jobs.asked_at + PEN_STILL)


def is_resting(ground: Ground, now: float) -> bool:
    """Returns whether a pass waits so that others have the processors."""
    return now < rests_until(ground)


def is_overtaken(ground: Ground) -> bool:
    """Returns whether a pass that has waited for its turn since its coarsest level has a newer job whose coarsest level
    is out, too: then nothing is lost by making the finer levels of that one, and who draws sees the newest strokes."""
    wanted, state, early = ground.jobs.wanted, ground.state, ground.early
    if wanted is None or not isinstance(state, Previewing) or state.finer or state.reached < 0:
        return False
    return early.made and early.number == wanted.job.number


def starts(ground: Ground, now: float) -> bool:
    """Returns whether the newest job is to be begun: at once, but for a preview pass that should end first."""
    wanted, state, channels = ground.jobs.wanted, ground.state, ground.channels
    if wanted is None:
        return False
    others = channels.beside is None or channels.beside.number != wanted.job.number
    if needs_channels_only(ground) and channels.making and others:
        return False  # frames of what was begun are sent first
    if isinstance(state, Previewing | Settling | ChannelsOnly) and wanted.job.heights == state.job.heights:
        # either the heights go on, or the channels
        return isinstance(state, ChannelsOnly) and now - channels.complete_at <= FINEST_WITHIN
    if not isinstance(state, Previewing) or is_overtaken(ground):
        return True
    starving = now - ground.shown.finest_at > FINEST_WITHIN
    return not starving and ground.shown.lead.get(state.reached, math.inf) > FINISH


def stage(ground: Ground, now: float) -> int | None:
    """Returns the class of what the room has to do (``COARSE`` … ``REFINE``); None when it has nothing to do."""
    state, wanted = ground.state, ground.jobs.wanted
    if ground.channels.making or starts_channels_beside(ground):
        return COARSE
    if is_overtaken(ground):
        return SETTLE if now - ground.shown.finest_at < PACE else FINER
    if wanted is not None and starts(ground, now):
        return SETTLE if wanted.job.number == ground.shown.previewed else COARSE
    if early_preview_is_due(ground, now):
        return COARSE
    match state:
        case Previewing(reached=-1):
            return COARSE
        case Previewing():
            return SETTLE if now - ground.shown.finest_at < PACE else FINER
        case Settling() | ChannelsOnly():
            return SETTLE
        case Refining():
            return REFINE
        case _:
            return None
