"""Carries the ops that a room ordered into the journal, a tick at a time, and says what became of them (DESIGN 4, 8).

Everything here runs in the event loop's thread; the journal's writer calls back into it.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Iterable
from concurrent.futures import Future
from typing import Final

from esker import contract as c
from esker.session.room.core import UNSAVED, Batch, RoomCore
from esker.session.room.members import Member
from esker.session.room.ports import Journal, Meter, Tenancy
from esker.store.engine.ports import Moved, Unknown, Unwritable
from esker.store.journal import HistoryFull
from esker.store.timestamps import Person

log = logging.getLogger("esker.room")

TICK: Final = c.TICK_MS / 1000
DOUBT_TICK: Final = 0.1
"""What is durable waits so long, again and again, while it is not certain whose the terrain is."""


class Commits:
    """The way of one room's ops into the journal. One batch at a time is under way."""

    def __init__(
        self,
        core: RoomCore,
        journal: Journal,
        loop: asyncio.AbstractEventLoop,
        *,
        tenancy: Tenancy | None,
        meter: Meter | None,
        taken: Callable[[], object],
        taken_back: Callable[[], object],
        lost: Callable[[], object],
    ) -> None:
        """``taken``: is called with each batch that goes to the journal; ``taken_back``: after one that could not be
        written; ``lost``: where it is not known any longer what is in the journal."""
        self._core, self._journal, self._loop = core, journal, loop
        self._tenancy, self._meter = tenancy, meter
        self._taken, self._taken_back, self._lost = taken, taken_back, lost
        self._timer: asyncio.TimerHandle | None = None
        self._taken_at = float("-inf")
        self._ordered_at: float | None = None
        """When the first op came that waits for a tick, where somebody measures."""
        self._called: dict[str, Person] = {}
        """Authors of ops as the journal knows them."""
        self._flushed = asyncio.Event()
        self._flushed.set()
        self._closed = False

    # --- batches ------------------------------------------------------------------------------------------------

    def ordered(self) -> None:
        """Has ops that were ordered committed with the next tick."""
        if self._meter is not None and self._ordered_at is None:
            self._ordered_at = self._loop.time()
        self._tick_soon()

    def _tick_soon(self) -> None:
        if self._timer is None and self._core.waiting:
            # An op that comes after a pause is committed at once (with all that is read in the same turn of the loop).
            self._timer = self._loop.call_at(max(self._loop.time(), self._taken_at + TICK), self._tick)

    def _tick(self) -> None:
        self._timer = None
        batch = self._core.take()
        if batch is None:
            return
        self._taken_at = self._loop.time()
        self._taken()
        self._flushed.clear()
        people = self._new_names(row.author for row in batch.rows)
        ordered, self._ordered_at = self._ordered_at, None
        future = self._journal.append(self._core.document.id, batch.rows, people)
        future.add_done_callback(lambda f: self._loop.call_soon_threadsafe(self._committed, batch, f, ordered))

    def _committed(self, batch: Batch, future: Future[None], ordered: float | None) -> None:
        error, terrain = future.exception(), self._core.document.id
        if self._closed:
            return  # another server may have the terrain: authors ask that one what became of this
        # Where another server can go on, people's work is not taken back: they send it again, here or there.
        is_away = self._tenancy is not None and isinstance(error, Unwritable) and not error.full
        if isinstance(error, (Moved, Unknown)) or is_away:
            log.warning("terrain %s: %s", terrain, error)
            self._lost()
            return
        if error is None and self._tenancy is not None and not self._tenancy.may_acknowledge(terrain):
            self._loop.call_later(DOUBT_TICK, self._committed, batch, future, ordered)
            return
        if error is None:
            self._core.committed(batch)
            if batch.snapshot is not None:
                self._journal.keep_snapshot(batch.snapshot)
            if self._meter is not None and ordered is not None:
                self._meter.acknowledged(self._loop.time() - ordered)
        else:
            log.error("terrain %s: a commit failed: %s", terrain, error)
            self._core.failed(f"{error} This change was taken back." if isinstance(error, HistoryFull) else UNSAVED)
            self._taken_back()
        if self._core.waiting:
            self._tick_soon()
        else:
            self._flushed.set()

    # --- names of authors ---------------------------------------------------------------------------------------

    def renamed(self, member: Member) -> None:
        """Has the new name of somebody kept whose ops have an older one."""
        if member.client in self._called and member.role != "view":
            self._journal.append(self._core.document.id, (), self._new_names((member.client,)))

    def _new_names(self, clients: Iterable[str]) -> list[Person]:
        """Returns what authors of ops are called, where the journal does not have it from this room yet."""
        here = (self._core.members.by_client.get(client) for client in dict.fromkeys(clients))
        people = [self._person(m) for m in here if m is not None]
        new = [person for person in people if self._called.get(person.client) != person]
        self._called |= {person.client: person for person in new}
        return new

    def _person(self, member: Member) -> Person:
        conducts = self._core.lesson.conducts(member)
        return Person(member.client, member.name, member.colour, member.person, conducts)

    # --- the end ------------------------------------------------------------------------------------------------

    async def flush(self) -> None:
        """Returns when every op that was ordered so far is committed or refused, or given up by ``abandon``."""
        await self._flushed.wait()
        while self._core.waiting:
            self._flushed.clear()
            self._tick_soon()
            await self._flushed.wait()

    def abandon(self) -> None:
        """Nobody waits any more for what is under way."""
        self._flushed.set()

    def close(self) -> None:
        """Takes no batch any more, and says nothing of the one that is under way."""
        self._closed = True
        if self._timer is not None:
            self._timer.cancel()
