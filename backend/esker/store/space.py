"""How much of its disk a server may use: the one place that looks (docs/decisions/0032-disk.md).

Everything that writes what a stranger sends, or what a stranger asks for, asks here first. ``FLOOR_BYTES`` stay free on
the file system, and half of that for people's own operations: a disk that imports and exports have filled up to the
floor can still be drawn on.
"""

from __future__ import annotations

import errno
import logging
import os
import shutil
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

log = logging.getLogger("esker.space")

FLOOR_BYTES: Final = 1 << 30
FLOOR_SHARE: Final = 0.05
"""The floor is this share of the disk where that is less than FLOOR_BYTES."""
LOOK_SECONDS: Final = 1.0
MEASURE_SECONDS: Final = 60.0
"""A folder with a quota is measured anew after so many seconds; in between, what was asked for is added up."""


class NoSpace(OSError):
    """There is no room for this; nothing was written. The HTTP face answers 507 (``server/routes/answers.py``)."""

    def __init__(self, message: str) -> None:
        super().__init__(errno.ENOSPC, message)


class Space:
    """The disk under a server's folder. Safe from any thread."""

    def __init__(
        self,
        folder: Path,
        quota: int = 0,
        floor: int | None = None,
        *,
        now: Callable[[], float] = time.monotonic,
        usage: Callable[[Path], tuple[int, int, int]] = shutil.disk_usage,
    ) -> None:
        """``quota``: bytes that the folder may take in all; 0: what the disk has above the floor.

        ``floor``: bytes that stay free (default: FLOOR_BYTES, or FLOOR_SHARE of a small disk). ``usage``: total, used
        and free bytes of the file system of a folder. Raises OSError.
        """
        self._folder, self._quota, self._now, self._usage = folder, quota, now, usage
        self._lock = threading.Lock()
        total, _, self._free = usage(folder)
        self.floor = min(FLOOR_BYTES, int(total * FLOOR_SHARE)) if floor is None else floor
        self._looked = now()
        self._used, self._measured = 0, float("-inf")
        self._said = float("-inf")

    def need(self, more: int = 0, *, drawing: bool = False) -> None:
        """Asks for room for ``more`` bytes. ``drawing``: for people's operations, which may use half of the floor.

        Raises NoSpace when they are not to be had.
        """
        with self._lock:
            now = self._now()
            if now - self._looked >= LOOK_SECONDS:
                self._free, self._looked = self._usage(self._folder)[2], now
            self._free -= more
            floor = self.floor // 2 if drawing else self.floor
            enough = self._free >= floor and self._within_quota(more, now)
            if not enough:
                self._free += more
                if now - self._said >= MEASURE_SECONDS:
                    self._said = now
                    log.error("%s: %d MiB are free, %d MiB stay free", self._folder, self._free >> 20, floor >> 20)
        if not enough:
            raise NoSpace("the disk of the server has no room for more")

    @property
    def free(self) -> int:
        """Bytes that are free on the file system now."""
        return self._usage(self._folder)[2]

    @property
    def low(self) -> bool:
        """Whether nothing large would be taken now."""
        return self.free < self.floor

    def _within_quota(self, more: int, now: float) -> bool:
        if not self._quota:
            return True
        if now - self._measured >= MEASURE_SECONDS:
            self._used, self._measured = _size(self._folder), now
        if self._used + more > self._quota:
            return False
        self._used += more
        return True


def _size(folder: Path) -> int:
    """Bytes of all files below a folder; files of several names count once."""
    seen: dict[tuple[int, int], int] = {}
    for parent, _, names in os.walk(folder):
        for name in names:
            try:
                found = os.lstat(os.path.join(parent, name))
            except OSError:
                continue
            seen[found.st_dev, found.st_ino] = found.st_size
    return sum(seen.values())
