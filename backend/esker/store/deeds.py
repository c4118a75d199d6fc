"""What one person did to a terrain, out of its journal (``document/takeback.py``)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from esker.document.former import read_op
from esker.document.history.folding import SILENT, UNLIMITED, silent
from esker.document.ops import StrokeSet
from esker.document.takeback import Deeds
from esker.store.journal import Row


class Source(Protocol):
    """The part of ``store.journal.Journal`` that is read here."""

    def first_by(self, terrain: str, clients: Sequence[str]) -> int | None: ...

    def document(self, terrain: str, upto: int | None = None) -> StrokeSet | None: ...

    def steps(self, terrain: str, after: int, upto: int | None = None) -> list[Row]: ...


def read_deeds(journal: Source, terrain: str, clients: Sequence[str]) -> Deeds:
    """What these clients did, up to the last op in the journal. Raises DamagedTerrain.

    It replays everything since the first of it, so it is for a thread of its own.
    """
    deeds = Deeds(clients)
    first = journal.first_by(terrain, clients)
    document = None if first is None else journal.document(terrain, first - 1)
    if document is None:
        return deeds
    for row in journal.steps(terrain, document.clock):
        if row.op == SILENT:
            document = silent(document)
            continue
        op = read_op(row.op)
        before = document
        document, _ = before.apply(op, UNLIMITED)
        deeds.note(row.author, op, before, document)
    return deeds
