"""One pass over all samples: what their range is, which values stand apart, and a coarse picture."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from esker.importing.source import Piece, Source

PREVIEW: Final = 32
EXTREMES: Final = 4
"""How many of the lowest and of the highest distinct values are kept."""


@dataclass(eq=False)
class Scan:
    """What is known of a grid's raw samples. ``lows`` ascend, ``highs`` descend: (value, count)."""

    rows: int
    cols: int
    valid: int = 0
    infinite: int = 0
    border_zeros: int = 0
    lows: list[tuple[float, int]] = field(default_factory=list)
    highs: list[tuple[float, int]] = field(default_factory=list)
    steps: float = 0.0
    """Sum of |difference| between neighbours along rows: how rough it is."""
    sums: NDArray[np.float64] = field(default_factory=lambda: np.zeros((PREVIEW, PREVIEW)))
    counts: NDArray[np.int64] = field(default_factory=lambda: np.zeros((PREVIEW, PREVIEW), np.int64))

    @property
    def low(self) -> float:
        """Lowest valid raw sample; NaN without any."""
        return self.lows[0][0] if self.lows else float("nan")

    @property
    def high(self) -> float:
        """Highest valid raw sample; NaN without any."""
        return self.highs[0][0] if self.highs else float("nan")

    @property
    def share(self) -> float:
        """Share of samples that are valid."""
        return self.valid / (self.rows * self.cols)

    def picture(self) -> NDArray[np.float64]:
        """Means (32, 32) of parts of the grid, raw, in the file's order of rows; NaN where there is none."""
        with np.errstate(invalid="ignore"):
            mean = np.where(self.counts > 0, self.sums / np.maximum(self.counts, 1), np.nan)
        return mean[np.ix_(_filled(self.rows), _filled(self.cols))]


def _filled(count: int) -> NDArray[np.intp]:
    """For each part of the picture the one that has samples: its own, or in small grids that of the nearest sample."""
    parts = np.arange(PREVIEW)
    return parts if count >= PREVIEW else (parts * count // PREVIEW) * PREVIEW // count


def usable(piece: Piece, masked: tuple[float, ...]) -> NDArray[np.bool_]:
    """Samples of a piece (rows, cols) that count: declared valid, finite, and none of the values taken for nodata."""
    good = piece.valid & np.isfinite(piece.values)
    for value in masked:
        good &= piece.values != value
    return good


def scan(source: Source, masked: tuple[float, ...], progress: Callable[[float], None]) -> Scan:
    """Reads everything once. ``masked``: raw values to leave out. Raises ImportRefused when the data are broken."""
    found = Scan(source.rows, source.cols)
    total = source.rows * source.cols
    done = 0
    for piece in source.pieces():
        _add(found, piece, usable(piece, masked))
        done += piece.values.size
        progress(done / total)
    return found


def _add(found: Scan, piece: Piece, good: NDArray[np.bool_]) -> None:
    found.infinite += int(np.count_nonzero(np.isinf(piece.values) & piece.valid))
    valid = piece.values[good]
    found.valid += valid.size
    found.lows = _merge(found.lows, _extremes(valid, 1.0), 1.0)
    found.highs = _merge(found.highs, _extremes(valid, -1.0), -1.0)
    zero = good & (piece.values == 0.0)
    height, width = piece.values.shape
    if piece.row == 0:
        found.border_zeros += int(zero[0].sum())
    if piece.row + height == found.rows:
        found.border_zeros += int(zero[-1].sum())
    if piece.col == 0:
        found.border_zeros += int(zero[:, 0].sum())
    if piece.col + width == found.cols:
        found.border_zeros += int(zero[:, -1].sum())
    values = np.where(good, piece.values, 0.0)
    found.steps += float(np.abs(np.diff(values, axis=1))[good[:, 1:] & good[:, :-1]].sum())
    row_part = np.arange(piece.row, piece.row + height) * PREVIEW // found.rows
    col_part = np.arange(piece.col, piece.col + width) * PREVIEW // found.cols
    rows, row_starts = np.unique(row_part, return_index=True)
    cols, col_starts = np.unique(col_part, return_index=True)
    for target, part in ((found.sums, values), (found.counts, good.astype(np.int64))):
        target[np.ix_(rows, cols)] += np.add.reduceat(np.add.reduceat(part, row_starts, 0), col_starts, 1)


def _extremes(values: NDArray[np.float64], sign: float) -> list[tuple[float, int]]:
    found: list[tuple[float, int]] = []
    while values.size and len(found) < EXTREMES:
        value = values.min() if sign > 0 else values.max()
        same = values == value
        found.append((float(value), int(same.sum())))
        values = values[~same]
    return found


def _merge(a: list[tuple[float, int]], b: list[tuple[float, int]], sign: float) -> list[tuple[float, int]]:
    counts: dict[float, int] = {}
    for value, count in (*a, *b):
        counts[value] = counts.get(value, 0) + count
    return sorted(counts.items(), key=lambda item: sign * item[0])[:EXTREMES]
