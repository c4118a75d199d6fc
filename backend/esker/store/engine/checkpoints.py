"""Checkpoints of SQLite's write-ahead log, in a thread of their own.

A checkpoint copies what the log holds into the database file and syncs that, so whoever's commit began one waited for
both. SQLite lets commits go on beside a passive checkpoint, and begins the log anew once all of it was copied.
"""

from __future__ import annotations

import logging
import sqlite3
import threading
from typing import Final

log = logging.getLogger("esker.store")

EVERY: Final = 100
"""Commits from one checkpoint to the next: some 500 pages while people draw."""
WRITERS_PAGES: Final = 2_000
"""Pages of the log at which the writer makes a checkpoint itself: where commits are large, or leave no gap in which all
of the log is copied."""


class Checkpoints:
    """Makes a checkpoint now and then. Call it from the writer's thread."""

    def __init__(self, db: sqlite3.Connection) -> None:
        """``db``: a connection that nobody else uses; it is closed with this."""
        self._db = db
        self._commits = 0
        self._due, self._closed = threading.Event(), False
        self._thread = threading.Thread(target=self._run, name="checkpoints", daemon=True)
        self._thread.start()

    def committed(self) -> None:
        """Counts a commit."""
        self._commits += 1
        if self._commits >= EVERY:
            self._commits = 0
            self._due.set()

    def close(self) -> None:
        """Ends the thread once a checkpoint that it makes is done."""
        self._closed = True
        self._due.set()
        self._thread.join()
        self._db.close()

    def _run(self) -> None:
        while self._due.wait() and not self._closed:
            self._due.clear()
            try:
                self._db.execute("PRAGMA wal_checkpoint(PASSIVE)").fetchone()
            except sqlite3.Error as error:  # a full disk, or one that fails: commits say so themselves
                log.warning("a checkpoint failed: %s", error)
