"""Launching the rasteriser on a device (DESIGN 5.5): shaders/opencl/raster.cl, twin ``reference_raster``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from esker.solve.constraints.kept_sums import NO_STROKE, Kept
from esker.solve.constraints.tables import Tables, Window
from esker.solve.opencl.device import named


class Launcher(Protocol):
    """A queue: ``levels.Launcher`` with one work-item a bin, or that of ``gpu_levels`` with one a sample.

    keeps_sums: whether its kernels can go on from sums of strokes that are kept."""

    keeps_sums: bool

    def constant(self, array: NDArray[Any]) -> Any: ...
    def run(self, name: str, size: tuple[int, ...], *args: Any) -> None: ...


@dataclass(frozen=True)
class Over:
    """Float32 buffers laid out like the constraints. base: the base there; share, target: to be written, see
    ``reference_raster.Constraints``."""

    base: Any
    share: Any
    target: Any


@dataclass(frozen=True)
class Target:
    """Where constraints go: float32 buffers of rows ``pitch`` floats apart, channels ``stride`` floats apart.

    Sample (row, column) of the level lies at (row - row0) * pitch + PAD + column - column0, with (row0, column0) the
    origin of the tables' box. Whole bins are written: rows need room for 16 samples a bin. height_d, height_f and
    gradient_d hold one channel, gradient_f two.
    """

    height_d: Any
    height_f: Any
    gradient_d: Any
    gradient_f: Any
    pitch: int
    stride: int
    over: Over | None = None


def rasterise(
    launch: Launcher,
    tables: Tables,
    window: Window,
    target: Target,
    loaded: tuple[Any, ...] | None = None,
    kept: Kept | None = None,
) -> None:
    """Enqueue the constraints of the bins of ``window``, which lie within the tables' box.

    ``loaded``: of ``load``, where several windows of the same tables follow each other; ``kept``: sums of strokes to go
    on from, for a launcher that keeps them.
    """
    if window.width == 0:
        return
    arguments = load(launch, tables) if loaded is None else loaded
    over = () if target.over is None else (target.over.base, target.over.share, target.over.target)
    first, slots, sums = Kept(NO_STROKE, None, None) if kept is None else kept
    sums_of = (np.int32(first), slots, sums) if launch.keeps_sums else ()
    name = named("rasterise", over_base=target.over is not None)
    launch.run(
        name, (window.width, len(window.spans)), *arguments, *_window(launch, tables, window),
        np.int32(target.pitch), np.int32(target.stride), target.gradient_d, target.gradient_f, target.height_d,
        target.height_f, np.float32(tables.screening), np.int32(tables.pinned), *sums_of, *over,
    )  # fmt: skip


def rasterise_channel(
    launch: Launcher,
    tables: Tables,
    window: Window,
    d: Any,
    f: Any,
    pitch: int,
    stride: int,
    covered: bool,
    base: Any = None,
) -> None:
    """Enqueue what the strokes say of the tables' channel, as a difference from its base (DESIGN 5.4).

    d: stiffness; f: what it pulls to, and if ``covered``, in a second channel, that of a value of 1 (see
    ``reference_raster.rasterise_channel``). base: a buffer with the base there. Layout: see ``Target``.
    """
    if window.width == 0:
        return
    name = named("rasterise_channel", over_base=base is not None)
    launch.run(
        name, (window.width, len(window.spans)), *load(launch, tables), *_window(launch, tables, window),
        np.int32(pitch), np.int32(stride), d, f, np.float32(tables.screening), np.int32(covered),
        *(() if base is None else (base,)),
    )  # fmt: skip


def load(launch: Launcher, tables: Tables) -> tuple[Any, ...]:
    """TABLE_ARGUMENTS of nearest.cl: the tables on the device."""

    def put(array: NDArray[Any]) -> Any:
        return launch.constant(array.astype(np.float32 if array.dtype.kind == "f" else np.int32))

    i, f = np.int32, np.float32
    cliff = 0.0 if tables.reach_m is None else 1 / tables.reach_m
    return (
        put(tables.segments), i(tables.segments.shape[1]), put(tables.knots), i(tables.knots.shape[1]),
        put(tables.pieces), put(tables.octaves), put(tables.strokes), put(tables.index), put(tables.row_start),
        put(tables.row_items), put(tables.span_index), put(tables.spans), i(tables.box[0]), i(tables.box[2]),
        f(tables.spacing_m), f(tables.octave_m), f(tables.exit_length_m), f(cliff), i(tables.edition),
    )  # fmt: skip


def _window(launch: Launcher, tables: Tables, window: Window) -> tuple[Any, ...]:
    """The bins to be done, and the samples of the level."""
    return np.int32(window.first), launch.constant(window.spans.astype(np.int32)), np.int32(tables.samples)
