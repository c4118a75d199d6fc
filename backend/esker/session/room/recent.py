"""Documents and ops as JSON text, as those get them who come into a room."""

from __future__ import annotations

from collections import deque
from typing import Final

from esker.document.ops import StrokeSet
from esker.document.wire import document_json
from esker.session.room.viewing import shown

RECENT_OPS: Final = 2_000
RECENT_CHARACTERS: Final = 4 * 1024 * 1024
"""Ops kept as text for clients that resume, at most so many and so long; who missed more gets a snapshot."""


def points_of(document: StrokeSet) -> int:
    """Points of all strokes, deleted ones too."""
    return sum(len(stroke.curve) for strokes in (document.strokes, document.deleted) for stroke in strokes.values())


def encoded(document: StrokeSet, view: bool = False) -> bytes:
    """The document as JSON, ``view``: as a link to look is shown it. Of a heavy one that takes seconds: then it is for
    another thread."""
    whole = document.to_document()
    return document_json(shown(whole) if view else whole).encode()


class Recent:
    """The newest committed ops as JSON text, bounded in number and size."""

    def __init__(self) -> None:
        self._ops: deque[tuple[int, str]] = deque()
        self._characters = 0

    def add(self, clock: int, text: str) -> None:
        """The next op; clocks come without gaps."""
        self._ops.append((clock, text))
        self._characters += len(text)
        while len(self._ops) > RECENT_OPS or self._characters > RECENT_CHARACTERS:
            self._characters -= len(self._ops.popleft()[1])

    def after(self, clock: int) -> list[tuple[int, str]] | None:
        """The ops after ``clock``, each with its own, or None when they are not all here."""
        if not self._ops or self._ops[0][0] > clock + 1:
            return None
        return [op for op in self._ops if op[0] > clock]
