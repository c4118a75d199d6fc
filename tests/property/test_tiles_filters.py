"""Filters of residuals give back what they took, and are used where they save (SPEC T33)."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from esker.contract import Filter
from esker.tiles.codec import CodecError, Ints, pack, unpack
from esker.tiles.filters import apply, pack_smallest, undo

RESIDUALS = arrays(np.int32, (65, 65), elements=st.integers(-(2**31) + 1, 2**31 - 1))


@given(RESIDUALS, st.sampled_from(Filter))
@settings(max_examples=40, deadline=None)
def test_undoing_gives_the_residual_back(residual: Ints, kind: Filter) -> None:
    assert np.array_equal(undo(kind, apply(kind, residual)), residual)


@given(RESIDUALS)
@settings(max_examples=15, deadline=None)
def test_whatever_is_chosen_decodes(residual: Ints) -> None:
    kind, planes, payload = pack_smallest(residual)
    assert np.array_equal(undo(kind, unpack(planes, payload)), residual)
    assert len(payload) <= len(pack(residual)[1])


def test_each_filter_by_hand() -> None:
    r = np.zeros((65, 65), dtype=np.int64)
    r[:3, :3] = [[5, 7, 4], [6, 9, 9], [1, 2, 8]]
    assert apply(Filter.NONE, r)[:3, :3].tolist() == [[5, 7, 4], [6, 9, 9], [1, 2, 8]]
    assert apply(Filter.ROW, r)[:3, :3].tolist() == [[5, 2, -3], [1, 3, 0], [-5, 1, 6]]
    assert apply(Filter.PLANE, r)[:3, :3].tolist() == [[5, 2, -3], [1, 1, 3], [-5, -2, 6]]


def test_slopes_are_filtered_and_noise_is_not() -> None:
    y, x = np.mgrid[0:65, 0:65]
    slope = x * y // 2 + 40
    kind, _, payload = pack_smallest(slope)
    assert kind == Filter.PLANE
    assert len(payload) < len(pack(slope)[1]) / 5
    noise = np.random.default_rng(1).integers(-9, 9, (65, 65))
    assert pack_smallest(noise)[0] == Filter.NONE


def test_differences_beyond_32_bits_are_not_chosen() -> None:
    wild = np.where(np.indices((65, 65)).sum(axis=0) % 2, 2**31 - 1, -(2**31) + 1).astype(np.int64)
    kind, planes, payload = pack_smallest(wild)
    assert kind == Filter.NONE
    assert np.array_equal(unpack(planes, payload), wild)


def test_an_unknown_filter_is_refused() -> None:
    with pytest.raises(CodecError, match="unknown filter"):
        undo(3, np.zeros((65, 65), dtype=np.int32))
