"""What copies of classes begin as, read once and written once for all who come in within some minutes.

A class comes in at once. Of a terrain of 2,000 strokes, to read the document takes Python's lock for 330 ms, a little
at a time, and to write it again for 60: whoever draws anywhere on the server shares that lock.
"""

from __future__ import annotations

import json
import time
from collections import OrderedDict
from collections.abc import Callable
from typing import Final

from esker import contract as c
from esker.document.wire import Compressed, compressed, document_json

CHARACTERS: Final = 16 << 20
"""Documents of so many characters are held, of all classes together; as objects they take some four times as many
bytes. One that has more by itself is read each time."""
SECONDS: Final = 180.0
"""Nothing is held for longer after the last one that asked for it."""


class Beginning:
    """What copies of one class begin as."""

    def __init__(self, document: c.Document, characters: int) -> None:
        """``characters``: of its JSON text."""
        self.document, self.characters = document, characters
        self.asked = 0.0
        self._tail: tuple[c.TerrainSettings, bytes, int] | None = None
        """What follows the id in copies with these settings, compressed, and its characters."""

    def find(self, born: c.Document) -> Compressed | None:
        """Returns a copy as it is kept, where one was made before that differs in nothing but its id."""
        if self._tail is None or self._tail[0] != born.settings:
            return None
        _, tail, characters = self._tail
        head = _head(born)
        return Compressed(compressed(head) + tail, len(head) + characters, born.settings.title)

    def compress(self, born: c.Document) -> Compressed:
        """Returns a copy as it is kept, and has it there for those that follow. It may be called in any thread."""
        text, head = document_json(born), _head(born)
        if not text.startswith(head):
            raise ValueError("a document begins with its id")
        tail = text[len(head) :]
        self._tail = (born.settings, compressed(tail), len(tail))
        return Compressed(compressed(head) + self._tail[1], len(text), born.settings.title)


class Beginnings:
    """Those that were asked for of late, by class and clock. Lives in the event loop."""

    def __init__(self, now: Callable[[], float] = time.monotonic) -> None:
        self._now = now
        self._held: OrderedDict[tuple[str, int], Beginning] = OrderedDict()

    def find(self, lesson: str, clock: int) -> Beginning | None:
        """Returns what is held, which now is held for longer."""
        self.forget_old()
        found = self._held.get((lesson, clock))
        if found is not None:
            self._touch((lesson, clock), found)
        return found

    def hold(self, lesson: str, clock: int, beginning: Beginning) -> None:
        """Holds one for those who ask next, in place of those that nobody asked for the longest."""
        if beginning.characters > CHARACTERS:
            return
        self._touch((lesson, clock), beginning)
        while sum(each.characters for each in self._held.values()) > CHARACTERS:
            self._held.popitem(last=False)

    def forget_old(self) -> None:
        """Lets go of what nobody asked for in ``SECONDS``."""
        while self._held and next(iter(self._held.values())).asked <= self._now() - SECONDS:
            self._held.popitem(last=False)

    def _touch(self, key: tuple[str, int], beginning: Beginning) -> None:
        beginning.asked = self._now()
        self._held[key] = beginning
        self._held.move_to_end(key)


def _head(document: c.Document) -> str:
    return f'{{"id":{json.dumps(document.id)}'
