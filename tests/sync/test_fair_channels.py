"""Channels that are made beside a solve yield to other rooms, and are always finished and sent (SPEC P400 to P402).

As in ``test_fair_turns.py`` the worker's steps are driven by hand, with a clock that only the solver's work moves.
"""

from __future__ import annotations

import itertools
import random
from collections.abc import Iterator, Sequence
from typing import Any

import pytest

from esker import contract as c
from esker.document.revisions import revision
from esker.events import PAUSE, BaseLevel, ChannelLevel, Preview, Settled, SolveEvent
from esker.session.ground.client import Client
from esker.session.ground.jobs import Job
from esker.session.ground.schedule import AHEAD
from esker.session.ground.worker import Worker
from tests.sync.test_fair_turns import CYCLES, FLAT, LEVELS, SETTINGS

SLICE = 0.02


class Paints:
    """A solver whose slices take SLICE; the first stroke's height is the number of slices that its channels take."""

    device_name = "simulated"

    def __init__(self, world: Rooms) -> None:
        self.world = world

    def steps(
        self, strokes: Sequence[c.Stroke], settings: c.TerrainSettings, levels: int | None = None, **_: Any
    ) -> Iterator[SolveEvent]:
        assert (settings, levels) == (SETTINGS, LEVELS)
        for level in range(LEVELS + 1):
            self.world.now += SLICE
            yield Preview(level, FLAT)
            if level == 0:
                yield from self.channels(strokes)
        for _cycle in range(CYCLES):
            self.world.now += SLICE
            yield PAUSE
        for level in range(LEVELS + 1):
            yield Settled(level, FLAT)

    def channels(self, strokes: Sequence[c.Stroke], *_: Any, **__: Any) -> Iterator[SolveEvent]:
        for _slice in range(int(strokes[0].first[2])):
            self.world.now += SLICE
            yield PAUSE
        for level in range(LEVELS + 1):
            yield ChannelLevel(level, FLAT, c.Channel.SNOW)

    def base_levels(self, base: Any, levels: int) -> Iterator[BaseLevel]:
        raise AssertionError(f"{base} of {levels} levels")

    def refiner(self, basis: object) -> Any:
        raise AssertionError(f"nobody was given {basis}")


class Rooms:
    """A worker without its thread. ``came``: (time, clock) by room, channel, level and whether it is settled."""

    def __init__(self) -> None:
        self.now = 0.0
        self.worker = Worker(lambda _: Paints(self), now=lambda: self.now, budget=1 << 40)
        self.worker._repairs.open()
        self.came: dict[tuple[Client, int, int, bool], list[tuple[float, int]]] = {}
        self.confirmed: dict[Client, int] = {}
        self.clock = 0
        self.drawn: dict[Client, tuple[int, int]] = {}
        """Revisions of heights and of paint."""
        self.asked: dict[Client, int] = {}
        self.painted_at: dict[Client, int] = {}

    def room(self) -> Client:
        def deliver(clock: int, result: Any) -> None:
            key = (room, int(result.channel), result.level, result.settled)
            self.came.setdefault(key, []).append((self.now, clock))

        def confirm(clock: int, top: int) -> None:
            assert top == LEVELS
            self.confirmed[room] = clock

        room = self.worker.add(LEVELS, deliver, lambda note: pytest.fail(note), confirm=confirm, note=deliver)
        self.drawn[room] = revision(), revision()
        return room

    def ask(self, room: Client, slices: int, *, draws: bool = False, paints: bool = False) -> None:
        """The room's document changes. ``slices``: what its channels take."""
        self.clock += 1
        heights_rev, paint_rev = self.drawn[room]
        heights_rev, paint_rev = revision() if draws else heights_rev, revision() if paints else paint_rev
        self.drawn[room] = heights_rev, paint_rev
        stroke = c.Stroke(id="s", kind="profile", first=(0, 0, slices), last=(1, 1, 0), curve=((0, 0),))
        self.worker.request(room, Job(self.clock, (stroke,), SETTINGS, heights_rev, paint_rev=paint_rev))
        self.asked[room] = self.clock
        if paints:
            self.painted_at[room] = self.clock

    def step(self) -> bool:
        """One slice; False when there is nothing to do."""
        turn = self.worker._choose()
        if turn is None:
            self.now += 0.001
            return False
        self.worker._step(turn)
        return True

    def until(self, when: float) -> None:
        while self.now < when:
            self.step()

    def finest_paint(self, room: Client) -> list[tuple[float, int]]:
        return self.came.get((room, int(c.Channel.SNOW), LEVELS, True), [])


def test_a_heavy_paint_yields_the_device_to_another_room() -> None:
    """SPEC P400: 6 s of channels beside a solve; a light room's first preview waited for all of them."""
    rooms = Rooms()
    heavy, light = rooms.room(), rooms.room()
    rooms.ask(heavy, 300, draws=True)
    rooms.step()
    rooms.ask(heavy, 300, paints=True)
    rooms.until(0.5)
    assert heavy.ground.channels.making, "it is being painted"
    asked = rooms.now
    rooms.ask(light, 1, draws=True)
    rooms.until(asked + 3.0)
    first = rooms.came[light, int(c.Channel.HEIGHT), 0, False][0][0]
    settled = rooms.came[light, int(c.Channel.HEIGHT), LEVELS, True][0][0]
    assert first - asked <= 3 * SLICE
    assert settled - asked <= 2 * SLICE * (CYCLES + 6) + AHEAD
    assert not rooms.finest_paint(heavy)
    rooms.until(40.0)
    assert rooms.finest_paint(heavy)[0][1] == 2, "what yielded was finished"


def test_who_paints_without_a_pause_is_shown_the_paint_however_long_it_takes() -> None:
    """SPEC P401: with and without a pen that never rests in the same room, and beside a busy one."""
    for draws, beside in itertools.product((False, True), repeat=2):
        rooms = Rooms()
        painter, other = rooms.room(), rooms.room()
        rooms.ask(painter, 40, draws=True)
        rooms.until(4.0)
        for n in range(600):
            rooms.ask(painter, 40, paints=not draws or n % 3 == 0, draws=draws)
            if beside:
                rooms.ask(other, 1, draws=True)
            rooms.until(rooms.now + 1 / 30)
        times = [at for at, _ in rooms.finest_paint(painter) if at > 4.0]
        gaps = [after - before for before, after in itertools.pairwise([4.0, *times, rooms.now])]
        assert max(gaps) < 5 * 40 * SLICE, f"draws: {draws}, beside another room: {beside}: {gaps}"
        heights = rooms.came[painter, int(c.Channel.HEIGHT), LEVELS, False]
        assert not draws or len(heights) > 5, "nor does paint stop the pen"
        rooms.until(rooms.now + 20.0)
        assert rooms.finest_paint(painter)[-1][1] >= rooms.painted_at[painter]


def test_a_commit_that_failed_takes_the_clock_back_and_its_paint_with_it() -> None:
    """SPEC P401: what is asked for later counts as newer, whatever its clock says."""
    rooms = Rooms()
    room = rooms.room()
    rooms.ask(room, 5, draws=True)
    rooms.until(5.0)
    rooms.clock = 100
    rooms.ask(room, 5, paints=True)
    rooms.until(10.0)
    rooms.clock = 50
    rooms.ask(room, 5, paints=True)
    rooms.until(15.0)
    assert [clock for _, clock in rooms.finest_paint(room)][-2:] == [101, 51]


@pytest.mark.parametrize("seed", range(12))
def test_many_rooms_that_draw_and_paint_all_see_the_end_of_it(seed: int) -> None:
    """SPEC P402."""
    random_of = random.Random(seed)
    rooms = Rooms()
    everybody = [rooms.room() for _ in range(random_of.choice((2, 7, 25)))]
    slices = {room: random_of.choice((1, 5, 60)) for room in everybody}
    for room in everybody:
        rooms.ask(room, slices[room], draws=True)
    for _ in range(600):
        busy = random_of.sample(everybody, k=random_of.randint(0, min(4, len(everybody))))
        for room in busy:
            kind = random_of.choice(("draws", "paints", "both", "again"))
            rooms.ask(room, slices[room], draws=kind in ("draws", "both"), paints=kind in ("paints", "both"))
        rooms.until(rooms.now + random_of.choice((0.0, SLICE, 0.1)))
    total = sum(SLICE * (3 * slices[room] + CYCLES + 6) for room in everybody)
    deadline = rooms.now + 4 * total
    while rooms.step():
        assert rooms.now < deadline, "it comes to an end"
    for room in everybody:
        for level in range(LEVELS + 1):
            heights = rooms.came[room, int(c.Channel.HEIGHT), level, True][-1][1]
            paint = [clock for _, clock in rooms.came[room, int(c.Channel.SNOW), level, True]]
            assert paint == sorted(paint), "older paint does not come after newer"
            assert paint[-1] >= rooms.painted_at.get(room, 0), f"level {level}: the last paint was not sent"
            assert max(heights, rooms.confirmed.get(room, 0)) == rooms.asked[room]
        assert not room.ground.channels.making
