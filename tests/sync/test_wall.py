"""The wall: every copy through one socket (SPEC L86 to L93)."""

from __future__ import annotations

import json
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from esker import contract as c
from esker.fairness.shares import Rates
from esker.grid import TileKey, quantum
from esker.tiles.decoder import FrameDecoder
from tests.sync.harness import PATIENCE, LiveServer, stroke
from tests.sync.test_classes import Pupil, Teacher


class Wall:
    """A wall by hand: facts of the copies, and the tiles of each as its own decoder holds them."""

    def __init__(self, server: LiveServer, **hello: Any) -> None:
        url = f"ws://127.0.0.1:{server.port}/ws/wall"
        protocols: Any = [c.SUBPROTOCOL]
        options: Any = {"compression": None, "proxy": None, "ping_interval": None}
        self.ws = connect(url, subprotocols=protocols, **options).__enter__()  # closed by hand
        self.copies: dict[int, dict[str, Any]] = {}
        self.state: dict[str, Any] = {}
        self.decoders: dict[int, FrameDecoder] = {}
        self.bytes = 0
        self.levels: set[int] = set()
        self.say("wall", **({"protocol": c.PROTOCOL_VERSION} | hello))

    def say(self, kind: str, **fields: Any) -> None:
        self.ws.send(json.dumps({"type": kind, **fields}))

    def read(self, timeout: float = PATIENCE) -> None:
        """One message."""
        message = self.ws.recv(timeout=timeout)
        if isinstance(message, str):
            found = json.loads(message)
            if found["type"] == "wall":
                self.state = found
                self.copies |= {each["number"]: each for each in found["copies"]}
            return
        self.bytes += len(message)
        number, fresh, _ = np.frombuffer(message[:4], dtype=c.WALL_HEADER)[0]
        if fresh:
            self.decoders[int(number)] = FrameDecoder()
        self.levels.add(self.decoders[int(number)].decode(message[4:]).level)

    def until(self, found: Any) -> None:
        """Reads until something is so."""
        deadline = time.monotonic() + PATIENCE
        while not found():
            self.read(max(0.01, deadline - time.monotonic()))

    def height(self, number: int) -> float | None:
        """Of the copy's south-western corner, metres."""
        decoder = self.decoders.get(number)
        held = None if decoder is None else decoder.held.get(TileKey(0, 0, 0))
        return None if held is None else float(held.samples[0, 0]) * quantum(0, c.DEFAULT_SIZE_M)

    def closed(self) -> int:
        """The code by which the server closes."""
        try:
            while True:
                self.read()
        except ConnectionClosed as closed:
            return closed.rcvd.code if closed.rcvd is not None else 1006


@pytest.fixture(name="teacher")
def _teacher(server: LiveServer) -> Teacher:
    state: Any = server.state
    state.new_terrains, state.code_tries = Rates(), Rates()
    return Teacher(server)


def _wall(teacher: Teacher, **over: Any) -> Wall:
    told = {"terrain": teacher.terrain, "secret": teacher.secret, "lesson": teacher.made["id"]}
    return Wall(teacher.server, **(told | over))


def test_every_copy_is_drawn_as_it_changes(server: LiveServer, teacher: Teacher) -> None:
    """SPEC L86, L87: who is there, when it was changed, how its ground lies; who comes later too."""
    ada = Pupil(teacher, "Ada")
    with_ada = ada.join("wada1")
    wall = _wall(teacher)
    wall.until(lambda: 1 in wall.decoders and wall.copies.get(1, {}).get("online") == 1)
    assert (wall.copies[1]["names"], wall.copies[1]["last"], wall.height(1)) == (["Ada"], None, 0.0)
    assert (wall.state["code"], wall.state["title"], wall.state["show"]) == (teacher.made["code"], "Valley", None)
    with_ada.ops(("wada1:1", stroke("s1", 40.0)))
    wall.until(lambda: wall.height(1) == 40.0 and wall.copies[1]["strokes"] == 1)
    assert wall.copies[1]["last"] is not None
    assert Pupil(teacher, "Ben").status == 201
    wall.until(lambda: 2 in wall.copies and 2 in wall.decoders)
    assert teacher.ask("freeze", {"frozen": True, "numbers": [2]})[0] == 200
    wall.until(lambda: wall.copies[2]["frozen"])
    with_ada.close()
    wall.until(lambda: wall.copies[1]["online"] == 0)
    assert wall.levels <= {0, 1}
    wall.ws.close()


def test_sleeping_copies_are_drawn_and_sleep_on(tmp_path: Path) -> None:
    """SPEC L88: after a restart nobody has them open; the wall shows them, and then no room is held."""
    with LiveServer(tmp_path) as server:
        teacher = Teacher(server)
        for n in range(5):
            peer = Pupil(teacher, f"P{n}").join(f"sleep{n}")
            peer.ops((f"sleep{n}:1", stroke("s1", 10.0 * (n + 1))))
            peer.wait("ack")
    with LiveServer(tmp_path) as server:
        teacher.server = server
        wall = _wall(teacher)
        wall.until(lambda: [wall.height(n + 1) for n in range(5)] == [10, 20, 30, 40, 50])
        deadline = time.monotonic() + PATIENCE
        while server.assembly.hub.open_rooms and time.monotonic() < deadline:
            time.sleep(0.05)
        assert server.assembly.hub.open_rooms == 0
        wall.until(lambda: all(wall.copies[n + 1]["strokes"] == 1 for n in range(5)))


def test_nothing_is_sent_while_nobody_draws(teacher: Teacher) -> None:
    """SPEC L89."""
    ada = Pupil(teacher, "Ada")
    with_ada = ada.join("wada2")
    with_ada.settled(0)
    wall = _wall(teacher)
    wall.until(lambda: 1 in wall.decoders and wall.copies.get(1, {}).get("online") == 1)
    assert [_quiet(wall) for _ in range(20)][-1]


def _quiet(wall: Wall) -> bool:
    """Reads one message; whether none came for a while."""
    try:
        wall.read(timeout=0.3)
    except TimeoutError:
        return True
    return False


def test_copies_that_are_compared_come_finer(teacher: Teacher) -> None:
    """SPEC L90: as fine as the server solves, up to WALL_CLOSE_LEVEL; two at most, no copy of another class."""
    ada = Pupil(teacher, "Ada")
    ada.join("wada3").settled(0)
    wall = _wall(teacher)
    wall.until(lambda: 1 in wall.decoders)
    first = wall.decoders[1]
    wall.say("focus", numbers=[1])
    wall.until(lambda: wall.decoders[1] is not first)
    wall.say("focus", numbers=[7])  # nobody's
    wall.say("focus", numbers=[1, 2, 3])
    assert wall.closed() == c.WS_CLOSE["malformed"]


def test_who_is_no_owner_sees_no_wall(server: LiveServer, teacher: Teacher) -> None:
    """SPEC L91: no viewer, no editor, no pupil, no owner of another terrain; nothing is told before."""
    ada = Pupil(teacher, "Ada")
    for role in ("view", "edit"):
        _, link = server.http("POST", f"/api/terrains/{teacher.terrain}/links", {"role": role}, teacher.secret)
        wall = _wall(teacher, secret=link["secret"])
        assert (wall.closed(), wall.copies) == (c.WS_CLOSE["bad_secret"], {})
    assert _wall(teacher, secret=ada.seat).closed() == c.WS_CLOSE["bad_secret"]
    assert _wall(teacher, secret=ada.seat, terrain=ada.terrain).closed() == c.WS_CLOSE["bad_secret"]
    other = Teacher(server)
    assert _wall(other, lesson=teacher.made["id"]).closed() == c.WS_CLOSE["no_terrain"]
    assert _wall(teacher, protocol=1).closed() == c.WS_CLOSE["bad_protocol"]
    assert _wall(teacher, lesson="x" * 41).closed() == c.WS_CLOSE["malformed"]


def test_a_wall_ends_with_its_link_and_with_its_class(server: LiveServer, teacher: Teacher) -> None:
    """SPEC L92."""
    _, second = server.http("POST", f"/api/terrains/{teacher.terrain}/links", {"role": "owner"}, teacher.secret)
    theirs, mine = _wall(teacher, secret=second["secret"]), _wall(teacher)
    theirs.until(lambda: theirs.state)
    server.http("DELETE", f"/api/terrains/{teacher.terrain}/links/{second['id']}", secret=teacher.secret)
    assert theirs.closed() == c.WS_CLOSE["revoked"]
    server.http("DELETE", teacher.path, secret=teacher.secret)
    assert mine.closed() == c.WS_CLOSE["no_terrain"]


def test_a_wall_that_says_nonsense_is_closed(teacher: Teacher) -> None:
    """SPEC L93: text that is no message, binary, a second hello, too much."""
    for nonsense in ("{", json.dumps({"type": "ops", "ops": []}), "x" * 20_000, b"\0"):
        wall = _wall(teacher)
        wall.until(lambda wall=wall: wall.state)
        wall.ws.send(nonsense)
        assert wall.closed() == c.WS_CLOSE["malformed"]
    wall = _wall(teacher)
    with suppress(ConnectionClosed):  # the server closes before the last of them where it is quick
        for _ in range(100):
            wall.say("focus", numbers=[])
    assert wall.closed() == c.WS_CLOSE["rate_limited"]
