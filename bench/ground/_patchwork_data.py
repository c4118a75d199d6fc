"""Elevation grids of 1k, 4k and 16k samples a side for the patchwork's benchmark.

The paper's 16,385 x 16,385 grid of Puget Sound is not at hand. Its own reduction to 1,025 a side is (``--puget``), or
else the part of it that ships with the starting terrains, mirrored to that size; finer grids are grown from it by a
fractal rule, so that roughness goes on to finer scales as it does in the original: a sample between others is their
mean by the 4-point rule of one axis after the other, and gets noise of ``NOISE`` times the range of its parents.
Where the parents are level (the Sound) nothing is added. Heights are rounded to 0.1 m, as in the original.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from esker.synthesis import hash as noise
from esker.templates import survey

Heights = NDArray[np.float32]

SIDES: Final = (1025, 4097, 16385)
SPACING_16K_M: Final = 10.0
NOISE: Final = 0.18
STEP_M: Final = 0.1
SEED: Final = 2011
BAND: Final = 512
"""Rows of the parent that are worked on at a time."""


def first(puget: Path | None) -> tuple[Heights, str]:
    """1,025 x 1,025 heights, row 0 south, and what they are."""
    if puget is not None:
        with Image.open(puget) as picture:
            steps = np.asarray(picture, dtype=np.float32)[::-1]
        if steps.shape != (SIDES[0], SIDES[0]):
            raise ValueError(f"{puget}: {steps.shape} samples, not {SIDES[0]} x {SIDES[0]}")
        return np.ascontiguousarray(steps * np.float32(STEP_M)), "Puget Sound, 160 m, 1025 x 1025 (the paper's)"
    part = survey.read(survey.FOLDER / "puget.npz").heights
    more = [(0, SIDES[0] - n) for n in part.shape]
    return np.pad(part, more, mode="reflect"), "a part of Puget Sound, 160 m, mirrored to 1025 x 1025"


def finer(coarse: Heights, level: int, out: Heights) -> None:
    """Fill ``out`` (2n - 1, 2n - 1) from ``coarse`` (n, n), band by band: both may be mapped files."""
    n = len(coarse)
    for top in range(0, n, BAND):
        stop = min(top + BAND, n)
        # parents one beyond either end, as far as there are any
        low, high = max(0, top - 1), min(n, stop + 2)
        made = _between(np.asarray(coarse[low:high]), level, 2 * low)
        rows = slice(2 * top, min(2 * stop, 2 * n - 1))
        out[rows] = made[rows.start - 2 * low : rows.stop - 2 * low]


def _between(z: Heights, level: int, first_row: int) -> Heights:
    """Twice as many rows and columns, with noise; exact at the parents."""
    fine = _axis(_axis(z, 0), 1)
    rough = np.zeros_like(fine)
    span = np.maximum.reduce([z[:-1, :-1], z[1:, :-1], z[:-1, 1:], z[1:, 1:]])
    span -= np.minimum.reduce([z[:-1, :-1], z[1:, :-1], z[:-1, 1:], z[1:, 1:]])
    rough[1::2, 1::2] = span
    rough[::2, 1::2] = np.abs(np.diff(z, axis=1))
    rough[1::2, ::2] = np.abs(np.diff(z, axis=0))
    rows, cols = np.arange(first_row, first_row + fine.shape[0]), np.arange(fine.shape[1])
    grain = noise.full(noise.hashed(SEED, level, 0, rows, cols), np.float32)
    fine += np.float32(NOISE) * rough * grain.astype(np.float32)
    rounded: Heights = (np.rint(fine * np.float32(1 / STEP_M)) * np.float32(STEP_M)).astype(np.float32)
    return rounded


def _axis(z: Heights, axis: int) -> Heights:
    """The 4-point rule along one axis; ends are repeated."""
    z = np.moveaxis(z, axis, 0)
    out = np.empty((2 * len(z) - 1, *z.shape[1:]), dtype=np.float32)
    out[::2] = z
    edged = np.concatenate([z[:1], z, z[-1:]])
    out[1::2] = (9 * (z[:-1] + z[1:]) - (edged[:-3] + edged[3:])) / 16
    return np.moveaxis(out, 0, axis)


def make(side: int, folder: Path, puget: Path | None) -> Path:
    """The grid of a size as ``folder``/SIDE.npy, made from the next coarser ones; kept ones are taken."""
    path = folder / f"{side}.npy"
    if path.exists():
        return path
    if side == SIDES[0]:
        np.save(path, first(puget)[0])
        return path
    coarse = np.load(make((side + 1) // 2, folder, puget), mmap_mode="r")
    out = np.lib.format.open_memmap(path, "w+", np.float32, (side, side))
    finer(coarse, int(np.log2(side - 1)), out)
    out.flush()
    return path
