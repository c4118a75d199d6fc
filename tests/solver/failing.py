"""Faults to inject: pyopencl's own exceptions, raised by its functions instead of what they do."""

from __future__ import annotations

import gc
from collections.abc import Callable
from typing import Any, Final

import numpy as np
import pyopencl as cl

from esker.solve.opencl import workspaces
from esker.solve.solver import Solver
from tests.solver.scenes import SCENES, SETTINGS

STROKES: Final = SCENES["five"]
NO_MEMORY, OUT_OF_RESOURCES, BUILD_FAILURE, LOST, INVALID_VALUE = -4, -5, -11, -36, -30


def error(code: int, routine: str = "clEnqueueNDRangeKernel") -> cl.Error:
    """What pyopencl raises for a code of OpenCL."""
    kind = cl.MemoryError if code == NO_MEMORY else cl.LogicError if code <= INVALID_VALUE else cl.RuntimeError
    return kind(cl._cl._ErrorRecord(msg="injected", code=code, routine=routine))


class Failing:
    """A function of pyopencl that works ``after`` times and then raises ``code``, ``times`` times."""

    def __init__(self, real: Callable[..., Any], code: int, after: int = 0, times: int = 1 << 30) -> None:
        self.real, self.code, self.after, self.times, self.calls = real, code, after, times, 0

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        self.calls += 1
        if self.after < self.calls <= self.after + self.times:
            raise error(self.code)
        return self.real(*args, **kwargs)


def held(solver: Solver) -> int:
    """Bytes of the workspaces on the device of a solver."""
    assert solver._device is not None
    gc.collect()
    return workspaces.held_bytes(solver._device)


def heights(solver: Solver, level: int = 2) -> np.ndarray:
    """A settled level of STROKES."""
    return solver.solve(STROKES, SETTINGS, level)[level]
