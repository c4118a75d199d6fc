"""Levels on a GPU: memory, kernel launches, reading back (DESIGN 5.3). State that can be rebuilt.

Layout (shaders/opencl/gpu/level.cl): a level is n rows of ``pitch`` floats, a multiple of 32, sample 0 first; channels
lie behind each other. Level 0's buffers also hold the levels below it, which the bottom kernels alone touch.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from esker import grid
from esker.contract import TILE_CELLS
from esker.solve.constraints.tables import BIN
from esker.solve.opencl.device import Device, named
from esker.solve.opencl.device_workspace import Arena, DeviceWorkspace, OverBase
from esker.solve.opencl.fields import Fields, Shape, SystemMemory
from esker.solve.opencl.gpu_program import CHAIN, CHAIN_ITEMS, CHANGE_ITEMS, STRIP_WIDTH, TILE, Plan, march_kernel
from esker.solve.opencl.queue import Queue
from esker.solve.reference import BOTTOM_LEVELS

LINE = 32
"""Floats of a cache line."""
BLOCK = (32, 8)
"""Work-group of the kernels that do one sample a work-item."""
MOST_CHAINED = 3
"""Restrictions that one launch does."""
CHANGE_GROUPS = 512
"""At most so many partial results of ``change`` are left to the host."""


def _lines(floats: int) -> int:
    return -(-floats // LINE) * LINE


def bottom_table() -> tuple[NDArray[np.int32], int]:
    """(offset, n, pitch, 0) of levels 0, -1, ... and the stride of a channel that holds them all."""
    rows, at = [], 0
    for k in range(BOTTOM_LEVELS + 1):
        n = (TILE_CELLS >> k) + 1
        rows.append((at, n, _lines(n), 0))
        at += n * _lines(n)
    return np.array(rows, dtype=np.int32), at


def shape_of(level: int) -> Shape:
    """Layout of a level."""
    n = grid.samples(level)
    return Shape(level, n, _lines(n), bottom_table()[1] if level == 0 else n * _lines(n))


class GpuLauncher(Queue):
    """A queue with its kernels. Arguments of a launch that comes again are set only once."""

    def __init__(self, device: Device) -> None:
        assert device.plan is not None, "opened for row-wise kernels"
        super().__init__(device, bottom_table()[0])
        self.plan: Plan = device.plan
        self.launches = 0
        self.partial = self.zeros(CHANGE_GROUPS)

    def run(self, name: str, groups: tuple[int, ...], block: tuple[int, ...], *args: Any) -> None:
        """Enqueue ``groups`` work-groups of ``block`` work-items, with arguments that live as long as the launcher."""
        self.enqueue(*sized(self.bound(name, *args), groups, block))

    def run_once(self, name: str, groups: tuple[int, ...], block: tuple[int, ...], *args: Any) -> None:
        """Enqueues a kernel with arguments that will not come again."""
        self.enqueue(*sized(self.once(name, args), groups, block))

    def enqueue(self, kernel: Any, size: tuple[int, ...], block: tuple[int, ...]) -> None:
        """Enqueues ``size`` work-items of a kernel in work-groups of ``block``."""
        self.launches += 1
        self.cl.enqueue_nd_range_kernel(self.queue, kernel, size, block)


Launch = tuple[Any, tuple[int, ...], tuple[int, ...]]
"""A kernel with its arguments, its work-items and those of a work-group."""


def sized(kernel: Any, groups: tuple[int, ...], block: tuple[int, ...]) -> Launch:
    """Returns the launch of ``groups`` work-groups of ``block`` work-items."""
    return kernel, tuple(g * b for g, b in zip(groups, block, strict=True)), block


def _blocks(columns: int, rows: int) -> tuple[int, int]:
    return -(-columns // BLOCK[0]), -(-rows // BLOCK[1])


class GpuSystem(Fields):
    """``multigrid.System`` on a GPU. Fields and their meaning: see there; ``static`` names the static part of f."""

    def __init__(
        self, launcher: GpuLauncher, top: int, channels: int, static: str, memory: SystemMemory | None = None
    ) -> None:
        super().__init__(launcher, shape_of, top, channels, static, memory)
        self.launch = launcher
        self._waiting: list[int] = []
        self._kept: dict[tuple[Any, ...], Launch] = {}
        """Launches that come again in each cycle: finding their arguments anew takes longer than the launch."""
        coarsest = ((TILE_CELLS >> BOTTOM_LEVELS) + 1) ** 2
        if memory is None:
            self.matrix = launcher.zeros(coarsest * coarsest)
        else:
            self.borrow(memory)

    def lend(self) -> SystemMemory:
        """See ``device_workspace.DeviceSystem``."""
        self._restrict_now()
        memory = SystemMemory(self.launch, self.fields, self.matrix)
        self.fields, self._kept = {}, {}
        del self.launch, self._queue, self.matrix
        return memory

    def borrow(self, memory: SystemMemory) -> None:
        """See ``device_workspace.DeviceSystem``."""
        self.launch, self.fields, self.matrix = memory
        self._queue = memory.launch
        self._kept = {}

    def _layout(self, level: int) -> tuple[np.int32, ...]:
        """n, pitch, stride, and pitch and stride of the next coarser level."""
        fine, under = self.shapes[level], self.shapes[max(level - 1, 0)]
        return tuple(np.int32(k) for k in (fine.n, fine.pitch, fine.stride, under.pitch, under.stride))

    def coarsen(self, screening: float, rows: tuple[int, int] | None = None) -> None:
        """Constraints of all coarser levels from those of the top, of which only ``rows`` (half open) changed."""
        i, launch = np.int32, self.launch
        self.eps = {level: screening * 4.0 ** (self.top - level) for level in self.shapes}
        self._kept = {}
        first, last = rows or (0, self.shapes[self.top].n)
        for level in range(self.top, 0, -1):
            under = self.shapes[level - 1]
            first, last = max(0, (first - 1) // 2), min(under.n, last // 2 + 1)
            fields = (("d", level), (self.static, level), ("d", level - 1), (self.static, level - 1))
            launch.run_once(
                "coarsen", _blocks(under.n, last - first), BLOCK, *(self.fields[k] for k in fields),
                *self._layout(level), i(self.channels), i(first), i(last),
            )  # fmt: skip
        launch.run_once(
            "coarsen_bottom", (1,), (launch.plan.bottom_items,), self.fields["d", 0], self.fields[self.static, 0],
            self.matrix, launch.table, i(self.channels), i(self.shapes[0].stride), np.float32(self.eps[0]),
        )  # fmt: skip

    def visit(
        self, level: int, *, rhs: str, out: str, guess: str | None, correction: str | None, residual: bool
    ) -> None:
        """See ``multigrid.System``."""
        self._restrict_now()
        held = self.fields
        fields = (
            held[guess, level] if guess else None, held[correction, level - 1] if correction else None,
            held[rhs, level], held["d", level], held[out, level], held["b", level - 1] if residual else None,
        )  # fmt: skip
        key = (level, self.eps[level], *map(id, fields))
        launch = self._kept.get(key)
        if launch is None:
            launch = self._kept[key] = self._visit(level, fields)
        self.launch.enqueue(*launch)

    def _visit(self, level: int, fields: tuple[Any, ...]) -> Launch:
        """The kernel of a visit with its arguments: strips where they fill the device, else tiles."""
        n, plan = self.shapes[level].n, self.launch.plan
        given = (*fields, *self._layout(level), np.float32(self.eps[level]), self.launch.weights)
        strip = plan.strip(n)
        if strip is not None:
            bound = self.launch.bound(march_kernel(self.channels), *given, np.int32(strip.rows))
            return sized(bound, strip.groups(n), (STRIP_WIDTH, 1))
        return sized(self.launch.bound(TILE.kernel(self.channels), *given), TILE.groups(n), (TILE.width, TILE.strips))

    def restrict(self, level: int) -> None:
        """See ``multigrid.System``. Restrictions behind each other wait for the others: up to three are one launch."""
        if self._waiting and self._waiting[-1] != level + 1:
            self._restrict_now()
        self._waiting.append(level)
        if len(self._waiting) == MOST_CHAINED:
            self._restrict_now()

    def _restrict_now(self) -> None:
        """Launch the restrictions that wait. Everything that reads or writes a field calls this first."""
        if not self._waiting:
            return
        level, count = self._waiting[0], len(self._waiting)
        self._waiting = []
        launch = self._kept.get(("restrict", level, count))
        if launch is None:
            launch = self._kept["restrict", level, count] = self._restriction(level, count)
        self.launch.enqueue(*launch)

    def _restriction(self, level: int, count: int) -> Launch:
        """The kernel of so many restrictions behind each other, with its arguments."""
        under = [self.shapes[max(level - k, 0)] for k in range(1, MOST_CHAINED + 1)]
        fields = [self.fields["b", level - k] if k <= count else None for k in range(MOST_CHAINED + 1)]
        if count == 1:
            bound = self.launch.bound("restriction", *fields[:2], *self._layout(level))
            return sized(bound, (*_blocks(under[0].n, under[0].n), self.channels), (*BLOCK, 1))
        fine = self.shapes[level]
        across = -(-(fine.n // 8 + 1) // CHAIN)
        layout = (fine.n, fine.pitch, fine.stride, *(k for s in under for k in (s.pitch, s.stride)))
        bound = self.launch.bound("restriction_chain", *fields, *(np.int32(k) for k in layout))
        return sized(bound, (across, across, self.channels), (CHAIN_ITEMS, 1, 1))

    def bottom(self, *, rhs: str, out: str, cycles: int) -> None:
        """See ``multigrid.System``."""
        self._restrict_now()
        given, made = self.fields[rhs, 0], self.fields[out, 0]
        key = ("bottom", self.eps[0], id(given), id(made), cycles)
        launch = self._kept.get(key)
        if launch is None:
            bound = self.launch.bound(
                "bottom", given, self.fields["d", 0], made, self.matrix, self.launch.table,
                np.int32(self.shapes[0].stride), np.float32(self.eps[0]), self.launch.weights, np.int32(cycles),
            )  # fmt: skip
            launch = self._kept[key] = sized(bound, (self.channels,), (self.launch.plan.bottom_items,))
        self.launch.enqueue(*launch)

    def hold(self) -> None:
        """See ``multigrid.System``."""
        shape = self.shapes[self.top]
        f, d, u = (self.fields[name, self.top] for name in ("f", "d", "u"))
        self.launch.run(
            "hold_fixed", _blocks(shape.n, shape.n), BLOCK, f, d, u, np.int32(shape.n), np.int32(shape.pitch)
        )

    def change(self, old: str, new: str) -> float:
        """See ``multigrid.System``."""
        self._restrict_now()
        shape = self.shapes[self.top]
        groups = min(CHANGE_GROUPS, shape.n * self.channels)
        self.launch.run(
            "change", (groups,), (CHANGE_ITEMS,), self.fields[old, self.top], self.fields[new, self.top],
            self.launch.partial, np.int32(shape.n), np.int32(shape.pitch), np.int32(shape.stride),
            np.int32(self.channels),
        )  # fmt: skip
        out = np.empty(groups, dtype=np.float32)
        self.launch.cl.enqueue_copy(self.launch.queue, out, self.launch.partial)
        return float(out.max())

    def flush(self) -> None:
        """See ``fields.Fields``."""
        self._restrict_now()

    def get(self, name: str, level: int) -> NDArray[np.float32]:
        """A field as (channels, n, n); d has one channel."""
        self._restrict_now()
        return super().get(name, level)

    def put(self, name: str, level: int, value: NDArray[Any]) -> None:
        """Set a field from (channels, n, n)."""
        self._restrict_now()
        super().put(name, level, value)


class Bins:
    """The launch of ``raster.rasterise``: a work-group of one work-item a sample for every bin."""

    keeps_sums = False

    def __init__(self, launch: GpuLauncher) -> None:
        self.launch = launch

    def constant(self, array: NDArray[Any]) -> Any:
        return self.launch.constant(array)

    def run(self, name: str, size: tuple[int, ...], *args: Any) -> None:
        self.launch.run_once(name, size, (BIN, BIN), *args)


def _over_base(launch: GpuLauncher, shape: Shape, fields: Sequence[Any], slack: float, rows: tuple[int, int]) -> None:
    """Enqueue ``reference.over_base`` (``device_workspace.OverBase``)."""
    i, (first, last) = np.int32, rows
    launch.run_once(
        named("over_base", True), _blocks(shape.n, last - first), BLOCK, *fields, np.float32(slack), i(shape.n),
        i(shape.pitch), i(first), i(last),
    )  # fmt: skip


class GpuWorkspace(DeviceWorkspace[GpuSystem]):
    """``solver.Workspace`` on a GPU."""

    def __init__(self, device: Device, top: int, based: bool = False, arena: Arena | None = None) -> None:
        if arena is None:
            launch = GpuLauncher(device)
            over = OverBase(launch, shape_of(top), 0, _over_base) if based else None
            arena = Arena(launch, Bins(launch), None, None, over)
        gradient = GpuSystem(arena.queue, top, 2, "f", arena.gradient)
        super().__init__(arena, gradient, GpuSystem(arena.queue, top, 1, "s", arena.height))

    def guide(self, level: int) -> None:
        """f of the height step at ``level`` from u of the gradient step."""
        i, shape, h = np.int32, self.height.shapes[level], self.height.fields
        self.launch.run(
            "divergence", _blocks(shape.n, shape.n), BLOCK, h["s", level], h["d", level],
            self.gradient.fields["u", level], h["f", level], i(shape.n), i(shape.pitch), i(shape.stride),
            np.float32(grid.spacing(level, self.size_m)),
        )  # fmt: skip
