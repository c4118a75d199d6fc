"""Texts that wait to be sent to one client (DESIGN 8, "Flow control").

Control texts are queued and never dropped; a client that lets more than ``MAX_BACKLOG_BYTES`` pile up is closed and
resumes. Tile frames are not queued at all: one is made when the queue is empty and the byte window is open, so it
always shows the latest state.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

from esker import contract as c
from esker.contract import CloseCode
from esker.fairness.shares import Share, Who

FEW_BYTES: Final = 64 * 1024
"""A client for whom no more bytes than this wait is not closed when the server has too much to send."""
NOBODY: Final = Who("")
"""Stands for who is not counted, as nobody asked by an address."""
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
    """A count of the bytes that wait to be sent: of the whole server, and by address and link of those who get them.

    An address has a quarter of all, a link too, a /48 half. Whoever makes others' pages fall behind thus fills up a
    share and not the server.
    """

    def __init__(self, most: int) -> None:
        self.share = Share(most, address=most // 4, network=most // 2, link=most // 4)
        self.held = 0
        self._of: Counter[tuple[str, str]] = Counter()

    def of(self, kind: str, key: str) -> int:
        """Bytes that wait for one address, /48 or link."""
        return self._of[kind, key]

    def fits(self, who: Who, size: int) -> bool:
        """Whether so many bytes more may wait for ``who``."""
        if self.held + size > self.share.total:
            return False
        return all(self._of[kind, key] + size <= self.share.most(kind) for kind, key in _named(who))

    def count(self, who: Who, size: int) -> None:
        """Counts ``size`` bytes more that wait for ``who``; fewer where ``size`` is negative."""
        self.held += size
        for key in _named(who):
            self._of[key] += size
            if not self._of[key]:
                del self._of[key]


def _named(who: Who) -> list[tuple[str, str]]:
    """What is counted of ``who``; nothing of who has no address."""
    return list(who.counted()) if who.address else []


class Outbox:
    """Bounded queue of one client. ``wake`` is called when there is something new to do; it must not block.

    ``now`` takes texts that none waits before, if they can go at once, and says whether they did: then they are not
    queued.
    """

    def __init__(
        self,
        wake: Callable[[], None],
        limit: int = c.MAX_BACKLOG_BYTES,
        now: Callable[[Sequence[str]], bool | None] | None = None,
        waiting: Waiting | None = None,
        who: Who = NOBODY,
    ) -> None:
        """``waiting``: the server's count; when it is full, or the share of ``who``, a client that has much to send is
        closed."""
        self._wake, self._limit, self._now = wake, limit, now
        self._waiting = waiting or Waiting(4 * limit)
        self._who = who
        self._waits = self._taken = 0
        """Bytes that wait, welcomes too; and those of the text that was taken last, which waits until it has left."""
        self._texts: deque[tuple[str | Long, int, bool]] = deque()
        """Texts, each with its bytes and with whether it is counted in ``backlog``."""
        self.backlog = 0
        self.closing: tuple[CloseCode, str] | None = None
        self.ticket = ""
        """By which who is closed may be let in later."""

    @property
    def home(self) -> str:
        """What the client's address counts as; empty where nobody asked by one."""
        return self._who.home

    def belongs(self, link: str) -> None:
        """Says by which link the client came in."""
        self._waiting.count(self._who, -self._waits)
        self._who = replace(self._who, link=link)
        self._waiting.count(self._who, self._waits)

    def push(self, *texts: str | Long, counted: bool = True) -> None:
        """Queues control texts. ``counted`` False is for a welcome, whose size is the document's: ``limit`` does not
        bound it, and shares do."""
        if self.closing is not None:
            return
        if self._now is not None and not self._texts:
            short = [text for text in texts if isinstance(text, str)]
            if len(short) == len(texts) and self._now(short):
                return
        for text in texts:
            size = len(text) if isinstance(text, str) else len(text.head) + len(text.tail)
            full = self._waits + size > FEW_BYTES and not self._waiting.fits(self._who, size)
            if (counted and self.backlog + size > self._limit) or full:
                self.close("slow_client", SLOW)
                return
            self._texts.append((text, size, counted))
            self.backlog += size if counted else 0
            self._count(size)
        self._wake()

    def _count(self, size: int) -> None:
        self._waits += size
        self._waiting.count(self._who, size)

    def sent(self) -> None:
        """The text that was taken has left."""
        taken, self._taken = self._taken, 0
        self._count(-taken)

    def drop(self) -> None:
        """Forgets everything that waits; nothing more is sent."""
        self._texts.clear()
        self.backlog = self._taken = 0
        self._count(-self._waits)

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
        """Takes the next text to send, or None; the one that was taken before has left by then."""
        self.sent()
        if not self._texts:
            return None
        text, size, counted = self._texts.popleft()
        self.backlog -= size if counted else 0
        self._taken = size
        return text

    @property
    def waits(self) -> bool:
        """Whether there is text that was not taken yet."""
        return bool(self._texts)

    def notify(self) -> None:
        """Says that something outside the queue changed: tiles, a view, credit."""
        self._wake()
