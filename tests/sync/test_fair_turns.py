"""Rooms have the solver by the time that they take, not by the work that they make (SPEC P225, P226).

The worker's own steps are driven here by hand, with a clock that only the solver's work moves.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import pytest

from esker import contract as c
from esker.events import PAUSE, BaseLevel, Preview, Settled, SolveEvent
from esker.session.ground.client import Client
from esker.session.ground.jobs import Job
from esker.session.ground.schedule import AHEAD
from esker.session.ground.tally import UNATTENDED_PRICE
from esker.session.ground.worker import Worker

SETTINGS = c.TerrainSettings()
FLAT = np.zeros((2, 2), dtype=np.float32)
LEVELS = 2
CYCLES = 20
"""In which a solve settles, between its previews and its settled levels."""


class Works:
    """A solver whose slices take as long as the first stroke is high, in seconds."""

    device_name = "simulated"

    def __init__(self, world: World) -> None:
        self.world = world

    def steps(
        self, strokes: Sequence[c.Stroke], settings: c.TerrainSettings, levels: int | None = None, **_: Any
    ) -> Iterator[SolveEvent]:
        assert settings.size_m > 0
        cost, top = strokes[0].first[2], levels or 0
        for level in range(top + 1):
            self.world.now += cost
            yield Preview(level, FLAT)
        for _cycle in range(CYCLES):
            self.world.now += cost
            yield PAUSE
        for level in range(top + 1):
            yield Settled(level, FLAT)

    def channels(self, *_: Any, **__: Any) -> Iterator[Any]:
        for _layer in range(5):
            self.world.now += 0.05
            yield PAUSE

    def base_levels(self, base: Any, levels: int) -> Iterator[BaseLevel]:
        raise AssertionError(f"{base} of {levels} levels")

    def refiner(self, basis: object) -> Any:
        raise AssertionError(f"nobody was given {basis}")


class World:
    """A worker without its thread."""

    def __init__(self, budget: int | None = None) -> None:
        self.now = 0.0
        self.worker = Worker(lambda _: Works(self), now=lambda: self.now, budget=budget)
        self.worker._repairs.open()
        self.settled: dict[str, list[float]] = {}
        self.previews: dict[str, list[float]] = {}
        self.coarse: dict[str, list[float]] = {}
        """When the coarsest previews came."""
        self.slices: dict[Client, float] = {}
        self.churning: list[tuple[Client, float, float]] = []
        """Rooms whose document changes all the time: what a slice of theirs takes, and when they changed last."""
        self.clock = 0

    def room(self, name: str, home: str | None = None) -> Client:
        self.settled[name], self.previews[name], self.coarse[name] = [], [], []

        def deliver(_: int, result: Any) -> None:
            if result.level == 0 and not result.settled:
                self.coarse[name].append(self.now)
            if result.level == LEVELS:
                (self.settled if result.settled else self.previews)[name].append(self.now)

        return self.worker.add(LEVELS, deliver, lambda note: pytest.fail(note), home=home)

    def ask(self, client: Client, cost: float, **like: Any) -> None:
        self.clock += 1
        stroke = c.Stroke(id="s", kind="profile", first=(0, 0, cost), last=(1, 1, 0), curve=((0, 0),))
        self.worker.request(client, Job(self.clock, (stroke,), SETTINGS, **like))

    def run(self, seconds: float) -> None:
        end = self.now + seconds
        while self.now < end:
            for n, (client, cost, at) in enumerate(self.churning):
                if self.now - at >= 1 / 30:
                    self.churning[n] = client, cost, self.now
                    self.ask(client, cost)
            turn = self.worker._choose()
            if turn is None:
                self.now += 0.001
                continue
            began = self.now
            self.worker._step(turn)
            self.slices[turn] = self.slices.get(turn, 0.0) + self.now - began


def test_a_light_room_settles_beside_one_that_changes_all_the_time() -> None:
    """Beside 5,000 strokes whose reach changed all the time it had not settled after 25 s; alone it took 0.43."""
    alone = World()
    light = alone.room("light")
    alone.ask(light, 0.018)
    alone.run(1.0)
    [by_itself] = alone.settled["light"]

    world = World()
    heavy, light = world.room("heavy"), world.room("light")
    world.churning.append((heavy, 0.2, 0.0))
    world.run(30.0)
    asked = world.now
    world.ask(light, 0.018)
    world.run(10.0)
    [settled] = world.settled["light"]
    assert settled - asked < 3 * by_itself + 2 * AHEAD
    assert world.previews["heavy"][-1] > settled, "the heavy one goes on"


def test_two_rooms_that_both_want_everything_have_half_each() -> None:
    world = World()
    rooms = [world.room(name) for name in ("heavy", "light")]
    for room, cost in zip(rooms, (0.2, 0.01), strict=True):
        world.churning.append((room, cost, 0.0))
    world.run(60.0)
    heavy, light = (world.slices[room] for room in rooms)
    assert abs(heavy - light) < AHEAD + 0.5
    assert len(world.previews["heavy"]) > 10, "its passes are finished, at the pace of its share"
    assert len(world.previews["light"]) > 10 * len(world.previews["heavy"])


def test_sixty_rooms_of_one_address_have_what_two_have() -> None:
    """SPEC A444: a stranger's sixty rooms had sixty turns for each of somebody else's."""
    world = World()
    mine = world.room("mine", "198.51.100.1")
    many = [world.room(f"r{k}", "203.0.113.7") for k in range(60)]
    world.churning += [(room, 0.01, 0.0) for room in (mine, *many)]
    world.run(60.0)
    theirs = [world.slices.get(room, 0.0) for room in many]
    assert abs(sum(theirs) - 2 * world.slices[mine]) < 4 * AHEAD
    assert min(theirs) > 0.25 * max(theirs), "they share evenly"


def test_a_room_settles_while_a_stranger_opens_one_after_another() -> None:
    """SPEC A444: who comes begins level with who was there, so each new room was one more that came first."""
    alone = World()
    light = alone.room("light", "198.51.100.1")
    alone.ask(light, 0.018)
    alone.run(1.0)
    [by_itself] = alone.settled["light"]
    world = World()
    light = world.room("light", "198.51.100.1")
    for k in range(60):
        world.ask(world.room(f"r{k}", "203.0.113.7"), 0.018)
    world.ask(light, 0.018)
    world.run(60.0)
    [settled] = world.settled["light"]
    assert settled < 3 * by_itself + 3 * AHEAD


def test_who_drew_before_sees_a_stroke_at_once_though_a_stranger_opens_sixty_rooms() -> None:
    """SPEC P646: rooms that never had a turn came first, so each of sixty did before whoever had drawn a while ago."""
    world = World()
    mine = world.room("mine", "198.51.100.1")
    world.churning.append((mine, 0.02, 0.0))
    world.run(5.0)
    world.churning.clear()
    world.run(5.0)
    for k in range(60):
        world.ask(world.room(f"r{k}", "203.0.113.7"), 0.02)
    asked = world.now
    world.ask(mine, 0.02)
    world.run(30.0)
    assert min(at for at in world.coarse["mine"] if at > asked) - asked < 4 * 0.02
    assert all(world.settled[f"r{k}"] for k in range(60))


def test_a_room_is_of_whoever_draws_in_it() -> None:
    """SPEC A444: the rooms of one address, opened by others, share as if they had been opened from there."""
    world = World()
    mine = world.room("mine", "198.51.100.1")
    many = [world.room(f"r{k}", f"203.0.113.{k}") for k in range(20)]
    for room in many:
        world.worker.move(room, "192.0.2.9")
    world.churning += [(room, 0.01, 0.0) for room in (mine, *many)]
    world.run(30.0)
    assert abs(sum(world.slices.get(room, 0.0) for room in many) - 2 * world.slices[mine]) < 4 * AHEAD
    for room in many:
        world.worker.remove(room)
    assert set(world.worker._tally.homes) == {"198.51.100.1"}


def test_rooms_that_nobody_is_in_come_behind_who_draws() -> None:
    """SPEC P664: a class that was collected had half of the solver beside whoever drew elsewhere."""
    world = World()
    drawn, collected = world.room("drawn", "198.51.100.1"), world.room("collected", "203.0.113.7")
    world.worker.attend(collected, False)
    world.churning += [(drawn, 0.01, 0.0), (collected, 0.01, 0.0)]
    world.run(20.0)
    assert abs(world.slices[drawn] - UNATTENDED_PRICE * world.slices[collected]) < 2 * AHEAD
    world.worker.move(collected, "203.0.113.8")
    world.slices.clear()
    world.run(20.0)
    assert world.slices[collected] < 0.3 * world.slices[drawn], "also where it is of somebody else"
    world.worker.attend(collected, True)
    world.slices.clear()
    world.run(20.0)
    assert abs(world.slices[drawn] - world.slices[collected]) < 2 * AHEAD, "until somebody comes"


def test_a_room_that_nobody_is_in_takes_little_from_its_own_address() -> None:
    """SPEC P664: a teacher draws while the class is collected, both from one address."""
    world = World()
    other, drawn, collected = (world.room(name, name[0]) for name in ("a", "b drawn", "b collected"))
    world.worker.attend(collected, False)
    world.churning += [(room, 0.01, 0.0) for room in (other, drawn, collected)]
    world.run(20.0)
    assert abs(world.slices[drawn] - UNATTENDED_PRICE * world.slices[collected]) < 2 * AHEAD
    assert world.slices[drawn] > 0.7 * world.slices[other]


def test_a_room_that_nobody_is_in_has_all_that_nobody_else_wants() -> None:
    """SPEC P664."""
    world = World()
    drawn, collected = world.room("drawn"), world.room("collected")
    world.worker.attend(collected, False)
    world.ask(drawn, 0.01)
    world.run(2.0)
    asked = world.now
    world.ask(collected, 0.01)
    world.run(2.0)
    [settled] = world.settled["collected"]
    assert settled - asked < (CYCLES + 2 * LEVELS + 2) * 0.01


def test_time_that_nobody_wanted_is_held_against_nobody_and_not_saved_up() -> None:
    world = World()
    old, new = world.room("old"), world.room("new")
    world.churning.append((old, 0.05, 0.0))
    world.run(100.0)
    assert world.worker._tally.rooms[old].time.seconds > 90
    world.churning.append((new, 0.05, 0.0))
    world.slices.clear()
    world.run(20.0)
    assert abs(world.slices[old] - world.slices[new]) < AHEAD + 0.2, "old is not made to wait for a hundred seconds"
    world.churning.clear()
    world.run(20.0)
    world.churning += [(old, 0.05, world.now), (new, 0.05, world.now)]
    world.slices.clear()
    world.run(20.0)
    assert abs(world.slices[old] - world.slices[new]) < 2 * AHEAD + 0.2


def test_many_rooms_each_have_their_part() -> None:
    world = World()
    rooms = [world.room(str(n)) for n in range(10)]
    for n, room in enumerate(rooms):
        world.churning.append((room, 0.1 if n < 5 else 0.01, 0.0))
    world.run(100.0)
    shares = [world.slices[room] for room in rooms]
    assert max(shares) - min(shares) < AHEAD + 0.5


def test_settling_is_ended_only_for_who_has_had_no_more() -> None:
    """Memory for one solve at a time: who changes all the time does not end the other's solve again and again."""
    world = World(budget=1)
    heavy, light = world.room("heavy"), world.room("light")
    world.churning.append((heavy, 0.2, 0.0))
    world.run(10.0)
    world.ask(light, 0.018)
    world.run(20.0)
    assert len(world.settled["light"]) == 1
