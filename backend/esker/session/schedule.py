"""Whose turn it is on the solver (DESIGN 8): rooms that wait for a first coarse preview, finer previews, settling, and
refinement, in this order; in turn within each, a slice at a time. Finer previews are finished one after the other,
the smallest terrains first: interleaved, all of them would come late.

A lower class that has waited for ``PATIENCE`` gets a slice all the same, so nothing starves. A solve in progress holds
memory, so only so many may be in progress as fit the budget: a room that waits for its coarse preview ends the settling
solve that began last, which starts again later.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, Protocol, runtime_checkable

from esker import contract as c
from esker.grid import TileKey, solve_bytes
from esker.session.ports import Base, LevelResult, Refinement, Refiner
from esker.session.recovery import Backoff
from esker.tiles.delivery import RefinedTile

FINEST_WITHIN: Final = 0.150
HOLD: Final = 0.070
"""A preview between the coarsest and the finest that the finest follows within this time is not shown."""
FINISH: Final = 0.300
"""A pass that should end within this time is not stopped: coarsest previews of newer jobs are made in between."""
FRAMES: Final = 0.060
"""The finest preview has this time to become frames before a level below it is shown again: what is coarser and newer
would bar it. The coarsest level alone is shown at any time: tiles follow it (``feed.py``, ``tiles/pyramid.py``)."""
PATIENCE: Final = 0.150
BUDGET: Final = min(3 << 30, os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") // 8)
"""Bytes for solves in progress, of all rooms together."""

COARSE, FINER, SETTLE, REFINE = range(4)

Deliver = Callable[[int, LevelResult, bool], None]


@dataclass(frozen=True)
class Job:
    """What to solve. ``clock`` is the document's; jobs of one room with the same ``shape`` have the same heights, and
    differ in the other channels alone, those with the same ``painted`` not by paint (``StrokeSet``)."""

    clock: int
    strokes: tuple[c.Stroke, ...]
    settings: c.TerrainSettings
    shape: object = field(default_factory=object, compare=False)
    painted: object = field(default=None, compare=False)
    base: Base | None = field(default=None, compare=False)
    """The ground under the strokes. Jobs with another base have another ``shape``."""


@runtime_checkable
class Glimpsing(Protocol):
    """A solve that can tell, while it goes on, what newer strokes look like on the coarsest level."""

    def glimpse(self, strokes: Sequence[c.Stroke], settings: c.TerrainSettings, base: Any = None) -> LevelResult | None:
        """The coarsest preview of other strokes, None when this solve cannot make one now."""
        ...


@dataclass(eq=False)
class Client:
    """A room as the worker sees it. ``top``: the finest level solved for it at present, of ``levels``."""

    levels: int
    deliver: Deliver
    tell: Callable[[str], None]
    refinement: Refinement | None = None
    limit: Callable[[int], None] | None = None
    confirm: Callable[[int, int], None] | None = None
    newest: Job | None = None
    running: Job | None = None
    steps: Iterator[LevelResult | None] | None = None
    refiner: Refiner | None = None
    remains: object = None
    """What its last solve left to refinement, kept until its next one has shown something: giving so much memory back
    takes a millisecond or more."""
    tiles: Iterator[RefinedTile | None] | None = None
    refined: set[TileKey] = field(default_factory=set)
    looking: bool = False
    """Whether tiles may be wanted that were not made yet."""
    top: int = field(init=False)
    backoff: Backoff = field(default_factory=Backoff)
    again_at: float = math.inf
    """When a job that failed is tried again by itself."""
    told: str = ""
    turn: int = 0
    """Of its last slice, counted over all rooms."""
    began: int = 0
    """Turn at which its solve began."""
    ran_at: float = 0.0
    """When it had its last slice, or began to wait."""
    ground: tuple[object, int] | None = None
    """Shape and finest level of the heights that are settled here, and refined."""
    ground_clock: int = -1
    """Of the job whose heights they are, or will be."""
    laid: tuple[Base | None, int] = (None, -1)
    """The base whose levels were delivered last, and the finest of them. A terrain begins with no base on any level."""
    light: bool = False
    """What runs are the channels of a job whose heights are settled."""
    aside_clock: int = -1
    """Of the newest job whose channels were solved while the running one went on; -1 for none."""
    aside_job: Job | None = None
    """That job."""
    painted: object = None
    """Of the job whose channels came last, or will come."""
    glimpsed: Job | None = None
    """The newest job of which the coarsest preview was to be made ahead of its pass, ..."""
    ahead: bool = False
    """... and whether it was."""
    stepped: bool = True
    """Its pass has gone on since then: who glimpses all the time keeps others, and itself, from finer levels."""
    previewing: bool = False
    finest_at: float = -math.inf
    _reached: int = -1
    _previewed: Job | None = None
    """That had the last complete preview."""
    _came: dict[int, float] = field(default_factory=dict)
    _lead: dict[int, float] = field(default_factory=dict)
    """Per level: how long before the finest its preview came, last time."""

    def __post_init__(self) -> None:
        self.top = self.levels

    @property
    def clock(self) -> int:
        """Of the job that it solves, or solved last."""
        return -1 if self.running is None else self.running.clock

    @property
    def bytes(self) -> int:
        """Memory that its solve holds, or would hold."""
        job = self.running if self.newest is None or self.steps is not None else self.newest
        return solve_bytes(self.top, job is not None and job.base is not None)

    @property
    def at_rest(self) -> bool:
        """Nothing to solve."""
        return self.steps is None and self.newest is None

    def request(self, job: Job, now: float) -> None:
        """The newest job."""
        if self.at_rest:
            self.ran_at = now
        self.newest, self.again_at = job, math.inf

    def again(self, now: float) -> None:
        """The job that was dropped, unless there is a newer one."""
        if self.newest is None and self.running is not None:
            self.request(self.running, now)

    def drop(self) -> None:
        """Ends what runs for it. In the solver's thread."""
        for work in (self.steps, self.tiles):
            _close(work)
        self.steps = self.tiles = self.refiner = self.remains = self.ground = None
        self.refined.clear()
        self.looking = self.previewing = self.light = False

    def stands_on(self, base: Base | None) -> bool:
        """Whether this base was delivered last, up to the level that is solved; no base need not be."""
        shown, top = self.laid
        return shown is base and (top >= self.top or (base is None and top == -1))

    @property
    def lighter(self) -> bool:
        """Whether its newest job has the heights that are settled already."""
        return self.newest is not None and self.ground == (self.newest.shape, self.top)

    @property
    def aside(self) -> bool:
        """Whether the channels of its newest job are to be had while the running one goes on: because they were painted
        on, which must not wait for a pass to end, or because the heights, which are the same, are settling."""
        newest, running = self.newest, self.running
        if newest is None or running is None or self.steps is None or self.light or newest is self.aside_job:
            return False
        settling = newest.shape is running.shape and not self.previewing
        return settling or newest.painted is not self.painted

    @property
    def glimpse_due(self) -> bool:
        """Whether the coarsest preview of its newest job is to be had while the pass of an older one goes on."""
        newest, running = self.newest, self.running
        if newest is None or running is None or newest is self.glimpsed or not isinstance(self.steps, Glimpsing):
            return False
        return self.stepped and self.previewing and self._reached >= 0 and newest.base is running.base

    def starts(self, now: float) -> bool:
        """Whether its newest job is to be begun: at once, but for a preview pass that should end first."""
        if self.newest is None:
            return False
        if self.steps is not None and self.running is not None and self.newest.shape is self.running.shape:
            return self.light  # the heights go on
        if self.steps is None or not self.previewing:
            return True
        starving = now - self.finest_at > FINEST_WITHIN
        return not starving and self._lead.get(self._reached, math.inf) > FINISH

    def stage(self, now: float) -> int | None:
        """Its class; None when it has nothing to do."""
        if self.aside:
            return COARSE
        if self.newest is not None and self.starts(now):
            return SETTLE if self.newest is self._previewed else COARSE
        if self.glimpse_due:
            return COARSE
        if self.steps is not None:
            return SETTLE if not self.previewing else FINER if self._reached >= 0 else COARSE
        return REFINE if self.refiner is not None and self.looking else None

    def begin(self) -> Job:
        """Takes up the newest job."""
        assert self.newest is not None
        self.painted, self.aside_clock, self.aside_job = self.newest.painted, -1, None
        if self.lighter:
            _close(self.steps)
            self.running, self.newest, self.light = self.newest, None, True
            self.again_at = math.inf
            return self.running
        refiner = self.refiner
        self.drop()
        self.remains = refiner
        self.ground_clock = self.newest.clock
        self.running, self.newest = self.newest, None
        self.previewing, self._reached, self.again_at = True, -1, math.inf
        self._came.clear()
        if self.is_ahead(self.running):
            self._reached, self._came[0] = 0, self.ran_at
        return self.running

    def is_ahead(self, job: Job) -> bool:
        """Whether the coarsest preview of a job was made ahead of its pass."""
        return self.ahead and job is self.glimpsed

    def ended(self) -> None:
        """Its solve came to its end."""
        self.steps, self.previewing = None, False
        if self.running is not None and not self.light:
            self.ground = self.running.shape, self.top

    def took(self, result: LevelResult, now: float) -> bool:
        """Notes a result; returns whether to show it.

        The coarsest level is always shown at once. Of a preview that ends soon it is the only one: what levels say in
        between would be corrected before anybody saw it (docs/decisions/0014-consistent-previews.md).
        """
        if not self.previewing or result.settled:
            return True
        level = self._reached = result.level
        if level < self.top:
            self._came[level] = now
            return level == 0 or (self._lead.get(level, math.inf) > HOLD and now - self.finest_at >= FRAMES)
        self._lead |= {coarse: now - came for coarse, came in self._came.items()}
        self.previewing, self.finest_at, self._previewed = False, now, self.running
        return True


class Schedule:
    """Chooses among ``clients``. Call it under the worker's lock, in its thread."""

    def __init__(self, now: Callable[[], float], budget: int = BUDGET) -> None:
        self.clients: list[Client] = []
        self._now, self._budget = now, budget
        self._turns = 0
        self._favoured: Client | None = None
        self._favour_after = -math.inf

    def pick(self) -> Client | None:
        """The client whose turn it is, None when there is nothing to do."""
        now = self._now()
        staged = [(stage, x) for x in self.clients if (stage := x.stage(now)) is not None and self._fits(x, stage, now)]
        if not staged:
            return None
        stage, best = min(staged, key=lambda s: (s[0], *_order(*s)))
        late = [x for other, x in staged if other > stage and now - x.ran_at > PATIENCE]
        self._favoured = None
        if late and now > self._favour_after:
            best = self._favoured = min(late, key=lambda x: x.turn)
        return best

    @property
    def called(self) -> bool:
        """Whether any client has a job that was not begun."""
        return any(client.newest is not None for client in tuple(self.clients))

    def urges(self, client: Client) -> bool:
        """Whether there is anything to do but to go on with the client's solve."""
        return any(x.newest is not None or (x is not client and x.steps is not None) for x in self.clients)

    def ended(self, client: Client) -> None:
        """Its slice is over: from now on it waits. After a slice out of turn the others have at least as long."""
        now = self._now()
        if client is self._favoured:
            self._favour_after = now + max(PATIENCE, now - client.ran_at)
        client.ran_at = now

    def begin(self, client: Client) -> Job | None:
        """The client's slice begins: the job to start, if it is to start one. Ends solves that are in its way."""
        now = self._now()
        self._turns += 1
        client.turn, client.ran_at = self._turns, now
        if not client.starts(now):
            return None
        for other in self._in_the_way(client):
            other.drop()
            other.again(now)
        client.began = self._turns
        return client.begin()

    def _fits(self, client: Client, stage: int, now: float) -> bool:
        """Whether its slice may run: in what memory there is, or, for a coarse preview, in what others can leave."""
        if client.steps is not None or client.lighter or not client.starts(now) or self._room(client, []):
            return True
        return stage == COARSE and self._room(client, self._settling(client))

    def _settling(self, client: Client) -> list[Client]:
        """Others that are only settling, longest first."""
        found = [x for x in self._solving(client) if not x.previewing]
        return sorted(found, key=lambda x: x.finest_at)

    def _solving(self, client: Client) -> list[Client]:
        """Others whose solves hold memory."""
        return [x for x in self.clients if x is not client and x.steps is not None and not x.light]

    def _in_the_way(self, client: Client) -> list[Client]:
        """The fewest settling solves, last begun first, without which the client's has room."""
        gone: list[Client] = []
        if client.lighter:
            return gone
        settling = self._settling(client)
        while settling and not self._room(client, gone):
            gone.append(settling.pop())
        return gone

    def _room(self, client: Client, gone: list[Client]) -> bool:
        held = [x for x in self._solving(client) if x not in gone]
        return not held or sum(x.bytes for x in [*held, client]) <= self._budget


def _close(work: object) -> None:
    close = getattr(work, "close", None)
    if close is not None:
        close()


def _order(stage: int, client: Client) -> tuple[int, int]:
    """Within a class the least comes first."""
    return (client.top, client.began) if stage == FINER else (0, client.turn)
