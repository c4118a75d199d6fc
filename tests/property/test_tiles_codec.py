"""The codec is exact, symmetric and seamless (SPEC T1, T2, T5, T55)."""

from __future__ import annotations

from fractions import Fraction
from math import floor

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from esker.tiles.bounds import sub_error
from esker.tiles.codec import entropy
from esker.tiles.codec.payload import SAMPLE_LIMIT, CodecError, child_window, pack, predict, reconstruct, unpack

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
    for base in (prediction, None):
        residual = child - (0 if base is None else prediction)
        for lattice in (False, True):
            coded = pack(residual, lattice)
            assert coded is not None or lattice
            assert coded is None or np.array_equal(reconstruct(base, unpack(*coded, lattice)), child)


@given(st.integers(0, 2**32), st.sampled_from([1, 3, 200, 2**17 - 1]), st.integers(0, 14), st.booleans())
@settings(max_examples=20, deadline=None)
def test_residuals_are_coded_without_the_power_of_two_that_they_share(
    seed: int, amplitude: int, shift: int, lattice: bool
) -> None:
    residual = rough(seed, amplitude) << shift
    residual[7, 9] = 1 << shift
    coded, whole = pack(residual, lattice), pack(residual >> shift, lattice)
    assert coded is not None
    assert whole is not None
    assert coded == (shift, whole[1])
    assert np.array_equal(unpack(*coded, lattice), residual)


def test_a_lattice_that_expects_too_much_is_not_coded() -> None:
    """Neighbours near 2^31 of both signs: what is left may have more than 32 bits."""
    wild = np.where(np.indices((65, 65)).sum(axis=0) % 2, 2**32 - 1, 1 - 2**32)
    assert entropy.encode(wild) is not None
    assert entropy.encode(wild, True) is None
    assert entropy.encode(wild + 2**32) is None


def test_smooth_ground_is_small_and_a_plane_is_nearly_free() -> None:
    y, x = np.mgrid[0:65, 0:65]
    parent = (40 * x + 25 * y).astype(np.int32)
    prediction = child_window(predict(parent), 0, 0)
    child = (40 * x + 25 * y).astype(np.int32)  # the same slope in quanta of the child
    assert pack(child - prediction) == (0, b"")
    lone = np.zeros((65, 65), dtype=np.int32)
    lone[30, 40] = 8
    coded = pack(lone)
    assert coded is not None
    assert len(coded[1]) < 40


def test_noise_takes_what_it_must_and_little_more() -> None:
    """This noise has an entropy of 1.5 bits; what is rare costs more, and is learnt for each size of neighbours."""
    rng = np.random.default_rng(3)
    noise = rng.choice([-1, 0, 0, 1], size=(65, 65))
    coded = pack(noise)
    assert coded is not None
    assert 1.5 * 65 * 65 / 8 < len(coded[1]) < 1.06 * 1.5 * 65 * 65 / 8
    both = noise.copy()
    both[32:] = rng.integers(-500, 500, (33, 65))
    apart = [pack(part) for part in (np.where(np.indices((65, 65))[0] < 32, both, 0), both)]
    assert apart[0] is not None
    assert apart[1] is not None
    assert len(apart[1][1]) < len(apart[0][1]) + 1.1 * 10 * 33 * 65 / 8


@given(st.binary(min_size=1, max_size=300), st.integers(0, 15), st.booleans())
@settings(max_examples=150, deadline=None)
def test_garbage_payloads_are_numbers_of_32_bits_or_refused(payload: bytes, shift: int, lattice: bool) -> None:
    try:
        residual = unpack(shift, payload, lattice)
    except CodecError:
        return
    assert residual.shape == (65, 65)
    assert np.abs(residual).max() < entropy.LIMIT


@given(st.integers(0, 2**32), st.sampled_from([1, 30, 9000, 2**31]), st.booleans())
@settings(max_examples=20, deadline=None)
def test_bytes_that_follow_a_payload_are_refused(seed: int, amplitude: int, lattice: bool) -> None:
    coded = pack(np.random.default_rng(seed).integers(-amplitude, amplitude, (65, 65)), lattice)
    if coded is not None:
        with pytest.raises(CodecError, match="left over"):
            unpack(coded[0], coded[1] + bytes(8), lattice)


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


CERTAIN = bytes.fromhex("2108586533084bc973db6cd071e9967bbd1f1bca0a7de8690963ef378eb1")
LARGEST = bytes.fromhex("00000000800000000000000000000000ffffff02")
TOO_LARGE = bytes.fromhex(
    "0000000080000000000000033ffffffd555000115577ffffffc36bee5b2f53af9fc36bec011fbf5ef86d7e980282c800002b721fc9fff64ba6e7"
    "2777ee57c5bfdfdb03675c8d0b97fffffb"
)


def test_the_ends_of_what_is_coded() -> None:
    """SPEC T55, the page's test has the same bytes: decisions that always fall the same way, both ways; the largest
    numbers; numbers that are too large; bytes that the decoder does not read."""
    certain, largest = np.full((65, 65), -3), np.zeros((65, 65), dtype=np.int64)
    largest[0, :2] = 2**32 - 1, 1 - 2**32
    for payload, residual in ((CERTAIN, certain), (LARGEST, largest)):
        assert entropy.encode(residual) == payload
        found = entropy.decode(payload)
        assert found is not None
        assert np.array_equal(found, residual)
    assert entropy.decode(TOO_LARGE, True) is None
    assert entropy.decode(CERTAIN + bytes(3)) is not None
    assert entropy.decode(CERTAIN + bytes(4)) is None
