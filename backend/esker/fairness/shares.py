"""Fair shares of what a server has only so much of: places that are held, rates, turns (decision 33).

Whatever strangers can take (seats, history rooms, imports, exports, connections, threads) has a sum over the server
and a share by who asks. Who asks is told by the address and by the link, never by an id that a client chooses. An IPv6
address counts as its /64, which is what one household has, and as its /48 more loosely. Pure: no I/O; times come in.

    seats = Places(Share(total=8, address=3, network=6, link=2))
    place = seats.take(Who("192.0.2.7", link="abc"))   # raises Full
    place.release()
"""

from __future__ import annotations

from collections import Counter, OrderedDict, deque
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from ipaddress import IPv6Address, ip_address
from types import TracebackType
from typing import Final, Generic, Self, TypeVar

T = TypeVar("T")

VIEWER, EDITOR, OWNER = 0, 1, 2
"""Ranks of who asks for a place in one terrain. Of the server's own things everybody has rank 0: whoever makes a
terrain is an owner."""
RANK: Final[dict[str, int]] = {"view": 0, "edit": 1, "owner": 2}
SITE_BITS: Final = 48
HOME_BITS: Final = 64
MOST_KEYS: Final = 20_000


@lru_cache(4096)
def homes(address: str) -> tuple[str, str]:
    """Returns what an address counts as: the narrow key (IPv4: itself; IPv6: its /64) and the loose one (its /48).

    An IPv4 address written as IPv6 is the IPv4 address. What is no address counts as itself.
    """
    try:
        parsed = ip_address(address.partition("%")[0])
    except ValueError:
        return address, address
    if isinstance(parsed, IPv6Address):
        if parsed.ipv4_mapped is None:
            return _cut(parsed, HOME_BITS), _cut(parsed, SITE_BITS)
        parsed = parsed.ipv4_mapped
    return str(parsed), str(parsed)


def _cut(address: IPv6Address, bits: int) -> str:
    return f"{IPv6Address(int(address) >> (128 - bits) << (128 - bits))}/{bits}"


@dataclass(frozen=True)
class Who:
    """Who asks. ``link``: the id of the link that opened the terrain, empty for who has none; ``rank``: what the link
    allows in the terrain whose places are asked for."""

    address: str
    link: str = ""
    rank: int = 0

    @property
    def home(self) -> str:
        """The narrow key of the address."""
        return homes(self.address)[0]

    @property
    def site(self) -> str:
        """The loose key of the address."""
        return homes(self.address)[1]

    def counted(self) -> Iterator[tuple[str, str]]:
        """Yields what is counted: kind and key, the narrowest first."""
        if self.link:
            yield "link", self.link
        home, site = homes(self.address)
        yield "address", home
        if site != home:
            yield "network", site


@dataclass(frozen=True)
class Share:
    """How many places there are, and the most of one address, of one IPv6 /48, of one link (None: no bound of its own).

    ``reserve``: places that are left free to ranks above 0, and of these to ranks above 1. Ranks above 0 are bounded by
    the total alone: a class that draws sits behind one address, and what viewers there hold never keeps it out.
    """

    total: int
    address: int | None = None
    network: int | None = None
    link: int | None = None
    reserve: tuple[int, int] = (0, 0)

    def most(self, kind: str) -> int:
        """The most places of one key of this kind."""
        bound = {"address": self.address, "network": self.network, "link": self.link}[kind]
        return self.total if bound is None else min(bound, self.total)

    def left_free(self, rank: int) -> int:
        """Places that this rank may not take."""
        return 0 if rank == OWNER else self.reserve[rank]


class Full(Exception):
    """There is no place. ``kind``: what is used up: "total", or the share of an "address", a "network" or a "link"."""

    def __init__(self, kind: str) -> None:
        super().__init__(kind)
        self.kind = kind

    @property
    def yours(self) -> bool:
        """Whether it is the share of who asked, and not all there is."""
        return self.kind != "total"


class Place:
    """A place that is held until ``release``; also a context manager. Releasing twice is harmless."""

    def __init__(self, places: Places, who: Who) -> None:
        self.who = who
        self._places: Places | None = places

    @property
    def held(self) -> bool:
        """Whether it is still held."""
        return self._places is not None

    def touch(self) -> None:
        """Says that it is in use: of several the one that was in use longest ago goes first."""
        if self._places is not None:
            self._places._touch(self)

    def release(self) -> None:
        """Gives it back."""
        places, self._places = self._places, None
        if places is not None:
            places._give_back(self)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.release()


class Places:
    """A bounded number of places and who holds them."""

    def __init__(self, share: Share) -> None:
        self.share = share
        self._held: OrderedDict[Place, None] = OrderedDict()
        """Longest unused first."""
        self._counts: Counter[tuple[str, str]] = Counter()

    def __len__(self) -> int:
        return len(self._held)

    def __iter__(self) -> Iterator[Place]:
        return iter(tuple(self._held))

    def refusal(self, who: Who) -> str | None:
        """Returns what stands against a place for ``who``: "total", "address", "network", "link"; None when there is
        one."""
        if len(self) >= self.share.total - self.share.left_free(who.rank):
            return "total"
        if who.rank == VIEWER:
            for kind, key in who.counted():
                if self.of(kind, key) >= self.share.most(kind):
                    return kind
        return None

    def take(self, who: Who) -> Place:
        """A place for ``who``. Raises Full."""
        against = self.refusal(who)
        if against is not None:
            raise Full(against)
        place = Place(self, who)
        self._held[place] = None
        if who.rank == VIEWER:
            self._counts.update(who.counted())
        return place

    def of(self, kind: str, key: str) -> int:
        """Places of rank 0 held by one key."""
        return self._counts[kind, key]

    def yielding(self, who: Who) -> Place | None:
        """The place that should be given up for ``who`` when all are taken: the longest unused one of the site that has
        the most, if that has at least two more than the site of who asks. None when the shares are even."""
        loads: Counter[str] = Counter(place.who.site for place in self._held)
        if not loads:
            return None
        site, most = max(loads.items(), key=lambda item: item[1])
        if most < loads[who.site] + 2:
            return None
        return next(place for place in self._held if place.who.site == site)

    def _touch(self, place: Place) -> None:
        self._held.move_to_end(place)

    def _give_back(self, place: Place) -> None:
        del self._held[place]
        if place.who.rank == VIEWER:
            for key in place.who.counted():
                self._counts[key] -= 1
                if not self._counts[key]:
                    del self._counts[key]


@dataclass(frozen=True)
class Rate:
    """A rate: tokens a second, and tokens that can be saved up."""

    per_second: float
    burst: float


class Rates:
    """Token buckets of the whole server, of each address, each /48 and each link. A bucket starts full.

    When too many keys are known, the ones that were used longest ago are forgotten.
    """

    def __init__(
        self,
        address: Rate | None = None,
        *,
        network: Rate | None = None,
        link: Rate | None = None,
        total: Rate | None = None,
        most_keys: int = MOST_KEYS,
    ) -> None:
        """A rate that is None does not bound. ``network`` is by default four times that of an address."""
        if network is None and address is not None:
            network = Rate(4 * address.per_second, 4 * address.burst)
        self._rates = {"address": address, "network": network, "link": link, "total": total}
        self._most = most_keys
        self._buckets: OrderedDict[tuple[str, str], tuple[float, float]] = OrderedDict()
        """Tokens and the time they were counted."""

    def take(self, who: Who, now: float, n: float = 1.0) -> bool:
        """Takes ``n`` tokens at time ``now`` (seconds) from every bucket of ``who``, or from none of them: False."""
        found = self._tokens(who, now)
        if any(tokens < n for tokens in found.values()):
            return False
        for key, tokens in found.items():
            self._buckets[key] = (tokens - n, now)
            self._buckets.move_to_end(key)
        while len(self._buckets) > self._most:
            self._forget()
        return True

    def has(self, who: Who, now: float, n: float = 1.0) -> bool:
        """Returns whether ``take`` would, without taking."""
        return all(tokens >= n for tokens in self._tokens(who, now).values())

    def _tokens(self, who: Who, now: float) -> dict[tuple[str, str], float]:
        found = {}
        for key in (*who.counted(), ("total", "")):
            rate = self._rates[key[0]]
            if rate is not None:
                tokens, at = self._buckets.get(key, (rate.burst, now))
                found[key] = min(rate.burst, tokens + max(0.0, now - at) * rate.per_second)
        return found

    def _forget(self) -> None:
        oldest = next(key for key in self._buckets if key[0] != "total")
        del self._buckets[oldest]


class Line(Generic[T]):
    """Who waits for a turn: one line for each key, served one after another, at most ``each`` of a key at a time.

    However many one key has waiting, another key's first is served after at most one of each.
    """

    def __init__(self, most: int, each: int | None = None, waiting: int | None = None) -> None:
        """``most``: turns at a time; ``each``: of one key; ``waiting``: the most of one key that may wait."""
        self._most, self._each, self._waiting = most, most if each is None else each, waiting
        self._lines: OrderedDict[str, deque[T]] = OrderedDict()
        self._running: Counter[str] = Counter()

    def __len__(self) -> int:
        return sum(map(len, self._lines.values()))

    @property
    def running(self) -> int:
        """Turns that are being used."""
        return self._running.total()

    def join(self, key: str, item: T) -> None:
        """Waits. Raises Full ("address") when so many of this key wait already."""
        line = self._lines.get(key, deque())
        if self._waiting is not None and len(line) >= self._waiting:
            raise Full("address")
        line.append(item)
        self._lines[key] = line

    def leave(self, key: str, item: T) -> bool:
        """Waits no longer; False when it does not wait (any more)."""
        line = self._lines.get(key)
        if line is None or item not in line:
            return False
        line.remove(item)
        if not line:
            del self._lines[key]
        return True

    def next(self) -> T | None:
        """Returns who has a turn now, None when nobody does; ``done`` ends it."""
        if self.running >= self._most:
            return None
        for key, line in self._lines.items():
            if self._running[key] < self._each:
                item = line.popleft()
                self._running[key] += 1
                self._lines.move_to_end(key)
                if not line:
                    del self._lines[key]
                return item
        return None

    def done(self, key: str) -> None:
        """A turn of this key is over."""
        self._running[key] -= 1
        if self._running[key] <= 0:
            del self._running[key]
