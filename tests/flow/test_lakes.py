"""Lakes take their levels from the flow (SPEC W11 to W13)."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from esker import Terrain, templates
from esker.flow import reference
from esker.flow.water import NO_SEA, find_water, quanta
from esker.synthesis.lakes import find_lakes, flooded

Floats = NDArray[np.float32]


def flood_of_samples(ground: Floats) -> Floats:
    """Every height by its rank, flooded sample by sample."""
    ranks, places = np.unique(ground, return_inverse=True)
    rows = [[int(place) for place in row] for row in np.asarray(places).reshape(ground.shape)]
    found = reference.flooded(rows, NO_SEA)
    return np.asarray(ranks[np.array(found)].reshape(ground.shape))


@pytest.mark.parametrize("name", ["alpine-ridge", "volcanic-island", "canyon"])
def test_starting_terrains_fill_as_a_flood_of_all_their_samples_does(name: str) -> None:
    """SPEC W11: to the bit, for the heights themselves and for whole steps of them."""
    terrain = Terrain.from_document(templates.load(name).document)
    ground = terrain.heights(2)
    np.testing.assert_array_equal(flooded(ground), flood_of_samples(ground))
    steps = quanta(ground, terrain.settings.size_m / 256)
    np.testing.assert_array_equal(find_water(steps).filled, flood_of_samples(steps.astype(np.float32)))


@pytest.mark.parametrize("seed", range(20))
def test_any_heights_fill_as_a_flood_of_all_samples_does(seed: int) -> None:
    """SPEC W12: of both signs, equal, tiny, huge, minus zero."""
    rng = np.random.default_rng(seed)
    ground = np.round(rng.normal(0, 10.0 ** (seed % 7 - 3), (19, 19)), seed % 4).astype(np.float32)
    ground[rng.integers(0, 19, 6), rng.integers(0, 19, 6)] = rng.choice([-0.0, 0.0, 1e30, -1e30, 1e-40], 6)
    np.testing.assert_array_equal(flooded(ground), flood_of_samples(ground + np.float32(0.0)))


def test_a_lake_below_sea_level_is_the_seas() -> None:
    """SPEC W13."""
    y, x = np.mgrid[0:25, 0:25]
    crater = (90 - 6 * np.abs(np.hypot(x - 12, y - 12) - 6)).astype(np.float32)
    assert find_lakes(crater, 16.0, 4.0).any
    assert find_lakes(crater, 16.0, 4.0, 60.0).any
    assert not find_lakes(crater, 16.0, 4.0, 100.0).any
