"""HTTP on one connection, with patience that ends (docs/protocol.md, "Limits").

The parser keeps whatever header comes, and nothing in it waits only so long. Without this, a few hundred connections
that never finish a request, or never read an answer, would take every descriptor of the server and never give it back.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from typing import Any, Final, Literal

from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol

from esker.fairness.shares import OWNER, Full, Place, Places, Share, Who
from esker.server.wire.websocket import WebSocketProtocol

MAX_HEADER_BYTES: Final = 64 * 1024
"""Most bytes of the request line and all header fields together."""
LOOK_SECONDS: Final = 5.0
HEADER_SECONDS: Final = 20.0
"""Seconds until the header of a request must be whole, counted from the beginning of the connection or from the end of
the answer before."""
BODY_SECONDS: Final = 20.0
BODY_BYTES: Final = 20 * 1024
"""A body, or an answer, that moves less than this in so many seconds has stopped."""
MOST_WAITING: Final = 8
"""Requests of a connection that may wait for the answer to the one before. Browsers send none of these."""
_TOO_LARGE: Final = (
    b"HTTP/1.1 431 Request Header Fields Too Large\r\ncontent-type: text/plain; charset=utf-8\r\n"
    b"content-length: 32\r\nconnection: close\r\n\r\nThe request's header is too long"
)
_TOO_MANY: Final = (
    b"HTTP/1.1 503 Service Unavailable\r\ncontent-type: text/plain; charset=utf-8\r\nretry-after: 10\r\n"
    b"content-length: 41\r\nconnection: close\r\n\r\nToo many connections are open. Try later."
)
ADDRESS_CONNECTIONS: Final = 1_024
"""Most connections of one address, as far as the server has so many. A school has one address, and each page holds some
seven."""


class Connections:
    """Connections of the server: a sum that leaves descriptors for its own files, and a share for each address."""

    def __init__(self, most: int, exempt: Callable[[str], bool] = lambda _: False) -> None:
        """``most``: at a time; ``exempt``: proxies, behind which are all addresses (``routes/socket.py`` counts)."""
        each = max(1, min(ADDRESS_CONNECTIONS, most // 4))
        self._places = Places(Share(most, address=each, network=min(2 * each, most)))
        self._exempt = exempt

    def __len__(self) -> int:
        return len(self._places)

    def take(self, address: str) -> Place:
        """Returns a place for a connection from there. Raises Full."""
        return self._places.take(Who("", rank=OWNER) if self._exempt(address) else Who(address))


def bounded(config: Any, connections: Connections) -> None:
    """Makes the protocols of a uvicorn.Config keep to these bounds."""
    config.esker_connections = connections


class HttpProtocol(HttpToolsProtocol):
    """Drops a peer that sends a header without end, or neither sends nor reads on what it began."""

    _reading: Literal["header", "body", "nothing"] = "header"
    _header_bytes = 0
    _body_bytes = 0
    _since = 0.0
    """Time from which on the header is awaited, or bytes of the body are counted."""
    _unread_since: float | None = None
    _look_timer: asyncio.TimerHandle | None = None
    _place: Place | None = None

    def connection_made(self, transport: Any) -> None:
        """Begins a connection: its first header is awaited. A connection beyond the shares is told so and closed."""
        super().connection_made(transport)
        connections: Connections | None = getattr(self.config, "esker_connections", None)
        if connections is not None:
            try:
                self._place = connections.take(self.client[0] if self.client else "")
            except Full:
                transport.write(_TOO_MANY)
                transport.close()
                return
        self._await_header()
        self._look_timer = self.loop.call_later(LOOK_SECONDS, self._look)

    def connection_lost(self, exc: Exception | None) -> None:
        """Notes that the connection ended."""
        self._leave()
        if self._place is not None:
            self._place.release()
        super().connection_lost(exc)

    def handle_websocket_upgrade(self) -> None:
        """Leaves the connection to the rules of the websocket."""
        self._leave()
        super().handle_websocket_upgrade()
        socket = self.transport.get_protocol()
        if isinstance(socket, WebSocketProtocol):
            socket.place, self._place = self._place, None

    def data_received(self, data: bytes) -> None:
        """Takes bytes of the peer, unless it is being sent away.

        A header above ``MAX_HEADER_BYTES`` ends the connection.
        """
        if self.transport.is_closing():
            return
        super().data_received(data)
        if self._reading == "header":
            self._header_bytes += len(data)
            if self._header_bytes > MAX_HEADER_BYTES and not self.transport.is_closing():
                self.transport.write(_TOO_LARGE)
                self.transport.close()

    def on_message_begin(self) -> None:
        """Notes the first byte of a request. Raises ValueError behind too many that wait: the parser gives up then."""
        if len(self.pipeline) >= MOST_WAITING:
            raise ValueError("too many requests at a time")
        self._await_header()
        super().on_message_begin()

    def on_headers_complete(self) -> None:
        """Notes that the header is whole; a body may follow."""
        self._reading, self._body_bytes, self._since = "body", 0, time.monotonic()
        super().on_headers_complete()

    def on_body(self, body: bytes) -> None:
        """Notes a part of the body."""
        self._body_bytes += len(body)
        super().on_body(body)

    def on_message_complete(self) -> None:
        """Notes that the request is whole; it may have been answered before."""
        self._reading = "nothing"
        super().on_message_complete()
        if self.cycle is None or self.cycle.response_complete:
            self._await_header()

    def on_response_complete(self) -> None:
        """Notes that the answer was handed over; another request may come."""
        if self._reading == "nothing" and not self.pipeline:
            self._await_header()
        super().on_response_complete()

    def pause_writing(self) -> None:
        """Notes that the peer does not read as fast as is sent."""
        self._unread_since = time.monotonic()
        super().pause_writing()

    def resume_writing(self) -> None:
        """Notes that the peer has read what was sent."""
        self._unread_since = None
        super().resume_writing()

    def _await_header(self) -> None:
        self._reading, self._header_bytes, self._since = "header", 0, time.monotonic()

    def _leave(self) -> None:
        if self._look_timer is not None:
            self._look_timer.cancel()
            self._look_timer = None

    def _look(self) -> None:
        self._look_timer = self.loop.call_later(LOOK_SECONDS, self._look)
        if self._stopped(time.monotonic()):
            self._leave()
            self.transport.abort()

    def _stopped(self, now: float) -> bool:
        """Returns whether the peer has left something unfinished for too long."""
        if self._unread_since is not None and now - self._unread_since > BODY_SECONDS:
            return True
        if self._reading == "header":
            return now - self._since > HEADER_SECONDS
        if self._reading == "body" and now - self._since > BODY_SECONDS:
            if self._body_bytes < BODY_BYTES and not self.flow.read_paused:
                return True
            self._since, self._body_bytes = now, 0
        return False
