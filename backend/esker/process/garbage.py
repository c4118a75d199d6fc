"""Memory that Python frees by itself only late: what is in circles.

Counting references frees most things the moment that nobody holds them. Things that hold each other wait for the
collector, which goes through all that it knows while every thread waits: through the documents of open rooms in 100 ms
and more. So what is large does not get into circles (``weakly``), and the collector goes through what is new alone,
until there is time to go through all (``Collector``).
"""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Final, ParamSpec, TypeVar
from weakref import WeakMethod

P = ParamSpec("P")
T = TypeVar("T")

NEW_OBJECTS: Final = 5_000
"""The collector looks at the newest objects when there are so many more than before."""
LOOKS: Final = (1, 1)
"""After more looks than these at the newest it looks at those that were left by them too, and after more of these at
all that is new: at 20,000 objects, which takes 6 to 15 ms."""
DUE, OVERDUE = 1, 360
"""All is gone through after so many looks at what is new: when there is little to do, and however much there is."""
CALM: Final = 0.1
"""Parts of a processor below which a process has little to do."""
CALM_SECONDS: Final = 5.0
"""All is gone through when there has been little to do for so long, up to the last moment: somebody who has just begun
to draw would wait for it."""


def weakly(method: Callable[P, T]) -> Callable[P, T | None]:
    """Calls a bound method as long as somebody else holds its object; later calls do nothing, and return None.

    Who makes parts of its own and wants to hear from them hands out this: else the parts hold it, it holds them, and
    neither is freed when nobody holds it any more.
    """
    held: WeakMethod[Callable[P, T]] = WeakMethod(method)

    def call(*args: P.args, **kwargs: P.kwargs) -> T | None:
        found = held()
        return None if found is None else found(*args, **kwargs)

    return call


@contextmanager
def importing() -> Iterator[None]:
    """Lets modules be imported without looks of the collector: all that they make stays, and each look goes through
    all of it. That is a sixth of what importing the server takes. What was made is set aside."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        if enabled:
            gc.enable()


class Collector:
    """Python's collector as a server wants it: no look takes long, except when nobody waits.

    What a look at all that is new leaves is set aside, and not looked at again before ``tend`` finds time.
    """

    def __init__(
        self, busy: Callable[[], float] = time.process_time, now: Callable[[], float] = time.monotonic
    ) -> None:
        """``busy``: seconds of processor time that the process took so far."""
        self._busy, self._now = busy, now
        self._looks = 0
        self._tended, self._was_busy = now(), busy()
        self._calm_since = self._tended
        self._before = gc.get_threshold()

    def begin(self) -> None:
        """Sets aside all that is there: modules and compiled code are never looked at again, but by ``tend``."""
        gc.collect()
        gc.freeze()
        gc.set_threshold(NEW_OBJECTS, *LOOKS)
        gc.callbacks.append(self._looked)

    def end(self) -> None:
        """Leaves the collector to itself again."""
        gc.callbacks.remove(self._looked)
        gc.set_threshold(*self._before)
        gc.unfreeze()

    def _looked(self, phase: str, info: dict[str, int]) -> None:
        if phase == "stop" and info["generation"] == 2:
            self._looks += 1
            gc.freeze()

    def tend(self) -> bool:
        """Goes through everything where that is due and the process has had little to do for ``CALM_SECONDS``. It is
        called more often than that, and had little to do between two calls or not. Returns whether it did."""
        now, busy = self._now(), self._busy()
        if busy - self._was_busy >= CALM * (now - self._tended):
            self._calm_since = now
        self._tended, self._was_busy = now, busy
        if self._looks < (DUE if now - self._calm_since >= CALM_SECONDS else OVERDUE):
            return False
        gc.unfreeze()
        gc.collect()
        self._looks = 0
        return True
