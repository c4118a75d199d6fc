"""The two steps of a solve on a device, whatever its kernels: loading strokes and reading results (DESIGN 5.3)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from esker.contract import Stroke, TerrainSettings
from esker.solve import multigrid, raster
from esker.solve.constraints import Packer
from esker.solve.fields import Shape
from esker.solve.queue import Queue
from esker.solve.tables import RASTER_BINS, Tables, Window


class DeviceSystem(multigrid.System, Protocol):
    """A ``multigrid.System`` whose fields (``fields.Fields``) lie on a device."""

    shapes: dict[int, Shape]
    fields: dict[tuple[str, int], Any]

    def coarsen(self, screening: float, rows: tuple[int, int] | None = None) -> None:
        """Constraints of all coarser levels from those of the top, of which only ``rows`` (half open) changed."""

    def get(self, name: str, level: int) -> NDArray[np.float32]:
        """See ``fields.Fields``."""

    def put(self, name: str, level: int, value: NDArray[Any]) -> None:
        """See ``fields.Fields``."""


S = TypeVar("S", bound=DeviceSystem)


class DeviceWorkspace(Generic[S]):
    """``solver.Workspace`` but for ``guide``, which is the kernels' own."""

    def __init__(self, queue: Queue, gradient: S, height: S, bins: raster.Launcher) -> None:
        self.top = height.top
        self.gradient, self.height = gradient, height
        self.packer = Packer(self.top)
        self.size_m = 1.0
        self._queue, self._bins = queue, bins

    def load(self, strokes: Sequence[Stroke], settings: TerrainSettings) -> None:
        """``loading`` without a pause."""
        for _ in self.loading(strokes, settings):
            pass

    def loading(self, strokes: Sequence[Stroke], settings: TerrainSettings) -> Iterator[None]:
        """Rasterise what changed since the last set, and coarsen; may be left between bands of bins."""
        tables, window = self.packer.pack(strokes, settings)
        self.size_m = tables.size_m
        if window is None:
            return
        for count, band in enumerate(window.bands(RASTER_BINS)):
            if count:
                self._queue.queue.finish()
                yield
            self.rasterise(tables, band)
        self.gradient.coarsen(tables.screening, window.sample_rows)
        self.height.coarsen(tables.screening, window.sample_rows)

    def warm(self, heights: NDArray[np.float32]) -> None:
        """Start the height step from these heights of the finest level instead of from coarser levels."""
        fixed = self.height.get("d", self.top) < 0
        self.height.put("u", self.top, np.where(fixed, self.height.get("s", self.top), heights[None]))

    def rasterise(self, tables: Tables, window: Window) -> None:
        """Constraints of the finest level inside a window of bins."""
        shape, h, g = self.height.shapes[self.top], self.height.fields, self.gradient.fields
        fields = (h["d", self.top], h["s", self.top], g["d", self.top], g["f", self.top])
        raster.rasterise(self._bins, tables, window, raster.Target(*fields, shape.pitch, shape.stride))

    def read(self, level: int) -> NDArray[np.float32]:
        """Heights of a level, metres."""
        return np.asarray(self.height.get("u", level)[0])

    def read_gradient(self) -> NDArray[np.float32]:
        """Both gradient components of the finest level, (2, n, n), metres per metre."""
        return self.gradient.get("u", self.top)
