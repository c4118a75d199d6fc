"""Two hundred scenes of the search for wrong ground (SPEC S180), which `esker bench search` does ten thousand times.

The scenes are the same on every run: what the search finds becomes a test with a name (tests/solver/test_lines.py). A
scene that fails here is not made simpler: the search does that.
"""

from __future__ import annotations

import json
import zlib

import pytest
from hypothesis import HealthCheck, Phase, given, settings

from bench.solver import _adversary, _direct, search

CASES = ((0, 130), (1, 30), (2, 4))
"""Levels, and scenes of each."""
NUMPY_EVERY = 4
"""One scene of so many is solved by NumPy, too, but on level 2: it takes ten times as long as OpenCL."""


def is_for_numpy(scene: _direct.Scene) -> bool:
    """Whether NumPy solves a scene, too. The scene itself says it: one that fails is run a second time."""
    return scene.level < 2 and zlib.crc32(json.dumps(scene.document()).encode()) % NUMPY_EVERY == 0


@pytest.mark.parametrize(("level", "cases"), CASES)
def test_settled_ground_is_that_of_direct_solves(level: int, cases: int) -> None:
    """The direct solve of a scene serves all solvers that are compared with it."""

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
        solvers = dict(search.solvers())
        if "opencl" in solvers and not is_for_numpy(scene):
            del solvers["numpy"]
        found = _direct.measure(scene, solvers)
        assert max(found.values()) <= 1, (found, scene.document())

    with _adversary.drawn_alike():
        every()
