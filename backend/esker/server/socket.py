"""The websocket route."""

from __future__ import annotations

import logging
from collections.abc import AsyncIterator, Callable, Iterator, Sequence
from contextlib import suppress
from functools import lru_cache
from typing import Any, Final
from urllib.parse import urlsplit

from fastapi import FastAPI, WebSocket
from starlette.websockets import WebSocketDisconnect
from websockets.frames import Frame, Opcode

from esker import contract as c
from esker.server.answers import address
from esker.session.hub import Hub
from esker.session.socket import Session
from esker.websocket_protocol import WebSocketProtocol

log = logging.getLogger("esker.server")


SHARED_TEXTS: Final = 16
SHARED_CHARACTERS: Final = 1 << 18
"""Frames of so many of the last texts are kept, up to this length: what everybody in a room is told is framed once."""
_WHOLE_TEXT: Final = 0x80 | Opcode.TEXT
FRAGMENT_BYTES: Final = 1 << 16
"""Longer texts go in frames of this size (RFC 6455, 5.4): it shows that a peer reads them, however slowly."""


def _frame(text: str) -> bytes:
    """A text as a frame of the websocket, as a server sends it: whole and without a mask (RFC 6455, 5.2)."""
    data = text.encode()
    size = len(data)
    if size < 126:
        head = bytes((_WHOLE_TEXT, size))
    elif size < 1 << 16:
        head = bytes((_WHOLE_TEXT, 126)) + size.to_bytes(2)
    else:
        head = bytes((_WHOLE_TEXT, 127)) + size.to_bytes(8)
    return head + data


def _fragments(text: str) -> Iterator[bytes]:
    """The same in several frames."""
    data = text.encode()
    for start in range(0, len(data), FRAGMENT_BYTES):
        opcode, end = Opcode.CONT if start else Opcode.TEXT, start + FRAGMENT_BYTES
        yield Frame(opcode, data[start:end], fin=end >= len(data)).serialize(mask=False)


_framed = lru_cache(SHARED_TEXTS)(_frame)


class _Transport:
    """``session.socket.Transport`` over Starlette's websocket."""

    def __init__(self, socket: WebSocket) -> None:
        self._socket = socket
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
            for fragment in _fragments(text):
                await self._wire.write(fragment)
                went_on()

    async def send_bytes(self, data: bytes) -> None:
        await self._send({"type": "websocket.send", "bytes": data})

    async def close(self, code: int, reason: str) -> None:
        await self._send({"type": "websocket.close", "code": code, "reason": reason})

    async def _send(self, message: dict[str, Any]) -> None:
        try:
            await self._socket.send(message)
        except (WebSocketDisconnect, RuntimeError) as error:  # Starlette's ways to say that the peer is gone
            raise ConnectionResetError("the peer is gone") from error

    def abort(self) -> None:
        if self._wire is not None:
            self._wire.abort()


async def _messages(socket: WebSocket) -> AsyncIterator[str | bytes]:
    while True:
        message = await socket.receive()
        if message["type"] != "websocket.receive":
            return
        text, data = message.get("text"), message.get("bytes")
        yield text if text is not None else data or b""


def add_socket(app: FastAPI, hub: Hub) -> None:
    """Adds it."""

    @app.websocket("/ws")
    async def ws(socket: WebSocket) -> None:
        offered = socket.scope.get("subprotocols", [])
        subprotocol = c.SUBPROTOCOL if c.SUBPROTOCOL in offered else None
        await socket.accept(subprotocol)
        transport = _Transport(socket)
        origin, host = socket.headers.get("origin"), socket.headers.get("host", "")
        if origin is not None and urlsplit(origin).netloc.lower() != host.lower():
            sentence = "A page of another site may not open this socket."
            log.info("closed a connection from %s: bad_origin", address(socket))
            text = c.ErrorMessage(code="bad_origin", message=sentence, fatal=True).model_dump_json()
            with suppress(ConnectionResetError):
                await transport.send_text(text, lambda: None)
                await transport.close(c.WS_CLOSE["bad_origin"], sentence)
            return
        await Session(hub, transport, address(socket), subprotocol).run(_messages(socket))
