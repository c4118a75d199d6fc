"""The way of solved levels to the clients of one room (DESIGN 8, "Flow control").

All work on tiles (taking a level, planning, encoding) happens in one thread of its own, so the event loop never waits
for it and no lock is needed. A client is planned for only while its byte window is open and its last frame has been
handed to the socket: versions in between are skipped by construction, and nothing stale is ever queued.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from concurrent.futures import CancelledError, Executor, Future
from dataclasses import dataclass
from typing import Final

from esker import contract as c
from esker.session.outbox import Outbox
from esker.session.ports import ClientTiles, LevelResult, Tiles

log = logging.getLogger("esker.feed")

PUTS_AHEAD: Final = 1
"""Levels that may wait to become tiles while the solver goes on."""


@dataclass(eq=False)
class Stream:
    """The tiles of one client: its window, and at most one encoded frame that waits for the socket."""

    outbox: Outbox
    view: c.View | None = None
    in_flight: int = 0
    hungry: bool = True
    busy: bool = False
    frame: bytes | None = None
    tiles: ClientTiles | None = None

    @property
    def ready(self) -> bool:
        """True when a frame may be made for it now."""
        free = self.frame is None and not self.busy and self.in_flight < c.BYTE_WINDOW
        return self.hungry and free and self.outbox.closing is None


class TileFeed:
    """Tiles of one room. Except for ``put``, call it from the event loop's thread."""

    def __init__(
        self,
        tiles: Tiles,
        size_m: float,
        levels: int,
        executor: Executor,
        loop: asyncio.AbstractEventLoop,
        on_level: Callable[[int, int, bool], None],
    ) -> None:
        """``executor`` has one thread; ``on_level(clock, level, settled)`` is called in the loop."""
        self._tiles, self._executor, self._loop, self._on_level = tiles, executor, loop, on_level
        self._server = tiles.server(size_m, levels)
        self._streams: set[Stream] = set()
        self._puts: list[Future[None]] = []

    def add(self, outbox: Outbox) -> Stream:
        """A new client."""
        stream = Stream(outbox)
        self._streams.add(stream)
        self._feed(stream)
        return stream

    def remove(self, stream: Stream) -> None:
        """The client left."""
        self._streams.discard(stream)

    def view(self, stream: Stream, view: c.View) -> None:
        """The client looks somewhere else."""
        stream.view = view
        self._wake(stream)

    def credit(self, stream: Stream, count: int) -> None:
        """The client has applied so many bytes."""
        stream.in_flight = max(0, stream.in_flight - count)
        self._feed(stream)

    def sent(self, stream: Stream) -> bytes | None:
        """Takes the frame that waits, to hand it to the socket; the next one may be made."""
        frame, stream.frame = stream.frame, None
        if frame is not None:
            self._loop.call_soon(self._feed, stream)
        return frame

    def put(self, clock: int, result: LevelResult) -> None:
        """Takes a solved level. Called in the solver's thread; waits while an earlier level is still being taken."""
        try:
            while len(self._puts) > PUTS_AHEAD - 1:
                self._puts.pop(0).result()
            self._puts.append(self._executor.submit(self._put, clock, result))
        except (CancelledError, RuntimeError):
            log.debug("the tile thread has stopped")

    # --- in the tile thread ---------------------------------------------------------------------------------------

    def _put(self, clock: int, result: LevelResult) -> None:
        try:
            self._server.put_level(clock, result.level, result.heights, result.settled)
        except Exception:
            log.exception("level %d at clock %d could not become tiles", result.level, clock)
            return
        self._call(self._level_taken, clock, result.level, result.settled)

    def _make(self, stream: Stream, view: c.View | None) -> None:
        frame: bytes | None = None
        try:
            if stream.tiles is None:
                stream.tiles = self._tiles.client(self._server)
            if view is not None:
                stream.tiles.set_view(view)
            plan = stream.tiles.plan()
            if plan is not None:
                frame = plan.encode()
                stream.tiles.commit(plan)
        except Exception:
            log.exception("a tile frame could not be made")
            self._call(stream.outbox.close, "server_error", "The server failed to prepare the ground for you.")
            return
        self._call(self._made, stream, frame)

    def _call(self, callback: Callable[..., None], *args: object) -> None:
        if not self._loop.is_closed():
            self._loop.call_soon_threadsafe(callback, *args)

    # --- in the loop ----------------------------------------------------------------------------------------------

    def _level_taken(self, clock: int, level: int, settled: bool) -> None:
        for stream in self._streams:
            self._wake(stream)
        self._on_level(clock, level, settled)

    def _wake(self, stream: Stream) -> None:
        stream.hungry = True
        self._feed(stream)

    def _feed(self, stream: Stream) -> None:
        if stream not in self._streams or not stream.ready:
            return
        view, stream.view = stream.view, None
        stream.busy, stream.hungry = True, False
        try:
            self._executor.submit(self._make, stream, view)
        except RuntimeError:  # the executor has been shut down: the server is stopping
            self._streams.discard(stream)

    def _made(self, stream: Stream, frame: bytes | None) -> None:
        stream.busy = False
        if frame is None:
            self._feed(stream)  # only if something changed while it was planned
            return
        stream.frame = frame
        stream.hungry = True
        stream.in_flight += len(frame)
        stream.outbox.notify()
