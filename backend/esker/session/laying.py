"""Making the base of a room's elevation layers (DESIGN 11): in a thread of its own, the newest layers win.

While a base is made the room goes on with the one before; layers that change faster than bases can be made (somebody
drags one) skip what lies in between. A base is never queued behind another of the same room.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from esker import contract as c
from esker import grid
from esker.document.ops import StrokeSet
from esker.session.ports import Base, Elevation

log = logging.getLogger("esker.laying")

SLOW_SECONDS: Final = 0.7
"""A base that takes longer is told of."""
LAYING: Final = "The elevation data are being laid on the terrain."
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
    ) -> None:
        """``laid()`` is called in the loop when ``base`` is another one; ``tell(sentence)`` when something goes wrong,
        or takes long. Without ``elevation`` and ``executor`` layers are kept and shared, but nothing is laid."""
        self._elevation, self._executor, self._loop = elevation, executor, loop
        self._laid, self._tell = laid, tell
        self.base: Base | None = None
        self._ground: object = None
        """Of the document that ``base`` belongs to; None before there is any."""
        self._wanted: StrokeSet | None = None
        self._making: object = None
        self._slow: asyncio.TimerHandle | None = None
        self._told = False
        """Whether it was told that this takes long, since nothing was wanted last."""
        self._closed = False

    def current(self, document: StrokeSet) -> bool:
        """Whether ``base`` is that of this document."""
        return self._ground is document.ground

    @property
    def empty(self) -> bool:
        """True until the first base is there (which may be None)."""
        return self._ground is None

    def want(self, document: StrokeSet) -> bool:
        """Sees to it that ``base`` will be of this document. True when it is already."""
        if self.current(document):
            self._wanted = None
            return True
        if self._elevation is None or self._executor is None or (self.base is None and not _visible(document)):
            self._wanted = None
            self._ground, self.base = document.ground, None
            return True
        self._wanted = document
        self._next()
        return False

    def close(self) -> None:
        """Nothing more is made or told."""
        self._closed, self._wanted = True, None
        self._quiet()

    def _next(self) -> None:
        """Begins with what is wanted, unless a base is being made: then it comes after that."""
        document = self._wanted
        if document is None or self._making is not None or self._closed:
            return
        self._wanted, self._making = None, document.ground
        self._slow = self._loop.call_later(SLOW_SECONDS, self._takes_long)
        layers, size_m = tuple(document.layers.values()), document.settings.size_m
        assert self._executor is not None
        try:
            future = self._executor.submit(self._make, layers, size_m, self.base)
        except RuntimeError:  # the server is stopping
            return
        ground = document.ground
        future.add_done_callback(lambda f: self._call(self._made, ground, f))

    def _make(self, layers: tuple[c.Layer, ...], size_m: float, before: Base | None) -> Base | None:
        """In the thread."""
        assert self._elevation is not None
        return self._elevation.base(layers, size_m, before, lambda sentence: self._call(self._tell, sentence))

    def _call(self, callback: Callable[..., object], *args: object) -> None:
        if not self._loop.is_closed():
            self._loop.call_soon_threadsafe(callback, *args)

    def _made(self, ground: object, future: Future[Base | None]) -> None:
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
        self._ground = ground
        if self._wanted is None or self._wanted.ground is ground:
            self._wanted, self._told = None, False
        self._laid()
        self._next()

    def _takes_long(self) -> None:
        if not self._told:
            self._told = True
            self._tell(LAYING)

    def _quiet(self) -> None:
        if self._slow is not None:
            self._slow.cancel()
            self._slow = None


def _visible(document: StrokeSet) -> bool:
    return any(not layer.hidden for layer in document.layers.values())


@dataclass(frozen=True)
class BlankLevel:
    """A level of no base at all; a ``ports.LevelResult``."""

    level: int
    heights: NDArray[np.float32]
    channel: c.Channel
    settled: bool = True
    basis: None = None


def blank_levels(top: int) -> Iterator[BlankLevel]:
    """What takes a base away again: levels 0..``top`` of zeros, and a survey of nothing."""
    for level in range(top + 1):
        n = grid.samples(level)
        yield BlankLevel(level, np.zeros((n, n), dtype=np.float32), c.Channel.BASE)
    for level in range(max(0, top - c.CHANNEL_LEVELS_BELOW) + 1):
        n = grid.samples(level)
        yield BlankLevel(level, np.full((n, n), c.BASE_SURVEY, dtype=np.float32), c.Channel.SURVEY)
