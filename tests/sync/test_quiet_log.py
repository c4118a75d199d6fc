"""What strangers break off or garble is no fault of the server's: no traceback in its log (SPEC J263)."""

from __future__ import annotations

import logging
import os
import socket
import struct
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from esker import contract as c
from esker.server.wire.websocket import WebSocketProtocol
from tests.sync.harness import LiveServer


@pytest.fixture
def server(tmp_path: Path) -> Iterator[LiveServer]:
    with LiveServer(tmp_path) as running:
        yield running


def _raw(server: LiveServer, head: str, body: bytes = b"") -> socket.socket:
    connection = socket.create_connection(("127.0.0.1", server.port), timeout=20)
    connection.sendall(head.replace("\n", "\r\n").encode() + body)
    return connection


def _cut(connection: socket.socket) -> None:
    """Resets it: the server's next read and its next write both fail."""
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    connection.close()


def _upload(server: LiveServer, path: str, secret: str = "") -> socket.socket:
    authorised = f"Authorization: Bearer {secret}\n" if secret else ""
    head = f"POST {path} HTTP/1.1\nHost: 127.0.0.1:{server.port}\n{authorised}Content-Length: 100000\n\n"
    return _raw(server, head, os.urandom(3000))


def _frame(opcode: int, payload: bytes) -> bytes:
    return bytes((0x80 | opcode, 0x80 | len(payload))) + bytes(4) + payload


def _open(server: LiveServer) -> socket.socket:
    head = (
        f"GET /ws HTTP/1.1\nHost: 127.0.0.1:{server.port}\nUpgrade: websocket\nConnection: Upgrade\n"
        f"Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\nSec-WebSocket-Version: 13\n"
        f"Sec-WebSocket-Protocol: {c.SUBPROTOCOL}\n\n"
    )
    connection = _raw(server, head)
    assert b"101" in connection.recv(4096)
    return connection


def test_cut_off_uploads_and_garbled_frames_leave_no_traceback(
    server: LiveServer, caplog: pytest.LogCaptureFixture
) -> None:
    terrain, secret = server.create()
    with caplog.at_level(logging.INFO):
        for path, key in (
            ("/api/terrains/import", ""),
            ("/api/terrains/from-grid?name=a.tif", ""),
            (f"/api/terrains/{terrain}/imports?name=a.tif", secret),
            ("/api/terrains", ""),
            ("/api/join", ""),
        ):
            _cut(_upload(server, path, key))
        for frame in (
            _frame(1, b"\xff\xfe\xfa"),
            _frame(1, b"\xed\xa0\x80"),
            _frame(8, b"\x03\xe8\xff\xff"),
            _frame(8, b"\x01"),
            _frame(3, b"x"),
            _frame(9, b"x" * 125),
            b"\xff" * 40,
        ):
            connection = _open(server)
            connection.sendall(frame)
            connection.settimeout(1)  # a ping is answered, and hung up on by nobody
            try:
                while connection.recv(4096):
                    pass
            except OSError:
                pass
            connection.close()
        for line in ("GET / HTTP/1.1\nHost: \xff\n\n", "GET /\x00 HTTP/1.1\nHost: x\n\n", "nonsense\n\n"):
            _cut(_raw(server, line))
        time.sleep(0.5)
        assert server.http("GET", "/healthz")[0] == 200
    left = list(server.assembly._grids.folder.glob(".work-*"))
    wrong = [r for r in caplog.records if r.exc_info or "Traceback" in r.getMessage() or r.levelno >= logging.ERROR]
    assert [f"{r.name}: {r.getMessage()}" for r in wrong] == []
    assert left == []


UPGRADE = "GET /ws HTTP/1.1\nHost: x\nUpgrade: websocket\nConnection: Upgrade\n"
KEY = "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\nSec-WebSocket-Version: 13\n"
NO_OPENINGS = {
    "with a body": f"{UPGRADE}{KEY}Content-Length: 2\n\n",
    "with a body without end": f"{UPGRADE}{KEY}Transfer-Encoding: chunked\n\n",
    "with a body that never comes": f"{UPGRADE}Content-Length: 9999999\n\n",
    "without a key": f"{UPGRADE}\n",
}


@pytest.mark.parametrize("kind", NO_OPENINGS)
def test_what_is_no_opening_of_a_websocket_is_answered(server: LiveServer, kind: str) -> None:
    """SPEC P450: such a connection was kept for ever, without a word."""
    with _raw(server, NO_OPENINGS[kind]) as connection:
        assert connection.recv(4096).startswith(b"HTTP/1.1 400 ")
        while connection.recv(4096):
            pass


@pytest.mark.parametrize("kind", NO_OPENINGS)
def test_no_connection_keeps_a_server_from_stopping(
    tmp_path: Path, kind: str, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """SPEC P450: one like that ended the stop with an error, before rooms were told and closed."""
    monkeypatch.setattr(WebSocketProtocol, "_refuse_handshake", lambda _: None)  # so that it stays
    with caplog.at_level(logging.INFO), LiveServer(tmp_path) as server:
        terrain, secret = server.create()
        peer = server.join(terrain, secret)
        odd = _raw(server, NO_OPENINGS[kind], b"xx")
        assert server.http("GET", "/healthz")[0] == 200
        server.stop()
        code, error = peer.closed()
        odd.close()
    assert error is not None
    assert (error["code"], code) == ("shutting_down", c.WS_CLOSE["shutting_down"])
    assert [r.getMessage() for r in caplog.records if r.exc_info or r.levelno >= logging.ERROR] == []


@pytest.mark.parametrize("origin", ["http://[", "http://[::1", "http://a]b"])
def test_an_origin_that_is_no_address_is_refused(
    server: LiveServer, origin: str, caplog: pytest.LogCaptureFixture
) -> None:
    """SPEC P450: of a change and of a socket; it was an error of the server's, with a traceback."""
    with caplog.at_level(logging.INFO):
        change = f"POST /api/terrains HTTP/1.1\nHost: localhost\nOrigin: {origin}\nContent-Length: 2\n\n"
        with _raw(server, change, b"{}") as connection:
            assert connection.recv(4096).startswith(b"HTTP/1.1 403 ")
        with _raw(server, f"{UPGRADE.replace('Host: x', 'Host: localhost')}{KEY}Origin: {origin}\n\n") as connection:
            told = b""
            while b"bad_origin" not in told and (data := connection.recv(4096)):
                told += data
            assert b"bad_origin" in told
    assert [r.getMessage() for r in caplog.records if r.exc_info or r.levelno >= logging.ERROR] == []
