"""Routes of terrains: making, downloading, uploading."""

from __future__ import annotations

import asyncio
from typing import Annotated, Any, Final

from fastapi import FastAPI, Request, Response
from pydantic import Field

from esker import contract as c
from esker import templates
from esker.document import archive
from esker.server.answers import AnyLink, Problem, limited
from esker.session.hub import Hub
from esker.upload import read_archive

MAX_IMPORT_BYTES: Final = 16 * 1024 * 1024


class NewTerrain(c.Wire):
    """Body of POST /api/terrains."""

    title: c.Name | None = None
    template: c.Id | None = None
    size_m: Annotated[float, Field(ge=c.MIN_SIZE_M, le=c.MAX_SIZE_M)] | None = None


def add_terrains(app: FastAPI, hub: Hub) -> None:
    """Adds them."""

    @app.get("/api/templates")
    async def list_templates() -> list[dict[str, str]]:
        return [{"id": t.id, "title": t.title, "description": t.description} for t in templates.catalogue()]

    @app.post("/api/terrains", status_code=201)
    async def create(request: Request, body: NewTerrain) -> dict[str, str]:
        limited(request, app.state.new_terrains, "new terrains came")
        return await _create(hub, _new_document(body))

    @app.post("/api/terrains/import", status_code=201)
    async def upload(request: Request) -> dict[str, str]:
        limited(request, app.state.new_terrains, "new terrains came")
        content = await _body(request, MAX_IMPORT_BYTES)
        try:
            document = await read_archive(content, app.state.uploads)
        except archive.ArchiveError as error:
            raise Problem(400, "bad_archive", str(error)) from error
        return await _create(hub, document)

    @app.get("/api/terrains/{terrain}")
    async def about(terrain: str, link: AnyLink) -> dict[str, Any]:
        document = await hub.document(terrain)
        return {
            "id": terrain,
            "title": document.settings.title,
            "role": link.role,
            "clock": document.clock,
            "strokes": len(document.strokes),
        }

    @app.get("/api/terrains/{terrain}/archive")
    async def download(terrain: str, link: AnyLink) -> Response:  # noqa: ARG001
        document = await hub.document(terrain)
        content = await asyncio.to_thread(archive.dumps, document)
        name = f'attachment; filename="{terrain}.esker"'
        return Response(content, media_type="application/zip", headers={"Content-Disposition": name})


def _new_document(body: NewTerrain) -> c.Document:
    if body.template is None:
        size = body.size_m or c.DEFAULT_SIZE_M
        document = c.Document(
            id="new", settings=c.TerrainSettings(size_m=size, reach_m=size * c.DEFAULT_REACH_FRACTION)
        )
    else:
        try:
            document = templates.load(body.template).document
        except KeyError:
            raise Problem(404, "no_template", "There is no such starting terrain.") from None
        if body.size_m is not None and body.size_m != document.settings.size_m:
            raise Problem(400, "malformed", "A starting terrain has its own size.")
    if body.title is not None:
        settings = document.settings.model_copy(update={"title": body.title})
        document = document.model_copy(update={"settings": settings})
    return document


async def _create(hub: Hub, document: c.Document) -> dict[str, str]:
    born, link, secret = await hub.create(document)
    return {"id": born.id, "title": born.settings.title, "secret": secret, "role": link.role}


async def _body(request: Request, limit: int) -> bytes:
    parts: list[bytes] = []
    size = 0
    async for part in request.stream():
        size += len(part)
        if size > limit:
            raise Problem(413, "too_large", f"The file may have {limit // 2**20} MiB at most.")
        parts.append(part)
    return b"".join(parts)
