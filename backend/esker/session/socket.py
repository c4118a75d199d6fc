"""Runs one socket: reads into the protocol, hands events to the room, sends what the outbox holds."""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import AsyncIterator, Callable, Sequence
from typing import Final, Protocol

from esker import contract as c
from esker.session import protocol
from esker.session.core import Denied
from esker.session.hub import Hub
from esker.session.outbox import SLOW, Outbox
from esker.session.room import Guest, Room

log = logging.getLogger("esker.socket")

WATCH_SECONDS: Final = 0.5
GOODBYE_SECONDS: Final = 1.0
"""How long a closing connection may take to accept the reason."""
REASON_BYTES: Final = 123
"""Of the reason in a close frame (RFC 6455, 5.5)."""


class Transport(Protocol):
    """One websocket. ``send_text`` and ``send_bytes`` return when the socket has room again; ``abort`` drops it without
    a farewell.

    All but ``abort`` and ``listen`` raise ConnectionError when the peer is gone. ``went_on`` is called whenever a part
    of a long text has left.
    """

    def listen(self, listener: Callable[[str | bytes], None]) -> None:
        """From now on a message that none waits before may be given to ``listener`` as it is read, and not come by the
        iterator. It must not raise."""
        ...

    def send_now(self, texts: Sequence[str]) -> bool:
        """Sends texts if there is room for them at once; False when there is not, or when one of them is long."""
        ...

    async def send_text(self, text: str, went_on: Callable[[], None]) -> None: ...

    async def send_bytes(self, data: bytes) -> None: ...

    async def close(self, code: int, reason: str) -> None: ...

    def abort(self) -> None: ...


class Session:
    """One connection from its handshake to its end."""

    def __init__(
        self,
        hub: Hub,
        transport: Transport,
        address: str,
        subprotocol: str | None,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        self._hub, self._transport, self._address, self._now = hub, transport, address, now
        self._protocol = protocol.Connection(now(), subprotocol)
        self._wake = asyncio.Event()
        self.outbox = Outbox(self._wake.set, now=self._send_now)
        self._room: Room | None = None
        self._guest: Guest | None = None
        self._sending_since: float | None = None

    async def run(self, messages: AsyncIterator[str | bytes]) -> None:
        """Serves the connection until either side ends it. ``messages`` ends when the socket is gone."""
        sender = asyncio.create_task(self._send_all())
        reader = asyncio.create_task(self._read_all(messages))
        watch = asyncio.create_task(self._watch())
        try:
            await asyncio.wait((sender, reader), return_when=asyncio.FIRST_COMPLETED)
            if self.outbox.closing is not None and not sender.done():
                await asyncio.wait((sender,), timeout=GOODBYE_SECONDS)
        finally:
            for task in (sender, reader, watch):
                task.cancel()
            results = await asyncio.gather(sender, reader, watch, return_exceptions=True)
            if self._room is not None and self._guest is not None:
                self._room.leave(self._guest)
                self._guest = None  # what is still read of its messages is nobody's
            if self.outbox.closing is not None:
                self._transport.abort()
            for error in results:
                if isinstance(error, Exception) and not isinstance(error, ConnectionError):
                    log.error("a connection from %s failed: %s: %s", self._address, type(error).__name__, error)

    # --- reading ------------------------------------------------------------------------------------------------

    async def _read_all(self, messages: AsyncIterator[str | bytes]) -> None:
        for event in self._protocol.opened():
            await self._handle(event)
        try:
            async for message in messages:
                for event in self._events(message):
                    await self._handle(event)
        except ConnectionError:
            raise
        except Exception:
            self._failed()

    def _read(self, message: str | bytes) -> None:
        """A message of a member, as it is read: what is not a hello needs no task to wait in."""
        try:
            for event in self._events(message):
                self._do(event)
        except Exception:
            self._failed()

    def _events(self, message: str | bytes) -> list[protocol.Event]:
        if isinstance(message, str):
            return self._protocol.text(message, self._now())
        return self._protocol.binary(message)

    def _failed(self) -> None:
        log.exception("a message from %s could not be handled", self._address)
        self.outbox.close("server_error", "The server failed to handle a message. Your page will come back.")

    async def _handle(self, event: protocol.Event) -> None:
        if not isinstance(event, protocol.Hi):
            self._do(event)
            return
        try:
            self._room, self._guest = await self._hub.enter(event.hello, self.outbox, self._address)
            self._transport.listen(self._read)  # a second hello is refused, so none comes this way
        except Denied as denied:
            self.outbox.close(denied.code, denied.message)

    def _do(self, event: protocol.Event) -> None:
        if isinstance(event, protocol.Close):
            self.outbox.close(event.code, event.message)
        elif self._room is not None and self._guest is not None and self.outbox.closing is None:
            self._room.receive(self._guest, event)
        elif isinstance(event, protocol.Reply):
            self.outbox.message(event.message)

    # --- sending ------------------------------------------------------------------------------------------------

    async def _send_all(self) -> None:
        while True:
            await self._wake.wait()
            self._wake.clear()
            while (text := self.outbox.pop()) is not None:
                self._went_on()
                await self._transport.send_text(text, self._went_on)
            if self.outbox.closing is not None:
                await self._farewell(*self.outbox.closing)
                return
            if self._room is not None and self._guest is not None:
                frame = self._room.frame(self._guest)
                if frame is not None:
                    self._went_on()
                    await self._transport.send_bytes(frame)
                    self._wake.set()
            self._sending_since = None

    def _send_now(self, texts: Sequence[str]) -> bool:
        """Whether texts went without the sender's task: nothing is on its way, and the socket has room."""
        try:
            return self._sending_since is None and self._transport.send_now(texts)
        except ConnectionError:  # the sender's task will see it too, and end
            return False

    def _went_on(self) -> None:
        self._sending_since = self._now()

    async def _farewell(self, code: c.CloseCode, reason: str) -> None:
        log.info("closed a connection from %s: %s (%s)", self._address, code, reason)
        text = c.ErrorMessage(code=code, message=reason, fatal=True).model_dump_json()
        await self._transport.send_text(text, self._went_on)
        await self._transport.close(c.WS_CLOSE[code], reason.encode()[:REASON_BYTES].decode(errors="ignore"))

    async def _watch(self) -> None:
        """Ends connections that never say hello, and clients that do not read."""
        closing_since: float | None = None
        while True:
            await asyncio.sleep(WATCH_SECONDS)
            now = self._now()
            for event in self._protocol.tick(now):
                await self._handle(event)
            if self.outbox.closing is not None:
                closing_since = now if closing_since is None else closing_since
                if now - closing_since >= GOODBYE_SECONDS:
                    self._transport.abort()
                    return
            elif self._sending_since is not None and now - self._sending_since > c.STALL_SECONDS:
                self.outbox.close("slow_client", SLOW)
                log.info("dropped a connection from %s: it did not read for %.0f s", self._address, c.STALL_SECONDS)
                self._transport.abort()
                return
