"""Routes that delete a terrain and bring it back."""

from __future__ import annotations

import asyncio
from typing import Any

from fastapi import FastAPI, Request

from esker.errors import Cannot
from esker.lesson.classes import Classes
from esker.server.routes.answers import OwnerLink, address, secret_of
from esker.session.room.door import Deleted
from esker.session.room.hub import Hub


def add_deletion(app: FastAPI, hub: Hub, classes: Classes) -> None:
    """Adds the routes."""

    @app.delete("/api/terrains/{terrain}")
    async def delete(terrain: str, link: OwnerLink) -> dict[str, Any]:
        until = await hub.delete(link)
        await classes.end_all(terrain)
        return {"id": terrain, "until": until}

    @app.post("/api/terrains/{terrain}/restore")
    async def restore(request: Request, terrain: str) -> dict[str, Any]:
        try:
            hub.door.authorise(terrain, secret_of(request), address(request))
        except Deleted as deleted:
            if deleted.link.role != "owner":
                raise Cannot(403, "not_owner", "Only an owner of the terrain may do this.") from None
            await asyncio.wrap_future(hub.deletion.bring_back(terrain))
            return {"id": terrain}
        raise Cannot(409, "not_deleted", "This terrain is not deleted.")
