"""Rasterised constraints kept between steps of refinement (DESIGN 5.5, 5.6).

Windows overlap by their halos, and most strokes stay as they are from one settled solve to the next: so what the
rasteriser found is kept by squares of bins, under a digest of the strokes that reach the square. Which bins were kept
does not change a bit of the result, as a bin's constraints do not depend on the window in which it is rasterised.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from esker import grid
from esker.solve.constraints.tables import BIN, BinBox, Window, bins

BLOCK_BINS: Final = 8
BLOCK: Final = BLOCK_BINS * BIN
"""Samples along a side of what is kept or dropped together."""
FIELDS: Final = 5
"""Stiffness and right-hand side of the heights, stiffness and both right-hand sides of the gradient; over a base two
more, the share of the gradient that is the ground's own and what is wanted above the base."""
BLOCK_BYTES: Final = 4 * FIELDS * BLOCK**2
CACHE_BYTES: Final = 64 << 20

Digest = Callable[[int, BinBox], bytes]
"""(level, bins) to a digest of all that decides the constraints of these bins."""


@dataclass
class Block:
    """Constraints of BLOCK_BINS x BLOCK_BINS bins, and which of them are known."""

    data: NDArray[np.float32]
    known: NDArray[np.bool_] = field(default_factory=lambda: np.zeros((BLOCK_BINS, BLOCK_BINS), dtype=bool))


@dataclass(frozen=True)
class Part:
    """Where a block and a window overlap: bins (row, column) first .. last - 1 of each."""

    block: Block
    first: tuple[int, int]
    last: tuple[int, int]
    at: tuple[int, int]

    @property
    def here(self) -> tuple[slice, slice]:
        """The overlap in the block, bins."""
        return slice(self.first[0], self.last[0]), slice(self.first[1], self.last[1])

    @property
    def there(self) -> tuple[slice, slice]:
        """The overlap in the window, bins."""
        rows, columns = self.last[0] - self.first[0], self.last[1] - self.first[1]
        return slice(self.at[0], self.at[0] + rows), slice(self.at[1], self.at[1] + columns)


class BinCache:
    """The blocks of all levels and strokes, least recently used dropped first."""

    def __init__(self, bytes_: int = CACHE_BYTES) -> None:
        self.most = max(1, bytes_ // BLOCK_BYTES)
        self._held: OrderedDict[tuple[int, int, int, bytes], Block] = OrderedDict()
        self._spare: list[NDArray[np.float32]] = []
        """Memory of blocks that were dropped: fresh memory costs more than filling it."""

    def __len__(self) -> int:
        return len(self._held)

    def parts(self, level: int, box: BinBox, digest: Digest, fields: int = FIELDS) -> list[Part]:
        """The blocks that hold the bins of ``box``, new ones where there were none."""
        return list(self._parts(level, box, digest, fields))

    def trim(self) -> None:
        """Drop what is too much; not while parts of a window are in use."""
        while len(self._held) > self.most:
            self._spare.append(self._held.popitem(last=False)[1].data)

    def clear(self) -> None:
        """Drop everything."""
        self._held.clear()
        self._spare.clear()

    def _memory(self, fields: int) -> NDArray[np.float32]:
        """Samples of a new block, of any value."""
        while self._spare:
            found = self._spare.pop()
            if len(found) == fields:
                return found
        return np.empty((fields, BLOCK, BLOCK), dtype=np.float32)

    def _parts(self, level: int, box: BinBox, digest: Digest, fields: int) -> Iterator[Part]:
        by0, by1, bx0, bx1 = box
        count = bins(grid.samples(level))
        for sy in range(by0 // BLOCK_BINS, (by1 - 1) // BLOCK_BINS + 1):
            for sx in range(bx0 // BLOCK_BINS, (bx1 - 1) // BLOCK_BINS + 1):
                y, x = sy * BLOCK_BINS, sx * BLOCK_BINS
                whole = y, min(y + BLOCK_BINS, count), x, min(x + BLOCK_BINS, count)
                key = level, sy, sx, digest(level, whole)
                if key not in self._held:
                    self._held[key] = Block(self._memory(fields))
                block = self._held[key]
                self._held.move_to_end(key)
                first = max(by0 - y, 0), max(bx0 - x, 0)
                last = min(by1 - y, BLOCK_BINS), min(bx1 - x, BLOCK_BINS)
                yield Part(block, first, last, (y + first[0] - by0, x + first[1] - bx0))


def missing(parts: list[Part], box: BinBox) -> Window:
    """Per row of bins of ``box`` the span that holds all bins that no block knows."""
    by0, by1, bx0, bx1 = box
    known = np.zeros((by1 - by0, bx1 - bx0), dtype=bool)
    for part in parts:
        known[part.there] = part.block.known[part.here]
    low = np.argmin(known, axis=1)
    high = known.shape[1] - np.argmin(known[:, ::-1], axis=1)
    spans = np.column_stack([low, np.where(known.all(axis=1), low, high)]) + bx0
    return Window(by0, spans.astype(np.int32))


def exchange(parts: list[Part], fresh: Window, box: BinBox, fields: list[NDArray[np.float32]]) -> None:
    """Completes a window whose bins of ``fresh`` have just been rasterised from its blocks, and these from the window.

    fields: views (rows, columns) of the window's samples, as many as a block has.
    """
    spans = [(int(low), int(high)) for low, high in fresh.spans - box[2]]  # arrays of two are slower than their work
    for part in parts:
        rows, columns = part.there
        row = rows.start
        while row < rows.stop:
            low, high = (min(max(v, columns.start), columns.stop) for v in spans[row])
            end = row + 1
            while end < rows.stop and spans[end] == spans[row]:
                end += 1
            for a, b in (
                (columns.start, low if high > low else columns.stop),
                (high, columns.stop if high > low else high),
            ):
                _copy(part, fields, row, end, a, b, into_window=True)
            row = end
    for part in parts:
        if not part.block.known[part.here].all():
            rows, columns = part.there
            _copy(part, fields, rows.start, rows.stop, columns.start, columns.stop, into_window=False)
            part.block.known[part.here] = True


def _copy(
    part: Part, fields: list[NDArray[np.float32]], r0: int, r1: int, c0: int, c1: int, *, into_window: bool
) -> None:
    """Bins r0 .. r1 - 1, c0 .. c1 - 1 of the window, as far as it has samples there."""
    height, width = fields[0].shape
    y0, y1, x0, x1 = r0 * BIN, min(r1 * BIN, height), c0 * BIN, min(c1 * BIN, width)
    if y0 >= y1 or x0 >= x1:
        return
    dy, dx = (part.first[0] - part.at[0]) * BIN, (part.first[1] - part.at[1]) * BIN
    for values, kept in zip(fields, part.block.data, strict=True):
        window, block = values[y0:y1, x0:x1], kept[y0 + dy : y1 + dy, x0 + dx : x1 + dx]
        if into_window:
            window[...] = block
        else:
            block[...] = window
