"""Water on the ground of starting terrains, as they are drawn."""

from __future__ import annotations

import numpy as np

from esker import Terrain, grid, templates
from esker.flow.water import find_water, quanta

LEVEL = 2


def test_hardly_anything_of_the_alpine_ridge_stands_under_water() -> None:
    """SPEC W80: spurs end on the ground. Those that ran down to height 0 each left a pit, 3 % of the ground in all."""
    document = templates.load("alpine-ridge").document
    cell_m = grid.spacing(LEVEL, document.settings.size_m)
    water = find_water(quanta(Terrain.from_document(document).heights(LEVEL).astype(np.float64), cell_m))
    assert np.mean(water.filled > water.z) < 0.01
