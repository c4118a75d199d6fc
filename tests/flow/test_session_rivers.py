"""Rivers of open terrains (SPEC W33 to W36)."""

from __future__ import annotations

import asyncio
import logging
import threading
from collections.abc import Callable
from concurrent.futures import Future
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from esker import contract as c
from esker import grid
from esker.document.ops import StrokeSet
from esker.server.hydrology import Hydrology, Snapshot, snapshot
from esker.session import rivers as session_rivers
from esker.session.ground.frames.feed import TileFeed
from esker.session.ground.frames.tilethread import TileThread
from esker.session.rivers import (
    EVERY_SECONDS,
    GATE_SECONDS,
    QUIET_SECONDS,
    REST_SHARE,
    Gate,
    Look,
    Pace,
    Rivers,
    Wanted,
    next_look,
)
from esker.tiles.codec.rivers import is_rivers, read_rivers
from esker.tiles.delivery import ClientTiles, TileServer
from esker.tiles.watcher import Watcher

PREVIEW, REST = Look(2, False), Look(4, True)


@pytest.mark.parametrize(
    ("wanted", "busy", "last", "look", "wait"),
    [
        (Wanted(), False, 0.0, None, None),
        (Wanted(True), True, 0.0, None, None),
        (Wanted(False, 0.0), True, 0.0, None, None),
        (Wanted(True), False, 10.0 - EVERY_SECONDS, PREVIEW, None),
        (Wanted(True), False, 9.9, None, 0.15),
        (Wanted(True, 5.0), False, 9.0, PREVIEW, None),
        (Wanted(False, 10.0), False, 9.9, REST, None),
        (Wanted(False, 10.5), False, 0.0, None, 0.5),
    ],
)
def test_when_rivers_are_looked_for(
    wanted: Wanted, busy: bool, last: float, look: Look | None, wait: float | None
) -> None:
    """SPEC W33."""
    found, waits = next_look(wanted, busy, 10.0, last)
    assert found == look
    assert waits == (None if wait is None else pytest.approx(wait))


def test_searches_of_all_rooms_pass_one_at_a_time_with_a_pause_behind_each() -> None:
    """SPEC S586: whoever has waited longest is next, and who closes gives the place back."""
    gate = Gate(4)
    assert gate.wait("a", None, 10.0) == 0
    gate.enter("a", None, 10.0)
    assert gate.wait("b", None, 10.0) > 0
    assert gate.wait("c", None, 10.0) > 0
    gate.leave("a", 10.5)
    assert gate.wait("b", None, 10.5) == pytest.approx(3 * 0.5)
    assert gate.wait("c", None, 12.0) > 0, "it came behind another one"
    assert gate.wait("b", None, 12.0) == 0
    gate.leave("b", 12.0)
    assert gate.wait("d", None, 12.0) > 0
    assert gate.wait("d", None, 13.0) == 0, "who does not come back holds nobody up"


def test_homes_have_turns_at_the_gate() -> None:
    """SPEC S586: sixty rooms of one home stood before the room of another, which now waits for one search at most. Of a
    home whoever has waited longest is next."""
    gate, now, rooms = Gate(1), 0.0, [f"s{k}" for k in range(60)]
    gate.enter("s", "stranger", now)
    for room in rooms:
        assert gate.wait(room, "stranger", now) > 0
    assert gate.wait("mine", "me", now) > 0
    gate.leave("s", now)
    order: list[str] = []
    waiting = dict.fromkeys(rooms, "stranger") | {"mine": "me"}
    while waiting:
        now += GATE_SECONDS / 2
        began = [room for room, home in waiting.items() if gate.wait(room, home, now) == 0]
        assert len(began) == 1
        gate.enter(began[0], waiting.pop(began[0]), now)
        gate.leave(began[0], now)
        order += began
    assert order.index("mine") <= 1
    assert [room for room in order if room != "mine"] == rooms


def test_searches_at_rest_pause_only_while_anybody_draws() -> None:
    """SPEC S587."""
    pace = Pace()
    pace.enter("a", None, REST, 100.0)
    pace.leave("a", 101.0)
    assert pace.wait("b", None, REST, 101.0) == 0, "nobody draws"
    pace.enter("c", None, PREVIEW, 101.0)
    pace.leave("c", 101.1)
    assert pace.wait("b", None, REST, 101.1) == pytest.approx(QUIET_SECONDS - 0.1)
    pace.enter("c", None, PREVIEW, 103.0)
    assert pace.wait("b", None, REST, 103.5) == pytest.approx(QUIET_SECONDS - 0.5)
    pace.leave("c", 103.6)
    for tenths in range(1036, 1100, 5):
        pace.wait("d", None, PREVIEW, tenths / 10)
        assert pace.wait("b", None, REST, tenths / 10) > 0, "who waits for a search draws, too"
    pace.wait("d", None, PREVIEW, 101.0 + REST_SHARE - 1)
    assert pace.wait("b", None, REST, 101.0 + REST_SHARE - 1) == 0, "the pause is over, however much is drawn"


class Searches:
    """A hydrology and a ground whose answers a test gives by hand."""

    def __init__(self) -> None:
        self.pace = Pace()
        self.levels: list[int] = []
        self.settled: list[bool] = []
        self.answers: list[Future[bytes | None]] = []
        self.is_wanted: list[Callable[[], bool]] = []
        self.shown: list[bytes | None] = []

    def snapshot(self, level: int, taken: Callable[[Any], None]) -> None:
        self.levels.append(level)
        taken("the ground")

    def show_rivers(self, frame: bytes | None) -> None:
        self.shown.append(frame)

    def lane(self) -> Any:
        return SimpleNamespace(home=None)

    def find(
        self,
        lane: Any,  # noqa: ARG002
        ground: Any,  # noqa: ARG002
        settings: c.TerrainSettings,  # noqa: ARG002
        span_m: tuple[float, float] | None,  # noqa: ARG002
        settled: bool,
        is_wanted: Callable[[], bool],
    ) -> Future[bytes | None]:
        self.settled.append(settled)
        self.is_wanted.append(is_wanted)
        self.answers.append(Future())
        return self.answers[-1]


def document(**settings: Any) -> StrokeSet:
    return StrokeSet.from_document(c.Document(id="t", settings=c.TerrainSettings(**settings)))


async def turns() -> None:
    """Lets the loop run what waits."""
    for _ in range(3):
        await asyncio.sleep(0)


@pytest.fixture
def now(monkeypatch: pytest.MonkeyPatch) -> None:
    """While somebody draws, rivers may be looked for at once."""
    monkeypatch.setattr(session_rivers, "EVERY_SECONDS", 0.0)
    monkeypatch.setattr(session_rivers, "REST_SECONDS", 0.0)
    monkeypatch.setattr(session_rivers, "SHARE", 1)
    monkeypatch.setattr(session_rivers, "REST_SHARE", 1)


def test_one_search_runs_at_a_time_and_the_newest_ground_is_next(now: None) -> None:
    """SPEC W33."""

    async def run() -> None:
        searches = Searches()
        rivers = Rivers(searches, searches, asyncio.get_running_loop())
        rivers.follow(document(rivers=1.0))
        assert searches.levels == [2]
        rivers.level_taken(2, False)
        rivers.level_taken(3, False)
        rivers.level_taken(4, True)
        assert searches.levels == [2]
        searches.answers[0].set_result(b"first")
        await turns()
        assert searches.levels == [2, 2]
        searches.answers[1].set_result(b"newest")
        await turns()
        assert searches.levels == [2, 2, 4]
        assert searches.settled == [False, False, True]
        searches.answers[2].set_result(b"at rest")
        await turns()
        assert searches.shown == [b"first", b"newest", b"at rest"]
        rivers.level_taken(0, False)
        assert len(searches.levels) == 3
        rivers.close()
        rivers.level_taken(2, False)
        assert len(searches.levels) == 3

    asyncio.run(run())


def test_settings_that_rivers_follow_from_have_them_looked_for_anew(now: None) -> None:
    """SPEC W34."""

    async def run() -> None:
        searches = Searches()
        rivers = Rivers(searches, searches, asyncio.get_running_loop())
        rivers.follow(document())
        rivers.level_taken(4, True)
        assert searches.levels == []
        for fields in ({}, {"sea_level_m": 3.0}, {"detail": 0.0}, {"rivers": 2.0}):
            rivers.follow(document(**({"rivers": 1.0} | fields)))
            for _ in range(2):
                searches.answers[-1].set_result(b"x")
                await turns()
        assert searches.levels == [2, 4] * 4
        rivers.follow(document(rivers=2.0, wetness=3.0, title="another"))
        assert searches.levels == [2, 4] * 4
        rivers.follow(document())
        assert searches.shown[-1] is None
        rivers.level_taken(4, True)
        assert searches.levels == [2, 4] * 4

    asyncio.run(run())


def test_a_search_at_rest_ends_where_people_go_on_drawing(now: None) -> None:
    """SPEC W33: and what it did not find is not shown."""

    async def run() -> None:
        searches = Searches()
        rivers = Rivers(searches, searches, asyncio.get_running_loop())
        rivers.follow(document(rivers=1.0))
        rivers.level_taken(4, True)
        for _ in range(2):
            searches.answers[-1].set_result(b"preview")
            await turns()
        assert searches.levels == [2, 2, 4]
        assert searches.is_wanted[-1]()
        rivers.level_taken(0, False)
        assert not searches.is_wanted[-1]()
        assert searches.is_wanted[0]()
        searches.answers[-1].set_result(None)
        await turns()
        assert searches.shown == [b"preview"] * 2

    asyncio.run(run())


def test_the_search_ends_when_it_is_wanted_no_more() -> None:
    """SPEC W33."""
    hydrology = Hydrology()
    ground, asked = Snapshot(0, 1, valley(1)), c.TerrainSettings(rivers=1.0)
    lane = hydrology.lane()
    assert hydrology.find(lane, ground, asked, None, True, lambda: False).result(120) is None
    assert hydrology.find(lane, ground, asked, None, True).result(120) is not None
    hydrology.close()
    with pytest.raises(RuntimeError):
        hydrology.find(lane, ground, asked, None, True)


def test_searches_of_many_rooms_of_one_address_wait_for_others(monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC P541: one of them is done before the next address has its own; those of closed rooms are not done."""
    done: list[str] = []
    held = threading.Event()

    def frame(ground: Any, *_: Any) -> bytes:
        held.wait(30)
        done.append(ground)
        return b""

    monkeypatch.setattr("esker.server.hydrology.frame_of", frame)
    hydrology, asked = Hydrology(), c.TerrainSettings(rivers=1.0)
    ground: Any
    found = []
    for k in range(20):
        lane = hydrology.lane()
        lane.home = "192.0.2.7"
        ground = f"stranger {k}"
        found.append(hydrology.find(lane, ground, asked, None, True, lambda k=k: k != 3))  # type: ignore[misc]
    for home in ("192.0.2.1", "192.0.2.2"):
        lane = hydrology.lane()
        lane.home = home
        ground = home
        found.append(hydrology.find(lane, ground, asked, None, True))
    held.set()
    for future in found:
        future.result(30)
    hydrology.close()
    assert max(done.index("192.0.2.1"), done.index("192.0.2.2")) <= 3
    assert "stranger 3" not in done


def test_rivers_that_come_after_they_were_turned_off_are_not_shown(now: None) -> None:
    """SPEC W34."""

    async def run() -> None:
        searches = Searches()
        rivers = Rivers(searches, searches, asyncio.get_running_loop())
        rivers.follow(document(rivers=1.0))
        rivers.follow(document())
        searches.answers[0].set_result(b"late")
        await turns()
        assert searches.shown == [None]

    asyncio.run(run())


def test_a_search_that_fails_is_logged_and_the_next_one_runs(now: None, caplog: pytest.LogCaptureFixture) -> None:
    """SPEC W36."""

    async def run() -> None:
        searches = Searches()
        rivers = Rivers(searches, searches, asyncio.get_running_loop())
        rivers.follow(document(rivers=1.0))
        rivers.level_taken(2, False)
        searches.answers[0].set_exception(ValueError("no ground"))
        await turns()
        searches.answers[1].set_result(b"again")
        await turns()
        assert searches.shown == [b"again"]

    with caplog.at_level(logging.ERROR):
        asyncio.run(run())
    assert "rivers could not be found" in caplog.text


class Outlet:
    """A connection that takes what it is given."""

    closing, home = None, ""

    def __init__(self) -> None:
        self.has_frames = asyncio.Event()

    def notify(self) -> None:
        self.has_frames.set()

    def close(self, code: str, reason: str) -> None:
        raise AssertionError(f"{code}: {reason}")


class RealTiles:
    """The tiles of a server."""

    def __init__(self) -> None:
        self.hydrology = Hydrology()

    def server(self, size_m: float, levels: int, finest: int) -> TileServer:
        return TileServer(size_m, levels, finest)

    def client(self, server: Any) -> ClientTiles:
        return ClientTiles(server)

    def watcher(self, server: Any, top: int) -> Watcher:
        return Watcher(server, top)

    def snapshot(self, server: Any, level: int) -> Snapshot | None:
        return snapshot(server, level)


def valley(level: int) -> np.ndarray[Any, np.dtype[np.float32]]:
    n = grid.samples(level)
    y, x = np.mgrid[0:n, 0:n] / (n - 1)
    return np.asarray(500 * y + 900 * np.abs(x - 0.5), dtype=np.float32)


def test_a_client_gets_rivers_behind_its_tiles_and_who_comes_gets_the_newest() -> None:
    """SPEC W35: found on real tiles by the real search."""

    async def run() -> None:
        loop, tiles, thread = asyncio.get_running_loop(), RealTiles(), TileThread()
        feed = TileFeed(tiles, 4096.0, 2, 2, thread.lane(), loop, lambda *_: None, lambda *_: None)
        rivers = Rivers(tiles.hydrology, feed, loop)
        frames: list[bytes] = []
        outlet = Outlet()
        stream = feed.add(outlet)

        async def drained(until: Callable[[], bool], to: Any, outlet: Outlet) -> None:
            while not until():
                await outlet.has_frames.wait()
                outlet.has_frames.clear()
                while (frame := feed.sent(to)) is not None:
                    frames.append(frame)
                    feed.credit(to, len(frame))

        rivers.follow(document(rivers=1.0))
        for level in range(3):
            feed.put(3, _level(level))
        rivers.level_taken(2, True)
        await drained(lambda: any(is_rivers(f) and read_rivers(f).settled for f in frames), stream, outlet)
        assert is_rivers(frames[-1])
        assert sum(not is_rivers(f) for f in frames) >= 3
        found = read_rivers(frames[-1])
        assert (found.clock, found.level, found.settled) == (3, 2, True)
        largest = max(found.rivers, key=lambda river: river.areas[1])
        assert all(abs(x - 512) < 100 for x, _ in largest.points)
        newest, frames[:] = frames[-1], []
        outlet = Outlet()
        late = feed.add(outlet)
        await drained(lambda: any(is_rivers(f) for f in frames), late, outlet)
        assert frames[-1] == newest
        tiles.hydrology.close()
        await asyncio.to_thread(thread.shutdown)

    asyncio.run(asyncio.wait_for(run(), 120))


def _level(level: int) -> Any:
    from esker.events import Settled

    return Settled(level, valley(level))


def test_a_snapshot_is_the_ground_as_clients_have_it() -> None:
    """SPEC W32, W33: offsets and base together, the finest level that is there, with its channels."""
    server = TileServer(4096.0, 3)
    assert snapshot(server, 2) is None
    for level in range(3):
        server.put_level(1, level, np.full((grid.samples(level),) * 2, 8.0, np.float32), True, c.Channel.BASE)
        server.put_level(1, level, valley(level), True)
    amplitude = np.linspace(0, 9, 65 * 65, dtype=np.float32).reshape(65, 65)
    server.put_level(1, 0, amplitude, True, c.Channel.AMPLITUDE)
    found = snapshot(server, 4)
    assert found is not None
    assert (found.clock, found.level) == (1, 2)
    np.testing.assert_allclose(found.heights, valley(2) + 8.0, atol=grid.quantum(2, 4096.0))
    np.testing.assert_allclose(found.channels["amplitude"], amplitude, atol=0.01)
    shallow = snapshot(server, 0)
    assert shallow is not None
    assert shallow.level == 0
