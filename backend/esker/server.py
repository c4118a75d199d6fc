"""The web server: HTTP routes and the websocket (DESIGN 13, docs/protocol.md). The only module that imports FastAPI."""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import AsyncIterator, Callable
from concurrent.futures import Future
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final
from urllib.parse import urlsplit

from fastapi import Depends, FastAPI, Query, Request, Response, WebSocket
from fastapi.exceptions import RequestValidationError
from fastapi.responses import FileResponse, HTMLResponse, JSONResponse
from pydantic import Field, StringConstraints
from starlette.exceptions import HTTPException
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocketDisconnect

from esker import contract as c
from esker import templates
from esker.contract import Role
from esker.document import archive
from esker.headers import Headers
from esker.render import card
from esker.render.previews import HEIGHT, WIDTH, Busy, CannotDraw, Previews
from esker.session.core import Denied
from esker.session.hub import Hub
from esker.session.limits import RateByKey
from esker.session.socket import Session
from esker.store.access import CODE_SECONDS, Link, TooManyLinks
from esker.store.previews import Preview, PreviewTokens
from esker.tls import CA_FILE, FOLDER
from esker.upload import AT_ONCE, read_archive
from esker.version import VERSION

log = logging.getLogger("esker.server")

MAX_IMPORT_BYTES: Final = 16 * 1024 * 1024
NEW_TERRAINS: Final = (1 / 3, 60)
"""New terrains by address: rate a second, burst. A whole class may sit behind one address."""
CODE_TRIES: Final = (1 / 3, 60)
"""Join codes by address: of 31^6 codes a guesser tries 360 in the fifteen minutes that one lives."""
RENEWED_AFTER: Final = 1.0
PICTURES: Final = (1.0, 60)
"""Preview pictures by address."""
PICTURE_SECONDS: Final = 20.0
"""So long an answer waits for a picture that is being drawn."""
STATUS: Final = {
    "bad_secret": 403,
    "revoked": 403,
    "no_terrain": 404,
    "rate_limited": 429,
    "server_error": 500,
    "shutting_down": 503,
}


class Problem(Exception):
    """An answer that is not what was asked for."""

    def __init__(self, status: int, code: str, message: str) -> None:
        super().__init__(message)
        self.status, self.code, self.message = status, code, message


class NewTerrain(c.Wire):
    """Body of POST /api/terrains."""

    title: c.Name | None = None
    template: c.Id | None = None
    size_m: Annotated[float, Field(ge=c.MIN_SIZE_M, le=c.MAX_SIZE_M)] | None = None


class NewLink(c.Wire):
    """Body of POST /api/terrains/{id}/links."""

    role: Role
    name: c.Name = ""


class NewCode(c.Wire):
    """Body of POST /api/terrains/{id}/codes."""

    role: Role = "edit"


class PreviewChange(c.Wire):
    """Body of POST /api/terrains/{id}/preview."""

    shown: bool | None = None
    renew: bool = False


class JoinCode(c.Wire):
    """Body of POST /api/join."""

    code: Annotated[str, StringConstraints(min_length=1, max_length=20)]


@dataclass(frozen=True)
class Pictures:
    """Preview pictures and who may see them. ``base``: where people reach this server; None: as each asks for it."""

    previews: Previews
    tokens: PreviewTokens
    base: str | None = None


def create_app(hub: Hub, page: Path, data: Path, pictures: Pictures) -> FastAPI:
    """The application over an open hub. ``page``: the built front-end; ``data``: where the LAN certificate lies."""

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:  # noqa: ARG001
        yield
        await pictures.previews.close()
        await hub.close()

    app = FastAPI(
        title="Esker",
        version=VERSION,
        docs_url=None,
        redoc_url=None,
        openapi_url="/api/openapi.json",
        lifespan=lifespan,
    )
    app.add_middleware(Headers)
    app.state.hub = hub
    app.state.new_terrains = RateByKey(*NEW_TERRAINS)
    app.state.uploads = asyncio.Semaphore(AT_ONCE)
    app.state.code_tries = RateByKey(*CODE_TRIES)
    _add_errors(app)
    _add_terrains(app, hub)
    _add_links(app, hub)
    _add_socket(app, hub)
    _add_previews(app, hub, pictures)
    _add_page(app, hub, page, data, pictures)
    return app


# --- errors -----------------------------------------------------------------------------------------------------


def _answer(status: int, code: str, message: str) -> JSONResponse:
    return JSONResponse({"code": code, "message": message}, status_code=status)


def _add_errors(app: FastAPI) -> None:
    @app.exception_handler(Problem)
    async def problem(_: Request, error: Problem) -> JSONResponse:
        return _answer(error.status, error.code, error.message)

    @app.exception_handler(Denied)
    async def denied(_: Request, error: Denied) -> JSONResponse:
        return _answer(STATUS.get(error.code, 400), error.code, error.message)

    @app.exception_handler(RequestValidationError)
    async def invalid(_: Request, error: RequestValidationError) -> JSONResponse:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"][1:])
        return _answer(400, "malformed", f"{where}: {first['msg']}." if where else f"{first['msg']}.")

    @app.exception_handler(HTTPException)
    async def http(_: Request, error: HTTPException) -> JSONResponse:
        code = {404: "not_found", 405: "not_allowed"}.get(error.status_code, "error")
        sentence = {404: "There is nothing at this address.", 405: "This address does not do that."}
        return _answer(error.status_code, code, sentence.get(error.status_code, str(error.detail)))

    @app.exception_handler(Exception)
    async def failed(request: Request, error: Exception) -> JSONResponse:
        log.error("%s %s failed: %s: %s", request.method, request.url.path, type(error).__name__, error)
        return _answer(500, "server_error", "The server failed to do this. It is in its log.")


# --- who asks ---------------------------------------------------------------------------------------------------


def _address(connection: Request | WebSocket) -> str:
    return connection.client.host if connection.client is not None else "unknown"


def _limited(request: Request, buckets: RateByKey, what: str) -> None:
    if not buckets.take(_address(request), time.monotonic()):
        raise Problem(429, "rate_limited", f"Too many {what} from your address. Wait a minute.")


def _link(request: Request, terrain: str) -> Link:
    """The link whose secret stands in the Authorization header. Raises Denied or Problem."""
    scheme, _, secret = request.headers.get("authorization", "").partition(" ")
    if scheme.lower() != "bearer" or not secret or len(secret) > 128:
        raise Problem(401, "bad_secret", "Send the secret of a link as 'Authorization: Bearer ...'.")
    hub: Hub = request.app.state.hub
    return hub.authorise(terrain, secret.strip(), _address(request))


def _owner(request: Request, terrain: str) -> Link:
    link = _link(request, terrain)
    if link.role != "owner":
        raise Problem(403, "not_owner", "Only an owner of the terrain may do this.")
    return link


AnyLink = Annotated[Link, Depends(_link)]
OwnerLink = Annotated[Link, Depends(_owner)]


# --- terrains ---------------------------------------------------------------------------------------------------


def _add_terrains(app: FastAPI, hub: Hub) -> None:
    @app.get("/api/templates")
    async def list_templates() -> list[dict[str, str]]:
        return [{"id": t.id, "title": t.title, "description": t.description} for t in templates.catalogue()]

    @app.post("/api/terrains", status_code=201)
    async def create(request: Request, body: NewTerrain) -> dict[str, str]:
        _limited(request, app.state.new_terrains, "new terrains came")
        return await _create(hub, _new_document(body))

    @app.post("/api/terrains/import", status_code=201)
    async def upload(request: Request) -> dict[str, str]:
        _limited(request, app.state.new_terrains, "new terrains came")
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


# --- links ------------------------------------------------------------------------------------------------------


def _add_links(app: FastAPI, hub: Hub) -> None:
    access = hub.access

    async def add(terrain: str, role: Role, name: str) -> tuple[Link, str]:
        try:
            return await asyncio.wrap_future(access.add(terrain, role, name))
        except TooManyLinks:
            raise Problem(409, "too_many_links", "This terrain has too many links. Revoke some.") from None

    @app.get("/api/terrains/{terrain}/links")
    async def list_links(terrain: str, link: OwnerLink) -> list[dict[str, Any]]:  # noqa: ARG001
        keys = ("id", "role", "name", "created", "revoked")
        return [{key: getattr(found, key) for key in keys} for found in access.links(terrain)]

    @app.post("/api/terrains/{terrain}/links", status_code=201)
    async def new_link(terrain: str, link: OwnerLink, body: NewLink) -> dict[str, str]:  # noqa: ARG001
        made, secret = await add(terrain, body.role, body.name)
        return {"id": made.id, "role": made.role, "name": made.name, "secret": secret}

    @app.post("/api/terrains/{terrain}/links/{link_id}/rotate")
    async def rotate(terrain: str, link_id: str, link: OwnerLink) -> dict[str, str]:
        secret = await asyncio.wrap_future(access.rotate(terrain, link_id))
        if secret is None:
            raise Problem(404, "no_link", "There is no such link, or it was revoked.")
        if link_id != link.id:
            hub.revoke_members(terrain, link_id)
        else:  # whoever asked has the new secret in a moment and comes back; nobody else with the old one does
            asyncio.get_running_loop().call_later(RENEWED_AFTER, hub.renew_members, terrain, link_id)
        return {"id": link_id, "secret": secret}

    @app.delete("/api/terrains/{terrain}/links/{link_id}", status_code=204)
    async def revoke(terrain: str, link_id: str, link: OwnerLink) -> None:
        if link_id == link.id:
            raise Problem(409, "own_link", "You cannot revoke the link that you came in by; rotate it instead.")
        if not await asyncio.wrap_future(access.revoke(terrain, link_id)):
            raise Problem(404, "no_link", "There is no such link, or it was revoked already.")
        hub.revoke_members(terrain, link_id)

    @app.post("/api/terrains/{terrain}/codes", status_code=201)
    async def new_code(terrain: str, link: AnyLink, body: NewCode) -> dict[str, Any]:
        if link.role == "view" or (link.role == "edit" and body.role == "owner"):
            raise Problem(403, "not_allowed", "Your link does not allow you to invite people in this role.")
        return {"code": access.make_code(terrain, body.role), "expires_s": CODE_SECONDS}

    @app.post("/api/join")
    async def join(request: Request, body: JoinCode) -> dict[str, str]:
        _limited(request, app.state.code_tries, "join codes came")
        found = access.open_code(body.code)
        if found is None:
            raise Problem(404, "bad_code", "This code is wrong or too old. Ask for a new one.")
        terrain, role = found
        _, secret = await add(terrain, role, "Joined by code")
        return {"id": terrain, "secret": secret, "role": role}


# --- the socket -------------------------------------------------------------------------------------------------


class _Transport:
    """``session.socket.Transport`` over Starlette's websocket."""

    def __init__(self, socket: WebSocket) -> None:
        self._socket = socket
        self._abort: Callable[[], None] | None = socket.scope.get("esker.abort")

    async def send_text(self, text: str) -> None:
        await self._send({"type": "websocket.send", "text": text})

    async def send_bytes(self, data: bytes) -> None:
        await self._send({"type": "websocket.send", "bytes": data})

    async def close(self, code: int, reason: str) -> None:
        await self._send({"type": "websocket.close", "code": code, "reason": reason})

    async def _send(self, message: dict[str, Any]) -> None:
        try:
            await self._socket.send(message)
        except (WebSocketDisconnect, RuntimeError) as error:  # Starlette's ways to say that the peer is gone
            raise ConnectionResetError("the peer is gone") from error

    def abort(self) -> None:
        if self._abort is not None:
            self._abort()


async def _messages(socket: WebSocket) -> AsyncIterator[str | bytes]:
    while True:
        message = await socket.receive()
        if message["type"] != "websocket.receive":
            return
        text, data = message.get("text"), message.get("bytes")
        yield text if text is not None else data or b""


def _add_socket(app: FastAPI, hub: Hub) -> None:
    @app.websocket("/ws")
    async def ws(socket: WebSocket) -> None:
        offered = socket.scope.get("subprotocols", [])
        subprotocol = c.SUBPROTOCOL if c.SUBPROTOCOL in offered else None
        await socket.accept(subprotocol)
        transport = _Transport(socket)
        origin, host = socket.headers.get("origin"), socket.headers.get("host", "")
        if origin is not None and urlsplit(origin).netloc.lower() != host.lower():
            sentence = "A page of another site may not open this socket."
            log.info("closed a connection from %s: bad_origin", _address(socket))
            text = c.ErrorMessage(code="bad_origin", message=sentence, fatal=True).model_dump_json()
            with suppress(ConnectionResetError):
                await transport.send_text(text)
                await transport.close(c.WS_CLOSE["bad_origin"], sentence)
            return
        await Session(hub, transport, _address(socket), subprotocol).run(_messages(socket))


# --- preview pictures -------------------------------------------------------------------------------------------


def _add_previews(app: FastAPI, hub: Hub, pictures: Pictures) -> None:
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
        _limited(request, app.state.pictures, "pictures were asked for")
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


# --- the page ---------------------------------------------------------------------------------------------------


async def _card(hub: Hub, pictures: Pictures, request: Request, terrain: str, token: str) -> str:
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


def _add_page(app: FastAPI, hub: Hub, page: Path, data: Path, pictures: Pictures) -> None:
    @app.get("/healthz")
    async def healthz() -> dict[str, Any]:
        return {"ok": True, "version": VERSION, "device": hub.device}

    def index(more: str = "") -> Response:
        path = page / "index.html"
        if not path.is_file():
            return _answer(503, "no_page", "The page is not built yet. Run `make run`, which builds it.")
        if not more:
            return FileResponse(path, media_type="text/html")
        return HTMLResponse(card.with_tags(path.read_text(encoding="utf-8"), more))

    @app.api_route("/", methods=["GET", "HEAD"], include_in_schema=False)
    async def landing() -> Response:
        return index()

    @app.api_route("/t/{terrain}", methods=["GET", "HEAD"], include_in_schema=False)
    async def shared(request: Request, terrain: str, p: Annotated[str, Query(max_length=40)] = "") -> Response:
        return index(await _card(hub, pictures, request, terrain, p) if p else "")

    @app.get(f"/{CA_FILE}", include_in_schema=False)
    async def certificate() -> Response:
        path = data / FOLDER / CA_FILE
        if not path.is_file():
            raise Problem(404, "not_found", "This server has no certificate of its own.")
        return FileResponse(path, media_type="application/x-x509-ca-cert", filename=CA_FILE)

    if page.is_dir():
        app.mount("/", StaticFiles(directory=page), name="page")
