"""Files that are sent to who opened a terrain by a link, for as long as the link lives."""

from __future__ import annotations

import time
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

from fastapi.responses import FileResponse
from starlette.background import BackgroundTask

from esker.session.room.core import Denied
from esker.session.room.hub import Hub
from esker.store.access import Link
from esker.store.engine.ports import Unreachable

ASK_SECONDS: Final = 0.25
"""Seconds between two looks at whether the link still lives, while a file is being sent."""


class _Cut(Exception):
    """The link has ended while a file was being sent."""


class Sent(FileResponse):
    """A file of a terrain. It is cut off within a second when the link is revoked or renewed."""

    def __init__(self, hub: Hub, link: Link, path: Path, media: str, name: str, *, passing: bool = False) -> None:
        """``passing``: the file was made for this answer and is removed after it. Raises Denied."""
        gone = BackgroundTask(path.unlink, missing_ok=True) if passing else None
        try:
            hub.door.demand(link)
        except Denied:
            if passing:
                path.unlink(missing_ok=True)
            raise
        super().__init__(path, media_type=media, filename=name, background=gone)
        self._hub, self._link, self._passing = hub, link, passing

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        """Sends it, or as much of it as the link lives: then the server closes the connection."""
        asked = time.monotonic()

        async def checked(message: Any) -> None:
            nonlocal asked
            now = time.monotonic()
            if now - asked >= ASK_SECONDS:
                asked = now
                try:
                    alive = self._hub.access.alive(self._link)
                except Unreachable:  # nobody can say whether the link was revoked meanwhile
                    alive = False
                if not alive:
                    raise _Cut
            await send(message)

        try:
            with suppress(_Cut):
                await super().__call__(scope, receive, checked)
        finally:
            if (
                self._passing
            ):  # an impossible range or a cut connection ends the answer before the task that would do this
                Path(self.path).unlink(missing_ok=True)
