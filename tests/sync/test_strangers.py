"""A stranger, or a member of another room, takes nobody's time (SPEC P222 to P224)."""

from __future__ import annotations

import json
import socket
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from websockets.client import ClientProtocol
from websockets.typing import Subprotocol
from websockets.uri import parse_uri

from esker import contract as c
from tests.sync.harness import LiveServer, set_op, stroke

MASK = b"\0\0\0\0"
PINGS = (b"\x89\x80" + MASK) * 10_000
EMPTY = (b"\x00\x80" + MASK) * 10_000
BAD_OPS = {"type": "ops", "ops": [{"id": f"c9:{n}", "op": {"type": "stroke.begin"}} for n in range(256)]}


def frame(text: str, fin: bool = True) -> bytes:
    data = text.encode()
    return bytes([0x81 if fin else 1, 0x80 | 126]) + len(data).to_bytes(2) + MASK + data


class Attacker:
    """Bytes as fast as they go, on a plain socket, until the server ends it."""

    def __init__(self, server: LiveServer, hello: dict[str, Any] | None, flood: bytes, first: bytes = b"") -> None:
        self.ended = threading.Event()
        self.socket = socket.create_connection(("127.0.0.1", server.port))
        place, spoken = parse_uri(f"ws://127.0.0.1:{server.port}/ws"), [Subprotocol(c.SUBPROTOCOL)]
        protocol = ClientProtocol(place, subprotocols=spoken)
        protocol.send_request(protocol.connect())
        self.socket.sendall(b"".join(protocol.data_to_send()))
        self.socket.recv(4096)
        if hello is not None:
            self.socket.sendall(frame(json.dumps(hello)))
        self.socket.sendall(first)
        self.flood = flood
        self.threads = [threading.Thread(target=work, daemon=True) for work in (self._read, self._write)]
        for thread in self.threads:
            thread.start()

    def close(self) -> None:
        self.ended.set()
        with suppress(OSError):
            self.socket.shutdown(socket.SHUT_RDWR)
        for thread in self.threads:
            thread.join(30)
        self.socket.close()

    def _write(self) -> None:
        try:
            while not self.ended.is_set():
                self.socket.sendall(self.flood)
        except OSError:
            self.ended.set()

    def _read(self) -> None:
        try:
            while self.socket.recv(1 << 16):
                pass
        except OSError:
            pass
        self.ended.set()


FLOODS: dict[str, Callable[[], tuple[bytes, bytes]]] = {
    "pings": lambda: (PINGS, b""),
    "empty frames": lambda: (EMPTY, frame("x" * 200, fin=False)),
    "bad ops": lambda: (frame(json.dumps(BAD_OPS)) * 8, b""),
}


@pytest.mark.parametrize("member", [False, True], ids=["stranger", "member"])
@pytest.mark.parametrize("kind", list(FLOODS))
def test_a_flood_ends_and_a_bystander_in_another_room_is_served(tmp_path: Path, kind: str, member: bool) -> None:
    """He waited 11.5, 10.4 and 1.35 s. This tests that an attack ends; how long others wait is measured."""
    with LiveServer(tmp_path) as server:
        calm = server.join(*server.create())
        terrain, secret = server.create()
        hello = {"type": "hello", "protocol": c.PROTOCOL_VERSION, "terrain": terrain, "secret": secret, "client": "c9"}
        flood, first = FLOODS[kind]()
        attacker = Attacker(server, hello if member else None, flood, first)
        n, deadline = 0, time.monotonic() + 60
        while not attacker.ended.is_set():
            assert time.monotonic() < deadline, "the flood goes on"
            n += 1
            calm.ops((f"c1:{n}", stroke() if n == 1 else set_op(first=[100, 100, float(n)])))
            assert calm.wait("ack")["ids"] == [f"c1:{n}"]
            time.sleep(0.01)
        attacker.close()
        calm.say("ping", t=1)
        calm.wait("pong")
        calm.close()


def test_who_is_ended_for_too_much_work_may_come_back(tmp_path: Path) -> None:
    with LiveServer(tmp_path) as server:
        terrain, secret = server.create()
        greedy = server.join(terrain, secret)
        for _ in range(6):
            greedy.ws.send(json.dumps(BAD_OPS))
        number, error = greedy.closed()
        assert error is not None
        assert (number, error["code"]) == (c.WS_CLOSE["rate_limited"], "rate_limited")
        server.join(terrain, secret).close()


def test_requests_that_do_not_wait_for_answers_are_few(tmp_path: Path) -> None:
    """SPEC P451: a quarter of a megabyte of requests was parsed at once, and kept as ten thousand of them."""
    with LiveServer(tmp_path) as live, socket.create_connection(("127.0.0.1", live.port), timeout=20) as flood:
        flood.sendall(b"GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n" * 1_000)
        told = b""
        with suppress(ConnectionResetError):
            while data := flood.recv(65536):
                told += data
        assert told.count(b"HTTP/1.1 200") < 100, "it is closed after the first read that brings more than a few"
        assert live.http("GET", "/healthz")[0] == 200
