"""The websocket of a wall."""

from __future__ import annotations

from fastapi import FastAPI, WebSocket

from esker import contract as c
from esker.fairness.spending import Accounts
from esker.lesson.classes import Classes
from esker.lesson.wall import Walls, WallSession
from esker.server.routes.answers import address
from esker.server.routes.socket import WireTransport, messages, refuse
from esker.server.wire.front import Front


def add_wall(app: FastAPI, classes: Classes, front: Front) -> None:
    """Adds it."""
    walls, accounts = Walls(classes), Accounts()

    @app.websocket("/ws/wall")
    async def wall(socket: WebSocket) -> None:
        offered = socket.scope.get("subprotocols", [])
        subprotocol = c.SUBPROTOCOL if c.SUBPROTOCOL in offered else None
        await socket.accept(subprotocol)
        transport = WireTransport(socket)
        against = front.against(socket.scope)
        if against is not None:
            await refuse(socket, transport, "bad_origin", against[2])
            return
        transport.charge(accounts.member(address(socket)), transport.abort)
        await WallSession(walls, transport, address(socket), subprotocol).run(messages(socket))
