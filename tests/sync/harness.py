"""A real server in a thread of this process, with a solver that is arithmetic, and a plain websocket client."""

from __future__ import annotations

import asyncio
import gc
import itertools
import json
import socket
import ssl
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from websockets.sync.client import ClientConnection, connect

from esker import contract as c
from esker import grid
from esker.document.birth import new_document
from esker.events import BaseLevel, Preview, Settled
from esker.server.run import Assembly
from esker.server.settings import Settings

TOKENS: dict[tuple[str, str], str] = {}
"""By which client ids come again, as programs keep them: also to a server that was started anew."""
PATIENCE = 90.0
"""Seconds to wait for what must come, on a machine that has other things to do."""
STARTS = itertools.count()
"""Counts the servers of this process."""
LOOKED_EVERY = 16
"""One of so many servers looks for garbage in all that the process holds when it starts."""


def height_level(level: int, heights: NDArray[np.float32], settled: bool) -> Preview | Settled:
    """Heights of one level, as a solver yields them."""
    return Settled(level, heights) if settled else Preview(level, heights)


class PlainSolver:
    """Heights that depend on the strokes in the simplest way: the sum of the strokes' first anchors' heights."""

    device_name = "arithmetic"

    def steps(
        self, strokes: Sequence[c.Stroke], settings: c.TerrainSettings, levels: int | None = None, **_: Any
    ) -> Iterator[Preview | Settled]:
        assert settings.size_m > 0
        height = float(sum(s.first[2] for s in strokes))
        for settled in (False, True):
            for level in range((levels or 0) + 1):
                n = grid.samples(level)
                yield height_level(level, np.full((n, n), height, dtype=np.float32), settled)

    def channels(self, *_: Any, **__: Any) -> Iterator[Any]:
        return iter(())

    def base_levels(self, base: Any, levels: int) -> Iterator[BaseLevel]:
        for level in range(levels + 1):
            yield BaseLevel(level, base.level(level), c.Channel.BASE)
        for level in range(max(0, levels - c.CHANNEL_LEVELS_BELOW) + 1):
            yield BaseLevel(level, base.survey(level), c.Channel.SURVEY)

    def refiner(self, basis: object) -> Any:
        raise AssertionError(f"nobody was given {basis}")


def settings(data: Path, **over: Any) -> Settings:
    """Small, on a free port, without a page."""
    return replace(Settings(port=0, data=data, page=data / "none", level=1), **over)


class LiveServer:
    """``with LiveServer(tmp_path) as server``: runs until the block ends."""

    def __init__(self, data: Path, solver: Any = None, factory: Any = None, **over: Any) -> None:
        self.assembly = Assembly(settings(data, **over), factory or (lambda _: solver or PlainSolver()))
        self._server = self.assembly.server(announce=False)
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self.port = self.assembly.port

    def _serve(self) -> None:
        self.assembly.run(self._server)

    def __enter__(self) -> LiveServer:
        # A server starts by looking for garbage in its whole process. Here all modules of the tests are in the process:
        # the look takes half of what a start takes, and a server finds nothing of its own there.
        if next(STARTS) % LOOKED_EVERY:
            gc.freeze()
        else:
            gc.unfreeze()
        self._thread.start()
        deadline = time.monotonic() + 30
        while not self._server.started:
            assert time.monotonic() < deadline
            assert self._thread.is_alive()
            time.sleep(0.005)
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def stop(self) -> None:
        self._server.should_exit = True
        self._thread.join(timeout=30)
        self.assembly.close()
        gc.freeze()  # the server that ended took back what was set aside, all modules among it

    @property
    def base(self) -> str:
        return self.assembly.base

    @property
    def state(self) -> Any:
        """What the application holds for its routes."""
        app: Any = self._server.config.app
        return app.state

    # --- HTTP ---------------------------------------------------------------------------------------------------

    def http(self, method: str, path: str, body: Any = None, secret: str | None = None) -> tuple[int, Any]:
        """Status and decoded JSON (or bytes) of one request."""
        status, content, kind = self.raw(method, path, body, secret)
        return status, json.loads(content) if kind.startswith("application/json") and content else content

    def raw(self, method: str, path: str, body: Any = None, secret: str | None = None) -> tuple[int, bytes, str]:
        data = body if isinstance(body, bytes) or body is None else json.dumps(body).encode()
        headers = {"Content-Type": "application/json"} | ({"Authorization": f"Bearer {secret}"} if secret else {})
        request = urllib.request.Request(self.base + path, data=data, headers=headers, method=method)
        context = ssl._create_unverified_context() if self.base.startswith("https") else None
        try:
            with urllib.request.urlopen(request, timeout=90, context=context) as answer:
                return answer.status, answer.read(), answer.headers.get("Content-Type", "")
        except urllib.error.HTTPError as error:
            return error.code, error.read(), error.headers.get("Content-Type", "")

    def create(self, **document: Any) -> tuple[str, str]:
        """A new terrain past the rate limit by address: id and owner secret."""
        born, _, secret = asyncio.run(self.assembly.hub.create(new_document().model_copy(update=document)))
        return born.id, secret

    # --- websocket ----------------------------------------------------------------------------------------------

    def socket(self, subprotocol: str | None = c.SUBPROTOCOL, path: str = "/ws", **options: Any) -> ClientConnection:
        """An open websocket that has said nothing yet."""
        protocols: Any = [subprotocol] if subprotocol else None
        url = f"ws://127.0.0.1:{self.port}{path}"
        # Without pings of its own: a peer that a test leaves behind says nothing in the log of another.
        options = {"ping_interval": None, "proxy": None, "create_connection": Listening, **options}
        opening = connect(url, subprotocols=protocols, max_size=None, compression=None, **options)
        opened: ClientConnection = opening.__enter__()  # closed by hand
        return opened

    def join(self, terrain: str, secret: str, client: str = "c1", **hello: Any) -> Peer:
        """A member that has had its welcome."""
        peer = Peer(self.socket())
        hello = {"token": TOKENS.get((terrain, client)), **hello}
        peer.say("hello", protocol=c.PROTOCOL_VERSION, terrain=terrain, secret=secret, client=client, **hello)
        peer.welcome = peer.wait("welcome")
        TOKENS[terrain, client] = peer.welcome["token"]
        return peer


class Listening(ClientConnection):
    """A connection that keeps what it has read.

    The library forgets the messages that came together with a close frame where its answer finds nobody any more.
    """

    def send_data(self) -> None:
        try:
            super().send_data()
        except OSError:
            if threading.current_thread() is not self.recv_events_thread:
                raise


class Peer:
    """A client by hand."""

    def __init__(self, ws: ClientConnection) -> None:
        self.ws = ws
        self.welcome: dict[str, Any] = {}
        self.frames: list[bytes] = []
        self.seen: list[dict[str, Any]] = []

    def say(self, kind: str, **fields: Any) -> None:
        self.ws.send(json.dumps({"type": kind, **fields}))

    def ops(self, *ops: tuple[str, dict[str, Any]]) -> None:
        self.say("ops", ops=[{"id": op_id, "op": op} for op_id, op in ops])

    def next(self, timeout: float = PATIENCE) -> dict[str, Any]:
        """The next control message; frames are kept aside."""
        deadline = time.monotonic() + timeout
        while True:
            message = self.ws.recv(timeout=max(0.01, deadline - time.monotonic()))
            if isinstance(message, bytes):
                self.frames.append(message)
                continue
            found: dict[str, Any] = json.loads(message)
            self.seen.append(found)
            return found

    def wait(self, *kinds: str, timeout: float = PATIENCE) -> dict[str, Any]:
        """The next control message of one of these kinds."""
        deadline = time.monotonic() + timeout
        while time.monotonic() < deadline:
            found = self.next(deadline - time.monotonic())
            if found["type"] in kinds:
                return found
        raise TimeoutError(kinds)

    def settled(self, clock: int, timeout: float = PATIENCE) -> None:
        """Waits until the server says that the ground is final for ``clock``."""
        deadline = time.monotonic() + timeout
        while True:
            found = self.wait("progress", timeout=deadline - time.monotonic())
            if found["settled"] and found["clock"] >= clock:
                return

    def at_rest(self, clock: int) -> None:
        """Waits until the ground is, or has been, final for ``clock``."""
        if not any(m["type"] == "progress" and m["settled"] and m["clock"] >= clock for m in self.seen):
            self.settled(clock)

    def closed(self, timeout: float = PATIENCE) -> tuple[int, dict[str, Any] | None]:
        """Reads until the server closes: the close code, and the last error message."""
        from websockets.exceptions import ConnectionClosed

        last: dict[str, Any] | None = None
        deadline = time.monotonic() + timeout
        try:
            while True:
                found = self.next(deadline - time.monotonic())
                last = found if found["type"] == "error" else last
        except ConnectionClosed as closed:
            return (closed.rcvd.code if closed.rcvd is not None else 1006), last

    def close(self) -> None:
        self.ws.close()


def stroke(stroke_id: str = "s1", height: float = 10.0) -> dict[str, Any]:
    """A stroke.begin op."""
    return {
        "type": "stroke.begin",
        "stroke": {
            "id": stroke_id,
            "kind": "profile",
            "first": [100, 100, height],
            "last": [900, 100, 0],
            "curve": [[0, 0], [1, 0]],
        },
    }


def set_op(stroke_id: str = "s1", **fields: Any) -> dict[str, Any]:
    """A stroke.set op."""
    return {"type": "stroke.set", "stroke": stroke_id, "fields": fields}


def raw_socket(port: int) -> socket.socket:
    """A plain TCP connection to the server."""
    return socket.create_connection(("127.0.0.1", port), timeout=10)


def sleeping_member(port: int, terrain: str, secret: str) -> socket.socket:
    """A member that said hello and then never reads a byte."""
    tcp = socket.socket()
    tcp.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    tcp.connect(("127.0.0.1", port))
    tcp.sendall(
        b"GET /ws HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        b"Sec-WebSocket-Version: 13\r\n"
        b"Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Protocol: %b\r\n\r\n" % c.SUBPROTOCOL.encode()
    )
    assert b"101" in tcp.recv(64)
    hello = {"type": "hello", "protocol": c.PROTOCOL_VERSION, "terrain": terrain, "secret": secret, "client": "sleeper"}
    payload = json.dumps(hello).encode()
    header = bytes([0x81, 0x80 | 126]) + len(payload).to_bytes(2, "big")
    tcp.sendall(header + bytes(4) + payload)  # masked with zeros
    return tcp
