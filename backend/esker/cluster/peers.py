"""Other nodes, as this one asks them: sessions, kept connections, requests and sockets that are passed on.

Bytes go on as they come, and no faster than the other end takes them. What was asked is asked again elsewhere only
while nothing of its body was read and nothing of the answer was given out.
"""

from __future__ import annotations

import asyncio
import json
import socket
import ssl
import time
from collections.abc import Awaitable, Callable, Iterable, MutableMapping
from dataclasses import dataclass
from typing import Any, Final
from urllib.parse import urlsplit

import h11

from esker.cluster import signing
from esker.cluster.places import CHANGES_NOTHING
from esker.cluster.relay import Relay
from esker.cluster.signing import NotSigned, Opened, Visit
from esker.errors import EskerError
from esker.store.engine.leases import Node

Message = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]
Headers = list[tuple[bytes, bytes]]

SESSION_PATH: Final = "/node/session"
MOVED_HEADER: Final = b"esker-moved"
"""The field of an answer by which a node says that a terrain is not there any more."""
CONNECT_SECONDS: Final = 1.0
"""A node on the same network answers in a thousandth of it."""
ANSWER_SECONDS: Final = 120.0
"""The longest that a node may take to begin an answer: a heavy document is read in seconds."""
SOCKET_SECONDS: Final = 2.0
"""The longest that a node may take to open a socket. Then it is tried again, or elsewhere."""
IDLE_SECONDS: Final = 4.0
"""A connection that was not used for so long is closed, before the other end gives it up."""
MOST_IDLE: Final = 32
PIECE: Final = 1 << 16
_HOP_BY_HOP: Final = frozenset(
    b"connection keep-alive proxy-authenticate proxy-authorization proxy-connection te trailer transfer-encoding "
    b"upgrade expect".split()
)
_OURS: Final = frozenset({signing.HEADER.encode(), b"forwarded", b"x-forwarded-for", b"x-forwarded-proto"})
"""Fields that say who asks. A visitor's own are not passed on: the signed field says it."""
_WRITTEN_AGAIN: Final = frozenset(
    b"date cache-control content-security-policy referrer-policy x-content-type-options cross-origin-opener-policy "
    b"permissions-policy strict-transport-security".split()
)
"""Fields of an answer that this node's own middleware writes."""


class Elsewhere(EskerError):
    """The other node does not have the terrain, or is not there. Nothing was done."""

    def __init__(self, sentence: str) -> None:
        super().__init__("moved", sentence, 503)


class Lost(EskerError):
    """The other node went away in the middle of a change, or of an answer."""

    def __init__(self) -> None:
        super().__init__("lost", "The server that was asked went away. Look whether it was done, and ask again.", 502)


class _Gone(Exception):
    """A kept connection was closed by the other end before it answered."""


@dataclass(eq=False)
class _Connection:
    reader: asyncio.StreamReader
    writer: asyncio.StreamWriter
    state: h11.Connection
    used: float

    async def event(self) -> Any:
        """The next event of the answer."""
        while (found := self.state.next_event()) is h11.NEED_DATA:
            data = await self.reader.read(PIECE)
            if not data and self.state.their_state is h11.SEND_RESPONSE and not self.state.trailing_data[0]:
                raise _Gone
            self.state.receive_data(data)
        return found

    def drop(self) -> None:
        self.writer.transport.abort()


class Peer:
    """One other node."""

    def __init__(self, node: Node, me: str, key: bytes, now: Callable[[], float] = time.monotonic) -> None:
        """``me``: the name of the node that asks."""
        self.node, self._me, self._key, self._now = node, me, key, now
        parts = urlsplit(node.address)
        self._tls = ssl.create_default_context() if parts.scheme == "https" else None
        self._host = parts.hostname or ""
        self._port = parts.port or (443 if self._tls else 80)
        self._idle: list[_Connection] = []
        self._relays: set[Relay] = set()
        self._busy: list[_Connection] = []
        self._closed = False
        self._session: signing.Session | None = None
        self._opening = asyncio.Lock()

    # --- sessions -----------------------------------------------------------------------------------------------

    async def session(self, old: signing.Session | None = None) -> signing.Session:
        """The session with this node; another one than ``old``, which the node does not know. Raises Elsewhere."""
        async with self._opening:
            if self._session is None or self._session is old:
                self._session = await self._open_session()
            return self._session

    async def _open_session(self) -> signing.Session:
        asked = signing.opening(self._key, self._me)
        body = json.dumps(asked.__dict__).encode()
        head = [(b"host", self._host.encode()), (b"content-type", b"application/json")]
        connection = await self._connected(fresh=True)
        try:
            request = h11.Request(
                method=b"POST",
                target=SESSION_PATH.encode(),
                headers=[*head, (b"content-length", str(len(body)).encode())],
            )
            for part in (request, h11.Data(data=body), h11.EndOfMessage()):
                connection.writer.write(connection.state.send(part) or b"")
            async with asyncio.timeout(CONNECT_SECONDS):
                answer = await connection.event()
                text = b""
                while not isinstance(found := await connection.event(), h11.EndOfMessage):
                    text += bytes(found.data)
            if answer.status_code != 200:
                raise Elsewhere(f"Node {self.node.name} opened no session ({answer.status_code}).")
            said = json.loads(text)
            made = signing.Session(self._key, asked, Opened(said["session"], said["nonce"], said["code"]))
        except (OSError, TimeoutError, h11.ProtocolError, ValueError, KeyError, TypeError, NotSigned, _Gone) as error:
            connection.drop()
            raise Elsewhere(f"Node {self.node.name} opened no session: {error}") from None
        self._keep(connection)
        return made

    # --- connections --------------------------------------------------------------------------------------------

    async def _connected(self, *, fresh: bool = False) -> _Connection:
        """A connection, kept or new. Raises Elsewhere."""
        if self._closed:
            raise Elsewhere(f"Node {self.node.name} is not there any more.")
        while self._idle and not fresh:
            kept = self._idle.pop()
            if self._now() - kept.used < IDLE_SECONDS and not kept.reader.at_eof():
                return kept
            kept.drop()
        try:
            async with asyncio.timeout(CONNECT_SECONDS):
                reader, writer = await asyncio.open_connection(self._host, self._port, ssl=self._tls, limit=PIECE)
        except (OSError, TimeoutError) as error:
            raise Elsewhere(f"Node {self.node.name} cannot be reached: {error or 'no answer'}.") from None
        return _Connection(reader, writer, h11.Connection(h11.CLIENT), self._now())

    def _keep(self, connection: _Connection) -> None:
        """Keeps a connection whose answer is whole, where both ends may go on."""
        if connection.state.our_state is not h11.DONE or connection.state.their_state is not h11.DONE:
            connection.drop()
            return
        connection.state.start_next_cycle()
        connection.used = self._now()
        self._idle.append(connection)
        if len(self._idle) > MOST_IDLE:
            self._idle.pop(0).drop()

    def close(self) -> None:
        """Closes what is kept, and what is passed on to this node: it is not there any more, or frozen."""
        self._closed = True
        for relay in list(self._relays):
            relay.abort()
        for each in (*self._idle, *self._busy):
            each.drop()
        self._idle.clear()

    # --- requests -----------------------------------------------------------------------------------------------

    async def request(self, scope: Message, receive: Receive, send: Send, visit: Visit) -> None:
        """Passes a request on, and its answer back. Raises Elsewhere."""
        session = await self.session()
        # Nothing is done twice: a change without a body may be under way as soon as its head was sent.
        is_safe = scope["method"] in CHANGES_NOTHING or has_body(scope["headers"])
        for attempt in range(3):
            connection = await self._connected(fresh=attempt > 0 or not is_safe)
            self._busy.append(connection)
            try:
                answer = await self._asked(connection, session, scope, visit)
                if answer is not None:
                    await self._answered(connection, answer, receive, send)
                    return
            except _Gone:
                if not is_safe:
                    raise Lost from None
                continue
            finally:
                self._busy.remove(connection)
                if connection not in self._idle:
                    connection.drop()
            session = await self.session(session)
        raise Elsewhere(f"Node {self.node.name} closed the connection.")

    async def _asked(self, connection: _Connection, session: signing.Session, scope: Message, visit: Visit) -> Any:
        """Sends the head of a request. Returns the head of the answer, or what says that the body may come; None where
        another session is needed. Raises Elsewhere, _Gone."""
        target, body = target_of(scope), has_body(scope["headers"])
        head = passed_on(scope["headers"])
        head.append((signing.HEADER.encode(), session.sign(visit, scope["method"], target, host_of(head)).encode()))
        if body:
            head.append((b"expect", b"100-continue"))
            if not any(name == b"content-length" for name, _ in head):
                head.append((b"transfer-encoding", b"chunked"))
        request = h11.Request(method=scope["method"].encode(), target=target.encode(), headers=head)
        connection.writer.write(connection.state.send(request) or b"")
        if not body:
            connection.writer.write(connection.state.send(h11.EndOfMessage()) or b"")
        try:
            async with asyncio.timeout(ANSWER_SECONDS):
                answer = await connection.event()
        except (OSError, TimeoutError, h11.ProtocolError) as error:
            raise (Elsewhere(f"Node {self.node.name} gave no answer: {error}.") if body else _Gone()) from None
        if answer.status_code == 401 and any(name == signing.HEADER.encode() for name, _ in answer.headers):
            return None
        if any(name == MOVED_HEADER for name, _ in answer.headers):
            raise Elsewhere("The terrain has moved.")
        return answer

    async def _answered(self, connection: _Connection, answer: Any, receive: Receive, send: Send) -> None:
        """Passes the body on, where it is wanted, and the answer back; whichever ends first."""
        body = isinstance(answer, h11.InformationalResponse)
        upward = asyncio.create_task(self._bring(connection, receive, body))
        try:
            if body:
                answer = await self._unless(upward, connection.event())
            await send(_start(answer))
            while not isinstance(found := await self._unless(upward, connection.event()), h11.EndOfMessage):
                await send({"type": "http.response.body", "body": bytes(found.data), "more_body": True})
            await send({"type": "http.response.body", "body": b"", "more_body": False})
        finally:
            upward.cancel()
            await asyncio.gather(upward, return_exceptions=True)
        self._keep(connection)

    async def _bring(self, connection: _Connection, receive: Receive, body: bool) -> None:
        """Brings the body on; then waits for whoever asked to hang up, and returns."""
        while True:
            message = await receive()
            if message["type"] != "http.request":
                return
            if not body:
                continue
            if message.get("body"):
                connection.writer.write(connection.state.send(h11.Data(data=message["body"])) or b"")
                await connection.writer.drain()
            if not message.get("more_body"):
                connection.writer.write(connection.state.send(h11.EndOfMessage()) or b"")
                body = False

    async def _unless(self, upward: asyncio.Task[None], wanted: Awaitable[Any]) -> Any:
        """Awaits the other node, unless whoever asked hangs up. Raises ConnectionError."""
        task = asyncio.ensure_future(wanted)
        await asyncio.wait({task, upward}, return_when=asyncio.FIRST_COMPLETED)
        if upward.done() and upward.exception() is None:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)
            raise ConnectionResetError("whoever asked has hung up")
        try:
            return await task  # a node that takes no more of a body may have said why
        except _Gone:
            raise ConnectionResetError("the other node has hung up") from None

    # --- sockets ------------------------------------------------------------------------------------------------

    async def socket(self, scope: Message, visit: Visit, relay: Relay) -> None:
        """Opens the socket of a visitor at this node, and ties ``relay`` to it. Raises Elsewhere."""
        session = await self.session()
        for _ in range(2):
            target, head = target_of(scope), passed_on(scope["headers"])
            signed = session.sign(visit, "GET", target, host_of(head))
            fields = [*head, (signing.HEADER.encode(), signed.encode())]
            fields += [(b"connection", b"Upgrade"), (b"upgrade", b"websocket")]
            text = b"".join(b"%b: %b\r\n" % field for field in fields)
            try:
                async with asyncio.timeout(CONNECT_SECONDS):
                    await asyncio.get_running_loop().create_connection(
                        lambda: relay, self._host, self._port, ssl=self._tls
                    )
                async with asyncio.timeout(SOCKET_SECONDS):
                    status, answer = await relay.opened(b"GET %b HTTP/1.1\r\n%b\r\n" % (target.encode(), text))
            except (OSError, TimeoutError) as error:
                relay.abort()
                raise Elsewhere(f"Node {self.node.name} cannot be reached: {error or 'no answer'}.") from None
            if status == 101:
                self._relays.add(relay)
                relay.ended.add_done_callback(lambda _: self._relays.discard(relay))
                return
            relay.abort()
            if status != 401 or signing.HEADER.encode() not in answer.lower():
                raise Elsewhere(f"Node {self.node.name} took no socket ({status}).")
            session = await self.session(session)
            relay.reset()
        raise Elsewhere(f"Node {self.node.name} takes no session.")


def _start(answer: h11.Response) -> Message:
    dropped = _HOP_BY_HOP | _WRITTEN_AGAIN
    fields = [(bytes(name), bytes(value)) for name, value in answer.headers if name not in dropped]
    return {"type": "http.response.start", "status": answer.status_code, "headers": fields}


def passed_on(headers: Iterable[tuple[bytes, bytes]]) -> Headers:
    """Returns the fields of a request that go on.

    >>> passed_on([(b"host", b"a"), (b"connection", b"x"), (b"x-forwarded-for", b"1.2.3.4")])
    [(b'host', b'a')]
    """
    return [(name, value) for name, value in headers if name not in _HOP_BY_HOP and name not in _OURS]


def has_body(headers: Iterable[tuple[bytes, bytes]]) -> bool:
    """Returns whether a request has a body.

    >>> has_body([(b"content-length", b"0")]), has_body([(b"transfer-encoding", b"chunked")])
    (False, True)
    """
    found = dict(headers)
    return b"transfer-encoding" in found or found.get(b"content-length", b"0").strip() != b"0"


def host_of(headers: Iterable[tuple[bytes, bytes]]) -> str:
    """Returns the field ``Host``, which is signed."""
    return next((value.decode("latin-1") for name, value in headers if name == b"host"), "")


def target_of(scope: Message) -> str:
    """Returns path and query as they came."""
    path: bytes = scope.get("raw_path") or scope["path"].encode()
    query: bytes = scope.get("query_string", b"")
    return (path + (b"?" + query if query else b"")).decode("latin-1")


def resolved(address: str) -> frozenset[str]:
    """Returns the addresses of a node on the network; none where its name is unknown."""
    host = urlsplit(address).hostname
    try:
        return frozenset(str(found[4][0]) for found in socket.getaddrinfo(host, None)) if host else frozenset()
    except OSError:
        return frozenset()
