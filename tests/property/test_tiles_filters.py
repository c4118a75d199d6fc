"""Filters of residuals give back what they took, and are used where they save (SPEC T33)."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from esker.contract import Filter
from esker.tiles.codec.filters import apply, pack_smallest, undo
from esker.tiles.codec.payload import CodecError, Ints, Wide, pack, unpack

RESIDUALS = arrays(np.int32, (65, 65), elements=st.integers(-(2**31) + 1, 2**31 - 1))


def packed(residual: Wide) -> bytes:
    found = pack(residual)
    assert found is not None
    return found[1]


@given(RESIDUALS, st.sampled_from(Filter))
@settings(max_examples=40, deadline=None)
def test_undoing_gives_the_residual_back(residual: Ints, kind: Filter) -> None:
    assert np.array_equal(undo(kind, apply(kind, residual)), residual)


@given(RESIDUALS)
@settings(max_examples=15, deadline=None)
def test_whatever_is_chosen_decodes(residual: Ints) -> None:
    kind, shift, payload = pack_smallest(residual, tuple(Filter))
    assert np.array_equal(undo(kind, unpack(shift, payload, kind == Filter.LATTICE)), residual)
    assert len(payload) <= len(packed(residual))


def test_each_filter_by_hand() -> None:
    r = np.zeros((65, 65), dtype=np.int64)
    r[:3, :3] = [[5, 7, 4], [6, 9, 9], [1, 2, 8]]
    assert apply(Filter.NONE, r)[:3, :3].tolist() == [[5, 7, 4], [6, 9, 9], [1, 2, 8]]
    assert apply(Filter.ROW, r)[:3, :3].tolist() == [[5, 2, -3], [1, 3, 0], [-5, 1, 6]]
    assert apply(Filter.PLANE, r)[:3, :3].tolist() == [[5, 2, -3], [1, 1, 3], [-5, -2, 6]]


def test_slopes_are_filtered_and_noise_is_not() -> None:
    y, x = np.mgrid[0:65, 0:65]
    slope = x * y // 2 + 40
    kind, _, payload = pack_smallest(slope, tuple(Filter))
    assert kind == Filter.PLANE
    assert len(payload) < len(packed(slope)) / 5
    noise = np.random.default_rng(1).integers(-9, 9, (65, 65))
    assert pack_smallest(noise, (Filter.ROW, Filter.PLANE))[0] == Filter.NONE


def test_what_lies_between_samples_of_the_parent_is_expected_from_beside() -> None:
    """Where the parent misses a crest, the samples between its own miss it together."""
    y, x = np.mgrid[0:65, 0:65]
    missed = 60 * np.exp(-(((x + y) / 12 - 6) ** 2)) * ((x & 1) | (y & 1))
    residual = np.rint(missed * (1 + (x & y & 1) * 0.3)).astype(np.int64)
    kind, _, payload = pack_smallest(residual, tuple(Filter))
    assert kind == Filter.LATTICE
    assert len(payload) < 0.9 * len(packed(residual))


def test_differences_beyond_32_bits_are_not_chosen() -> None:
    wild = np.where(np.indices((65, 65)).sum(axis=0) % 2, 2**31 - 1, -(2**31) + 1).astype(np.int64)
    kind, shift, payload = pack_smallest(wild, (Filter.ROW, Filter.PLANE))
    assert kind == Filter.NONE
    assert np.array_equal(unpack(shift, payload), wild)


def test_an_unknown_filter_is_refused() -> None:
    with pytest.raises(CodecError, match="unknown filter"):
        undo(4, np.zeros((65, 65), dtype=np.int32))
