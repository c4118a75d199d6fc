"""The websocket route."""

from __future__ import annotations

import logging
from collections.abc import AsyncIterator, Callable
from contextlib import suppress
from typing import Any
from urllib.parse import urlsplit

from fastapi import FastAPI, WebSocket
from starlette.websockets import WebSocketDisconnect

from esker import contract as c
from esker.server.answers import address
from esker.session.hub import Hub
from esker.session.socket import Session

log = logging.getLogger("esker.server")


class _Transport:
    """``session.socket.Transport`` over Starlette's websocket."""

    def __init__(self, socket: WebSocket) -> None:
        self._socket = socket
        self._abort: Callable[[], None] | None = socket.scope.get("esker.abort")

    async def send_text(self, text: str) -> None:
        await self._send({"type": "websocket.send", "text": text})

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
        if self._abort is not None:
            self._abort()


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
                await transport.send_text(text)
                await transport.close(c.WS_CLOSE["bad_origin"], sentence)
            return
        await Session(hub, transport, address(socket), subprotocol).run(_messages(socket))
