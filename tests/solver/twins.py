"""What tests of kernels share: noise for their fields, and how close float32 comes to the float64 twins."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from esker import grid
from esker.contract import Stroke
from esker.solve.opencl import device as devices
from esker.solve.opencl import gpu_program
from esker.solve.opencl.device import Device, open_device
from esker.solve.opencl.gpu_levels import GpuLauncher, GpuSystem, GpuWorkspace
from esker.solve.opencl.gpu_program import plan
from esker.solve.opencl.levels import ClSystem, ClWorkspace, Launcher
from esker.solve.opencl.pocl import home
from esker.solve.solver import Solver

Field = NDArray[np.float64]
LEVELS = (1, 2, 3)
EPS = 0.01
SMALLEST = plan(256, 30 << 10, 1)
"""Tiles for an integrated GPU with work-groups of 256 and less than 32 KiB of local memory."""


@cache
def tile_device(size: str) -> Device | None:
    """A device with tile kernels, as large as it can hold them ("full") or as small as they come ("smallest").

    None where there is no OpenCL. Without a GPU it is PoCL's CPU device, which has work-groups and local memory too.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ESKER_KERNELS", "tiles")
        patch.setattr(devices, "_opened", {})
        if size == "smallest":
            patch.setattr(gpu_program, "plan_of", lambda _: SMALLEST)
        found = open_device()
    assert found is not None or home.site() is None, "PoCL's wheel is here, so kernels that it refuses are broken"
    return found


def small_tiles(solver: Solver) -> Solver:
    """Makes a solver with tile kernels visit each level by small tiles and never by strips; returns the solver.

    A CPU needs half of the time for small tiles, and ``test_gpu_kernels`` shows that no bit depends on the choice.
    """
    device = solver._device
    if device is not None and device.plan is not None:
        solver._device = replace(device, plan=replace(device.plan, units=1 << 20))
    return solver


def noise(shape: tuple[int, ...], seed: int = 0) -> Field:
    return np.random.default_rng(seed).normal(size=shape).astype(np.float32).astype(np.float64)


def stiffness(n: int, seed: int = 1) -> Field:
    """Free, sprung and fixed samples, shape (1, n, n)."""
    rng = np.random.default_rng(seed)
    d = np.where(rng.random((1, n, n)) < 0.3, rng.random((1, n, n)), 0.0)
    return np.where(rng.random((1, n, n)) < 0.05, -1.0, d).astype(np.float32).astype(np.float64)


def close(actual: NDArray[np.float32], expected: Field, scale: float = 1.0) -> None:
    assert actual.shape == expected.shape
    assert np.abs(actual - expected).max() < 2e-5 * scale * max(1.0, np.abs(expected).max())


def new_system(device: Device, level: int, channels: int) -> ClSystem | GpuSystem:
    """A system with the kernels of the device."""
    if device.plan is None:
        return ClSystem(Launcher(device, level), level, channels, "f")
    return GpuSystem(GpuLauncher(device), level, channels, "f")


def new_workspace(device: Device, level: int) -> ClWorkspace | GpuWorkspace:
    return ClWorkspace(device, level) if device.plan is None else GpuWorkspace(device, level)


def noise_fields(level: int, channels: int) -> dict[str, Field]:
    """Fields of noise of a finest level, and e of the next."""
    n, m = grid.samples(level), grid.samples(level - 1)
    return {
        "d": stiffness(n),
        "f": noise((channels, n, n), 2),
        "u": noise((channels, n, n), 3),
        "e": noise((channels, m, m), 4),
    }


def fill(s: ClSystem | GpuSystem) -> dict[str, Field]:
    """Fields of the finest level and e of the next are noise from now on; the same fields for the twin."""
    level = s.top
    s.eps = {k: EPS * 4.0 ** (level - k) for k in range(level + 1)}
    host = noise_fields(level, s.channels)
    for name in ("d", "f", "u"):
        s.put(name, level, host[name])
    s.put("e", level - 1, host["e"])
    return host


def edited(strokes: list[Stroke]) -> list[Stroke]:
    """One of fifty strokes changed, three gone."""
    return [*strokes[:20], strokes[20].model_copy(update={"plateau_radius_m": 90.0}), *strokes[21:-3]]
