"""Sharing the solver: many rooms that draw, and one or two big terrains that settle, on one device (DESIGN 8).

Each of ``--rooms`` people appends a segment every ``PERIOD`` seconds for ``DRAWING`` seconds, then rests for as long;
the rooms are out of step. Real solver and worker, no sockets. Measured from the request to the delivery of the coarsest
and of the finest preview, without and with terrains that settle at 4097 x 4097 all the time. A slice is what the solver
does until it can be left: it is what a coarse preview may have to wait for.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from bench.room import _serving, stream
from esker import contract as c
from esker.events import Level
from esker.session.ground.ports import Refiner
from esker.session.ground.worker import Client, Job, Worker
from esker.solve.solver import Solver
from esker.solve.solving import Solving
from esker.version import VERSION

PERIOD: Final = 1.0
DRAWING: Final = 4.0
REST: Final = 4.0
"""Seconds. Thirty rooms, half of them at rest: 15 appends a second in all."""
BIG_LEVEL: Final = 6


class _Timed:
    """A solver whose slices are timed: what ``next`` takes, by the level of the solve."""

    def __init__(self, solver: Solver) -> None:
        self._solver = solver
        self.slices: dict[int, list[float]] = {}

    @property
    def device_name(self) -> str:
        return self._solver.device_name

    def steps(
        self, strokes: Sequence[c.Stroke], settings: c.TerrainSettings, levels: int | None = None, **more: Any
    ) -> _Slices:
        """See ``session.ground.ports.Solver``."""
        level = self._solver.max_level if levels is None else levels
        return _Slices(self._solver.steps(strokes, settings, levels, **more), self.slices.setdefault(level, []))

    def channels(self, *job: Any, **over: Any) -> Iterator[Any]:
        return self._solver.channels(*job, **over)

    def base_levels(self, base: Any, levels: int | None = None) -> Iterator[Any]:
        """See ``session.ground.ports.Solver``."""
        return self._solver.base_levels(base, levels)

    def refiner(self, basis: Any) -> Refiner:
        """See ``session.ground.ports.Solver``."""
        return self._solver.refiner(basis)


class _Slices(Iterator[Any]):
    """A solve whose steps and early previews are timed."""

    def __init__(self, steps: Solving, took: list[float]) -> None:
        self._steps, self._took = steps, took

    def __next__(self) -> Any:
        return self._timed(lambda: next(self._steps))

    def early_preview(self, strokes: Sequence[c.Stroke], settings: c.TerrainSettings, base: Any = None) -> Any:
        return self._timed(lambda: self._steps.early_preview(strokes, settings, base))

    def close(self) -> None:
        self._steps.close()

    def _timed(self, work: Callable[[], Any]) -> Any:
        start = time.perf_counter()
        try:
            return work()
        finally:
            self._took.append(time.perf_counter() - start)


@dataclass
class _Room:
    """Someone who draws: the times from each request to its previews."""

    document: c.Document
    levels: int
    client: Client | None = None
    clock: int = 0
    asked: dict[int, float] = field(default_factory=dict)
    coarse: list[float] = field(default_factory=list)
    finest: list[float] = field(default_factory=list)
    settled: int = 0

    def deliver(self, clock: int, result: Level) -> None:
        """Notes a level. It is called in the worker's thread. A preview shows every append up to its clock."""
        now = time.perf_counter()
        if result.settled:
            self.settled += result.level == self.levels
        elif result.level == 0:
            self.coarse += [now - at for k, at in self.asked.items() if k <= clock and k not in self.seen]
            self.seen |= {k for k in self.asked if k <= clock}
        elif result.level == self.levels:
            self.finest += [now - at for k, at in self.asked.items() if k <= clock]
            self.asked = {k: at for k, at in self.asked.items() if k > clock}

    def __post_init__(self) -> None:
        self.seen: set[int] = set()

    def draw(self, worker: Worker) -> None:
        """One more segment, or the same again at the end of the stroke."""
        self.clock += 1
        points = tuple(p for n in range(1 + self.clock % 24) for p in stream.segment(n).points)
        pen = stream.PEN.model_copy(update={"curve": points})
        assert self.client is not None
        self.asked[self.clock] = time.perf_counter()
        worker.request(self.client, Job(self.clock, (*self.document.strokes, pen), self.document.settings))


def _percentiles(seconds: list[float]) -> dict[str, float]:
    ms = np.array(seconds or [np.nan]) * 1000
    p50, p99 = (round(float(np.percentile(ms, q)), 1) for q in (50, 99))
    return {"p50": p50, "p99": p99, "max": round(float(ms.max()), 1), "n": len(seconds)}


def _own(seed: int) -> c.Document:
    """Fifty strokes with ids that no other room has, as in life: solvers know a room by the ids of its strokes."""
    document = stream.fifty(seed)
    strokes = tuple(stroke.model_copy(update={"id": f"{seed}-{stroke.id}"}) for stroke in document.strokes)
    return document.model_copy(update={"strokes": strokes})


def measure(solver: Solver, rooms: int, big: int, seconds: float, level: int) -> dict[str, Any]:
    """One run. ``level``: of the rooms that draw; the big terrains have BIG_LEVEL."""
    timed = _Timed(solver)
    worker = Worker(lambda _: timed)
    worker.start()
    try:
        people = [_Room(_own(100 + i), level) for i in range(rooms)]
        giants = [_Room(_own(200 + i), BIG_LEVEL) for i in range(big)]
        for room in [*people, *giants]:
            room.client = worker.add(room.levels, room.deliver, _unexpected)
        _warm(worker, [*people, *giants])
        timed.slices.clear()
        _run(worker, people, giants, seconds)
    finally:
        worker.stop()
    small = [t for k, ts in timed.slices.items() if k == level for t in ts]
    large = [t for k, ts in timed.slices.items() if k == BIG_LEVEL and k != level for t in ts]
    return {
        "rooms": rooms,
        "big": big,
        "coarse_preview_ms": _percentiles([t for r in people for t in r.coarse]),
        "finest_preview_ms": _percentiles([t for r in people for t in r.finest]),
        "settled": sum(r.settled for r in people),
        "big_settled": sum(r.settled for r in giants),
        "slice_ms": _percentiles(small),
        "big_slice_ms": _percentiles(large) if large else None,
    }


def _warm(worker: Worker, rooms: list[_Room]) -> None:
    """Every room is open and at rest before anything is measured."""
    for room in rooms:
        room.draw(worker)
        deadline = time.monotonic() + 120
        while not room.settled:
            if time.monotonic() > deadline:
                raise RuntimeError("a room did not settle")
            time.sleep(0.005)
        room.settled, room.coarse, room.finest = 0, [], []


def _run(worker: Worker, people: list[_Room], giants: list[_Room], seconds: float) -> None:
    """People draw and rest; a giant that has settled is asked again."""
    start = time.perf_counter()
    cycle = DRAWING + REST
    due = [start + cycle * i / max(1, len(people)) for i in range(len(people))]
    done = [-1] * len(giants)
    while (now := time.perf_counter()) < start + seconds:
        for i, room in enumerate(people):
            if now >= due[i]:
                room.draw(worker)
                resting = (due[i] + PERIOD - start - cycle * i / len(people)) % cycle >= DRAWING
                due[i] += REST + PERIOD if resting else PERIOD
        for i, giant in enumerate(giants):
            if giant.settled > done[i]:
                done[i] = giant.settled
                giant.draw(worker)
        time.sleep(max(0.0005, min(due, default=now + 0.01) - time.perf_counter()) if not giants else 0.002)


def _unexpected(sentence: str) -> None:
    raise RuntimeError(sentence)


def main(argv: list[str]) -> int:
    """``esker bench share [--json] [--rooms N] [--seconds S] [--big N]``."""
    parser = argparse.ArgumentParser(prog="esker bench share", description=__doc__)
    parser.add_argument("--rooms", type=int, default=30)
    parser.add_argument("--seconds", type=float, default=16.0)
    parser.add_argument("--big", type=int, default=1, help="terrains that settle at 4097 x 4097 all the time")
    parser.add_argument("--level", type=int, default=c.DEFAULT_LEVEL)
    parser.add_argument("--json", action="store_true", help="print the result as JSON")
    arguments = parser.parse_args(argv)
    solver = Solver(max_level=arguments.level)
    result: dict[str, Any] = {
        "bench": "share",
        "version": VERSION,
        "machine": _serving.machine(solver.device_name),
        "level": arguments.level,
        "big_level": BIG_LEVEL,
        "runs": {},
    }
    runs = {"alone": (1, 0), "rooms": (arguments.rooms, 0), "rooms_and_big": (arguments.rooms, arguments.big)}
    for name, (rooms, big) in runs.items():
        result["runs"][name] = measure(solver, rooms, big, arguments.seconds, arguments.level)
    if arguments.json:
        sys.stdout.write(json.dumps(result, indent=1) + "\n")
    else:
        for name, run in result["runs"].items():
            sys.stdout.write(f"{name}: {run}\n")
    return 0
