"""One solver for all tests of this folder: a program is compiled once."""

from __future__ import annotations

from dataclasses import replace

import pytest

from esker.solve.opencl.device import Device, open_device, row_kernels
from esker.solve.solver import Solver
from tests.solver.failing import STROKES
from tests.solver.scenes import SETTINGS
from tests.solver.twins import small_tiles


@pytest.fixture(scope="session")
def device() -> Device:
    """The best device, with row-wise kernels whatever it is."""
    found = open_device()
    if found is None:
        pytest.skip("no OpenCL device: the NumPy twin is tested by itself")
    return row_kernels(found)


@pytest.fixture(scope="session")
def solver() -> Solver:
    return Solver()


@pytest.fixture(params=["rows", "tiles"])
def fresh(request: pytest.FixtureRequest) -> Solver:
    """A solver that has not solved, on a device of a name of its own."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ESKER_KERNELS", request.param)
        made = small_tiles(Solver())
    if made._device is None:
        pytest.skip("no OpenCL device")
    made._device = replace(made._device, name=f"{request.param} under test")
    return made


@pytest.fixture
def used(fresh: Solver) -> Solver:
    """A solver that has solved, with an idle workspace of level 2, on a device of a name of its own."""
    fresh.solve(STROKES, SETTINGS, 2)
    return fresh
