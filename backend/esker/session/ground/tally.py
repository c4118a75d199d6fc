"""What rooms, and the homes that they belong to, had of the solver's time.

A home is the address that a room's work is done for: of who opened it, then of who draws. Homes that are busy have
about as much time as each other, and so have the rooms of one home among themselves. So whoever opens sixty rooms has
no more than whoever has two: a home with several busy rooms counts as two, since a class sits behind one address. A
room without a home is one by itself. What is done for a room that nobody is in counts several times, for the room and
for its home: a class is collected behind those who draw.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final, Generic, TypeVar

PATIENCE: Final = 0.150
HOME_ROOMS: Final = 2
"""A home with so many busy rooms or more has so many times what a home with one has."""
UNATTENDED_PRICE: Final = 4.0
"""What is done for a room that nobody is in counts so many times: beside somebody who draws it has a fifth."""

Room = TypeVar("Room", bound=Hashable)


@dataclass(frozen=True)
class Time:
    """Time that was used. seconds: how long, when it is compared with that of others that are busy. is_busy: whether
    there was something to do when the tally was last levelled. is_coarsest: whether the last slice was for a coarsest
    preview; coarsest_s: what the last such one took. price: what a second of it counts."""

    seconds: float = 0.0
    is_busy: bool = False
    is_coarsest: bool = False
    coarsest_s: float = 0.0
    price: float = 1.0

    def levelled(self, is_busy: bool, least: float) -> Time:
        """The time of who is busy, or is not: who comes begins with the least of those who were."""
        comes = is_busy and not self.is_busy
        return replace(self, seconds=max(self.seconds, least) if comes else self.seconds, is_busy=is_busy)

    def ended(self, took: float) -> Time:
        """The time after a slice."""
        coarsest_s = took if self.is_coarsest else self.coarsest_s
        return replace(self, seconds=self.seconds + took * self.price, coarsest_s=coarsest_s)


@dataclass(frozen=True)
class Used:
    """Time of the solver that one room had.

    turn: number of its last slice, where slices of all rooms are counted. began: number of the slice at which its solve
    began. ran_at: when it had its last slice, or began to wait. is_spared: its solve has made room for another one
    already, and is not made to a second time. home: for whom its work is done; None: for this room alone. time: is
    compared with that of others of its home.
    """

    turn: int = 0
    began: int = 0
    ran_at: float = 0.0
    is_spared: bool = False
    home: Hashable = None
    time: Time = field(default_factory=Time)


@dataclass(frozen=True)
class Home:
    """Time of the solver that all rooms of one home had.

    time: is compared with that of other homes; least: the least seconds of its rooms that were busy at the last choice.
    turn: number of the last slice of any of its rooms."""

    time: Time = field(default_factory=Time)
    least: float = 0.0
    turn: int = 0


@dataclass(frozen=True)
class Favour(Generic[Room]):
    """The room that was chosen out of turn, and from when on the next one may be."""

    room: Room | None = None
    after: float = -math.inf


@dataclass(frozen=True)
class Tally(Generic[Room]):
    """Time of the solver that all rooms had.

    budget: bytes for their solves. turns: slices so far. least: the least seconds of the homes
    that were busy at the last choice."""

    budget: int
    rooms: Mapping[Room, Used] = field(default_factory=dict)
    homes: Mapping[Hashable, Home] = field(default_factory=dict)
    turns: int = 0
    least: float = 0.0
    favour: Favour[Room] = field(default_factory=Favour)

    def home_of(self, room: Room) -> Hashable:
        """Returns the key of a room's home."""
        home = self.rooms[room].home
        return room if home is None else home

    def noted(self, room: Room, **what: Any) -> Tally[Room]:
        """Returns the tally with something else noted of one room."""
        return replace(self, rooms={**self.rooms, room: replace(self.rooms[room], **what)})

    def served(self, room: Room) -> Tally[Room]:
        """Notes that a room has the present turn."""
        key = self.home_of(room)
        return replace(self, homes={**self.homes, key: replace(self.homes[key], turn=self.turns)})

    def opened(self, room: Room, home: Hashable = None) -> Tally[Room]:
        """Returns the tally with a room that comes."""
        tally = replace(self, rooms={**self.rooms, room: Used(home=home)})
        key = tally.home_of(room)
        return tally if key in tally.homes else replace(tally, homes={**tally.homes, key: Home()})

    def closed(self, room: Room) -> Tally[Room]:
        """Returns the tally without a room that goes; with the last of its rooms a home goes."""
        if room not in self.rooms:
            return self
        key = self.home_of(room)
        tally = replace(self, rooms={other: had for other, had in self.rooms.items() if other != room})
        if any(tally.home_of(other) == key for other in tally.rooms):
            return tally
        return replace(tally, homes={other: had for other, had in tally.homes.items() if other != key})

    def attended(self, room: Room, by_somebody: bool) -> Tally[Room]:
        """Returns the tally from when somebody is in a room on, or nobody."""
        had = self.rooms.get(room)
        price = 1.0 if by_somebody else UNATTENDED_PRICE
        return self if had is None else self.noted(room, time=replace(had.time, price=price))

    def moved(self, room: Room, home: Hashable) -> Tally[Room]:
        """From now on a room's work is done for another home. Among the rooms there it begins as who comes does."""
        had = self.rooms.get(room)
        if had is None or had.home == home:
            return self
        kept = {name: getattr(had, name) for name in ("turn", "began", "ran_at", "is_spared")}
        return self.closed(room).opened(room, home).noted(room, time=Time(price=had.time.price), **kept)

    def ended(self, room: Room, now: float) -> Tally[Room]:
        """Returns the tally after the slice of a room, which waits from now on.

        After a slice out of turn the other rooms have at least as long.
        """
        had = self.rooms.get(room)
        if had is None:
            return self
        took, key = now - had.ran_at, self.home_of(room)
        home = self.homes[key]
        busy = sum(other.time.is_busy and self.home_of(name) == key for name, other in self.rooms.items())
        paid = home.time.seconds + took * had.time.price / min(max(busy, 1), HOME_ROOMS)
        tally = self.noted(room, time=had.time.ended(took), ran_at=now)
        tally = replace(tally, homes={**tally.homes, key: replace(home, time=replace(home.time, seconds=paid))})
        if room is not self.favour.room:
            return tally
        return replace(tally, favour=Favour(room, now + max(PATIENCE, took)))

    def ahead(self, other: Room, room: Room) -> float:
        """Returns how many seconds more one room had than another: its home than the other's, where they differ."""
        mine, its = self.home_of(room), self.home_of(other)
        if mine == its:
            return self.rooms[other].time.seconds - self.rooms[room].time.seconds
        return self.homes[its].time.seconds - self.homes[mine].time.seconds

    def levelled(self, waiting: set[Room]) -> Tally[Room]:
        """Who comes begins with the least time of those who were busy: homes among homes, rooms among those of their
        home. ``waiting``: all who wait for more than refinement, which waits for all."""
        there = {self.home_of(room) for room in waiting}
        busy = [self.homes[key].time.seconds for key in there if self.homes[key].time.is_busy]
        least = max(self.least, min(busy, default=0.0))
        inside: dict[Hashable, float] = {}
        for room in waiting:
            key, time = self.home_of(room), self.rooms[room].time
            if time.is_busy:
                inside[key] = min(inside.get(key, math.inf), time.seconds)
        within = {key: max(home.least, inside.get(key, 0.0)) for key, home in self.homes.items()}
        rooms = {
            room: replace(had, time=had.time.levelled(room in waiting, within[self.home_of(room)]))
            for room, had in self.rooms.items()
            if had.time.is_busy != (room in waiting)
        }
        homes = {
            key: replace(home, time=home.time.levelled(key in there, least), least=within[key])
            for key, home in self.homes.items()
            if home.time.is_busy != (key in there) or within[key] != home.least
        }
        if not rooms and not homes and least == self.least:
            return self
        return replace(self, least=least, rooms={**self.rooms, **rooms}, homes={**self.homes, **homes})

    def within(self, waiting: set[Room], ahead: float) -> set[Room]:
        """Returns the rooms that have had about as much time as those that wait: their homes, and they among the rooms
        of their home, are ``ahead`` of nobody by more."""
        there = {self.home_of(room) for room in waiting}
        least = min(self.homes[key].time.seconds for key in there)
        inside: dict[Hashable, float] = {}
        for room in waiting:
            key = self.home_of(room)
            inside[key] = min(inside.get(key, math.inf), self.rooms[room].time.seconds)
        return {
            room
            for room, had in self.rooms.items()
            if self.homes[key := self.home_of(room)].time.seconds <= least + ahead
            and had.time.seconds <= inside.get(key, math.inf) + ahead
        }
