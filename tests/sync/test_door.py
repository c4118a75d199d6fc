"""One port for HTTPS and for plain HTTP, which is sent there (SPEC P340, P341). Raw sockets: no client is so rude."""

from __future__ import annotations

import asyncio
import socket
import ssl
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from esker.server.wire import door
from esker.server.wire.door import redirected
from tests.sync.harness import LiveServer

PATIENCE = 60.0


@pytest.fixture(scope="module")
def lan(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LiveServer]:
    with LiveServer(tmp_path_factory.mktemp("lan"), lan=True) as server:
        yield server


def _connected(server: LiveServer) -> socket.socket:
    return socket.create_connection(("127.0.0.1", server.port), timeout=PATIENCE)


def _all(connection: socket.socket) -> bytes:
    """What comes until the server closes."""
    got = b""
    while True:
        try:
            more = connection.recv(65536)
        except ConnectionResetError:
            return got
        if not more:
            return got
        got += more


def _healthy(server: LiveServer) -> bool:
    """Whether somebody who speaks TLS is served now."""
    context = ssl.create_default_context()
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    with _connected(server) as plain, context.wrap_socket(plain) as connection:
        connection.sendall(b"GET /healthz HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n")
        return _all(connection).startswith(b"HTTP/1.1 200")


def test_a_typed_address_is_sent_to_https(lan: LiveServer) -> None:
    with _connected(lan) as connection:
        connection.sendall(b"GET /t/abc?p=1 HTTP/1.1\r\nHost: 192.168.1.20:8000\r\nAccept: */*\r\n\r\n")
        answer = _all(connection)
    head = answer.partition(b"\r\n\r\n")[0].split(b"\r\n")
    assert head[0] == b"HTTP/1.1 307 Temporary Redirect"
    assert b"Location: https://192.168.1.20:8000/t/abc?p=1" in head
    assert _healthy(lan)


def test_a_slow_peer_is_redirected_and_holds_nobody_up(lan: LiveServer) -> None:
    with _connected(lan) as slow, _connected(lan) as silent:
        assert _healthy(lan), "beside one that says nothing"
        for part in (b"G", b"ET / HT", b"TP/1.1\r\nHo", b"st: a.example\r\n", b"\r\n"):
            slow.sendall(part)
            assert _healthy(lan), "and one that speaks byte by byte"
        assert b"Location: https://a.example/\r\n" in _all(slow)
        silent.sendall(b"\x16")  # the first byte of TLS, and no more: it waits for a handshake
        assert _healthy(lan)


@pytest.mark.parametrize(
    "request_",
    [
        b"GET http://elsewhere.example/ HTTP/1.1\r\n\r\n",
        b"nonsense\r\n\r\n",
        b"GET /\x00 HTTP/1.1\r\n\r\n",
        b"SSH-2.0-OpenSSH_9.2\r\n\r\n",
    ],
)
def test_what_is_no_request_is_refused(lan: LiveServer, request_: bytes) -> None:
    with _connected(lan) as connection:
        connection.sendall(request_)
        answer = _all(connection)
    assert answer.startswith(b"HTTP/1.1 400 ")
    assert b"Location" not in answer


def test_a_host_that_may_not_stand_in_a_header_is_not_repeated() -> None:
    for host in (b"a b", b"evil\r\nSet-Cookie: x=1", b"", b"a/b", b"user@host", b"x" * 300):
        answer = redirected(b"GET / HTTP/1.1\r\nHost: " + host + b"\r\n\r\n", "10.0.0.2:8000")
        assert b"Location: https://10.0.0.2:8000/\r\n" in answer or b"Location: https://evil/" in answer
        assert b"Set-Cookie" not in answer
    assert b"Location: https://[fe80::1]:8000/x\r\n" in redirected(b"GET /x HTTP/1.0\nHOST:[fe80::1]:8000\n\n", "y")


def test_a_header_without_end_is_dropped(lan: LiveServer) -> None:
    with _connected(lan) as connection:
        connection.sendall(b"GET / HTTP/1.1\r\n" + b"X: y\r\n" * (door.MAX_HEADER_BYTES // 6 + 1))
        assert _all(connection) == b""


def test_silence_ends(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Who says nothing, and who begins a plain request and stops, is dropped; more than so many silent ones are not."""
    monkeypatch.setattr(door, "FIRST_BYTE_SECONDS", 0.2)
    monkeypatch.setattr(door, "HEADER_SECONDS", 0.2)
    monkeypatch.setattr(door, "HANDSHAKE_SECONDS", 0.2)
    with LiveServer(tmp_path, lan=True) as server:
        for beginning in (b"", b"GET / HT", b"\x16\x03"):
            with _connected(server) as connection:
                connection.sendall(beginning)
                assert _all(connection) == b""
        monkeypatch.setattr(door, "FIRST_BYTE_SECONDS", 600.0)
        monkeypatch.setattr(door, "WAITING", 2)
        with _connected(server) as oldest, _connected(server), _connected(server):
            assert _all(oldest) == b""
            assert _healthy(server)


def test_a_door_that_is_closed_lets_go_of_all() -> None:
    async def open_and_close() -> None:
        with socket.socket() as listener:
            listener.bind(("127.0.0.1", 0))
            made = door.Door(listener, ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER), asyncio.Protocol, "x")
            with socket.create_connection(listener.getsockname(), timeout=PATIENCE) as connection:
                made.close()
                made.close()
                await made.wait_closed()
                listener.close()
                assert await asyncio.to_thread(_all, connection) == b""

    before = set(threading.enumerate())
    asyncio.run(open_and_close())
    assert not [thread for thread in threading.enumerate() if thread.name == "door" and thread not in before]
