"""The two steps of a solve on a device, whatever its kernels: loading strokes and reading results (DESIGN 5.3)."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, Protocol, TypeVar

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
from esker.solve.opencl import parking, raster
from esker.solve.opencl.fields import Shape, SystemMemory, rectangle
from esker.solve.opencl.parking import Parked, Saved, Spares, copied, restored
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

    def flush(self) -> None:
        """See ``fields.Fields``."""

    def lend(self) -> SystemMemory:
        """Gives its memory away; it can do nothing until it borrows some."""

    def borrow(self, memory: SystemMemory) -> None:
        """Works with the memory of another system of the same shape from now on, whatever is in it."""


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


class Arena(NamedTuple):
    """The device memory of one workspace, which can go from one to another: a queue with its kernels, what rasterises,
    and the memory of both systems, None where they are to make it."""

    queue: Any
    bins: raster.Launcher
    gradient: SystemMemory | None
    height: SystemMemory | None
    over: OverBase | None


class Home(Protocol):
    """Whoever sees to it that workspaces have device memory while they solve."""

    def admit(self, workspace: DeviceWorkspace[Any]) -> None:
        """The workspace is not parked from now on. Raises DeviceErrors."""


S = TypeVar("S", bound=DeviceSystem)


class DeviceWorkspace(ABC, Generic[S]):
    """``solver.Workspace`` but for ``guide``, which is the kernels' own.

    in_progress: whether a solve is in the middle of it. home: None where it always has device memory.
    """

    def __init__(self, arena: Arena, gradient: S, height: S) -> None:
        self.top = height.top
        self.based, self.device = arena.over is not None, arena.queue.device
        self.gradient, self.height = gradient, height
        self.packer = Packer(self.top)
        self.preview_workspace: Workspace | None = None
        self.solved_for: object = None
        self.size_m = self.relief_m = 1.0
        self.home: Home | None = None
        self.in_progress = False
        self._screening = 0.0
        self._at_rest: tuple[NDArray[np.float32], NDArray[np.float32]] | None = None
        self._parked: Parked | None = None
        self._loaded: tuple[Tables, tuple[Any, ...]] | None = None
        self._resident(arena)
        self._kept = KeptSums(bins_of(grid.samples(self.top)), self.based) if arena.bins.keeps_sums else None

    def _resident(self, arena: Arena) -> None:
        self.launch: Any
        self.launch = self._queue = arena.queue
        self._bins, self._over = arena.bins, arena.over

    @property
    def is_parked(self) -> bool:
        """Returns whether it has no device memory."""
        return self._parked is not None

    @property
    def bytes(self) -> int:
        """Memory that it holds, without its preview workspace; an arena is about what a solve takes."""
        sums = 0 if self._kept is None else self._kept.bytes
        return sums + (grid.arena_bytes(self.top, self.based) if self._parked is None else self._parked.bytes)

    def park(self, spares: Spares, *, empty: bool = False) -> Arena:
        """Gives its device memory away, after copying what cannot be made again from what is left; ``empty``: nothing.

        Raises DeviceErrors.
        """
        parked = Parked([]) if empty else self._copied(spares)
        arena = Arena(self._queue, self._bins, self.gradient.lend(), self.height.lend(), self._over)
        self._parked = parked
        del self.launch, self._queue, self._bins, self._over
        return arena

    def _copied(self, spares: Spares) -> Parked:
        saved, queue = self._saved(), self._queue
        self.gradient.flush()
        self.height.flush()
        if not self.in_progress and self._kept is not None:
            self._kept.clear()  # a stroke is drawn no longer
        if self.packer.is_light(parking.LIGHT):
            self.packer.unrastered()
            parked = Parked([])
        else:
            parked = Parked(copied(queue, saved.constraints, spares))
        if self._at_rest is not None:
            parked.at_rest = self._at_rest
        elif self.in_progress or self.solved_for is not None:
            parked.ground = copied(queue, saved.ground, spares)
        if self.in_progress:
            parked.progress = copied(queue, saved.progress, spares)
        return parked

    def resume(self, arena: Arena, spares: Spares) -> None:
        """Takes over the device memory that another workspace gave away, and is as it was. Raises DeviceErrors."""
        assert self._parked is not None
        assert arena.gradient is not None
        assert arena.height is not None
        parked, self._parked = self._parked, None
        self._resident(arena)
        self.gradient.borrow(arena.gradient)
        self.height.borrow(arena.height)
        saved = self._saved()
        if parked.constraints:
            restored(self._queue, parked.constraints, saved.constraints)
        elif self.in_progress:
            self._rasterise_again()
        if parked.at_rest is not None:
            heights, gradient = parked.at_rest
            self.height.put("u", self.top, heights[None])
            self.gradient.put("u", self.top, gradient)
        for copies, buffers in ((parked.ground, saved.ground), (parked.progress, saved.progress)):
            if copies is not None:
                restored(self._queue, copies, buffers)
        if parked.constraints:
            for system in (self.gradient, self.height):
                system.coarsen(self._screening)
        if self.in_progress:
            self.guide(self.top)
        parked.released(spares)

    def _saved(self) -> Saved:
        top, g, h = self.top, self.gradient.fields, self.height.fields
        over = () if self._over is None else (self._over.share, self._over.target, self._over.raw)
        constraints = (g["d", top], g["f", top], h["d", top], h["s", top], *over)
        progress = [f["b", top - 1] for f in (g, h) if top > 0]
        progress += [f["u", level] for f in (g, h) for level in range(top)]
        return Saved(constraints, (g["u", top], h["u", top]), progress)

    @abstractmethod
    def guide(self, level: int) -> None:
        """f of the height step at ``level`` from u of the gradient step."""

    def rest(self) -> None:
        """Nothing solves with it any more."""
        self.in_progress = False

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
            if self.home is not None:
                self.home.admit(self)
            self.in_progress, self._at_rest = True, None
            yield from self._rasterising(tables, window, base)
        except BaseException:  # half of the raster is not that of any set
            self.packer.forget()
            raise

    def _rasterising(self, tables: Tables, window: Window | None, base: Base | None) -> Iterator[None]:
        self.size_m, self._screening = tables.size_m, tables.screening
        if window is None:
            return
        if base is not None and self._over is not None:
            self._over.put(base)
        for count, band in enumerate(window.bands(RASTER_BINS)):
            if count:
                self._queue.queue.finish()
                yield
            self.rasterise(tables, band)
        self._loaded = None
        rows = window.sample_rows
        self.gradient.coarsen(tables.screening, rows)
        if self._over is not None:
            rows = max(0, rows[0] - 1), min(tables.samples, rows[1] + 1)
            d, f = (self.height.fields[name, self.top] for name in ("d", "s"))
            self._over.add(d, f, tables.spacing_m, rows)
        self.height.coarsen(tables.screening, rows)

    def _rasterise_again(self) -> None:
        """Makes the constraints of the last set, of which none are in this memory."""
        if self._kept is not None:
            self._kept.clear()
        for _ in self._rasterising(*self.packer.again()):
            pass

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
        kept = None if self._kept is None else self._kept.plan(self._queue, self.packer, window)
        if self._loaded is None or self._loaded[0] is not tables:
            self._loaded = tables, raster.load(self._bins, tables)
        raster.rasterise(self._bins, tables, window, target, self._loaded[1], kept)

    def read(self, level: int) -> NDArray[np.float32]:
        """Heights of a level, metres."""
        return np.asarray(self.height.get("u", level)[0])

    def read_gradient(self) -> NDArray[np.float32]:
        """Both gradient components of the finest level, (2, n, n), metres per metre."""
        return self.gradient.get("u", self.top)

    def given(self, heights: NDArray[np.float32], gradient: NDArray[np.float32]) -> None:
        """Both solutions of the finest level, at rest, were given out as these arrays, which never change: a workspace
        that is parked need not copy them."""
        self._at_rest = heights, gradient
