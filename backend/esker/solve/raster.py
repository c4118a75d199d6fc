"""Launching the rasteriser on a device (DESIGN 5.5): shaders/opencl/raster.cl, twin ``reference_raster``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from esker.solve.tables import Tables, Window


class Launcher(Protocol):
    """A queue: ``levels.Launcher`` with one work-item a bin, or that of ``gpu_levels`` with one a sample."""

    def constant(self, array: NDArray[Any]) -> Any: ...
    def run(self, name: str, size: tuple[int, ...], *args: Any) -> None: ...


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


def rasterise(launch: Launcher, tables: Tables, window: Window, target: Target) -> None:
    """Enqueue the constraints of the bins of ``window``, which lie within the tables' box."""
    if window.width == 0:
        return
    put, i, f = launch.constant, np.int32, np.float32
    floats = [put(a.astype(np.float32)) for a in (tables.segments, tables.strokes, tables.spans)]
    ints = (tables.index, tables.row_start, tables.row_items, tables.span_index)
    launch.run(
        "rasterise", (window.width, len(window.spans)), floats[0], i(tables.segments.shape[1]), floats[1],
        *(put(a.astype(np.int32)) for a in ints), floats[2], target.height_d, target.height_f, target.gradient_d,
        target.gradient_f, i(tables.samples), i(target.pitch), i(target.stride), f(tables.spacing_m),
        f(tables.screening), f(tables.exit_length_m), i(tables.pinned), i(tables.box[0]), i(tables.box[2]),
        i(window.first), put(window.spans),
    )  # fmt: skip
