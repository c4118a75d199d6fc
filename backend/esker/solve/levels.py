"""Levels on an OpenCL device: memory, kernel launches, reading back (DESIGN 5.3). State that can be rebuilt.

Layout (shaders/opencl/rows.cl): a level is n rows of ``pitch`` floats with PAD floats before sample 0; channels lie
behind each other. Level 0's buffers also hold the levels below it, which the bottom kernels alone touch.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from esker import grid
from esker.contract import TILE_CELLS, Stroke, TerrainSettings
from esker.solve import raster, wave
from esker.solve.constraints import Packer, Tables, Window
from esker.solve.device import Device
from esker.solve.reference import BOTTOM_LEVELS, chebyshev_weights
from esker.solve.tables import RASTER_BINS

PAD = wave.PAD
ALIGN = 64
MIN_STRIP = 16
MOST_BOUND = 512
"""Kernels with arguments set that a launcher keeps; each costs a kilobyte or two, and setting them 50 microseconds."""


def pitch_of(samples: int) -> int:
    """Floats from one row to the next."""
    return PAD + -(-samples // 32) * 32 + 2 * PAD


@dataclass(frozen=True)
class Shape:
    """One level's layout; ``stride`` floats from one channel to the next."""

    level: int
    n: int
    pitch: int
    stride: int


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


class Launcher:
    """A queue with its kernels, scratch and constant tables, for one finest level."""

    def __init__(self, device: Device, top: int) -> None:
        import pyopencl as cl

        self.cl, self.device, self.queue = cl, device, device.queue
        self.bound: dict[tuple[Any, ...], Any] = {}
        self.scratch_stride = scratch_floats(top)
        self.scratch = self.zeros(2 * device.strips * self.scratch_stride)
        self.weights = self.constant(chebyshev_weights().astype(np.float32))
        self.table = self.constant(bottom_table()[0])

    def zeros(self, floats: int) -> Any:
        """A new buffer of zeros."""
        buffer = self.cl.Buffer(self.device.context, self.cl.mem_flags.READ_WRITE, size=4 * max(floats, 1))
        self.cl.enqueue_fill_buffer(self.queue, buffer, np.zeros(1, dtype=np.float32), 0, buffer.size)
        return buffer

    def constant(self, array: NDArray[Any]) -> Any:
        """A read-only copy of a host array (one zero when it is empty)."""
        host = np.ascontiguousarray(array) if array.size else np.zeros(1, dtype=array.dtype)
        flags = self.cl.mem_flags.READ_ONLY | self.cl.mem_flags.COPY_HOST_PTR
        return self.cl.Buffer(self.device.context, flags, hostbuf=host)

    def run(self, name: str, size: tuple[int, ...], *args: Any) -> None:
        """Enqueue one kernel, one work-item a work-group."""
        kernel = self.cl.Kernel(self.device.program, name)
        kernel.set_args(*args)
        self._enqueue(kernel, size)

    def again(self, name: str, size: tuple[int, ...], *args: Any, last: tuple[Any, ...] = ()) -> None:
        """The same, for arguments that come again: setting them takes longer than most launches, so they are kept.

        ``last``: arguments behind them that change, and are set every time.
        """
        key = (name, *args)
        kernel = self.bound.pop(key, None)
        if kernel is None:
            kernel = self.cl.Kernel(self.device.program, name)
            for k, value in enumerate(args):
                kernel.set_arg(k, value)
            if len(self.bound) >= MOST_BOUND:
                del self.bound[next(iter(self.bound))]
        self.bound[key] = kernel
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


class ClSystem:
    """``multigrid.System`` on a device. Fields and their meaning: see there; ``s`` is the static part of f."""

    def __init__(self, launcher: Launcher, top: int, channels: int, static: str) -> None:
        self.top, self.channels, self.static = top, channels, static
        self.launch = launcher
        self.settling = False
        self.changed: tuple[Any, Any] | None = None
        self.changes = launcher.zeros(channels * launcher.device.strips)
        self.shapes = {level: shape_of(level) for level in range(top + 1)}
        self.eps = dict.fromkeys(range(top + 1), 0.0)
        names = {"f", "u", "v", static}
        self.fields: dict[tuple[str, int], Any] = {}
        for level, shape in self.shapes.items():
            inner = set() if level == top and top > 0 else {"b", "e", "t"}
            for name in names | inner:
                self.fields[name, level] = launcher.zeros(channels * shape.stride + PAD)
            self.fields["d", level] = launcher.zeros(shape.stride + PAD)

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

    def swap(self, level: int) -> None:
        self.fields["u", level], self.fields["v", level] = self.fields["v", level], self.fields["u", level]

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

    def get(self, name: str, level: int) -> NDArray[np.float32]:
        """A field as (channels, n, n); d has one channel."""
        shape = self.shapes[level]
        channels = 1 if name == "d" else self.channels
        out = np.empty((channels, shape.n, shape.n), dtype=np.float32)
        for c in range(channels):
            self.launch.cl.enqueue_copy(self.launch.queue, out[c], self.fields[name, level], **_window(shape, c))
        return out

    def put(self, name: str, level: int, value: NDArray[Any]) -> None:
        """Set a field from (channels, n, n)."""
        self.changed = None
        for c, channel in enumerate(value):
            host = np.ascontiguousarray(channel, dtype=np.float32)
            self.launch.cl.enqueue_copy(
                self.launch.queue, self.fields[name, level], host, **_window(self.shapes[level], c)
            )


def _window(shape: Shape, channel: int) -> dict[str, Any]:
    """A channel's samples, without padding, for a rectangular copy."""
    return {
        "host_pitches": (4 * shape.n,),
        "host_origin": (0, 0),
        "region": (4 * shape.n, shape.n),
        "buffer_pitches": (4 * shape.pitch,),
        "buffer_origin": (4 * (PAD + channel * shape.stride), 0),
    }


class ClWorkspace:
    """``solver.Workspace`` on an OpenCL device."""

    def __init__(self, device: Device, top: int) -> None:
        self.top = top
        self.launch = Launcher(device, top)
        self.gradient = ClSystem(self.launch, top, 2, "f")
        self.height = ClSystem(self.launch, top, 1, "s")
        self.packer = Packer(top)
        self.size_m = 1.0

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
                self.launch.queue.finish()
                yield
            self.rasterise(tables, band)
        self.gradient.coarsen(tables.screening, window.sample_rows)
        self.height.coarsen(tables.screening, window.sample_rows)

    def warm(self, heights: NDArray[np.float32]) -> None:
        """Start the height step from these heights of the finest level instead of from coarser levels."""
        fixed = self.height.get("d", self.top) < 0
        value = np.where(fixed, self.height.get("s", self.top), heights[None])
        self.height.put("u", self.top, value)

    def rasterise(self, tables: Tables, window: Window) -> None:
        """Constraints of the finest level inside a window of bins."""
        shape, h, g = self.height.shapes[self.top], self.height.fields, self.gradient.fields
        fields = (h["d", self.top], h["s", self.top], g["d", self.top], g["f", self.top])
        raster.rasterise(self.launch, tables, window, raster.Target(*fields, pitch=shape.pitch, stride=shape.stride))

    def guide(self, level: int) -> None:
        """f of the height step at ``level`` from u of the gradient step."""
        i, shape = np.int32, self.height.shapes[level]
        strips, rows = self.launch.strips(shape.n)
        h = self.height.fields
        self.launch.again(
            "divergence", (strips,), h["s", level], h["d", level], self.gradient.fields["u", level], h["f", level],
            i(shape.n), i(shape.pitch), i(shape.stride), np.float32(grid.spacing(level, self.size_m)), i(rows),
        )  # fmt: skip

    def read(self, level: int) -> NDArray[np.float32]:
        """Heights of a level, metres."""
        return np.asarray(self.height.get("u", level)[0])

    def read_gradient(self) -> NDArray[np.float32]:
        """Both gradient components of the finest level, (2, n, n), metres per metre."""
        return self.gradient.get("u", self.top)
