"""When the rivers of a room are looked for: while somebody draws a few times a second, at rest once, exactly.

They follow the ground at the lowest priority: the ground is read when the tile thread has nothing else to do, the
search runs in a thread of low priority, and frames of rivers go out when a client has all tiles that it is to have.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Hashable
from concurrent.futures import Future
from dataclasses import dataclass, replace
from typing import Any, Final, Protocol

from esker.document.layers import span_m
from esker.document.ops import StrokeSet
from esker.fairness.rounds import Rounds
from esker.session.ground.ports import Hydrology

log = logging.getLogger("esker.rivers")

PREVIEW_LEVEL: Final = 2
"""The level whose samples count while somebody draws."""
REST_LEVEL: Final = 4
"""The level whose samples count at rest, or the finest that is solved as a whole."""
EVERY_SECONDS: Final = 0.25
"""While somebody draws they are looked for at most this often."""
SHARE: Final = 5
"""Searches while somebody draws take one part of so many of the time, those of all rooms together."""
REST_SECONDS: Final = 0.6
"""Ground that has been final for so long is at rest: small terrains settle between two strokes."""
REST_SHARE: Final = 10
"""Searches at rest, a second each, take one part of so many of the time in which anybody on the server draws."""
GATE_SECONDS: Final = 0.1
"""Whoever stands in line looks so often whether it is the turn."""
QUIET_SECONDS: Final = 2.0
"""After so long without a search for somebody who draws nobody draws."""
FOLLOWED: Final = ("rivers", "sea_level_m", "seed", "look", "detail", "rule", "place")
"""Settings that rivers follow from beside the ground. Width follows from ``wetness`` where they are drawn."""


class Ground(Protocol):
    """Where the ground is read and frames are sent (``ground.frames.feed.TileFeed``)."""

    def snapshot(self, level: int, taken: Callable[[Any], None]) -> None:
        """Reads the ground once the tile thread has nothing else to do; ``taken`` is called in the loop, with None
        where there is none."""
        ...

    def show_rivers(self, frame: bytes | None) -> None:
        """Sends a frame to everybody, and to who comes; None: to nobody."""
        ...


@dataclass(frozen=True)
class Look:
    """What is to be looked for: on which level, and whether the ground is at rest."""

    level: int
    settled: bool


@dataclass(frozen=True)
class Wanted:
    """What is still to be looked for. ``preview``: on PREVIEW_LEVEL; ``rest_at``: from when on at rest, None: not."""

    preview: bool = False
    rest_at: float | None = None


@dataclass(frozen=True)
class _Place:
    """A room's place in the line: the address that it searches for, and when it comes back to ask."""

    home: Hashable
    due: float


class Gate:
    """Lets the searches of all rooms of a server through one after another, with a pause behind each that is as long as
    the search times ``share`` less one, and ``most`` seconds at most. Homes (addresses) have turns, and of the rooms of
    a home the one that has waited longest is next: however many rooms one home has, another home's room waits for one
    search of it. A room without a home is its own. Call it from the event loop's thread."""

    def __init__(self, share: int, most: float = float("inf")) -> None:
        self._share, self._most = share, most
        self._line: dict[object, _Place] = {}
        """Who waits, whoever came first at the front."""
        self._rounds = Rounds()
        self._inside: object = None
        self._since = 0.0
        self._until = float("-inf")

    def wait(self, who: object, home: Hashable, now: float, pause_until: float = float("inf")) -> float:
        """Returns 0 where a room may begin, which ``enter`` says then; else for how many seconds it has to wait at
        least. It stands in line from now on. ``pause_until``: when the pause ends however long it is."""
        left = min(self._until, pause_until) - now
        self._line[who] = _Place(who if home is None else home, now)
        if self._inside is not None or left > 0:
            wait = GATE_SECONDS if self._inside is not None else left
        else:
            wait = 0.0 if self._next(now) is who else GATE_SECONDS
        self._line[who] = replace(self._line[who], due=now + wait)
        return wait

    def _next(self, now: float) -> object:
        """Returns whose turn it is of those in line. Who did not come back wants nothing any more and is forgotten."""
        self._line = {who: place for who, place in self._line.items() if place.due >= now - GATE_SECONDS}
        return min(self._line, key=lambda who: self._rounds.last(self._line[who].home))

    def enter(self, who: object, home: Hashable, now: float) -> None:
        """A room begins: this is its home's turn."""
        self._line.pop(who, None)
        self._rounds.took(who if home is None else home)
        self._inside, self._since = who, now

    def leave(self, who: object, now: float) -> None:
        """A room has ended, or waits no more."""
        self._line.pop(who, None)
        if self._inside is who:
            self._inside, self._until = None, now + min((now - self._since) * (self._share - 1), self._most)


class Pace:
    """How often rivers are looked for on a server: while somebody draws, and at rest."""

    def __init__(self) -> None:
        self.previews, self.rests = Gate(SHARE, QUIET_SECONDS / 2), Gate(REST_SHARE)
        self._drawn = float("-inf")

    def wait(self, who: object, home: Hashable, look: Look, now: float) -> float:
        """See ``Gate.wait``. Where nobody draws, searches at rest follow each other without a pause."""
        if look.settled:
            return self.rests.wait(who, home, now, self._drawn + QUIET_SECONDS)
        self._drawn = now  # who waits for a search draws, too
        return self.previews.wait(who, home, now)

    def enter(self, who: object, home: Hashable, look: Look, now: float) -> None:
        """A search begins."""
        if look.settled:
            self.rests.enter(who, home, now)
        else:
            self._drawn = now
            self.previews.enter(who, home, now)

    def leave(self, who: object, now: float) -> None:
        """A search has ended, or none is to be made."""
        self.rests.leave(who, now)
        self.previews.leave(who, now)


def next_look(wanted: Wanted, busy: bool, now: float, last: float) -> tuple[Look | None, float | None]:
    """What to look for now, if anything; and else for how long to wait, None: until something happens.

    ``last``: when a search began last. Rest comes after the previews of what led to it.
    """
    if busy:
        return None, None
    if wanted.preview:
        wait = last + EVERY_SECONDS - now
        return (Look(PREVIEW_LEVEL, False), None) if wait <= 0 else (None, wait)
    if wanted.rest_at is None:
        return None, None
    wait = wanted.rest_at - now
    return (Look(REST_LEVEL, True), None) if wait <= 0 else (None, wait)


class Rivers:
    """The rivers of one room. Call it from the event loop's thread."""

    def __init__(self, hydrology: Hydrology | None, ground: Ground, loop: asyncio.AbstractEventLoop) -> None:
        """Without ``hydrology`` there are none."""
        self._hydrology, self._ground, self._loop = hydrology, ground, loop
        self._lane = None if hydrology is None else hydrology.lane()
        self._document: StrokeSet | None = None
        self._followed: tuple[object, ...] = ()
        self._wanted = Wanted()
        self._settled = False
        self._busy = self._closed = self._overtaken = False
        self._last = float("-inf")
        self._timer: asyncio.TimerHandle | None = None

    def works_for(self, home: str) -> None:
        """From now on searches count for this address."""
        if self._lane is not None:
            self._lane.home = home or None

    def _home(self) -> Hashable:
        return None if self._lane is None else self._lane.home

    def follow(self, document: StrokeSet) -> None:
        """The document has changed; where a setting of the rivers did, they are looked for anew."""
        self._document = document
        followed = tuple(getattr(document.settings, name) for name in FOLLOWED)
        if followed == self._followed:
            return
        before, self._followed = self._followed, followed
        if document.settings.rivers == 0:
            self._wanted = Wanted()
            if before and before[0]:
                self._ground.show_rivers(None)
        else:
            self._look_for(self._settled)

    def level_taken(self, level: int, settled: bool) -> None:
        """A level became tiles. ``settled``: now all of them are final."""
        self._settled = settled
        if self._document is None or self._document.settings.rivers == 0:
            return
        self._overtaken = not settled
        if settled or level == PREVIEW_LEVEL:
            self._look_for(settled)
        else:
            self._wanted = replace(self._wanted, rest_at=None)

    def _look_for(self, settled: bool) -> None:
        """On the coarse level soon, and, where the ground is final, on the finer one when it has rested."""
        self._wanted = Wanted(True, self._loop.time() + REST_SECONDS if settled else None)
        self._go_on()

    def close(self) -> None:
        """Looks for no more."""
        self._closed = True
        self._ended()
        if self._timer is not None:
            self._timer.cancel()

    def _go_on(self) -> None:
        if self._hydrology is None or self._closed:
            return
        now, pace = self._loop.time(), self._hydrology.pace
        look, wait = next_look(self._wanted, self._busy, now, self._last)
        if look is not None and (later := pace.wait(self, self._home(), look, now)) > 0:
            look, wait = None, later
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if look is not None:
            self._wanted = Wanted() if look.settled else replace(self._wanted, preview=False)
            self._busy, self._last, self._overtaken = True, now, False
            pace.enter(self, self._home(), look, now)
            self._ground.snapshot(look.level, lambda found: self._read(found, look.settled))
        elif wait is not None:
            self._timer = self._loop.call_later(wait, self._go_on)

    def _read(self, found: Any, settled: bool) -> None:
        document = self._document
        hydrology, lane = None if self._closed else self._hydrology, self._lane
        if found is None or document is None or hydrology is None or lane is None or not document.settings.rivers:
            self._ended()
            self._go_on()
            return
        try:
            span = span_m(tuple(document.layers.values()))
            # A search at rest takes a second: it ends where people go on drawing. Previews are short, and are shown.
            future = hydrology.find(
                lane,
                found,
                document.settings,
                span,
                settled,
                lambda: not self._closed and not (settled and self._overtaken),
            )
        except RuntimeError:  # the server is stopping
            self._ended()
            return
        future.add_done_callback(lambda done: self._call(self._found, done))

    def _call(self, callback: Callable[..., object], *args: object) -> None:
        if not self._loop.is_closed():
            self._loop.call_soon_threadsafe(callback, *args)

    def _ended(self) -> None:
        """No search is on its way any more."""
        if self._hydrology is not None:
            self._hydrology.pace.leave(self, self._loop.time())
        self._busy = False

    def _found(self, future: Future[bytes | None]) -> None:
        self._ended()
        if future.cancelled() or self._closed:
            return
        error = future.exception()
        if error is not None:
            log.error("rivers could not be found: %s: %s", type(error).__name__, error)
        elif self._document is not None and self._document.settings.rivers:
            frame = future.result()
            if frame is not None:
                self._ground.show_rivers(frame)
        self._go_on()
