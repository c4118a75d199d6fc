"""Routes of exports: estimate, begin, status, file, cancel (docs/exporting.md)."""

from __future__ import annotations

from typing import Annotated, Final

from fastapi import FastAPI, Query, Request, Response
from fastapi.responses import FileResponse

from esker import contract as c
from esker.exports.service import Cannot, Exports
from esker.server.answers import AnyLink, address, answer, limited
from esker.session.limits import RateByKey

EXPORTS: Final = (1 / 6, 20)
"""Exports by address: rate a second, burst."""
ClientId = Annotated[str, Query(max_length=40, pattern=r"^[A-Za-z0-9_-]*$")]


def add_exports(app: FastAPI, exports: Exports) -> None:
    """Adds them."""
    app.state.exports = RateByKey(*EXPORTS)
    path = "/api/terrains/{terrain}/exports"

    @app.exception_handler(Cannot)
    async def cannot(_: Request, error: Cannot) -> Response:
        return answer(error.status, error.code, error.message)

    @app.post(f"{path}/estimate")
    async def estimate(terrain: str, link: AnyLink, wish: c.ExportWish) -> c.ExportEstimate:  # noqa: ARG001
        return exports.estimate(wish)

    @app.post(path, status_code=202)
    async def begin(
        request: Request, terrain: str, link: AnyLink, wish: c.ExportWish, client: ClientId = ""
    ) -> c.ExportStatus:
        limited(request, app.state.exports, "exports were asked for")
        return await exports.begin(terrain, link, f"{link.id} {client or address(request)}", wish)

    @app.get(f"{path}/{{job}}")
    async def status(terrain: str, job: str, link: AnyLink) -> c.ExportStatus:
        return exports.status(terrain, job, link)

    @app.get(f"{path}/{{job}}/file")
    async def file(terrain: str, job: str, link: AnyLink) -> Response:
        found = exports.file(terrain, job, link)
        return FileResponse(found.path, media_type=found.media, filename=found.name)

    @app.delete(f"{path}/{{job}}", status_code=204)
    async def cancel(terrain: str, job: str, link: AnyLink) -> None:
        await exports.cancel(terrain, job, link)
