"""Amplitude, roughness and what is painted, diffused from the strokes for synthesis to use (DESIGN 5.4).

A channel is made from two layers, each with an equation of its own, solved CHANNEL_LEVELS_BELOW levels below the
heights: sum_edges (c_j - c_i)^2 + sum_i a_i (c_i - t_i)^2 + eps sum_i (c_i - k_i t_i)^2 for c, the difference from the
base, where k is how far a sample is known, 0..1. What strokes of the ground ask is known on crests and in flank bands,
free elsewhere, and back at the base a few reaches away. Paint is known under the brush and lies over it: beside the
painted value its cover is diffused, 1 on its line, and the channel is strokes (1 - cover) + paint. A layer of which
nobody asks anything costs nothing.
"""

from __future__ import annotations

from collections.abc import Generator, Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from esker import grid
from esker.contract import (
    AMPLITUDE_QUANTA_PER_M,
    BIAS_QUANTA,
    CHANNEL_LEVELS_BELOW,
    ROUGHNESS_QUANTA,
    Channel,
    Stroke,
    TerrainSettings,
)
from esker.solve import multigrid
from esker.solve.base import Base
from esker.solve.constraints import raster_reference
from esker.solve.constraints.channel_targets import BASES, STROKES_ASK, Contributors, Layer, contributors, reach_of
from esker.solve.constraints.constraints import Packer
from esker.solve.injection import frozen, injections
from esker.solve.opencl import gpu_levels, levels, raster
from esker.solve.opencl.device import Device
from esker.solve.opencl.faults import finished
from esker.solve.opencl.fields import Shape
from esker.solve.reference import NumpySystem

TOLERANCES = {
    Channel.AMPLITUDE: 0.25 / AMPLITUDE_QUANTA_PER_M,
    Channel.ROUGHNESS: 0.25 / ROUGHNESS_QUANTA,
} | dict.fromkeys((Channel.SNOW, Channel.GRASS, Channel.FOREST, Channel.WETNESS, Channel.EROSION), 0.25 / BIAS_QUANTA)
"""Error at which a channel is at rest: a quarter of a quantum."""

Values = NDArray[np.float32]
Levels = tuple[Values, ...]
Loading = Generator[None, None, bool]


def channel_level(top: int) -> int:
    """The finest level of the channels of a terrain whose heights are solved up to level ``top``."""
    return max(0, top - CHANNEL_LEVELS_BELOW)


@lru_cache(maxsize=64)
def at_base(channel: Channel, level: int) -> Levels:
    """Levels 0..``level`` of a channel of which nothing is asked: the same arrays every time."""
    n = grid.samples(level)
    return tuple(injections(frozen(np.full((n, n), BASES[channel], dtype=np.float32))))


class LayerWorkspace(Protocol):
    """Memory and kernels for one layer of one level."""

    @property
    def system(self) -> multigrid.System: ...

    def loading(self, strokes: Sequence[Stroke], settings: TerrainSettings, base: Base | None) -> Loading:
        """Rasterise and coarsen what changed since the last stroke set and base; whether anything did."""

    def read(self) -> Values:
        """The layer as a difference from the base, float32 (1, n, n), or (2, n, n) with its cover."""


def new_layer(device: Device | None, level: int, layer: Layer) -> LayerWorkspace:
    """A workspace on a device; None is NumPy. Raises DeviceErrors."""
    if device is None:
        return _NumpyLayer(level, layer)
    kind = _RowLayer if device.plan is None else _TileLayer
    return finished(device, lambda: kind(device, level, layer))


def _covers(layer: Layer) -> bool:
    """Returns whether drawn strokes may ask something of the channel, for this paint to lie over."""
    return layer.painted and layer.channel in STROKES_ASK


class _NumpyLayer:
    def __init__(self, level: int, layer: Layer) -> None:
        self.level, self.packer, self._covers = level, Packer(level, layer), _covers(layer)
        self.system: NumpySystem

    def loading(self, strokes: Sequence[Stroke], settings: TerrainSettings, base: Base | None) -> Loading:
        tables, window = yield from self.packer.packing(strokes, settings, base)
        if window is not None:
            d, *f = raster_reference.rasterise_channel(tables, None if base is None else base.level(self.level))
            self.system = NumpySystem(d[None], np.stack(f[: 1 + self._covers]), tables.screening, self.level)
        return window is not None

    def read(self) -> Values:
        return np.asarray(self.system.fields["u", self.level], dtype=np.float32)


class _ClLayer:
    """A layer on an OpenCL device, whatever its kernels' layout."""

    def __init__(
        self, system: levels.ClSystem | gpu_levels.GpuSystem, launch: raster.Launcher, level: int, layer: Layer
    ) -> None:
        self.level, self.packer, self.system, self._launch = level, Packer(level, layer), system, launch
        self._base: tuple[bytes, Any] = b"", None

    def loading(self, strokes: Sequence[Stroke], settings: TerrainSettings, base: Base | None) -> Loading:
        tables, window = yield from self.packer.packing(strokes, settings, base)
        if window is None:
            return False
        shape, fields = self.system.shapes[self.level], self.system.fields
        d, f = fields["d", self.level], fields["f", self.level]
        covered = self.system.channels > 1
        under = None if base is None else self._under(base, shape)
        raster.rasterise_channel(self._launch, tables, window, d, f, shape.pitch, shape.stride, covered, under)
        self.system.coarsen(tables.screening, window.sample_rows)
        return True

    def _under(self, base: Base, shape: Shape) -> Any:
        """The base at the samples, on the device."""
        if self._base[0] != base.digest:
            pad = self.system.pad
            host = np.zeros(shape.stride + pad, dtype=np.float32)
            rows = host[pad : pad + shape.n * shape.pitch]
            np.copyto(
                np.lib.stride_tricks.as_strided(rows, (shape.n, shape.n), (4 * shape.pitch, 4)), base.level(self.level)
            )
            self._base = base.digest, self._launch.constant(host)
        return self._base[1]

    def read(self) -> Values:
        return self.system.get("u", self.level)


class _RowLayer(_ClLayer):
    def __init__(self, device: Device, level: int, layer: Layer) -> None:
        launch = levels.Launcher(device, level)
        super().__init__(levels.ClSystem(launch, level, 1 + _covers(layer), "f"), launch, level, layer)


class _TileLayer(_ClLayer):
    def __init__(self, device: Device, level: int, layer: Layer) -> None:
        launch = gpu_levels.GpuLauncher(device)
        system = gpu_levels.GpuSystem(launch, level, 1 + _covers(layer), "f")
        super().__init__(system, gpu_levels.Bins(launch), level, layer)


class ChannelSolver:
    """Diffuses the channels of stroke sets of one level. Use it from one thread; a channel is a few milliseconds."""

    def __init__(self, device: Device | None, level: int) -> None:
        self.level = level
        self._device = device
        self._layers: dict[Layer, tuple[LayerWorkspace, tuple[float, float], Values]] = {}
        """Per layer that was asked for last time its memory, the bounds of its values, and what came out."""
        self._made: dict[Channel, tuple[Values | None, Values | None, Levels]] = {}
        """Per channel the layers that it was made from last, and its levels."""

    def solve(
        self, strokes: Sequence[Stroke], settings: TerrainSettings, base: Base | None = None
    ) -> Iterator[tuple[Channel, Values]]:
        """Each channel, (n, n) float32 of ``level`` in its unit (metres, 0..1, -1..1), row 0 south, read-only.

        A pure function of the strokes and the settings. Raises DeviceErrors.
        """
        for channel, pyramid in self.pyramids(contributors(strokes, settings), settings, base=base):
            yield channel, pyramid[-1]

    def pyramids(
        self,
        asked: Mapping[Layer, Contributors],
        settings: TerrainSettings,
        channels: Iterable[Channel] = BASES,
        base: Base | None = None,
    ) -> Iterator[tuple[Channel, Levels]]:
        """Yields some channels, with levels 0..``level`` of each. Channels that did not change since the last time are
        the same arrays. ``asked``: ``channel_targets.contributors`` of the strokes."""
        return (found for found in self.making(asked, settings, channels, base) if found is not None)

    def making(
        self,
        asked: Mapping[Layer, Contributors],
        settings: TerrainSettings,
        channels: Iterable[Channel] = BASES,
        base: Base | None = None,
    ) -> Iterator[tuple[Channel, Levels] | None]:
        """``pyramids``, with None wherever the work can be left; others may use this solver meanwhile."""
        for channel in channels:
            ground_layer, paint_layer = Layer(channel, painted=False), Layer(channel, painted=True)
            ground = yield from self._diffused(ground_layer, asked.get(ground_layer), settings, base)
            paint = yield from self._diffused(paint_layer, asked.get(paint_layer), settings, base)
            made = self._made.get(channel)
            if made is None or made[0] is not ground or made[1] is not paint:
                made = ground, paint, self._composed(channel, ground, paint)
            self._made[channel] = made
            yield channel, made[2]

    def _composed(self, channel: Channel, ground: Values | None, paint: Values | None) -> Levels:
        """Levels of a channel from its layers; None: a layer of which nothing is asked."""
        if ground is None and paint is None:
            return at_base(channel, self.level)
        over = 0 if ground is None else ground[0] * (1 - paint[1]) if paint is not None else ground[0]
        finest = (0 if paint is None else paint[0]) + over + np.float32(BASES[channel])
        return tuple(injections(frozen(np.asarray(finest, dtype=np.float32))))

    def _diffused(
        self, layer: Layer, asking: Contributors | None, settings: TerrainSettings, base: Base | None
    ) -> Generator[None, None, Values | None]:
        """A layer as ``LayerWorkspace.read`` gives it, the same array as last time if nothing changed; None at zero."""
        kept = self._layers.pop(layer, None)  # kept again only if nothing fails: half a raster is not to be trusted
        if asking is None:
            return None
        workspace = new_layer(self._device, self.level, layer) if kept is None else kept[0]
        under = None if layer.painted else base  # a brush lies on the ground, however high that is
        changed = yield from workspace.loading(
            asking.strokes, settings.model_copy(update={"reach_m": reach_of(layer, settings)}), under
        )
        if changed:
            diffuse(workspace.system, TOLERANCES[layer.channel])
        if kept is None or changed or kept[1] != asking.bounds:
            values = workspace.read()
            np.clip(values[0], *asking.bounds, out=values[0])
            np.clip(values[1:], 0, 1, out=values[1:])
            kept = workspace, asking.bounds, values
        self._layers[layer] = kept
        return kept[2]


def diffuse(system: multigrid.System, tolerance: float) -> None:
    """Full multigrid, then cycles to rest."""
    for level in range(system.top):
        multigrid.start(system, level)
        multigrid.finish(system, level)
    multigrid.start(system, system.top)
    for _ in multigrid.converge(system, tolerance):
        pass
