"""The websocket route."""

from __future__ import annotations

import logging
from collections.abc import AsyncIterator, Callable, Iterator, Sequence
from contextlib import suppress
from functools import lru_cache
from typing import Any, Final

from fastapi import FastAPI, WebSocket
from starlette.websockets import WebSocketDisconnect
from websockets.frames import Frame, Opcode

from esker import contract as c
from esker.cluster.node import Cluster
from esker.fairness.laps import Laps
from esker.fairness.shares import Full, Places, Share, Who
from esker.fairness.spending import Account, Accounts
from esker.fairness.turns import Turnstile
from esker.server.routes.answers import address
from esker.server.routes.elsewhere import Arrival
from esker.server.wire.front import Front
from esker.server.wire.websocket import WebSocketProtocol
from esker.session.room.hub import Hub
from esker.session.room.socket import Session

log = logging.getLogger("esker.server")


SOCKETS: Final = Share(8_192, address=512, network=1_024)
"""Sockets at a time; the bound holds too for addresses behind a proxy, whose connections all come from one."""
CROWDED: Final = "Many sockets are open from your address. Close some pages, or wait a moment."
SHARED_TEXTS: Final = 16
SHARED_CHARACTERS: Final = 1 << 18
"""Frames of so many of the last texts are kept, up to this length: a text that goes to everybody in a room is framed
once."""
_WHOLE_TEXT: Final = 0x80 | Opcode.TEXT
FRAGMENT_BYTES: Final = 1 << 16
"""Longer texts go in frames of this size (RFC 6455, 5.4): it shows that a peer reads them, however slowly."""


def _frame(text: str) -> bytes:
    """Returns a text as a frame of the websocket, as a server sends it: whole and without a mask (RFC 6455, 5.2)."""
    data = text.encode()
    size = len(data)
    if size < 126:
        head = bytes((_WHOLE_TEXT, size))
    elif size < 1 << 16:
        head = bytes((_WHOLE_TEXT, 126)) + size.to_bytes(2)
    else:
        head = bytes((_WHOLE_TEXT, 127)) + size.to_bytes(8)
    return head + data


def _fragments(parts: Sequence[bytes]) -> Iterator[bytes]:
    """Yields a text whose bytes lie in parts, in several frames, each made when it is its turn."""
    ends = [(part, at) for part in parts for at in range(0, len(part), FRAGMENT_BYTES)]
    for n, (part, at) in enumerate(ends):
        data = part[at : at + FRAGMENT_BYTES]
        yield Frame(Opcode.CONT if n else Opcode.TEXT, data, fin=n == len(ends) - 1).serialize(mask=False)


_framed = lru_cache(SHARED_TEXTS)(_frame)


def _write(wire: WebSocketProtocol, fragment: bytes, others: Iterator[bytes]) -> bytes | None:
    """Writes a fragment if there is room for it. Returns what is to be written next: the same one where there was none,
    None after the last."""
    return next(others, None) if wire.write_now(fragment) else fragment


class WireTransport:
    """``session.room.socket.Transport`` over Starlette's websocket."""

    def __init__(self, socket: WebSocket, long: Turnstile) -> None:
        """``long``: lets through what all sockets send of long texts, a fragment at a time."""
        self._socket, self._long, self._who = socket, long, Who(address(socket))
        self._wire: WebSocketProtocol | None = socket.scope.get("esker.socket")

    def listen(self, listener: Callable[[str | bytes], None]) -> None:
        if self._wire is not None:
            self._wire.listen(listener)

    def send_now(self, texts: Sequence[str]) -> bool:
        if self._wire is None or any(len(text) > SHARED_CHARACTERS for text in texts):
            return False
        return self._wire.write_now(_framed(texts[0]) if len(texts) == 1 else b"".join(map(_framed, texts)))

    async def send_text(self, text: str, went_on: Callable[[], None]) -> None:
        if self._wire is None:
            await self._send({"type": "websocket.send", "text": text})
        elif len(text) <= SHARED_CHARACTERS:
            await self._wire.write(_framed(text))
        else:
            await self.send_long((text.encode(),), went_on)

    async def send_long(self, parts: Sequence[bytes], went_on: Callable[[], None]) -> None:
        if self._wire is None:
            await self._send({"type": "websocket.send", "text": b"".join(parts).decode()})
            return
        fragments = _fragments(parts)
        fragment = next(fragments, None)
        while fragment is not None:
            await self._wire.writable.wait()
            following = await self._long.run(self._who, _write, self._wire, fragment, fragments)
            if following is not fragment:
                went_on()
            fragment = following

    async def send_bytes(self, data: bytes) -> None:
        await self._send({"type": "websocket.send", "bytes": data})

    async def close(self, code: int, reason: str) -> None:
        await self._send({"type": "websocket.close", "code": code, "reason": reason})

    async def _send(self, message: dict[str, Any]) -> None:
        try:
            await self._socket.send(message)
        except (WebSocketDisconnect, RuntimeError) as error:  # Starlette's ways to say that the peer is gone
            raise ConnectionResetError("the peer is gone") from error

    def charge(self, account: Account, broke: Callable[[], None]) -> None:
        if self._wire is not None:
            self._wire.charge(account, broke)

    def pay(self, seconds: float) -> None:
        if self._wire is not None:
            self._wire.pay(seconds)

    def abort(self) -> None:
        if self._wire is not None:
            self._wire.abort()


async def messages(socket: WebSocket) -> AsyncIterator[str | bytes]:
    while True:
        message = await socket.receive()
        if message["type"] != "websocket.receive":
            return
        text, data = message.get("text"), message.get("bytes")
        yield text if text is not None else data or b""


async def accepted(socket: WebSocket, front: Front, long: Turnstile) -> tuple[WireTransport, str | None, bool]:
    """Answers the handshake. Returns the transport, the subprotocol, and whether the page comes from here."""
    offered = socket.scope.get("subprotocols", [])
    subprotocol = c.SUBPROTOCOL if c.SUBPROTOCOL in offered else None
    await socket.accept(subprotocol)
    transport = WireTransport(socket, long)
    against = front.against(socket.scope)
    if against is not None:
        await refuse(socket, transport, "bad_origin", against[2])
    return transport, subprotocol, against is None


def add_socket(app: FastAPI, hub: Hub, front: Front, laps: Laps, cluster: Cluster | None = None) -> None:
    """Adds the route. ``laps``: those of the event loop; ``cluster``: where other servers may have the terrain."""
    accounts, sockets, long = Accounts(laps=laps), Places(SOCKETS), Turnstile()

    @app.websocket("/ws")
    async def ws(socket: WebSocket) -> None:
        arrival = None if cluster is None else Arrival(cluster, socket)
        if arrival is not None and not await arrival.expected():
            return
        transport, subprotocol, is_welcome = await accepted(socket, front, long)
        if not is_welcome:
            return
        try:
            place = sockets.take(Who(address(socket)))
        except Full:
            await refuse(socket, transport, "rate_limited", CROWDED)
            return

        async def here() -> None:
            await Session(hub, transport, address(socket), subprotocol, accounts=accounts).run(messages(socket))

        with place:
            if arrival is None:
                await here()
            else:
                await arrival.serve(here, lambda sentence: refuse(socket, transport, "moved", sentence))


async def refuse(socket: WebSocket, transport: WireTransport, code: c.CloseCode, sentence: str) -> None:
    log.info("closed a connection from %s: %s", address(socket), code)
    text = c.ErrorMessage(code=code, message=sentence, fatal=True).model_dump_json()
    with suppress(ConnectionResetError):
        await transport.send_text(text, lambda: None)
        await transport.close(c.WS_CLOSE[code], sentence)
