"""What connections and requests may take of the event loop's processor time (decisions 31, 45). Times come in; laps
of the event loop are counted (``fairness/laps.py``).

Every connection has a purse that fills at a rate, and pays what its bytes cost before and after they are read. The
connections of one address, and of one IPv6 /48, pay into shared purses as well: when one of those is empty, the
connections that have spent much of their own end, and those beside them that have not go on. Requests of HTTP are paid
by their address alone, and wait where it cannot (``server/wire/pacing.py``).
"""

from __future__ import annotations

import asyncio
import math
from collections import OrderedDict
from collections.abc import Callable
from contextvars import ContextVar
from dataclasses import dataclass
from functools import partial
from typing import Final, TypeVar

from esker.fairness.laps import Laps, LapShare, Waiting
from esker.fairness.shares import MOST_KEYS, Rate, Who

K = TypeVar("K")
V = TypeVar("V")

STRANGER: Final = Rate(0.02, 0.1)
"""Processor time of a connection that has not been let in: seconds a second, and seconds that may be saved up."""
MEMBER: Final = Rate(0.2, 1.0)
"""Processor time of a connection that was let in. Somebody who draws without a pause takes a hundredth of a core."""
STRANGERS: Final = Rate(0.1, 0.5)
"""Processor time of all connections of one address together that were not let in."""
MEMBERS: Final = Rate(0.6, 3.0)
"""Processor time of all connections of one address together that were let in."""
ASKERS: Final = Rate(0.25, 3.0)
"""Processor time of all requests of one address: thirty people behind one who open the page at once take a second."""
MUCH: Final = 0.85
"""An address that has less than this share of its purse left is served at ``PACE``, its requests one after another; and
a connection that has less of its own is read with longer rests."""
STRAINED_REST: Final = 4.0
"""A connection that has less than ``MUCH`` of its own purse left rests so many times as long as it takes."""
STRAINED_PRICE: Final = 2.0
"""It pays for a part of these rests too, else its purse would fill up as fast and it would never end."""
PACE: Final = Rate(0.2, 0.0)
"""Processor time of the requests of one address that has asked for much, and of its connections together where they
have taken much: a rest follows each, in which others have their turns."""
SHARED_PACE: Final = Rate(0.08, 0.0)
"""What takes its place for requests where people of another address are there: an acknowledgement waits for whatever
the loop has begun on its way in and out."""
LONGEST_REST: Final = 5.0
"""A connection rests no longer than this, however much its address has to make up for."""
CALM_REST, CALM_SECONDS = 20.0, 0.001
"""A connection that has taken little itself, and takes no more than ``CALM_SECONDS`` at once, rests no longer than
``CALM_REST`` times that, beside those of its address that have taken much: what somebody draws comes a moment later,
and not when the others have paid."""
USUAL_SECONDS: Final = 0.001
"""What a request costs before anything is known of those of its address, and what reading a connection does."""
NETWORK: Final = 3.0
"""An IPv6 /48 has so many times the processor time of an address."""
BYTE_SECONDS: Final = 1e-8
"""Seconds that a byte costs before anybody looks at it."""
DOUBT: Final = 0.5
"""A connection that has less than this share of its own purse left pays where its address's purse is empty."""


PAYS: ContextVar[Callable[[float], None] | None] = ContextVar("PAYS", default=None)
"""Who pays for what is done for the present request in other threads: a function of seconds, called in the loop."""


class Purse:
    """Seconds that may be spent. It may be overdrawn, as what something costs is known afterwards."""

    __slots__ = ("_at", "left", "rate")

    def __init__(self, rate: Rate) -> None:
        self.rate, self._at, self.left = rate, math.inf, rate.burst

    def pay(self, now: float, seconds: float) -> bool:
        """Takes ``seconds`` out at time ``now``; False when that is more than there was."""
        self.left = min(self.rate.burst, self.left + max(0.0, now - self._at) * self.rate.per_second) - seconds
        self._at = now
        return self.left >= 0

    @property
    def debt(self) -> float:
        """Seconds from the last payment until it is no longer overdrawn."""
        return max(0.0, -self.left / self.rate.per_second)

    @property
    def share(self) -> float:
        """Share of the purse that is left, at most 1."""
        return self.left / self.rate.burst


class Pace:
    """The pace at which requests of one address follow each other.

    What a request costs is known when it is done, and many may be asked at once: each is counted as usual ones cost
    when it begins, so that the next waits for it.
    """

    __slots__ = ("_is_shared", "_purse", "_usual")

    def __init__(self, is_shared: Callable[[], bool] = lambda: False) -> None:
        """``is_shared``: whether people of other addresses are there."""
        self._purse, self._usual, self._is_shared = Purse(PACE), USUAL_SECONDS, is_shared

    def begin(self, now: float) -> tuple[float, float]:
        """Counts a request. Returns the seconds that it waits for those before it, and what it was counted as."""
        self._purse.pay(now, 0.0)
        self._purse.rate = SHARED_PACE if self._is_shared() else PACE
        wait, counted = self._purse.debt, self._usual
        self._purse.pay(now, counted)
        return wait, counted

    def end(self, now: float, counted: float, seconds: float) -> None:
        """Corrects what a request was counted as by what it took."""
        self._usual += (seconds - self._usual) / 8
        self._purse.pay(now, seconds - counted)


@dataclass(frozen=True)
class _Kind:
    own: Rate
    shared: Rate


_STRANGER, _MEMBER, _ASKER = _Kind(STRANGER, STRANGERS), _Kind(MEMBER, MEMBERS), _Kind(ASKERS, ASKERS)


class Crowd:
    """The connections of one address: their share of each lap, and the pace at which they are read where they have
    taken much."""

    __slots__ = ("lap", "pace")

    def __init__(self, laps: Laps, home: str = "") -> None:
        self.lap, self.pace = LapShare(laps, home), Purse(PACE)


class Account:
    """The purse of one connection, with those that it shares."""

    def __init__(self, shared: tuple[Purse, ...] = (), kind: _Kind = _STRANGER, crowd: Crowd | None = None) -> None:
        """``crowd``: the connections of its address (default: it is the only one)."""
        self._own, self._shared, self._crowd = Purse(kind.own), shared, crowd or Crowd(Laps())
        self._usual = USUAL_SECONDS
        """What reading it takes of late."""

    def left(self) -> float:
        """Returns the seconds for which it may be read in this lap of the event loop, 0 where it has to wait in line.
        Called in an event loop, as is what follows."""
        return self._crowd.lap.left(self.is_small)

    def wait(self, call: Callable[[], None]) -> Waiting:
        """Calls ``call`` when it may be read, in a later lap."""
        return self._crowd.lap.wait(self.is_small, call)

    async def turn(self) -> None:
        """Waits until it may be read."""
        if self.left() > 0:
            return
        begun = asyncio.get_running_loop().create_future()

        def begin() -> None:  # it goes on a lap later: as much of this one is kept free
            if not begun.done():  # whoever waited was cancelled in this lap, and hears of that in the next
                self._crowd.lap.take(self._usual)
                begun.set_result(None)

        waiting = self.wait(begin)
        try:
            await begun
        finally:
            waiting.cancel()

    def took(self, seconds: float, held: float) -> None:
        """Notes what reading it took, for those of its address that come after it: processor time, and for how long
        others waited."""
        self._crowd.lap.take(seconds, held)
        self._usual = max(seconds, self._usual + (seconds - self._usual) / 8)

    @property
    def is_small(self) -> bool:
        """Whether it takes little each time: its turns end by its processor time. Others' end by the time for which
        everybody waits, which is longer beside threads that compute: many of one address would hold up a lap."""
        return self._own.share >= MUCH and self._usual <= CALM_SECONDS

    @property
    def is_strained(self) -> bool:
        """Whether the connection has taken more than people's drawing does, or those of its address together have,
        though not so much that it has to end."""
        return self._own.share < MUCH or self._is_crowded

    @property
    def _is_crowded(self) -> bool:
        return any(purse.share < MUCH for purse in self._shared)

    def price(self, seconds: float) -> float:
        """Returns what the connection has to pay for so many seconds."""
        return seconds * STRAINED_PRICE if self._own.share < MUCH else seconds

    def rest(self, now: float, seconds: float) -> float:
        """Returns for how long the connection rests after it took so many seconds."""
        is_calm = self._own.share >= MUCH
        rest = seconds if is_calm else seconds * STRAINED_REST
        if self._is_crowded:
            self._crowd.pace.pay(now, seconds)
            is_small = is_calm and seconds <= CALM_SECONDS
            rest = max(rest, min(self._crowd.pace.debt, seconds * CALM_REST if is_small else LONGEST_REST))
        return rest

    def pay(self, now: float, seconds: float) -> bool:
        """Pays; False when the connection has to end."""
        going_on = self._own.pay(now, seconds)
        for purse in self._shared:
            if not purse.pay(now, seconds) and self._own.share < DOUBT:
                going_on = False
        return going_on


class Accounts:
    """The shared purses of a server. When too many are known, those that were used longest ago are forgotten."""

    def __init__(self, most_keys: int = MOST_KEYS, laps: Laps | None = None) -> None:
        """``laps``: those of the event loop, where others have accounts of it too (default: nobody has)."""
        self._purses: OrderedDict[tuple[str, str, _Kind], Purse] = OrderedDict()
        self._paces: OrderedDict[str, Pace] = OrderedDict()
        self._crowds: OrderedDict[str, Crowd] = OrderedDict()
        self._laps = laps or Laps()
        self._most = most_keys

    def stranger(self, address: str) -> Account:
        """Opens the account of a connection that has said nothing yet."""
        return self._open(address, _STRANGER)

    def member(self, address: str) -> Account:
        """Opens the account of a connection that was let in."""
        return self._open(address, _MEMBER)

    def asker(self, address: str) -> tuple[Purse, ...]:
        """Returns the purses out of which a request of this address is paid."""
        return tuple(self._purse(place, key, _ASKER) for place, key in Who(address).counted())

    def pace(self, address: str) -> Pace:
        """Returns the pace of the requests of this address."""
        home = Who(address).home
        return self._known(self._paces, home, lambda: Pace(partial(self._laps.is_shared, home)))

    def _open(self, address: str, kind: _Kind) -> Account:
        shared = tuple(self._purse(place, key, kind) for place, key in Who(address).counted())
        home = Who(address).home
        return Account(shared, kind, self._known(self._crowds, home, lambda: Crowd(self._laps, home)))

    def _purse(self, place: str, key: str, kind: _Kind) -> Purse:
        times = NETWORK if place == "network" else 1.0
        rate = Rate(times * kind.shared.per_second, times * kind.shared.burst)
        return self._known(self._purses, (place, key, kind), lambda: Purse(rate))

    def _known(self, known: OrderedDict[K, V], key: K, make: Callable[[], V]) -> V:
        """Returns what is known under a key, which is used last now, or makes it."""
        found = known[key] = known.pop(key) if key in known else make()
        while len(known) > self._most:
            known.popitem(last=False)
        return found
