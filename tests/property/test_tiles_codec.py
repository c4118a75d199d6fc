"""The codec is exact, symmetric and seamless (SPEC T1, T2, T5)."""

from __future__ import annotations

from fractions import Fraction
from math import floor

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from esker.tiles.bounds import sub_error
from esker.tiles.codec import SAMPLE_LIMIT, CodecError, child_window, pack, predict, reconstruct, unpack

Ints = NDArray[np.int32]
AMPLITUDES = st.sampled_from([0, 1, 100, 30_000, 3_170_000, 3_180_000, 1 << 27, SAMPLE_LIMIT])


def rough(seed: int, amplitude: int, shape: tuple[int, ...] = (65, 65)) -> Ints:
    """Uniform noise within +-amplitude, both ends included."""
    return np.random.default_rng(seed).integers(-amplitude, amplitude, size=shape, endpoint=True, dtype=np.int32)


def line(values: list[Fraction]) -> list[Fraction]:
    """The rule of SPEC T2 on one line, written as plainly as possible."""
    out: list[Fraction] = []
    n = len(values)
    for i in range(n):
        out.append(values[i])
        if i == n - 1:
            break
        if i == 0:
            near, weights = values[0:4], (5, 15, -5, 1)
        elif i == n - 2:
            near, weights = values[n - 4 : n], (1, -5, 15, 5)
        else:
            near, weights = values[i - 1 : i + 3], (-1, 9, 9, -1)
        out.append(sum((w * v for w, v in zip(weights, near, strict=True)), Fraction(0)) / 16)
    return out


def slow_prediction(parent: Ints, rows: range, cols: range) -> list[list[int]]:
    """The prediction at some places of the 129x129 grid in rational arithmetic."""
    wide = [line([Fraction(int(v)) for v in row]) for row in parent]
    columns = {c: line([row[c] for row in wide]) for c in cols}
    return [[floor(2 * columns[c][r] + Fraction(1, 2)) for c in cols] for r in rows]


@given(st.integers(0, 2**32), AMPLITUDES)
@settings(max_examples=12, deadline=None)
def test_prediction_is_the_rule_of_the_specification(seed: int, amplitude: int) -> None:
    parent = rough(seed, amplitude)
    rows, cols = range(seed % 7, 129, 11), range(seed % 5, 129, 13)
    fast = predict(parent)[np.ix_(rows, cols)]
    assert fast.tolist() == slow_prediction(parent, rows, cols)


def test_prediction_at_the_corners_is_one_sided() -> None:
    parent = rough(3, 1000)
    for rows in (range(6), range(123, 129)):
        assert predict(parent)[np.ix_(rows, rows)].tolist() == slow_prediction(parent, rows, rows)


@given(st.integers(0, 2**32), AMPLITUDES)
@settings(max_examples=25, deadline=None)
def test_prediction_is_symmetric_and_keeps_even_samples(seed: int, amplitude: int) -> None:
    parent = rough(seed, amplitude)
    assert np.array_equal(predict(parent).T, predict(np.ascontiguousarray(parent.T)))
    assert np.array_equal(predict(parent)[::2, ::2], 2 * parent.astype(np.int64))
    assert np.array_equal(predict(np.stack([parent, -parent]))[0], predict(parent))


@given(st.integers(0, 2**32), AMPLITUDES)
@settings(max_examples=25, deadline=None)
def test_neighbours_predict_equal_edges(seed: int, amplitude: int) -> None:
    ground = rough(seed, amplitude, (129, 129))
    parts = {(x, y): predict(ground[64 * y : 64 * y + 65, 64 * x : 64 * x + 65]) for x in (0, 1) for y in (0, 1)}
    assert np.array_equal(parts[0, 0][:, -1], parts[1, 0][:, 0])
    assert np.array_equal(parts[0, 0][-1], parts[0, 1][0])
    assert np.array_equal(child_window(parts[0, 0], 0, 0)[:, -1], child_window(parts[0, 0], 1, 0)[:, 0])


@given(st.integers(0, 2**32), AMPLITUDES, AMPLITUDES, st.integers(0, 3))
@settings(max_examples=60, deadline=None)
def test_round_trip_is_exact(seed: int, parent_size: int, child_size: int, quadrant: int) -> None:
    parent, child = rough(seed, parent_size), rough(seed + 1, child_size)
    prediction = child_window(predict(parent), quadrant & 1, quadrant >> 1)
    planes, payload = pack(child - prediction)
    assert np.array_equal(reconstruct(prediction, unpack(planes, payload)), child)
    planes, payload = pack(child)
    assert np.array_equal(reconstruct(None, unpack(planes, payload)), child)


@pytest.mark.parametrize(("largest", "planes"), [(0, 0), (127, 1), (128, 2), (32_767, 2), (32_768, 3), (1 << 23, 4)])
def test_planes_are_as_few_as_the_largest_residual_needs(largest: int, planes: int) -> None:
    residual = np.zeros((65, 65), dtype=np.int32)
    residual[7, 9] = largest
    count, payload = pack(residual)
    assert count == planes
    assert np.array_equal(unpack(count, payload), residual)


def test_smooth_ground_is_small_and_a_plane_is_nearly_free() -> None:
    y, x = np.mgrid[0:65, 0:65]
    parent = (40 * x + 25 * y).astype(np.int32)
    prediction = child_window(predict(parent), 0, 0)
    child = (40 * x + 25 * y).astype(np.int32)  # the same slope in quanta of the child
    assert len(pack(child - prediction)[1]) < 40


@given(st.integers(1, 4), st.binary(max_size=300))
@settings(max_examples=150, deadline=None)
def test_garbage_payloads_are_refused(planes: int, payload: bytes) -> None:
    with pytest.raises(CodecError):
        unpack(planes, payload)


def test_prediction_beyond_the_limit_is_refused() -> None:
    residual = np.full((65, 65), 1, dtype=np.int32)
    with pytest.raises(CodecError, match="out of range"):
        reconstruct(np.full((65, 65), SAMPLE_LIMIT, dtype=np.int32), residual)


@given(st.integers(0, 2**32), st.sampled_from([1, 1000, SAMPLE_LIMIT]))
@settings(max_examples=20, deadline=None)
def test_sub_error_is_the_distance_to_the_parents_bilinear_surface(seed: int, amplitude: int) -> None:
    samples, parent = rough(seed, amplitude), rough(seed + 1, amplitude // 2 + 1, (33, 33))
    rows = np.arange(65) / 2
    p = 2.0 * parent
    low, high, f = np.floor(rows).astype(int), np.ceil(rows).astype(int), 0.5
    drawn = (p[low] * f + p[high] * f)[:, low] * f + (p[low] * f + p[high] * f)[:, high] * f
    distance = np.abs(samples - drawn)
    want = [[np.ceil(distance[r : r + 17, c : c + 17].max()) for c in range(0, 64, 16)] for r in range(0, 64, 16)]
    assert np.array_equal(sub_error(samples, parent), np.array(want))
