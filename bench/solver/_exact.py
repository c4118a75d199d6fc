"""Solutions to compare with, at any size: float64 by iterative refinement, on the solver's own float32 constraints.

The residual is taken in float64 on the host; a few float32 cycles on the device give the correction. Each round gains
three digits or so, whatever float32 can hold, until float64 has nothing left to gain: 10^-12 of the relief and below.
A sparse direct solve gives the same (a test compares them), but not at 4097 samples a side.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from esker import grid
from esker.contract import Stroke, TerrainSettings
from esker.solve import multigrid, reference
from esker.solve.opencl.device import Device
from esker.solve.opencl.gpu_levels import GpuSystem, GpuWorkspace
from esker.solve.opencl.levels import ClSystem, ClWorkspace
from esker.solve.opencl.workspaces import new_workspace

Field = NDArray[np.float64]
Field32 = NDArray[np.float32]
DeviceSystem = ClSystem | GpuSystem
DeviceWorkspace = ClWorkspace | GpuWorkspace
BLOCK = 128
"""Rows of a residual at once: a strip stays in the cache."""
ROUNDS = 12
CYCLES = 4
RELATIVE = 1e-12
"""The last correction, as a share of the largest value, at which the solution is taken as exact."""
PROBE_CYCLES = 12
PROBE_FIRST = 4
"""Convergence is measured between these cycles, once the start is forgotten."""


@dataclass(frozen=True)
class Constraints:
    """What the device made of a stroke set at its finest level, float32 read back.

    gradient_d, height_d: (n, n); gradient_f: (2, n, n); height_f: (n, n), without the guidance. See ``reference``.
    """

    level: int
    spacing_m: float
    screening: float
    gradient_d: Field32
    gradient_f: Field32
    height_d: Field32
    height_f: Field32


def workspace(device: Device, level: int) -> DeviceWorkspace:
    """A workspace whose fields can be read and written, with the kernels of the device."""
    made = new_workspace(device, level)
    assert isinstance(made, ClWorkspace | GpuWorkspace), "NumPy comes without a device only"
    return made


def constraints(w: DeviceWorkspace, settings: TerrainSettings) -> Constraints:
    """The constraints of a workspace that was loaded and not solved yet."""
    return Constraints(
        w.top,
        grid.spacing(w.top, settings.size_m),
        w.height.eps[w.top],
        w.gradient.get("d", w.top)[0],
        w.gradient.get("f", w.top),
        w.height.get("d", w.top)[0],
        w.height.get(w.height.static, w.top)[0],
    )


def full_multigrid(system: DeviceSystem) -> None:
    """u of the finest level from nothing, ready for cycles."""
    for level in range(system.top):
        multigrid.start(system, level)
        multigrid.finish(system, level)
    multigrid.start(system, system.top)


def load(w: DeviceWorkspace, strokes: tuple[Stroke, ...], settings: TerrainSettings) -> Constraints:
    """Rasterise afresh, whatever the workspace held, and read the constraints."""
    w.packer.forget()
    w.load(strokes, settings)
    return constraints(w, settings)


def residual(u: Field, f: Field32 | Field, d: Field32, screening: float) -> tuple[Field32, float]:
    """(float32 of f - A u, its largest entry), channels (c, n, n), a strip of rows at a time."""
    n = u.shape[1]
    out = np.empty(u.shape, dtype=np.float32)
    largest = 0.0
    for first in range(0, n, BLOCK):
        last = min(n, first + BLOCK)
        below, above = max(0, first - 1), min(n, last + 1)
        # The mirror of ``reference.laplacian`` acts on whole grids: give strips in the middle one spare row a side.
        strip = np.s_[:, below:above]
        r = reference.residual(
            u[strip], f[strip].astype(np.float64), d[None, below:above].astype(np.float64), screening
        )
        r = r[:, first - below : r.shape[1] - (above - last)]
        out[:, first:last] = r
        largest = max(largest, float(np.abs(r).max()))
    return out, largest


def solve(system: DeviceSystem, f: Field32 | Field, d: Field32, screening: float, start: Field) -> Field:
    """A u = f to float64 rest, from ``start`` (c, n, n), which holds the right values at fixed samples.

    Overwrites f and u of the system's finest level. Raises RuntimeError when refinement stalls above RELATIVE.
    """
    top, u = system.top, start.copy()
    zero = np.zeros(u.shape, dtype=np.float32)
    step, scale = np.inf, 1.0
    for _ in range(ROUNDS):
        r, largest = residual(u, f, d, screening)
        if largest == 0:
            return u
        system.put("f", top, r / np.float32(largest))
        system.put("u", top, zero)
        multigrid.refresh(system)
        for _ in range(CYCLES):
            multigrid.cycle(system)
        correction = system.get("u", top).astype(np.float64) * largest
        u += correction
        before, step = step, float(np.abs(correction).max())
        scale = max(float(np.abs(u).max()), 1e-300)
        if step < RELATIVE * scale or step > 0.5 * before:
            break
    if step > 1e-9 * scale:
        raise RuntimeError(f"refinement stalled at {step / scale:.1e} of the largest value")
    return u


def at_fixed(f: Field32 | Field, d: Field32) -> Field:
    """Zero, and the value at fixed samples: what ``solve`` may start from."""
    return np.where(d[None] < 0, f, 0).astype(np.float64)


def factor(system: DeviceSystem, d: Field32, seed: int = 1) -> float:
    """Asymptotic convergence factor of the device's own cycle, largest norm, on A u = 0 from a random start.

    The error is the solution itself here, so float32 follows it down as far as one likes: no rounding floor.
    """
    top = system.top
    rng = np.random.default_rng(seed)
    shape = (system.channels, *d.shape)
    noise = rng.standard_normal(shape, dtype=np.float32)
    smooth = np.linspace(-1, 1, d.shape[0], dtype=np.float32)
    u = np.where(d[None] < 0, np.float32(0), noise + 3 * smooth[None, :, None] * smooth[None, None, :])
    system.put("f", top, np.zeros(shape, dtype=np.float32))
    system.put("u", top, u)
    multigrid.refresh(system)
    sizes = []
    for _ in range(PROBE_CYCLES):
        multigrid.cycle(system)
        sizes.append(float(np.abs(system.get("u", top)).max()))
    first, last = sizes[PROBE_FIRST - 1], sizes[-1]
    return (last / first) ** (1 / (PROBE_CYCLES - PROBE_FIRST)) if first > 0 else 0.0


@dataclass(frozen=True)
class Exact:
    """Float64 solutions in metres. heights: (n, n); relief: highest minus lowest, base included; f: (n, n), right-hand
    side of the height step with the exact gradient."""

    f: Field
    heights: Field
    relief: float


def exact(w: DeviceWorkspace, c: Constraints) -> Exact:
    """Both steps to float64 rest. The workspace must be loaded; its finest f and u are overwritten."""
    gradient = solve(w.gradient, c.gradient_f, c.gradient_d, c.screening, at_fixed(c.gradient_f, c.gradient_d))
    static, d = c.height_f[None].astype(np.float64), c.height_d[None].astype(np.float64)
    f = reference.divergence(static, d, gradient, c.spacing_m)
    heights = solve(w.height, f, c.height_d, c.screening, at_fixed(f, c.height_d))[0]
    # Ground that is one crest's height everywhere has that height as its relief.
    return Exact(f[0], heights, max(float(np.ptp(heights)), float(np.abs(heights).max()), 1e-9))


def errors_per_cycle(system: DeviceSystem, want: Field, count: int) -> Iterator[float]:
    """Largest error of the finest u: after the full multigrid start, then after each cycle."""
    full_multigrid(system)
    yield float(np.abs(system.get("u", system.top)[0] - want).max())
    for _ in range(count):
        multigrid.cycle(system)
        yield float(np.abs(system.get("u", system.top)[0] - want).max())
