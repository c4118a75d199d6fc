"""Tables that all materials read: tiling noise and stones (twins of gpu/synthesis/noise.ts and stones.ts)."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

NOISE_SIZE: Final = 256
GRADIENT_RANGE: Final = 8
OCTAVES: Final = 6
DEVIATION: Final = 0.19
STONES_SIZE: Final = 512
STONES_PERIOD: Final = 24
STONES_EDGE: Final = 0.55
STONES_SEED: Final = 71
STONES_LEAN: Final = 0.16

Floats = NDArray[np.float64]


def lattice_hash(x: NDArray[np.uint32], y: NDArray[np.uint32], seed: int) -> NDArray[np.uint32]:
    h = (x * np.uint32(0x27D4EB2D)) ^ (y * np.uint32(0x165667B1)) ^ np.uint32((seed * 0x9E3779B1) & 0xFFFFFFFF)
    h = (h ^ (h >> np.uint32(15))) * np.uint32(0x85EBCA6B)
    h = (h ^ (h >> np.uint32(13))) * np.uint32(0xC2B2AE35)
    return np.asarray(h ^ (h >> np.uint32(16)))


def _octave(period: int, seed: int) -> Floats:
    """Gradient noise (Perlin 2002) on a periodic lattice: (NOISE_SIZE, NOISE_SIZE)."""
    i = np.arange(period, dtype=np.uint32)
    angle = lattice_hash(i[None, :], i[:, None], seed) / 2**32 * 2 * np.pi
    gx, gy = (f(angle).astype(np.float32).astype(np.float64) for f in (np.cos, np.sin))
    at = np.arange(NOISE_SIZE) / (NOISE_SIZE / period)
    whole = np.floor(at).astype(np.int64)
    part = at - whole
    weight = part**3 * (part * (part * 6 - 15) + 10)
    wx, wy = weight[None, :], weight[:, None]

    def corner(di: int, dj: int) -> Floats:
        at = np.ix_((whole + dj) % period, (whole + di) % period)
        return np.asarray(gx[at] * (part[None, :] - di) + gy[at] * (part[:, None] - dj))

    south = corner(0, 0) + (corner(1, 0) - corner(0, 0)) * wx
    north = corner(0, 1) + (corner(1, 1) - corner(0, 1)) * wx
    return np.asarray(south + (north - south) * wy)


def _sum(first: int, seed: int, decay: float, shape: Callable[[Floats], Floats]) -> Floats:
    """Octaves of falling strength, scaled to mean 0.5 and the same deviation for each kind, within 0..1."""
    out = np.zeros((NOISE_SIZE, NOISE_SIZE), dtype=np.float32)
    for k in range(OCTAVES):
        out = (out + decay**k * shape(_octave(first << k, seed + k))).astype(np.float32)
    field = out.astype(np.float64)
    mean = field.mean()
    scaled = 0.5 + (field - mean) * (DEVIATION / np.sqrt(((field - mean) ** 2).mean()))
    return np.asarray(np.clip(scaled, 0, 1).astype(np.float32), dtype=np.float64)


@cache
def noise_mipmaps() -> tuple[NDArray[np.uint8], ...]:
    """Levels of the mipmap, finest first, (side, side, 4): r fbm, g ridged fbm, ba gradient of r per texture width."""
    smooth = _sum(4, 11, 0.55, lambda v: v)
    ridged = _sum(3, 31, 0.58, lambda v: -np.abs(v))
    slope = NOISE_SIZE / (8 * GRADIENT_RANGE)
    east = (np.roll(smooth, -1, axis=1) - np.roll(smooth, 1, axis=1)) * slope
    north = (np.roll(smooth, -1, axis=0) - np.roll(smooth, 1, axis=0)) * slope
    texels = np.stack((smooth, ridged, 0.5 + east, 0.5 + north), axis=-1).astype(np.float32)
    return _mipmaps(texels)


def _mipmaps(texels: NDArray[np.float32]) -> tuple[NDArray[np.uint8], ...]:
    levels = []
    while True:
        levels.append(np.floor(np.clip(texels, 0, 1).astype(np.float64) * 255 + 0.5).astype(np.uint8))
        if len(texels) == 1:
            return tuple(levels)
        n = len(texels) // 2
        texels = texels.astype(np.float64).reshape(n, 2, n, 2, 4).mean(axis=(1, 3)).astype(np.float32)


def _cells() -> tuple[Floats, Floats, Floats, Floats]:
    """How far in from its stone's edge each texel is, 0..1, its stone's own number and lean (Worley 1996)."""
    i = np.arange(STONES_PERIOD, dtype=np.uint32)
    east, north, numbers = (
        (lattice_hash(i[None, :], i[:, None], STONES_SEED + k) / 2**32).astype(np.float32).astype(np.float64)
        for k in range(3)
    )
    at = np.arange(STONES_SIZE) * (STONES_PERIOD / STONES_SIZE)
    whole = np.floor(at).astype(np.int64)
    near = np.full((STONES_SIZE, STONES_SIZE), 9.0)
    second = near.copy()
    own, lean_east, lean_north = (np.zeros_like(near) for _ in range(3))
    for dj in range(-2, 3):
        for di in range(-2, 3):
            cell = np.ix_((whole + dj) % STONES_PERIOD, (whole + di) % STONES_PERIOD)
            ex = (whole + di)[None, :] + east[cell] - at[None, :]
            ey = (whole + dj)[:, None] + north[cell] - at[:, None]
            d = np.sqrt(ex * ex + ey * ey)
            second = np.where(d < near, near, np.minimum(second, d))
            own = np.where(d < near, numbers[cell], own)
            lean_east = np.where(d < near, (east[cell] - 0.5) * STONES_LEAN, lean_east)
            lean_north = np.where(d < near, (north[cell] - 0.5) * STONES_LEAN, lean_north)
            near = np.minimum(near, d)
    inside = np.minimum(1, (second - near) / STONES_EDGE).astype(np.float32)
    return inside.astype(np.float64), own, lean_east, lean_north


@cache
def stone_mipmaps() -> tuple[NDArray[np.uint8], ...]:
    """Levels of the mipmap, finest first, (side, side, 4): r how far in from its stone's edge, g the stone's own
    number, ba gradient of its leaning, rounded relief per stone."""
    inside, own, lean_east, lean_north = _cells()
    relief = np.sqrt(inside * (2 - inside)).astype(np.float32).astype(np.float64)
    slope = STONES_SIZE / STONES_PERIOD / (8 * GRADIENT_RANGE)
    east = (np.roll(relief, -1, axis=1) - np.roll(relief, 1, axis=1)) * slope
    north = (np.roll(relief, -1, axis=0) - np.roll(relief, 1, axis=0)) * slope
    return _mipmaps(
        np.stack((inside, own, 0.5 + east + lean_east, 0.5 + north + lean_north), axis=-1).astype(np.float32)
    )
