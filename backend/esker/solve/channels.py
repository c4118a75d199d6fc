"""Amplitude and roughness, diffused from the strokes for synthesis to use (DESIGN 5.4).

Both are one system with two channels, E = sum_edges (c_j - c_i)^2 + sum_i a_i (c_i - t_i)^2 + eps sum_i (c_i - base)^2,
solved CHANNEL_LEVELS_BELOW levels below the heights, as differences from the base: known on crests and in flank bands,
free elsewhere, and back at the base a few reaches away.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from esker.contract import (
    BASE_AMPLITUDE_M,
    BASE_ROUGHNESS,
    CHANNEL_LEVELS_BELOW,
    ROUGHNESS_QUANTA,
    Channel,
    Stroke,
    TerrainSettings,
)
from esker.solve import gpu_levels, levels, multigrid, raster, reference_raster
from esker.solve.constraints import Packer
from esker.solve.device import Device
from esker.solve.faults import finished
from esker.solve.reference import NumpySystem

BASES = ((Channel.AMPLITUDE, BASE_AMPLITUDE_M), (Channel.ROUGHNESS, BASE_ROUGHNESS))
"""The channels in their order in the system, and what they are where no stroke says otherwise."""
TOLERANCE = 0.25 / ROUGHNESS_QUANTA
"""Error at which the channels are at rest: a quarter of a quantum of roughness, and far less of one of amplitude."""

Strokes = tuple[Stroke, ...]
Values = NDArray[np.float32]


def channel_level(top: int) -> int:
    """The finest level of the channels of a terrain whose heights are solved up to level ``top``."""
    return max(0, top - CHANNEL_LEVELS_BELOW)


class ChannelWorkspace(Protocol):
    """Memory and kernels for the channels of one level."""

    @property
    def system(self) -> multigrid.System: ...

    def load(self, strokes: Sequence[Stroke], settings: TerrainSettings) -> None:
        """Rasterise and coarsen what changed since the last stroke set."""

    def read(self) -> Values:
        """Both channels as differences from their base, (2, n, n) float32."""


def new_channels(device: Device | None, level: int) -> ChannelWorkspace:
    """A workspace on a device; None is NumPy. Raises DeviceErrors."""
    if device is None:
        return _NumpyChannels(level)
    return finished(
        device, lambda: _RowChannels(device, level) if device.plan is None else _TileChannels(device, level)
    )


class _NumpyChannels:
    def __init__(self, level: int) -> None:
        self.level, self.packer = level, Packer(level)
        self.system: NumpySystem

    def load(self, strokes: Sequence[Stroke], settings: TerrainSettings) -> None:
        tables, window = self.packer.pack(strokes, settings)
        if window is not None:
            d, f = reference_raster.rasterise_channels(tables)
            self.system = NumpySystem(d[None], f, tables.screening, self.level)

    def read(self) -> Values:
        return np.asarray(self.system.fields["u", self.level], dtype=np.float32)


class _ClChannels:
    """Channels on an OpenCL device, whatever its kernels' layout."""

    def __init__(self, system: levels.ClSystem | gpu_levels.GpuSystem, launch: raster.Launcher, level: int) -> None:
        self.level, self.packer, self.system, self._launch = level, Packer(level), system, launch

    def load(self, strokes: Sequence[Stroke], settings: TerrainSettings) -> None:
        tables, window = self.packer.pack(strokes, settings)
        if window is None:
            return
        shape, fields = self.system.shapes[self.level], self.system.fields
        raster.rasterise_channels(
            self._launch, tables, window, fields["d", self.level], fields["f", self.level], shape.pitch, shape.stride
        )
        self.system.coarsen(tables.screening, window.sample_rows)

    def read(self) -> Values:
        return self.system.get("u", self.level)


class _RowChannels(_ClChannels):
    def __init__(self, device: Device, level: int) -> None:
        launch = levels.Launcher(device, level)
        super().__init__(levels.ClSystem(launch, level, 2, "f"), launch, level)


class _TileChannels(_ClChannels):
    def __init__(self, device: Device, level: int) -> None:
        launch = gpu_levels.GpuLauncher(device)
        super().__init__(gpu_levels.GpuSystem(launch, level, 2, "f"), gpu_levels.Bins(launch), level)


class ChannelSolver:
    """Diffuses the channels of stroke sets of one level. Use it from one thread; a solve is a few milliseconds."""

    def __init__(self, device: Device | None, level: int) -> None:
        self.level = level
        self._device = device
        self._workspace: ChannelWorkspace | None = None

    def solve(self, strokes: Sequence[Stroke], settings: TerrainSettings) -> Iterator[tuple[Channel, Values]]:
        """Each channel, (n, n) float32 of ``level``, amplitude in metres and roughness 0..1, row 0 south.

        A pure function of the strokes and the settings. Raises DeviceErrors.
        """
        workspace, self._workspace = self._workspace or new_channels(self._device, self.level), None
        workspace.load(strokes, settings)
        diffuse(workspace.system)
        values = workspace.read()
        self._workspace = workspace  # kept only if nothing failed: a raster that stopped half-way is not trusted
        for (channel, base), difference in zip(BASES, values, strict=True):
            top = 1.0 if channel == Channel.ROUGHNESS else np.inf
            yield channel, np.clip(difference + np.float32(base), 0.0, top, dtype=np.float32)


def diffuse(system: multigrid.System) -> None:
    """Full multigrid, then cycles to rest."""
    for level in range(system.top):
        multigrid.start(system, level)
        multigrid.finish(system, level)
    multigrid.start(system, system.top)
    if system.top > 0:
        for _ in multigrid.converge(system, TOLERANCE):
            pass
