"""The websocket of a wall."""

from __future__ import annotations

from fastapi import FastAPI, WebSocket

from esker.fairness.spending import Accounts
from esker.lesson.classes import Classes
from esker.lesson.wall import Walls, WallSession
from esker.server.routes.answers import address
from esker.server.routes.socket import accepted, messages
from esker.server.wire.front import Front


def add_wall(app: FastAPI, classes: Classes, front: Front) -> None:
    """Adds it."""
    walls, accounts = Walls(classes), Accounts()

    @app.websocket("/ws/wall")
    async def wall(socket: WebSocket) -> None:
        transport, subprotocol, is_welcome = await accepted(socket, front)
        if not is_welcome:
            return
        transport.charge(accounts.member(address(socket)), transport.abort)
        await WallSession(walls, transport, address(socket), subprotocol).run(messages(socket))
