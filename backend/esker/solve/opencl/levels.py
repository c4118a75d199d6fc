"""Levels on an OpenCL device: memory, kernel launches, reading back (DESIGN 5.3). State that can be rebuilt.

Layout (shaders/opencl/rows.cl): a level is n rows of ``pitch`` floats with PAD floats before sample 0; channels lie
behind each other. Level 0's buffers also hold the levels below it, which the bottom kernels alone touch.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from esker import grid
from esker.contract import TILE_CELLS
from esker.solve.opencl import wave
from esker.solve.opencl.device import Device, named
from esker.solve.opencl.device_workspace import Arena, DeviceWorkspace, OverBase
from esker.solve.opencl.fields import Fields, Shape, SystemMemory
from esker.solve.opencl.queue import Queue
from esker.solve.reference import BOTTOM_LEVELS

PAD = wave.PAD
ALIGN = 64
MIN_STRIP = 16


def pitch_of(samples: int) -> int:
    """Floats from one row to the next."""
    return PAD + -(-samples // 32) * 32 + 2 * PAD


def _round(size: int) -> int:
    return -(-size // ALIGN) * ALIGN


def bottom_table() -> tuple[NDArray[np.int32], int]:
    """(offset, n, pitch, 0) of levels 0, -1, ... and the stride of a channel that holds them all."""
    rows, at = [], 0
    for k in range(BOTTOM_LEVELS + 1):
        n = (TILE_CELLS >> k) + 1
        rows.append((at, n, pitch_of(n), 0))
        at += _round(n * pitch_of(n) + PAD)
    return np.array(rows, dtype=np.int32), at


def shape_of(level: int) -> Shape:
    n = grid.samples(level)
    stride = bottom_table()[1] if level == 0 else _round(n * pitch_of(n) + PAD)
    return Shape(level, n, pitch_of(n), stride)


def scratch_floats(top: int) -> int:
    """Scratch of one work-item: a wave's working set, or four rows of the finest level."""
    return _round(max(wave.scratch_floats(), 4 * pitch_of(grid.samples(top)) + PAD))


class Launcher(Queue):
    """A queue with its kernels and scratch, for one finest level."""

    keeps_sums = True

    def __init__(self, device: Device, top: int) -> None:
        super().__init__(device, bottom_table()[0])
        self.scratch_stride = scratch_floats(top)
        self.scratch = self.zeros(2 * device.strips * self.scratch_stride)

    def run(self, name: str, size: tuple[int, ...], *args: Any) -> None:
        """Enqueue one kernel, one work-item a work-group."""
        self._enqueue(self.once(name, args), size)

    def again(self, name: str, size: tuple[int, ...], *args: Any, last: tuple[Any, ...] = ()) -> None:
        """Enqueues a kernel with arguments that come again. They are kept, as setting them takes longer than most
        launches.

        ``last``: arguments behind them that change, and are set every time.
        """
        kernel = self.bound(name, *args)
        for k, value in enumerate(last, len(args)):
            kernel.set_arg(k, value)
        self._enqueue(kernel, size)

    def _enqueue(self, kernel: Any, size: tuple[int, ...]) -> None:
        self.cl.enqueue_nd_range_kernel(self.queue, kernel, size, (1,) * len(size))

    def strips(self, rows: int) -> tuple[int, int]:
        """How to cut ``rows`` rows: (strips, rows a strip, even)."""
        count = max(1, min(self.device.strips, rows // MIN_STRIP))
        each = -(-rows // count)
        each += each & 1
        return -(-rows // each), each


class ClSystem(Fields):
    """``multigrid.System`` on a device. Fields and their meaning: see there; ``s`` is the static part of f."""

    pad = PAD

    def __init__(
        self, launcher: Launcher, top: int, channels: int, static: str, memory: SystemMemory | None = None
    ) -> None:
        super().__init__(launcher, shape_of, top, channels, static, memory)
        self.launch = launcher
        self.settling = False
        self.changed: tuple[Any, Any] | None = None
        if memory is None:
            self.changes = launcher.zeros(channels * launcher.device.strips)
        else:
            self.borrow(memory)

    def lend(self) -> SystemMemory:
        """See ``device_workspace.DeviceSystem``."""
        memory = SystemMemory(self.launch, self.fields, self.changes)
        self.fields, self.changed = {}, None
        del self.launch, self._queue, self.changes
        return memory

    def borrow(self, memory: SystemMemory) -> None:
        """See ``device_workspace.DeviceSystem``."""
        self.launch, self.fields, self.changes = memory
        self._queue, self.changed = memory.launch, None

    def coarsen(self, screening: float, rows: tuple[int, int] | None = None) -> None:
        """Constraints of all coarser levels from those of the top, of which only ``rows`` (half open) changed."""
        run, i = self.launch.again, np.int32
        self.eps = {level: screening * 4.0 ** (self.top - level) for level in self.shapes}
        first, last = rows or (0, self.shapes[self.top].n)
        for level in range(self.top, 0, -1):
            fine, under = self.shapes[level], self.shapes[level - 1]
            first, last = max(0, (first - 1) // 2), min(under.n, last // 2 + 1)
            strips, each = self.launch.strips(last - first)
            d, f = ("d", level), (self.static, level)
            d2, f2 = ("d", level - 1), (self.static, level - 1)
            run(
                "coarsen", (strips, self.channels), *(self.fields[k] for k in (d, f, d2, f2)), i(fine.n), i(fine.pitch),
                i(under.pitch), i(fine.stride), i(under.stride), self.launch.scratch, i(self.launch.scratch_stride),
                last=(i(each), i(first), i(last)),
            )  # fmt: skip
        run(
            "coarsen_bottom", (1,), self.fields["d", 0], self.fields[self.static, 0], self.launch.table,
            i(BOTTOM_LEVELS), i(self.channels), i(self.shapes[0].stride), self.launch.scratch,
        )  # fmt: skip

    def visit(
        self, level: int, *, rhs: str, out: str, guess: str | None, correction: str | None, residual: bool
    ) -> None:
        i, fine, under = np.int32, self.shapes[level], self.shapes[level - 1]
        strips, rows = self.launch.strips(fine.n)
        before = self.fields[guess, level] if guess else None
        if level == self.top:
            self.settling = self.settling and before is not None
            self.changed = (before, self.fields[out, level]) if self.settling else None
        self.launch.again(
            "visit", (strips, self.channels), before, self.fields[correction, level - 1] if correction else None,
            self.fields[rhs, level], self.fields["d", level], self.fields[out, level],
            self.fields["b", level - 1] if residual else None, i(fine.n), i(fine.pitch), i(under.pitch),
            i(fine.stride), i(under.stride), np.float32(self.eps[level]), self.launch.scratch,
            i(self.launch.scratch_stride), i(rows), self.launch.weights,
            self.changes if level == self.top and self.settling else None,
        )  # fmt: skip

    def restrict(self, level: int) -> None:
        i, fine, under = np.int32, self.shapes[level], self.shapes[level - 1]
        strips, rows = self.launch.strips(under.n)
        self.launch.again(
            "restriction", (strips, self.channels), self.fields["b", level], self.fields["b", level - 1], i(fine.n),
            i(fine.pitch), i(under.pitch), i(fine.stride), i(under.stride), self.launch.scratch,
            i(self.launch.scratch_stride), i(rows),
        )  # fmt: skip

    def bottom(self, *, rhs: str, out: str, cycles: int) -> None:
        i = np.int32
        self.launch.again(
            "bottom", (self.channels,), self.fields[rhs, 0], self.fields["d", 0], self.fields[out, 0],
            self.fields["t", 0], self.launch.table, i(BOTTOM_LEVELS), i(self.shapes[0].stride),
            np.float32(self.eps[0]), self.launch.scratch, i(self.launch.scratch_stride), self.launch.weights, i(cycles),
        )  # fmt: skip

    def hold(self) -> None:
        """See ``multigrid.System``."""
        i, shape = np.int32, self.shapes[self.top]
        strips, rows = self.launch.strips(shape.n)
        f, d, u = (self.fields[name, self.top] for name in ("f", "d", "u"))
        self.launch.again("hold_fixed", (strips,), f, d, u, i(shape.n), i(shape.pitch), i(rows))

    def change(self, old: str, new: str) -> float:
        """See ``multigrid.System``. Who asks once will ask again: until the next start from a coarser level the visits
        of the finest one find it on their way; only the first time needs a pass over both fields."""
        shape = self.shapes[self.top]
        strips, rows = self.launch.strips(shape.n)
        pair = (self.fields[old, self.top], self.fields[new, self.top])
        source, count = self.changes, strips * self.channels
        if self.changed is None or pair != self.changed:
            i, source, count = np.int32, self.launch.scratch, strips
            self.launch.again(
                "change", (strips,), *pair, source, i(shape.n), i(shape.pitch), i(shape.stride), i(self.channels),
                i(rows),
            )  # fmt: skip
        self.settling = True
        out = np.empty(count, dtype=np.float32)
        self.launch.cl.enqueue_copy(self.launch.queue, out, source)
        return float(out.max())

    def put(self, name: str, level: int, value: NDArray[Any]) -> None:
        """Set a field from (channels, n, n)."""
        self.changed = None
        super().put(name, level, value)


def over_base(
    launch: Launcher, fields: Sequence[Any], slack: float, samples: tuple[int, int], pitch: int, rows: tuple[int, int]
) -> None:
    """Enqueue ``reference.over_base`` for ``rows`` (half open) of (rows, columns) samples; fields: base, share, target,
    d, static part without it, static part."""
    i, (first, last) = np.int32, rows
    strips, each = launch.strips(last - first)
    launch.run(
        named("over_base", True), (strips,), *fields, np.float32(slack), i(samples[0]), i(samples[1]), i(pitch),
        i(first), i(last), i(each),
    )  # fmt: skip


def _over_level(launch: Launcher, shape: Shape, fields: Sequence[Any], slack: float, rows: tuple[int, int]) -> None:
    over_base(launch, fields, slack, (shape.n, shape.n), shape.pitch, rows)


class ClWorkspace(DeviceWorkspace[ClSystem]):
    """``solver.Workspace`` on an OpenCL device."""

    def __init__(self, device: Device, top: int, based: bool = False, arena: Arena | None = None) -> None:
        if arena is None:
            launch = Launcher(device, top)
            over = OverBase(launch, shape_of(top), PAD, _over_level) if based else None
            arena = Arena(launch, launch, None, None, over)
        gradient = ClSystem(arena.queue, top, 2, "f", arena.gradient)
        super().__init__(arena, gradient, ClSystem(arena.queue, top, 1, "s", arena.height))

    def guide(self, level: int) -> None:
        """f of the height step at ``level`` from u of the gradient step."""
        i, shape = np.int32, self.height.shapes[level]
        strips, rows = self.launch.strips(shape.n)
        h = self.height.fields
        self.launch.again(
            "divergence", (strips,), h["s", level], h["d", level], self.gradient.fields["u", level], h["f", level],
            i(shape.n), i(shape.pitch), i(shape.stride), np.float32(grid.spacing(level, self.size_m)), i(rows),
        )  # fmt: skip
