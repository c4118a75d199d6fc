"""Preview pictures of shared terrains, drawn by a process of their own and kept on disk.

Drawing takes seconds of all that a core can do and runs a graphics driver: neither may touch the rooms, so a child
process does it, at the lowest priority, one picture at a time. A picture belongs to the clock of its document. While a
newer one is being drawn, or too soon after the last, the old one is served. Where several servers have a store of
objects together, what one of them drew the others do not draw again.
"""

from __future__ import annotations

import asyncio
import logging
import multiprocessing
import os
import threading
import time
from collections.abc import Callable
from concurrent.futures import Executor, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Final

from esker.contract import Document
from esker.document.wire import document_json
from esker.fairness.shares import OWNER, Full, Places, Share, Who
from esker.process import interrupt, system
from esker.process.bounds import Bounds
from esker.process.child_process import ORPHANED
from esker.store.engine.made import PREVIEWS, Made

log = logging.getLogger("esker.previews")

WIDTH, HEIGHT = 1200, 630
"""What the programs that unfold links want (Open Graph, Twitter cards)."""
QUALITY: Final = 86
LEVEL: Final = 4
AGAIN_SECONDS: Final = 60.0
"""A terrain that people draw on gets a new picture at most this often."""
WAITING: Final = 16
SHARE: Final = Share(WAITING, address=6, network=8)
"""Terrains that may wait for their turn, and those of one address and one /48; more are refused for now."""
SERVER: Final = Who("", rank=OWNER)
KEPT: Final = 500
"""Pictures on disk; those that were asked for longest ago go."""
IDLE_SECONDS: Final = 90.0
"""After this long without work the drawing process ends and gives its memory back."""
NICENESS: Final = 15
NO_PICTURES: Final = "This server cannot draw pictures."
FILE_BYTES: Final = 256 << 20
OPEN_FILES: Final = 1_024

Painter = Callable[[str, str | None], bytes]
"""(document as JSON, device that solves) -> JPEG. Runs in the child."""


class CannotDraw(RuntimeError):
    """There is no OpenGL here: no picture will ever come. Travels from the child by its message."""


class Busy(RuntimeError):
    """Too many terrains wait for their picture."""


class Previews:
    """Pictures by terrain. Lives in one event loop."""

    def __init__(
        self,
        folder: Path,
        device: str | None = None,
        *,
        grids: Path | None = None,
        fetch: Callable[[Document], object] = lambda _: None,
        made: Made | None = None,
        painter: Painter | None = None,
        executor: Callable[[], Executor] | None = None,
        now: Callable[[], float] = time.monotonic,
        draws: bool = True,
    ) -> None:
        """``folder``: where pictures are kept, made when needed. ``grids``: where the rasters of elevation layers lie,
        by digest; ``fetch`` brings those of a document there. ``made``: where all servers have their pictures.
        ``painter``, ``executor``, ``now``: others, for tests. ``draws``: whether pictures are drawn here at all."""
        self._fetch, self._made = fetch, Made() if made is None else made
        self._folder, self._device, self._now = folder, device, now
        self._painter = painter or partial(paint, grids=grids)
        self._new_executor = executor or DrawingProcess
        self._executor: Executor | None = None
        self._turn = asyncio.Lock()
        self._places = Places(SHARE)
        self._coming: dict[str, asyncio.Task[Path]] = {}
        self._ahead: set[asyncio.Future[Path]] = set()
        self._drawn: dict[str, float] = {}
        self._used = 0.0
        self.available = draws
        """False where nothing shall be drawn, and once it has turned out that nothing can be drawn here."""

    def held(self, terrain: str) -> Path | None:
        """The newest picture of a terrain on disk."""
        return max(self._of(terrain), key=_clock, default=None)

    def _of(self, terrain: str) -> list[Path]:
        """Its pictures, of all clocks. Ids may hold dashes, so the start of a name alone does not tell."""
        return [p for p in self._folder.glob(f"{terrain}-*.jpg") if p.stem.rsplit("-", 1)[0] == terrain]

    async def picture(self, document: Document, who: Who = SERVER) -> Path:
        """The picture of a document: the one on disk if it is of this clock or was drawn a moment ago, else a new one.
        ``who`` asks: pictures that are begun count for them.

        Raises CannotDraw, Busy, and OSError where nothing can be kept.
        """
        held = self.held(document.id)
        if held is not None and (_clock(held) == document.clock or self._soon(document.id)):
            os.utime(held)
            return held
        if not self.available and not self._made.is_shared:
            raise CannotDraw(NO_PICTURES)
        task = self._coming.get(document.id)
        if task is None:
            try:
                place = self._places.take(who)
            except Full:
                raise Busy("Many pictures are being drawn. Try again in a minute.") from None
            task = self._coming[document.id] = asyncio.create_task(self._draw(document))
            task.add_done_callback(lambda done: self._forget(document.id, done))
            task.add_done_callback(lambda _: place.release())
        return await asyncio.shield(task)

    def begin(self, document: Document, who: Who = SERVER) -> None:
        """Starts the picture of a document if it is due, without waiting for it or for what becomes of it."""
        if self.available and self._places.refusal(who) is None:
            task = asyncio.ensure_future(self.picture(document, who))
            self._ahead.add(task)
            task.add_done_callback(self._began)

    def _began(self, task: asyncio.Future[Path]) -> None:
        self._ahead.discard(task)
        if not task.cancelled() and (error := task.exception()) is not None:
            log.debug("no picture ahead of time: %s", error)

    def forget(self, terrain: str) -> None:
        """Removes the pictures of a terrain from the disk, and from where all servers have them."""
        for path in self._of(terrain):
            path.unlink(missing_ok=True)
        self._drawn.pop(terrain, None)
        if self._made.is_shared:
            asyncio.get_running_loop().run_in_executor(None, self._made.remove_all, f"{PREVIEWS}{terrain}/")

    async def close(self) -> None:
        """Ends the drawing process."""
        for task in (*self._coming.values(), *self._ahead):
            task.cancel()
        self._stop()

    # --- drawing

    def _soon(self, terrain: str) -> bool:
        drawn = self._drawn.get(terrain)
        return drawn is not None and self._now() - drawn < AGAIN_SECONDS

    def _forget(self, terrain: str, task: asyncio.Task[Path]) -> None:
        self._coming.pop(terrain, None)
        if not task.cancelled() and task.exception() is not None:
            log.debug("no picture of %s: %s", terrain, task.exception())

    async def _draw(self, document: Document) -> Path:
        if self._made.is_shared and (drawn := await asyncio.to_thread(self._drawn_by_others, document)) is not None:
            return drawn
        if not self.available:
            raise CannotDraw(NO_PICTURES)
        async with self._turn:
            started = self._now()
            await asyncio.to_thread(self._fetch, document)
            data = await self._paint(await asyncio.to_thread(document_json, document))
            self._drawn[document.id] = self._now()
            log.info("picture of %s at clock %d in %.1f s", document.id, document.clock, self._now() - started)
            return await asyncio.to_thread(self._keep, document, data)

    async def _paint(self, document: str) -> bytes:
        loop = asyncio.get_running_loop()
        if self._executor is None:
            self._executor = self._new_executor()
        self._used = self._now()
        try:
            data = await loop.run_in_executor(self._executor, self._painter, document, self._device)
        except CannotDraw as error:
            self.available = False
            self._stop()
            log.warning("no preview pictures: %s", error)
            raise
        except BrokenProcessPool:
            self._stop()
            log.warning("the process that draws previews ended; the next picture starts another one")
            raise Busy("The picture could not be drawn. Try again in a minute.") from None
        self._used = self._now()
        loop.call_later(IDLE_SECONDS, self._idle)
        return data

    def _idle(self) -> None:
        if not self._coming and self._now() - self._used >= IDLE_SECONDS * 0.99:
            self._stop()

    def _stop(self) -> None:
        if self._executor is not None:
            self._executor.shutdown(wait=False, cancel_futures=True)
            self._executor = None

    def _drawn_by_others(self, document: Document) -> Path | None:
        """Brings the picture of a document here where another server drew it."""
        self._folder.mkdir(parents=True, exist_ok=True)
        path = self._folder / f"{document.id}-{document.clock}.jpg"
        if not self._made.fetch(_name(path), path):
            return None
        self._tidy(path)
        return path

    def _keep(self, document: Document, data: bytes) -> Path:
        self._folder.mkdir(parents=True, exist_ok=True)
        path = self._folder / f"{document.id}-{document.clock}.jpg"
        part = path.with_suffix(".part")
        part.write_bytes(data)
        part.replace(path)
        self._made.give(_name(path), path)
        self._made.remove(*(_name(old) for old in self._of(document.id) if old != path))
        self._tidy(path)
        return path

    def _tidy(self, path: Path) -> None:
        """Removes what the picture at ``path`` stands for now, and those that nobody asked for."""
        for old in self._of(path.stem.rsplit("-", 1)[0]):
            if old != path:
                old.unlink(missing_ok=True)
        pictures = sorted(self._folder.glob("*.jpg"), key=lambda p: p.stat().st_mtime)
        for old in pictures[:-KEPT]:
            old.unlink(missing_ok=True)


def _name(path: Path) -> str:
    """The name under which all servers have a picture."""
    terrain, _, clock = path.stem.rpartition("-")
    return f"{PREVIEWS}{terrain}/{clock}.jpg"


def _clock(path: Path) -> int:
    return int(path.stem.rsplit("-", 1)[1])


class DrawingProcess(ProcessPoolExecutor):
    """A process that draws one picture at a time. It ends, in the middle of a picture too, when this executor is shut
    down and when the server ends, however that ends: both close the pipe on which the process listens."""

    def __init__(self) -> None:
        # A fresh interpreter: threads and devices of the server are not copied into it.
        context = multiprocessing.get_context("spawn")
        listens, self._alive = context.Pipe(duplex=False)
        super().__init__(1, mp_context=context, initializer=_begin, initargs=(listens,))

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Ends the process; what it draws is lost."""
        self._alive.close()
        super().shutdown(wait=wait, cancel_futures=cancel_futures)


def _begin(server: Connection[Any, Any]) -> None:
    """In the drawing process, before its first picture."""
    interrupt.ignored()
    threading.Thread(target=_end_with, args=[server], name="parent", daemon=True).start()
    system.step_back(NICENESS)
    system.first_to_end()
    Bounds(file_bytes=FILE_BYTES, open_files=OPEN_FILES, core_bytes=0).apply()


def _end_with(server: Connection[Any, Any]) -> None:
    with suppress(EOFError, OSError):
        server.recv_bytes()
    os._exit(ORPHANED)


def paint(document: str, device: str | None, grids: Path | None = None) -> bytes:
    """The preview of a document as JPEG: the page's view of the whole terrain. Raises CannotDraw.

    Layers whose grid is not in the folder ``grids``, or damaged, are left out, as rooms leave them out.
    """
    from esker.render.device import NoGraphics
    from esker.render.pictures.painting import picture

    try:
        return picture(Document.model_validate_json(document), grids, device, (WIDTH, HEIGHT), LEVEL, QUALITY)
    except NoGraphics as error:
        raise CannotDraw(str(error)) from None
