"""Runs one socket: reads into the protocol, hands events to the room, sends what the outbox holds."""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import AsyncIterator, Callable, Sequence
from typing import Final, Protocol

from esker import contract as c
from esker.fairness.shares import Who
from esker.fairness.spending import Account, Accounts
from esker.process.garbage import weakly
from esker.session.room import protocol
from esker.session.room.core import Denied
from esker.session.room.hub import Hub
from esker.session.room.outbox import SLOW, Long, Outbox
from esker.session.room.room import Guest, Room
from esker.store.engine.ports import Unreachable

log = logging.getLogger("esker.socket")

WATCH_SECONDS: Final = 0.5
GOODBYE_SECONDS: Final = 0.8
"""A closing connection has this time to accept the reason."""
BROKE: Final = "This connection asked for more work than people's drawing takes."
SILENT: Final = "The server's database does not answer at the moment. Your page comes back by itself."
REASON_BYTES: Final = 123
"""Most bytes that a close frame holds for its reason (RFC 6455, 5.5)."""
LONG_SECONDS: Final = 0.002
"""A message that took longer is followed by a rest of the same length."""


class Transport(Protocol):
    """One websocket. ``send_text`` and ``send_bytes`` return when the socket has room again; ``abort`` drops it without
    a farewell.

    All but ``abort`` and ``listen`` raise ConnectionError when the peer is gone. ``went_on`` is called whenever a part
    of a long text has left.
    """

    def listen(self, listener: Callable[[str | bytes], None]) -> None:
        """Lets the transport call ``listener`` with each message as it is read, where no earlier message waits.

        Such a message does not come by the iterator. ``listener`` must not raise.
        """
        ...

    def send_now(self, texts: Sequence[str]) -> bool:
        """Sends texts if there is room for them at once.

        Returns False when there is not, or when one of them is long.
        """
        ...

    async def send_text(self, text: str, went_on: Callable[[], None]) -> None: ...

    async def send_long(self, parts: Sequence[bytes], went_on: Callable[[], None]) -> None:
        """Sends one text whose bytes lie in parts, of which no copy is made."""
        ...

    async def send_bytes(self, data: bytes) -> None: ...

    async def close(self, code: int, reason: str) -> None: ...

    def abort(self) -> None: ...

    def charge(self, account: Account, broke: Callable[[], None]) -> None:
        """Has ``account`` pay from now on for what is read; ``broke`` is called when it cannot pay."""
        ...

    def pay(self, seconds: float) -> None:
        """Pays for processor time that a message took after it was read."""
        ...


class Session:
    """One connection from its handshake to its end."""

    def __init__(
        self,
        hub: Hub,
        transport: Transport,
        address: str,
        subprotocol: str | None,
        now: Callable[[], float] = time.monotonic,
        accounts: Accounts | None = None,
    ) -> None:
        """``accounts``: what the connections of an address may take together (default: this one's alone)."""
        self._accounts = accounts or Accounts()
        self._hub, self._transport, self._address, self._now = hub, transport, address, now
        self._protocol = protocol.Connection(now(), subprotocol)
        self._wake = asyncio.Event()
        waiting = getattr(hub, "waiting", None)
        self.outbox = Outbox(weakly(self._woken), now=weakly(self._send_now), waiting=waiting, who=Who(address))
        self._end: asyncio.TimerHandle | None = None
        self._room: Room | None = None
        self._guest: Guest | None = None
        self._sending_since: float | None = None
        self._has_said_farewell = False
        self._account = self._accounts.stranger(address)
        transport.charge(self._account, weakly(self._broke))

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
            self._room = self._guest = None  # messages that are still read belong to nobody
            # What was written as a farewell may still be on its way: then the timer drops the connection.
            if self._end is not None and not self._has_said_farewell:
                self._end.cancel()
                self._transport.abort()
            self.outbox.drop()
            for error in results:
                if isinstance(error, Exception) and not isinstance(error, ConnectionError):
                    log.error("a connection from %s failed: %s: %s", self._address, type(error).__name__, error)

    def _woken(self) -> None:
        self._wake.set()
        if self.outbox.closing is not None and self._end is None:
            # A client that is sent away is gone in a second, whether or not it reads the farewell.
            self._end = asyncio.get_running_loop().call_later(GOODBYE_SECONDS, self._transport.abort)

    # --- reading ------------------------------------------------------------------------------------------------

    async def _read_all(self, messages: AsyncIterator[str | bytes]) -> None:
        for event in self._protocol.opened():
            await self._handle(event)
        try:
            async for message in messages:
                await self._account.turn()
                began, since = time.thread_time(), time.monotonic()
                events = self._events(message)
                for event in events:
                    if not isinstance(event, protocol.Hi):
                        self._do(event)
                spent = time.thread_time() - began
                self._account.took(spent, time.monotonic() - since)
                self._transport.pay(spent)
                for event in events:
                    if isinstance(event, protocol.Hi):
                        await self._handle(event)
                # The next message may wait already, and taking one that waits gives nobody else a turn.
                await asyncio.sleep(spent if spent > LONG_SECONDS else 0)
        except ConnectionError:
            raise
        except Exception as error:
            self._failed(error)

    def _read(self, message: str | bytes) -> None:
        """Takes a message of a member, as it is read: only a hello needs a task to wait in."""
        try:
            for event in self._events(message):
                self._do(event)
        except Exception as error:
            self._failed(error)

    def _events(self, message: str | bytes) -> list[protocol.Event]:
        if isinstance(message, str):
            return self._protocol.text(message, self._now())
        return self._protocol.binary(message)

    def _failed(self, error: Exception) -> None:
        """Closes the connection: what came by it could not be done."""
        if isinstance(error, Unreachable):
            log.warning("a message from %s could not be handled: %s", self._address, error)
            self.outbox.close("server_error", SILENT)
            return
        log.exception("a message from %s could not be handled", self._address)
        self.outbox.close("server_error", "The server failed to handle a message. Your page will come back.")

    async def _handle(self, event: protocol.Event) -> None:
        if not isinstance(event, protocol.Hi):
            self._do(event)
            return
        try:
            self._room, self._guest = await self._hub.enter(event.hello, self.outbox, self._address)
            self._account = self._accounts.member(self._address)
            self._transport.charge(self._account, weakly(self._broke))
            self._transport.listen(weakly(self._read))  # a second hello is refused, so none comes this way
        except Denied as denied:
            self.outbox.close(denied.code, denied.message, denied.ticket)

    def _broke(self) -> None:
        self.outbox.close("rate_limited", BROKE)

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
                if isinstance(text, Long):
                    await self._transport.send_long((text.head, text.body, text.tail), self._went_on)
                else:
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
        """Returns whether texts went without the sender's task: nothing is on its way, and the socket has room."""
        try:
            return self._sending_since is None and self._transport.send_now(texts)
        except ConnectionError:  # the sender's task will see it too, and end
            return False

    def _went_on(self) -> None:
        self._sending_since = self._now()

    async def _farewell(self, code: c.CloseCode, reason: str) -> None:
        log.info("closed a connection from %s: %s (%s)", self._address, code, reason)
        text = c.ErrorMessage(code=code, message=reason, fatal=True, ticket=self.outbox.ticket).model_dump_json()
        await self._transport.send_text(text, self._went_on)
        await self._transport.close(c.WS_CLOSE[code], reason.encode()[:REASON_BYTES].decode(errors="ignore"))
        self._has_said_farewell = True

    async def _watch(self) -> None:
        """Ends connections that never say hello, and clients that do not read."""
        while True:
            await asyncio.sleep(WATCH_SECONDS)
            now = self._now()
            for event in self._protocol.tick(now):
                await self._handle(event)
            if (
                self.outbox.closing is None
                and self._sending_since is not None
                and now - self._sending_since > c.STALL_SECONDS
            ):
                self.outbox.close("slow_client", SLOW)
                log.info("dropped a connection from %s: it did not read for %.0f s", self._address, c.STALL_SECONDS)
                self._transport.abort()
                return
