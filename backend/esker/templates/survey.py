"""Elevation grids small enough to ship: how they are kept in the repository.

A grid is an ``.npz`` of whole steps of ``quantum`` metres: what is left of each sample after its plane through the
neighbours west, south and south-west is taken away, zig-zag, low and high bytes apart, deflated. Reading one gives the
same float32 bits everywhere, so that its content has one name (``contract.Layer.content``).
"""

from __future__ import annotations

from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

FOLDER: Final = Path(__file__).parent / "data"
STEPS: Final = 1 << 16


class Grid(NamedTuple):
    """``heights``: (rows, cols) float32, metres, NaN where there are none; ``warp``: the control net of a raster, or
    None."""

    heights: NDArray[np.float32]
    warp: NDArray[np.float64] | None


def write(path: Path, grid: Grid, quantum: float) -> None:
    """Keep a grid. Raises ValueError for one that does not fit 16 bits in steps of ``quantum`` metres."""
    holes = np.isnan(grid.heights)
    whole = np.where(holes, np.nanmin(grid.heights), grid.heights).astype(np.float64)
    steps = np.rint(whole / quantum).astype(np.int64)
    low = int(steps.min())
    if int(steps.max()) - low >= STEPS:
        raise ValueError(f"steps of {quantum} m are too fine for heights of this range")
    steps = _filled(steps - low, holes)
    residual = (steps - _plane(steps)).astype(np.int64)
    words = ((residual << 1) ^ (residual >> 63)).astype(np.uint32)
    planes = np.stack([words & 255, (words >> 8) & 255, words >> 16]).astype(np.uint8)
    warp = np.zeros((0, 0, 2)) if grid.warp is None else grid.warp
    np.savez_compressed(
        path, planes=planes, holes=np.packbits(holes), low=np.int64(low), quantum=np.float64(quantum), warp=warp
    )


def read(path: Path) -> Grid:
    """A kept grid. Raises OSError, ValueError, KeyError for what is none."""
    with np.load(path, allow_pickle=False) as file:
        planes, warp = file["planes"].astype(np.int64), file["warp"]
        words = planes[0] | (planes[1] << 8) | (planes[2] << 16)
        residual = (words >> 1) ^ -(words & 1)
        steps = np.cumsum(np.cumsum(residual, axis=0), axis=1) + int(file["low"])
        heights = (steps * float(file["quantum"])).astype(np.float32)
        holes = np.unpackbits(file["holes"], count=heights.size).reshape(heights.shape).astype(bool)
    heights[holes] = np.nan
    return Grid(heights, warp if warp.size else None)


def _plane(steps: NDArray[np.int64]) -> NDArray[np.int64]:
    """West + south - south-west of each sample; what lies outside is zero."""
    padded = np.pad(steps, ((1, 0), (1, 0)))
    return padded[1:, :-1] + padded[:-1, 1:] - padded[:-1, :-1]


def _filled(steps: NDArray[np.int64], holes: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Holes filled with the last sample west of them: cheap to code."""
    at = np.where(holes, 0, np.arange(steps.shape[1])[None, :])
    return np.take_along_axis(steps, np.maximum.accumulate(at, axis=1), axis=1)
