"""Bounds on this process, from now on: memory, processor time, files. Children that read what strangers sent set them.

POSIX systems keep bounds themselves (``setrlimit``). Where a system does not, a thread of this process looks four times
a second and ends it: later than a kernel would, and only between two calls that hold the interpreter. Files are then
bounded by what calls wrote, as far as the system counts it; the number of open files is not bounded.
"""

from __future__ import annotations

import os
import sys
import threading
from dataclasses import dataclass
from typing import Final

import psutil

try:
    import resource
except ImportError:  # Windows
    resource = None  # type: ignore[assignment]

WATCH_SECONDS: Final = 0.25
KINDS: Final = {
    "memory_bytes": "RLIMIT_DATA",
    "address_bytes": "RLIMIT_AS",
    "cpu_seconds": "RLIMIT_CPU",
    "file_bytes": "RLIMIT_FSIZE",
    "open_files": "RLIMIT_NOFILE",
    "core_bytes": "RLIMIT_CORE",
}
ENDED: Final = 77
"""Exit status of a process that its own watch ended."""


@dataclass(frozen=True)
class Bounds:
    """Bounds of what a process may take. None stands for as much as there is."""

    memory_bytes: int | None = None
    """Memory of the process's own; files that it maps do not count."""
    address_bytes: int | None = None
    """Address space. Systems without limits of their own do not bound it."""
    cpu_seconds: int | None = None
    file_bytes: int | None = None
    """Most bytes of one file that the process writes."""
    open_files: int | None = None
    core_bytes: int | None = None

    def apply(self) -> None:
        """Bounds this process, by the system or by a watch. Limits that were lower stay as they were."""
        kept = {name for name in KINDS if self._limit(name)}
        if sys.platform != "linux":
            kept.discard("memory_bytes")  # macOS takes the limit and does not count what is mapped
        if missing := {name for name in ("memory_bytes", "cpu_seconds", "file_bytes") if getattr(self, name)} - kept:
            _Watch(self, frozenset(missing)).start()

    def _limit(self, name: str) -> bool:
        """Sets one limit; False where this system has none of the kind."""
        value: int | None = getattr(self, name)
        kind = getattr(resource, KINDS[name], None)
        if kind is None:
            return False
        if value is None:
            return True
        try:
            _, hard = resource.getrlimit(kind)
            value = value if hard == resource.RLIM_INFINITY else min(value, hard)
            resource.setrlimit(kind, (value, value))
        except (ValueError, OSError):  # macOS refuses RLIMIT_AS
            return False
        return True


class _Watch(threading.Thread):
    """Ends this process when it exceeds bounds that the system does not keep."""

    def __init__(self, bounds: Bounds, of: frozenset[str]) -> None:
        super().__init__(name="bounds", daemon=True)
        self._bounds, self._of, self._process = bounds, of, psutil.Process()

    def run(self) -> None:
        pause = threading.Event()
        while not pause.wait(WATCH_SECONDS):
            if any((limit := getattr(self._bounds, name)) and self._used(name) > limit for name in self._of):
                os._exit(ENDED)

    def _used(self, name: str) -> float:
        if name == "cpu_seconds":
            spent = self._process.cpu_times()
            return float(spent.user + spent.system)
        if name == "file_bytes":
            counters = getattr(self._process, "io_counters", None)
            return 0.0 if counters is None else float(counters().write_bytes)
        info = self._process.memory_info()
        return float(getattr(info, "private", info.rss - getattr(info, "shared", 0)))
