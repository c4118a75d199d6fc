"""What waits to be sent, and which terrains are open, have bounds over the server (SPEC P228 to P231)."""

from __future__ import annotations

import asyncio
import threading
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest

from esker import contract as c
from esker.document.ops import StrokeSet
from esker.document.wire import document_json
from esker.fairness import shares
from esker.fairness.shares import Share, Who
from esker.fairness.turns import Turnstile
from esker.process import memory
from esker.server.routes import socket as route
from esker.session.room import hub, openrooms
from esker.session.room.core import Denied, RoomCore, RoomInfo
from esker.session.room.openrooms import OpenRooms
from esker.session.room.outbox import FEW_BYTES, Long, Outbox, Waiting
from esker.session.room.replicas import recent
from esker.session.room.replicas import replicas as module
from esker.store.journal import Loaded
from tests.sync.harness import LiveServer, Peer
from tests.unit.test_websocket import Wire, settle

INFO = RoomInfo(4, 4, "none")


def stroke(name: str, points: int) -> c.Stroke:
    curve = tuple((k / points, float(k % 7)) for k in range(points))
    return c.Stroke(id=name, kind="profile", first=(0, 0, 0), last=(100, 100, 0), curve=curve)


def heavy(count: int = 40) -> StrokeSet:
    strokes = {f"s{k}": stroke(f"s{k}", 1000) for k in range(count)}
    return StrokeSet("t", strokes=strokes, deleted={"d": stroke("d", 3)})


# --- the welcome ----------------------------------------------------------------------------------------------------


def test_a_document_in_pieces_is_the_document() -> None:
    for document in (StrokeSet("t"), heavy(3)):
        assert document_json(document.to_document()) == document.to_document().model_dump_json()


def core_of(document: StrokeSet) -> RoomCore:
    return RoomCore(Loaded(document, [], {}), lambda _client, _counter: None)


def join(core: RoomCore, name: str, clock: int | None = None) -> list[str | Long]:
    outbox = Outbox(lambda: None)
    hello = c.Hello(protocol=c.PROTOCOL_VERSION, terrain="t", secret="s", client=name, clock=clock)
    core.join(hello, "edit", "link", outbox, INFO)
    texts = []
    while (text := outbox.pop()) is not None:
        texts.append(text)
    return texts


def draw(core: RoomCore, clock: int) -> None:
    member = core.members.by_client["ada"]
    envelope = c.OpEnvelope(id=f"ada:{clock}", op=c.BeginStroke(stroke=stroke(f"new{clock}", 2)))
    assert core.submit(member, [envelope]) == 1
    batch = core.take()
    assert batch is not None
    core.committed(batch)


def test_a_heavy_document_is_one_piece_of_memory_for_all_who_come() -> None:
    """It was copied for each member that did not read: 40 MB each."""
    core = core_of(heavy())
    [ada] = join(core, "ada")
    [ben] = join(core, "ben")
    assert isinstance(ada, Long)
    assert isinstance(ben, Long)
    assert ada.body is ben.body
    assert len(ada.head) + len(ada.tail) < 2000
    told = c.Welcome.model_validate_json(str(ben))
    assert told.document is not None
    assert len(told.document.strokes) == 40


def test_who_comes_after_some_strokes_gets_the_same_piece_and_what_was_done_since() -> None:
    core = core_of(heavy())
    [first] = join(core, "ada")
    draw(core, 1)
    draw(core, 2)
    welcome, since = join(core, "ben")
    assert isinstance(welcome, Long)
    assert isinstance(first, Long)
    assert welcome.body is first.body
    told = c.Welcome.model_validate_json(str(welcome))
    assert told.clock == 0
    missed = c.OpsBroadcast.model_validate_json(str(since))
    assert [op.clock for op in missed.ops] == [1, 2]
    assert core.ready(None)
    [resumed] = join(core, "cy", clock=1)
    assert isinstance(resumed, str)
    assert c.Welcome.model_validate_json(resumed).clock == 2


def test_after_much_has_been_done_it_is_encoded_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "SINCE_CHARACTERS", 10)
    core = core_of(heavy())
    join(core, "ada")
    draw(core, 1)
    assert not core.ready(None)
    assert core.ready(1)
    [welcome] = join(core, "ben")
    assert c.Welcome.model_validate_json(str(welcome)).clock == 1


def test_a_light_document_is_sent_as_it_is_now() -> None:
    core = core_of(StrokeSet("t"))
    join(core, "ada")
    draw(core, 1)
    [welcome] = join(core, "ben")
    assert isinstance(welcome, str)
    assert c.Welcome.model_validate_json(welcome).clock == 1


def test_a_heavy_document_is_encoded_outside_of_the_event_loop(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It stopped the loop for 2.4 s."""
    where: list[str] = []
    whole = recent.encoded

    def noted(document: StrokeSet, view: bool = False) -> bytes:
        where.append(threading.current_thread().name)
        return whole(document, view)

    monkeypatch.setattr("esker.session.room.replicas.recent.encoded", noted)
    monkeypatch.setattr(module, "encoded", noted)
    with LiveServer(tmp_path) as server:
        terrain, secret = server.create(strokes=tuple(heavy().strokes.values()))
        peers = [server.join(terrain, secret, f"p{n}") for n in range(3)]
        for peer in peers:
            assert len(peer.welcome["document"]["strokes"]) == 40
            peer.close()
    assert len(where) == 1
    assert where[0].startswith("reading")


def test_fragments_of_long_texts_of_all_sockets_go_one_after_another() -> None:
    """SPEC P649: all that fits into a socket was written in one turn of the event loop, for two hundred at once."""

    async def run() -> None:
        loop, long, rounds = asyncio.get_running_loop(), Turnstile(), 0
        went: list[tuple[str, int]] = []

        def count() -> None:
            nonlocal rounds
            rounds += 1
            loop.call_soon(count)

        def transport(name: str) -> route.WireTransport:
            def write_now(_: bytes) -> bool:
                went.append((name, rounds))
                return True

            wire = Mock(writable=asyncio.Event(), write_now=write_now)
            wire.writable.set()
            return route.WireTransport(Mock(scope={"esker.socket": wire}, client=Mock(host=name)), long)

        loop.call_soon(count)
        text = (b"x" * (3 * route.FRAGMENT_BYTES),)
        await asyncio.gather(*(transport(name).send_long(text, Mock()) for name in ("ada", "ben")))
        assert [name for name, _ in went[1:5]] in (["ada", "ben"] * 2, ["ben", "ada"] * 2), "addresses have turns"
        assert len({each for _, each in went}) == len(went) == 6, "one in a round of the loop"

    asyncio.run(run())


def test_a_long_text_arrives_whole_from_its_parts() -> None:
    async def run() -> None:
        wire = Wire()
        await settle()
        wire.take()
        parts = ("é".encode() * 7, "ü".encode() * route.FRAGMENT_BYTES, b'"}')
        went_on = Mock()
        await route.WireTransport(Mock(scope=wire.scope, client=None), Turnstile()).send_long(parts, went_on)
        frames: Any = wire.take()
        assert b"".join(bytes(frame.data) for frame in frames) == b"".join(parts)
        assert [frame.fin for frame in frames] == [False] * (len(frames) - 1) + [True]
        assert went_on.call_count == len(frames) == 4
        wire.server.connection_lost(None)
        await settle()

    asyncio.run(run())


# --- what waits -----------------------------------------------------------------------------------------------------


def test_what_waits_for_all_is_bounded_and_who_has_little_goes_on() -> None:
    waiting = Waiting(3 * FEW_BYTES)
    slow = [Outbox(lambda: None, waiting=waiting) for _ in range(4)]
    text = "x" * (FEW_BYTES - 10)
    for outbox in slow[:3]:
        outbox.push(text)
    slow[0].push("y" * 20)
    assert slow[0].closing is None
    slow[0].push("y" * 20)
    assert slow[0].closing == ("slow_client", "Your connection did not keep up. It will resume by itself.")
    assert waiting.held == 2 * len(text)
    slow[3].push(text)
    slow[3].push("z")
    assert slow[3].closing is None, "it has no more than a few"
    slow[1].pop()
    assert waiting.held == 3 * len(text) + 1, "what was taken waits until it has left"
    slow[1].sent()
    assert waiting.held == 2 * len(text) + 1
    slow[2].drop()
    slow[3].drop()
    assert waiting.held == 0


def test_what_waits_has_a_share_by_address_and_by_link() -> None:
    """SPEC A442: one address with many connections that do not read held all that might wait for everybody."""
    waiting = Waiting(40 * FEW_BYTES)
    text = "x" * (2 * FEW_BYTES)

    def comes(address: str, link: str = "") -> Outbox:
        outbox = Outbox(lambda: None, waiting=waiting, who=Who(address))
        outbox.belongs(link)
        outbox.push(text, counted=False)
        return outbox

    deaf = [comes("192.0.2.7") for _ in range(40)]
    assert sum(outbox.closing is None for outbox in deaf) == 5, "a quarter of all"
    assert waiting.of("address", "192.0.2.7") == 10 * FEW_BYTES == waiting.held
    by_link = [comes(f"198.51.100.{k}", "spread") for k in range(40)]
    assert sum(outbox.closing is None for outbox in by_link) == 5, "a link has no more from many addresses"
    assert comes("203.0.113.9", "another").closing is None, "there is room for others"
    many = [comes(f"2001:db8:7:{k}::1", f"link{k}") for k in range(40)]
    assert sum(outbox.closing is None for outbox in many) == 9, "a /48 has half, and all have all there is"
    assert deaf[0].pop() == text
    assert comes("192.0.2.7").closing is not None, "what was taken and has not left waits still"
    deaf[0].sent()
    assert comes("192.0.2.7").closing is None
    for outbox in deaf:
        outbox.drop()
    assert waiting.of("address", "192.0.2.7") == 2 * FEW_BYTES


def test_a_welcome_with_all_that_was_missed_counts() -> None:
    """SPEC A442: who resumes far behind gets megabytes of ops; each such text was one more copy that nobody counted."""
    waiting = Waiting(8 * FEW_BYTES)
    outbox = Outbox(lambda: None, limit=10, waiting=waiting, who=Who("192.0.2.7"))
    outbox.push("x" * FEW_BYTES, counted=False)
    outbox.push("12345")
    assert (outbox.backlog, outbox.closing, waiting.held) == (5, None, FEW_BYTES + 5)
    other = Outbox(lambda: None, waiting=waiting, who=Who("192.0.2.7"))
    other.push("x" * (2 * FEW_BYTES), counted=False)
    assert other.closing is not None


# --- open rooms -----------------------------------------------------------------------------------------------------


class Hall:
    """Rooms, some of which somebody is in."""

    def __init__(self, bound: Share) -> None:
        self.busy: set[str] = set()
        self.slept: list[str] = []
        self.rooms = OpenRooms(self.sleep, bound)

    def sleep(self, terrain: str) -> bool:
        if terrain in self.busy:
            return False
        self.slept.append(terrain)
        self.rooms.release(terrain)
        return True

    def open(self, *terrains: str, address: str = "192.0.2.1") -> None:
        for terrain in terrains:
            self.rooms.take(terrain, Who(address, "some link"))


def test_rooms_that_nobody_is_in_sleep_longest_unused_first() -> None:
    hall = Hall(Share(3))
    hall.open("a", "b", "c")
    hall.rooms.used("a")
    hall.open("d")
    assert hall.slept == ["b"]
    hall.busy = {"c", "a"}
    hall.open("e")
    assert hall.slept == ["b", "d"]
    hall.busy.add("e")
    with pytest.raises(Denied) as denied:
        hall.open("f")
    assert (denied.value.code, denied.value.message) == ("rate_limited", openrooms.FULL)
    hall.busy.clear()
    hall.open("f")
    assert len(hall.rooms) == 3


def test_an_address_has_a_share_and_makes_room_from_its_own() -> None:
    hall = Hall(Share(10, address=2))
    hall.open("other", address="192.0.2.9")
    hall.open("a", "b")
    hall.open("c")
    assert hall.slept == ["a"]
    hall.busy = {"b", "c"}
    with pytest.raises(Denied) as denied:
        hall.open("d")
    assert denied.value.message == openrooms.YOURS
    hall.open("e", address="192.0.2.9")
    assert hall.slept == ["a"]


def test_there_is_room_for_as_many_as_memory_has(monkeypatch: pytest.MonkeyPatch) -> None:
    for size, total in ((512 << 20, 8), (16 << 30, 128), (1 << 40, 256)):
        monkeypatch.setattr(memory, "available_bytes", lambda size=size: size)
        bound = openrooms.share()
        assert bound.total == total
        assert bound.address == total // 2


def test_a_room_in_which_nobody_does_anything_sleeps_for_somebody_who_comes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """SPEC A404: empty ones first, then one whose people are idle; ones in use never."""
    monkeypatch.setattr(openrooms, "share", lambda: shares.Share(2))
    with LiveServer(tmp_path) as server:
        places = [server.create() for _ in range(3)]
        active, idle = (server.join(*place) for place in places[:2])
        rooms = [server.assembly.hub.open_room(place[0]) for place in places[:2]]
        assert rooms[1] is not None
        idle.say("ping", t=0)
        idle.wait("pong")  # a welcome leaves before the room has noted that somebody came
        rooms[1]._active_at -= hub.REST_SECONDS
        idle.say("ping", t=1)
        idle.wait("pong")  # what a page says by itself is not activity
        newcomer = server.join(*places[2])
        number, error = idle.closed()
        assert error is not None
        assert (number, error["message"]) == (c.WS_CLOSE["room_full"], hub.RESTED)
        active.say("ping", t=1)
        active.wait("pong")
        newcomer.close()
        active.close()


def test_a_server_with_all_its_rooms_in_use_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(openrooms, "share", lambda: shares.Share(2))
    with LiveServer(tmp_path) as server:
        places = [server.create() for _ in range(4)]
        first, second = (server.join(*place) for place in places[:2])
        late = Peer(server.socket())
        terrain, secret = places[2]
        late.say("hello", protocol=c.PROTOCOL_VERSION, terrain=terrain, secret=secret, client="late")
        number, error = late.closed()
        assert error is not None
        assert (number, error["message"]) == (c.WS_CLOSE["rate_limited"], openrooms.FULL)
        first.say("ping", t=1)
        first.wait("pong")
        second.close()
        first.close()


def test_what_a_room_held_goes_back_to_the_system_after_it_closed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """SPEC P231. The C library keeps what it can: without being told, until it is asked for more."""
    given = threading.Event()
    with LiveServer(tmp_path) as server:
        hub = server.assembly.hub
        terrain, secret = server.create()
        peer = server.join(terrain, secret)
        room = hub.open_room(terrain)
        assert room is not None
        monkeypatch.setattr("esker.session.room.openrooms.GIVE_BACK_SECONDS", 0.0)
        monkeypatch.setattr("esker.session.room.openrooms.system.give_memory_back", given.set)
        room._loop.call_soon_threadsafe(hub._close_idle, terrain)
        peer.say("ping", t=1)
        peer.wait("pong")
        assert not given.is_set(), "somebody is in it"
        peer.close()
        deadline = 60.0
        while hub.open_room(terrain) is not None and not given.wait(0.01):
            room._loop.call_soon_threadsafe(hub._close_idle, terrain)
        assert given.wait(deadline)
        assert room.closed
        assert len(hub._places) == 0


def test_a_server_that_ends_gives_no_memory_back(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its loop takes no more work for other threads, and the timer said so in the log now and then."""
    given = Mock()
    monkeypatch.setattr(openrooms, "GIVE_BACK_SECONDS", 0.01)
    monkeypatch.setattr("esker.process.system.give_memory_back", given)

    async def ending() -> None:
        rooms = openrooms.ClosedRooms()
        rooms.give_back_soon()
        await asyncio.sleep(0.1)
        assert given.call_count == 1
        rooms.give_back_soon()
        rooms.end()
        at_rest = openrooms.ClosedRooms()
        at_rest.end()
        at_rest.give_back_soon()
        await asyncio.sleep(0.1)

    asyncio.run(ending())
    assert given.call_count == 1
