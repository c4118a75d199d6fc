"""Routes of the page itself."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from fastapi import FastAPI, Query, Request, Response
from fastapi.responses import FileResponse, HTMLResponse
from starlette.staticfiles import StaticFiles

from esker.render import card
from esker.server.answers import Problem, answer
from esker.server.previews import Pictures, card_of
from esker.session.hub import Hub
from esker.tls import CA_FILE, FOLDER
from esker.version import VERSION


def add_page(app: FastAPI, hub: Hub, page: Path, data: Path, pictures: Pictures) -> None:
    """Adds them; all that no other route takes is a file of the page."""

    @app.get("/healthz")
    async def healthz() -> dict[str, Any]:
        return {"ok": True, "version": VERSION, "device": hub.device}

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

    @app.api_route("/t/{terrain}", methods=["GET", "HEAD"], include_in_schema=False)
    async def shared(request: Request, terrain: str, p: Annotated[str, Query(max_length=40)] = "") -> Response:
        return index(await card_of(hub, pictures, request, terrain, p) if p else "")

    @app.get(f"/{CA_FILE}", include_in_schema=False)
    async def certificate() -> Response:
        path = data / FOLDER / CA_FILE
        if not path.is_file():
            raise Problem(404, "not_found", "This server has no certificate of its own.")
        return FileResponse(path, media_type="application/x-x509-ca-cert", filename=CA_FILE)

    if page.is_dir():
        app.mount("/", StaticFiles(directory=page), name="page")
