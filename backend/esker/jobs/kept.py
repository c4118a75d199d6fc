"""Exports in the store that several servers have together: what one made, each can give out (DESIGN 18)."""

from __future__ import annotations

import asyncio
import re
from collections.abc import Callable
from pathlib import Path
from typing import Final

from esker import contract as c
from esker.store.engine.made import EXPORTS, Made

_ID: Final = re.compile(r"[A-Za-z0-9_-]{1,40}")


class KeptExport(c.Wire):
    """What is said of an export beside its file.

    link: by which it was made. media: of the file. until: by the date that all servers have together, seconds since
    1970; then it is gone for everybody.
    """

    status: c.ExportStatus
    link: c.Id
    media: str
    until: float


class KeptExports:
    """Exports that are done, for every server. Where there is no store nothing is kept."""

    def __init__(self, made: Made, date: Callable[[], float]) -> None:
        """``date``: what all servers have together."""
        self._made, self._date = made, date

    async def keep(self, terrain: str, path: Path, status: c.ExportStatus, link: str, media: str, life: float) -> bool:
        """Stores an export for ``life`` seconds. Returns whether others have it now."""
        if not self._made.is_shared:
            return False
        text = KeptExport(status=status, link=link, media=media, until=self._date() + life).model_dump_json()
        file, said = _names(terrain, status.id)

        def work() -> bool:
            return self._made.give(file, path) and self._made.say(said, text)

        return await asyncio.to_thread(work)

    async def find(self, terrain: str, export: str) -> tuple[KeptExport, float] | None:
        """An export that some server made, and for how many seconds it is still there; or None."""
        if not self._made.is_shared or not _ID.fullmatch(export):
            return None
        text = await asyncio.to_thread(self._made.said, _names(terrain, export)[1])
        if text is None:
            return None
        found = KeptExport.model_validate_json(text)
        left = found.until - self._date()
        return (found, left) if left > 0 else None

    async def fetch(self, terrain: str, export: str, path: Path) -> bool:
        """Brings the file of an export to ``path``. Returns whether there was one."""
        return await asyncio.to_thread(self._made.fetch, _names(terrain, export)[0], path)

    def drop(self, terrain: str, export: str) -> None:
        """Removes an export for everybody, soon."""
        if self._made.is_shared:
            asyncio.get_running_loop().run_in_executor(None, self._made.remove, *_names(terrain, export))


def _names(terrain: str, export: str) -> tuple[str, str]:
    """Where the file lies, and what is said of it."""
    return f"{EXPORTS}{terrain}/{export}/file", f"{EXPORTS}{terrain}/{export}/status"
