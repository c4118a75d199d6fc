"""Keeping a process small while it sweeps over mapped files: pages are let go behind the sweep.

Pages of a mapped file count as memory of the process that touched them until the system wants them back, which on an
idle machine is never. Sweeps over a raster therefore go in strips and let go what they have done with. Nothing is
lost: the pages stay in the system's cache or go to disk, and come back when they are touched again.
"""

from __future__ import annotations

import mmap
from collections.abc import Callable
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from esker.patchwork.jit import bands, spread

STRIP_BYTES: Final = 1 << 24
"""Bytes of an array that one thread sweeps before it lets go of them."""


def let_go(array: NDArray[Any], start: int = 0, stop: int | None = None) -> None:
    """Takes rows start..stop of a mapped file out of this process's memory.

    An array that is no such file is left alone, and so is one that is mapped copy-on-write: what was written to it is
    nowhere else.
    """
    holder = _mapping(array)
    if holder is None or not hasattr(mmap, "MADV_DONTNEED"):
        return
    rows = array[start:stop]
    if rows.size == 0 or not array.flags.c_contiguous:
        return
    first = np.frombuffer(holder, np.uint8, 1).__array_interface__["data"][0]
    at = rows.__array_interface__["data"][0] - first
    low, high = at // mmap.PAGESIZE * mmap.PAGESIZE, -(-(at + rows.nbytes) // mmap.PAGESIZE) * mmap.PAGESIZE
    holder.madvise(mmap.MADV_DONTNEED, low, min(high, len(holder)) - low)


def _mapping(array: NDArray[Any]) -> mmap.mmap | None:
    """The map of a file that an array is a view of."""
    holder: Any = array
    while holder is not None and not isinstance(holder, np.memmap):
        holder = getattr(holder, "base", None)
    if holder is None or holder.mode == "c":
        return None
    while isinstance(holder, np.memmap) and isinstance(holder.base, np.memmap):
        holder = holder.base
    found = getattr(holder, "_mmap", None)
    return found if isinstance(found, mmap.mmap) else None


def mapped(array: NDArray[Any]) -> bool:
    """Returns whether an array is a view of a mapped file that rows can be let go of."""
    return _mapping(array) is not None


def strip_rows(array: NDArray[Any]) -> int:
    """Rows of a mapped array that one thread should sweep before it lets go of them."""
    row_bytes = int(array.shape[1]) * array.itemsize
    return max(1, min(STRIP_BYTES // row_bytes, bands(len(array))[0][1]))


def sweep(work: Callable[[int, int], None], array: NDArray[Any], least: int = 1, group: int = 1) -> None:
    """``jit.spread`` over the rows of an array, in groups of ``group``; those of a mapped file are let go of.

    ``work(start, stop)`` gets numbers of groups, ``least`` of them at least unless there are fewer.
    """
    count = -(-len(array) // group)

    def one(start: int, stop: int) -> None:
        work(start, stop)
        let_go(array, group * start, group * stop)

    if mapped(array):
        step = max(least, strip_rows(array) // group)
        spread(one, [(start, min(start + step, count)) for start in range(0, count, step)])
    else:
        spread(work, bands(count, least))
