"""Routes of elevation files: upload, status, answers, cancel; and the stored grids."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Final

import numpy as np
from fastapi import FastAPI, Query, Request, Response
from fastapi.exceptions import RequestValidationError
from pydantic import StringConstraints, ValidationError

from esker import contract as c
from esker.errors import Cannot
from esker.jobs import Imports
from esker.patchwork.raster.rasters import RasterError
from esker.server.routes.answers import AnyLink, EditorLink, address, asker, limited
from esker.server.wire.sending import Sent
from esker.session.lesson.rules import HANDS_OFF
from esker.session.room.hub import Hub
from esker.store.grids import GridStore

TICKET_HEADER: Final = "Esker-Ticket"
"""By which a lesson knows who brings a file in, as by the ticket of a ``hello``."""
FileName = Annotated[str, Query(max_length=400)]
ClientId = Annotated[str, Query(max_length=40, pattern=r"^[A-Za-z0-9_-]*$")]
Digest = Annotated[str, StringConstraints(pattern=r"^[0-9a-f]{64}$")]


def add_imports(app: FastAPI, hub: Hub, grids: GridStore, imports: Imports) -> None:
    """Adds the routes."""
    _add_uploads(app, hub, imports)
    _add_grids(app, hub, grids)

    @app.get("/api/terrains/{terrain}/imports/{job}")
    async def status(terrain: str, job: str, link: AnyLink) -> c.ImportStatus:  # noqa: ARG001
        return imports.status(terrain, job)

    @app.post("/api/terrains/{terrain}/imports/{job}/answers")
    async def answers(request: Request, terrain: str, job: str, link: EditorLink) -> c.ImportStatus:
        # The body is parsed as JSON by the model: pydantic's strict mode takes no Python list for a pair.
        try:
            body = c.ImportAnswers.model_validate_json(await _short(request))
        except ValidationError as error:
            raise RequestValidationError(
                [{**found, "loc": ("body", *found["loc"])} for found in error.errors(include_url=False)]
            ) from error
        hub.door.demand(link)
        return imports.answer(terrain, job, link, body)

    @app.delete("/api/terrains/{terrain}/imports/{job}", status_code=204)
    async def cancel(terrain: str, job: str, link: EditorLink) -> None:
        await imports.cancel(terrain, job, link)


def _add_uploads(app: FastAPI, hub: Hub, imports: Imports) -> None:
    @app.post("/api/terrains/from-grid", status_code=201)
    async def from_grid(request: Request, name: FileName = "", client: ClientId = "") -> dict[str, Any]:
        limited(request, app.state.new_terrains, "new terrains came")
        person = f"{address(request)} {client}"
        body, length, who = request.stream(), _length(request), asker(request)
        taking = imports.upload_new(name, person, body, length, client, who, request.is_disconnected)
        born, secret, status = await taking
        return {
            "id": born.id,
            "title": born.settings.title,
            "secret": secret,
            "role": "owner",
            "import": status.model_dump(mode="json"),
        }

    @app.post("/api/terrains/{terrain}/imports", status_code=202)
    async def upload(
        request: Request, terrain: str, link: EditorLink, name: FileName = "", client: ClientId = "", hold: bool = False
    ) -> c.ImportStatus:
        limited(request, app.state.imports, "files came")
        person = f"{link.id} {client or address(request)}"
        caller = hub.lessons.caller(link, request.headers.get(TICKET_HEADER), address(request))
        if not hub.lessons.of(terrain).draws(caller):
            raise Cannot(403, "hands_off", HANDS_OFF)
        return await imports.upload(
            name,
            person,
            request.stream(),
            _length(request),
            terrain=terrain,
            link=link,
            client=client,
            who=asker(request, link),
            hold=hold,
            caller=caller,
        )


def _add_grids(app: FastAPI, hub: Hub, grids: GridStore) -> None:
    @app.get("/api/terrains/{terrain}/grids/{digest}")
    async def grid(request: Request, terrain: str, digest: Digest, link: AnyLink) -> Response:
        who = asker(request, link)
        if link.role == "view":
            had = {layer.content for layer in (await hub.strokes(terrain, None, who)).layers.values()}
        else:
            had = await hub.read(who, hub.journal.grids, terrain)
        if digest not in had:
            raise Cannot(404, "no_grid", "No layer of this terrain has this grid.")
        try:
            path = await hub.packing.run(asker(request, link), _packed, grids, digest)
        except RasterError as error:
            raise Cannot(410, "no_grid", str(error)) from error
        except OSError as error:
            raise Cannot(507, "storage", "The server has no room to pack this grid.") from error
        return Sent(hub, link, path, "application/zip", f"{digest[:16]}.npz", passing=True)


async def _short(request: Request) -> bytes:
    data = b""
    async for part in request.stream():
        data += part
        if len(data) > c.MAX_MESSAGE_BYTES:
            raise Cannot(413, "too_large", "These answers are too long.")
    return data


def _length(request: Request) -> int | None:
    text = request.headers.get("content-length", "")
    return int(text) if text.isdigit() else None


def _packed(grids: GridStore, digest: str) -> Path:
    """Returns a temporary .npz file with the heights, float32 metres, row 0 south, and the control net if there is
    one."""
    raster = grids.read(digest)
    arrays = {"heights": raster.heights} | ({} if raster.warp is None else {"warp": raster.warp})
    path = grids.temporary(".npz")
    with path.open("wb") as file:
        try:
            np.savez(file, **arrays)  # type: ignore[arg-type]
        except BaseException:
            path.unlink()
            raise
    return path
