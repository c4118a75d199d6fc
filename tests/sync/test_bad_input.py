"""The list of bad input of the issue, one by one, over a real socket (SPEC P3 to P12).

Each has a defined code and a sentence, closes at most its own connection, and loses nothing: a witness stays in the
room throughout and the document is what it was.
"""

from __future__ import annotations

import json
import logging
from collections.abc import Iterator
from contextlib import suppress
from typing import Any

import pytest

from esker import contract as c
from tests.sync.harness import LiveServer, Peer, set_op, stroke


class Scene:
    """A terrain with one stroke and a witness who must not be disturbed."""

    def __init__(self, server: LiveServer) -> None:
        self.server = server
        self.terrain, self.secret = server.create()
        self.witness = server.join(self.terrain, self.secret, "witness")
        self.witness.ops(("witness:1", stroke("s1")), ("witness:2", stroke("locked")), ("witness:3", stroke("gone")))
        self.witness.ops(
            ("witness:4", set_op("locked", locked=True)), ("witness:5", {"type": "stroke.delete", "stroke": "gone"})
        )
        while self.witness.wait("ack")["clocks"][-1] < 5:
            pass
        self.peer = server.join(self.terrain, self.secret, "c1")

    def check(self) -> None:
        """The witness is online, the document is untouched."""
        self.witness.say("ping", t=1.5)
        assert self.witness.wait("pong")["t"] == 1.5
        assert all(message["type"] != "error" for message in self.witness.seen)
        status, about = self.server.http("GET", f"/api/terrains/{self.terrain}", secret=self.secret)
        assert (status, about["clock"], about["strokes"]) == (200, 5, 2)

    def closes(self, code: str) -> str:
        """The peer is closed with ``code``; returns the sentence."""
        number, error = self.peer.closed()
        assert error is not None, "closed without a reason"
        assert (error["code"], error["fatal"], number) == (code, True, c.WS_CLOSE[code])
        assert len(error["message"]) > 15
        self.check()
        return str(error["message"])

    def refuses(self, op: Any, code: str) -> str:
        """The peer's op is refused with ``code``; the peer stays; returns the sentence."""
        self.peer.say("ops", ops=[{"id": "c1:1", "op": op}])
        answer = self.peer.wait("reject", "ack", "error")
        assert (answer["type"], answer.get("id"), answer.get("code")) == ("reject", "c1:1", code)
        assert len(answer["message"]) > 15
        self.peer.say("ping", t=2.0)
        assert self.peer.wait("pong")["t"] == 2.0
        self.check()
        return str(answer["message"])


@pytest.fixture
def scene(server: LiveServer) -> Iterator[Scene]:
    made = Scene(server)
    yield made
    made.peer.close()
    made.witness.close()


@pytest.mark.parametrize(
    "text", ["{", "", "[]", "1", '{"type":"teleport"}', '{"type":"ops"}', "\x00", '{"type":"ping"}']
)
def test_malformed_json_and_unknown_messages(scene: Scene, text: str) -> None:
    scene.peer.ws.send(text)
    scene.closes("malformed")


def test_deeply_nested_json(scene: Scene) -> None:
    scene.peer.ws.send("[" * 30_000 + "]" * 30_000)
    scene.closes("malformed")


def test_the_close_is_logged_in_one_line(scene: Scene, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO, "esker"):
        scene.peer.ws.send("{")
        scene.closes("malformed")
    lines = [r.getMessage() for r in caplog.records if r.name.startswith("esker")]
    assert len([line for line in lines if "malformed" in line]) == 1
    assert not any(scene.secret in line for line in lines)


@pytest.mark.parametrize("name", ["\n2026 I esker: all is well\x1b[2J", "山" * 300, "é" * 9_000])
def test_a_field_named_to_spoil_the_log(scene: Scene, name: str, caplog: pytest.LogCaptureFixture) -> None:
    """SPEC P126."""
    with caplog.at_level(logging.INFO, "esker"):
        scene.peer.say("ping", **{"t": 1.0, name: 1})
        sentence = scene.closes("malformed")
    assert len(sentence) < 900
    assert sentence.isascii()
    assert sentence.isprintable()
    lines = [r.getMessage() for r in caplog.records if r.name.startswith("esker") and "malformed" in r.getMessage()]
    assert len(lines) == 1
    assert lines[0].isprintable()
    assert not [r for r in caplog.records if r.levelno >= logging.ERROR]


def test_unknown_op(scene: Scene) -> None:
    scene.refuses({"type": "stroke.explode", "stroke": "s1"}, "malformed")


@pytest.mark.parametrize(
    "fields",
    [{"label": 5}, {"hidden": "yes"}, {"curve": "line"}, {"left": 3}, {"nonsense": 1}, {"plateau_radius_m": "12"}],
)
def test_wrong_types(scene: Scene, fields: dict[str, Any]) -> None:
    scene.refuses(set_op(**fields), "malformed")


@pytest.mark.parametrize("number", ["NaN", "Infinity", "-Infinity", "1e999"])
def test_numbers_that_are_not_finite(scene: Scene, number: str) -> None:
    text = json.dumps(_ops({"type": "stroke.anchor", "stroke": "s1", "which": "last", "to": [0, "N", 0]}))
    scene.peer.ws.send(text.replace('"N"', number))
    answer = scene.peer.wait("reject", "error")
    assert (answer["type"], answer["code"]) == ("reject", "out_of_domain")
    scene.check()


@pytest.mark.parametrize("x", [40961, -40961, 700_000, 1e300])
def test_points_outside_ten_times_the_domain(scene: Scene, x: float) -> None:
    scene.refuses({"type": "stroke.anchor", "stroke": "s1", "which": "last", "to": [x, 0, 0]}, "out_of_domain")


def test_too_many_points_in_an_append(scene: Scene) -> None:
    points = [[0, 0]] * (c.MAX_POINTS_PER_APPEND + 1)
    op = {"type": "stroke.append", "stroke": "s1", "start": 0, "points": points, "last": [0, 0, 0]}
    scene.refuses(op, "too_many_points")


def test_too_many_points_in_a_curve(scene: Scene) -> None:
    scene.refuses(set_op(curve=[[0, 0]] * (c.MAX_POINTS_PER_STROKE + 1)), "too_many_points")


def _ops(op: Any) -> dict[str, Any]:
    return {"type": "ops", "ops": [{"id": "c1:1", "op": op}]}


def test_oversize_message(scene: Scene) -> None:
    scene.peer.ws.send(json.dumps({"type": "rename", "name": "x" * c.MAX_MESSAGE_BYTES}))
    scene.closes("too_large")


def test_oversize_in_bytes_not_in_characters(scene: Scene) -> None:
    text = json.dumps({"type": "rename", "name": "山" * 25_000}, ensure_ascii=False)
    assert len(text) < c.MAX_MESSAGE_BYTES < len(text.encode())
    scene.peer.ws.send(text)
    scene.closes("too_large")


def test_a_message_beyond_every_measure_is_cut_off(scene: Scene) -> None:
    from websockets.exceptions import ConnectionClosed

    with suppress(ConnectionClosed, OSError):
        scene.peer.ws.send("x" * (8 * c.MAX_MESSAGE_BYTES))
    assert scene.peer.closed()[0] in (1006, 1009)
    scene.check()


@pytest.mark.parametrize("data", [b"", b"\x00", b"KS\x01\x00" + bytes(12), bytes(70_000)])
def test_binary_from_a_client(scene: Scene, data: bytes) -> None:
    scene.peer.ws.send(data)
    scene.closes("malformed")


def _hello(scene: Scene, **over: Any) -> None:
    scene.peer.close()
    scene.peer = Peer(scene.server.socket())
    hello = {"protocol": c.PROTOCOL_VERSION, "terrain": scene.terrain, "secret": scene.secret, "client": "c2"}
    scene.peer.say("hello", **(hello | over))


def test_wrong_secret(scene: Scene) -> None:
    _hello(scene, secret="not-the-secret")
    scene.closes("bad_secret")


def test_secret_of_another_terrain(scene: Scene) -> None:
    _, other = scene.server.create()
    _hello(scene, secret=other)
    scene.closes("bad_secret")


def test_no_such_terrain(scene: Scene) -> None:
    _hello(scene, terrain="nowhere")
    scene.closes("no_terrain")


def test_unknown_protocol_version(scene: Scene) -> None:
    _hello(scene, protocol=99)
    assert str(c.PROTOCOL_VERSION) in scene.closes("bad_protocol")


@pytest.mark.parametrize("subprotocol", [None, "esker.99"])
def test_unknown_subprotocol(scene: Scene, subprotocol: str | None) -> None:
    scene.peer.close()
    scene.peer = Peer(scene.server.socket(subprotocol))
    assert c.SUBPROTOCOL in scene.closes("bad_protocol")


@pytest.mark.parametrize("first", [{"type": "ping", "t": 1}, {"type": "ops", "ops": []}, {"type": "hello"}])
def test_anything_but_a_hello_first(scene: Scene, first: dict[str, Any]) -> None:
    scene.peer.close()
    scene.peer = Peer(scene.server.socket())
    scene.peer.ws.send(json.dumps(first))
    scene.closes("bad_hello")


def test_hello_twice(scene: Scene) -> None:
    scene.peer.say("hello", protocol=c.PROTOCOL_VERSION, terrain=scene.terrain, secret=scene.secret, client="c1")
    scene.closes("bad_hello")


def test_a_page_of_another_site(scene: Scene) -> None:
    scene.peer.close()
    scene.peer = Peer(scene.server.socket(origin="https://evil.example"))
    scene.closes("bad_origin")


def test_the_own_site_is_welcome(scene: Scene) -> None:
    origin = f"http://127.0.0.1:{scene.server.port}"
    peer = Peer(scene.server.socket(origin=origin))
    peer.say("hello", protocol=c.PROTOCOL_VERSION, terrain=scene.terrain, secret=scene.secret, client="c3")
    assert peer.wait("welcome")["clock"] == 5
    peer.close()


@pytest.mark.parametrize(
    ("op", "code"),
    [
        (set_op("gone", label="x"), "deleted_stroke"),
        (set_op("locked", label="x"), "locked_stroke"),
        ({"type": "stroke.delete", "stroke": "locked"}, "locked_stroke"),
        (set_op("never", label="x"), "unknown_stroke"),
        (stroke("s1"), "duplicate_stroke"),
        ({"type": "stroke.append", "stroke": "s1", "start": 9, "points": [], "last": [0, 0, 0]}, "bad_index"),
        (set_op("s1", label=None), "bad_field"),
    ],
)
def test_ops_that_do_not_apply(scene: Scene, op: dict[str, Any], code: str) -> None:
    scene.refuses(op, code)


def test_an_op_under_the_id_of_another_client(scene: Scene) -> None:
    scene.peer.ops(("witness:99", set_op("s1", label="x")))
    answer = scene.peer.wait("reject")
    assert (answer["id"], answer["code"]) == ("witness:99", "malformed")
    scene.check()


def test_a_good_op_beside_a_bad_one_is_ordered(scene: Scene) -> None:
    scene.peer.ops(("c1:1", set_op("s1", label=7)), ("c1:2", {"type": "stroke.finish", "stroke": "s1"}))
    assert scene.peer.wait("reject")["id"] == "c1:1"
    assert scene.peer.wait("ack")["ids"] == ["c1:2"]


@pytest.mark.parametrize(
    "junk", [b"\x00" * 64, b"GET / HTTP/1.1\r\n\r\n" * 3, b"GET /ws HTTP/1.1\r\nUpgrade: x\r\n\r\n"]
)
def test_bytes_that_are_no_websocket(scene: Scene, junk: bytes) -> None:
    from tests.sync.harness import raw_socket

    with raw_socket(scene.server.port) as tcp:
        tcp.sendall(junk)
        tcp.settimeout(5)
        tcp.recv(65536)
    scene.check()


def test_a_broken_websocket_frame(scene: Scene) -> None:
    import os

    raw = scene.peer.ws.socket
    raw.sendall(os.urandom(256))
    number, _ = scene.peer.closed()
    assert number in (1002, 1006, 1007, 1009)
    scene.check()


def test_a_frame_that_stops_halfway(scene: Scene) -> None:
    scene.peer.ws.socket.sendall(b"\x81\xfe\x40\x00\x00\x00")
    scene.peer.ws.socket.close()
    scene.check()
