"""One solver for all tests of this folder: a program is compiled once."""

from __future__ import annotations

import pytest

from esker.solve.device import Device, open_device, row_kernels
from esker.solve.solver import Solver


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
