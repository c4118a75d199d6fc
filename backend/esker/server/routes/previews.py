"""Routes of preview pictures, and of programs that unfold links."""

from __future__ import annotations

import asyncio
import time
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any, Final

from fastapi import FastAPI, Request, Response
from fastapi.responses import FileResponse

from esker import contract as c
from esker.errors import Cannot
from esker.fairness.shares import Rate, Rates, Who
from esker.render.pictures import card
from esker.render.pictures.previews import HEIGHT, WIDTH, Busy, CannotDraw, Previews
from esker.server.routes.answers import AnyLink, OwnerLink, asker, limited
from esker.session.room.core import Denied
from esker.session.room.hub import Hub
from esker.store.access import Link
from esker.store.previews import Preview, PreviewTokens

PICTURES: Final = (1.0, 60)
"""Preview pictures by address."""
PICTURE_SECONDS: Final = 20.0
"""Seconds for which an answer waits for a picture that is being drawn."""


class PreviewChange(c.Wire):
    """Body of POST /api/terrains/{id}/preview."""

    shown: bool | None = None
    renew: bool = False


@dataclass(frozen=True)
class Pictures:
    """Preview pictures and who may see them. ``base``: where people reach this server; None: as each asks for it."""

    previews: Previews
    tokens: PreviewTokens
    base: str | None = None


def add_previews(app: FastAPI, hub: Hub, pictures: Pictures) -> None:
    """Adds the routes."""
    previews, tokens = pictures.previews, pictures.tokens
    app.state.pictures = Rates(Rate(*PICTURES))

    async def answer(request: Request, terrain: str, link: Link, found: Future[Preview]) -> dict[str, Any]:
        preview = await asyncio.wrap_future(found)
        hub.door.demand(link)
        if preview.shown:
            await _draw_ahead(hub, pictures, terrain, asker(request, link))
        return {"token": preview.token, "shown": preview.shown, "available": previews.available}

    @app.get("/api/terrains/{terrain}/preview")
    async def preview(request: Request, terrain: str, link: AnyLink) -> dict[str, Any]:
        return await answer(request, terrain, link, tokens.of(terrain))

    @app.post("/api/terrains/{terrain}/preview")
    async def change(request: Request, terrain: str, link: OwnerLink, body: PreviewChange) -> dict[str, Any]:
        if body.shown is False:
            previews.forget(terrain)
        return await answer(request, terrain, link, tokens.change(terrain, shown=body.shown, renew=body.renew))

    @app.api_route("/preview/{token}.jpg", methods=["GET", "HEAD"], include_in_schema=False)
    async def picture(request: Request, token: str) -> Response:
        limited(request, app.state.pictures, "pictures were asked for")
        terrain = tokens.terrain(token)
        if terrain is None:
            raise Cannot(404, "not_found", "There is no picture at this address.")
        try:
            document = await hub.document(terrain, None, asker(request))
            path = await asyncio.wait_for(previews.picture(document, asker(request)), PICTURE_SECONDS)
        except CannotDraw:
            raise Cannot(404, "no_pictures", "This server cannot draw pictures.") from None
        except (Busy, TimeoutError):
            raise Cannot(503, "busy", "The picture is still being drawn. Ask again in a moment.") from None
        return FileResponse(path, media_type="image/jpeg")


async def _draw_ahead(hub: Hub, pictures: Pictures, terrain: str, who: Who) -> c.Document | None:
    """Begins the picture of a terrain, so that it is there when it is asked for. Returns the document; None where there
    is none, or too much is asked for by ``who``."""
    try:
        document = await hub.document(terrain, None, who)
    except Denied:
        return None
    if hub.is_here(terrain):  # elsewhere the picture is asked for, and drawn
        pictures.previews.begin(document, who)
    return document


async def card_of(hub: Hub, pictures: Pictures, request: Request, terrain: str, token: str) -> str:
    """Returns tags for programs that unfold links: of this terrain, where the token opens its picture; else of none."""
    if pictures.tokens.terrain(token) != terrain or not pictures.previews.available:
        return ""
    if not request.app.state.pictures.take(asker(request), time.monotonic()):
        return ""
    document = await _draw_ahead(hub, pictures, terrain, asker(request))
    if document is None:
        return ""
    base = pictures.base or str(request.base_url).rstrip("/")
    title = document.settings.title
    image = f"{base}/preview/{token}.jpg?v={document.clock}"
    return card.tags(f"{base}/t/{terrain}?p={token}", title, image, (WIDTH, HEIGHT), f"{title}, seen from the air")
