"""The two steps of a solve on a device, whatever its kernels: loading strokes and reading results (DESIGN 5.3)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from esker import grid
from esker.contract import Stroke, TerrainSettings
from esker.solve import multigrid
from esker.solve.base import Base
from esker.solve.constraints.constraints import Packer
from esker.solve.constraints.kept_sums import KeptSums
from esker.solve.constraints.tables import RASTER_BINS, Tables, Window
from esker.solve.constraints.tables import bins as bins_of
from esker.solve.opencl import raster
from esker.solve.opencl.fields import Shape, rectangle
from esker.solve.opencl.queue import Queue

if TYPE_CHECKING:
    from esker.solve.passes import Workspace


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


class OverBase:
    """Memory of a workspace over a base on the device: the base at the finest level, the share of the guidance that is
    the ground's own, what strokes want above the base, and the right-hand side of the heights without what is owed to
    the base."""

    def __init__(self, queue: Queue, shape: Shape, pad: int, enqueue: Callable[..., None]) -> None:
        fields = (queue.zeros(shape.stride + pad) for _ in range(grid.BASE_FIELDS))
        self.base, self.share, self.target, self.raw = fields
        self._queue, self._shape, self._pad, self._enqueue = queue, shape, pad, enqueue
        self._digest = b""

    def put(self, base: Base) -> None:
        """Copy the base's samples to the device, unless they are there."""
        if base.digest != self._digest:
            samples = base.level(self._shape.level)
            window = rectangle(self._shape, 0, self._pad)
            self._queue.cl.enqueue_copy(self._queue.queue, self.base, np.ascontiguousarray(samples), **window)
            self._digest = base.digest

    def add(self, d: Any, f: Any, slack: float, rows: tuple[int, int]) -> None:
        """f = ``raw`` and what is owed to the base, rows first .. last - 1; see ``reference.over_base``."""
        self._enqueue(self._queue, self._shape, (self.base, self.share, self.target, d, self.raw, f), slack, rows)


S = TypeVar("S", bound=DeviceSystem)


class DeviceWorkspace(Generic[S]):
    """``solver.Workspace`` but for ``guide``, which is the kernels' own."""

    def __init__(self, queue: Queue, gradient: S, height: S, bins: raster.Launcher, over: OverBase | None) -> None:
        self.top = height.top
        self.gradient, self.height = gradient, height
        self.packer = Packer(self.top)
        self.preview_workspace: Workspace | None = None
        self.solved_for: object = None
        self.size_m = 1.0
        self._queue, self._bins, self._over = queue, bins, over
        self._kept = KeptSums(queue, bins_of(grid.samples(self.top)), over is not None) if bins.keeps_sums else None

    @property
    def based(self) -> bool:
        """Whether the workspace solves over a base."""
        return self._over is not None

    def load(self, strokes: Sequence[Stroke], settings: TerrainSettings, base: Base | None = None) -> None:
        """``loading`` without a pause."""
        for _ in self.loading(strokes, settings, base):
            pass

    def loading(self, strokes: Sequence[Stroke], settings: TerrainSettings, base: Base | None = None) -> Iterator[None]:
        """Rasterise what changed since the last set, and coarsen; may be left between strokes and bands of bins."""
        if (base is None) == self.based:
            raise ValueError("a workspace solves with a base or without one, as it was made")
        tables, window = yield from self.packer.packing(strokes, settings, base)
        try:
            yield from self._rasterising(tables, window, base)
        except BaseException:  # half of the raster is not that of any set
            self.packer.forget()
            raise

    def _rasterising(self, tables: Tables, window: Window | None, base: Base | None) -> Iterator[None]:
        self.size_m = tables.size_m
        if window is None:
            return
        if base is not None and self._over is not None:
            self._over.put(base)
        for count, band in enumerate(window.bands(RASTER_BINS)):
            if count:
                self._queue.queue.finish()
                yield
            self.rasterise(tables, band)
        rows = window.sample_rows
        self.gradient.coarsen(tables.screening, rows)
        if self._over is not None:
            rows = max(0, rows[0] - 1), min(tables.samples, rows[1] + 1)
            d, f = (self.height.fields[name, self.top] for name in ("d", "s"))
            self._over.add(d, f, tables.spacing_m, rows)
        self.height.coarsen(tables.screening, rows)

    def warm(self, heights: NDArray[np.float32]) -> None:
        """Start the height step from these heights of the finest level instead of from coarser levels."""
        fixed = self.height.get("d", self.top) < 0
        self.height.put("u", self.top, np.where(fixed, self.height.get("s", self.top), heights[None]))

    def rasterise(self, tables: Tables, window: Window) -> None:
        """Constraints of the finest level inside a window of bins."""
        shape, h, g = self.height.shapes[self.top], self.height.fields, self.gradient.fields
        over = self._over
        static = h["s", self.top] if over is None else over.raw
        fields = (h["d", self.top], static, g["d", self.top], g["f", self.top])
        pair = None if over is None else raster.Over(over.base, over.share, over.target)
        target = raster.Target(*fields, shape.pitch, shape.stride, pair)
        kept = None if self._kept is None else self._kept.plan(self.packer, window)
        raster.rasterise(self._bins, tables, window, target, kept=kept)

    def read(self, level: int) -> NDArray[np.float32]:
        """Heights of a level, metres."""
        return np.asarray(self.height.get("u", level)[0])

    def read_gradient(self) -> NDArray[np.float32]:
        """Both gradient components of the finest level, (2, n, n), metres per metre."""
        return self.gradient.get("u", self.top)
