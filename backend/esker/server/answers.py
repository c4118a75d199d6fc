"""Answers that are not what was asked for, and who asks (docs/protocol.md)."""

from __future__ import annotations

import errno
import logging
import time
from typing import Annotated, Final
from urllib.parse import quote

from fastapi import Depends, FastAPI, Request, WebSocket
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from starlette.exceptions import HTTPException

from esker.session.core import Denied
from esker.session.hub import Hub
from esker.session.limits import RateByKey
from esker.store.access import Link
from esker.store.journal import Unwritable

log = logging.getLogger("esker.server")

STATUS: Final = {
    "bad_secret": 403,
    "revoked": 403,
    "no_terrain": 404,
    "rate_limited": 429,
    "server_error": 500,
    "shutting_down": 503,
}
FULL: Final = "The server has no room for this (is its disk full?). Nothing was changed."
UNWRITABLE: Final = "The server cannot save anything at the moment. Nothing was changed; try again later."
AGAIN_SECONDS: Final = 30
NO_ROOM: Final = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG})


class Problem(Exception):
    """An answer that is not what was asked for."""

    def __init__(self, status: int, code: str, message: str) -> None:
        super().__init__(message)
        self.status, self.code, self.message = status, code, message


def answer(status: int, code: str, message: str, again: int | None = None) -> JSONResponse:
    """A refusal as JSON. ``again``: seconds after which it may be asked again."""
    headers = None if again is None else {"Retry-After": str(again)}
    return JSONResponse({"code": code, "message": message}, status_code=status, headers=headers)


def add_errors(app: FastAPI) -> None:
    """Every error becomes an answer with a code and a sentence."""

    @app.exception_handler(Problem)
    async def problem(_: Request, error: Problem) -> JSONResponse:
        return answer(error.status, error.code, error.message)

    @app.exception_handler(Denied)
    async def denied(_: Request, error: Denied) -> JSONResponse:
        return answer(STATUS.get(error.code, 400), error.code, error.message)

    @app.exception_handler(RequestValidationError)
    async def invalid(_: Request, error: RequestValidationError) -> JSONResponse:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"][1:])
        return answer(400, "malformed", f"{where}: {first['msg']}." if where else f"{first['msg']}.")

    @app.exception_handler(HTTPException)
    async def http(_: Request, error: HTTPException) -> JSONResponse:
        code = {404: "not_found", 405: "not_allowed", 413: "too_large"}.get(error.status_code, "error")
        sentence = {404: "There is nothing at this address.", 405: "This address does not do that."}
        return answer(error.status_code, code, sentence.get(error.status_code, str(error.detail)))

    @app.exception_handler(OSError)
    async def disk(request: Request, error: OSError) -> JSONResponse:
        if error.errno not in NO_ROOM:
            return await failed(request, error)
        log.error("%s %s: no room: %s", request.method, quote(request.url.path), error)
        return answer(507, "storage", FULL, AGAIN_SECONDS)

    @app.exception_handler(Unwritable)
    async def unwritable(request: Request, error: Unwritable) -> JSONResponse:
        log.error("%s %s: the database cannot be written: %s", request.method, quote(request.url.path), error)
        if error.full:
            return answer(507, "storage", FULL, AGAIN_SECONDS)
        return answer(503, "unavailable", UNWRITABLE, AGAIN_SECONDS)

    @app.exception_handler(Exception)
    async def failed(request: Request, error: Exception) -> JSONResponse:
        log.error("%s %s failed: %s: %s", request.method, quote(request.url.path), type(error).__name__, error)
        return answer(500, "server_error", "The server failed to do this. It is in its log.")


def address(connection: Request | WebSocket) -> str:
    """Where a request comes from."""
    return connection.client.host if connection.client is not None else "unknown"


def limited(request: Request, buckets: RateByKey, what: str) -> None:
    """Takes one token of the address. Raises Problem (429)."""
    if not buckets.take(address(request), time.monotonic()):
        raise Problem(429, "rate_limited", f"Too many {what} from your address. Wait a minute.")


def link_of(request: Request, terrain: str) -> Link:
    """The link whose secret stands in the Authorization header. Raises Denied or Problem."""
    scheme, _, secret = request.headers.get("authorization", "").partition(" ")
    if scheme.lower() != "bearer" or not secret or len(secret) > 128:
        raise Problem(401, "bad_secret", "Send the secret of a link as 'Authorization: Bearer ...'.")
    hub: Hub = request.app.state.hub
    return hub.authorise(terrain, secret.strip(), address(request))


def owner(request: Request, terrain: str) -> Link:
    """The same, of an owner."""
    link = link_of(request, terrain)
    if link.role != "owner":
        raise Problem(403, "not_owner", "Only an owner of the terrain may do this.")
    return link


def editor(request: Request, terrain: str) -> Link:
    """The same, of somebody who may change the terrain."""
    link = link_of(request, terrain)
    if link.role == "view":
        raise Problem(403, "view_only", "You opened this terrain with a link to look at it.")
    return link


AnyLink = Annotated[Link, Depends(link_of)]
OwnerLink = Annotated[Link, Depends(owner)]
EditorLink = Annotated[Link, Depends(editor)]
