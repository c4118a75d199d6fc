"""The server's side of a websocket: frames made once for many, messages read a few ahead (SPEC P118, P119)."""

from __future__ import annotations

import asyncio
from typing import Any
from unittest.mock import Mock

import pytest
import uvicorn
from uvicorn.server import ServerState
from websockets.client import ClientProtocol
from websockets.frames import Frame
from websockets.http11 import Response
from websockets.uri import parse_uri

from esker.run import READ_AHEAD, _WebSocketProtocol
from esker.server import socket as route


class Wire:
    """A connection whose other side is a client's state machine, with nothing between."""

    def __init__(self) -> None:
        self.messages: list[Any] = []
        self.proceed = asyncio.Event()
        config = uvicorn.Config(
            self.app, ws=_WebSocketProtocol, log_config=None, interface="asgi3", proxy_headers=False
        )
        self.server = _WebSocketProtocol(config, ServerState(), {}, asyncio.get_running_loop())
        self.transport = Mock(is_closing=lambda: False, get_extra_info=lambda *_: None)
        self.client = ClientProtocol(parse_uri("ws://localhost/ws"))
        self.server.connection_made(self.transport)
        self.client.send_request(self.client.connect())
        self.give()

    async def app(self, scope: Any, receive: Any, send: Any) -> None:
        self.scope = scope
        await receive()
        await send({"type": "websocket.accept"})
        while (message := await receive())["type"] == "websocket.receive":
            await self.proceed.wait()
            self.messages.append(message["text"])

    def give(self) -> None:
        """Brings what the client wrote to the server."""
        self.server.data_received(b"".join(self.client.data_to_send()))

    def take(self) -> list[Any]:
        """What the server wrote, as the client understands it."""
        for call in self.transport.write.call_args_list:
            self.client.receive_data(call.args[0])
        self.transport.write.reset_mock()
        return self.client.events_received()


async def settle() -> None:
    for _ in range(20):
        await asyncio.sleep(0)


def test_a_frame_made_once_arrives_as_a_text_and_not_after_the_end() -> None:
    async def run() -> None:
        wire = Wire()
        await settle()
        assert isinstance(wire.take()[0], Response)
        for size in (0, 125, 126, 65_535, 65_536, route.SHARED_CHARACTERS + 1):
            text = "é" * size
            went_on = Mock()
            await route._Transport(Mock(scope=wire.scope)).send_text(text, went_on)
            frames = wire.take()
            assert all(isinstance(frame, Frame) for frame in frames)
            assert b"".join(bytes(frame.data) for frame in frames).decode() == text
            long = size > route.SHARED_CHARACTERS
            assert len(frames) == (-(-2 * size // route.FRAGMENT_BYTES) if long else 1)
            assert went_on.call_count == (len(frames) if long else 0)
            assert [frame.fin for frame in frames] == [False] * (len(frames) - 1) + [True]
        wire.client.send_close()
        wire.give()
        with pytest.raises(ConnectionResetError):
            await wire.scope["esker.write"](route._frame("late"))
        wire.server.connection_lost(None)
        await settle()

    asyncio.run(run())


def test_no_more_is_read_while_messages_wait() -> None:
    async def run() -> None:
        wire = Wire()
        await settle()
        wire.take()
        for number in range(READ_AHEAD + 1):
            assert not wire.transport.pause_reading.called, number
            wire.client.send_text(str(number).encode())
            wire.give()
            await settle()  # the first is taken, the others wait behind it
        assert wire.transport.pause_reading.call_count == 1
        assert not wire.transport.resume_reading.called
        wire.proceed.set()
        await settle()
        assert wire.messages == [str(number) for number in range(READ_AHEAD + 1)]
        assert wire.transport.resume_reading.call_count == 1
        wire.server.connection_lost(None)
        await settle()

    asyncio.run(run())
