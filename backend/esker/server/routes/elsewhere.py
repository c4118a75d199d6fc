"""Sockets whose terrain another node has (DESIGN 18). Without ``--node`` nothing here runs."""

from __future__ import annotations

import logging
from collections.abc import Awaitable, Callable
from contextlib import ExitStack, suppress
from typing import Final

from fastapi import WebSocket

from esker.cluster import passing, places
from esker.cluster.node import Cluster
from esker.cluster.peers import MOVED_HEADER, Elsewhere
from esker.cluster.relay import Relay
from esker.cluster.signing import Visit
from esker.server.wire.holding import Holding
from esker.server.wire.websocket import WebSocketProtocol
from esker.session.room.protocol import HELLO_SECONDS

log = logging.getLogger("esker.server")

MOVING: Final = "This terrain is on its way to another server. Your page comes back by itself."
"""What a page is told that came while a terrain moved, and longer than it waits."""


class Arrival:
    """A socket that came to this node."""

    def __init__(self, cluster: Cluster, socket: WebSocket) -> None:
        self._cluster, self._socket = cluster, socket
        self._visit: Visit | None = socket.scope.get(passing.PASSED)
        self._wire: WebSocketProtocol = socket.scope["esker.socket"]
        self._held: Holding | None = self._wire.hold() if self._visit is None else None

    async def expected(self) -> bool:
        """Returns whether the socket is to be accepted: another node that was wrong about this one is told so, before
        anything was said, and asks elsewhere."""
        if self._visit is None:
            return True
        try:
            await self._cluster.hold(self._visit.terrain)
        except Elsewhere as error:
            log.info("a socket that was passed on found no terrain here: %s", error)
            with suppress(OSError):  # whoever asked may have given up meanwhile
                await passing.refuse(self._socket.send, 409, b"{}", [(MOVED_HEADER, b"1")])
            self._wire.handshake_complete = True  # as far as it goes: the library would log an error
            return False
        return True

    async def serve(self, here: Callable[[], Awaitable[None]], refuse: Callable[[str], Awaitable[None]]) -> None:
        """Serves the socket by ``here``, or has the node serve it that has its terrain. ``refuse``: tells the page to
        come again."""
        terrain = self._visit.terrain if self._visit is not None else ""
        if self._held is not None:
            terrain = places.terrain_of_hello(await self._held.first(places.MOST_HELLO, HELLO_SECONDS))
            if terrain:
                try:
                    relay = await passing.relay(self._cluster, self._socket.scope, terrain, self._held)
                except Elsewhere as error:
                    log.info("a socket found its terrain nowhere: %s", error)
                    await refuse(MOVING)
                    return
                if relay is not None:
                    await self._tie(relay, self._held)
                    return
            self._held.release()
        with ExitStack() as stack:
            if terrain:
                stack.enter_context(self._cluster.using(terrain))
            await here()

    async def _tie(self, relay: Relay, held: Holding) -> None:
        counts = self._cluster.counts
        counts.sockets_passing += 1
        try:
            held.tie(relay)
            await relay.ended
        finally:
            relay.close()
            counts.sockets_passing -= 1
