"""Sums of the strokes that stay, kept by bin while a stroke is drawn (docs/decisions/0043-kept-sums.md).

What a sample gets is concluded from sums over strokes, added in the order of their ids. While one stroke changes, the
sums of all before it stay: they are kept, and a bin goes on from there. The same numbers are added in the same order,
so the bits are those of a full raster.
"""

from __future__ import annotations

from bisect import bisect_left
from typing import Any, Final, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from esker.solve.constraints.tables import BIN, Window

MOST_BINS: Final = 1024
"""Bins whose sums a workspace keeps, 13 KiB each: a stroke of a kilometre at level 4 reaches half as many."""
LEAST_STROKES: Final = 4
"""Sums are kept only where so many strokes come before the one that changes: with fewer there is nothing to gain."""
BETWEEN: Final = 3
"""Strokes between those that are kept and the one that changes, before sums are made anew: where several people draw,
now this stroke changes and now that."""
SUMS: Final = 13
"""Numbers of a sample, float32; one more over a base (``sums_t`` of shaders/opencl/nearest.cl)."""
NO_STROKE: Final = 0x7FFFFFFF
"""First stroke to go on with of a raster that keeps nothing."""


class Kept(NamedTuple):
    """Arguments of the kernel. first: the strokes of the tables from here on are not in the sums; slots: int32, by bin
    of the window, k + 1 where sums are kept in slot k, -k - 1 where they are to be, 0 where they are not; sums: buffer.
    """

    first: int
    slots: Any
    sums: Any


class Changes(Protocol):
    """Facts that ``constraints.Packer`` gives of its last set.

    earliest: least id of a stroke that changed, None where no sums of before can be kept; order: ids of the strokes of
    the tables, ascending.
    """

    @property
    def earliest(self) -> str | None: ...
    @property
    def order(self) -> list[str]: ...


class Memory(Protocol):
    """A queue: what makes buffers."""

    def raw(self, size: int) -> Any: ...
    def constant(self, array: NDArray[Any]) -> Any: ...


class KeptSums:
    """The sums that one workspace keeps. ``side``: bins along a side of its finest level."""

    def __init__(self, side: int, based: bool) -> None:
        self._bytes = 4 * BIN * BIN * (SUMS + int(based))
        self._slots = np.zeros((side, side), dtype=np.int32)
        self._used = self._most = 0
        self._until: str | None = None
        self._buffer: Any = None

    @property
    def bytes(self) -> int:
        """Memory of the sums that are kept, or were since the buffer was made."""
        return self._most * self._bytes

    def clear(self) -> None:
        """Lets the sums go."""
        self._slots[:] = 0
        self._used = self._most = 0
        self._until = self._buffer = None

    def plan(self, memory: Memory, changes: Changes, window: Window) -> Kept | None:
        """Returns the sums to keep, and those to go on from, in the bins of a window that is rasterised next; None: all
        strokes are summed anew.

        ``memory``: makes buffers on the device.
        """
        until = self._bound(changes)
        if until != self._until:
            self._slots[:] = 0
            self._used, self._until = 0, until
        first = 0 if until is None else bisect_left(changes.order, until)
        if first < LEAST_STROKES:
            return None
        if self._buffer is None:
            self._buffer = memory.raw(MOST_BINS * self._bytes)
        return Kept(first, memory.constant(self._codes(window)), self._buffer)

    def _bound(self, changes: Changes) -> str | None:
        """The id below which strokes are in the sums: that of the first that changes, or one shortly before it."""
        earliest, until = changes.earliest, self._until
        if earliest is None or until is None or earliest < until:
            return earliest
        between = bisect_left(changes.order, earliest) - bisect_left(changes.order, until)
        return until if between <= BETWEEN else earliest

    def _codes(self, window: Window) -> NDArray[np.int32]:
        """(rows, width) int32, see ``Kept``; from now on the sums of these bins are there."""
        codes = np.zeros((len(window.spans), window.width), dtype=np.int32)
        for row, (left, right) in enumerate(window.spans):
            known = self._slots[window.first + row, left:right]
            fresh = np.flatnonzero(known == 0)[: MOST_BINS - self._used]
            codes[row, : len(known)] = known
            known[fresh] = np.arange(self._used + 1, self._used + len(fresh) + 1)
            codes[row, fresh] = -known[fresh]
            self._used += len(fresh)
        self._most = max(self._most, self._used)
        return codes
