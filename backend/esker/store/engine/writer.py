"""The thread that writes, whatever the database: what waits goes into one commit."""

from __future__ import annotations

import queue
from collections.abc import Callable
from typing import Final, TypeVar

T = TypeVar("T")

BATCH_LIMIT: Final = 256
"""One commit takes so many items at most."""


def write_all(waiting: queue.SimpleQueue[T | None], commit: Callable[[list[T]], object]) -> None:
    """Has what waits committed, batch by batch, until the queue gives None.

    While this waits for the next batch it holds no earlier one, nor the rooms that heard of it.
    """
    while _write_next(waiting, commit):
        pass


def _write_next(waiting: queue.SimpleQueue[T | None], commit: Callable[[list[T]], object]) -> bool:
    """Commits what waits, once something does. Returns False when nothing is to be written after it."""
    item = waiting.get()
    if item is None:
        return False
    batch, stop = [item], False
    while len(batch) < BATCH_LIMIT:
        try:
            more = waiting.get_nowait()
        except queue.Empty:
            break
        if more is None:
            stop = True
            break
        batch.append(more)
    commit(batch)
    return not stop
