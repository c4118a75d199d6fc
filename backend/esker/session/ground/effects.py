"""Events that happen to the ground of a room beside those of a solve, and effects that follow (``machine.py``).

Events come in, effects go out. The solver's own events are in ``esker.events``.
"""

from __future__ import annotations

from dataclasses import dataclass

from esker.events import BaseLevel, ChannelLevel, Preview, Settled, SolveEvent
from esker.session.ground.jobs import Job

# --- events ---------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Requested:
    """The room has a newer job."""

    job: Job


@dataclass(frozen=True)
class Turn:
    """The room has a slice of the solver's time. begins: whether its newest job is to be begun."""

    begins: bool


@dataclass(frozen=True)
class Opened:
    """The solve of the job that was begun is open. previews_early: see ``states.Previewing``."""

    previews_early: bool


@dataclass(frozen=True)
class BaseShown:
    """All levels of the base of the running job are out."""


@dataclass(frozen=True)
class Beside:
    """An event of the channels that are made beside a solve."""

    event: SolveEvent


@dataclass(frozen=True)
class EarlyMade:
    """The early preview of the newest job; None where the solve could not make one."""

    job: Job
    preview: Preview | None


@dataclass(frozen=True)
class Nudged:
    """Other tiles above the global levels may be wanted than before."""


@dataclass(frozen=True)
class NothingRequested:
    """Nobody wants a tile that was not refined."""


@dataclass(frozen=True)
class Dropped:
    """All work for the room was ended. settled: whether the settled heights stay settled."""

    settled: bool = False


@dataclass(frozen=True)
class Again:
    """The job that was begun last is to be done once more, unless there is a newer one."""


@dataclass(frozen=True)
class Unsolved:
    """The job could not be computed, for a reason of its own or an unknown one. All work for the room was ended."""


@dataclass(frozen=True)
class Unsolvable:
    """No device would solve the job, and trying again is in vain until it changes. All work for the room was ended."""


@dataclass(frozen=True)
class Coarser:
    """There is no memory for ``top``: the level below is the finest from now on. All work for the room was ended."""


@dataclass(frozen=True)
class Finer:
    """There may be memory for level ``top`` again."""

    top: int


Event = (
    SolveEvent
    | Requested
    | Turn
    | Opened
    | BaseShown
    | Beside
    | EarlyMade
    | Nudged
    | NothingRequested
    | Dropped
    | Again
    | Unsolved
    | Unsolvable
    | Coarser
    | Finer
)

# --- effects --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Leave:
    """End the solve and refinement that are open.

    The memory that refinement held is given back behind the next result. keeps: the channels that are made alone go on
    beside the next solve.
    """

    keeps: bool = False


@dataclass(frozen=True)
class OpenSolve:
    """Begin to solve a job. coarsest: with level 0, which was not shown early. base: with its base before."""

    job: Job
    top: int
    coarsest: bool
    base: bool


@dataclass(frozen=True)
class OpenChannels:
    """Begin to make the channels of a job alone. beside: begin them beside a solve.

    Channels that are being made beside a solve become the ones made alone.
    """

    job: Job
    top: int
    beside: bool = False


@dataclass(frozen=True)
class AdoptChannels:
    """Go on with the channels that are made beside a solve, and with nothing else."""


@dataclass(frozen=True)
class Step:
    """Go on with the solve, or with the channels alone, until that work can be left."""


@dataclass(frozen=True)
class StepBeside:
    """Go on with the channels beside the solve."""


@dataclass(frozen=True)
class PreviewEarly:
    """Make the coarsest preview of a newer job between two steps of the solve."""

    job: Job


@dataclass(frozen=True)
class Refine:
    """Finish at most one tile above the global levels."""


@dataclass(frozen=True)
class Deliver:
    """Bring a level to people."""

    job: Job
    level: Preview | Settled | ChannelLevel | BaseLevel


@dataclass(frozen=True)
class Note:
    """Keep a preview that the finest replaces so soon that it is not shown."""

    job: Job
    preview: Preview


@dataclass(frozen=True)
class Confirm:
    """Tell people that the settled heights are those of this job too, and that its channels have come."""

    job: Job
    top: int


@dataclass(frozen=True)
class Yield:
    """Leave the processor for so many seconds to the threads that bring people the delivered tiles."""

    seconds: float


@dataclass(frozen=True)
class GiveBack:
    """Give back the memory that the refinement before held: something newer is out."""


@dataclass(frozen=True)
class OpenRefinement:
    """Get ready to refine the settled heights, from the basis of the solve."""

    basis: object


@dataclass(frozen=True)
class NoteSolved:
    """A whole solve went through: the device works, and so does the finest level."""


@dataclass(frozen=True)
class Apologise:
    """Tell the room that its job could not be computed. again: whether it will be tried again soon."""

    again: bool


Effect = (
    Leave
    | OpenSolve
    | OpenChannels
    | AdoptChannels
    | Step
    | StepBeside
    | PreviewEarly
    | Refine
    | Deliver
    | Note
    | Confirm
    | Yield
    | GiveBack
    | OpenRefinement
    | NoteSolved
    | Apologise
)
