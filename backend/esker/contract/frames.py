"""Binary frames: kinds, predictors, channels and headers (DESIGN 6)."""

from __future__ import annotations

from enum import IntEnum
from typing import Final

import numpy as np

# --- binary frames (DESIGN 6) -----------------------------------------------------------------------------------

FRAME_MAGIC: Final = 0x4B53  # "SK" on the wire


class FrameKind(IntEnum):
    """What a binary frame means for the tiles of its level that it does not carry.

    LEVEL: the level is complete for this clock; held tiles of the level that are neither carried nor dropped are
    confirmed as they are. FILL: only adds tiles (the view moved); says nothing of the others. RIVERS: no tiles, but all
    rivers of the terrain; they replace those of before (see RIVER_UNITS_PER_CELL).
    """

    LEVEL = 0
    FILL = 1
    RIVERS = 2


class Predictor(IntEnum):
    """What a tile's residual adds to: nothing; the parent; the tile as held, moved along with its parent; as held."""

    ZERO = 0
    PARENT = 1
    PREVIOUS = 2
    HELD = 3


class Filter(IntEnum):
    """How a tile's residual was made smaller before it was coded: what is left of a sample after taking away ...

    NONE: nothing. ROW: the one to its west; in the first column the one to its south. PLANE: west + south - south-west.
    LATTICE: what LATTICE_WEIGHTS expect of samples between those of the parent. What lies outside the tile is zero.
    """

    NONE = 0
    ROW = 1
    PLANE = 2
    LATTICE = 3


class Channel(IntEnum):
    HEIGHT = 0
    AMPLITUDE = 1
    ROUGHNESS = 2
    SNOW = 3
    GRASS = 4
    FOREST = 5
    WETNESS = 6
    BASE = 7
    """The elevation layers' ground, in the quanta of heights: what is drawn is HEIGHT + BASE."""
    SURVEY = 8
    """Level whose spacing is that of the finest elevation data here; detail begins below it."""
    EROSION = 9
    """What is painted of gullies."""
    FAR = 10
    """Distance from what strokes fix, as a share of ``fractal.FAR_SHARE`` of the domain's side, 1 beyond."""


FRAME_HEADER: Final = np.dtype(
    [
        ("magic", "<u2"),
        ("protocol", "u1"),
        ("kind", "u1"),
        ("level", "u1"),
        ("channel", "u1"),
        ("flags", "<u2"),
        ("clock", "<u4"),
        ("tiles", "<u2"),
        ("drops", "<u2"),
    ]
)
"""Starts a binary frame: then ``drops`` x TILE_DROP, then ``tiles`` tiles (see TILE_MAX_SHIFT).
flags bit 0: the level is final (settled) for this clock."""
FRAME_SETTLED: Final = 1

TILE_DROP: Final = np.dtype([("x", "<u2"), ("y", "<u2")])
"""A tile of this level that the client must forget: its content changed and is not being sent."""

TILE_PREDICTOR_BITS: Final = 2
TILE_FILTER_BITS: Final = 2
TILE_MAX_SHIFT: Final = 15
"""A tile in a frame is, with numbers as LEB128, differences zig-zag: x; y; predictor, filter and shift, lowest bits
first; ``version`` of the tile, and ``base_version`` of the parent or previous tile that it was predicted from, as
differences to those of the tile before in the frame (0 at first); bytes of the payload; payload. Residuals are 2^shift
times what is coded; no payload: no residual. Bounds and errors of the 16-cell sub-patches follow from the samples and
the parent, both of which the decoder holds, so they do not travel (docs/decisions/0003-derived-bounds.md)."""

RIVER_UNITS_PER_CELL: Final = 4
"""A frame of rivers has FRAME_HEADER, with their level, the document's clock, and how many there are in ``tiles``; then
for each, with numbers as LEB128 and differences zig-zag: how many points, at least 2; x and y of the first, in these
parts of a cell of the level; RIVER_AREA_STEPS times the binary logarithm of the area in m2 that drains through its
head, zig-zag, and how much more at its end; which river it runs into, counted from itself, 0 for none; then the
differences of x and y from point to point. A river comes before the one that it runs into. There are no heights:
whoever draws has the ground."""
RIVER_AREA_STEPS: Final = 8
MAX_RIVER_BYTES: Final = 32 << 10
"""A frame of rivers is no larger: where all would not fit there are fewer, the largest."""

TILE_SAMPLE_LIMIT: Final = 1 << 28
"""Samples are within +-2^28 quanta, so that a residual always fits 32 bits."""

CODER_SIZES: Final = 32
"""Classes of neighbouring magnitudes: two an octave."""
CODER_PLACES: Final = 5
"""Any residual; and of a lattice: on a sample of the parent, between two of a row, of a column, between four."""
CODER_NODES: Final = 48
"""Decisions in a context: 0 zero or not, 1 sign, 2 to 32 one more in the exponent, 36 to 47 the second highest bit."""
CODER_MAX_EXPONENT: Final = 31
CODER_LIMIT: Final = 1 << 32
"""Residuals are below this."""
CODER_MAX_BYTES: Final = 1 << 18
"""More than any tile takes: 4,225 times 35 decisions of at most 11 bits, and 30 bits, are 219 KB."""
CODER_SURE: Final = 32
"""No decision is held for more certain than this share of 65,536."""
CODER_SLOWEST: Final = 255
"""Decisions after which a probability goes on learning at the same rate."""

LATTICE_CLASSES: Final = 20
"""Classes of the size of the residuals around, of which each has weights; larger ones take those of the last."""
LATTICE_WEIGHTS: Final = (
    "18 0 0 0 0 0 0 -2 -9 0 0 15 0 0 0 0 -4 0 0 -1 0 0 3 8 0 0 -1 -1 -1 0 "
    "19 0 -2 13 0 2 0 -2 -8 1 0 16 0 3 1 2 -4 0 0 -1 0 0 1 5 1 0 0 -1 -2 3 "
    "0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 "
    "22 0 -4 11 3 4 -1 -2 -9 0 0 16 -2 3 1 1 -4 0 0 -2 0 0 -4 6 -2 0 4 2 -3 4 "
    "20 11 -2 13 2 3 1 -5 -13 1 11 16 -3 4 3 1 -4 1 -1 -2 17 11 -5 7 -4 -2 0 1 -2 2 "
    "26 18 -9 8 -2 7 1 -5 -11 1 23 24 -8 4 7 -1 -7 1 -1 -1 28 21 -12 6 0 0 -1 1 -3 1 "
    "32 29 -16 -1 -3 3 2 -2 -9 1 28 30 -15 3 5 -2 -2 2 0 3 35 28 -15 3 -5 -2 3 2 -2 2 "
    "34 41 -24 -14 -3 -1 3 5 3 2 39 28 -28 3 2 -3 0 3 -1 1 52 45 -34 -3 -9 -5 6 5 -2 1 "
    "29 52 -29 -24 -6 -8 4 4 1 2 47 34 -36 2 -3 -4 2 4 -1 0 62 56 -41 -10 -9 -9 6 7 0 2 "
    "34 58 -35 -27 -7 -13 5 6 3 3 57 28 -43 1 -10 -4 4 5 -1 1 66 58 -42 -5 -10 -9 8 8 0 2 "
    "28 60 -37 -29 -7 -14 6 10 4 2 59 30 -46 1 -11 -4 9 5 -1 7 68 60 -37 -12 -9 -9 8 7 1 2 "
    "26 67 -42 -31 -7 -18 7 9 1 2 67 29 -50 2 -18 -4 12 6 -1 -5 70 65 -44 -12 -11 -10 9 8 2 2 "
    "29 67 -42 -32 -6 -18 7 10 1 2 67 38 -51 1 -17 -5 -1 7 -1 6 68 68 -38 -18 -9 -12 8 10 3 2 "
    "26 64 -42 -30 -6 -15 7 11 4 2 63 46 -46 1 -18 -5 -1 6 -1 -1 67 65 -40 -11 -10 -11 8 8 2 1 "
    "35 59 -41 -27 -8 -11 8 13 1 1 58 25 -38 1 -15 -6 35 6 -2 -18 66 61 -41 -15 -11 -10 8 8 1 1 "
    "20 53 -34 -25 -10 -7 6 0 0 1 46 68 -23 4 -11 -7 27 3 -2 12 65 58 -14 1 -12 -9 8 7 0 -1 "
    "52 37 -20 -16 -10 -8 2 2 -12 -2 37 55 -15 6 -10 -7 54 1 -3 25 59 49 -21 3 -11 -8 5 5 0 -1 "
    "33 29 -15 -13 -11 -5 1 -16 -2 -1 31 50 -15 6 -4 -8 40 2 -4 -28 53 38 18 75 -10 -8 1 5 -2 -2 "
    "37 25 -15 -13 -12 -2 2 -7 -19 0 30 4 -22 6 1 -7 96 3 -5 -61 50 33 7 -89 -12 -6 2 3 -4 -2 "
    "10 27 -17 -14 -14 -1 3 33 13 1 30 -16 -25 4 4 -8 -87 4 -3 -27 51 36 27 127 -11 -6 2 4 -4 0"
)
"""In 64ths, per class, for a sample between two of a row of the parent, two of a column, between four: what is expected
of its residual from those to the west, south, south-west, south-east, west twice, south twice, and at a knight's move:
west twice south, south twice west, south twice east, east twice south (docs/decisions/0022-entropy-coding.md)."""
