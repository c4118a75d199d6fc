"""Kernels are compiled once for all tests of this folder."""

from __future__ import annotations

import pytest

from esker.solve.opencl.device import open_device
from esker.synthesis.kernels import Kernels


@pytest.fixture(scope="session")
def kernels() -> Kernels:
    device = open_device()
    if device is None:
        pytest.skip("no OpenCL device: the NumPy twin is tested by itself")
    return Kernels(device)
