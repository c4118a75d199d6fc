"""A websocket under uvicorn, with short ways in and out for what a room full of people says (docs/protocol.md).

ASGI hands every message over through a queue and a task. Here the application may have messages as they are read, and
may write frames that were made once for many.
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Callable
from typing import Any, Final

from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.exceptions import WebSocketException
from websockets.frames import CloseCode, Frame, Opcode
from websockets.protocol import State

from esker.fairness.laps import WAITED, Waiting
from esker.fairness.shares import Place
from esker.fairness.spending import BYTE_SECONDS, Account
from esker.server.wire.boundaries import FrameBoundaries
from esker.server.wire.holding import Holding

try:
    from websockets.speedups import apply_mask
except ImportError:  # a platform without a compiled one
    from websockets.utils import apply_mask

log = logging.getLogger("esker.server")

READ_AHEAD: Final = 8
"""Messages of one client that may wait to be understood before no more are read."""
FAREWELL_SECONDS: Final = 1.0
"""Seconds that a peer which does not answer has for reading the farewell."""
SLICE_BYTES: Final = 4096
"""Bytes that are parsed at a time. They are few, since small frames cost a hundred times what their bytes do."""
TURN_SECONDS, STRAINED_TURN_SECONDS = 0.004, 0.002
"""A connection that took so much processor time without a pause waits as long before more of it is read. One that has
taken much waits sooner, and longer (``spending.Account.rest``)."""
MAX_FRAGMENTS: Final = 256
"""Frames of one message. The library bounds its bytes, and empty frames have none."""
_NO_HANDSHAKE: Final = (
    b"HTTP/1.1 400 Bad Request\r\ncontent-type: text/plain; charset=utf-8\r\n"
    b"content-length: 33\r\nconnection: close\r\n\r\nThis is no opening of a websocket"
)
_WHOLE_TEXT: Final = 0x80 | Opcode.TEXT
_MASKED: Final = 0x80
_TWO_BYTES, _EIGHT_BYTES = 126, 127
"""Codes that stand for a length which follows in two or in eight bytes (RFC 6455, 5.2)."""


class WebSocketProtocol(WebSocketsSansIOProtocol):
    """The object that an application finds as ``scope["esker.socket"]``, beside ASGI's ``receive`` and ``send``."""

    _listener: Callable[[str | bytes], None] | None = None
    _broke: Callable[[], None] | None = None
    _deaf = False
    _rest = b""
    """Bytes that were read, and wait for the connection's next turn."""
    _turn: asyncio.TimerHandle | Waiting | None = None
    place: Place | None = None
    """Place of this connection among those that the server has."""
    _holding: Holding | None = None
    """Where bytes go that this server does not read: the socket may be for another node."""

    def __init__(self, *arguments: Any, **named: Any) -> None:
        """As uvicorn makes its own."""
        super().__init__(*arguments, **named)
        self._boundaries = FrameBoundaries()
        self._account = Account()

    async def run_asgi(self) -> None:
        """Runs the application."""
        self.scope["esker.socket"] = self  # type: ignore[typeddict-unknown-key]
        await super().run_asgi()

    def connection_lost(self, exc: Exception | None) -> None:
        """The connection ended."""
        self._listener = self._broke = None
        self._rest = b""
        if self._holding is not None:
            self._holding.gone()
        if self._turn is not None:
            self._turn.cancel()
        if self.place is not None:
            self.place.release()
        super().connection_lost(exc)

    # --- out ----------------------------------------------------------------------------------------------------

    def abort(self) -> None:
        """Drops a connection whose peer does not read."""
        self.transport.abort()

    def write_now(self, frame: bytes) -> bool:
        """Writes a whole frame if there is room for it. Raises ConnectionResetError when the peer is gone."""
        if not self.writable.is_set():
            return False
        if self.disconnected or self.close_sent or self.conn.state is not State.OPEN:
            raise ConnectionResetError("the peer is gone")
        self.transport.write(frame)
        return True

    async def write(self, frame: bytes) -> None:
        """Writes a whole frame when there is room. Raises ConnectionResetError when the peer is gone."""
        while not self.write_now(frame):
            await self.writable.wait()

    def keepalive_timeout(self) -> None:
        """The peer did not answer a ping. What is on its way to it may wait for ever, so nothing waits for that."""
        super().keepalive_timeout()
        self.loop.call_later(FAREWELL_SECONDS, self.transport.abort)

    # --- in -----------------------------------------------------------------------------------------------------

    def shutdown(self) -> None:
        """The server stops. A connection that cannot take its leave in form is dropped: the others, and what is to be
        saved, come after it."""
        try:
            super().shutdown()
        except (AssertionError, RuntimeError, WebSocketException) as error:
            log.debug("a connection could not be closed in form: %s", error)
            self.transport.abort()

    def hold(self) -> Holding:
        """From now on what comes is not read but kept, until it is known who reads it. Called before the handshake."""
        self._holding = Holding(self)
        return self._holding

    def go_on(self, held: bytes) -> None:
        """Reads what was kept, and all that comes."""
        self._holding = None
        if held:
            self.data_received(held)

    def pause_writing(self) -> None:
        """The peer does not read as fast as is sent."""
        super().pause_writing()
        if self._holding is not None:
            self._holding.full()

    def resume_writing(self) -> None:
        """The peer has read."""
        super().resume_writing()
        if self._holding is not None:
            self._holding.free()

    def listen(self, listener: Callable[[str | bytes], None]) -> None:
        """From now on messages are given to ``listener`` when they are read. Those that wait come by ``receive``,
        and so does the end. ``listener`` must not raise."""
        self._listener = listener

    def charge(self, account: Account, broke: Callable[[], None]) -> None:
        """From now on what is read is paid for by ``account``. When it cannot pay nothing more is read, and ``broke``
        is called, which must not raise."""
        self._account, self._broke = account, broke

    def pay(self, seconds: float) -> None:
        """Pays for what was done for this connection elsewhere."""
        if self._deaf or self.disconnected:
            return
        if self._account.pay(self.loop.time(), seconds):
            return
        self._deaf, self._rest = True, b""
        self.transport.pause_reading()
        if self._broke is None:
            self.transport.abort()
        else:
            self._broke()

    def data_received(self, data: bytes) -> None:
        """Bytes of the peer. Each is paid for before it is parsed, and what it took afterwards."""
        if self._deaf:
            return
        if self._holding is not None:
            self._holding.feed(data)
            return
        self.pay(BYTE_SECONDS * len(data))
        if self._deaf:
            return
        if self._turn is not None:
            self._rest += data
            self.transport.pause_reading()
            return
        self._parse(data)

    def _parse(self, data: bytes) -> None:
        """Whole plain texts are understood here, all else by the library's parser, for one turn: in this lap of the
        event loop, or in a later one where those of its address have had their share of this."""
        left = self._account.left()
        if left <= 0:
            self._rest = data
            self.transport.pause_reading()
            self._turn = self._account.wait(self._go_on)
            return
        began, since, at = time.thread_time(), time.monotonic(), 0
        is_small = self._account.is_small

        def used() -> float:
            spent = time.thread_time() - began
            return spent if is_small else max(spent, WAITED * (time.monotonic() - since))

        is_strained = self._account.is_strained
        turn = min(left, STRAINED_TURN_SECONDS if is_strained else TURN_SECONDS)
        while at < len(data) and used() < turn and not self._deaf and not self.disconnected:
            taken = self._take_texts(data, at, used, turn)
            if not taken:
                taken = min(SLICE_BYTES, len(data) - at)
                piece = data[at : at + taken] if taken < len(data) else data
                self._boundaries.feed(piece)
                super().data_received(piece)
                if self.conn.handshake_exc is not None and not self.handshake_initiated:
                    self._refuse_handshake()
            at += taken
        spent = time.thread_time() - began
        self._account.took(spent, time.monotonic() - since)
        self.pay(self._account.price(spent))
        if (at < len(data) or (is_strained and data)) and not self._deaf and not self.disconnected:
            self._rest = data[at:]
            self.transport.pause_reading()
            self._turn = self.loop.call_later(self._account.rest(self.loop.time(), spent), self._go_on)

    def _refuse_handshake(self) -> None:
        """The request asked for a websocket and cannot be one: it has a body, say. The library says nothing then."""
        self._deaf = self.close_sent = True
        self.transport.write(_NO_HANDSHAKE)
        self.transport.close()

    def _go_on(self) -> None:
        self._turn = None
        rest, self._rest = self._rest, b""
        self._parse(rest)
        if self._turn is None and not self._deaf and not self.read_paused and not self.transport.is_closing():
            self.transport.resume_reading()

    def handle_cont(self, event: Frame) -> None:
        """A part of a message. Of one in too many parts nothing more is read."""
        if self._deaf:
            return
        if len(self.frames) >= MAX_FRAGMENTS:
            self.conn.fail(CloseCode.MESSAGE_TOO_BIG, f"a message has {MAX_FRAGMENTS} frames at most")
            self.handle_parser_exception()
            self._deaf, self.frames = True, []
            return
        super().handle_cont(event)

    def _take_texts(self, data: bytes, at: int, used: Callable[[], float], turn: float) -> int:
        """Gives the listener the texts that ``data`` has from ``at`` on, until more than ``turn`` seconds are used.

        Returns how many bytes they took. Clients say nearly everything in texts that are masked and in one frame each,
        and here these take a third of the time. What is anything else is left as it is.
        """
        first = at
        while len(data) - at >= 6 and data[at] == _WHOLE_TEXT and data[at + 1] & _MASKED and self._idle():
            size, start = data[at + 1] & ~_MASKED, at + 6
            if size == _TWO_BYTES:
                size, start = int.from_bytes(data[at + 2 : at + 4]), at + 8
            elif size == _EIGHT_BYTES:
                break
            if start + size > len(data) or size > self.config.ws_max_size:
                break
            try:
                text = apply_mask(data[start : start + size], data[start - 4 : start]).decode()
            except UnicodeDecodeError:
                break
            at = start + size
            assert self._listener is not None
            self._listener(text)
            if used() > turn:
                break
        return at - first

    def _idle(self) -> bool:
        """Returns whether there is a listener and nothing before what comes now: no part of a frame or of a message, no
        message that waits, no farewell."""
        if self._listener is None or self.close_sent or self.conn.state is not State.OPEN or not self.queue.empty():
            return False
        return self._boundaries.is_between

    def send_receive_event_to_app(self) -> None:
        """A whole message has come: to the listener, or into the queue behind those that wait there."""
        if self.close_sent:
            super().send_receive_event_to_app()  # this drops the message
            return
        data = self.frames[0] if len(self.frames) == 1 else b"".join(self.frames)
        try:
            message = data.decode() if self.curr_msg_data_type == "text" else bytes(data)
        except UnicodeDecodeError:
            # The library would log a traceback, as if the fault were the server's.
            self.frames = []
            self.conn.send_close(CloseCode.INVALID_DATA)
            self.handle_parser_exception()
            return
        if self._listener is None or not self.queue.empty():
            self._queue_message()
            return
        self.frames = []
        self._listener(message)

    def _queue_message(self) -> None:
        """Stops reading when ``READ_AHEAD`` messages wait; at every single one, as it is inherited, takes two calls of
        the system for each."""
        paused, self.read_paused = self.read_paused, True
        super().send_receive_event_to_app()
        self.read_paused = paused
        if not paused and self.queue.qsize() >= READ_AHEAD:
            self.read_paused = True
            self.transport.pause_reading()
