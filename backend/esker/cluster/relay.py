"""The end of a passed-on socket at the node that has the terrain."""

from __future__ import annotations

import asyncio
from contextlib import suppress
from typing import Final, Protocol, cast

MOST_HEAD: Final = 1 << 16
"""Most bytes of the head of an answer."""


class NearEnd(Protocol):
    """The end at the visitor, as a relay needs it: ``server/wire/websocket.py`` has it."""

    def pass_back(self, data: bytes) -> None:
        """Sends bytes to the visitor."""

    def pause_visitor(self) -> None:
        """Takes nothing more for now."""

    def resume_visitor(self) -> None:
        """Takes more."""


class Relay(asyncio.Protocol):
    """The end of a passed-on socket at the other node. Bytes go both ways as they are: frames are masked by the visitor
    and unmasked by the owner, as each would be without this node in between."""

    def __init__(self, near: NearEnd) -> None:
        """``near``: the end at the visitor."""
        self._near = near
        self.reset()

    def reset(self) -> None:
        """As before the first try."""
        self._transport: asyncio.Transport | None = None
        self._head = b""
        self._opened: asyncio.Future[tuple[int, bytes]] = asyncio.get_running_loop().create_future()
        self._is_open = False
        self.ended: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self.passed = [0, 0]
        """Bytes to the owner, and back."""

    async def opened(self, request: bytes) -> tuple[int, bytes]:
        """Sends the request; returns the status and the head of the answer."""
        assert self._transport is not None
        self._transport.write(request)
        return await self._opened

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast(asyncio.Transport, transport)  # uvloop's are none by inheritance

    def data_received(self, data: bytes) -> None:
        if self._is_open:
            self.passed[1] += len(data)
            self._near.pass_back(data)
            return
        self._head += data
        end = self._head.find(b"\r\n\r\n")
        if end < 0:
            if len(self._head) > MOST_HEAD:
                self.abort()
            return
        head, rest = self._head[:end], self._head[end + 4 :]
        self._head, words = b"", head.split(b" ", 2)
        status = int(words[1]) if len(words) > 1 and words[1].isdigit() else 0
        self._is_open = status == 101
        if not self._opened.done():
            self._opened.set_result((status, head))
        if self._is_open and rest:
            self._near.pass_back(rest)

    def send(self, data: bytes) -> None:
        """Passes bytes of the visitor on."""
        if self._transport is not None and not self._transport.is_closing():
            self.passed[0] += len(data)
            self._transport.write(data)

    def pause_writing(self) -> None:
        """The owner does not read as fast as the visitor sends."""
        self._near.pause_visitor()

    def resume_writing(self) -> None:
        self._near.resume_visitor()

    def pause_reading(self) -> None:
        """The visitor does not read as fast as the owner sends."""
        if self._transport is not None:
            with suppress(RuntimeError):
                self._transport.pause_reading()

    def resume_reading(self) -> None:
        """The visitor has read."""
        if self._transport is not None:
            with suppress(RuntimeError):
                self._transport.resume_reading()

    def connection_lost(self, exc: Exception | None) -> None:
        if not self._opened.done():
            self._opened.set_exception(exc or ConnectionResetError("the connection was closed"))
            self._opened.exception()
        if not self.ended.done():
            self.ended.set_result(None)

    def close(self) -> None:
        """Ends it, once what is on its way was sent."""
        if self._transport is not None:
            self._transport.close()

    def abort(self) -> None:
        """Ends it at once."""
        if self._transport is not None:
            self._transport.abort()
