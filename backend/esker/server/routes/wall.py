"""The websocket of a wall."""

from __future__ import annotations

from fastapi import FastAPI, WebSocket

from esker.cluster.node import Cluster
from esker.fairness.laps import Laps
from esker.fairness.spending import Accounts
from esker.fairness.turns import Turnstile
from esker.lesson.classes import Classes
from esker.lesson.wall import Walls, WallSession
from esker.server.routes.answers import address
from esker.server.routes.elsewhere import Arrival
from esker.server.routes.socket import accepted, messages, refuse
from esker.server.wire.front import Front


def add_wall(app: FastAPI, classes: Classes, front: Front, laps: Laps, cluster: Cluster | None = None) -> None:
    """Adds it. ``laps``: those of the event loop; ``cluster``: where other servers may have the class."""
    walls, accounts, long = Walls(classes), Accounts(laps=laps), Turnstile()

    @app.websocket("/ws/wall")
    async def wall(socket: WebSocket) -> None:
        arrival = None if cluster is None else Arrival(cluster, socket)
        if arrival is not None and not await arrival.expected():
            return
        transport, subprotocol, is_welcome = await accepted(socket, front, long)
        if not is_welcome:
            return

        async def here() -> None:
            await WallSession(walls, transport, address(socket), subprotocol, accounts).run(messages(socket))

        if arrival is None:
            await here()
        else:
            await arrival.serve(here, lambda sentence: refuse(socket, transport, "moved", sentence))
