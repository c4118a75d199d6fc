"""Answers that refuse or fail, and the address and link of who asks (docs/protocol.md)."""

from __future__ import annotations

import errno
import logging
import time
from collections.abc import Callable, Collection, Mapping
from typing import Annotated, Final, TypeVar
from urllib.parse import quote

from fastapi import Depends, FastAPI, Request, WebSocket
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect

from esker import contract as c
from esker.errors import AnswerCode, Cannot, EskerError
from esker.fairness.shares import Full, Rates, Who
from esker.session.lesson.rules import Lesson
from esker.session.room.door import Deleted
from esker.session.room.hub import Hub
from esker.session.room.replicas import viewing
from esker.store.access import Link
from esker.store.engine.ports import Moved, Unknown, Unreachable, Unwritable

log = logging.getLogger("esker.server")
T = TypeVar("T")

FULL: Final = "The server has no room for this (is its disk full?). Nothing was changed."
UNWRITABLE: Final = "The server cannot save anything at the moment. Nothing was changed; try again later."
SILENT: Final = "The server's database does not answer at the moment. Nothing was changed; try again in a moment."
MOVED: Final = "This terrain is just being moved to another server. Try again in a moment."
UNKNOWN: Final = "The database went away meanwhile: nobody knows whether this was done. Look first."
AGAIN_SECONDS: Final = 30
SILENT_AGAIN_SECONDS: Final = 5
NO_ROOM: Final = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG})


def answer(status: int, code: AnswerCode, message: str, again: int | None = None) -> JSONResponse:
    """A refusal as JSON. ``again``: seconds after which it may be asked again."""
    headers = None if again is None else {"Retry-After": str(again)}
    return JSONResponse({"code": code, "message": message}, status_code=status, headers=headers)


HTTP_CODES: Final[Mapping[int, AnswerCode]] = {404: "not_found", 405: "not_allowed", 413: "too_large"}
HTTP_SENTENCES: Final = {404: "There is nothing at this address.", 405: "This address does not do that."}


def add_errors(app: FastAPI) -> None:
    """Turns every error into an answer with a code and a sentence."""

    @app.exception_handler(EskerError)
    async def refused(_: Request, error: EskerError) -> JSONResponse:
        return JSONResponse({"code": error.code, "message": error.message}, status_code=error.status)

    @app.exception_handler(Deleted)
    async def deleted(_: Request, error: Deleted) -> JSONResponse:
        facts = {"until": error.until, "restorable": error.link.role == "owner"}
        return JSONResponse({"code": "deleted", "message": error.message, **facts}, status_code=410)

    @app.exception_handler(Full)
    async def full(_: Request, error: Full) -> JSONResponse:
        if error.yours:
            return answer(429, "rate_limited", "Too much was asked for from your address at once. Wait a moment.", 5)
        return answer(503, "busy", "Much is asked of this server just now. Try again in a moment.", AGAIN_SECONDS)

    @app.exception_handler(RequestValidationError)
    async def invalid(_: Request, error: RequestValidationError) -> JSONResponse:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"][1:])
        return answer(400, "malformed", f"{where}: {first['msg']}." if where else f"{first['msg']}.")

    @app.exception_handler(HTTPException)
    async def http(_: Request, error: HTTPException) -> JSONResponse:
        status = error.status_code
        return answer(status, HTTP_CODES.get(status, "error"), HTTP_SENTENCES.get(status, str(error.detail)))

    @app.exception_handler(ClientDisconnect)
    async def cut_off(request: Request, _: ClientDisconnect) -> JSONResponse:
        log.info("%s %s was cut off", request.method, _path(request))
        return answer(400, "cut_off", "The request was cut off.")  # nobody is there to read this answer

    @app.exception_handler(OSError)
    async def disk(request: Request, error: OSError) -> JSONResponse:
        if error.errno not in NO_ROOM:
            return await failed(request, error)
        log.error("%s %s: no room: %s", request.method, _path(request), error)
        return answer(507, "storage", FULL, AGAIN_SECONDS)

    @app.exception_handler(Unwritable)
    async def unwritable(request: Request, error: Unwritable) -> JSONResponse:
        log.error("%s %s: the database cannot be written: %s", request.method, _path(request), error)
        if error.full:
            return answer(507, "storage", FULL, AGAIN_SECONDS)
        return answer(503, "unavailable", UNWRITABLE, AGAIN_SECONDS)

    @app.exception_handler(Unreachable)
    async def unreachable(request: Request, error: Unreachable) -> JSONResponse:
        log.warning("%s %s: %s", request.method, _path(request), error)
        return answer(503, "unavailable", SILENT, SILENT_AGAIN_SECONDS)

    @app.exception_handler(Moved)
    async def moved(request: Request, error: Moved) -> JSONResponse:
        log.info("%s %s: %s", request.method, _path(request), error)
        return answer(503, "moved", MOVED, AGAIN_SECONDS)

    @app.exception_handler(Unknown)
    async def unknown(request: Request, error: Unknown) -> JSONResponse:
        log.error("%s %s: %s", request.method, _path(request), error)
        return answer(503, "unknown", UNKNOWN, AGAIN_SECONDS)

    @app.exception_handler(Exception)
    async def failed(request: Request, error: Exception) -> JSONResponse:
        log.error("%s %s failed: %s: %s", request.method, _path(request), type(error).__name__, error)
        return answer(500, "server_error", "The server failed to do this. It is in its log.")


def _path(request: Request) -> str:
    """Returns the path for the log. ``request.url`` would also parse ``Host``, which may be anything, and raise."""
    return quote(request.scope["path"])


def address(connection: Request | WebSocket) -> str:
    """Returns the address that a request comes from."""
    return connection.client.host if connection.client is not None else "unknown"


def asker(connection: Request | WebSocket, link: Link | None = None) -> Who:
    """Returns who asks, as shares are counted."""
    return Who(address(connection), "" if link is None else link.id)


def shown(document: c.Document, link: Link, lesson: Lesson, still: Collection[viewing.Key] | None = None) -> c.Document:
    """Returns what a link may take of a terrain as a whole: one to look takes neither what was deleted nor who drew
    what; while a lesson hides names only owners take these.

    ``still``: of an earlier document, what is there now."""
    if link.role == "view":
        return viewing.shown(document, still)
    return viewing.anonymous(document) if lesson.state.hide and link.role != "owner" else document


def limited(request: Request, rates: Rates, what: str, link: Link | None = None) -> None:
    """Takes one token of the address, and of the link where one is named. Raises Cannot (429)."""
    if not rates.take(asker(request, link), time.monotonic()):
        whose = "address" if link is None else "address or by your link"
        raise Cannot(429, "rate_limited", f"Too many {what} from your {whose}. Wait a minute.")


def guess(request: Request, find: Callable[[], T | None], *, again: bool = False) -> T:
    """Returns what a typed code opens; who types wrong ones is slowed down, by address and over the whole server.

    ``again``: the code was asked for just now, as everybody in a class does; a right one does not count a second time.
    Raises Cannot (404, 429).
    """
    state = request.app.state
    who, now = asker(request), time.monotonic()
    if not again or not state.code_tries.has(who, now):
        limited(request, state.code_tries, "join codes came")
    cost = float(state.nodes())
    if not state.wrong_codes.has(who, now, cost):
        raise Cannot(429, "rate_limited", "Somebody is guessing codes. Wait a minute, or ask for the link.")
    found = find()
    if found is None:
        state.wrong_codes.take(who, now, cost)  # all nodes together allow no more than one
        if again:
            limited(request, state.code_tries, "join codes came")
        raise bad_code()
    return found


def bad_code() -> Cannot:
    """A code that opens nothing."""
    return Cannot(404, "bad_code", "This code is wrong or too old. Ask for a new one.")


def secret_of(request: Request) -> str:
    """Returns the secret in the Authorization header. Raises Cannot (401)."""
    scheme, _, secret = request.headers.get("authorization", "").partition(" ")
    if scheme.lower() != "bearer" or not secret or len(secret) > 128:
        raise Cannot(401, "bad_secret", "Send the secret of a link as 'Authorization: Bearer ...'.")
    return secret.strip()


async def link_of(request: Request, terrain: str) -> Link:
    """The link whose secret stands in the Authorization header. Raises Denied or Cannot.

    It is looked up in the event loop: in the threads that all requests share it would wait behind a stranger's."""
    secret = secret_of(request)
    hub: Hub = request.app.state.hub
    return hub.door.authorise(terrain, secret, address(request))


async def owner(request: Request, terrain: str) -> Link:
    """Returns the link of ``link_of``, which must be an owner's. Raises Denied or Cannot."""
    link = await link_of(request, terrain)
    if link.role != "owner":
        raise Cannot(403, "not_owner", "Only an owner of the terrain may do this.")
    return link


async def editor(request: Request, terrain: str) -> Link:
    """Returns the link of ``link_of``, which must allow changes. Raises Denied or Cannot."""
    link = await link_of(request, terrain)
    if link.role == "view":
        raise Cannot(403, "view_only", "You opened this terrain with a link to look at it.")
    return link


AnyLink = Annotated[Link, Depends(link_of)]
OwnerLink = Annotated[Link, Depends(owner)]
EditorLink = Annotated[Link, Depends(editor)]
