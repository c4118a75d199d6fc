"""The way of solved levels and refined tiles to the clients of one room (DESIGN 5.6; 8, "Flow control").

All work on tiles (taking a level, planning, encoding) happens in one thread of its own, so the event loop never waits
for it and no lock is needed. A client is planned for only while its byte window is open and its last frames have been
handed to the socket: versions in between are skipped by construction, and no more than ``stream.BATCH_BYTES`` are ever
queued.

A coarsest preview of newer strokes may come at any time. What is coarser and newer bars finer levels, so it waits until
the frames of a finest preview that has just come were made.

What the clients want refined goes the other way: the tile thread publishes it, the solver's thread reads it, and the
tiles that come back are taken together, so that a hundred of them cost a few selections and not a hundred.
"""

from __future__ import annotations

import asyncio
import logging
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import CancelledError, Future
from contextlib import suppress
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from esker import contract as c
from esker.events import Level, Preview
from esker.grid import TileKey
from esker.session.ground.frames.stream import Stream
from esker.session.ground.frames.tilethread import Lane, TileThread
from esker.session.ground.ports import ClientTiles, FrameOutlet, Tiles, WateredTiles
from esker.tiles.delivery import RefinedTile

log = logging.getLogger("esker.feed")

PUTS_AHEAD: Final = 1
"""Levels that may wait to become tiles while the solver goes on."""
BATCH_SECONDS: Final = 0.03
"""Refined tiles that come within this time are taken together."""
BATCH_TILES: Final = 16
"""A batch of so many refined tiles is taken without waiting for more."""
BATCH_SHARE: Final = 0.25
"""Taking tiles, and working out the requests of a room full of people, takes at most this share of the time."""
FORGET_SECONDS: Final = 1.0
"""Earlier states of levels are let go so long after something was taken or sent: by then clients have the newest."""
REQUESTS_SECONDS: Final = 0.05
"""While cameras move, requests are worked out at most this often."""


class TileFeed:
    """Tiles of one room. Call it from the event loop's thread, except where another is named."""

    def __init__(
        self,
        tiles: Tiles,
        size_m: float,
        levels: int,
        finest: int,
        executor: Lane | TileThread,
        loop: asyncio.AbstractEventLoop,
        on_level: Callable[[int, int, bool], None],
        on_requests: Callable[[int, bool], None],
    ) -> None:
        """``executor`` has one thread. The callbacks run in the loop.

        ``on_level(clock, level, settled)``: a level was taken; ``settled``, whether now all levels are final.
        ``on_requests(count, more)``: how many tiles are wanted refined, and whether the solver should look at
        ``wanted`` again.
        """
        self._tiles, self._executor, self._loop = tiles, executor, loop
        self._on_level, self._on_requests = on_level, on_requests
        self._server = tiles.server(size_m, levels, finest)
        self._refines = finest > levels
        self._streams: set[Stream] = set()
        self._clients: dict[Stream, ClientTiles] = {}
        """Tiles that each stream's client holds. Only the tile thread may touch it."""
        self._puts: list[Future[None]] = []
        self._newest: dict[tuple[c.Channel, int], object] = {}
        """The newest array of each level of the channels other than heights. Only the solver's thread may touch it."""
        self._lock = threading.Lock()
        self._requests: tuple[TileKey, ...] = ()
        self._made: dict[TileKey, tuple[int, RefinedTile]] = {}
        """Refined tiles that wait to be taken. This and ``_requests`` need the lock."""
        self._coarse: tuple[int, Level] | None = None
        """The newest coarsest preview that waits to be taken. Access needs the lock."""
        self._frames_pending = False
        """Whether a finest preview was taken whose frames nobody was sent yet. Only the tile thread may touch it."""
        self._taking = False
        self._rivers: bytes | None = None
        self._rest_until = 0.0
        """Time of the loop from which on the next batch may be taken."""
        self._requests_timer: asyncio.TimerHandle | None = None
        self._forget_timer: asyncio.TimerHandle | None = None

    def add(self, outbox: FrameOutlet, top: int | None = None) -> Stream:
        """A new client; or, with ``top``, somebody who watches the levels up to it."""
        stream = Stream(outbox, top, rivers=self._rivers if top is None else None)
        self._streams.add(stream)
        self._feed(stream)
        return stream

    def remove(self, stream: Stream) -> None:
        """Forgets a client that left."""
        stream.gone = True
        self._streams.discard(stream)
        self._submit(self._forget, stream)

    def view(self, stream: Stream, view: c.View) -> None:
        """Takes a client's new view."""
        stream.view = view
        self._wake(stream)

    def credit(self, stream: Stream, count: int) -> None:
        """Takes note that a client has applied so many bytes."""
        stream.credit(count)
        self._feed(stream)

    def heights(self, level: int) -> Future[NDArray[np.float32] | None]:
        """The ground of a level, once the tile thread comes to it. Raises RuntimeError after the server's end."""
        return self._executor.submit(self._server.heights, level)

    def sent(self, stream: Stream) -> bytes | None:
        """Takes the frame that waits, to hand it to the socket; the next one may be made."""
        if not stream.frames:
            return None
        frame = stream.frames.popleft()
        if not stream.frames:
            self._loop.call_soon(self._feed, stream)
        return frame

    def snapshot(self, level: int, taken: Callable[[Any], None]) -> None:
        """Reads the ground of a level once the tile thread has nothing else to do for this room; ``taken`` is called in
        the loop, with None where there is no ground yet."""
        assert isinstance(self._tiles, WateredTiles)
        read = self._tiles.snapshot
        self._submit(lambda: self._call(taken, read(self._server, level)))

    def show_rivers(self, frame: bytes | None) -> None:
        """Sends a frame of rivers to everybody, and to who comes, once they have their tiles; None: to nobody."""
        self._rivers = frame
        for stream in self._streams:
            if stream.top is None:
                stream.rivers = frame
                self._wake(stream)

    # --- in the solver's thread -----------------------------------------------------------------------------------

    def put(self, clock: int, result: Level) -> None:
        """Takes a solved level; waits while an earlier level is still being taken."""
        place = (result.channel, result.level)
        if result.channel != c.Channel.HEIGHT:
            if self._newest.get(place) is result.heights:
                return
            self._newest[place] = result.heights
        if result.channel == c.Channel.BASE:
            with self._lock:  # tiles that wait were made over another base
                self._made.clear()
        try:
            if result.level == 0 and result.channel == c.Channel.HEIGHT and not result.settled:
                self._put_coarse(clock, result)
                return
            while len(self._puts) > PUTS_AHEAD - 1:
                self._puts.pop(0).result()
            self._puts.append(self._executor.first(self._put, clock, result))
        except (CancelledError, RuntimeError):
            log.debug("the tile thread has stopped")

    def note(self, clock: int, preview: Preview) -> None:
        """Takes a preview that is not shown, as the finest follows soon (``tiles/pyramid.py``). Never waits."""
        with suppress(RuntimeError):  # the tile thread has stopped
            self._executor.first(self._note, clock, preview)

    def _put_coarse(self, clock: int, result: Level) -> None:
        """Takes a coarsest preview in place of one that still waits. Never waits."""
        with self._lock:
            waiting, self._coarse = self._coarse, (clock, result)
        if waiting is None:
            self._executor.first(self._take_coarse)

    def confirm(self, clock: int, level: int) -> None:
        """Says that heights up to ``level`` are final for ``clock`` too: only other channels followed from the
        change."""
        with suppress(RuntimeError):  # the tile thread has stopped
            self._executor.first(self._confirm, clock, level)

    def limit(self, top: int) -> None:
        """Says that levels 0..``top`` are solved from now on."""
        self._newest.clear()
        with suppress(RuntimeError):  # the tile thread has stopped
            self._executor.first(self._limit, top)

    def wanted(self) -> Sequence[TileKey]:
        """Returns the tiles to refine next, most urgent first; none while the ground moves.

        It may be called from any thread.
        """
        with self._lock:
            return tuple(key for key in self._requests if key not in self._made)

    def deliver_tile(self, clock: int, tile: RefinedTile) -> None:
        """Takes a refined tile of the settled solve at ``clock``. Never waits."""
        with self._lock:
            self._made[tile.key] = (clock, tile)
            full = len(self._made) >= min(BATCH_TILES, len(self._requests))
            first, self._taking = not self._taking, True
            rest = self._rest_until - self._loop.time()
        if full and rest <= 0:
            self._submit(self._take)
        elif first:
            self._call(self._loop.call_later, max(BATCH_SECONDS, rest), self._submit, self._take)

    # --- in the tile thread ---------------------------------------------------------------------------------------

    def _take_coarse(self) -> None:
        """Puts the coarsest preview, unless frames of a finest one are pending: then the coarsest comes again behind
        these."""
        if self._frames_pending:
            self._call(self._submit, self._take_coarse_now)
            return
        self._take_coarse_now()

    def _take_coarse_now(self) -> None:
        with self._lock:
            waiting, self._coarse = self._coarse, None
        if waiting is not None:
            self._put(*waiting)

    def _frames_submitted(self) -> None:
        self._frames_pending = False

    def _put(self, clock: int, result: Level) -> None:
        channel = result.channel
        try:
            self._server.put_level(clock, result.level, result.heights, result.settled, channel)
        except Exception:
            log.exception("level %d of %s at clock %d could not become tiles", result.level, channel.name, clock)
            return
        if channel == c.Channel.BASE:
            self._publish(False)
        if channel != c.Channel.HEIGHT:
            self._call(self._wake_all)
            return
        settled = self._server.settled()
        self._publish(settled)
        self._frames_pending = result.level > 0 and not result.settled
        self._call(self._level_taken, clock, result.level, settled)
        if self._frames_pending:
            self._call(self._submit, self._frames_submitted)

    def _note(self, clock: int, preview: Preview) -> None:
        try:
            self._server.note(clock, preview.level, preview.heights)
        except Exception:
            log.exception("level %d at clock %d could not be noted", preview.level, clock)

    def _confirm(self, clock: int, level: int) -> None:
        self._call(self._level_taken, clock, level, self._server.settled())

    def _limit(self, top: int) -> None:
        self._server.limit(top)
        self._call(self._wake_all)

    def _take(self) -> None:
        """Takes the refined tiles that wait, and says what is wanted then."""
        with self._lock:
            made, self._taking = list(self._made.values()), False
        if not made:
            return
        began = self._loop.time()
        taken = 0
        for clock, tile in made:
            try:
                taken += self._server.put_tile(clock, tile)
            except Exception:
                log.exception("the refined tile %s at clock %d was refused", tuple(tile.key), clock)
        self._publish(taken > 0, made)
        ended = self._loop.time()
        with self._lock:
            self._rest_until = ended + (ended - began) * (1 / BATCH_SHARE - 1)
        if taken:
            self._call(self._wake_all)

    def _publish(self, look: bool, taken: Sequence[tuple[int, RefinedTile]] = ()) -> None:
        """Works out the requests. ``look``: the solver should look even if they are the same as before."""
        if not self._refines:
            return
        try:
            requests, count = self._server.requests(list(self._clients.values()))
        except Exception:
            log.exception("what to refine could not be worked out")
            return
        with self._lock:
            for made in taken:
                if self._made.get(made[1].key) is made:
                    del self._made[made[1].key]
            look = bool(requests) and (look or requests != self._requests)
            self._requests = requests
        self._call(self._on_requests, count, look)

    def _forget_earlier(self) -> None:
        try:
            self._server.forget_earlier(list(self._clients.values()))
        except Exception:
            log.exception("earlier states of levels could not be let go")

    def _forget(self, stream: Stream) -> None:
        if self._clients.pop(stream, None) is not None:
            self._publish(False)

    def _make(self, stream: Stream, view: c.View | None, most: int) -> None:
        """Makes frames of the latest state, up to ``most`` bytes and the rest of a frame; hands each over when made."""
        made = 0
        if stream.gone:
            return
        try:
            tiles = self._clients.get(stream)
            if tiles is None:
                if stream.top is None:
                    tiles = self._tiles.client(self._server)
                else:
                    tiles = self._tiles.watcher(self._server, stream.top)
                self._clients[stream] = tiles
            if view is not None:
                tiles.set_view(view)
            # All frames of a level are made once the first one is. A coarsest preview that waits goes before them only
            # then.
            while made < most and (plan := tiles.plan(made > 0 and self._coarse is not None)) is not None:
                frame = plan.encode()
                tiles.commit(plan)
                made += len(frame)
                self._call(self._frame_made, stream, frame)
        except Exception:
            log.exception("a tile frame could not be made")
            self._call(stream.outbox.close, "server_error", "The server failed to prepare the ground for you.")
            return
        self._call(self._all_made, stream, made > 0)

    def _call(self, callback: Callable[..., object], *args: object) -> None:
        if not self._loop.is_closed():
            self._loop.call_soon_threadsafe(callback, *args)

    # --- in the loop ----------------------------------------------------------------------------------------------

    def _level_taken(self, clock: int, level: int, settled: bool) -> None:
        self._wake_all()
        self._forget_soon()
        self._on_level(clock, level, settled)

    def _forget_soon(self) -> None:
        if self._forget_timer is None:
            self._forget_timer = self._loop.call_later(FORGET_SECONDS, self._forget_due)

    def _forget_due(self) -> None:
        self._forget_timer = None
        self._submit(self._forget_earlier)

    def _wake_all(self) -> None:
        for stream in self._streams:
            self._wake(stream)

    def _wake(self, stream: Stream) -> None:
        stream.hungry = True
        self._feed(stream)

    def _feed(self, stream: Stream) -> None:
        if stream not in self._streams or not stream.ready:
            return
        view, stream.view = stream.view, None
        stream.busy, stream.hungry = True, False
        if view is not None and self._refines and self._requests_timer is None:
            self._requests_timer = self._loop.call_later(REQUESTS_SECONDS, self._requests_due)
        behind = stream.outbox.home if stream.newcomer else None
        if not self._submit(self._make, stream, view, stream.most, behind=behind):
            self._streams.discard(stream)

    def _requests_due(self) -> None:
        self._requests_timer = None
        self._submit(self._publish, False)

    def _submit(self, work: Callable[..., None], *args: object, behind: str | None = None) -> bool:
        """Has the tile thread do something; with ``behind``, as a newcomer's who counts as that.

        Returns False when the thread has been shut down: the server is stopping.
        """
        try:
            if behind is None:
                self._executor.submit(work, *args)
            else:
                self._executor.behind(behind, work, *args)
        except RuntimeError:
            return False
        return True

    def _frame_made(self, stream: Stream, frame: bytes) -> None:
        stream.frames.append(frame)
        stream.in_flight += len(frame)
        stream.outbox.notify()

    def _all_made(self, stream: Stream, some: bool) -> None:
        stream.made(some)
        if some:
            self._forget_soon()
        if not stream.hungry and stream.rivers is not None:
            frame, stream.rivers = stream.rivers, None
            self._frame_made(stream, frame)
        self._feed(stream)  # something may have changed while the frames were made, or there may be more
