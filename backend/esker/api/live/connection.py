"""The connection of a live terrain: a thread that holds the socket, comes back after a cut, and sends what waits."""

from __future__ import annotations

import asyncio
import logging
import random
import ssl
import threading
import time
from collections.abc import Callable
from typing import Any, Final

from websockets.asyncio.client import ClientConnection
from websockets.asyncio.client import connect as open_socket
from websockets.exceptions import ConnectionClosed, InvalidHandshake, InvalidMessage
from websockets.proxy import get_proxy
from websockets.uri import parse_uri

from esker import contract as c
from esker.api.link import Link, Refused
from esker.api.live.ground import StreamedGround
from esker.document.sync import Diverged, SyncDoc
from esker.document.wire import op_json
from esker.fairness.buckets import TokenBucket
from esker.tiles.codec.frame import FrameError

log = logging.getLogger("esker.api.live")

RATE: Final = 0.8 * c.MAX_OPS_PER_SECOND
BURST: Final = 0.5 * c.OPS_BURST
"""A little below the server's own, so that nothing is refused for its rate."""
NOTICES: Final = 100
BACKOFF_SECONDS: Final = (0.2, 10.0)
FINAL_CODES: Final = frozenset(code for code in c.WS_CLOSE.values() if code <= 4008 or code in (4011, 4012))
CONNECT_SECONDS: Final = 15.0
LOST: Final = (OSError, ConnectionClosed, InvalidHandshake, InvalidMessage, TimeoutError, Diverged, FrameError)
"""After these the client connects again."""


class LiveConnection:
    """One terrain's connection. All public methods may be called from any thread; ``changed`` guards what they share.

    The document is ``sync``. What the server says of us and of others stands in ``role``, ``members``, ``lesson`` and
    ``notices``; ``refusals`` are of ops since they were last taken.
    """

    def __init__(self, link: Link, name: str, client: str, tls: ssl.SSLContext | None, *, ground: bool) -> None:
        """``ground``: take the tiles that the server streams."""
        self._link, self._name, self._client, self._tls = link, name, client, tls
        # Whoever looks for a proxy goes through the environment, which the thread that made us may change at any time.
        self._proxy = get_proxy(parse_uri(link.url))
        self.sync = SyncDoc(client)
        self.changed = threading.Condition()
        self.role: c.Role = "view"
        self.members: tuple[c.Member, ...] = ()
        self.lesson = c.Lesson()
        self.notices: list[str] = []
        self.refusals: list[Refused] = []
        self.is_online = False
        self.ground: StreamedGround | None = None
        if ground:
            self.ground = StreamedGround(self.sync, self.changed, self.poke, self.raise_failure)
        self._token: str | None = None
        self._ticket: str | None = None
        self._socket: ClientConnection | None = None
        self._failure: Refused | None = None
        self._is_closing = False
        self._bucket = TokenBucket(RATE, BURST)
        self._loop = asyncio.new_event_loop()
        self._wake = asyncio.Event()
        self._thread = threading.Thread(target=self._run, name="esker-client", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Leaves. What is unsent then is lost."""
        if self._is_closing:
            return
        self._is_closing = True
        self.poke()
        self._thread.join(timeout=10)

    def raise_failure(self) -> None:
        """Raises Refused once the server does not let us in any more."""
        if self._failure is not None:
            raise self._failure

    def raise_closed(self) -> None:
        """Raises RuntimeError after ``close``."""
        if self._is_closing:
            raise RuntimeError("this connection was closed: connect again to change the terrain")

    def wait_for(self, ready: Callable[[], bool], timeout: float, what: str) -> None:
        """Returns once it is ``ready``. Raises TimeoutError with ``what``, or Refused."""
        with self.changed:
            done = self.changed.wait_for(lambda: self._failure is not None or ready(), timeout)
            if not ready():
                self.raise_failure()
            if not done:
                raise TimeoutError(what)

    def say(self, message: c.Conduct | c.People | c.Grouping) -> None:
        """Sends a message. Raises RuntimeError while there is no connection."""
        self.raise_closed()
        socket = self._socket
        if socket is None or not self.is_online:
            raise RuntimeError("there is no connection at the moment: try again when `online` is True")
        asyncio.run_coroutine_threadsafe(socket.send(message.model_dump_json()), self._loop).result(CONNECT_SECONDS)

    def poke(self) -> None:
        """Has the thread look for what waits to be sent."""
        if not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._wake.set)

    # --- the thread ---------------------------------------------------------------------------------------------

    def _run(self) -> None:
        try:
            self._loop.run_until_complete(self._stay_connected())
        finally:
            self._loop.close()

    async def _stay_connected(self) -> None:
        low, high = BACKOFF_SECONDS
        delay = low
        while not self._is_closing and self._failure is None:
            started, moved = time.monotonic(), False
            try:
                await self._connection()
            except LOST as error:
                log.info("connection lost: %s", error)
                moved = self.is_online and _has_moved(error)
                if isinstance(error, Diverged):
                    with self.changed:
                        self.sync.start_over()
            with self.changed:
                self.is_online = False
                self.sync.disconnected()
                self.changed.notify_all()
            if self._is_closing or self._failure is not None:
                return
            delay = low if time.monotonic() - started > high else min(high, delay * 2)
            self._wake.clear()
            spread = random.uniform(0.0, c.MOVED_WITHIN_MS / 1000)
            await self._sleep(spread if moved else delay * random.uniform(0.5, 1.0))

    async def _sleep(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        while not self._is_closing and time.monotonic() < end:
            await asyncio.sleep(min(0.1, seconds))

    async def _connection(self) -> None:
        options: dict[str, Any] = {"ssl": self._tls} if self._tls else {}
        async with open_socket(
            self._link.url,
            subprotocols=[c.SUBPROTOCOL],  # type: ignore[list-item]
            max_size=None,
            compression=None,
            open_timeout=10,
            proxy=self._proxy,
            **options,
        ) as socket:
            hello = c.Hello(
                protocol=c.PROTOCOL_VERSION,
                terrain=self._link.terrain,
                secret=self._link.secret,
                client=self._client,
                token=self._token,
                ticket=self._ticket,
                name=self._name,
                clock=self.sync.clock,
            )
            await socket.send(hello.model_dump_json())
            if self.ground is not None:
                with self.changed:
                    self.ground.connected()
            sender, self._socket = asyncio.create_task(self._send(socket)), socket
            try:
                async for message in socket:
                    if isinstance(message, str):
                        self._receive(c.SERVER_MESSAGE.validate_json(message))
                    elif self.ground is not None:  # else frames are not read, and no credit is given for them
                        with self.changed:
                            credit = self.ground.applied(message)
                        await socket.send(credit.model_dump_json())
            finally:
                self._socket = None
                sender.cancel()
                await asyncio.gather(sender, return_exceptions=True)

    async def _send(self, socket: ClientConnection) -> None:
        while True:
            await self._wake.wait()
            self._wake.clear()
            if self._is_closing:
                await socket.close()
                return
            if self.ground is not None and self.is_online:
                with self.changed:
                    view = self.ground.unsent()
                if view is not None:
                    await socket.send(view.model_dump_json())
            while self.is_online and not self._is_closing:
                with self.changed:
                    envelopes = self.sync.outgoing(1) if self._bucket.take(time.monotonic()) else None
                if envelopes is None:
                    await asyncio.sleep(1 / RATE)
                    continue
                if not envelopes:
                    break
                envelope = envelopes[0]
                await socket.send(f'{{"type":"ops","ops":[{{"id":"{envelope.id}","op":{op_json(envelope.op)}}}]}}')

    def _receive(self, message: object) -> None:
        with self.changed:
            match message:
                case c.Welcome():
                    self.sync.welcome(message)
                    self._token, self._ticket = message.token, message.ticket or None
                    self.lesson = message.lesson or self.lesson
                    self.role, self.members, self.is_online = message.role, message.members, True
                    self._wake.set()
                case c.OpsBroadcast():
                    self.sync.ordered(message)
                case c.Ack():
                    self.sync.ack(message)
                case c.Reject():
                    self.sync.reject(message)
                    self.refusals.append(Refused(message.code, message.message))
                case c.Lesson():
                    self.lesson = message
                case c.Notice():
                    self.notices = [*self.notices, message.text][-NOTICES:]
                case c.Members():
                    self.members = message.members
                case c.Progress() if self.ground is not None:
                    self.ground.progressed(message)
                case c.ErrorMessage() if message.fatal and c.WS_CLOSE[message.code] in FINAL_CODES:
                    self._failure = Refused(message.code, message.message)
            self.changed.notify_all()


def _has_moved(error: Exception) -> bool:
    """Returns whether the server said that the terrain goes to another one: nothing is wrong, and it is there soon."""
    received = error.rcvd if isinstance(error, ConnectionClosed) else None
    return received is not None and received.code == c.WS_CLOSE["moved"]
