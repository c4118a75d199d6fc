"""The thread in which levels become tiles and tiles become frames, for all rooms (DESIGN 8; decision 0008).

New levels go before frames: a frame that is made a little later shows more, and the solver waits for nobody's zlib.
"""

from __future__ import annotations

import itertools
import queue
import threading
from collections.abc import Callable
from concurrent.futures import Executor, Future
from typing import Any

FIRST, LATER, STOP = range(3)

_Work = tuple[Future[Any], Callable[[], Any]]


class TileThread(Executor):
    """One thread; what was given to ``first`` runs before what was given to ``submit``, each in its own order."""

    def __init__(self, name: str = "tiles") -> None:
        self._queue: queue.PriorityQueue[tuple[int, int, _Work | None]] = queue.PriorityQueue()
        self._count = itertools.count()
        self._lock = threading.Lock()
        self._closed = False
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """See ``concurrent.futures.Executor``. Raises RuntimeError after ``shutdown``."""
        return self._add(LATER, lambda: fn(*args, **kwargs))

    def first(self, fn: Callable[..., Any], /, *args: Any) -> Future[Any]:
        """Runs a function ahead of everything that ``submit`` was given. Raises RuntimeError after ``shutdown``."""
        return self._add(FIRST, lambda: fn(*args))

    def _add(self, rank: int, work: Callable[[], Any]) -> Future[Any]:
        future: Future[Any] = Future()
        with self._lock:
            if self._closed:
                raise RuntimeError("the tile thread has stopped")
            self._queue.put((rank, next(self._count), (future, work)))
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Takes no more work. Work that waits is done, or dropped with ``cancel_futures``."""
        with self._lock:
            self._closed = True
            while cancel_futures:
                try:
                    work = self._queue.get_nowait()[2]
                except queue.Empty:
                    break
                if work is not None:
                    work[0].cancel()
            self._queue.put((STOP, next(self._count), None))
        if wait:
            self._thread.join()

    def _run(self) -> None:
        while (work := self._queue.get()[2]) is not None:
            future, call = work
            if not future.set_running_or_notify_cancel():
                continue
            try:
                future.set_result(call())
            except BaseException as error:
                future.set_exception(error)
            del work, future, call
