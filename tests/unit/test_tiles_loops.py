"""Compiled loops give the bits of their plain twins (SPEC T52)."""

from __future__ import annotations

import numpy as np
import pytest

from esker import grid
from esker.tiles import loops
from esker.tiles.bounds import SubPatches, block_reduce, sub_error
from esker.tiles.codec.payload import SAMPLE_LIMIT, predict, upsampled
from esker.tiles.pyramid import quantise
from esker.tiles.stabiliser import Steadier, steadied

LEVEL, SIZE_M = 2, 512.0
N = grid.samples(LEVEL)


def heights(rng: np.random.Generator, scale: float) -> np.ndarray[tuple[int, int], np.dtype[np.float32]]:
    return rng.normal(scale=scale, size=(N, N)).astype(np.float32)


@pytest.mark.parametrize("scale", [0.01, 300.0, 1e8])
def test_samples_are_steadied_and_rounded_as_in_numpy(scale: float) -> None:
    rng = np.random.default_rng(int(scale) + 1)
    preview, settled, now = (heights(rng, scale) for _ in range(3))
    now[::3] = preview[::3]
    steadier = Steadier()
    steadier.note(1, preview)
    steadier.settled(1, settled)
    want = steadied(now, settled, settled - preview)
    np.testing.assert_array_equal(steadier.preview(2, now), want)
    roundings = 4 * np.finfo(np.float32).eps * np.abs([preview, settled]).max()
    np.testing.assert_allclose(want[::3], settled[::3], rtol=0, atol=roundings, err_msg="unchanged: as it is settled")

    quantum = np.float32(1 / grid.quantum(LEVEL, SIZE_M))
    kept = quantise(want + rng.normal(scale=2 / quantum, size=want.shape).astype(np.float32), LEVEL, SIZE_M)
    found = np.empty_like(kept)
    for step in (1, 8):
        loops.quantised(want, kept, quantum, step, np.float32(SAMPLE_LIMIT), found)
        np.testing.assert_array_equal(found, quantise(want, LEVEL, SIZE_M, kept, step))


def test_what_is_not_finite_is_found() -> None:
    rng = np.random.default_rng(4)
    ground = heights(rng, 1e30)
    ground[7, 9] = np.finfo(np.float32).max
    assert loops.finite(ground)
    for value in (np.inf, -np.inf, np.nan, -np.nan):
        broken = ground.copy()
        broken[-1, -1] = value
        assert not loops.finite(broken)


@pytest.mark.parametrize("cells", [4, 64])
def test_a_changed_sample_marks_every_block_that_it_lies_in(cells: int) -> None:
    rng = np.random.default_rng(cells)
    old = rng.integers(-9, 9, (N, N), dtype=np.int32)
    for spots in (0, 1, 5, 300):
        new = old.copy()
        new[tuple(rng.integers(0, N, (2, spots)))] += 1
        new[:: N - 1, 64] += spots > 4
        found = np.zeros(((N - 1) // cells,) * 2, dtype=np.bool_)
        loops.changed(new, old, cells, found)
        np.testing.assert_array_equal(found, block_reduce(np.logical_or, new != old, cells))


@pytest.mark.parametrize("scale", [100, SAMPLE_LIMIT - 1])
def test_bounds_of_sub_patches_are_those_of_numpy(scale: int) -> None:
    rng = np.random.default_rng(scale)
    samples = rng.integers(-scale, scale, (N, N), dtype=np.int32)
    parent = rng.integers(-scale, scale, (N // 2 + 1,) * 2, dtype=np.int32) // 2
    dirty = np.zeros((1 << LEVEL, 1 << LEVEL), dtype=np.bool_)
    dirty[1, 1] = dirty[2, 3] = True
    sub = SubPatches(LEVEL)
    sub.update(lambda r, k: samples[r, k], lambda r, k: parent[r, k], dirty)
    at = np.s_[4:12, 4:16]
    for found, ufunc in ((sub.low, np.minimum), (sub.high, np.maximum)):
        np.testing.assert_array_equal(found[at], block_reduce(ufunc, samples, 16)[at])
    np.testing.assert_array_equal(sub.error[at], sub_error(samples, parent)[at])
    assert not sub.low[:4].any()
    assert not sub.error[:, :4].any()


@pytest.mark.parametrize("ratio", [1, 2])
@pytest.mark.parametrize("scale", [1, 3000, SAMPLE_LIMIT])
def test_children_are_predicted_as_in_numpy(scale: int, ratio: int) -> None:
    parent = np.random.default_rng(scale).integers(-scale, scale, (65, 65), endpoint=True).astype(np.int32)
    want = upsampled(parent, ratio)
    np.testing.assert_array_equal(predict(parent, ratio), want)
    parent.flags.writeable = False
    np.testing.assert_array_equal(predict(parent.T, ratio), want.T)
