"""The flat tables that the rasteriser reads: fields, constants, windows of bins (DESIGN 5.2, 5.5).

The ground is cut into bins of 16 x 16 samples, aligned to sample 0 of the level. Per row of bins the tables list the
strokes that can reach it; the rasteriser finds for itself, per bin, the few segments of a stroke that can be nearest.
Horizontal lengths are in cells of the level, heights in metres, coordinates those of the whole level.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from esker import grid
from esker.contract import CREST_STIFFNESS, SPRING_CELLS, SPRING_FULL_FRACTION

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
BinBox = tuple[int, int, int, int]
"""Rows by0 .. by1 - 1 and columns bx0 .. bx1 - 1 of bins: (by0, by1, bx0, bx1)."""

BIN = 16
"""Samples along one side of a bin: one float16 vector wide."""
LANES = 16
"""Segment tables are padded per stroke to a multiple of this with copies of the last segment."""
CREST_HALF_WIDTH = 0.71
"""Samples nearer than this many cells to a crest line are crest: never a gap, at any angle."""
SPRING_FLOOR_CELLS = 8.0
"""A spring is never stiffer than that of a band this wide."""
TOE = 1.3
"""Beyond its end a band still tells the gradient, fading out at this multiple of its width: nothing overshoots."""
EXIT_SHARE = 0.25
"""Where a band ends above the base the gradient leaves as if this share of the height there decayed over the reach:
more, and the ground beyond sinks below the base; less, and a step shows."""
HELD_FRACTION = 0.93
"""Up to this share of a band screening pulls to the profile instead of the base, then fades to the base at its end."""
SOFT_PART = 0.5
"""Share of the crest height that the round part of a concave foot or a convex shoulder takes."""
FLATTEST = 1e-9
"""Slopes below this count as this: the width of a band is height / slope."""
HALF_DIAGONAL = math.hypot(BIN - 1, BIN - 1) / 2
"""From the middle of a bin to its corners, cells."""
LONGEST_CELLS = 1024.0
"""Longer segments are cut, so that float32 places every crest point to a small part of a quantum at any level."""
THINNEST_M = 1e-3
"""Bands narrower than this are as wide as this, so that the tip of a stroke is no special case."""

SEGMENT_FIELDS = (
    *("ax", "ay", "az", "dx", "dy", "dz", "il2", "t0x", "t0y", "t1x", "t1y", "cap0", "cap1"),
    *("s0x", "s0y", "s1x", "s1y"),
)
STROKE_FIELDS = ("plateau", "xmin", "xmax", "reach", "lh", "ls", "le", "lk", "lf", "rh", "rs", "re", "rk", "rf")
STROKE_STRIDE = 16
INDEX_FIELDS = ("first", "count", "spans")
INDEX_STRIDE = 4


@dataclass(frozen=True)
class Tables:
    """The constraints of one level, packed.

    segments: (17, m) by SEGMENT_FIELDS. a: start; d: end - start; il2: 1 / plan length^2, or 0 for a point; t0, t1:
      unit directions of travel at the ends; cap: 1 where the line ends there; s0, s1: slope of the crest at the ends
      as a vector, metres a cell, the mean of the two segments that meet (0 at a cap).
    strokes: (k, 16) by STROKE_FIELDS. plateau, xmin, xmax, reach in cells (reach: outermost distance with any
      effect); per side h: 1 if there is a flank, s: slope (tangent), e: extent in metres, k and f: shares of the
      crest height taken by a round shoulder and a round foot.
    index: (k, 4) by INDEX_FIELDS: first segment, number of segments, start in span_index or -1.
    row_start, row_items: strokes by row of bins of ``box`` (CSR). span_index, spans: inside intervals of closed
      outlines per sample row of ``box`` (CSR within the stroke), in cells.
    box: the bins that the tables speak of; all of the level's, or a window.
    """

    level: int
    size_m: float
    box: BinBox
    segments: Floats
    strokes: Floats
    index: Ints
    row_start: Ints
    row_items: Ints
    span_index: Ints
    spans: Floats
    screening: float
    exit_length_m: float
    pinned: bool

    @property
    def samples(self) -> int:
        return grid.samples(self.level)

    @property
    def spacing_m(self) -> float:
        return grid.spacing(self.level, self.size_m)

    @property
    def origin(self) -> tuple[int, int]:
        """(row, column) of the first sample of the box."""
        return self.box[0] * BIN, self.box[2] * BIN

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns) of samples in the box; bins at the level's border stick out of it."""
        by0, by1, bx0, bx1 = self.box
        return min(by1 * BIN, self.samples) - by0 * BIN, min(bx1 * BIN, self.samples) - bx0 * BIN

    @property
    def empty(self) -> bool:
        return len(self.index) == 0


def bins(samples: int) -> int:
    """Bins along one side."""
    return -(-samples // BIN)


def whole(level: int) -> BinBox:
    """All bins of a level."""
    count = bins(grid.samples(level))
    return 0, count, 0, count


def defines() -> dict[str, float | int]:
    """The constants that the OpenCL twin is compiled with."""
    return {
        "BIN": BIN,
        "CREST_HALF_WIDTH": CREST_HALF_WIDTH,
        "SPRING_FLOOR_CELLS": SPRING_FLOOR_CELLS,
        "TOE": TOE,
        "HELD_FRACTION": HELD_FRACTION,
        "EXIT_SHARE": EXIT_SHARE,
        "HALF_DIAGONAL": HALF_DIAGONAL,
        "THINNEST_M": THINNEST_M,
        "STROKE_STRIDE": STROKE_STRIDE,
        "INDEX_STRIDE": INDEX_STRIDE,
        "CREST_STIFFNESS": CREST_STIFFNESS,
        "SPRING_CELLS": SPRING_CELLS,
        "SPRING_FULL_FRACTION": SPRING_FULL_FRACTION,
    }


@dataclass(frozen=True)
class Window:
    """Bins: of row ``first + j`` the columns spans[j, 0] .. spans[j, 1] - 1. ``spans`` (rows, 2) int32."""

    first: int
    spans: Ints

    @property
    def sample_rows(self) -> tuple[int, int]:
        """Sample rows that the bins cover, half open; may run past the last row."""
        return self.first * BIN, (self.first + len(self.spans)) * BIN

    @property
    def width(self) -> int:
        """Most bins of a row."""
        return int((self.spans[:, 1] - self.spans[:, 0]).max(initial=0))


def everything(box: BinBox) -> Window:
    """All bins of a box."""
    by0, by1, bx0, bx1 = box
    return Window(by0, np.tile(np.array([bx0, bx1], dtype=np.int32), (by1 - by0, 1)))
