"""The thread in which levels become tiles and tiles become frames, for all rooms (DESIGN 8; decision 0008).

Each room has a lane, whose work keeps its order. Lanes have turns by home (the address that a room's work is done for,
``tally.py``): of sixty rooms that one stranger opened one has a turn before the next home has its own, whether that is
for a level or for a frame. Within a home new levels go before frames: a frame that is made a little later shows more.

Newcomers' first views are many frames at once, and whoever comes can come two hundred times. They are made while
nothing else waits, and have ``1 / (1 + OTHERS)`` of the time where something always does. Newcomers have turns by the
home that they come from, whichever rooms they came to.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Hashable
from concurrent.futures import Executor, Future
from typing import Any, Final

from esker.fairness.rounds import Rounds

OTHERS: Final = 3.0
"""While others' work waits it has so many times the time that newcomers' has."""

_Work = tuple[Future[Any], Callable[[], Any]]


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

    def behind(self, home: Hashable, fn: Callable[..., Any], /, *args: Any) -> Future[Any]:
        """Runs a function for a newcomer who comes from ``home``, behind others' work and in no order with it. Raises
        RuntimeError after ``shutdown``."""
        return self._thread.behind(home, fn, *args)


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
        self._newcomers: dict[Hashable, deque[_Work]] = {}
        """Work for newcomers by the home that they come from, where there is any."""
        self._homes_of_newcomers = Rounds()
        self._owed = 0.0
        """Seconds that others have before the next turn of a newcomer."""
        self._closed = self._is_newcomers = False
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
        with self._changed:
            future = self._put(queue, work)
            self._lanes[lane] = None
            return future

    def behind(self, home: Hashable, fn: Callable[..., Any], /, *args: Any) -> Future[Any]:
        """Runs a function for a newcomer, behind others' work. Raises RuntimeError after ``shutdown``."""
        with self._changed:
            queue = self._newcomers.get(home, deque())
            future = self._put(queue, lambda: fn(*args))
            self._newcomers[home] = queue
            return future

    def _put(self, queue: deque[_Work], work: Callable[[], Any]) -> Future[Any]:
        """Adds to a queue. Needs the lock."""
        if self._closed:
            raise RuntimeError("the tile thread has stopped")
        future: Future[Any] = Future()
        queue.append((future, work))
        self._changed.notify()
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Takes no more work. Work that waits is done, or dropped with ``cancel_futures``."""
        with self._changed:
            self._closed = True
            if cancel_futures:
                queues = [queue for lane in self._lanes for queue in (lane.levels, lane.frames)]
                for queue in (*queues, *self._newcomers.values()):
                    for future, _ in queue:
                        future.cancel()
                    queue.clear()
                self._lanes.clear()
                self._newcomers.clear()
            self._changed.notify()
        if wait:
            self._thread.join()

    def _run(self) -> None:
        self._begin()
        while (work := self._next()) is not None:
            future, call = work
            began = self._now()
            if not future.set_running_or_notify_cancel():
                continue
            try:
                future.set_result(call())
            except BaseException as error:
                future.set_exception(error)
            self._took(self._now() - began)
            del work, future, call

    def _next(self) -> _Work | None:
        """Waits for work; None once the thread is to end."""
        with self._changed:
            while not self._lanes and not self._newcomers:
                if self._closed:
                    return None
                self._changed.wait()
            self._is_newcomers = bool(self._newcomers) and (not self._lanes or self._owed <= 0)
            if self._is_newcomers:
                return self._newcomer()
            lane = self._chosen()
            lane.turn = self._rounds.took(_home(lane))
            work = (lane.levels or lane.frames).popleft()
            if not lane.levels and not lane.frames:
                del self._lanes[lane]
            return work

    def _took(self, seconds: float) -> None:
        """Counts what the last work took. Only the thread may call it."""
        self._owed = OTHERS * seconds if self._is_newcomers else self._owed - seconds

    def _newcomer(self) -> _Work:
        """Returns the work of the newcomer whose turn it is."""
        home = min(self._newcomers, key=self._homes_of_newcomers.last)
        self._homes_of_newcomers.took(home)
        queue = self._newcomers[home]
        work = queue.popleft()
        if not queue:
            del self._newcomers[home]
        return work

    def _chosen(self) -> Lane:
        """Returns the lane whose turn it is, of those that have work."""
        return min(self._lanes, key=lambda lane: (self._rounds.last(_home(lane)), not lane.levels, lane.turn))


def _home(lane: Lane) -> Hashable:
    return lane if lane.home is None else lane.home
