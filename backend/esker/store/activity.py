"""The history of terrains in pages, newest first, out of the journal (docs/decisions/0021-history.md)."""

from __future__ import annotations

import threading
from bisect import bisect_right
from collections import OrderedDict
from collections.abc import Iterator
from dataclasses import replace
from typing import Final, NamedTuple

from esker import contract as c
from esker.document.history.activity import ActivityLog, Entry, JournalEntry
from esker.store import timestamps
from esker.store.journal import Journal

OPEN_TERRAINS: Final = 8
"""Terrains whose entries are kept in memory."""
READ_AT_ONCE: Final = 2_000
"""Ops that are taken from the journal in one piece."""


class Page(NamedTuple):
    """Entries by their last clock, newest first. ``more``: there are earlier ones; ``first``: the clock after which the
    list begins, 0 for the terrain's birth; ``clock``: the newest clock that was read; ``people``: authors by client."""

    entries: tuple[Entry, ...]
    more: bool
    first: int
    clock: int
    people: dict[str, timestamps.Person]


class ActivityLogs:
    """Reads histories. Safe from any thread; the first read of a long journal may take a second."""

    def __init__(self, journal: Journal, reach: int = c.MAX_HISTORY_OPS) -> None:
        """``reach``: ops that a list goes back; it may grow to twice as many while it is kept in memory."""
        self._journal, self._reach = journal, reach
        self._lock = threading.Lock()
        self._open: OrderedDict[str, tuple[threading.Lock, list[ActivityLog]]] = OrderedDict()

    def page(self, terrain: str, before: int | None, limit: int) -> Page:
        """At most ``limit`` entries whose last clock lies before ``before`` (None: the newest)."""
        with self._lock:
            lock, held = self._open.setdefault(terrain, (threading.Lock(), []))
            self._open.move_to_end(terrain)
            while len(self._open) > OPEN_TERRAINS:
                self._open.popitem(last=False)
        with lock:
            activity_log = self._follow(terrain, held)
            entries = sorted(activity_log.entries, key=lambda entry: entry.last)
            end = len(entries) if before is None else bisect_right(entries, before - 1, key=lambda entry: entry.last)
            start = max(0, end - limit)
            # Entries grow while ops come, so a page shows how they are now.
            page = tuple(replace(entry, of=None, steps=[]) for entry in reversed(entries[start:end]))
            people = {
                client: timestamps.Person(client, name, "") for client, name in activity_log.names.items()
            } | timestamps.read_people(self._journal.reader(), terrain)
            authors = {entry.author for entry in page}
            known = {client: person for client, person in people.items() if client in authors}
            return Page(page, start > 0, activity_log.first, activity_log.clock, known)

    def _follow(self, terrain: str, held: list[ActivityLog]) -> ActivityLog:
        newest = self._journal.newest(terrain)
        if not held or newest - held[0].first > 2 * self._reach:
            held[:] = [self._begin(terrain, newest)]
        activity_log = held[0]
        activity_log.add(self._entries(terrain, activity_log.clock, newest))
        return activity_log

    def _begin(self, terrain: str, newest: int) -> ActivityLog:
        start = max(0, newest - self._reach)
        born = self._journal.document(terrain, 0) if start == 0 else None
        return ActivityLog(None if born is None else born.to_document(), start)

    def _entries(self, terrain: str, after: int, upto: int) -> Iterator[JournalEntry]:
        known = timestamps.read_timestamps(self._journal.reader(), terrain, after, upto)
        clocks = [clock for clock, _ in known]
        for start in range(after, upto, READ_AT_ONCE):
            for row in self._journal.rows(terrain, start, min(upto, start + READ_AT_ONCE)):
                i = bisect_right(clocks, row.clock)
                yield JournalEntry(row.clock, row.author, row.op, known[i - 1][1] if i else None)
