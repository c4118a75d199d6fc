"""The HTTP server: uvicorn with this project's own protocols, doors and bounds, and a farewell before it ends."""

from __future__ import annotations

import asyncio
import socket
import ssl
from collections.abc import Awaitable, Callable
from typing import Any, Final

import uvicorn

from esker import contract as c
from esker.jobs import Imports
from esker.process import system
from esker.process.garbage import Collector
from esker.server.nodes import Member
from esker.server.settings import Settings
from esker.server.starting import CannotServe
from esker.server.wire.door import BACKLOG, Door
from esker.server.wire.front import Front, Proxies, hosts, local_names
from esker.server.wire.http import Connections, HttpProtocol, bounded
from esker.server.wire.websocket import WebSocketProtocol
from esker.session.room.hub import Hub

GOODBYE_SECONDS: Final = 0.3
"""Time for the farewells to leave before the sockets are closed."""
HARD_MESSAGE_LIMIT: Final = 4 * c.MAX_MESSAGE_BYTES
"""Above ``MAX_MESSAGE_BYTES`` a client gets a sentence (4007); above this the websocket library hangs up (1009)."""
PING_SECONDS, PONG_SECONDS = 20.0, 20.0
"""A websocket's peer is asked so often whether it is there. Without an answer in so long it is dropped."""
OWN_FILES: Final = 256
"""Descriptors that connections leave to the database, uploads and children: so many, and a quarter of all at least."""
TEND_TICKS: Final = 5
"""Ticks of the HTTP server, ten a second, after which the collector is asked whether there is time for it."""


class HttpServer(uvicorn.Server):
    """Says goodbye to the members of all rooms before the sockets are closed."""

    def __init__(
        self,
        config: uvicorn.Config,
        hub: Hub,
        imports: Imports,
        host: str,
        started: Callable[[], Awaitable[None]],
        node: Member | None = None,
    ) -> None:
        """``host``: the address for people who speak plain HTTP and name no host; ``node``: among others."""
        super().__init__(config)
        self._node = node
        self._hub, self._imports, self._host, self._announce = hub, imports, host, started
        self.collector = Collector()

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        if self._node is not None:
            await self._node.begin()
        context, self.config.ssl = self.config.ssl, None
        if context is None or not sockets:
            await super().startup(sockets)
        else:  # the door makes the connections: some of them begin without TLS and are sent to https
            for each in sockets:  # connections that come before the door is made wait in the backlog
                each.listen(BACKLOG)
            await super().startup([])
            self.servers: list[Any] = [Door(each, context, self._protocol, self._host) for each in sockets]
        if self.started:
            await self._announce()

    def _protocol(self) -> asyncio.Protocol:
        make: Any = self.config.http_protocol_class
        made: asyncio.Protocol = make(config=self.config, server_state=self.server_state, app_state=self.lifespan.state)
        return made

    async def on_tick(self, counter: int) -> bool:
        if counter % TEND_TICKS == 0:
            self.collector.tend()
        return await super().on_tick(counter)

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        if self._node is not None:
            await self._node.leave()
        await self._imports.close()
        await self._hub.close()
        await asyncio.sleep(GOODBYE_SECONDS)
        await super().shutdown(sockets)


def front_of(settings: Settings, address: str) -> Front:
    """Returns by which names this server is reached, and behind which proxies. Raises CannotServe."""
    try:
        proxies = Proxies(settings.forwarded_allow_ips)
    except ValueError as error:
        raise CannotServe(f"ESKER_FORWARDED_ALLOW_IPS: {error}.") from None
    url = settings.public_url.rstrip("/").lower() if settings.public_url else None
    names = {*local_names(), *(name.strip() for name in settings.hosts.split(",") if name.strip())}
    near = settings.lan or settings.host in ("localhost", "127.0.0.1", "::1")
    known = hosts((*names, address), url) if near or url or settings.hosts else None
    # HTTPS with a certificate that people must trust first, or click away, may not be made the only way in.
    return Front(proxies, known, url, strict=url is not None and url.startswith("https:") and not settings.lan)


def configured(app: Any, exempt: Callable[[str], bool], context: ssl.SSLContext | None) -> uvicorn.Config:
    """Returns how uvicorn serves the application. ``exempt``: addresses of which any number of connections may come:
    proxies, other nodes."""
    config = uvicorn.Config(
        app,
        ws=WebSocketProtocol,
        ws_max_size=HARD_MESSAGE_LIMIT,
        # Tiles are deflated already, and control texts are small: a second deflate costs more than it saves.
        ws_per_message_deflate=False,
        ws_ping_interval=PING_SECONDS,
        ws_ping_timeout=PONG_SECONDS,
        http=HttpProtocol,
        log_config=None,
        access_log=False,
        server_header=False,
        timeout_graceful_shutdown=5,
        proxy_headers=False,  # server/wire/front.py reads the headers of proxies
    )
    config.load()
    config.ssl = context
    files = system.raise_open_files()
    bounded(config, Connections(files - max(files // 4, min(OWN_FILES, files // 2)), exempt))
    return config
