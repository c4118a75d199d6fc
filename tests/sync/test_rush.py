"""More rooms than a solver has time for (SPEC S549): what the schedule makes of it, on a clock of its own."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from esker import contract as c
from esker.events import Done, Pause, Preview, SolveEvent
from esker.session.ground import effects as does
from esker.session.ground import machine, schedule, states
from esker.session.ground.jobs import Job
from esker.session.ground.states import Ground
from esker.session.ground.tally import Tally

FLAT = np.zeros((1, 1), dtype=np.float32)
TOP = 4
COARSE_S, PASS_S, SETTLE_S = 0.004, 0.063, 0.050
"""Seconds of a coarsest preview, of a pass behind it with what parked memory takes, and of settling: those of two
cores that fifteen segments a second fill (docs/decisions/0057-parked-workspaces.md)."""
SLICES = 5


@dataclass
class Person:
    """A room where somebody draws a segment a second for four seconds of eight."""

    due: float
    clock: int = 0
    asked: dict[int, float] = field(default_factory=dict)
    left: list[tuple[float, SolveEvent]] = field(default_factory=list)


class Rush:
    """Thirty such rooms, out of step."""

    def __init__(self, rooms: int = 30) -> None:
        self.now = 0.0
        self.people = [Person(8.0 * k / rooms) for k in range(rooms)]
        self.grounds = {k: Ground(TOP) for k in range(rooms)}
        self.tally: Tally[int] = Tally(schedule.BUDGET)
        for k in range(rooms):
            self.tally = self.tally.opened(k)
        self.finest: list[float] = []
        self.settled = 0

    def happen(self, room: int, event: does.Event) -> list[does.Effect]:
        rested = states.is_at_rest(self.grounds[room])
        self.grounds[room], effects = machine.next(self.grounds[room], event, self.now)
        if rested and not states.is_at_rest(self.grounds[room]):
            self.tally = self.tally.noted(room, ran_at=self.now)
        person = self.people[room]
        for effect in effects:
            if isinstance(effect, does.OpenSolve):
                person.left = _solve(effect.coarsest)
            if isinstance(effect, does.Deliver) and effect.level.level == TOP:
                shown = [k for k in person.asked if k <= effect.job.clock]
                self.finest += [self.now - person.asked.pop(k) for k in shown]
        return list(effects)

    def draw(self) -> None:
        """What was drawn until now."""
        for room, person in enumerate(self.people):
            while person.due <= self.now:
                person.clock += 1
                person.asked[person.clock] = person.due
                self.happen(room, does.Requested(Job(person.clock, (), c.TerrainSettings())))
                person.due += 5.0 if person.clock % 4 == 0 else 1.0

    def slice(self) -> None:
        """One turn, as the worker takes it."""
        room, self.tally = schedule.choose(self.grounds, self.now, self.tally)
        if room is None:
            rest = schedule.rested_in(self.grounds, self.now)
            self.now = min([person.due for person in self.people] + ([] if rest is None else [self.now + rest]))
            return
        begins, gone, self.tally = schedule.begin(room, self.grounds, self.now, self.tally)
        for other in gone:
            self.happen(other, does.Dropped())
            self.happen(other, does.Again())
        effects = self.happen(room, does.Turn(begins))
        if any(isinstance(effect, does.OpenSolve) for effect in effects):
            effects = self.happen(room, does.Opened(previews_early=True))
        for effect in effects:
            if isinstance(effect, does.PreviewEarly):
                self.spend(room, COARSE_S, does.EarlyMade(effect.job, Preview(0, FLAT)))
            elif isinstance(effect, does.Step):
                left = self.people[room].left
                self.spend(room, *(left.pop(0) if left else (0.0, Done())))

    def spend(self, room: int, seconds: float, event: does.Event) -> None:
        self.settled += isinstance(event, Done)
        self.now += seconds
        self.tally = self.tally.ended(room, self.now)
        self.happen(room, event)


def _solve(coarsest: bool) -> list[tuple[float, SolveEvent]]:
    """What a solve gives, each with the seconds that it takes."""
    passes: list[tuple[float, SolveEvent]] = [(COARSE_S, Preview(0, FLAT))] if coarsest else []
    passes += [(PASS_S / SLICES, Pause())] * (SLICES - 1)
    passes.append((PASS_S / SLICES, Preview(TOP, FLAT)))
    return passes + [(SETTLE_S / SLICES, Pause())] * SLICES


def test_who_draws_among_thirty_sees_newer_strokes_than_a_round_ago() -> None:
    """SPEC S549, S582: half of the finest previews come within two thirds of a round of all rooms that draw, and nearly
    all within one and a third; and rooms that rest settle one after another.

    Made of the strokes that a pass began to wait with, it was one round and nearly three.
    """
    rush = Rush()
    while rush.now < 30.0:
        rush.draw()
        rush.slice()
    waited = np.array(rush.finest)
    rounds = 15 * (PASS_S + COARSE_S)
    assert len(waited) > 0.9 * sum(person.clock for person in rush.people)
    assert np.median(waited) < 0.8 * rounds
    assert np.percentile(waited, 99) < 1.5 * rounds
    assert rush.settled > 25, "slices that went round settled 15"
