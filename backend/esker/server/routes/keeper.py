"""Routes of the machine's owner: what this server keeps (docs/decisions/0035-the-machines-owner.md)."""

from __future__ import annotations

import asyncio
import time
from typing import Annotated, Any, Final

from fastapi import Depends, FastAPI, Query, Request

from esker import contract as c
from esker.contract import Role
from esker.errors import Cannot
from esker.fairness.shares import Rate, Rates
from esker.fairness.turns import SERVER
from esker.keeper.private import Key
from esker.server.routes.answers import asker
from esker.session.room.hub import Hub
from esker.store.access import TooManyLinks
from esker.store.kept import MOST, all_kept, count_kept

WRONG_KEYS: Final = (0.5, 30)
"""Wrong keys by address: rate a second, burst."""
LINK_NAME: Final = "Opened from the list of this server"


class KeeperLink(c.Wire):
    """Body of POST /api/server/terrains/{id}/links."""

    role: Role = "owner"


def add_keeper(app: FastAPI, hub: Hub, key: Key) -> None:
    """Adds the routes."""
    wrong = Rates(Rate(*WRONG_KEYS))

    async def keeper(request: Request) -> None:
        """Lets a person through who shows the server's key. Raises Cannot."""
        scheme, _, shown = request.headers.get("authorization", "").partition(" ")
        if scheme.lower() == "bearer" and len(shown) <= 128 and key.fits(shown.strip()):
            return
        if not wrong.take(asker(request), time.monotonic()):
            raise Cannot(429, "rate_limited", "Too many wrong keys came from your address. Wait a minute.")
        raise Cannot(
            403, "not_keeper", "Only the owner of the server's computer may see this. `esker link` prints how."
        )

    @app.get("/api/server/terrains", dependencies=[Depends(keeper)])
    async def list_terrains(skip: Annotated[int, Query(ge=0, le=10**9)] = 0) -> dict[str, Any]:
        kept = await hub.read(SERVER, all_kept, hub.journal, skip, MOST)
        total = await hub.read(SERVER, count_kept, hub.journal)
        return {"total": total, "terrains": [each._asdict() | {"here": _here(hub, each.id)} for each in kept]}

    @app.post("/api/server/terrains/{terrain}/links", status_code=201, dependencies=[Depends(keeper)])
    async def new_link(terrain: str, body: KeeperLink) -> dict[str, str]:
        if not hub.journal.exists(terrain):
            raise Cannot(404, "no_terrain", "There is no such terrain on this server.")
        try:
            made, secret = await asyncio.wrap_future(hub.access.add(terrain, body.role, LINK_NAME))
        except TooManyLinks:
            raise Cannot(409, "too_many_links", "This terrain has too many links. Revoke some.") from None
        return {"id": terrain, "role": made.role, "secret": secret}


def _here(hub: Hub, terrain: str) -> int:
    """Returns how many people are in a terrain now."""
    room = hub.open_room(terrain)
    return 0 if room is None else len(room.core.members)
