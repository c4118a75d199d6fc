"""One port for HTTPS and for addresses that were typed without their scheme (docs/protocol.md).

A browser that is given ``192.168.1.20:8000`` speaks plain HTTP first. The first byte of a connection says which of the
two it is: TLS begins with 22, and nothing of HTTP does. TLS goes on to the server; plain HTTP is answered with a
redirect to the same address under https.

A thread of its own accepts and waits for that byte: it only looks (``MSG_PEEK``), so that the server still reads the
byte, and it does so with any event loop of any system. Who sends nothing waits here and keeps nobody else waiting.
"""

from __future__ import annotations

import asyncio
import logging
import re
import selectors
import socket
import ssl
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any, Final, cast

log = logging.getLogger("esker.server.wire.door")

TLS_HANDSHAKE: Final = 0x16
"""The first byte of every TLS connection: the type of its first record."""
FIRST_BYTE_SECONDS: Final = 10.0
"""Seconds for which a connection may be silent before it says what it is."""
HANDSHAKE_SECONDS: Final = 20.0
WAITING: Final = 512
"""Connections that may be silent at a time. With one more the longest silent one is closed."""
HEADER_SECONDS: Final = 10.0
MAX_HEADER_BYTES: Final = 8 * 1024
"""Most bytes that the header of a plain request may have to be answered with a redirect."""
BACKLOG: Final = 2048
LOOK_SECONDS: Final = 0.5
FULL_SECONDS: Final = 0.2
"""Seconds for which nobody is accepted when the process has no descriptor left."""
_HOST: Final = re.compile(rb"[A-Za-z0-9.\-]{1,253}(:[0-9]{1,5})?|\[[0-9A-Fa-f:.]{2,45}\](:[0-9]{1,5})?")
_TARGET: Final = re.compile(rb"/[!-~]*")


class Door:
    """Accepts on one listener until it is closed. Like an ``asyncio.Server`` it is closed, then awaited."""

    def __init__(
        self,
        listener: socket.socket,
        context: ssl.SSLContext,
        serve: Callable[[], asyncio.Protocol],
        host: str,
    ) -> None:
        """``serve`` makes the protocol of one TLS connection; ``host``: the address where a request names none.

        Must be made in the event loop in which the protocols live.
        """
        self._listener, self._context, self._serve, self._host = listener, context, serve, host
        self._loop = asyncio.get_running_loop()
        self._tasks: set[asyncio.Task[Any]] = set()
        self._redirects: set[Redirect] = set()
        self._silent: dict[socket.socket, float] = {}
        """Connections that have said nothing yet, oldest first, each with the time when it is given up."""
        self._selector = selectors.DefaultSelector()
        self._wake, self._waker = socket.socketpair()
        self._stopping = False
        listener.setblocking(False)
        listener.listen(BACKLOG)
        self._selector.register(listener, selectors.EVENT_READ)
        self._selector.register(self._wake, selectors.EVENT_READ)
        self._thread = threading.Thread(target=self._run, name="door", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Accepts nobody more, and closes connections that have said nothing yet. Connections of the server live on."""
        if not self._stopping:
            self._stopping = True
            self._waker.send(b"\0")
            self._thread.join()

    async def wait_closed(self) -> None:
        """Waits for handshakes that were under way, and ends plain requests that are not whole yet."""
        for redirect in tuple(self._redirects):
            redirect.abort()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    # --- in the thread ------------------------------------------------------------------------------------------

    def _run(self) -> None:
        try:
            while not self._stopping:
                for key, _ in self._selector.select(LOOK_SECONDS):
                    if key.fileobj is self._listener:
                        self._accept()
                    elif key.fileobj is not self._wake:
                        self._look(key.fileobj)  # type: ignore[arg-type]
                self._give_up(time.monotonic())
        finally:
            for silent in list(self._silent):
                self._forget(silent)
                silent.close()
            self._selector.close()
            self._wake.close()
            self._waker.close()

    def _accept(self) -> None:
        try:
            connection, _ = self._listener.accept()
        except (BlockingIOError, ConnectionAbortedError, InterruptedError):
            return
        except OSError as error:
            if not self._stopping:
                log.error("nobody can be accepted: %s", error)
                time.sleep(FULL_SECONDS)
            return
        connection.setblocking(False)
        while len(self._silent) >= WAITING:
            oldest = next(iter(self._silent))
            self._forget(oldest)
            oldest.close()
        self._silent[connection] = time.monotonic() + FIRST_BYTE_SECONDS
        self._selector.register(connection, selectors.EVENT_READ)

    def _look(self, connection: socket.socket) -> None:
        try:
            first = connection.recv(1, socket.MSG_PEEK)
        except (BlockingIOError, InterruptedError):
            return
        except OSError:
            first = b""
        self._forget(connection)
        if not first:
            connection.close()
            return
        try:
            self._loop.call_soon_threadsafe(self._hand_over, connection, first[0] == TLS_HANDSHAKE)
        except RuntimeError:  # the loop has ended
            connection.close()

    def _forget(self, connection: socket.socket) -> None:
        del self._silent[connection]
        self._selector.unregister(connection)

    def _give_up(self, now: float) -> None:
        for connection, until in list(self._silent.items()):
            if until > now:
                return
            self._forget(connection)
            connection.close()

    # --- in the event loop --------------------------------------------------------------------------------------

    def _hand_over(self, connection: socket.socket, tls: bool) -> None:
        task = self._loop.create_task(self._serve_tls(connection) if tls else self._redirect(connection))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _serve_tls(self, connection: socket.socket) -> None:
        # Handshakes that fail are the peer's affair: a port scan, a certificate that is not trusted yet.
        with suppress(OSError):
            await self._loop.connect_accepted_socket(
                self._serve, connection, ssl=self._context, ssl_handshake_timeout=HANDSHAKE_SECONDS
            )

    async def _redirect(self, connection: socket.socket) -> None:
        with suppress(OSError):
            protocol = Redirect(self._host, self._redirects.discard)
            self._redirects.add(protocol)
            await self._loop.connect_accepted_socket(lambda: protocol, connection)


class Redirect(asyncio.Protocol):
    """Answers one plain HTTP request with the same address under https, and closes."""

    def __init__(self, host: str, ended: Callable[[Redirect], object]) -> None:
        """``host``: with its port, where the request names none that can be repeated; ``ended`` is told of the end."""
        self._host, self._ended, self._got = host, ended, b""
        self._transport: asyncio.Transport | None = None
        self._timer: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Gives the request up, which has been awaited for so long."""
        self._transport = cast(asyncio.Transport, transport)
        self._timer = asyncio.get_running_loop().call_later(HEADER_SECONDS, self.abort)

    def connection_lost(self, exc: Exception | None) -> None:  # noqa: ARG002
        """Notes that the connection ended."""
        if self._timer is not None:
            self._timer.cancel()
        self._ended(self)

    def abort(self) -> None:
        """Ends the connection at once."""
        if self._transport is not None:
            self._transport.abort()

    def data_received(self, data: bytes) -> None:
        """Takes bytes of the request. Its body is of no interest."""
        if self._transport is None or self._transport.is_closing():
            return
        self._got += data
        if b"\r\n\r\n" in self._got or b"\n\n" in self._got:
            self._transport.write(redirected(self._got, self._host))
            self._transport.close()
        elif len(self._got) > MAX_HEADER_BYTES:
            self.abort()


def redirected(request: bytes, host: str) -> bytes:
    """The answer to a plain HTTP request: a redirect to https, or 400 where it is no request.

    ``host`` is named where the request names no host, or none that may stand in a header.

    >>> redirected(b"GET /t/abc HTTP/1.1\\r\\nHost: 10.0.0.2:8000\\r\\n\\r\\n", "x").split(b"\\r\\n")[1]
    b'Location: https://10.0.0.2:8000/t/abc'
    """
    head = request.replace(b"\r\n", b"\n").partition(b"\n\n")[0].split(b"\n")
    words = head[0].split(b" ")
    if len(words) != 3 or not words[2].startswith(b"HTTP/1.") or not _TARGET.fullmatch(words[1]):
        return _answer(b"400 Bad Request", b"This port speaks HTTPS.", b"")
    asked = next((line[5:].strip() for line in head[1:] if line[:5].lower() == b"host:"), b"")
    where = b"https://" + (asked if _HOST.fullmatch(asked) else host.encode("ascii", "ignore")) + words[1]
    # The redirect is temporary: plain HTTP may be served here one day, and browsers never forget a permanent one.
    return _answer(b"307 Temporary Redirect", b"This server speaks HTTPS: " + where, b"Location: " + where + b"\r\n")


def _answer(status: bytes, text: bytes, more: bytes) -> bytes:
    head = b"HTTP/1.1 " + status + b"\r\n" + more + b"Content-Type: text/plain\r\nCache-Control: no-store\r\n"
    return head + b"Content-Length: " + str(len(text)).encode() + b"\r\nConnection: close\r\n\r\n" + text
