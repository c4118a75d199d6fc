"""Texts that wait to be sent to one client (DESIGN 8, "Flow control").

Control texts are queued and never dropped; a client that lets more than ``MAX_BACKLOG_BYTES`` pile up is closed and
resumes. Tile frames are not queued at all: one is made when the queue is empty and the byte window is open, so it
always shows the latest state.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

from esker import contract as c
from esker.contract import CloseCode

FEW_BYTES: Final = 64 * 1024
"""A client for whom no more bytes than this wait is not closed when the server has too much to send."""
SLOW: Final = "Your connection did not keep up. It will resume by itself."


@dataclass(frozen=True, slots=True)
class Long:
    """A long text in three parts of UTF-8. ``body`` is shared by all to whom it goes, and copied for none of them."""

    head: bytes
    body: bytes
    tail: bytes

    def __str__(self) -> str:
        return (self.head + self.body + self.tail).decode()


class Waiting:
    """A count of the bytes that wait to be sent by the whole server."""

    def __init__(self, most: int) -> None:
        self.most, self.held = most, 0


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
        waiting: Waiting | None = None,
    ) -> None:
        """``waiting``: the server's count; when it is full, a client that has much to send is closed."""
        self._wake, self._limit, self._now = wake, limit, now
        self._waiting = waiting or Waiting(limit)
        self._texts: deque[tuple[str | Long, int]] = deque()
        self.backlog = 0
        self.closing: tuple[CloseCode, str] | None = None
        self.ticket = ""
        """By which who is closed may be let in later."""

    def push(self, *texts: str | Long, counted: bool = True) -> None:
        """Queues control texts. ``counted`` False is for a welcome, whose size is the document's."""
        if self.closing is not None:
            return
        if self._now is not None and not self._texts:
            short = [text for text in texts if isinstance(text, str)]
            if len(short) == len(texts) and self._now(short):
                return
        for text in texts:
            size = len(text) if counted and isinstance(text, str) else 0
            full = self._waiting.held + size > self._waiting.most and self.backlog + size > FEW_BYTES
            if self.backlog + size > self._limit or full:
                self.close("slow_client", SLOW)
                return
            self._texts.append((text, size))
            self._count(size)
        self._wake()

    def _count(self, size: int) -> None:
        self.backlog += size
        self._waiting.held += size

    def drop(self) -> None:
        """Forgets everything that waits; nothing more is sent."""
        self._texts.clear()
        self._count(-self.backlog)

    def message(self, message: c.Wire) -> None:
        """Queues a server message."""
        self.push(message.model_dump_json())

    def close(self, code: CloseCode, reason: str, ticket: str = "") -> None:
        """Ends the connection with an error message. Queued texts are dropped: the client resumes, or is refused."""
        if self.closing is None:
            self.closing, self.ticket = (code, reason), ticket
            self.drop()
            self._wake()

    def pop(self) -> str | Long | None:
        """Returns the next text to send, or None."""
        if not self._texts:
            return None
        text, size = self._texts.popleft()
        self._count(-size)
        return text

    @property
    def waits(self) -> bool:
        """Whether there is text that was not taken yet."""
        return bool(self._texts)

    def notify(self) -> None:
        """Says that something outside the queue changed: tiles, a view, credit."""
        self._wake()
