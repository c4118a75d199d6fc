"""SPEC S595 to S597: what is large is freed when nobody holds it, and the collector keeps nobody waiting."""

from __future__ import annotations

import asyncio
import gc
import subprocess
import sys
import time
import weakref
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from esker.process.garbage import CALM_SECONDS, DUE, OVERDUE, Collector, importing, weakly
from esker.tiles.decoder import FrameDecoder
from tests.sync.harness import PATIENCE, LiveServer, stroke
from tests.sync.test_refined import NEAR, RoofSolver, follow


@pytest.fixture
def alone() -> Iterator[None]:
    """Without a collector, things in circles stay for good."""
    gc.collect()
    gc.disable()
    yield
    gc.enable()
    gc.collect()


def wait(until: Callable[[], bool]) -> None:
    deadline = time.monotonic() + PATIENCE
    while not until():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def parts(room: Any) -> dict[str, weakref.ref[Any]]:
    """What of a room is large."""
    feed, core = room._feed, room.core
    found = {"room": room, "tiles": feed._server, "document": core.head, "replicas": core._replicas}
    return {name: weakref.ref(part) for name, part in found.items()}


@pytest.mark.usefixtures("alone")
def test_a_closed_room_is_freed_without_a_collector(tmp_path: Path) -> None:
    """SPEC S595: the collector, which looked for closed rooms in the event loop, made all wait for 100 ms and more."""
    with LiveServer(tmp_path, RoofSolver(), level=1, refine=5) as server:
        terrain, secret = server.create()
        peer = server.join(terrain, secret)
        peer.say("view", **NEAR.model_dump(mode="json", exclude={"type"}))
        peer.ops(("c1:0", stroke()))
        follow(peer, FrameDecoder(), 1)
        room = server.assembly.hub.open_room(terrain)
        assert room is not None
        left = parts(room)
        past = server.join(terrain, secret, "c2", at=0)
        past.settled(0)
        (history,) = server.assembly.hub._history_rooms._rooms
        left |= {f"history's {name}": part for name, part in parts(history).items()}
        loop = room._loop
        del room, history
        past.close()
        peer.close()

        async def sleep() -> bool:
            return server.assembly.hub.sleep(terrain)

        wait(lambda: asyncio.run_coroutine_threadsafe(sleep(), loop).result(PATIENCE))
        wait(lambda: [name for name, part in left.items() if part() is not None] == [])


def test_what_is_called_weakly_is_freed_and_then_not_called() -> None:
    """SPEC S595."""

    class Whole:
        def __init__(self) -> None:
            self.part = weakly(self.hears)

        def hears(self, word: str) -> str:
            return word * 2

    whole = Whole()
    part, left = whole.part, weakref.ref(whole)
    assert part("ha") == "haha"
    gc.disable()
    del whole
    gc.enable()
    assert left() is None
    assert part("ha") is None


class Clock:
    """Time, and how much of it a process was busy."""

    def __init__(self) -> None:
        self.now = self.busy = 0.0

    def pass_(self, seconds: float, share: float) -> None:
        self.now += seconds
        self.busy += share * seconds


@pytest.fixture
def collector() -> Iterator[tuple[Collector, Clock]]:
    clock = Clock()
    made = Collector(lambda: clock.busy, lambda: clock.now)
    made.begin()
    yield made, clock
    made.end()


def in_circles(count: int) -> list[Any]:
    made: list[Any] = [[] for _ in range(count)]
    for one in made:
        one.append(one)
    return made


def test_what_a_look_at_what_is_new_left_is_not_looked_at_again(collector: tuple[Collector, Clock]) -> None:
    """SPEC S596: a look is as long as what is new is much."""
    there = in_circles(1000)
    gc.collect()
    del there
    assert gc.collect() < 1000, "it was set aside while somebody held it"
    gc.unfreeze()
    assert gc.collect() >= 1000


def test_all_is_looked_at_when_there_is_time(collector: tuple[Collector, Clock]) -> None:
    """SPEC S596: so what was set aside, and is held by nobody now, does not stay for good."""
    made, clock = collector
    there = in_circles(1000)
    for _ in range(DUE):
        gc.collect()
    left = gc.get_freeze_count()
    del there
    clock.pass_(CALM_SECONDS, 0.9)
    assert not made.tend(), "somebody draws"
    clock.pass_(CALM_SECONDS - 0.5, 0.01)
    assert not made.tend(), "somebody drew a moment ago"
    clock.pass_(0.5, 0.3)
    assert not made.tend(), "somebody has just begun to draw"
    clock.pass_(CALM_SECONDS - 0.5, 0.01)
    assert not made.tend(), "somebody drew a moment ago"
    clock.pass_(0.5, 0.01)
    assert made.tend()
    assert gc.get_freeze_count() <= left - 1000
    clock.pass_(CALM_SECONDS, 0.01)
    assert not made.tend(), "it was done"


def test_all_is_looked_at_where_there_never_is_time(collector: tuple[Collector, Clock]) -> None:
    """SPEC S596."""
    made, clock = collector
    for _ in range(OVERDUE):
        gc.collect()
    clock.pass_(5, 1.5)
    assert made.tend()


def test_a_server_leaves_the_collector_as_it_was(tmp_path: Path) -> None:
    """SPEC S596."""
    before = gc.get_threshold(), list(gc.callbacks)
    with LiveServer(tmp_path):
        assert gc.get_threshold() != before[0]
    assert (gc.get_threshold(), list(gc.callbacks)) == before


def test_what_is_imported_is_set_aside_and_not_looked_through_meanwhile() -> None:
    """SPEC S597: of importing the server a sixth was looking through what it makes, which stays."""
    gc.unfreeze()
    looks: list[str] = []

    def looked(phase: str, info: dict[str, int]) -> None:
        looks.append(phase)

    gc.callbacks.append(looked)
    try:
        with importing():
            there = in_circles(20_000)
            assert looks == []
        assert gc.get_freeze_count() >= len(there)
        assert gc.isenabled()
    finally:
        gc.callbacks.remove(looked)  # what was set aside stays so, as the modules of all tests are among it
    gc.disable()
    try:
        with importing():
            pass
        assert not gc.isenabled(), "whoever has put the collector off has it put off afterwards"
    finally:
        gc.enable()


WATCHED = """
import gc, os, sys

class Watch:
    def find_spec(self, name, path=None, target=None):
        if name == "esker.server.run":
            sys.stderr.write(f"enabled: {gc.isenabled()}")
            sys.stderr.flush()
            os._exit(0)

sys.meta_path.insert(0, Watch())
from esker.cli.main import main
main(["serve", "--port", "0", "--data", sys.argv[1]])
"""


def test_the_command_imports_the_server_so(tmp_path: Path) -> None:
    """SPEC S597."""
    command = [sys.executable, "-c", WATCHED, str(tmp_path / "data")]
    ran = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, check=True)
    assert ran.stderr.endswith("enabled: False")
