"""What a workspace keeps while another one works with its memory (docs/decisions/0057-parked-workspaces.md).

Of the fields of a solve most can be made again from a few: the constraints of coarser levels from those of the finest,
the right-hand side of the heights from the gradient. What cannot be made again is copied to the host, whole buffers as
they are, and back to the bit.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from esker.solve.opencl.queue import Queue

SPARE_BYTES: Final = 32 << 20
"""Host memory of workspaces that came back which is kept for those that are parked next: new memory costs a page fault
for every four kilobytes, as much time as the copy itself."""


LIGHT: Final = 4.0
"""Strokes of a bin, on average, up to which they are rasterised again rather than their constraints copied: it takes
about as long, and holds nothing."""


@dataclass(frozen=True)
class Saved:
    """Buffers by name that a workspace saves, of its kind always the same ones in the same order.

    constraints: of the finest level; ground: the solution of the finest level; progress: what a solve that is under way
    needs besides.
    """

    constraints: Sequence[Any]
    ground: Sequence[Any]
    progress: Sequence[Any]


@dataclass
class Parked:
    """The copies. constraints are empty where they are to be made again; ground and progress are None where a workspace
    had none that counts, or where ``at_rest`` has it.

    at_rest: heights and gradient of the finest level as they were given out, which other holders share.
    """

    constraints: list[NDArray[np.uint8]]
    ground: list[NDArray[np.uint8]] | None = None
    progress: list[NDArray[np.uint8]] | None = None
    at_rest: tuple[NDArray[np.float32], NDArray[np.float32]] | None = None

    @property
    def bytes(self) -> int:
        """Host memory of the copies. What is shared with others is not counted."""
        return sum(copy.nbytes for copy in self._copies())

    def _copies(self) -> Iterator[NDArray[np.uint8]]:
        for part in (self.constraints, self.ground, self.progress):
            yield from part or ()

    def released(self, spares: Spares) -> None:
        """Gives the memory of the copies back: they are not needed any more."""
        for copy in self._copies():
            spares.give(copy)


class Spares:
    """Host memory for copies, kept from one parking to the next."""

    def __init__(self) -> None:
        self._free: dict[int, list[NDArray[np.uint8]]] = {}
        self.bytes = 0

    def take(self, size: int) -> NDArray[np.uint8]:
        """Memory of so many bytes, with anything in it."""
        free = self._free.get(size)
        if not free:
            return np.empty(size, dtype=np.uint8)
        self.bytes -= size
        return free.pop()

    def give(self, memory: NDArray[np.uint8]) -> None:
        """Keeps it for the next, as far as SPARE_BYTES go."""
        if self.bytes + memory.nbytes <= SPARE_BYTES:
            self._free.setdefault(memory.nbytes, []).append(memory)
            self.bytes += memory.nbytes

    def clear(self) -> None:
        """Lets all of it go."""
        self._free.clear()
        self.bytes = 0


def copied(queue: Queue, buffers: Iterable[Any], spares: Spares) -> list[NDArray[np.uint8]]:
    """The contents of some buffers, once all that was enqueued before is done."""
    found = []
    for buffer in buffers:
        found.append(spares.take(buffer.size))
        queue.cl.enqueue_copy(queue.queue, found[-1], buffer)
    return found


def restored(queue: Queue, copies: Sequence[NDArray[np.uint8]], buffers: Sequence[Any]) -> None:
    """Copies back to the buffers that they are of."""
    for copy, buffer in zip(copies, buffers, strict=True):
        queue.cl.enqueue_copy(queue.queue, buffer, copy)
