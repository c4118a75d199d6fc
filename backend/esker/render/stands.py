"""Where trees, rocks and tufts may stand: the twin of shaders/wgsl/instances/stands.wgsl, for many cells at once."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from esker.render.tables import lattice_hash

Floats = NDArray[np.float64]

TREE, ROCK, TUFT = range(3)
CELLS_M: Final = (6.5, 4.0, 0.32)
"""Side of a cell of each kind, metres."""
SEED: Final = 501


class Stands(NamedTuple):
    """What the hashes of (n,) cells say: place in the cell, 0..1, (n, 2); the least density at which one stands; size,
    turn and hue, 0..1."""

    at: Floats
    least: Floats
    size: Floats
    turn: Floats
    hue: Floats


class Soil(NamedTuple):
    """What the ground offers at (n,) places, 0..1; ``steep`` is the tangent of the slope, ``height`` counts in the
    relief, ``woods`` is broad noise."""

    grass: Floats
    forest: Floats
    snow: Floats
    wet: Floats
    smoothness: Floats
    steep: Floats
    height: Floats
    woods: Floats


def stands(cells: NDArray[np.int64], kind: int) -> Stands:
    """The stands of (n, 2) cells of a kind."""
    i, j = (cells[:, axis].astype(np.int32).view(np.uint32) for axis in (0, 1))
    a, b, c = (lattice_hash(i, j, SEED + 3 * kind + k) for k in range(3))

    def low(word: NDArray[np.uint32]) -> Floats:
        return (word & np.uint32(0xFFFF)) / 65536.0

    def high(word: NDArray[np.uint32]) -> Floats:
        return (word >> np.uint32(16)) / 65536.0

    return Stands(0.06 + 0.88 * np.stack([low(a), high(a)], axis=1), low(b), high(b), low(c), high(c))


def density(kind: int, look: str, s: Soil) -> Floats:
    """Share of the cells of a kind in which one stands."""
    nothing = np.zeros_like(s.steep)
    if look == "paper":
        return nothing
    bare = 1 - _ramp(0.25, 0.75, s.snow)
    if kind == TREE:
        level = 1 - _ramp(0.75, 1.15, s.steep)
        if look == "alpine":
            woods = _ramp(0.52, 0.64, s.woods) * (1 - _ramp(0.036, 0.060, s.height))
            return level * np.maximum(woods, _ramp(0.30, 0.70, s.forest)) * 0.9
        if look == "desert":
            return level * bare * (0.5 * _ramp(0.35, 0.8, s.forest) + 0.02 * s.grass + 0.10 * _ramp(0.4, 0.8, s.wet))
        lone = 0.012 * s.grass * _ramp(0.05, 0.3, s.forest + 0.06)
        return level * bare * (0.94 * _ramp(0.28, 0.72, s.forest) + lone)
    if kind == ROCK:
        slopes = _ramp(0.30, 0.75, s.steep) * (1 - _ramp(1.0, 1.5, s.steep))
        strewn = 0.035 + 0.32 * slopes + 0.10 * (1 - _ramp(0.30, 0.60, s.smoothness))
        return strewn * (1 - 0.6 * s.forest) * (1 - 0.55 * _ramp(0.5, 0.9, s.snow))
    gentle = 1 - _ramp(0.85, 1.25, s.steep)
    if look == "desert":
        return gentle * bare * (0.05 + 0.45 * s.grass + 0.22 * _ramp(0.50, 0.62, s.woods))
    if look == "alpine":
        return gentle * bare * 0.5
    return gentle * bare * _ramp(0.25, 0.6, s.grass) * (1 - 0.55 * _ramp(0.4, 0.8, s.forest))


def _ramp(low: float, high: float, x: Floats) -> Floats:
    t = np.clip((x - low) / (high - low), 0, 1)
    return np.asarray(t * t * (3 - 2 * t))
