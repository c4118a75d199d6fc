"""Strokes that give way where they meet others (SPEC S310 to S312)."""

from __future__ import annotations

import numpy as np
import pytest

from esker.api.terrain import Stroke as Make
from esker.contract import Stroke
from esker.solve.constraints import raster_reference
from esker.solve.constraints.constraints import pack
from esker.solve.opencl.device import Device
from esker.solve.solver import Solver
from tests.solver.scenes import SETTINGS, SIZE, flank
from tests.solver.test_ties import differences

LEVEL = 3
AT = (2048.0, 2048.0)
"""Where the strokes cross."""


def summit() -> Stroke:
    """A mountain of 700 m, its summit where the other one crosses."""
    points = [(900, 2048, 0), (2048, 2048, 700), (3200, 2048, 0)]
    return Make.profile(points, left=flank(35, 1000), right=flank(35, 1000), id="summit")


def crossing(yields: float) -> Stroke:
    """A lower ridge over its summit."""
    points = [(2048, 700, 0), (2048, 1300, 250), (2048, 2800, 250), (2048, 3400, 0)]
    return Make.profile(points, left=flank(35, 400), right=flank(35, 400), id="crossing", yields=yields)


def height(h: np.ndarray, x: float, y: float) -> float:
    s = SIZE / (len(h) - 1)
    return float(h[round(y / s), round(x / s)])


@pytest.fixture(scope="module")
def crossed(solver: Solver) -> dict[float, np.ndarray]:
    """Settled heights by how far the crossing ridge yields."""
    return {k: np.array(solver.solve([summit(), crossing(k)], SETTINGS, LEVEL)[LEVEL]) for k in (0.0, 0.3, 0.6, 1.0)}


def test_a_yielding_stroke_leaves_the_summit_that_it_crosses(crossed: dict[float, np.ndarray], solver: Solver) -> None:
    """SPEC S310: it notched the summit by 200 m; wholly yielding, not by two, nor the upper flanks."""
    alone = np.array(solver.solve([summit()], SETTINGS, LEVEL)[LEVEL])
    assert height(crossed[0.0], *AT) < height(alone, *AT) - 200
    assert height(crossed[1.0], *AT) == pytest.approx(height(alone, *AT), abs=2)
    for y in (1700, 1850, 2200, 2400):
        assert height(crossed[1.0], 2048, y) == pytest.approx(height(alone, 2048, y), rel=0.05)
    # Between the two there is every degree, and none overshoots.
    tops = [height(crossed[k], *AT) for k in sorted(crossed)]
    assert tops == sorted(tops)


def test_where_it_meets_nobody_nothing_follows_from_yielding(solver: Solver) -> None:
    """SPEC S311: alone it is itself to the quantum, and so it is beyond the other's band."""
    one, other = (np.array(solver.solve([crossing(k)], SETTINGS, LEVEL)[LEVEL]) for k in (0.0, 1.0))
    assert np.abs(one - other).max() < SIZE / 64 / 2**LEVEL / 256


@pytest.mark.parametrize("yields", [0.0, 0.37, 1.0])
def test_kernels_agree_with_their_twin(device: Device, yields: float) -> None:
    """SPEC S312."""
    assert max(differences(device, [summit(), crossing(yields)], SETTINGS, LEVEL).values()) < 5e-4


def test_the_order_of_strokes_does_not_matter() -> None:
    """SPEC S312: yielding is a weight, not an order of edits."""
    strokes = [summit(), crossing(0.8), crossing(0.2).model_copy(update={"id": "third"})]
    one, other = (raster_reference.rasterise(pack(s, SETTINGS, 2)) for s in (strokes, strokes[::-1]))
    assert np.array_equal(one.height_f, other.height_f)
    assert np.array_equal(one.gradient_f, other.gradient_f)
