"""From a solve to its detail: what the Python API and ``esker solve`` share (docs/synthesis.md).

The room of synthesis knows arrays only; this gives it a solver's heights, channels, refinement and device.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from esker.contract import DEFAULT_REFINED_LEVEL, MAX_REFINED_LEVEL, Channel, Stroke, TerrainSettings
from esker.events import ChannelLevel, Done, SolveEvent
from esker.solve.base import Base
from esker.solve.channels import channel_level
from esker.solve.opencl.device import Device
from esker.solve.opencl.faults import finished
from esker.solve.solver import Basis, Solver
from esker.synthesis.detailed import DetailedTerrain, site_of
from esker.synthesis.interpolate import Window
from esker.synthesis.kernels import Kernels
from esker.synthesis.site import Site
from esker.synthesis.subdivide import Samples


@dataclass(frozen=True)
class Settled:
    """A settled solve with its channels, (n, n) float32 each, by name; over a base "survey" too."""

    basis: Basis
    channels: Mapping[str, NDArray[np.float32]]


def settle(
    solver: Solver,
    strokes: Sequence[Stroke],
    settings: TerrainSettings,
    level: int,
    step: Callable[[SolveEvent], None] | None = None,
    *,
    base: Base | None = None,
) -> Settled:
    """Solve levels 0..``level`` to rest, over a base; ``step`` is told each step. Raises ValueError, DeviceErrors as
    solves do."""
    basis: Basis | None = None
    channels: dict[str, NDArray[np.float32]] = {}
    for result in solver.steps(strokes, settings, level, basis=True, base=base):
        if step is not None:
            step(result)
        if isinstance(result, ChannelLevel):
            channels[result.channel.name.lower()] = result.heights  # coarse to fine: the last is the finest
        basis = result.basis if isinstance(result, Done) else basis
    if basis is None:
        raise RuntimeError("The solve ended before the ground was settled.")
    if base is not None:
        channels[Channel.SURVEY.name.lower()] = base.survey(channel_level(level))
    return Settled(basis, channels)


def detailed(
    solver: Solver,
    settled: Settled,
    refined_level: int = DEFAULT_REFINED_LEVEL,
    ground_m: tuple[float, float] | None = None,
) -> DetailedTerrain:
    """A maker of windows with detail of a settled solve, on the solver's device.

    ``ground_m``: lowest and highest sample of the elevation layers (``document.layers.span_m``), None without any.
    Raises ValueError for a level that is not refined, DeviceErrors for a device that fails.
    """
    if not 0 <= refined_level <= MAX_REFINED_LEVEL:
        raise ValueError(f"tiles are refined to level 0..{MAX_REFINED_LEVEL}, not {refined_level}")
    basis, base = settled.basis, settled.basis.base
    refiner = solver.refiner(basis)
    levels = [] if base is None else [base.level(k, solver.device) for k in range(basis.level + 1)]
    shown = _shown(settled.channels, max(refined_level, basis.level))
    site = site_of(basis.settings, basis.heights, shown, levels, ground_m)
    maker = None if solver.device is None else _OnDevice(solver.device)

    def ground(level: int, rows: slice, cols: slice) -> NDArray[np.float32]:
        assert base is not None
        return base.window(level, rows, cols, solver.device)

    return DetailedTerrain(site, maker, refiner.window, refined_level, None if base is None else ground)


def _shown(channels: Mapping[str, NDArray[np.float32]], finest: int) -> Mapping[str, NDArray[np.float32]]:
    """The channels where no tile is finer than ``finest``: detail goes on below it, as on a server's tiles."""
    name = Channel.SURVEY.name.lower()
    if name not in channels:
        return channels
    return {**channels, name: np.minimum(channels[name], np.float32(finest))}


class _OnDevice:
    """Kernels whose faults are the solver's DeviceErrors."""

    def __init__(self, device: Device) -> None:
        self._device = device
        self._kernels = finished(device, lambda: Kernels(device))

    def detail(self, site: Site, window: Window) -> Samples:
        """See ``Kernels.detail``."""
        return finished(self._device, lambda: self._kernels.detail(site, window))
