"""Running water on integer heights (SPEC W1 to W13)."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from numpy.typing import NDArray

from esker.flow import basins, reference
from esker.flow.receivers import OUT
from esker.flow.water import NO_SEA, Water, find_water, quanta, sea_quanta
from tests.flow.grounds import LIMIT, grounds

Ints = NDArray[np.int32]


def check_twin(z: Ints, sea: int) -> Water:
    """Everything that is found is what the plain twin finds."""
    water = find_water(z, sea)
    plain = z.tolist()
    first = reference.receivers(plain, sea)
    basin = reference.basins(first)
    over = reference.exits(plain, basin)
    receiver = reference.through(first, over)
    assert water.basin.ravel().tolist() == basin
    assert water.filled.ravel().tolist() == reference.flooded(plain, sea)
    assert water.receiver.ravel().tolist() == receiver
    assert water.area.ravel().tolist() == reference.areas(receiver)
    return water


@pytest.mark.parametrize("name", grounds())
def test_kernels_find_what_their_plain_twin_finds(name: str) -> None:
    """SPEC W1, W9."""
    check_twin(*grounds()[name])


heights = arrays.arrays(np.int32, arrays.array_shapes(min_dims=2, max_dims=2, max_side=9), elements=st.integers(-4, 4))
wide = arrays.arrays(
    np.int32, arrays.array_shapes(min_dims=2, max_dims=2, max_side=6), elements=st.integers(-LIMIT, LIMIT)
)


@given(heights, st.integers(-5, 3))
@settings(max_examples=300, deadline=None)
def test_any_ground_of_few_heights_has_the_twins_water(z: Ints, sea: int) -> None:
    """SPEC W1, W2, W5."""
    check_laws(check_twin(z, sea), sea)


@given(wide)
@settings(max_examples=150, deadline=None)
def test_any_ground_of_far_heights_has_the_twins_water(z: Ints) -> None:
    """SPEC W1, W9."""
    check_laws(check_twin(z, NO_SEA), NO_SEA)


def check_laws(water: Water, sea: int) -> None:
    """What holds on all ground: every drop leaves, none rises above what is filled, and none is lost."""
    receiver, filled = water.receiver.ravel(), water.filled.ravel()
    z = water.z.ravel()
    assert (filled >= z).all()
    for i in range(z.size):
        way = water.raindrop(i)
        assert len(set(way.tolist())) == len(way)
        end = int(way[-1])
        rows, cols = water.shape
        at_border = end // cols in (0, rows - 1) or end % cols in (0, cols - 1)
        assert receiver[end] == OUT
        assert at_border or z[end] <= sea
        assert (np.diff(filled[way].astype(np.int64)) <= 0).all()
    assert int(water.area.ravel()[receiver == OUT].sum()) == z.size


def test_rough_ground_of_many_basins_has_the_twins_water() -> None:
    """SPEC W1: more passes than the first table holds."""
    z = np.random.default_rng(3).integers(0, 1 << 20, (65, 65)).astype(np.int32)
    water = check_twin(z, NO_SEA)
    assert int(water.basin.max()) > 300


def test_a_table_of_passes_that_is_too_small_says_so() -> None:
    water = find_water(np.random.default_rng(3).integers(0, 1 << 20, (33, 33)).astype(np.int32))
    count = int(water.basin.max())
    small, large = np.full((64, 4), -1, np.int64), np.full((1 << 14, 4), -1, np.int64)
    assert basins.find_passes(water.z, water.basin.ravel(), count, small) == -1
    assert basins.find_passes(water.z, water.basin.ravel(), count, large) > 32


def test_water_takes_a_diagonal_only_where_the_drawn_edge_goes_down() -> None:
    """SPEC W2."""
    along, across = grounds()["corner along the mesh"], grounds()["corner across the mesh"]
    assert find_water(*across).filled[6, 6] == 80
    assert find_water(*along).filled[6, 6] == 40


def test_level_ground_runs_to_its_nearest_outlet() -> None:
    """SPEC W3: breadth first, so ways over level ground are short."""
    z = np.full((9, 21), 5, np.int32)
    z[0, :] = z[-1, :] = z[:, 0] = z[:, -1] = 9
    z[4, 20] = 1
    water = find_water(z)
    assert len(water.raindrop(4 * 21 + 1)) == 20
    assert int(water.area[4, 20]) == 7 * 19 + 1


def test_level_ground_without_an_outlet_runs_over_its_lowest_brim() -> None:
    """SPEC W4, W5."""
    z = np.full((7, 7), 5, np.int32)
    z[0, :] = z[-1, :] = z[:, 0] = z[:, -1] = 9
    z[3, 6] = 7
    water = find_water(z)
    assert (water.filled[1:-1, 1:-1] == 7).all()
    assert int(water.area[3, 6]) == 26
    assert int(water.spill[1]) == 7


@pytest.mark.parametrize("name", grounds())
def test_a_watershed_is_all_whose_drops_pass(name: str) -> None:
    """SPEC W7."""
    water = find_water(*grounds()[name])
    for index in range(0, water.z.size, 7):
        inside = water.watershed(index)
        passes = [index in water.raindrop(i) for i in range(water.z.size)]
        assert inside.ravel().tolist() == passes
        assert int(inside.sum()) == int(water.area.ravel()[index])


def test_the_highest_ground_above_is_that_of_the_watershed() -> None:
    """SPEC W8."""
    for z, sea in grounds().values():
        water = find_water(z, sea)
        top = water.highest().ravel()
        for index in range(0, z.size, 5):
            assert top[index] == z[water.watershed(index)].max()


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e30])
def test_heights_that_are_no_numbers_never_reach_the_flow(bad: float) -> None:
    """SPEC W10."""
    ground = np.zeros((5, 5), np.float32)
    ground[2, 2] = bad
    with pytest.raises(ValueError, match=r"finite|too large"):
        quanta(ground, 16.0)


def test_heights_become_whole_steps_halves_to_even() -> None:
    ground = np.array([[0.0, 1.0, 1.5, 2.5, -0.5]], np.float32)
    assert quanta(ground, 256.0).tolist() == [[0, 1, 2, 2, 0]]


@pytest.mark.parametrize("sea_m", [None, -3.0, 0.0, 2.25, 1e30, -1e30])
def test_the_sea_covers_what_lies_at_its_level_or_below(sea_m: float | None) -> None:
    """SPEC W6."""
    ground = np.array([[9, 9, 9], [9, 2.25, 9], [9, 9, 9]], np.float32)
    water = find_water(quanta(ground, 1.0), sea_quanta(sea_m, 1.0))
    covered = sea_m is not None and sea_m >= 2.25
    assert (water.receiver[1, 1] == OUT) == covered
    assert water.filled[1, 1] == (576 if covered else 9 * 256)


@pytest.mark.parametrize(
    "bad",
    [np.zeros(4, np.int32), np.zeros((0, 4), np.int32), np.zeros((4, 4), np.float32), np.zeros((4, 4), np.int64)],
)
def test_what_is_no_grid_of_32_bit_integers_is_refused(bad: NDArray[Any]) -> None:
    """SPEC W10."""
    with pytest.raises(ValueError, match="int32 grid"):
        find_water(bad)


def test_the_same_ground_has_the_same_water() -> None:
    """SPEC W1: nothing depends on where arrays lie, or on what was computed before."""
    z, sea = grounds()["rough"]
    first, other = find_water(z, sea), find_water(np.asfortranarray(z), sea)
    for field in ("receiver", "filled", "area", "basin", "spill"):
        np.testing.assert_array_equal(getattr(first, field), getattr(other, field))
