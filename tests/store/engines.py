"""Engines under journals, for tests that look below the ports."""

from __future__ import annotations

from pathlib import Path

from esker.store.engine.sqlite import Sqlite
from esker.store.journal import Journal


def sqlite(journal: Journal) -> Sqlite:
    """The engine of a journal that lies in a folder."""
    assert isinstance(journal.engine, Sqlite)
    return journal.engine


def copied(journal: Journal) -> Path:
    """A copy of such a journal."""
    made = journal.backup()
    assert made is not None
    return made
