"""Laps of an event loop: in each it does what has come by then. Forty connections that are read in one lap hold up
whoever comes in the next, so those of an address share a part of each, and wait in line for it."""

from __future__ import annotations

import asyncio
import math
import time
from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Final

LAP_SECONDS: Final = 0.003
"""Seconds that the connections of one address have in one lap, whose end others wait for. Those that take little each
time have them of processor time; for the rest it counts as well how long others wait (``WAITED``)."""
WAITED: Final = 0.5
"""Beside threads that compute a lap takes several times its processor time. A second for which others wait counts like
so many of processor time; not whole, as sixty people who draw faster than the processors follow would be read less."""
LAP_REST: Final = 0.006
"""After that they rest for so long, in which threads have what the loop leaves. Connections that take little each time
only wait for the next lap: thirty people who draw behind one address are a quarter of a core."""
SHARED_LAP_SECONDS, SHARED_LAP_REST = 0.0015, 0.009
"""What takes the place of these two for connections that take much, where another address took something of late: an
operation of somebody there passes three or four laps on its way to its acknowledgement."""
OF_LATE: Final = 2.0
"""Seconds for which an address counts as being there."""
SMALL_LAPS: Final = 1.5
"""One that takes little each time has a turn until those of its address have taken so many times ``LAP_SECONDS``."""


class Laps:
    """Numbers the laps of the event loop that runs, and knows which addresses took something of them last."""

    def __init__(self) -> None:
        self._number = 0
        self._loop: asyncio.AbstractEventLoop | None = None
        """The loop that counts the present lap's end."""
        self._here = ("", -math.inf), ("", -math.inf)
        """The two addresses that took something last, the later one first, and when."""

    def taken(self, home: str) -> None:
        """Notes that an address took something just now."""
        last, before = self._here
        now = time.monotonic()
        self._here = (home, now), (before if last[0] == home else last)

    def is_shared(self, home: str) -> bool:
        """Whether another address took something of late."""
        last, before = self._here
        other = before if last[0] == home else last
        return time.monotonic() - other[1] < OF_LATE

    def now(self) -> int:
        """Returns the number of the present lap, which is greater in the next."""
        loop = asyncio.get_running_loop()
        if self._loop is not loop:
            self._loop = loop
            loop.call_soon(self._end)
        return self._number

    def _end(self) -> None:
        self._number += 1
        self._loop = None


class Waiting:
    """Somebody who waits in line."""

    __slots__ = ("call",)

    def __init__(self, call: Callable[[], None]) -> None:
        self.call: Callable[[], None] | None = call

    def cancel(self) -> None:
        """Waits no more."""
        self.call = None


class _Taken:
    """Seconds that were taken of the present lap."""

    __slots__ = ("_lap", "_laps", "_seconds")

    def __init__(self, laps: Laps) -> None:
        self._laps, self._lap, self._seconds = laps, -1, 0.0

    @property
    def seconds(self) -> float:
        lap = self._laps.now()
        if lap != self._lap:
            self._lap, self._seconds = lap, 0.0
        return self._seconds

    def take(self, seconds: float) -> None:
        self._seconds = self.seconds + seconds


class LapShare:
    """What the connections of one address take of each lap. Lives in an event loop."""

    __slots__ = ("_held", "_home", "_laps", "_others", "_small", "_taken")

    def __init__(self, laps: Laps, home: str = "") -> None:
        """``home``: the address, as ``shares.Who.home`` names it."""
        self._laps, self._home = laps, home
        self._taken, self._held = _Taken(laps), _Taken(laps)
        self._small = _Line(self._taken, lambda: (LAP_SECONDS * SMALL_LAPS, 0.0))
        self._others = _Line(self._held, partial(_limits, laps, home))

    def left(self, is_small: bool) -> float:
        """Returns the seconds of this lap that they still have. ``is_small``: for one that takes little each time."""
        line = self._line(is_small)
        return 0.0 if line.is_waiting else line.left()

    def take(self, seconds: float, held: float = 0.0) -> None:
        """Notes that one of them took so many seconds of processor time just now, and held the loop up for ``held``."""
        self._laps.taken(self._home)
        self._taken.take(seconds)
        self._held.take(max(seconds, WAITED * held))

    def wait(self, is_small: bool, call: Callable[[], None]) -> Waiting:
        """Calls ``call`` in a later lap, after those who wait already."""
        return self._line(is_small).join(call)

    def _line(self, is_small: bool) -> _Line:
        return self._small if is_small else self._others


def _limits(laps: Laps, home: str) -> tuple[float, float]:
    return (SHARED_LAP_SECONDS, SHARED_LAP_REST) if laps.is_shared(home) else (LAP_SECONDS, LAP_REST)


class _Line:
    """Those who wait for a lap of which less is taken than they may have."""

    __slots__ = ("_is_serving", "_limits", "_taken", "_waiting")

    def __init__(self, taken: _Taken, limits: Callable[[], tuple[float, float]]) -> None:
        """``limits``: the seconds that they may have of a lap, and those after which another lap is looked at."""
        self._taken, self._limits = taken, limits
        self._waiting: deque[Waiting] = deque()
        self._is_serving = False

    @property
    def is_waiting(self) -> bool:
        """Whether who comes now has to wait for others."""
        return bool(self._waiting) and not self._is_serving

    def left(self) -> float:
        """Returns the seconds of this lap that are left."""
        return max(0.0, self._limits()[0] - self._taken.seconds)

    def join(self, call: Callable[[], None]) -> Waiting:
        """Waits at the end of the line."""
        waiting = Waiting(call)
        self._waiting.append(waiting)
        if len(self._waiting) == 1 and not self._is_serving:
            self._again()
        return waiting

    def _again(self) -> None:
        loop = asyncio.get_running_loop()
        rest = self._limits()[1]
        if rest > 0:
            loop.call_later(rest, self._serve)
        else:
            loop.call_soon(self._serve)

    def _serve(self) -> None:
        self._is_serving = True
        try:
            while self._waiting and self.left() > 0:
                call = self._waiting.popleft().call
                if call is not None:
                    call()
        finally:
            self._is_serving = False
            if self._waiting:
                self._again()
