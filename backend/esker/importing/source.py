"""What every elevation file looks like to the rest of this room: a stream of pieces of raw samples."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from esker import contract as c
from esker.importing.placement.georef import Georef
from esker.importing.refusal import ImportRefused

PIECE_SAMPLES: Final = 1 << 20
"""Samples that are looked at in one go: 8 MiB of float64."""
MAX_BLOCK_BYTES: Final = 256 << 20
"""Largest block (tile, strip) of a file that is decoded: it must lie in memory whole."""


@dataclass(frozen=True, eq=False)
class Piece:
    """A part of a grid as the file has it: ``values`` float64 (h, w) raw samples from [row, col] on; ``valid`` bool
    (h, w): false where the file itself declares that there is no data."""

    row: int
    col: int
    values: NDArray[np.float64]
    valid: NDArray[np.bool_]


@dataclass(frozen=True)
class Own:
    """Where a heightmap of Esker's own lay: its south-western sample in its terrain, and that terrain."""

    south_west_m: tuple[float, float]
    spacing_m: float
    terrain_m: float
    place: c.Place | None


@dataclass(eq=False)
class Source(ABC):
    """An opened elevation file. Rows and columns are in the file's own order.

    Metres = ``gain`` * raw + ``bias``. ``measured``: the file says what its numbers mean, so that these are metres;
    else they are steps of an unknown size. ``step``: the smallest difference of raw samples (1 for integers), None
    when the type is floating. ``nodata``: what the file declares, for the report; pieces have it masked already.
    """

    format: str
    rows: int
    cols: int
    dtype: str
    georef: Georef | None = None
    gain: float = 1.0
    bias: float = 0.0
    measured: bool = True
    step: float | None = None
    nodata: float | None = None
    notes: list[str] = field(default_factory=list)
    eight_bit: bool = False
    colour: bool = False
    """Three 8-bit bands: heights may be coded in the colours."""
    bands: int = 1
    unit_m: float | None = None
    """Metres per unit of height that the file itself names, None when it names none."""
    own: Own | None = None
    """Where it lay in a terrain of Esker's, when it is a picture that Esker made and says so."""
    row_order_known: bool = True
    """False: nothing says whether the first row is the northern one."""

    @abstractmethod
    def pieces(self) -> Iterator[Piece]:
        """All samples once, in pieces of about ``PIECE_SAMPLES``. Raises ImportRefused when the data are broken."""

    def close(self) -> None:
        """Gives back what reading holds (most hold nothing); no more pieces after it."""
        return


def check_shape(rows: int, cols: int) -> None:
    """Refuses a declared size that cannot be taken, before anything is allocated. Raises ImportRefused."""
    if rows < c.MIN_GRID_SIDE or cols < c.MIN_GRID_SIDE:
        raise ImportRefused(
            f"It has {cols} x {rows} samples: a grid needs at least {c.MIN_GRID_SIDE} rows and as many columns."
        )
    if rows * cols > c.MAX_GRID_SAMPLES:
        raise ImportRefused(
            f"It declares {cols:,} x {rows:,} = {rows * cols:,} samples; at most {c.MAX_GRID_SAMPLES:,} can be taken. "
            "Cut out the part that you need first."
        )


@dataclass(eq=False)
class ArraySource(Source):
    """A grid that lies in a file as one array (NPY, NPZ, RAW, HGT): ``array`` is a map (rows, cols)."""

    array: NDArray[Any] = field(default_factory=lambda: np.zeros((0, 0)))

    def pieces(self) -> Iterator[Piece]:
        """See ``Source.pieces``; the declared nodata value is masked."""
        height = max(1, PIECE_SAMPLES // self.cols)
        for row in range(0, self.rows, height):
            raw = np.asarray(self.array[row : row + height])
            values = raw.astype(np.float64)
            valid = np.ones(values.shape, np.bool_) if self.nodata is None else values != self.nodata
            yield Piece(row, 0, values, valid)


def integer_step(dtype: np.dtype[Any]) -> float | None:
    """1 for integers, None for floating types. Raises ImportRefused for what is no number."""
    if dtype.kind in "iu":
        return 1.0
    if dtype.kind == "f":
        return None
    raise ImportRefused(f"Its samples are of type {dtype}: elevations are real numbers.")
