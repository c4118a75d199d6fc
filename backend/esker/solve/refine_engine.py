"""One step of refinement of one window: from the parent's fields to those of the next level (DESIGN 5.6).

Cubic prolongation, then Chebyshev-Jacobi sweeps of both steps of the solver with the constraints of the finer level:
first the two gradient components, then the heights with them as guidance. Each sample is a function of the samples
within HALO of it, and is computed by the same operations in every window: windows agree bit for bit on what they share.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from esker import grid
from esker.contract import CHEBYSHEV_HIGH, TerrainSettings
from esker.solve import raster, reference, reference_raster
from esker.solve.base_blocks import BaseWindows
from esker.solve.constraints import BIN, BinBox, Tables
from esker.solve.device import Device
from esker.solve.faults import guarded
from esker.solve.levels import PAD, Launcher, over_base
from esker.solve.refine_sheets import Sheets, exchange, missing

GRADIENT_SWEEPS: Final = 8
HEIGHT_SWEEPS: Final = 64
"""Both even. docs/decisions/0012-refinement.md says why so many."""
LOWEST: Final = 16.0
"""The sweeps damp errors from this / sweeps^2 of the spectrum's scale upward."""
HALO: Final = GRADIENT_SWEEPS + 1 + HEIGHT_SWEEPS
"""Samples around a window that take part: one more for the divergence."""
CHANNELS: Final = 3
"""d/dx, d/dy, height."""
_STRIPS_ROWS = 64

Values = NDArray[np.float32]
Fields = NDArray[np.float32]
"""(CHANNELS, rows, columns): d/dx, d/dy (metres per metre), height (metres)."""


class Span(NamedTuple):
    """Samples of a level: rows r0 .. r1 - 1, columns c0 .. c1 - 1."""

    r0: int
    r1: int
    c0: int
    c1: int

    def grown(self, by: int, samples: int) -> Span:
        """With ``by`` more samples on every side, as far as the level goes."""
        return Span(max(0, self.r0 - by), min(samples, self.r1 + by), max(0, self.c0 - by), min(samples, self.c1 + by))

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns)."""
        return self.r1 - self.r0, self.c1 - self.c0


@dataclass(frozen=True)
class Step:
    """Which samples one step computes and reads. core: the result; box: the bins of the window; parent: what is read of
    the next coarser level."""

    level: int
    core: Span
    box: BinBox
    parent: Span

    @property
    def window(self) -> Span:
        """The samples of the window: it begins on a bin and ends where the level does."""
        n = grid.samples(self.level)
        by0, by1, bx0, bx1 = self.box
        return Span(by0 * BIN, min(by1 * BIN, n), bx0 * BIN, min(bx1 * BIN, n))


def step(level: int, core: Span) -> Step:
    """The step that computes the samples ``core`` of ``level``."""
    n = grid.samples(level)
    halo = core.grown(HALO, n)
    box = halo.r0 // BIN, -(-halo.r1 // BIN), halo.c0 // BIN, -(-halo.c1 // BIN)
    r0, r1, c0, c1 = (box[0] * BIN, min(n, box[1] * BIN), box[2] * BIN, min(n, box[3] * BIN))
    under = Span(r0 // 2, (r1 - 1) // 2 + 1, c0 // 2, (c1 - 1) // 2 + 1)
    # the cubic between samples i and i + 1 needs i - 1 and i + 2
    parent = Span(under.r0 - 1, under.r1 + 2, under.c0 - 1, under.c1 + 2)
    m = grid.samples(level - 1)
    clipped = Span(max(0, parent.r0), min(m, parent.r1), max(0, parent.c0), min(m, parent.c1))
    return Step(level, core, box, clipped)


@lru_cache(maxsize=8)
def sweep_weights(sweeps: int) -> NDArray[np.float64]:
    """Relaxations of Chebyshev-Jacobi sweeps on [LOWEST / sweeps^2, CHEBYSHEV_HIGH].

    ``sweeps`` is a power of two. In the order of Lebedev and Finogenov (1971), each root followed by that which makes
    up for it, so that rounding errors do not grow: in their natural order float32 would lose all digits.
    """
    low = min(0.5, LOWEST / sweeps**2)
    mid, half = (CHEBYSHEV_HIGH + low) / 2, (CHEBYSHEV_HIGH - low) / 2
    order = [0]
    while len(order) < sweeps:
        order = [k for j in order for k in (j, 2 * len(order) - 1 - j)]
    return np.asarray(1 / (mid + half * np.cos(np.pi * (2 * np.array(order) + 1) / (2 * sweeps))))


def with_ghosts(parent: NDArray[Any], at: Step) -> NDArray[Any]:
    """The parent's samples with a ring of ghosts: beyond the level's border by quadratic extrapolation.

    Shape (channels, rows + 2, columns + 2) around ``at.window``'s parents; where the level goes on, its own samples.
    """
    out, m = parent, grid.samples(at.level - 1)
    for axis, low, high in ((1, at.parent.r0, at.parent.r1), (2, at.parent.c0, at.parent.c1)):
        a = np.moveaxis(out, axis, 0)
        south = [3 * a[:1] - 3 * a[1:2] + a[2:3]] if low == 0 else []
        north = [3 * a[-1:] - 3 * a[-2:-1] + a[-3:-2]] if high == m else []
        out = np.moveaxis(np.concatenate([*south, a, *north]), 0, axis)
    return out


class StrokeWindows(Protocol):
    """The strokes, as far as a step needs them."""

    settings: TerrainSettings
    base: BaseWindows | None

    def tables(self, level: int, box: BinBox) -> Tables:
        """The rasteriser's tables of a box of bins."""

    def shared_tables(self, level: int, box: BinBox) -> Tables:
        """The same for kernels: lists may name strokes that do not reach the box."""

    def sheet_digest(self, level: int, box: BinBox) -> bytes:
        """Digest of all that decides the constraints of a box of bins at this level."""


_MEMORY: Final = {"u": 3, "v": 3, "gd": 1, "gf": 2, "hd": 1, "hf": 1, "q": 2, "rhs": 1}
"""Fields of a window and their channels."""
_OVER: Final = {"base": 1, "share": 1, "target": 1, "raw": 1}
"""Those that it has over a base."""


class Engine(Protocol):
    """Computes one step. ``device``: on what; None is NumPy."""

    @property
    def device(self) -> Device | None: ...

    def run(self, at: Step, strokes: StrokeWindows, parent: Fields) -> Fields:
        """``at.core``'s fields from the parent's on ``at.parent``."""

    def clear(self) -> None:
        """Drop what is kept between steps."""


class NumpyEngine:
    """The twin in float64, and what serves without OpenCL."""

    device = None

    def clear(self) -> None:
        """Nothing is kept."""

    def run(self, at: Step, strokes: StrokeWindows, parent: Fields) -> Fields:
        tables = strokes.tables(at.level, at.box)
        under = None if strokes.base is None else strokes.base.window(at.level, at.window).astype(np.float64)
        c = reference_raster.rasterise(tables, under)
        f = c.height_f
        if under is not None:
            f = reference.over_base(f, c.height_d, c.share, c.target, under, tables.spacing_m)
        u = prolongation(with_ghosts(parent.astype(np.float64), at), at.window)
        gradient = sweeps(u[:2], c.gradient_f, c.gradient_d[None], tables.screening, GRADIENT_SWEEPS)
        fixed = c.height_d[None] < 0
        rhs = reference.divergence(f[None], c.height_d[None], gradient, tables.spacing_m)
        start = np.where(fixed, f[None], u[2:])
        height = sweeps(start, rhs, c.height_d[None], tables.screening, HEIGHT_SWEEPS)
        w, core = at.window, at.core
        rows, columns = slice(core.r0 - w.r0, core.r1 - w.r0), slice(core.c0 - w.c0, core.c1 - w.c0)
        return np.concatenate([gradient, height])[:, rows, columns].astype(np.float32)


def prolongation(parent: NDArray[np.float64], window: Span) -> NDArray[np.float64]:
    """The samples of ``window`` by the cubic through four samples; parent: ``with_ghosts``."""
    for axis, count in ((1, window.shape[0]), (2, window.shape[1])):
        a = np.moveaxis(parent, axis, 0)
        between = (9 * (a[1:-2] + a[2:-1]) - (a[:-3] + a[3:])) / 16
        out = np.empty((count, *a.shape[1:]))
        out[::2] = a[1 : 1 + (count + 1) // 2]
        out[1::2] = between[: count // 2]
        parent = np.moveaxis(out, 0, axis)
    return parent


def sweeps(
    u: NDArray[np.float64], rhs: NDArray[np.float64], d: NDArray[np.float64], screening: float, count: int
) -> NDArray[np.float64]:
    """``count`` sweeps; the window's ends are mirrored like the level's borders."""
    q = np.where(d < 0, 0.0, 1 / (4 + screening + np.maximum(d, 0)))
    for w in sweep_weights(count):
        u = u + w * q * reference.residual(u, rhs, d, screening)
    return u


class ClEngine:
    """The same on an OpenCL device, row by row (shaders/opencl/refine.cl). Keeps memory for the largest window."""

    def __init__(self, device: Device) -> None:
        self.device = device
        self.launch = Launcher(device, 0)
        self.weights = {k: self.launch.constant(sweep_weights(k).astype(np.float32)) for k in _counts()}
        self.sheets = Sheets()
        self.stride = 0
        self.fields: dict[str, Any] = {}

    def clear(self) -> None:
        """Drop the rasterised constraints."""
        self.sheets.clear()

    def _room(self, stride: int, based: bool) -> None:
        """Memory for windows of ``stride`` floats a channel, over a base if ``based``."""
        if stride > self.stride:
            self.stride = stride
            self.fields.clear()
        for name, channels in (_MEMORY | _OVER if based else _MEMORY).items():
            if name not in self.fields:
                self.fields[name] = self.launch.zeros(channels * self.stride + 2 * PAD)

    def run(self, at: Step, strokes: StrokeWindows, parent: Fields) -> Fields:
        with guarded(self.device):
            return self._run(at, strokes, parent)

    def _run(self, at: Step, strokes: StrokeWindows, parent: Fields) -> Fields:
        i, f = np.int32, np.float32
        spacing = grid.spacing(at.level, strokes.settings.size_m)
        reach = strokes.settings.reach_m
        screening = 0.0 if reach is None else (spacing / reach) ** 2
        rows, columns = at.window.shape
        pitch = PAD + (at.box[3] - at.box[2]) * BIN + PAD
        self._room(rows * pitch, strokes.base is not None)
        a, stride, run = self.fields, self.stride, self.launch.run
        self._constrain(at, strokes, pitch, spacing)
        shape = (i(rows), i(columns), i(pitch), i(stride))
        each = _STRIPS_ROWS
        strips = -(-rows // each)
        host = _padded(with_ghosts(parent, at), rows, columns)
        run(
            "refine_start", (strips, CHANNELS), self.launch.constant(host), i(host.shape[2]),
            i(host.shape[1] * host.shape[2]), a["gd"], a["hd"], a["hf"], a["u"], a["q"], *shape, f(screening),
            i(each),
        )  # fmt: skip
        core = at.core
        target_span = Span(
            core.r0 - at.window.r0, core.r1 - at.window.r0, core.c0 - at.window.c0, core.c1 - at.window.c0
        )
        wide = target_span.grown(HEIGHT_SWEEPS + 1, 1 << 30)
        wide = Span(wide.r0, min(rows, wide.r1), wide.c0, min(columns, wide.c1))
        self._sweep(2, 0, "gf", "gd", 0, shape, screening, GRADIENT_SWEEPS, wide)
        run("refine_guide", (strips,), a["u"], a["hd"], a["hf"], a["rhs"], *shape, f(spacing), i(each))
        self._sweep(1, 2, "rhs", "hd", 1, shape, screening, HEIGHT_SWEEPS, target_span)
        return self._read(target_span, pitch)

    def _constrain(self, at: Step, strokes: StrokeWindows, pitch: int, spacing: float) -> None:
        """The constraints of the window: bins that are known from the sheets, the others from the rasteriser."""
        a, cl, queue, base = self.fields, self.launch.cl, self.launch.queue, strokes.base
        kept = [("hd", 1), ("hf" if base is None else "raw", 1), ("gd", 1), ("gf", 2)]
        kept += [] if base is None else [("share", 1), ("target", 1)]
        parts = self.sheets.parts(at.level, at.box, strokes.sheet_digest, sum(channels for _, channels in kept))
        fresh = missing(parts, at.box)
        (rows, columns), both = at.window.shape, cl.map_flags.READ | cl.map_flags.WRITE
        over = None
        if base is not None:
            self._put_base(base.window(at.level, at.window), pitch)
            over = raster.Over(a["base"], a["share"], a["target"])
        if fresh.width:
            target = raster.Target(a["hd"], a[kept[1][0]], a["gd"], a["gf"], pitch, self.stride, over)
            raster.rasterise(self.launch, strokes.shared_tables(at.level, at.box), fresh, target)
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
        self.sheets.trim()
        if base is not None:
            fields = [a[name] for name in ("base", "share", "target", "hd", "raw", "hf")]
            over_base(self.launch, fields, spacing, (rows, columns), pitch, (0, rows))

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

    def _read(self, span: Span, pitch: int) -> Fields:
        rows, columns = span.shape
        out = np.empty((CHANNELS, rows, columns), dtype=np.float32)
        for c in range(CHANNELS):
            self.launch.cl.enqueue_copy(
                self.launch.queue, out[c], self.fields["u"], host_pitches=(4 * columns,), host_origin=(0, 0),
                region=(4 * columns, rows), buffer_pitches=(4 * pitch,),
                buffer_origin=(4 * (c * self.stride + span.r0 * pitch + PAD + span.c0), 0),
            )  # fmt: skip
        return out


def _counts() -> set[int]:
    return {GRADIENT_SWEEPS, HEIGHT_SWEEPS}


def _padded(parent: NDArray[np.float32], rows: int, columns: int) -> NDArray[np.float32]:
    """Rows and columns enough for the kernel's vectors."""
    out = np.zeros((CHANNELS, rows // 2 + 4, -(-columns // BIN) * (BIN // 2) + 2 * PAD), dtype=np.float32)
    out[:, : parent.shape[1], : parent.shape[2]] = parent[:, : out.shape[1], : out.shape[2]]
    return out
