"""The flat tables that the rasteriser reads: fields, constants, windows of bins (DESIGN 5.2, 5.4, 5.5).

The ground is cut into bins of 16 x 16 samples, aligned to sample 0 of the level. Per row of bins the tables list the
strokes that can reach it, and which of its bins. Horizontal lengths are in cells of the level, heights in metres,
coordinates those of the whole level.

There are two kinds of crests. A *profile* is straight in plan and varies in height: its heights are knots, and
octaves of ever smoother heights. An *outline* is level and curved in plan: segments, among which the rasteriser finds
the few that can be nearest to a bin.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from esker import grid
from esker.contract import CREST_STIFFNESS, SPRING_CELLS, SPRING_FULL_FRACTION

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
Ints = NDArray[np.int32]
BinBox = tuple[int, int, int, int]
"""Rows by0 .. by1 - 1 and columns bx0 .. bx1 - 1 of bins: (by0, by1, bx0, bx1)."""

BIN = 16
"""Samples along one side of a bin: one float16 vector wide."""
RASTER_BINS = 1000
"""Bins rasterised at a stretch: a quarter of a level with 1025 x 1025 samples. All of it at once takes up to 400 ms
where sixty strokes meet in a bin, and others wait for it."""
LANES = 16
"""Segment tables are padded per stroke to a multiple of this with copies of the last segment."""
CREST_HALF_WIDTH = 0.71
"""Samples nearer than this many cells to a crest line are crest: never a gap, at any angle."""
SPRING_FLOOR_CELLS = 8.0
"""A spring is never stiffer than that of a band this wide."""
CHANNEL_FLOOR_CELLS = 1.5
"""Where a band or a brush is narrower, the other channels are known to this distance from the line."""
NEAR_SHARE = 1 / 80
"""Strokes are weighed by the square of their distance; nearer to its crest than this share of its width one has most of
the say. A length on the ground, so that every level sees the same crossing."""
NEAR_FLOOR = 2.0
"""The length that NEAR gives is at least so many 1,024ths of the domain, or cells of a level coarser than 4: a narrower
notch would turn into beads."""
OVERLAP_STIFFENING = 200.0
"""Where strokes want different heights the springs are up to this many times stiffer: the mean of their gradients is
not the gradient of their mean height there, and a crest would stand out of the ground sample by sample."""
OVERLAP_STIFFEST = 8.0
"""... but no more than by this: coarse levels, whose springs saturate, could not follow."""
PINNED = -2.0
"""Stiffness that marks a sample of a pinned border; like all that are negative it means a fixed sample."""
PINNED_STIFFNESS = 1e6
"""Stiffness of a pinned sample on coarse levels: as good as fixed."""
LINE_STIFFNESS = 64.0
"""Stiffness, on a coarse level, of a crest that runs along one of its lines of samples, and so lies exactly there.
Saturating springs would let the ground slip by half a cell, again on every coarser level, until corrections are more
than twice too large. (As stiff as a pinned border, the end of such a line would make the cycle diverge.)"""
FIRM_STIFFNESS = 2.0
"""From this stiffness on, springs in a row count as a crest, too, if nothing as stiff lies beside them."""
AGREEMENT = 1e-3
"""Variance of the wanted heights, as a share of their mean square, below which strokes count as agreeing."""
AGREEMENT_NOISE = 1e-5
"""The part of it that is rounding: a stroke alone agrees with itself exactly."""
PAIRS_EDITION = 3
"""From this edition of a terrain on the variance of the wanted heights comes from the differences of pairs of strokes:
float32 loses that of high ground when it takes it from sums of squares. A stroke with less than AGREEMENT of the weight
counts less, as far as it has hardly any. And a plateau is one where its crest has no height, too."""
TOE = 1.3
"""A band still tells the gradient beyond its end, fading out at this multiple of its width: nothing overshoots."""
EXIT_SHARE = 0.25
"""Where a band ends above the base the gradient leaves as if this share of the height there decayed over the reach:
more, and the ground beyond sinks below the base; less, and a step shows."""
YIELDING_SAY = 1e-6
"""Weight of a stroke that yields wholly: less than that of others but in the last tenth of a band; more than a skirt's,
so that the stroke still leads its own flanks."""
COURSE_SAY = 1e3
"""How many times the weight of other strokes a course has: a bed or a road leads through the flanks that it crosses."""
SKIRT_SAY = 1e4
"""From PAIRS_EDITION on a skirt has so many times more weight than before: another's band leads until a hundredth of
its width is left, not a thousandth, of which float32 knows too few digits."""
SKIRT_YIELDS = 1 / 3
"""From PAIRS_EDITION on a skirt yields by this power of what its stroke does: else it would lead where another's
band has a ten-thousandth of its width left, and rounding decides how much that is."""
FULL_SAY = 1 / 64
"""Around the end of a stroke with one flank less and less of this is present; below this share it has less say beside
other strokes, by the third power, so that none is left where rounding decides whether there is any."""
SKIRT_SLOPE = 0.7
"""Where a band ends so high that screening would break the ground off, a skirt leads down at first with the flank's
own slope or this one, whichever is steeper."""
HELD_FRACTION = 0.93
"""Up to this share of a band screening pulls to the profile instead of the base, then fades to the base at its end."""
SOFT_PART = 0.5
"""Share of the crest height that the round part of a concave foot or a convex shoulder takes."""
FLATTEST = 1e-9
"""Slopes below this count as this: the width of a band is height / slope."""
THINNEST_M = 1e-3
"""Bands narrower than this are as wide as this, so that the tip of a stroke is no special case."""
NO_LENGTH_M = 1e-15
"""From PAIRS_EDITION on so near to a plateau is on it: squares of shorter lengths are 0 in float32."""
LOWEST_M = 1e-3
"""Crests lower than this have narrower bands, by the third power: else a flank without slope would be as wide as its
extent, or not there, by how the height of a crest at the base is rounded."""
HALF_DIAGONAL = math.hypot(BIN - 1, BIN - 1) / 2
"""From the middle of a bin to its corners, cells."""
LONGEST_CELLS = 1024.0
"""Longer segments are cut, so that float32 places every crest point to a small part of a quantum at any level."""
EDGE_CELLS = 1 / 64
EDGE_SHARE = 1 / 8192
"""Over so many cells, or this share of its width, beyond its end a band's gradient becomes that beyond it: rounding
does not say on which side of the end a sample is."""
STOPS = {1: 1e30, 2: 1 / EDGE_CELLS, 3: 1 / EDGE_CELLS}
"""By the terrain's edition how many slopes along a crest end in a cell past its ends: in the first at once, so that a
sample at the end had it or not by how the length was rounded."""
BALANCE_M = 1 / 16
"""A stroke goes over from filling to cutting while its crest sinks by so much below the base."""
STEEPEST = 60.0
"""Slopes along a crest count as this at most: drawn lines have upright parts."""
FIRST_OCTAVE = 1 / 1024
"""Distance of the controls of the first octave of smoothed heights, as a share of the domain."""
FAN = 2.0
"""Octave o is what is seen from 2^o - 1 times this many first controls away from the plateau: more, and the teeth of a
drawn silhouette run farther down the flank; less, and flanks are made of rubber."""
OCTAVE_SHARE = 1 / 8
"""The controls of the last octave are at most this share of the crest's length apart: its shape at large stays."""

SEGMENT_FIELDS = ("ax", "ay", "dx", "dy", "il2", "t0x", "t0y", "t1x", "t1y", "cap0", "cap1", "z", "rise")
KNOT_FIELDS = ("t", "z", "slope")
STROKE_FIELDS = (
    *("plateau", "reach", "lh", "ls", "le", "lk", "lf", "rh", "rs", "re", "rk", "rf", "same", "run"),
    *("height", "ax", "ay", "tx", "ty", "length", "value", "brush", "fill", "cut", "say", "plateau2", "crest2"),
    *("middle", "stop", "skirt", "lb", "rb"),
)
STROKE_STRIDE = len(STROKE_FIELDS)
INDEX_FIELDS = ("first", "count", "spans", "octave", "octaves")
INDEX_STRIDE = len(INDEX_FIELDS)
ITEM_STRIDE = 3
STROKE_AT = {name: k for k, name in enumerate(STROKE_FIELDS)}
INDEX_AT = {name: k for k, name in enumerate(INDEX_FIELDS)}


@dataclass(frozen=True)
class Tables:
    """The constraints of one level, packed. Arrays are float32 and int32: kernels and twins read the same numbers.

    segments: (13, m) by SEGMENT_FIELDS, of outlines. a: start; d: end - start; il2: 1 / length^2; t0, t1: unit
      directions of travel at the ends; cap: 1 where the line ends there; z: height of the start, rise: how much higher
      the end is, 0 but of a course.
    knots: (3, q) by KNOT_FIELDS, of profiles: distance from the crest's start, height, slope per cell up to the next.
    pieces: (c, 4) cubics of the octaves: height a0 + a1 f + a2 f^2 + a3 f^3 at the share f of a piece; octaves: (o,)
      per profile and octave the place in ``pieces`` of piece 0 (which may lie outside the window's part).
    strokes: (k, STROKE_STRIDE) by STROKE_FIELDS. plateau, reach in cells (reach: outermost distance with any effect);
      per side h: 1 if there is a flank, s: slope (tangent), e: extent in metres, k and f: shares of the crest height
      taken by a round shoulder and a round foot; same: 1 if both sides are alike, then run: 1 / slope; height: of the
      first point of an outline; a, t, length: start, unit direction and length of a profile in plan. In tables of a
      channel other than heights, value: what the stroke asks of it, as a difference from its base; brush: radius of
      paint in cells, or 0.
      fill, cut: how far bands raise ground below the crest and lower ground above it, 0..1; read over a base only.
      say: weight beside other strokes, 1 but where it yields.
      middle: from where the pieces of a profile's octaves count, cells from its start; stop: over 1 / stop of a cell
      past its ends its slope along the crest ends (of an outline, too); skirt: how many times the weight of the first
      edition a skirt has; lb, rb: widths in cells of the banks of a course, where no spring holds the ground and the
      diffusion leads to its line.
      plateau2, crest2: squares of the distances up to which a sample is plateau, and crest: what is decided is decided
      alike in every precision.
    index: (k, INDEX_STRIDE) by INDEX_FIELDS: first segment or knot, number of them, start in span_index or -1, start in
      ``octaves``, number of octaves or -1 for an outline.
    row_start, row_items: by row of bins of ``box`` (CSR), per stroke (stroke, first bin, end of bins). span_index,
      spans: inside intervals of closed outlines per sample row of ``box`` (CSR within the stroke), in cells.
    box: the bins that the tables speak of; all of the level's, or a window.
    edition: of the rules (contract.CURRENT_EDITION).
    """

    level: int
    size_m: float
    box: BinBox
    segments: Singles
    knots: Singles
    pieces: Singles
    octaves: Ints
    strokes: Singles
    index: Ints
    row_start: Ints
    row_items: Ints
    span_index: Ints
    spans: Singles
    reach_m: float | None
    exit_length_m: float
    pinned: bool
    edition: int

    @property
    def samples(self) -> int:
        return grid.samples(self.level)

    @property
    def spacing_m(self) -> float:
        return grid.spacing(self.level, self.size_m)

    @property
    def screening(self) -> float:
        """Weight of the screening term at this level (DESIGN 5.1)."""
        return 0.0 if self.reach_m is None else (self.spacing_m / self.reach_m) ** 2

    @property
    def octave_m(self) -> float:
        """Metres between the controls of the first octave."""
        return self.size_m * FIRST_OCTAVE

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
        "CHANNEL_FLOOR_CELLS": CHANNEL_FLOOR_CELLS,
        "NEAR_SHARE": NEAR_SHARE,
        "NEAR_FLOOR": NEAR_FLOOR,
        "OVERLAP_STIFFENING": OVERLAP_STIFFENING,
        "OVERLAP_STIFFEST": OVERLAP_STIFFEST,
        "PINNED": PINNED,
        "PINNED_STIFFNESS": PINNED_STIFFNESS,
        "LINE_STIFFNESS": LINE_STIFFNESS,
        "FIRM_STIFFNESS": FIRM_STIFFNESS,
        "AGREEMENT": AGREEMENT,
        "AGREEMENT_NOISE": AGREEMENT_NOISE,
        "PAIRS_EDITION": PAIRS_EDITION,
        "TOE": TOE,
        "HELD_FRACTION": HELD_FRACTION,
        "EXIT_SHARE": EXIT_SHARE,
        "SKIRT_SLOPE": SKIRT_SLOPE,
        "FULL_SAY": FULL_SAY,
        "LOWEST_M": LOWEST_M,
        "NO_LENGTH_M": NO_LENGTH_M,
        "EDGE_CELLS": EDGE_CELLS,
        "EDGE_SHARE": EDGE_SHARE,
        "BALANCE_M": BALANCE_M,
        "HALF_DIAGONAL": HALF_DIAGONAL,
        "THINNEST_M": THINNEST_M,
        "STEEPEST": STEEPEST,
        "FAN": FAN,
        "STROKE_STRIDE": STROKE_STRIDE,
        "INDEX_STRIDE": INDEX_STRIDE,
        "ITEM_STRIDE": ITEM_STRIDE,
        "CREST_STIFFNESS": CREST_STIFFNESS,
        "SPRING_CELLS": SPRING_CELLS,
        "SPRING_FULL_FRACTION": SPRING_FULL_FRACTION,
        **{f"P_{name.upper()}": k for name, k in STROKE_AT.items()},
        **{f"I_{name.upper()}": k for name, k in INDEX_AT.items()},
    }


@dataclass(frozen=True)
class Window:
    """Bins: of row ``first + j`` the columns spans[j, 0] .. spans[j, 1] - 1. ``spans`` (rows, 2) int32."""

    first: int
    spans: Ints

    @cached_property
    def bounds(self) -> tuple[int, int, int, int]:
        """Rows and columns of bins (first, end, first, end) around all that are in it."""
        left, right = self.spans.T
        used = right > left
        columns = (int(left[used].min()), int(right[used].max())) if used.any() else (0, 0)
        return self.first, self.first + len(self.spans), *columns

    @property
    def sample_rows(self) -> tuple[int, int]:
        """Sample rows that the bins cover, half open; may run past the last row."""
        return self.first * BIN, (self.first + len(self.spans)) * BIN

    @property
    def width(self) -> int:
        """Most bins of a row."""
        return int((self.spans[:, 1] - self.spans[:, 0]).max(initial=0))

    def bands(self, bins: int) -> Iterator[Window]:
        """Yields the bins in bands of whole rows with about ``bins`` of them at most, for work that may be left."""
        rows = max(1, bins // max(1, self.width))
        for row in range(0, len(self.spans), rows):
            yield Window(self.first + row, self.spans[row : row + rows])

    def within(self, other: Window) -> Window | None:
        """The bins that both hold; None if there are none."""
        first = max(self.first, other.first)
        last = min(self.first + len(self.spans), other.first + len(other.spans))
        a, b = (w.spans[first - w.first : max(last, first) - w.first] for w in (self, other))
        left = np.maximum(a[:, 0], b[:, 0])
        spans = np.column_stack([left, np.maximum(np.minimum(a[:, 1], b[:, 1]), left)])
        return Window(first, spans) if (spans[:, 1] > spans[:, 0]).any() else None


def everything(box: BinBox) -> Window:
    """All bins of a box."""
    by0, by1, bx0, bx1 = box
    return Window(by0, np.tile(np.array([bx0, bx1], dtype=np.int32), (by1 - by0, 1)))


def union(windows: list[Window]) -> Window | None:
    """The least window that holds all of these; None of none."""
    windows = [w for w in windows if len(w.spans)]
    if not windows:
        return None
    first, last = min(w.first for w in windows), max(w.first + len(w.spans) for w in windows)
    low = np.full(last - first, 1 << 30, dtype=np.int32)
    high = np.zeros(last - first, dtype=np.int32)
    for w in windows:
        rows = slice(w.first - first, w.first - first + len(w.spans))
        used = w.spans[:, 1] > w.spans[:, 0]
        low[rows] = np.where(used, np.minimum(low[rows], w.spans[:, 0]), low[rows])
        high[rows] = np.where(used, np.maximum(high[rows], w.spans[:, 1]), high[rows])
    return Window(first, np.column_stack([np.minimum(low, high), high]))
