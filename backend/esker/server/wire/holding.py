"""A socket whose bytes this node does not read: its first message says where they are to go.

The first message is looked into as it lies in its frame. Then the bytes go to this server's own reader, as if nothing
had been, or on to another node as they are: frames are masked by the visitor and unmasked by the owner either way, so
nothing is parsed in between, and pings of the one are answered by the other.
"""

from __future__ import annotations

import asyncio
from contextlib import suppress
from typing import Final, Protocol

from websockets.frames import Opcode
from websockets.utils import apply_mask

from esker.server.wire.boundaries import MASK_BYTES, measured

MOST_HELD: Final = 64 * 1024
"""Bytes that wait until it is known who reads them; then the visitor is not read."""
_FINAL_TEXT: Final = 0x80 | Opcode.TEXT


class Socket(Protocol):
    """The socket's protocol (``websocket.py``)."""

    transport: asyncio.Transport

    def go_on(self, held: bytes) -> None: ...

    def stop_keepalive(self) -> None: ...


class FarEnd(Protocol):
    """Who has the bytes: the connection to another node."""

    def send(self, data: bytes) -> None: ...

    def pause_reading(self) -> None: ...

    def resume_reading(self) -> None: ...

    def close(self) -> None: ...


class Holding:
    """What a visitor has sent and nobody has read."""

    def __init__(self, socket: Socket) -> None:
        self._socket = socket
        self._held = b""
        self._more = asyncio.Event()
        self._is_gone = False
        self._far: FarEnd | None = None

    # --- what the socket calls ----------------------------------------------------------------------------------

    def feed(self, data: bytes) -> None:
        """Bytes of the visitor."""
        if self._far is not None:
            self._far.send(data)
            return
        self._held += data
        if len(self._held) > MOST_HELD:
            self.pause_visitor()
        self._more.set()

    def gone(self) -> None:
        """The visitor's connection ended."""
        self._is_gone = True
        self._more.set()
        if self._far is not None:
            self._far.close()

    def full(self) -> None:
        """The visitor does not read as fast as the other node sends."""
        if self._far is not None:
            self._far.pause_reading()

    def free(self) -> None:
        """The visitor has read."""
        if self._far is not None:
            self._far.resume_reading()

    # --- who looks, and decides ---------------------------------------------------------------------------------

    async def first(self, most: int, seconds: float) -> str:
        """The first message; empty where it is none that is short, whole and a text, or does not come."""
        with suppress(TimeoutError):
            async with asyncio.timeout(seconds):
                while (found := first_text(self._held, most)) is None and not self._is_gone:
                    self._more.clear()
                    await self._more.wait()
                return found or ""
        return ""

    def release(self) -> None:
        """This server reads what was kept."""
        self.resume_visitor()
        if not self._is_gone:
            self._socket.go_on(self._held)

    def tie(self, far: FarEnd) -> None:
        """From now on the bytes are the other node's."""
        self._far = far
        self._socket.stop_keepalive()
        far.send(self._held)
        self._held = b""
        self.resume_visitor()
        if self._is_gone:
            far.close()

    # --- the end at the visitor, for the other node's bytes -----------------------------------------------------

    def pass_back(self, data: bytes) -> None:
        """Sends bytes of the other node to the visitor."""
        if not self._socket.transport.is_closing():
            self._socket.transport.write(data)

    def pause_visitor(self) -> None:
        """Reads nothing more of the visitor for now."""
        with suppress(RuntimeError):
            self._socket.transport.pause_reading()

    def resume_visitor(self) -> None:
        """Reads the visitor again."""
        with suppress(RuntimeError):
            self._socket.transport.resume_reading()


def first_text(data: bytes, most: int) -> str | None:
    """Returns the text of the first frame; None while it is not whole, empty where it is none that may be looked into.

    >>> first_text(bytes((0x81, 0x82, 0, 0, 0, 0)) + b"hi", 100)
    'hi'
    >>> first_text(bytes((0x81, 0x82, 0, 0, 0, 0)) + b"h", 100) is None
    True
    >>> first_text(bytes((0x82, 0x81, 0, 0, 0, 0)) + b"b", 100)
    ''
    """
    if len(data) < 2:
        return None
    if data[0] != _FINAL_TEXT or not data[1] & 0x80:
        return ""
    found = measured(data[:14])
    if found is None:
        return None
    start, size = found
    if size > most:
        return ""
    if len(data) < start + size:
        return None
    return apply_mask(data[start : start + size], data[start - MASK_BYTES : start]).decode(errors="replace")
