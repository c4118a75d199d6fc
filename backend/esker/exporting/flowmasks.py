"""Masks of running water: where it flows, and where it lays down what it carries (docs/exporting.md)."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from esker import contract, grid
from esker.exporting.ground import Ground, HeightSource, Mask, bands, eight_bits
from esker.flow.rivers import water_of
from esker.flow.water import Water

FLOW: Final = "flow"
"""Mask of how much ground drains through a place, by its logarithm: 0 is one sample, 255 is all of the terrain."""
DEPOSITS: Final = "deposits"
"""Mask of where water slows down: 255 where it can carry nothing of what it brings."""
LEAST_AREA: Final = 16
"""Samples from which water gathers before it carries anything that is worth a mark."""

Grid = NDArray[np.float32]


def with_flow(terrain: HeightSource, ground: Ground, **levels: int) -> Ground:
    """The ground with FLOW and DEPOSITS beside its masks.

    Water runs over the whole terrain, on DEFAULT_LEVEL with detail; finer files are interpolated between its samples.
    """
    size = ground.settings.size_m
    level = contract.DEFAULT_LEVEL
    whole = terrain.window(level, 0.0, 0.0, size, size, detail=True, progress=None, **levels).heights
    water = water_of(whole, size, ground.settings.sea_level_m)
    rows, columns = ground.heights.shape
    per_m = (grid.samples(level) - 1) / size
    y, x = (
        (corner + np.arange(n, dtype=np.float64) * ground.spacing_m) * per_m
        for corner, n in ((ground.y_m, rows), (ground.x_m, columns))
    )
    masks = {
        name: _eight_bits_between(share, y, x) for name, share in ((FLOW, flow(water)), (DEPOSITS, deposits(water)))
    }
    return replace(ground, masks={**ground.masks, **masks})


def flow(water: Water) -> Grid:
    """Shares 0..1 of FLOW, (rows, columns)."""
    share: Grid = (np.log(water.area) / np.log(max(water.area.size, 2))).astype(np.float32)
    return share


def deposits(water: Water) -> Grid:
    """Shares 0..1 of DEPOSITS, (rows, columns).

    What water can carry grows with its slope and with the root of what drains there (stream power); where it can
    carry less than above, it leaves the difference.
    """
    receiver, area, filled = water.receiver.ravel(), water.area.ravel(), water.filled.ravel().astype(np.float64)
    to = np.where(receiver < 0, np.arange(receiver.size), receiver)
    step = np.abs(to - np.arange(receiver.size))
    straight = (step == 1) | (step == water.shape[1])
    slope = (filled - filled[to]) / np.where(straight, 1.0, np.sqrt(2.0))
    power = np.where(receiver < 0, 0.0, np.sqrt(area) * slope)
    brought = np.zeros(receiver.size)
    runs = receiver >= 0
    np.maximum.at(brought, receiver[runs], power[runs])
    left = np.where(brought > 0, np.clip(1.0 - power / np.maximum(brought, 1e-12), 0.0, 1.0), 0.0)
    left *= (area >= LEAST_AREA) & runs
    return _spread(left.reshape(water.shape)).astype(np.float32)


def _spread(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values over the samples around: a stream is narrower than what it leaves is wide."""
    padded = np.pad(values, 1, mode="edge")
    wide = np.maximum.reduce([padded[i : i + len(values), j : j + values.shape[1]] for i in range(3) for j in range(3)])
    padded = np.pad(wide, 1, mode="edge")
    rows = 0.25 * padded[:-2] + 0.5 * padded[1:-1] + 0.25 * padded[2:]
    blurred: NDArray[np.float64] = 0.25 * rows[:, :-2] + 0.5 * rows[:, 1:-1] + 0.25 * rows[:, 2:]
    return blurred


def _eight_bits_between(values: Grid, y: NDArray[np.float64], x: NDArray[np.float64]) -> Mask:
    """``_between`` in steps of 1/255, in bands of rows."""
    steps = np.empty((len(y), len(x)), dtype=np.uint8)
    for start, stop in bands(0, *steps.shape):
        steps[start:stop] = eight_bits(_between(values, y[start:stop], x))
    return steps


def _between(values: Grid, y: NDArray[np.float64], x: NDArray[np.float64]) -> Grid:
    """Bilinear at rows ``y`` and columns ``x``, in samples."""
    last = len(values) - 2
    i, j = (np.clip(np.floor(at).astype(np.intp), 0, last) for at in (y, x))
    v, u = (y - i)[:, None].astype(np.float32), (x - j).astype(np.float32)
    south = values[i][:, j] * (1 - u) + values[i][:, j + 1] * u
    north = values[i + 1][:, j] * (1 - u) + values[i + 1][:, j + 1] * u
    return np.asarray(south * (1 - v) + north * v, dtype=np.float32)
