"""When a room's task is scored: once its ground is final, for the ground and the task as they are, in one thread.

A room has at most one score on the way, so rooms take turns; while nobody draws nothing is computed.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from esker import contract as c
from esker.document.ops import StrokeSet
from esker.process import priority
from esker.session.ground.frames.tilethread import Lane, TileThread
from esker.tasks.score import Points, score

log = logging.getLogger("esker.tasks")

Heights = NDArray[np.float32]
FOLLOWED: Final = ("task", "sea_level_m")
"""Settings that a score follows from beside the ground."""


class Scorer:
    """One thread of low priority for the scores of all rooms, whose homes have turns. Safe from any thread."""

    def __init__(self) -> None:
        self._thread = TileThread("scores", begin=priority.yield_to_others)

    def lane(self) -> Lane:
        """Returns a place for the scores of one room."""
        return self._thread.lane()

    def score(self, lane: Lane, goal: c.Goal, heights: Heights, settings: c.TerrainSettings) -> Future[Points]:
        """Begins to count. Raises RuntimeError after ``close``."""
        return lane.submit(score, goal, heights, settings)

    def close(self) -> None:
        """Drops what waits, and takes no more."""
        self._thread.shutdown(wait=False, cancel_futures=True)


class Scoring:
    """The score of one room. Call it from the event loop's thread."""

    def __init__(
        self,
        scorer: Scorer | None,
        heights: Callable[[], Future[Heights | None]],
        loop: asyncio.AbstractEventLoop,
        tell: Callable[[c.Score], None],
    ) -> None:
        """``heights``: reads the ground that counts; ``tell``: hears of new scores. Without ``scorer`` none comes."""
        self._scorer, self._heights, self._loop, self._tell = scorer, heights, loop, tell
        self._lane = None if scorer is None else scorer.lane()
        self._document: StrokeSet | None = None
        self._followed: tuple[object, ...] = ()
        self._settled = self._busy = self._due = self._closed = False
        self.newest: c.Score | None = None
        """The score that everybody was told last; None: nothing was ever scored here."""

    def works_for(self, home: str) -> None:
        """From now on scores count for this address."""
        if self._lane is not None:
            self._lane.home = home or None

    def follow(self, document: StrokeSet) -> None:
        """The document has changed; where its task did, it is scored anew."""
        self._document = document
        followed = tuple(getattr(document.settings, name) for name in FOLLOWED)
        if followed == self._followed:
            return
        self._followed = followed
        if self._goal is not None:
            self._soon()
        elif self.newest is not None:
            self._note(c.Score(clock=document.clock))

    def level_taken(self, settled: bool) -> None:
        """A level became tiles. ``settled``: now all of them are final."""
        self._settled = settled
        if settled:
            self._soon()

    @property
    def busy(self) -> bool:
        """Whether a newer score is on its way."""
        return self._busy or self._due

    def close(self) -> None:
        """Scores no more."""
        self._closed = True

    @property
    def _goal(self) -> c.Goal | None:
        task = None if self._document is None else self._document.settings.task
        return None if task is None else task.goal

    def _soon(self) -> None:
        self._due = self._goal is not None and self._scorer is not None
        self._go_on()

    def _go_on(self) -> None:
        if not self._due or not self._settled or self._busy or self._closed:
            return
        self._due, self._busy = False, True
        clock = 0 if self._document is None else self._document.clock
        self._after(self._heights, lambda found: self._read(clock, found))

    def _read(self, clock: int, heights: Heights | None) -> None:
        document, goal = self._document, self._goal
        if heights is None or document is None or goal is None or self._scorer is None or self._lane is None:
            self._busy = False
            self._go_on()
            return
        scorer, lane, settings = self._scorer, self._lane, document.settings
        self._after(lambda: scorer.score(lane, goal, heights, settings), lambda found: self._counted(clock, found))

    def _counted(self, clock: int, found: Points | None) -> None:
        self._busy = False
        if found is not None and self._goal is not None:
            self._note(c.Score(clock=clock, points=found.points, text=found.text, figures=found.figures))
        self._go_on()

    def _note(self, score: c.Score) -> None:
        before, self.newest = self.newest, score
        if before is None or (before.points, before.text) != (score.points, score.text):
            self._tell(score)

    def _after(self, begin: Callable[[], Future[Any]], then: Callable[[Any], None]) -> None:
        """Calls ``then`` in the loop with what a thread found, None where it found nothing."""
        try:
            begin().add_done_callback(lambda done: self._call(done, then))
        except RuntimeError:  # the server is stopping
            self._busy = False

    def _call(self, future: Future[Any], then: Callable[[Any], None]) -> None:
        error = None if future.cancelled() else future.exception()
        if error is not None:
            log.error("a task could not be scored: %s: %s", type(error).__name__, error)
        found = None if future.cancelled() or error is not None else future.result()
        if not self._loop.is_closed():
            self._loop.call_soon_threadsafe(lambda: None if self._closed else then(found))
