"""Compiled loops of this room: where they are kept, and one way to spread them over the processors.

Loops are compiled at their first call and kept on disk, so that nothing is compiled at import nor twice on a machine.
None is compiled with numba's own ``parallel``: its thread pools must not be entered by two threads at once, and a
server does just that. Loops release the interpreter lock instead, and :func:`spread` runs bands of them in threads.
Bands write to places of their own, so that the result has the same bits for any number of threads.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Final

import numba
import numpy as np

from esker import compiled
from esker.patchwork import kept_loops
from esker.process import caches, system

__all__ = ["bands", "kernel", "processors", "read_only", "spread"]


def _keep_by_content() -> str | None:
    """Keeps compiled code in a folder that is named by what it was compiled from, and removes that of other texts.

    numba asks only whether the file of a function has changed, not those of the functions that it calls. Where the
    folder cannot be written, numba finds another place by its own rules.
    """
    kept = kept_loops.beside()
    try:
        kept.mkdir(parents=True, exist_ok=True)
        if not os.access(kept, os.W_OK):
            return None
    except OSError:
        return None
    for other in kept.parent.glob("compiled-*"):
        if other != kept:
            shutil.rmtree(other, ignore_errors=True)
    return None if caches.LOOPS in os.environ else str(kept)


_KEPT: Final = _keep_by_content()


def kernel(function: compiled.F) -> compiled.F:
    """``compiled.kernel``, kept in this room's folder. Other rooms' loops are kept beside their own files, whichever
    room was imported first."""
    before = numba.config.CACHE_DIR  # type: ignore[attr-defined]
    try:
        if _KEPT is not None:
            numba.config.CACHE_DIR = _KEPT  # type: ignore[attr-defined]
        return compiled.kernel(function)
    finally:
        numba.config.CACHE_DIR = before  # type: ignore[attr-defined]


def read_only(array: Any) -> Any:
    """A read-only base-class view: one kind of array for the compiled loops, whoever made it.

    Numba compiles a loop once more for arrays that may be written. What is kept may not be; what was just made may.
    """
    view = np.asarray(array).view(np.ndarray)
    view.flags.writeable = False
    return view


def processors() -> int:
    """Threads that :func:`spread` uses: the processors that this process may run on, 16 at most."""
    return min(16, system.processors())


def bands(count: int, least: int = 1, per_thread: int = 4) -> list[tuple[int, int]]:
    """Ranges that cover 0..count, of at least ``least``, some for each thread so that uneven ones even out."""
    if count <= 0:
        return []
    step = max(least, -(-count // (processors() * per_thread)))
    return [(start, min(start + step, count)) for start in range(0, count, step)]


def spread(work: Callable[[int, int], None], ranges: Iterable[tuple[int, int]]) -> None:
    """Call ``work(start, stop)`` for every range, in threads. Raises what the first failing call raised."""
    ranges = list(ranges)
    if len(ranges) < 2 or processors() < 2:
        for start, stop in ranges:
            work(start, stop)
        return
    with ThreadPoolExecutor(processors(), thread_name_prefix="patchwork") as pool:
        for done in [pool.submit(work, start, stop) for start, stop in ranges]:
            done.result()
