"""Routes of preview pictures, and of programs that unfold links."""

from __future__ import annotations

import asyncio
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any, Final

from fastapi import FastAPI, Request, Response
from fastapi.responses import FileResponse

from esker import contract as c
from esker.render import card
from esker.render.previews import HEIGHT, WIDTH, Busy, CannotDraw, Previews
from esker.server.answers import AnyLink, OwnerLink, Problem, limited
from esker.session.core import Denied
from esker.session.hub import Hub
from esker.session.limits import RateByKey
from esker.store.previews import Preview, PreviewTokens

PICTURES: Final = (1.0, 60)
"""Preview pictures by address."""
PICTURE_SECONDS: Final = 20.0
"""So long an answer waits for a picture that is being drawn."""


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
    """Adds them."""
    previews, tokens = pictures.previews, pictures.tokens
    app.state.pictures = RateByKey(*PICTURES)

    async def answer(terrain: str, found: Future[Preview]) -> dict[str, Any]:
        preview = await asyncio.wrap_future(found)
        if preview.shown:
            await _draw_ahead(hub, pictures, terrain)
        return {"token": preview.token, "shown": preview.shown, "available": previews.available}

    @app.get("/api/terrains/{terrain}/preview")
    async def preview(terrain: str, link: AnyLink) -> dict[str, Any]:  # noqa: ARG001
        return await answer(terrain, tokens.of(terrain))

    @app.post("/api/terrains/{terrain}/preview")
    async def change(terrain: str, link: OwnerLink, body: PreviewChange) -> dict[str, Any]:  # noqa: ARG001
        if body.shown is False:
            previews.forget(terrain)
        return await answer(terrain, tokens.change(terrain, shown=body.shown, renew=body.renew))

    @app.api_route("/preview/{token}.jpg", methods=["GET", "HEAD"], include_in_schema=False)
    async def picture(request: Request, token: str) -> Response:
        limited(request, app.state.pictures, "pictures were asked for")
        terrain = tokens.terrain(token)
        if terrain is None:
            raise Problem(404, "not_found", "There is no picture at this address.")
        try:
            path = await asyncio.wait_for(previews.picture(await hub.document(terrain)), PICTURE_SECONDS)
        except CannotDraw:
            raise Problem(404, "no_pictures", "This server cannot draw pictures.") from None
        except (Busy, TimeoutError):
            raise Problem(503, "busy", "The picture is still being drawn. Ask again in a moment.") from None
        return FileResponse(path, media_type="image/jpeg")


async def _draw_ahead(hub: Hub, pictures: Pictures, terrain: str) -> c.Document | None:
    """Begins the picture of a terrain, so that it is there when it is asked for. Returns the document, None if none."""
    try:
        document = await hub.document(terrain)
    except Denied:
        return None
    pictures.previews.begin(document)
    return document


async def card_of(hub: Hub, pictures: Pictures, request: Request, terrain: str, token: str) -> str:
    """Tags for programs that unfold links: of this terrain, where the token opens its picture; else of none."""
    if pictures.tokens.terrain(token) != terrain or not pictures.previews.available:
        return ""
    document = await _draw_ahead(hub, pictures, terrain)
    if document is None:
        return ""
    base = pictures.base or str(request.base_url).rstrip("/")
    title = document.settings.title
    image = f"{base}/preview/{token}.jpg?v={document.clock}"
    return card.tags(f"{base}/t/{terrain}?p={token}", title, image, (WIDTH, HEIGHT), f"{title}, seen from the air")
