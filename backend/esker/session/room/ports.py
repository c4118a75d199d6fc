"""What a room needs of the store, and of other servers where there are some. Tests stand in for it."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Future
from typing import Protocol

from esker import contract as c
from esker.document.ops import StrokeSet
from esker.store.journal import Loaded, Row
from esker.store.timestamps import Person


class Journal(Protocol):
    """The part of ``store.journal.Journal`` that a room uses."""

    def append(
        self,
        terrain: str,
        rows: Sequence[Row],
        people: Sequence[Person] = (),
    ) -> Future[None]: ...

    def keep_snapshot(self, document: c.Document) -> Future[None]: ...

    def keep_lesson(self, terrain: str, state: str) -> Future[None]: ...

    def first_by(self, terrain: str, clients: Sequence[str]) -> int | None: ...

    def find(self, terrain: str, client: str, counter: int) -> int | None: ...

    def newest(self, terrain: str) -> int: ...

    def load(self, terrain: str, upto: int | None = None) -> Loaded | None: ...

    def document(self, terrain: str, upto: int | None = None) -> StrokeSet | None: ...

    def steps(self, terrain: str, after: int, upto: int | None = None) -> list[Row]: ...


class Tenancy(Protocol):
    """The terrains that this server owns, where several share a database. A server that is alone has no such list."""

    async def hold(self, terrain: str) -> None:
        """Returns when this server has a terrain. Raises EskerError where another one has it."""

    def may_acknowledge(self, terrain: str) -> bool:
        """Returns whether what is durable may be acknowledged: this server certainly has the terrain still."""


class Meter(Protocol):
    """Counts what a server does, where somebody reads the figures."""

    def acknowledged(self, seconds: float) -> None:
        """Operations were acknowledged, so long after the first of them came."""

    def framed(self, size: int) -> None:
        """A frame of tiles was taken for a socket."""
