"""The server's side of a websocket: short ways in and out, messages read a few ahead (SPEC P118, P119, P127)."""

from __future__ import annotations

import asyncio
import random
from typing import Any
from unittest.mock import Mock

import pytest
import uvicorn
from uvicorn.server import ServerState
from websockets.client import ClientProtocol
from websockets.frames import Frame
from websockets.http11 import Response
from websockets.uri import parse_uri

from esker.fairness.turns import Turnstile
from esker.server.routes import socket as route
from esker.server.wire.websocket import READ_AHEAD, WebSocketProtocol


class Wire:
    """A connection whose other side is a client's state machine, with nothing between."""

    def __init__(self) -> None:
        self.messages: list[Any] = []
        self.proceed = asyncio.Event()
        config = uvicorn.Config(self.app, ws=WebSocketProtocol, log_config=None, interface="asgi3", proxy_headers=False)
        self.server = WebSocketProtocol(config, ServerState(), {}, asyncio.get_running_loop())
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


async def all_heard(heard: list[Any], count: int) -> None:
    """Waits until so many messages were heard: what takes long to read, on a busy machine say, is read in turns."""
    async with asyncio.timeout(60):
        while len(heard) < count:
            await asyncio.sleep(0.001)


def test_a_frame_made_once_arrives_as_a_text_and_not_after_the_end() -> None:
    async def run() -> None:
        wire = Wire()
        await settle()
        assert isinstance(wire.take()[0], Response)
        for size in (0, 125, 126, 65_535, 65_536, route.SHARED_CHARACTERS + 1):
            text = "é" * size
            went_on = Mock()
            await route.WireTransport(Mock(scope=wire.scope, client=None), Turnstile()).send_text(text, went_on)
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
            await wire.scope["esker.socket"].write(route._frame("late"))
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


def _listening(wire: Wire) -> list[str | bytes]:
    wire.take()
    heard: list[str | bytes] = []
    wire.scope["esker.socket"].listen(heard.append)
    return heard


def _library_sees(wire: Wire, monkeypatch: pytest.MonkeyPatch) -> list[bytes]:
    """Bytes that are left to the library's parser."""
    seen: list[bytes] = []
    receive = wire.server.conn.receive_data

    def noted(data: bytes) -> None:
        seen.append(bytes(data))
        receive(data)

    monkeypatch.setattr(wire.server.conn, "receive_data", noted)
    return seen


def test_whole_texts_go_straight_to_the_listener(monkeypatch: pytest.MonkeyPatch) -> None:
    async def run() -> None:
        wire = Wire()
        await settle()
        heard, seen = _listening(wire), _library_sees(wire, monkeypatch)
        texts = ["", "a", "é" * 62, "b" * 125, "c" * 126, "d" * 65_535]
        for text in texts:
            wire.client.send_text(text.encode())
        wire.give()
        await all_heard(heard, len(texts))
        assert heard == texts
        assert seen == [], "nothing was left to the library"
        wire.client.send_text(b"e" * 65_536)
        wire.give()
        await all_heard(heard, len(texts) + 1)
        assert heard[len(texts) :] == ["e" * 65_536]
        assert len(b"".join(seen)) == 65_536 + 14
        wire.server.connection_lost(None)
        await settle()
        assert wire.messages == [], "none came by the queue"

    asyncio.run(run())


@pytest.mark.parametrize("seed", range(12))
def test_whatever_comes_in_whatever_pieces_is_heard_as_the_library_would_read_it(seed: int) -> None:
    rng = random.Random(seed)

    async def run() -> None:
        wire = Wire()
        await settle()
        heard = _listening(wire)
        expected: list[str | bytes] = []
        for _ in range(60):
            text = "".join(rng.choices("aé\u20ac\U0001f600", k=rng.choice((0, 3, 40, 126, 300))))
            kind = rng.randrange(6)
            if kind == 0:
                half = len(text) // 2
                wire.client.send_text(text[:half].encode(), fin=False)
                wire.client.send_ping(b"?")
                wire.client.send_continuation(text[half:].encode(), fin=True)
                expected.append(text)
            elif kind == 1:
                wire.client.send_binary(text.encode())
                expected.append(text.encode())
            else:
                wire.client.send_text(text.encode())
                expected.append(text)
        data = b"".join(wire.client.data_to_send())
        while data:
            size = rng.choice((1, 2, 5, 7, 50, 400, 3_000))
            wire.server.data_received(data[:size])
            data = data[size:]
        await all_heard(heard, len(expected))
        assert heard == expected
        wire.server.connection_lost(None)
        await settle()

    asyncio.run(run())


@pytest.mark.parametrize(
    ("bad", "code"),
    [
        (b"\x81\x02ab", 1002),  # no mask
        (b"\xc1\x82\0\0\0\0ab", 1002),  # a reserved bit
        (b"\x83\x82\0\0\0\0ab", 1002),  # an unknown opcode
        (b"\x80\x82\0\0\0\0ab", 1002),  # the end of a message that never began
        (b"\x81\x82\0\0\0\0\xff\xfe", 1007),  # no UTF-8
        (b"\x81\xff" + (1 << 40).to_bytes(8) + bytes(4), 1009),  # a terabyte
    ],
)
def test_frames_that_are_wrong_are_left_to_the_library_and_end_the_connection(bad: bytes, code: int) -> None:
    async def run() -> None:
        wire = Wire()
        await settle()
        heard = _listening(wire)
        wire.client.send_text(b"fine")
        wire.give()
        wire.server.data_received(bad)
        wire.server.data_received(b"\x81\x82\0\0\0\0ab")
        assert heard == ["fine"]
        wire.take()
        assert wire.client.close_rcvd is not None
        assert wire.client.close_rcvd.code == code
        wire.server.connection_lost(None)
        await settle()

    asyncio.run(run())


def test_messages_that_wait_come_before_those_that_are_heard() -> None:
    async def run() -> None:
        wire = Wire()
        await settle()
        wire.take()
        for text in (b"1", b"2"):
            wire.client.send_text(text)
        wire.give()
        heard = _listening(wire)
        wire.client.send_text(b"3")
        wire.give()
        assert heard == []
        wire.proceed.set()
        await settle()
        wire.client.send_text(b"4")
        wire.give()
        assert (wire.messages, heard) == (["1", "2", "3"], ["4"])
        wire.server.connection_lost(None)
        await settle()

    asyncio.run(run())
