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
    confirmed as they are. FILL: only adds tiles (the view moved); says nothing of the others.
    """

    LEVEL = 0
    FILL = 1


class Predictor(IntEnum):
    """What a tile's residual adds to: nothing; the parent; the tile as held, moved along with its parent; as held."""

    ZERO = 0
    PARENT = 1
    PREVIOUS = 2
    HELD = 3


class Filter(IntEnum):
    """How a tile's residual was made smaller before it was coded: what is left of a sample after taking away ...

    NONE: nothing. ROW: the one to its west; in the first column the one to its south. PLANE: west + south - south-west.
    What lies outside the tile is zero.
    """

    NONE = 0
    ROW = 1
    PLANE = 2


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
"""Starts a binary frame: then ``drops`` x TILE_DROP, then ``tiles`` x (TILE_HEADER, payload of ``bytes`` bytes).
flags bit 0: the level is final (settled) for this clock."""
FRAME_SETTLED: Final = 1

TILE_DROP: Final = np.dtype([("x", "<u2"), ("y", "<u2")])
"""A tile of this level that the client must forget: its content changed and is not being sent."""

TILE_HEADER: Final = np.dtype(
    [
        ("x", "<u2"),
        ("y", "<u2"),
        ("predictor", "u1"),
        ("planes", "u1"),
        ("filter", "u1"),
        ("reserved", "u1"),
        ("version", "<u4"),
        ("base_version", "<u4"),
        ("bytes", "<u4"),
    ]
)
"""``version``: of this tile; ``base_version``: of the parent (or previous) tile that it was predicted from;
``planes``: byte planes before deflate (0..4; 0: no residual and no payload). Bounds and errors of the 16-cell
sub-patches follow from the samples and the parent, both of which the decoder holds, so they do not travel
(docs/decisions/0003-derived-bounds.md)."""
