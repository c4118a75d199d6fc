"""What the worker does slice by slice: tiles refined at rest, solves left half-way (SPEC P57, P72, P73; DESIGN 8)."""

from __future__ import annotations

import gc
import time
import weakref
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from bench.room import stream
from esker import contract as c
from esker import grid
from esker.events import PAUSE, Done, Preview, Settled
from esker.grid import TileKey
from esker.session.ground import states
from esker.session.ground.client import Client
from esker.session.ground.jobs import Job
from esker.session.ground.worker import Worker
from esker.solve.solver import Solver

SETTINGS = c.TerrainSettings()
NOTHING = np.zeros((1, 1), dtype=np.float32)


def ignore(*_: Any) -> None:
    """A callback that does nothing."""


# --- refinement -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Tile:
    key: TileKey
    heights: Any = None
    base: Any = None
    content: bytes = b""


class Refining:
    """A solver whose solves take no time and whose tiles are counted."""

    device_name = "refining"

    def __init__(self) -> None:
        self.closed = 0
        self.pace = 0.0

    def steps(self, strokes: Sequence[c.Stroke], settings: Any, levels: int, *, basis: bool) -> Iterator[Any]:
        assert basis
        assert settings == SETTINGS
        yield Preview(levels, NOTHING)
        yield Settled(levels, NOTHING)
        yield Done(len(strokes))

    def channels(self, *_: Any) -> Iterator[Any]:
        return iter(())

    def refiner(self, basis: object) -> Refining:
        assert basis is not None
        return self

    def tiles(self, keys: Sequence[TileKey], _: Any) -> Iterator[Tile | None]:
        try:
            for key in keys:
                yield None
                time.sleep(self.pace)
                yield Tile(key)
        except GeneratorExit:
            self.closed += 1
            raise


@dataclass
class Viewer:
    """Wants tiles; takes what is made."""

    keys: tuple[TileKey, ...] = ()
    got: list[tuple[int, TileKey]] = field(default_factory=list)
    asked: int = 0

    def wanted(self) -> Sequence[TileKey]:
        self.asked += 1
        return self.keys

    def deliver_tile(self, clock: int, tile: Any) -> None:
        self.got.append((clock, tile.key))


@pytest.fixture
def refining() -> Iterator[tuple[Refining, Worker, Viewer, Client]]:
    solver, viewer = Refining(), Viewer()
    made: Any = solver
    worker = Worker(lambda _: made)
    worker.start()
    client = worker.add(1, ignore, ignore, viewer)
    yield solver, worker, viewer, client
    worker.stop()


def wait(condition: Any) -> None:
    deadline = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.001)


A, B, C = (TileKey(5, x, 0) for x in range(3))


def test_at_rest_what_is_wanted_is_refined_once_and_asked_for_again(refining: Any) -> None:
    _, worker, viewer, client = refining
    viewer.keys = (B, A)
    worker.request(client, Job(7, (), SETTINGS))
    wait(lambda: len(viewer.got) == 2)
    assert viewer.got == [(7, B), (7, A)], "in the order asked"
    wait(lambda: viewer.asked >= 2)
    asked = viewer.asked
    time.sleep(0.03)
    assert viewer.asked == asked, "nothing new is wanted: no busy loop"
    viewer.keys = (B, A, C)
    worker.nudge(client)
    wait(lambda: (7, C) in viewer.got)


def test_the_thread_that_waits_knows_no_room_that_left(refining: Any) -> None:
    """SPEC S594: the loop's own variable kept the room that left last, with all of its ground."""
    _, worker, _, _ = refining
    viewer = Viewer((A,))
    client = worker.add(1, ignore, ignore, viewer)
    worker.request(client, Job(7, (), SETTINGS))
    wait(lambda: viewer.got)
    left = weakref.ref(client)
    worker.remove(client)
    del client
    deadline = time.monotonic() + 5
    while left() is not None:
        assert time.monotonic() < deadline
        gc.collect()
        time.sleep(0.01)


def test_a_new_job_ends_refinement_at_once_and_it_starts_again_from_the_new_ground(refining: Any) -> None:
    solver, worker, viewer, client = refining
    solver.pace = 0.01
    viewer.keys = tuple(TileKey(6, x, y) for x in range(20) for y in range(20))
    worker.request(client, Job(1, (), SETTINGS))
    wait(lambda: len(viewer.got) >= 2)
    worker.request(client, Job(2, (), SETTINGS))
    wait(lambda: any(clock == 2 for clock, _ in viewer.got))
    clocks = [clock for clock, _ in viewer.got]
    assert clocks == sorted(clocks)
    assert clocks.count(1) < 20
    assert solver.closed == 1


def test_an_op_does_not_wait_for_the_device_that_refines(refining: Any) -> None:
    """SPEC P57."""
    solver, worker, viewer, client = refining
    asked: list[bool] = []

    def busy(keys: Sequence[TileKey], urgent: Any) -> Iterator[Tile | None]:
        while len(viewer.got) == 0:
            asked.append(urgent())
            if asked[-1]:
                yield None
            time.sleep(0.001)
        yield from map(Tile, keys)

    solver.tiles = busy
    viewer.keys = (A,)
    worker.request(client, Job(1, (), SETTINGS))
    wait(lambda: len(asked) > 5)
    assert not any(asked)
    del solver.tiles
    worker.request(client, Job(2, (), SETTINGS))
    wait(lambda: viewer.got == [(2, A)])
    assert asked[-1]
    assert solver.closed == 0


def test_when_refining_fails_the_ground_stays_and_people_are_told(refining: Any) -> None:
    solver, worker, viewer, client = refining
    told: list[str] = []
    client.tell = told.append
    viewer.keys = (A, B)

    def broken(keys: Sequence[TileKey], _: Any) -> Iterator[Tile | None]:
        yield Tile(keys[0])
        raise MemoryError

    solver.tiles = broken
    worker.request(client, Job(1, (), SETTINGS))
    wait(lambda: bool(told))
    assert "detail" in told[0]
    assert viewer.got == [(1, A)]
    assert states.is_at_rest(client.ground)
    del solver.tiles
    worker.request(client, Job(2, (), SETTINGS))
    wait(lambda: (2, B) in viewer.got)
    assert len(told) == 1


# --- with the real solver -------------------------------------------------------------------------------------------


class Watched:
    """The real solver at work in a worker, every slice noted."""

    def __init__(self, levels: int) -> None:
        self.solver, self.levels = Solver(max_level=levels), levels
        self.device_name = self.solver.device_name
        self.open: list[int] = []
        self.done: list[tuple[int, int, bool, float]] = []
        made: Any = self
        self.worker = Worker(lambda _: made)
        self.worker.start()
        self.client = self.worker.add(levels, self.deliver, ignore, note=self.deliver)

    def steps(self, strokes: Any, settings: Any, levels: int, **_: Any) -> Iterator[Any]:
        self.open.append(len(strokes))
        return self.solver.steps(strokes, settings, levels)

    def deliver(self, clock: int, result: Any) -> None:
        if result.channel == c.Channel.HEIGHT:
            self.done.append((clock, result.level, result.settled, time.monotonic()))

    def ask(self, clock: int, strokes: tuple[c.Stroke, ...]) -> None:
        self.worker.request(self.client, Job(clock, strokes, SETTINGS))

    def at(self, clock: int, level: int, settled: bool) -> bool:
        return any(entry[:3] == (clock, level, settled) for entry in self.done)


def test_a_solve_left_while_it_rasterises_leaves_no_trace(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("esker.solve.opencl.device_workspace.RASTER_BINS", 40)
    strokes = stream.fifty().strokes
    solver = Solver(max_level=2)
    if solver.device_name.startswith("NumPy"):
        pytest.skip("NumPy rasterises in one piece")
    want = solver.solve(strokes, SETTINGS)
    solver.solve(strokes[:30], SETTINGS)
    steps = solver.steps(strokes, SETTINGS)
    assert next(steps) == PAUSE, "between two bands of bins"
    steps.close()
    got = solver.solve(strokes, SETTINGS)
    for level in range(3):
        np.testing.assert_array_equal(got[level], want[level])


def test_ops_during_a_fine_level_stop_it_within_one_level_and_at_rest_the_fine_levels_complete() -> None:
    watched = Watched(3)
    strokes = stream.fifty().strokes
    try:
        watched.ask(1, strokes)
        wait(lambda: watched.at(1, 3, False))  # now it settles: its finest level is being worked on
        watched.ask(2, strokes[:-1])
        wait(lambda: watched.at(2, 0, False))
        asked = [entry for entry in watched.done if entry[0] == 1]
        assert not any(settled for *_, settled, _ in asked), "it was stopped before it had settled"
        after = watched.done[len(asked) :]
        assert after[0][:3] == (2, 0, False), "nothing of the old clock comes after the op"
        for clock in range(3, 12):  # a hand that draws: 30 ops a second
            watched.ask(clock, strokes[: -1 - clock])
            time.sleep(0.033)
        wait(lambda: watched.at(11, 3, True))
        finest = [entry for entry in watched.done if entry[0] == 11]
        assert [entry[1:3] for entry in finest[-4:]] == [(level, True) for level in range(4)]
        heights = watched.solver.solve(strokes[:-12], SETTINGS, 3)
        assert heights.settled
        assert heights[3].shape == (grid.samples(3),) * 2
    finally:
        watched.worker.stop()
