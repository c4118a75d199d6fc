"""Documents and ops as JSON text, as they are sent to people who come into a room."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Awaitable, Callable
from functools import partial
from typing import Final, Protocol

from esker.document.ops import StrokeSet
from esker.document.wire import document_json
from esker.session.room.replicas.viewing import shown

RECENT_OPS: Final = 2_000
RECENT_CHARACTERS: Final = 4 * 1024 * 1024
"""Ops kept as text for clients that resume, at most so many and so long. A client that missed more gets a snapshot."""


def points_of(document: StrokeSet) -> int:
    """Returns the points of all strokes, deleted ones too."""
    return sum(len(stroke.curve) for strokes in (document.strokes, document.deleted) for stroke in strokes.values())


def encoded(document: StrokeSet, view: bool = False) -> bytes:
    """Returns the document as JSON.

    ``view``: as a link to look is shown it. A heavy document takes seconds, in a thread of its own.
    """
    whole = document.to_document()
    return document_json(shown(whole) if view else whole).encode()


class Kept(Protocol):
    """A holder of encoded documents: ``RoomCore``."""

    document: StrokeSet

    def ready(self, clock: int | None, view: bool = False, asked: int | None = None) -> bool: ...

    def keep(self, clock: int, body: bytes, view: bool = False) -> None: ...


class Encoder:
    """Has heavy documents of one room encoded in another thread, each once for all who wait for it."""

    def __init__(self, core: Kept) -> None:
        self._core = core
        self._going: dict[bool, asyncio.Task[None]] = {}

    async def prepare(
        self,
        clock: int | None,
        run: Callable[[Callable[[], bytes]], Awaitable[bytes]],
        view: bool = False,
        over: Callable[[], bool] = lambda: False,
    ) -> int:
        """Returns when who has seen ``clock`` can be welcomed, or when it is ``over``: the clock when it was asked for.

        ``run`` encodes, in another thread; ``view``: as a link to look is shown it. Raises what ``run`` raises; what
        the ``run`` of somebody else raised is no reason, as that one's share may be used up.
        """
        asked = self._core.document.clock
        while not self._core.ready(clock, view, asked) and not over():
            mine = view not in self._going
            if mine:
                self._going[view] = asyncio.create_task(self._encode(run, view))
            try:
                await asyncio.shield(self._going[view])
            except Exception:
                if mine:
                    raise
        return asked

    async def _encode(self, run: Callable[[Callable[[], bytes]], Awaitable[bytes]], view: bool) -> None:
        # A callback at the end of the task would come too late for whoever asks between the two: waiting for a task
        # that is done does not wait, so such a loop never gave way to the callback.
        document = self._core.document
        try:
            self._core.keep(document.clock, await run(partial(encoded, document, view)), view)
        finally:
            del self._going[view]


class Recent:
    """The newest committed ops as JSON text, bounded in number and size."""

    def __init__(self) -> None:
        self._ops: deque[tuple[int, str]] = deque()
        self._characters = 0

    def add(self, clock: int, text: str) -> None:
        """Adds the next op; clocks come without gaps."""
        self._ops.append((clock, text))
        self._characters += len(text)
        while len(self._ops) > RECENT_OPS or self._characters > RECENT_CHARACTERS:
            self._characters -= len(self._ops.popleft()[1])

    def after(self, clock: int) -> list[tuple[int, str]] | None:
        """Returns the ops after ``clock``, each with its own, or None when they are not all here."""
        if not self._ops or self._ops[0][0] > clock + 1:
            return None
        return [op for op in self._ops if op[0] > clock]
