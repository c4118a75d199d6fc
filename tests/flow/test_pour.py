"""Water that is poured out: how high it stands, and that none is lost (SPEC W39 to W42)."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from numpy.typing import NDArray

from esker import Stroke, Terrain
from esker.flow import reference
from esker.flow.pour import Poured, brim, pour
from esker.flow.water import NO_SEA, Water, find_water
from tests.flow.grounds import grounds

Ints = NDArray[np.int32]
BESIDE = ((0, 1), (0, -1), (1, 0), (-1, 0), (-1, 1), (1, -1))


def check_laws(water: Water, poured: Poured, volume: float) -> None:
    """What holds of any water that was poured out."""
    z, filled, cols = water.z.ravel(), water.filled.ravel(), water.shape[1]
    assert sum(pool.volume for pool in poured.pools) + poured.left == pytest.approx(volume, rel=1e-12, abs=1e-9)
    seen: set[int] = set()
    for pool in poured.pools:
        samples = pool.samples.tolist()
        assert seen.isdisjoint(samples)
        seen.update(samples)
        assert (z[pool.samples] < pool.level).all()
        # No pool stands above the brim of its hollow, and the last one ends at ground that is as high as it is.
        assert all(pool.level <= filled[i] + 1e-9 for i in samples)
    for i in poured.pools[-1].samples.tolist() if poured.pools and poured.left == 0 else ():
        row, col = divmod(i, cols)
        around = [(row + r) * cols + col + c for r, c in BESIDE]
        assert all(j in seen or z[j] >= poured.pools[-1].level for j in around)


heights = arrays.arrays(np.int32, arrays.array_shapes(min_dims=2, max_dims=2, max_side=9), elements=st.integers(-9, 9))


@given(heights, st.integers(-10, 6), st.integers(0, 80), st.floats(0, 300))
@settings(max_examples=400, deadline=None)
def test_no_drop_is_lost_on_any_ground(z: Ints, sea: int, at: int, volume: float) -> None:
    """SPEC W39, W40."""
    water = find_water(z, sea)
    check_laws(water, pour(water, at % z.size, volume), volume)


@pytest.mark.parametrize("name", grounds())
def test_enough_water_fills_a_hollow_to_its_brim(name: str) -> None:
    """SPEC W40: and then all lakes below it, as they stand when every lake runs over."""
    z, sea = grounds()[name]
    water = find_water(z, sea)
    for at in range(z.size):
        poured = pour(water, at, 1e15)
        assert (poured.left > 0) or z.size == 0
        way = water.raindrop(at)
        for pool in poured.pools:
            assert all(pool.level == water.filled.ravel()[i] for i in pool.samples)
        full = {int(i) for i in way if water.basin.ravel()[i] != 0 and water.filled.ravel()[i] > z.ravel()[i]}
        assert full <= {i for pool in poured.pools for i in pool.samples.tolist()}


def test_a_crater_rises_by_the_volume_over_its_wet_samples() -> None:
    """SPEC W39: by hand. Nine samples, of which one lies 4 lower, below a brim 6 higher than its bed."""
    z = np.full((5, 5), 13, np.int32)
    z[1:4, 1:4] = 7
    z[2, 2] = 3
    water = find_water(z)
    assert pour(water, 6, 2.0).pools[0].level == 5.0
    assert pour(water, 6, 4.0).pools[0].level == 7.0
    assert pour(water, 6, 4.0 + 9 * 2.5).pools[0].level == 9.5
    over = pour(water, 6, 4.0 + 9 * 6 + 11)
    assert (over.pools[0].level, over.left) == (13.0, 11.0)


def test_two_hollows_fill_one_after_the_other_and_join() -> None:
    """SPEC W40: the second fills from the first, and once both stand at the brim between them they rise together."""
    z = np.full((3, 7), 9, np.int32)
    z[1, 1:6] = [2, 2, 5, 1, 1]
    water = find_water(z)
    first = pour(water, 8, 6.0 + 4.0)
    assert [pool.level for pool in first.pools] == [5.0, 3.0]
    both = pour(water, 8, 6.0 + 8.0 + 5 * 1.0)
    assert [(pool.level, pool.samples.tolist()) for pool in both.pools] == [(6.0, [8, 9, 10, 11, 12])]


def test_a_brim_carries_all_that_drains_through_its_lake() -> None:
    """SPEC W41."""
    z, _ = grounds()["crater"]
    water = find_water(z, NO_SEA)
    at = 6 * 13 + 6
    out = brim(water, at)
    inside = water.watershed(out)
    basin = water.basin.ravel()[at]
    assert inside.ravel()[water.basin.ravel() == basin].all()
    assert water.area.ravel()[out] == inside.sum()
    assert brim(water, 0) == -1


def test_what_a_hollow_holds_is_what_the_plain_flood_leaves_in_it() -> None:
    """SPEC W40: the volume of a full hollow is that of the water over its ground, by the twin's flood."""
    z, sea = grounds()["crater"]
    water = find_water(z, sea)
    at = 6 * 13 + 6
    filled = np.array(reference.flooded(z.tolist(), sea)).reshape(z.shape)
    inside = water.basin == water.basin[6, 6]
    assert pour(water, at, 1e9).pools[0].volume == float((filled - z)[inside].sum())


@pytest.fixture(scope="module")
def bowl() -> Terrain:
    terrain = Terrain(size_m=2048)
    ring = [(1024 + 500 * np.cos(a), 1024 + 500 * np.sin(a), 300.0) for a in np.linspace(0, 2 * np.pi, 24)]
    for start, end in pairwise(ring):
        terrain.add(Stroke.profile([start, end]))
    return terrain


def test_a_terrain_says_how_high_rain_makes_a_lake_stand(bowl: Terrain) -> None:
    """SPEC W42."""
    by_volume = bowl.flood(1024, 1024, volume_m3=2e6, level=2)
    lake = by_volume.lakes[0]
    assert sum(found.volume_m3 for found in by_volume.lakes) + by_volume.runs_off_m3 == pytest.approx(2e6)
    ground = bowl.heights(2, True)
    cell_m2 = (2048 / 256) ** 2
    depth = np.maximum(0.0, lake.level_m - ground[lake.inside].astype(np.float64))
    assert depth.sum() * cell_m2 == pytest.approx(lake.volume_m3, rel=1e-3)
    assert lake.depth_m == pytest.approx(depth.max(), abs=0.05)
    by_rain = bowl.flood(1024, 1024, rain_mm=50, level=2)
    assert by_rain.poured_m3 == pytest.approx(0.05 * by_rain.watershed_m2)
    assert by_rain.watershed_m2 > lake.area_m2


@pytest.mark.parametrize(
    ("asked", "sentence"),
    [
        ({}, "say either"),
        ({"volume_m3": 1.0, "rain_mm": 1.0}, "say either"),
        ({"volume_m3": -1.0}, "volume_m3"),
        ({"rain_mm": float("nan")}, "rain_mm"),
    ],
)
def test_a_flood_of_bad_numbers_is_refused(bowl: Terrain, asked: dict[str, float], sentence: str) -> None:
    """SPEC W42."""
    with pytest.raises(ValueError, match=sentence):
        bowl.flood(1024, 1024, level=1, **asked)
