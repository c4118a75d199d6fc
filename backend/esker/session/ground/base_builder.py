"""Making the base of a room's elevation layers (DESIGN 11): in a thread of its own, the newest layers win.

While a base is made the room goes on with the one before; layers that change faster than bases can be made (somebody
drags one) skip what lies in between. A base is never queued behind another of the same room.
"""

from __future__ import annotations

import asyncio
import functools
import logging
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from typing import Final

import numpy as np

from esker import contract as c
from esker import grid
from esker.document.ops import StrokeSet
from esker.events import BaseLevel
from esker.session.ground.ports import Base, Elevation

log = logging.getLogger("esker.base")

SLOW_SECONDS: Final = 0.7
"""``Layers.slow`` says that a base takes longer."""
FAILED: Final = "The elevation data could not be laid on the terrain; it stays as it was."


class Layers:
    """The base of one room, always of the newest layers that could be made. Lives in the event loop."""

    def __init__(
        self,
        elevation: Elevation | None,
        executor: Executor | None,
        loop: asyncio.AbstractEventLoop,
        laid: Callable[[], None],
        tell: Callable[[str], None],
        slow_changed: Callable[[], None],
    ) -> None:
        """``laid()`` is called in the loop when ``base`` is another one, ``tell(sentence)`` when something goes wrong,
        and ``slow_changed()`` when ``slow`` is. Without ``elevation`` and ``executor`` layers are kept and shared, but
        nothing is laid."""
        self._elevation, self._executor, self._loop = elevation, executor, loop
        self._laid, self._tell, self._slow_changed = laid, tell, slow_changed
        self.base: Base | None = None
        self._made_of: int | None = None
        """``StrokeSet.layers_rev`` of the document that ``base`` was made for; None before the first base."""
        self._wanted: StrokeSet | None = None
        self._making: int | None = None
        self._timer: asyncio.TimerHandle | None = None
        self.slow = False
        """Whether making the wanted base has taken long. It stays so until no other base is wanted."""
        self._closed = False

    def current(self, document: StrokeSet) -> bool:
        """Returns whether ``base`` is that of this document."""
        return self._made_of == document.layers_rev

    @property
    def empty(self) -> bool:
        """Whether the first base is still to come (a base may be None)."""
        return self._made_of is None

    def want(self, document: StrokeSet) -> bool:
        """Sees to it that ``base`` will be of this document. Returns True when it already is."""
        if self.current(document):
            self._wanted = None
            return True
        if self._elevation is None or self._executor is None or (self.base is None and not _visible(document)):
            self._wanted = None
            self._made_of, self.base = document.layers_rev, None
            return True
        self._wanted = document
        self._next()
        return False

    def close(self) -> None:
        """Ends the making: no further base is begun, and nobody is told of one."""
        self._closed, self._wanted = True, None
        self._quiet()

    def _next(self) -> None:
        """Begins to make the wanted base. Where one is being made, the next begins after it."""
        document = self._wanted
        if document is None or self._making is not None or self._closed:
            return
        self._wanted, self._making = None, document.layers_rev
        self._timer = self._loop.call_later(SLOW_SECONDS, self._takes_long)
        layers, settings = tuple(document.layers.values()), document.settings
        assert self._executor is not None
        try:
            future = self._executor.submit(self._make, layers, settings, self.base)
        except RuntimeError:  # the server is stopping
            return
        revision = document.layers_rev
        future.add_done_callback(lambda f: self._call(self._made, revision, f))

    def _make(self, layers: tuple[c.Layer, ...], settings: c.TerrainSettings, before: Base | None) -> Base | None:
        """Makes a base. It runs in the executor's thread."""
        assert self._elevation is not None
        edition = settings.edition
        tell = functools.partial(self._call, self._tell)
        return self._elevation.base(layers, settings.size_m, before, tell, edition)

    def _call(self, callback: Callable[..., object], *args: object) -> None:
        if not self._loop.is_closed():
            self._loop.call_soon_threadsafe(callback, *args)

    def _made(self, revision: int, future: Future[Base | None]) -> None:
        self._making = None
        self._quiet()
        if self._closed:
            return
        error = future.exception()
        if error is None:
            self.base = future.result()
        else:
            log.error("a base could not be made: %s: %s", type(error).__name__, error)
            self._tell(FAILED)
        self._made_of = revision
        if self._wanted is None or self._wanted.layers_rev == revision:
            self._wanted = None
            self._set_slow(False)
        self._laid()
        self._next()

    def _takes_long(self) -> None:
        self._set_slow(True)

    def _set_slow(self, slow: bool) -> None:
        if slow != self.slow:
            self.slow = slow
            self._slow_changed()

    def _quiet(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None


def _visible(document: StrokeSet) -> bool:
    return any(not layer.hidden for layer in document.layers.values())


def blank_levels(top: int) -> Iterator[BaseLevel]:
    """Yields the levels that take a base away again: levels 0..``top`` of zeros, and a data level of none."""
    for level in range(top + 1):
        n = grid.samples(level)
        yield BaseLevel(level, np.zeros((n, n), dtype=np.float32), c.Channel.BASE)
    for level in range(max(0, top - c.CHANNEL_LEVELS_BELOW) + 1):
        n = grid.samples(level)
        yield BaseLevel(level, np.full((n, n), c.BASE_SURVEY, dtype=np.float32), c.Channel.SURVEY)
