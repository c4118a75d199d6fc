"""Threads that yield to others: those in which a CPU device computes (DESIGN 8).

With all cores a preview takes half the time, but the event loop, the tiles, and a browser on the same machine must not
wait for it. So a device's threads have a lower priority than the thread that opens it, and get what is left.
"""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Final

NICE: Final = 3
"""Half of the time of a thread of ordinary priority where both want the same core: enough to be preempted at once."""
_TASKS: Final = Path("/proc/self/task")


def can_yield() -> bool:
    """Returns whether threads have priorities of their own here: on Linux."""
    return sys.platform == "linux" and _TASKS.is_dir() and hasattr(os, "setpriority")


@contextmanager
def yielding() -> Iterator[None]:
    """Threads that a library starts inside yield to the caller's; Python's own, and those that were there, do not."""
    before = _tasks()
    yield
    known = {thread.native_id for thread in threading.enumerate()}
    for task in _tasks() - before - known:
        with suppress(OSError):  # the thread has ended already
            os.setpriority(os.PRIO_PROCESS, task, min(19, os.getpriority(os.PRIO_PROCESS, 0) + NICE))


def yield_to_others() -> None:
    """Makes the calling thread yield to others, as ``yielding`` does those of a library, where a system can."""
    if can_yield():
        with suppress(OSError):
            task = threading.get_native_id()
            os.setpriority(os.PRIO_PROCESS, task, min(19, os.getpriority(os.PRIO_PROCESS, task) + NICE))


def _tasks() -> set[int]:
    try:
        return {int(task.name) for task in _TASKS.iterdir()}
    except OSError:
        return set()
