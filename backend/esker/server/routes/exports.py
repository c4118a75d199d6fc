"""Routes of exports: estimate, begin, status, file, cancel (docs/exporting.md)."""

from __future__ import annotations

from typing import Annotated, Final

from fastapi import FastAPI, Query, Request, Response

from esker import contract as c
from esker.fairness.shares import Rate, Rates
from esker.jobs.exports import Exports
from esker.server.routes.answers import AnyLink, address, asker, limited
from esker.server.wire.sending import Sent
from esker.session.room.hub import Hub

EXPORTS: Final = (1 / 6, 20)
"""Exports by address: rate a second, burst."""
ClientId = Annotated[str, Query(max_length=40, pattern=r"^[A-Za-z0-9_-]*$")]


def add_exports(app: FastAPI, hub: Hub, exports: Exports) -> None:
    """Adds the routes."""
    app.state.exports = Rates(Rate(*EXPORTS))
    path = "/api/terrains/{terrain}/exports"

    @app.post(f"{path}/estimate")
    async def estimate(terrain: str, link: AnyLink, wanted: c.ExportRequest) -> c.ExportEstimate:  # noqa: ARG001
        return exports.estimate(wanted)

    @app.post(path, status_code=202)
    async def begin(
        request: Request, terrain: str, link: AnyLink, wanted: c.ExportRequest, client: ClientId = ""
    ) -> c.ExportStatus:
        limited(request, app.state.exports, "exports were asked for")
        return await exports.begin(
            terrain, link, f"{link.id} {client or address(request)}", wanted, asker(request, link)
        )

    @app.get(f"{path}/{{job}}")
    async def status(terrain: str, job: str, link: AnyLink) -> c.ExportStatus:
        return await exports.status(terrain, job, link)

    @app.get(f"{path}/{{job}}/file")
    async def file(terrain: str, job: str, link: AnyLink) -> Response:
        found = await exports.file(terrain, job, link)
        return Sent(hub, link, found.path, found.media, found.name)

    @app.delete(f"{path}/{{job}}", status_code=204)
    async def cancel(terrain: str, job: str, link: AnyLink) -> None:
        await exports.cancel(terrain, job, link)
