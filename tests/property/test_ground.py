"""Two hundred scenes of the search for wrong ground (SPEC S180), which `esker bench search` does ten thousand times.

The scenes are the same on every run: what the search finds becomes a test with a name (tests/solver/test_lines.py). A
scene that fails here is not made simpler: the search does that.
"""

from __future__ import annotations

import pytest
from hypothesis import HealthCheck, Phase, given, settings

from bench.solver import _adversary, _direct, search

CASES = (("opencl", 0, 130), ("opencl", 1, 30), ("opencl", 2, 4), ("numpy", 0, 30), ("numpy", 1, 6))


@pytest.mark.parametrize(("device", "level", "cases"), CASES)
def test_settled_ground_is_that_of_direct_solves(device: str, level: int, cases: int) -> None:
    if device not in search.solvers():
        pytest.skip("there is no OpenCL here")

    @settings(
        max_examples=cases,
        derandomize=True,
        database=None,
        deadline=None,
        phases=(Phase.generate,),
        suppress_health_check=list(HealthCheck),
    )
    @given(_adversary.scenes(level))
    def every(scene: _direct.Scene) -> None:
        found = _direct.measure(scene, {device: search.solvers()[device]})
        assert max(found.values()) <= 1, (found, scene.document())

    with _adversary.drawn_alike():
        every()
