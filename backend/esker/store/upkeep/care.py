"""What a server does for its data beside serving: copies, folding, and the end of what nobody needs any more.

All that a server leaves on its disk has a bound and an owner, here or where it is made; docs/security.md lists them.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

from esker.store.engine.made import Made
from esker.store.grids import GridStore
from esker.store.journal import Journal
from esker.store.upkeep.compaction import Compaction
from esker.store.upkeep.deletion import Deletion
from esker.store.upkeep.inspection import DATABASE_NAME

log = logging.getLogger("esker.care")

CARE_SECONDS: Final = 3600.0
FULL_SECONDS: Final = 60.0
"""A terrain whose history is full is folded this soon, and not more often."""
STOP_SECONDS: Final = 60.0


def sweep_parts(data: Path) -> None:
    """Removes what a killed restore or a killed preview left half written. Call it before anything is opened."""
    parts = (*data.glob(f"{DATABASE_NAME}.part*"), *(data / "previews").glob("*.part"))
    for path in (*parts, data / "private.new"):
        if path.exists():
            log.info("removing %s, which was left half written", path)
            path.unlink(missing_ok=True)


class Care:
    """Copies the database at the start and every hour, then folds and removes what is old, in its own thread."""

    def __init__(
        self,
        journal: Journal,
        deletion: Deletion,
        grids: GridStore,
        *,
        made: Made | None = None,
        seconds: float = CARE_SECONDS,
        full_seconds: float = FULL_SECONDS,
    ) -> None:
        """``made``: what servers made for all of them."""
        self._made = Made() if made is None else made
        self._journal, self._deletion, self._grids = journal, deletion, grids
        self._seconds, self._full_seconds = seconds, full_seconds
        self._compaction = Compaction(journal, pause=self._pause)
        self._stopped, self._wake = threading.Event(), threading.Event()
        self._full: set[str] = set()
        self._thread = threading.Thread(target=self._run, name="care", daemon=True)
        journal.hear_of_full = self._hear

    def start(self) -> None:
        """Begins."""
        self._thread.start()

    def stop(self) -> None:
        """Ends; what is under way comes to its end, or is left at the next stretch."""
        self._stopped.set()
        self._wake.set()
        if self._thread.is_alive():
            self._thread.join(timeout=STOP_SECONDS)

    def round(self) -> None:
        """All of it once. What fails is logged and does not keep the rest from being done."""
        for work, failure in (
            (self._journal.backup, "the backup failed"),
            (self._remove, "deleted terrains could not be removed"),
            (self._fold, "old histories could not be folded"),
            (self._sweep, "forgotten grids could not be removed"),
            (self._made.throw_old, "old exports and pictures could not be removed"),
        ):
            if not self._stopped.is_set():
                _do(work, failure)

    def _run(self) -> None:
        while True:
            began = time.monotonic()
            self.round()
            while not self._stopped.is_set() and (rest := began + self._seconds - time.monotonic()) > 0:
                if self._wake.wait(rest) and not self._stopped.wait(self._full_seconds):
                    self._wake.clear()
                    _do(self._fold_full, "a full history could not be folded")
            if self._stopped.is_set():
                return

    def _remove(self) -> None:
        expired = self._deletion.expire().result()
        gone = self._deletion.remove_old()
        if expired or gone:
            log.info("%d terrains that nobody drew on were deleted, %d are gone for good", expired, len(gone))

    def _fold(self) -> None:
        gone = self._compaction.round(stopped=self._stopped.is_set)
        if gone:
            log.info("%d operations of old gestures were folded", gone)

    def _sweep(self) -> None:
        if self._journal.may_sweep():
            named = self._journal.grids()
            self._grids.throw_forgotten(named)
            self._grids.throw_old_objects(named)
        self._grids.empty_trash()

    def _hear(self, terrain: str) -> None:
        self._full.add(terrain)
        self._wake.set()

    def _fold_full(self) -> None:
        while self._full and not self._stopped.is_set():
            terrain = self._full.pop()
            log.info("the history of terrain %s is full: %d operations were folded", terrain,
                     self._compaction.terrain(terrain))  # fmt: skip

    def _pause(self, seconds: float) -> None:
        self._stopped.wait(seconds)


def _do(work: Callable[[], object], failure: str) -> None:
    try:
        work()
    except Exception as error:
        log.error("%s: %s", failure, error)
