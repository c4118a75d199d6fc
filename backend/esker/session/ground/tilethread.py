"""The thread in which levels become tiles and tiles become frames, for all rooms (DESIGN 8; decision 0008).

New levels go before frames: a frame that is made a little later shows more, and the solver waits for nobody's zlib.

Each room has a lane, whose work keeps its order. Lanes have turns by home (the address that a room's work is done for,
``tally.py``): of sixty rooms that one stranger opened one has a turn before the next home has its own. Where levels of
other homes come without end, frames that have waited for ``PATIENCE`` have every second turn.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Hashable
from concurrent.futures import Executor, Future
from typing import Any, Final

from esker.fairness.rounds import Rounds

PATIENCE: Final = 0.1
"""Frames that have waited for so many seconds are late."""

_Work = tuple[Future[Any], Callable[[], Any], float]


class Lane:
    """Work of one room. ``home`` says for whom it is done; None: for this room alone."""

    def __init__(self, thread: TileThread) -> None:
        self._thread = thread
        self.home: Hashable = None
        self.levels: deque[_Work] = deque()
        self.frames: deque[_Work] = deque()
        self.turn = 0
        """Number of its last turn."""

    def submit(self, fn: Callable[..., Any], /, *args: Any) -> Future[Any]:
        """Runs a function behind what ``first`` was given. Raises RuntimeError after the thread's ``shutdown``."""
        return self._thread.add(self, self.frames, lambda: fn(*args))

    def first(self, fn: Callable[..., Any], /, *args: Any) -> Future[Any]:
        """Runs a function ahead of everything that ``submit`` was given. Raises RuntimeError after ``shutdown``."""
        return self._thread.add(self, self.levels, lambda: fn(*args))


class TileThread(Executor):
    """One thread. What it is given by itself, and not by a lane, is one room's."""

    def __init__(
        self,
        name: str = "tiles",
        now: Callable[[], float] = time.monotonic,
        begin: Callable[[], object] = lambda: None,
    ) -> None:
        """``begin``: called first in the thread."""
        self._now, self._begin = now, begin
        self._changed = threading.Condition()
        self._lanes: dict[Lane, None] = {}
        """Lanes that have work. They, and what follows, need the lock."""
        self._rounds = Rounds()
        self._was_late = self._closed = False
        self._own = Lane(self)
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def lane(self) -> Lane:
        """Makes a lane for a room. It needs no closing."""
        return Lane(self)

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """See ``concurrent.futures.Executor``. Raises RuntimeError after ``shutdown``."""
        return self._own.submit(lambda: fn(*args, **kwargs))

    def first(self, fn: Callable[..., Any], /, *args: Any) -> Future[Any]:
        """Runs a function ahead of everything that ``submit`` was given. Raises RuntimeError after ``shutdown``."""
        return self._own.first(fn, *args)

    def add(self, lane: Lane, queue: deque[_Work], work: Callable[[], Any]) -> Future[Any]:
        """Work for a lane, at the end of one of its queues. Raises RuntimeError after ``shutdown``."""
        future: Future[Any] = Future()
        with self._changed:
            if self._closed:
                raise RuntimeError("the tile thread has stopped")
            queue.append((future, work, self._now()))
            self._lanes[lane] = None
            self._changed.notify()
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Takes no more work. Work that waits is done, or dropped with ``cancel_futures``."""
        with self._changed:
            self._closed = True
            if cancel_futures:
                for lane in self._lanes:
                    for future, _, _ in (*lane.levels, *lane.frames):
                        future.cancel()
                    lane.levels.clear()
                    lane.frames.clear()
                self._lanes.clear()
            self._changed.notify()
        if wait:
            self._thread.join()

    def _run(self) -> None:
        self._begin()
        while (work := self._next()) is not None:
            future, call, _ = work
            if not future.set_running_or_notify_cancel():
                continue
            try:
                future.set_result(call())
            except BaseException as error:
                future.set_exception(error)
            del work, future, call

    def _next(self) -> _Work | None:
        """Waits for work; None once the thread is to end."""
        with self._changed:
            while not self._lanes:
                if self._closed:
                    return None
                self._changed.wait()
            lane = self._chosen()
            lane.turn = self._rounds.took(_home(lane))
            work = (lane.frames if self._was_late or not lane.levels else lane.levels).popleft()
            if not lane.levels and not lane.frames:
                del self._lanes[lane]
            return work

    def _chosen(self) -> Lane:
        """Returns the lane whose turn it is, of those that have work.

        ``_was_late`` then says whether frames were late.
        """
        levels = [lane for lane in self._lanes if lane.levels]
        homes, since = {_home(lane) for lane in levels}, self._now() - PATIENCE
        late = [] if self._was_late or not levels else [lane for lane in self._lanes if _home(lane) not in homes]
        late = [lane for lane in late if lane.frames[0][2] <= since]
        self._was_late = bool(late)
        return min(late or levels or self._lanes, key=lambda lane: (self._rounds.last(_home(lane)), lane.turn))


def _home(lane: Lane) -> Hashable:
    return lane if lane.home is None else lane.home
