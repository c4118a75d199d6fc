"""A websocket under uvicorn, with short ways in and out for what a room full of people says (docs/protocol.md).

ASGI hands every message over through a queue and a task. Here the application may have messages as they are read, and
may write frames that were made once for many.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.frames import Opcode
from websockets.protocol import State
from websockets.streams import StreamReader

try:
    from websockets.speedups import apply_mask
except ImportError:  # a platform without a compiled one
    from websockets.utils import apply_mask

READ_AHEAD: Final = 8
"""Messages of one client that may wait to be understood before no more are read."""
FAREWELL_SECONDS: Final = 1.0
"""For the farewell to a peer that does not answer, should it read after all."""
_WHOLE_TEXT: Final = 0x80 | Opcode.TEXT
_MASKED: Final = 0x80
_TWO_BYTES, _EIGHT_BYTES = 126, 127
"""What stands for the length where it follows in so many bytes (RFC 6455, 5.2)."""
_BETWEEN_FRAMES: Final = StreamReader.at_eof.__code__


class WebSocketProtocol(WebSocketsSansIOProtocol):
    """What an application finds as ``scope["esker.socket"]``, beside ASGI's ``receive`` and ``send``."""

    _listener: Callable[[str | bytes], None] | None = None

    async def run_asgi(self) -> None:
        """Runs the application."""
        self.scope["esker.socket"] = self  # type: ignore[typeddict-unknown-key]
        await super().run_asgi()

    def connection_lost(self, exc: Exception | None) -> None:
        """The connection ended."""
        self._listener = None
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

    def listen(self, listener: Callable[[str | bytes], None]) -> None:
        """From now on messages are given to ``listener`` when they are read. Those that wait come by ``receive``,
        and so does the end. ``listener`` must not raise."""
        self._listener = listener

    def data_received(self, data: bytes) -> None:
        """Bytes of the peer: whole plain texts are understood here, all else by the library's parser."""
        taken = self._take_texts(data)
        if taken < len(data):
            super().data_received(data[taken:] if taken else data)

    def _take_texts(self, data: bytes) -> int:
        """Gives the listener the texts that ``data`` begins with, masked, in one frame each, which is what clients send
        all day, in a third of the time; how many bytes they took. What is anything else is left as it is."""
        at = 0
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
        return at

    def _idle(self) -> bool:
        """Whether there is a listener and nothing before what comes now: no part of a frame or of a message, no message
        that waits, no farewell."""
        if self._listener is None or self.close_sent or self.conn.state is not State.OPEN or not self.queue.empty():
            return False
        waiting: Any = self.conn.parser
        while (inner := getattr(waiting, "gi_yieldfrom", None)) is not None:
            waiting = inner
        return self.conn.current_size is None and getattr(waiting, "gi_code", None) is _BETWEEN_FRAMES

    def send_receive_event_to_app(self) -> None:
        """A whole message has come: to the listener, or into the queue behind those that wait there."""
        if self._listener is None or self.close_sent or not self.queue.empty():
            self._queue_message()
            return
        data = self.frames[0] if len(self.frames) == 1 else b"".join(self.frames)
        try:
            message = data.decode() if self.curr_msg_data_type == "text" else bytes(data)
        except UnicodeDecodeError:
            super().send_receive_event_to_app()  # which ends the connection
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
