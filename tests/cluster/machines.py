"""Two or more servers of one process with the real wire and a small application, for tests of what is passed on."""

from __future__ import annotations

import asyncio
import json
import socket
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Any

import uvicorn
from fastapi import FastAPI, Request, WebSocket
from fastapi.responses import StreamingResponse

from esker.cluster.node import Cluster
from esker.cluster.passing import PASSED, Entrance, Passing
from esker.cluster.signing import made_key
from esker.fairness.spending import Account
from esker.server.routes.elsewhere import Arrival
from esker.server.serving import configured
from esker.store.engine.leases import Leases

KEY = made_key("the key that the nodes of a test have together")


async def slowly() -> None:
    """Lets everybody else have many turns of the loop."""
    for _ in range(20):
        await asyncio.sleep(0)


class Rich(Account):
    """Pays for everything."""

    def pay(self, *_: float) -> bool:
        return True


class NoRooms:
    """Rooms that have nothing open."""

    def __init__(self, homes: dict[str, str] | None = None) -> None:
        self.homes, self.lost, self.given = homes or {}, list[str](), list[str]()
        self.used, self.fresh = set[str](), list[str]()

    def in_use(self, terrain: str) -> bool:
        return terrain in self.used

    def lose(self, terrain: str) -> None:
        self.lost.append(terrain)

    async def hand_over(self, terrain: str) -> None:
        self.given.append(terrain)

    def home(self, terrain: str) -> str:
        return self.homes.get(terrain, terrain)

    def taken(self, terrain: str) -> None:
        self.fresh.append(terrain)


async def nowhere(*_: object) -> str:
    """No class, seat or code belongs to a terrain here."""
    return ""


class Machine:
    """One node with an application that says who serves whom."""

    def __init__(self, name: str, leases: Leases, **more: Any) -> None:
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.port: int = self.listener.getsockname()[1]
        self.rooms = NoRooms()
        self.cluster = Cluster(name, f"http://127.0.0.1:{self.port}", leases, more.pop("key", KEY), **more)
        self.bodies: list[int] = []
        self.sent = 0
        """Bytes that whoever sends a body has given away."""
        self.lags: list[int] = []
        self.ended = asyncio.Event()
        """The stream that is given out has ended, whole or not."""
        app = self._app()
        app.add_middleware(Passing, cluster=self.cluster, terrain_of=nowhere)
        app.add_middleware(Entrance, cluster=self.cluster)
        self.server = uvicorn.Server(configured(app, lambda _: False, None))
        self.task: asyncio.Task[None] | None = None

    def _app(self) -> FastAPI:
        app, name = FastAPI(), self.cluster.name

        @app.api_route("/api/terrains/{terrain}/{what}", methods=["GET", "POST", "DELETE"])
        async def here(request: Request, terrain: str, what: str) -> Any:
            if what == "stream":
                return StreamingResponse(self._parts(request), media_type="application/octet-stream")
            if what == "refused":
                return StreamingResponse(iter([b"no"]), status_code=413)
            size = 0
            async for part in request.stream():
                size += len(part)
                self.bodies.append(len(part))
                if what == "slow":
                    await slowly()
                    self.lags.append(self.sent - size)
            client = request.client.host if request.client else ""
            return {
                "node": name,
                "terrain": terrain,
                "client": client,
                "scheme": request.url.scheme,
                "bytes": size,
                "passed": PASSED in request.scope,
                "host": request.headers["host"],
                "header": request.headers.get("x-told", ""),
                "forwarded": request.headers.get("x-forwarded-for", ""),
            }

        @app.websocket("/ws")
        async def ws(socket: WebSocket) -> None:
            arrival = Arrival(self.cluster, socket)
            socket.scope["esker.socket"].charge(Rich(), lambda: None)
            if not await arrival.expected():
                return
            await socket.accept()

            async def here() -> None:
                hello = json.loads(await socket.receive_text())
                client = socket.client.host if socket.client else ""
                await socket.send_json({"node": name, "client": client, "terrain": hello["terrain"]})
                async for text in socket.iter_text():
                    await socket.send_text(text)

            async def refuse(sentence: str) -> None:
                await socket.close(4502, sentence)

            await arrival.serve(here, refuse)

        return app

    async def _parts(self, request: Request) -> AsyncIterator[bytes]:
        try:
            for n in range(512):
                if await request.is_disconnected():
                    return
                self.bodies.append(n)
                yield bytes(65536)
        finally:
            self.ended.set()

    async def start(self) -> None:
        await self.cluster.start(self.rooms)
        self.task = asyncio.create_task(self.server.serve(sockets=[self.listener]))
        while not self.server.started:
            await asyncio.sleep(0.005)

    async def stop(self) -> None:
        await self.cluster.drain()
        await self.cluster.close()
        self.server.should_exit = True
        if self.task is not None:
            await self.task


@asynccontextmanager
async def machines(leases: Leases, *names: str, make: Callable[..., Machine] = Machine) -> AsyncIterator[list[Machine]]:
    """Nodes that know each other."""
    made = [make(name, leases) for name in names]
    for each in made:
        await each.start()
    for each in made:  # who came first learns of the others with its next renewal; here at once
        each.cluster._nodes = leases.nodes()
    try:
        yield made
    finally:
        for each in made:
            await each.stop()
