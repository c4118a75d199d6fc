"""The most that the body of a request may hold, as ASGI middleware: files are streamed, all else is read whole."""

from __future__ import annotations

from typing import Any, Final

from fastapi import HTTPException

from esker import contract as c
from esker.server.routes.answers import answer

UPLOADS: Final = frozenset({"import", "from-grid", "imports"})
"""Last part of the paths that take a file and bound it themselves (``terrains.py``, ``jobs/imports.py``)."""
TOO_LONG: Final = f"The body of this request may have {c.MAX_MESSAGE_BYTES} bytes at most."


class Bodies:
    """Answers 413 to a body of more than ``MAX_MESSAGE_BYTES``; no more than that of it is kept."""

    def __init__(self, app: Any) -> None:
        self.app = app

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        if scope["type"] != "http" or scope["path"].rpartition("/")[2] in UPLOADS:
            await self.app(scope, receive, send)
            return
        declared = dict(scope["headers"]).get(b"content-length", b"")
        if declared.isdigit() and int(declared) > c.MAX_MESSAGE_BYTES:
            await answer(413, "too_large", TOO_LONG)(scope, receive, send)
            return
        size = 0

        async def bounded() -> Any:
            nonlocal size
            message = await receive()
            size += len(message.get("body", b""))
            if size > c.MAX_MESSAGE_BYTES:
                raise HTTPException(413, TOO_LONG)
            return message

        await self.app(scope, bounded, send)
