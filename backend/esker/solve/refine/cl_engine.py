"""Steps of refinement on an OpenCL device, row by row (refine.cl, pockets.cl); twin ``engine.NumpyEngine``.

Two steps may be under way: while the sweeps of one run, which take one core of a CPU, the host prepares the next one.
What waits in a queue is kept short, as who draws waits for it: bins are rasterised some at a time, and the sweeps are
enqueued when all of them are done.
"""

from __future__ import annotations

import weakref
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from esker import grid
from esker.solve.constraints.constraints import BIN
from esker.solve.constraints.tables import Tables, Window
from esker.solve.opencl import raster
from esker.solve.opencl.device import Device
from esker.solve.opencl.faults import guarded
from esker.solve.opencl.levels import PAD, Launcher, over_base
from esker.solve.refine.bin_cache import BinCache, Part, exchange, missing
from esker.solve.refine.cl_pockets import Pockets
from esker.solve.refine.engine import (
    CHANNELS,
    FIRST_SWEEPS,
    GRADIENT_SWEEPS,
    LAST_SWEEPS,
    SWEPT,
    Fields,
    Pending,
    Span,
    Step,
    StrokeWindows,
    Values,
    gradient_weights,
    height_weights,
    with_ghosts,
)

AHEAD: Final = 2
"""Steps under way at once: each has memory of its own."""
BAND_BINS: Final = 192
"""Bins rasterised at a stretch: 5 ms on two cores where sixty strokes meet."""
_STRIPS_ROWS: Final = 64

_MEMORY: Final = {"u": 3, "v": 3, "gd": 1, "gf": 2, "hd": 1, "hf": 1, "q": 2, "rhs": 1}
"""Fields of a window and their channels."""
_OVER: Final = {"base": 1, "share": 1, "target": 1, "raw": 1}
"""Further fields of a window over a base."""


class ClEngine:
    """Steps on a device, with the constraints that windows share."""

    ahead = AHEAD

    def __init__(self, device: Device) -> None:
        self.device = device
        self.bin_cache = BinCache()
        self.begun = 0
        self._rooms = deque(_Room(device) for _ in range(AHEAD))

    @property
    def is_empty(self) -> bool:
        """See ``Engine``."""
        return len(self.bin_cache) == 0 and not any(room.stride for room in self._rooms)

    def clear(self) -> None:
        """Drop the rasterised constraints."""
        self.bin_cache.clear()

    def release(self) -> bool:
        """See ``Engine``."""
        if any(room.is_busy for room in self._rooms):
            return False
        self.clear()
        for room in self._rooms:
            room.release()
        return True

    def begin(self, at: Step, strokes: StrokeWindows, parent: Fields) -> Pending:
        """See ``Engine``. The step that was begun ``ahead`` steps before is waited for, if anybody still wants it."""
        self.begun += 1
        room = self._rooms[0]
        self._rooms.rotate(-1)
        room.make_free()
        for other in self._rooms:
            other.share()
        with guarded(self.device):
            return room.begin(at, strokes, parent, self.bin_cache)


class _Flight:
    """A step that a room's queue works on."""

    def __init__(self, room: _Room, constraining: Iterator[Any], relax: Callable[[], Any], span: Span, pitch: int):
        """``constraining`` enqueues the constraints bit by bit, and gives out the events to wait for in between, or
        None; ``relax`` enqueues the rest and returns the last event."""
        self._room, self._span, self._pitch = room, span, pitch
        self._constraining, self._relax = constraining, relax
        self._event: Any = None
        self._made: Fields | None = None
        self.prepared = self.ready = False
        self._go_on()

    def poll(self) -> bool:
        """See ``Pending``."""
        with guarded(self._room.device):
            if self.ready or (self._event is not None and not self._room.complete(self._event)):
                return False
            self._go_on()
        return True

    def prepare(self) -> None:
        """See ``Pending``."""
        self._wait(lambda: self.prepared)

    def fields(self) -> Fields:
        """See ``Pending``."""
        if self._made is None:
            self._wait(lambda: self.ready)
            with guarded(self._room.device):
                self._made = self._room.read(self._span, self._pitch)
        return self._made

    def _wait(self, until: Callable[[], bool]) -> None:
        with guarded(self._room.device):
            while not until():
                if self._event is not None:
                    self._event.wait()
                self._go_on()

    def _go_on(self) -> None:
        """Enqueues what follows the event that has come."""
        if self.prepared:
            self.ready = True
            return
        try:
            self._event = next(self._constraining)
        except StopIteration:
            self.prepared, self._event = True, self._relax()


class _Room:
    """A queue and memory for one step at a time, as large as the largest window so far."""

    def __init__(self, device: Device) -> None:
        with guarded(device):
            import pyopencl as cl

            queue = cl.CommandQueue(device.context, device.context.devices[0])
            self.device = device
            self.launch = Launcher(replace(device, queue=queue), 0)
            weights = {GRADIENT_SWEEPS: gradient_weights()}
            weights |= {count: height_weights(count) for count in (FIRST_SWEEPS, LAST_SWEEPS)}
            self.pockets = Pockets(self.launch)
            self.weights = {k: self.launch.constant(w.astype(np.float32)) for k, w in weights.items()}
        self.stride = 0
        self.fields: dict[str, Any] = {}
        self._flight: weakref.ref[_Flight] | None = None

    @property
    def is_busy(self) -> bool:
        """Whether anybody wants the step that is here."""
        return self._flight is not None and self._flight() is not None

    def release(self) -> None:
        """Drops the memory of windows."""
        self.stride = 0
        self.fields.clear()
        self.pockets.release()

    def make_free(self) -> None:
        """Has the step that is still here read, if anybody wants it."""
        here, self._flight = self._flight, None
        flight = None if here is None else here()
        if flight is not None:
            flight.fields()

    def share(self) -> None:
        """Has the constraints of the step that is here, if anybody wants it, in the cache."""
        flight = None if self._flight is None else self._flight()
        if flight is not None:
            flight.prepare()

    def complete(self, event: Any) -> bool:
        """Returns whether all that was enqueued up to an event is done. Raises DeviceError where it failed."""
        status = event.command_execution_status
        if status < 0:
            event.wait()
        return bool(status == self.launch.cl.command_execution_status.COMPLETE)

    def _mark(self) -> Any:
        """The event of all that was enqueued so far."""
        event = self.launch.cl.enqueue_marker(self.launch.queue)
        self.launch.queue.flush()
        return event

    def _reserve(self, stride: int, based: bool) -> None:
        """Memory for windows of ``stride`` floats a channel, over a base if ``based``."""
        if stride > self.stride:
            self.stride = stride
            self.fields.clear()
        for name, channels in (_MEMORY | _OVER if based else _MEMORY).items():
            if name not in self.fields:
                self.fields[name] = self.launch.zeros(channels * self.stride + 2 * PAD)

    def begin(self, at: Step, strokes: StrokeWindows, parent: Fields, bin_cache: BinCache) -> Pending:
        """Has the queue make ``at.core``'s fields; the room is free."""
        rows, core, window = at.window.shape[0], at.core, at.window
        pitch = PAD + (at.box[3] - at.box[2]) * BIN + PAD
        self._reserve(rows * pitch, strokes.base is not None)
        span = Span(core.r0 - window.r0, core.r1 - window.r0, core.c0 - window.c0, core.c1 - window.c0)
        spacing = grid.spacing(at.level, strokes.settings.size_m)
        reach = strokes.settings.reach_m
        screening = 0.0 if reach is None else (spacing / reach) ** 2

        def relax() -> Any:
            return self._relaxed(at, with_ghosts(parent, at), span, pitch, spacing, screening)

        flight = _Flight(self, self._constrain(at, strokes, pitch, spacing, bin_cache), relax, span, pitch)
        self._flight = weakref.ref(flight)
        return flight

    def _relaxed(self, at: Step, parent: Fields, span: Span, pitch: int, spacing: float, screening: float) -> Any:
        """Enqueues prolongation and sweeps; their event."""
        i, f, (rows, columns) = np.int32, np.float32, at.window.shape
        a, stride, run, each = self.fields, self.stride, self.launch.run, _STRIPS_ROWS
        shape = (i(rows), i(columns), i(pitch), i(stride))
        strips = -(-rows // each)
        host = _padded(parent, rows, columns)
        run(
            "refine_start", (strips, CHANNELS), self.launch.constant(host), i(host.shape[2]),
            i(host.shape[1] * host.shape[2]), a["gd"], a["hd"], a["hf"], a["u"], a["q"], *shape, f(screening),
            i(each),
        )  # fmt: skip
        swept, guided = (_within(span.grown(by, rows + columns), rows, columns) for by in (SWEPT, SWEPT + FIRST_SWEEPS))
        self._sweep(2, 0, "gf", "gd", 0, shape, screening, GRADIENT_SWEEPS, guided)
        run("refine_guide", (strips,), a["u"], a["hd"], a["hf"], a["rhs"], *shape, f(spacing), i(each))
        self._sweep(1, 2, "rhs", "hd", 1, shape, screening, FIRST_SWEEPS, swept)
        self.pockets.correct(a, (rows, columns, pitch, stride), span, screening)
        self._sweep(1, 2, "rhs", "hd", 1, shape, screening, LAST_SWEEPS, span)
        return self._mark()

    def _constrain(
        self, at: Step, strokes: StrokeWindows, pitch: int, spacing: float, bin_cache: BinCache
    ) -> Iterator[Any]:
        """The constraints of the window: bins that are known from the cache, the others from the rasteriser."""
        a, base = self.fields, strokes.base
        kept = [("hd", 1), ("hf" if base is None else "raw", 1), ("gd", 1), ("gf", 2)]
        kept += [] if base is None else [("share", 1), ("target", 1)]
        parts = bin_cache.parts(at.level, at.box, strokes.bins_digest, sum(channels for _, channels in kept))
        fresh = missing(parts, at.box)
        over = None
        if base is not None:
            self._put_base(base.window(at.level, at.window), pitch)
            over = raster.Over(a["base"], a["share"], a["target"])
        if fresh.width:
            target = raster.Target(a["hd"], a[kept[1][0]], a["gd"], a["gf"], pitch, self.stride, over)
            tables = yield from strokes.shared_tables(at.level, at.box)
            yield from self._rasterised(tables, fresh, target)
        self._exchanged(kept, parts, fresh, at, pitch)
        bin_cache.trim()
        if base is not None:
            fields = [a[name] for name in ("base", "share", "target", "hd", "raw", "hf")]
            rows, columns = at.window.shape
            over_base(self.launch, fields, spacing, (rows, columns), pitch, (0, rows))

    def _rasterised(self, tables: Tables, fresh: Window, target: raster.Target) -> Iterator[Any]:
        """Two bands of bins are in the queue at once, until all are done."""
        loaded, events = raster.load(self.launch, tables), deque[Any]()
        for band in fresh.bands(BAND_BINS):
            raster.rasterise(self.launch, tables, band, target, loaded)
            events.append(self._mark())
            if len(events) > 1:
                yield events.popleft()
        yield from events

    def _exchanged(self, kept: list[tuple[str, int]], parts: list[Part], fresh: Window, at: Step, pitch: int) -> None:
        cl, queue, a = self.launch.cl, self.launch.queue, self.fields
        (rows, columns), both = at.window.shape, cl.map_flags.READ | cl.map_flags.WRITE
        views, maps = [], []
        for name, channels in kept:
            host, _ = cl.enqueue_map_buffer(queue, a[name], both, 0, (a[name].size // 4,), np.float32)
            maps.append(host)
            for c in range(channels):
                first = c * self.stride + PAD
                views.append(host[first : first + rows * pitch].reshape(rows, pitch)[:, :columns])
        exchange(parts, fresh, at.box, views)
        for host in maps:
            host.base.release(queue)

    def _put_base(self, samples: Values, pitch: int) -> None:
        """Copies the base's samples to the window's."""
        rows, columns = samples.shape
        self.launch.cl.enqueue_copy(
            self.launch.queue, self.fields["base"], samples, host_pitches=(4 * columns,), host_origin=(0, 0),
            region=(4 * columns, rows), buffer_pitches=(4 * pitch,), buffer_origin=(4 * PAD, 0),
        )  # fmt: skip

    def _sweep(
        self, channels: int, first: int, f: str, d: str, q: int, shape: tuple[Any, ...], screening: float, count: int,
        span: Span,
    ) -> None:  # fmt: skip
        i, a = np.int32, self.fields
        self.launch.run(
            "refine_sweeps", (channels,), a["u"], a["v"], a[f], a[d], a["q"], i(first), i(q), *shape,
            np.float32(screening), self.weights[count], i(count), *map(i, span),
        )  # fmt: skip

    def read(self, span: Span, pitch: int) -> Fields:
        """The fields of samples of the window, when all that was begun is done."""
        rows, columns = span.shape
        out = np.empty((CHANNELS, rows, columns), dtype=np.float32)
        for c in range(CHANNELS):
            self.launch.cl.enqueue_copy(
                self.launch.queue, out[c], self.fields["u"], host_pitches=(4 * columns,), host_origin=(0, 0),
                region=(4 * columns, rows), buffer_pitches=(4 * pitch,),
                buffer_origin=(4 * (c * self.stride + span.r0 * pitch + PAD + span.c0), 0),
            )  # fmt: skip
        return out


def _within(span: Span, rows: int, columns: int) -> Span:
    """As much of a span as a window has."""
    return Span(span.r0, min(rows, span.r1), span.c0, min(columns, span.c1))


def _padded(parent: NDArray[np.float32], rows: int, columns: int) -> NDArray[np.float32]:
    """Rows and columns enough for the kernel's vectors."""
    out = np.zeros((CHANNELS, rows // 2 + 4, -(-columns // BIN) * (BIN // 2) + 2 * PAD), dtype=np.float32)
    out[:, : parent.shape[1], : parent.shape[2]] = parent[:, : out.shape[1], : out.shape[2]]
    return out
