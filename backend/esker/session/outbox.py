"""What waits to be sent to one client (DESIGN 8, "Flow control").

Control texts are queued and never dropped; a client that lets more than ``MAX_BACKLOG_BYTES`` pile up is closed and
resumes. Tile frames are not queued at all: one is made when the queue is empty and the byte window is open, so it
always shows the latest state.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from typing import Final

from esker import contract as c
from esker.contract import CloseCode

SLOW: Final = "Your connection did not keep up. It will resume by itself."


class Outbox:
    """Bounded queue of one client. ``wake`` is called when there is something new to do; it must not block.

    ``now`` takes texts that none waits before, if they can go at once, and says whether they did: then they are not
    queued.
    """

    def __init__(
        self,
        wake: Callable[[], None],
        limit: int = c.MAX_BACKLOG_BYTES,
        now: Callable[[Sequence[str]], bool] | None = None,
    ) -> None:
        self._wake, self._limit, self._now = wake, limit, now
        self._texts: deque[tuple[str, int]] = deque()
        self.backlog = 0
        self.closing: tuple[CloseCode, str] | None = None

    def push(self, *texts: str, counted: bool = True) -> None:
        """Queues control texts. ``counted`` False is for a welcome, whose size is the document's."""
        if self.closing is not None:
            return
        if self._now is not None and not self._texts and self._now(texts):
            return
        for text in texts:
            size = len(text) if counted else 0
            if self.backlog + size > self._limit:
                self.close("slow_client", SLOW)
                return
            self._texts.append((text, size))
            self.backlog += size
        self._wake()

    def message(self, message: c.Wire) -> None:
        """Queues a server message."""
        self.push(message.model_dump_json())

    def close(self, code: CloseCode, reason: str) -> None:
        """Ends the connection with an error message; what is queued is dropped (the client resumes or is refused)."""
        if self.closing is None:
            self.closing = (code, reason)
            self._texts.clear()
            self.backlog = 0
            self._wake()

    def pop(self) -> str | None:
        """The next text to send, or None."""
        if not self._texts:
            return None
        text, size = self._texts.popleft()
        self.backlog -= size
        return text

    @property
    def waits(self) -> bool:
        """True while there is text that was not taken yet."""
        return bool(self._texts)

    def notify(self) -> None:
        """Something outside the queue changed: tiles, a view, credit."""
        self._wake()
