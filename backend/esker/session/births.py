"""New terrains of a server: compressed in a thread, written one after another, each address in its turn (decision 61).

The document of a new terrain is one row of the database, and the changes of everybody who draws wait for the commit
that writes it. What one address may have written in this way has a rate in bytes: a copy of a heavy terrain costs
whoever asks for it a few bytes, and the server as many as the terrain has.
"""

from __future__ import annotations

import asyncio
import secrets
import time
from collections.abc import Callable
from typing import Any, Final

from esker import contract as c
from esker.document.wire import Compressed
from esker.errors import Cannot
from esker.fairness.shares import Rate, Rates, Who
from esker.fairness.turns import SERVER, FairThreads, Turns
from esker.store.journal import Journal

MEGA: Final = 1 << 20
BORN: Final = Rate(MEGA, 256 * MEGA)
"""Characters of new documents by address: a class of forty comes in at once on a terrain of six megabytes."""
ALL_BORN: Final = Rate(8 * MEGA, 1024 * MEGA)
WAITING: Final = 100
"""New terrains of one address that may wait for their turn."""
TOO_MUCH: Final = "Much was brought in from your address just now. Wait a minute."


class Births:
    """Writes new terrains. Lives in the event loop."""

    def __init__(self, journal: Journal, reading: FairThreads, now: Callable[[], float] = time.monotonic) -> None:
        """``reading``: the threads that documents are compressed in."""
        self._journal, self._reading, self._now = journal, reading, now
        self._turns = Turns(1, waiting=WAITING)
        self.rates = Rates(BORN, total=ALL_BORN)

    async def write(
        self,
        born: c.Document,
        also: Callable[[Any], Any] | None = None,
        who: Who = SERVER,
        by: str | None = None,
        kept: Compressed | None = None,
    ) -> None:
        """Writes a new terrain with what ``also`` writes into the database, or neither. ``by``: the terrain whose rows
        ``also`` writes beside those of the new one. ``kept``: its document, where it was compressed before.

        Raises Cannot (429), shares.Full, store.journal.Unwritable, and what ``also`` raises.
        """
        if who == SERVER:  # what the server makes for itself is empty, and waits for nobody
            await asyncio.wrap_future(self._journal.create(born, also, by))
            return
        if kept is None:
            kept = await self.compressed(born, who)
        else:
            self._count(kept, who)
        async with self._turns.turn(who):
            await asyncio.wrap_future(self._journal.create(born, also, by, kept))

    async def compressed(self, document: c.Document, who: Who) -> Compressed:
        """A document as it is to be written; it counts for ``who``. Raises Cannot (429), shares.Full."""
        kept = await self._reading.run(who, Compressed.of, document)
        self._count(kept, who)
        return kept

    def _count(self, kept: Compressed, who: Who) -> None:
        if not self.rates.take(Who(who.address), self._now(), kept.characters):
            raise Cannot(429, "rate_limited", TOO_MUCH)


def born_as(document: c.Document) -> c.Document:
    """The document of a terrain that begins as ``document``, under an id of its own."""
    return document.model_copy(update={"id": fresh_id(), "clock": 0})


def fresh_id() -> str:
    """Returns an id that no terrain has: 72 random bits. It may stand in a command, so it begins with no dash."""
    while (made := secrets.token_urlsafe(9)).startswith("-"):
        pass
    return made
