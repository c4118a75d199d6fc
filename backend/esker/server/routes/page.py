"""Routes of the page itself."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

from fastapi import FastAPI, Query, Request, Response
from fastapi.responses import FileResponse, HTMLResponse
from starlette.exceptions import HTTPException
from starlette.staticfiles import StaticFiles
from starlette.types import Scope

from esker.errors import Cannot
from esker.process import system
from esker.render.pictures import card
from esker.server.routes.answers import answer
from esker.server.routes.previews import Pictures, card_of
from esker.server.wire.tls import CA_FILE, FOLDER
from esker.session.room.hub import Hub

HELP: Final = frozenset({"warning", "devices"})
"""Pages in words: what a browser says of a certificate, and how it is made to say nothing."""


class _Files(StaticFiles):
    """The page's files.

    A person who types an address that is none of them gets the page itself, which says so (404).
    """

    def __init__(self, page: Path) -> None:
        super().__init__(directory=page)
        self._index = page / "index.html"

    async def get_response(self, path: str, scope: Scope) -> Response:
        """Returns the file. A person who looks for a page gets the page. Raises HTTPException (404, 405)."""
        try:
            return await super().get_response(path, scope)
        except HTTPException as error:
            asked = dict(scope["headers"]).get(b"accept", b"")
            for_machines = path.startswith(("api/", "assets/", "preview/"))
            if error.status_code != 404 or for_machines or b"text/html" not in asked or not self._index.is_file():
                raise
            return HTMLResponse(self._index.read_text(encoding="utf-8"), 404)


def add_page(app: FastAPI, hub: Hub, page: Path, data: Path, pictures: Pictures) -> None:
    """Adds the routes. Every path that no other route takes is a file of the page."""

    def index(more: str = "") -> Response:
        path = page / "index.html"
        if not path.is_file():
            return answer(503, "no_page", "The page is not built yet. Run `make run`, which builds it.")
        if not more:
            return FileResponse(path, media_type="text/html")
        return HTMLResponse(card.with_tags(path.read_text(encoding="utf-8"), more))

    @app.api_route("/", methods=["GET", "HEAD"], include_in_schema=False)
    async def landing() -> Response:
        return index()

    @app.api_route("/privacy", methods=["GET", "HEAD"], include_in_schema=False)
    async def privacy() -> Response:
        return index()

    @app.api_route("/room", methods=["GET", "HEAD"], include_in_schema=False)
    async def room() -> Response:
        return index()

    @app.api_route("/help/{topic}", methods=["GET", "HEAD"], include_in_schema=False)
    async def helping(topic: str) -> Response:
        if topic not in HELP:
            raise Cannot(404, "not_found", "There is no such page.")
        return index()

    @app.api_route("/lessons/{lesson}", methods=["GET", "HEAD"], include_in_schema=False)
    async def lesson() -> Response:
        return index()

    @app.api_route("/server", methods=["GET", "HEAD"], include_in_schema=False)
    async def keeper() -> Response:
        return index()

    @app.api_route("/join", methods=["GET", "HEAD"], include_in_schema=False)
    async def join() -> Response:
        return index()

    @app.api_route("/wall/{terrain}/{lesson}", methods=["GET", "HEAD"], include_in_schema=False)
    async def wall() -> Response:
        return index()

    @app.api_route("/t/{terrain}", methods=["GET", "HEAD"], include_in_schema=False)
    async def shared(request: Request, terrain: str, p: Annotated[str, Query(max_length=40)] = "") -> Response:
        return index(await card_of(hub, pictures, request, terrain, p) if p else "")

    @app.get(f"/{CA_FILE}", include_in_schema=False)
    async def certificate() -> Response:
        path = data / FOLDER / CA_FILE
        if not path.is_file():
            raise Cannot(404, "not_found", "This server has no certificate of its own.")
        return FileResponse(path, media_type="application/x-x509-ca-cert", filename=CA_FILE)

    system.name_types()
    if page.is_dir():
        app.mount("/", _Files(page), name="page")
