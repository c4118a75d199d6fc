"""A protocol of what a room needs from the store. Tests stand in for it."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Future
from typing import Protocol

from esker import contract as c
from esker.store.journal import Loaded, Row
from esker.store.timestamps import Person


class Journal(Protocol):
    """The part of ``store.journal.Journal`` that a room uses."""

    def append(
        self,
        terrain: str,
        rows: Sequence[Row],
        snapshot: c.Document | None = None,
        people: Sequence[Person] = (),
    ) -> Future[None]: ...

    def keep_lesson(self, terrain: str, state: str) -> Future[None]: ...

    def first_by(self, terrain: str, clients: Sequence[str]) -> int | None: ...

    def find(self, terrain: str, client: str, counter: int) -> int | None: ...

    def newest(self, terrain: str) -> int: ...

    def load(self, terrain: str, upto: int | None = None) -> Loaded | None: ...

    def steps(self, terrain: str, after: int, upto: int | None = None) -> list[Row]: ...
