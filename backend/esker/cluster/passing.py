"""Requests that come to the wrong node are passed on: two ASGI middlewares, and the sockets' part of it.

``Entrance`` stands before everything else. It opens sessions for other nodes and reads what they say of a visitor, who
is from there on as if they had come by themselves: shares and rates count their address on the node that works for
them. ``Passing`` stands behind the gate and before the application, and passes requests on.
"""

from __future__ import annotations

import json
import logging
from collections.abc import Awaitable, Callable
from typing import Any, Final

from esker.cluster import places, signing
from esker.cluster.node import Cluster
from esker.cluster.peers import (
    MOVED_HEADER,
    SESSION_PATH,
    Elsewhere,
    Lost,
    Message,
    Peer,
    Receive,
    Send,
    host_of,
    target_of,
)
from esker.cluster.relay import Relay
from esker.cluster.signing import NotSigned, Opening, Sessions, Visit
from esker.store.engine.leases import Unreachable

log = logging.getLogger("esker.cluster")

PASSED: Final = "esker.passed"
"""What the scope of a request has under this name that another node passed on: its ``Visit``."""
MOST_OPENING: Final = 1024
SILENT: Final = "The database of this server does not answer at the moment. Try again in a moment."
AGAIN: Final = "This terrain is on its way to another server. Try again in a moment."


TerrainOf = Callable[[places.About, Message, bytes], Awaitable[str]]


class Entrance:
    """Lets other nodes in, by what they sign."""

    def __init__(self, app: Any, cluster: Cluster) -> None:
        self.app, self._sessions = app, Sessions(cluster.key)

    async def __call__(self, scope: Message, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self.app(scope, receive, send)
            return
        field = next((value for name, value in scope["headers"] if name == signing.HEADER.encode()), None)
        if scope["type"] == "http" and scope["path"] == SESSION_PATH:
            await self._open(scope, receive, send)
            return
        if field is None:
            await self.app(scope, receive, send)
            return
        method = scope.get("method", "GET")
        try:
            visit = self._sessions.read(field.decode("latin-1"), method, target_of(scope), host_of(scope["headers"]))
        except NotSigned as error:
            log.warning("refused what passed for another node, from %s: %s", _address(scope), error)
            fields = [(signing.HEADER.encode(), b"renew")] if error.renew else []
            await _answer(scope, send, 401, error.code, error.message, fields)
            return
        scheme = visit.scheme.replace("http", "ws") if scope["type"] == "websocket" else visit.scheme
        headers = [pair for pair in scope["headers"] if pair[0] != signing.HEADER.encode()]
        passed = {"client": (visit.visitor, 0), "scheme": scheme, "headers": headers, PASSED: visit}
        await self.app({**scope, **passed}, receive, send)

    async def _open(self, scope: Message, receive: Receive, send: Send) -> None:
        body = b""
        while True:
            message = await receive()
            body += message.get("body", b"")
            if message["type"] != "http.request" or not message.get("more_body") or len(body) > MOST_OPENING:
                break
        try:
            said = json.loads(body[:MOST_OPENING])
            opened = self._sessions.open(Opening(str(said["node"]), str(said["nonce"]), str(said["code"])))
        except (ValueError, KeyError, TypeError):
            await _answer(scope, send, 400, "malformed", "Only other nodes open sessions.", [])
        except NotSigned as error:
            log.warning("no session for what passed for another node, from %s: %s", _address(scope), error)
            await _answer(scope, send, 401, error.code, error.message, [])
        else:
            await _body(send, 200, json.dumps(opened.__dict__).encode(), [])


class Passing:
    """Passes requests on to the node that has the terrain."""

    def __init__(self, app: Any, cluster: Cluster, terrain_of: TerrainOf) -> None:
        """``terrain_of``: asks the database for the terrain of a class, a picture, a seat or a code; empty for none."""
        self.app, self._cluster, self._terrain_of = app, cluster, terrain_of

    async def __call__(self, scope: Message, receive: Receive, send: Send) -> None:
        about = places.about(scope["method"], scope["path"]) if scope["type"] == "http" else None
        if about is None:
            await self.app(scope, receive, send)
            return
        try:
            body = b""
            if about.is_code:
                body, receive = await _whole(receive)
            terrain = about.terrain or await self._terrain_of(about, scope, body)
            if not terrain:
                await self.app(scope, receive, send)
                return
            if PASSED in scope:
                if about.changes:
                    await self._cluster.hold(terrain)
            elif await self._cluster.reach(terrain, self._attempt(scope, receive, send, terrain), taking=about.changes):
                return
        except Elsewhere as error:
            log.info("%s %s was not passed on: %s", scope["method"], scope["path"], error)
            await _answer(scope, send, 503, "moved", AGAIN, [(MOVED_HEADER, b"1"), (b"retry-after", b"1")])
            return
        except Unreachable as error:
            log.warning("%s %s: %s", scope["method"], scope["path"], error)
            await _answer(scope, send, 503, "unavailable", SILENT, [(b"retry-after", b"5")])
            return
        except Lost as error:
            await _answer(scope, send, error.status, error.code, error.message, [])
            return
        if not about.changes:
            await self.app(scope, receive, send)
            return
        with self._cluster.using(terrain):
            await self.app(scope, receive, send)

    def _attempt(self, scope: Message, receive: Receive, send: Send, terrain: str) -> Any:
        visit = Visit(_address(scope), scope.get("scheme", "http"), terrain=terrain)

        async def attempt(peer: Peer) -> None:
            self._cluster.counts.requests_passed += 1
            try:
                await peer.request(scope, receive, send, visit)
            except Elsewhere:
                self._cluster.counts.requests_passed -= 1
                raise

        return attempt


async def _whole(receive: Receive) -> tuple[bytes, Receive]:
    """Reads a short body, which is looked into here; returns the body and what gives it once more."""
    body, more = b"", True
    while more and len(body) <= MOST_OPENING:
        message = await receive()
        more = message["type"] == "http.request" and bool(message.get("more_body"))
        body += message.get("body", b"")
    first = [{"type": "http.request", "body": body, "more_body": more}]

    async def again() -> Message:
        return first.pop() if first else await receive()

    return body, again


async def relay(cluster: Cluster, scope: Message, terrain: str, near: Any) -> Relay | None:
    """Ties a visitor's socket to the node that has the terrain; None where that is this one. Raises Elsewhere.

    ``near``: the end at the visitor (``relay.NearEnd``).
    """
    visit = Visit(_address(scope), scope.get("scheme", "ws").replace("ws", "http"), terrain=terrain)
    made: list[Relay] = []

    async def attempt(peer: Peer) -> None:
        relay = Relay(near)
        await peer.socket(scope, visit, relay)
        made.append(relay)

    if not await cluster.reach(terrain, attempt, taking=True):
        return None
    cluster.counts.sockets_passed += 1
    return made[0]


def _address(scope: Message) -> str:
    return str(scope["client"][0]) if scope.get("client") else "unknown"


async def _answer(
    scope: Message, send: Send, status: int, code: str, sentence: str, fields: list[tuple[bytes, bytes]]
) -> None:
    body = json.dumps({"code": code, "message": sentence}).encode()
    if scope["type"] == "http":
        await _body(send, status, body, fields)
    else:
        await refuse(send, status, body, fields)


async def refuse(send: Send, status: int, body: bytes, fields: list[tuple[bytes, bytes]]) -> None:
    """Answers the opening of a socket as a request that opens none."""
    head = [(b"content-type", b"application/json"), *fields]
    await send({"type": "websocket.http.response.start", "status": status, "headers": head})
    await send({"type": "websocket.http.response.body", "body": body})


async def _body(send: Send, status: int, body: bytes, fields: list[tuple[bytes, bytes]]) -> None:
    head = [(b"content-type", b"application/json"), (b"content-length", str(len(body)).encode()), *fields]
    await send({"type": "http.response.start", "status": status, "headers": head})
    await send({"type": "http.response.body", "body": body})
