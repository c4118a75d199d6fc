"""Routes of terrains: making, downloading, uploading."""

from __future__ import annotations

import asyncio
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any, Final

from fastapi import FastAPI, Request, Response
from pydantic import Field

from esker import contract as c
from esker import templates
from esker.document import archive
from esker.document.birth import new_document
from esker.errors import Cannot
from esker.fairness.shares import Who
from esker.fairness.turns import Turns
from esker.patchwork.raster.rasters import RasterError
from esker.server.routes.answers import AnyLink, asker, limited, shown
from esker.server.upload import read_archive
from esker.server.wire.sending import Sent
from esker.session.room.hub import Hub
from esker.store.grids import GridStore
from esker.store.space import Space

MAX_IMPORT_BYTES: Final = c.MAX_GRID_BYTES
"""Most bytes of an uploaded .esker file, which holds its grids."""


class NewTerrain(c.Wire):
    """Body of POST /api/terrains. ``language``: of what pupils read in a lesson."""

    title: c.Name | None = None
    template: c.Id | None = None
    size_m: Annotated[float, Field(ge=c.MIN_SIZE_M, le=c.MAX_SIZE_M)] | None = None
    language: templates.Language = "en"


def add_terrains(app: FastAPI, hub: Hub, grids: GridStore) -> None:
    """Adds the routes."""

    @app.get("/api/templates")
    async def list_templates() -> list[dict[str, str]]:
        return [{"id": t.id, "title": t.title, "description": t.description} for t in templates.catalogue()]

    @app.get("/api/lessons")
    async def list_lessons() -> list[dict[str, Any]]:
        found = templates.plans()
        return [
            {"id": t.id, "title": t.title, "description": t.description, "minutes": found[t.id].minutes}
            for t in templates.lessons()
        ]

    @app.get("/api/lessons/{lesson}")
    async def lesson_plan(lesson: str, language: str = "en") -> dict[str, Any]:
        found = templates.plans("de" if language == "de" else "en").get(lesson)
        if found is None:
            raise Cannot(404, "no_lesson", "There is no such lesson.")
        return {"id": lesson, **asdict(found)}

    @app.post("/api/terrains", status_code=201)
    async def create(request: Request, body: NewTerrain) -> dict[str, str]:
        limited(request, app.state.new_terrains, "new terrains came")
        document = _new_document(body)
        if body.template is not None and document.layers:
            await asyncio.to_thread(_put_all, grids, templates.load(body.template))
        return await _create(hub, document, asker(request))

    @app.post("/api/terrains/import", status_code=201)
    async def upload(request: Request) -> dict[str, str]:
        limited(request, app.state.new_terrains, "new terrains came")
        with app.state.receiving.take(asker(request)):
            document = await _taken_in(request, grids, app.state.uploads)
        return await _create(hub, document, asker(request))

    @app.get("/api/terrains/{terrain}")
    async def about(request: Request, terrain: str, link: AnyLink) -> dict[str, Any]:
        document = await hub.document(terrain, None, asker(request, link))
        hub.door.demand(link)
        return {
            "id": terrain,
            "title": document.settings.title,
            "role": link.role,
            "clock": document.clock,
            "strokes": len(document.strokes),
            "layers": len(document.layers),
        }

    @app.get("/api/terrains/{terrain}/archive")
    async def download(request: Request, terrain: str, link: AnyLink) -> Response:
        document = shown(await hub.document(terrain, None, asker(request, link)), link, hub.lessons.of(terrain))
        try:
            path = await hub.packing.run(asker(request, link), grids.pack, document)
        except (archive.ArchiveError, RasterError) as error:
            raise Cannot(409, "no_grid", str(error)) from error
        return Sent(hub, link, path, "application/zip", f"{terrain}.esker", passing=True)


async def _taken_in(request: Request, grids: GridStore, uploads: Turns) -> c.Document:
    """Reads the terrain in the file that a request brings, and stores its grids."""
    work = grids.work()
    try:
        await _receive(request, work / "upload.esker", MAX_IMPORT_BYTES, grids.space)
        document = await read_archive(work / "upload.esker", work, lambda: uploads.turn(asker(request)))
        for digest in {layer.content for layer in (*document.layers, *document.deleted_layers)}:
            await asyncio.to_thread(grids.keep, work / digest, digest)
        return document
    except archive.ArchiveError as error:
        raise Cannot(400, "bad_archive", str(error)) from error
    finally:
        await asyncio.to_thread(grids.drop, work)


def _new_document(body: NewTerrain) -> c.Document:
    if body.template is None:
        document = new_document(body.size_m or c.DEFAULT_SIZE_M)
    else:
        try:
            document = templates.document(body.template, body.language)
        except KeyError:
            raise Cannot(404, "no_template", "There is no such starting terrain.") from None
        if body.size_m is not None and body.size_m != document.settings.size_m:
            raise Cannot(400, "malformed", "A starting terrain has its own size.")
    if body.title is not None:
        settings = document.settings.model_copy(update={"title": body.title})
        document = document.model_copy(update={"settings": settings})
    return document


async def _create(hub: Hub, document: c.Document, who: Who) -> dict[str, str]:
    born, link, secret = await hub.create(document, who)
    return {"id": born.id, "title": born.settings.title, "secret": secret, "role": link.role}


def _put_all(grids: GridStore, template: templates.Template) -> None:
    for raster in template.rasters().values():
        grids.put(raster)


async def _receive(request: Request, path: Path, limit: int, space: Space) -> None:
    """Writes the body of a request to the disk. Raises Cannot, space.NoSpace."""
    size = 0
    with path.open("wb") as file:
        async for part in request.stream():
            size += len(part)
            if size > limit:
                raise Cannot(413, "too_large", f"The file may have {limit // 2**20} MiB at most.")
            space.need(len(part))
            file.write(part)
