"""The correction on a coarse grid of a window on an OpenCL device (shaders/opencl/pockets.cl); twin ``correction``."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from esker.solve.opencl.levels import PAD, Launcher
from esker.solve.refine.engine import LAST_SWEEPS, Span
from esker.solve.refine.pocket import COARSENINGS, MARGIN

STRIP_ROWS: Final = 32
"""Rows of a grid that one work-item does."""
LANES: Final = 16
"""Subdomains that a work-item relaxes at once."""
_PLANES: Final = 8
"""Arms, springs, right-hand side and correction of a grid, and how loosely arms hold."""
_COUPLINGS, _AROUND = 5, 9

Shape = tuple[int, int, int, int]
"""Rows, columns, floats from one row to the next, and from one plane to the next."""


class Pockets:
    """Memory for one window at a time, as large as the largest so far."""

    def __init__(self, launch: Launcher) -> None:
        self._launch = launch
        self._held: dict[str, Any] = {}

    def correct(self, fields: dict[str, Any], window: Shape, span: Span, screening: float) -> None:
        """Enqueues u += correction on channel 2 of a window, right where the last sweeps for ``span`` read it.

        fields: u, v, rhs and hd of the window (``cl_engine``).
        """
        run, i, f = self._launch.run, np.int32, np.float32
        rows = window[0]
        shape, strips = tuple(map(i, window)), -(-rows // STRIP_ROWS)
        run(
            "refine_residual", (strips,), fields["u"], fields["v"], fields["rhs"], fields["hd"], i(2), *shape,
            f(screening), i(STRIP_ROWS),
        )  # fmt: skip
        grids = [_coarser(window)]
        for _ in range(COARSENINGS - 1):
            grids.append(_coarser(grids[-1]))
        held = [self._reserved(f"grid {k}", _PLANES * g[3] + 4 * PAD) for k, g in enumerate(grids)]
        run(
            "pocket_first", (_strips(grids[0][0]),), fields["hd"], fields["v"], i(2), *shape, held[0],
            *map(i, grids[0]), i(STRIP_ROWS),
        )  # fmt: skip
        for fine, coarse, a, b in zip(grids, grids[1:], held, held[1:], strict=False):
            run("pocket_next", (_strips(coarse[0]),), a, *map(i, fine), b, *map(i, coarse), i(STRIP_ROWS))
        y0, y1, x0, x1 = _nodes(span, grids[-1])
        self._relax(held[-1], grids[-1], (y0, y1, x0, x1), screening * 4.0**COARSENINGS)
        pairs = list(zip(grids, grids[1:], held, held[1:], strict=False))
        for fine, coarse, a, b in pairs[::-1]:
            run("pocket_back", (_strips(y1 - y0),), a, *map(i, fine), b, *map(i, coarse), i(y0), i(y1), i(STRIP_ROWS))
            y0, y1 = 2 * y0, min(2 * y1, fine[0])
        run(
            "pocket_last", (_strips(y1 - y0),), fields["u"], fields["hd"], i(2), *shape, held[0], *map(i, grids[0]),
            i(y0), i(y1), i(STRIP_ROWS),
        )  # fmt: skip

    def release(self) -> None:
        """Drops the memory."""
        self._held.clear()

    def _relax(self, grid: Any, shape: Shape, nodes: tuple[int, int, int, int], screening: float) -> None:
        """Enqueues the correction of these nodes (rows y0, y1, columns x0, x1) of the last grid."""
        run, i = self._launch.run, np.int32
        (rows, columns, _, _), (y0, y1, x0, x1) = shape, nodes
        (py0, py1), (px0, px1) = ((low // 2, high // 2 + 1) for low, high in ((y0, y1), (x0, x1)))
        pitch = PAD + columns + 6 * LANES
        stride = (rows + 2 * MARGIN) * pitch
        couplings = self._reserved("couplings", _COUPLINGS * stride + 8 * PAD)
        around_pitch = PAD + columns // 2 + 3 * LANES
        around_stride = (rows // 2 + 2) * around_pitch
        around = self._reserved("around", _AROUND * around_stride + 4 * PAD)
        run("pocket_couple", (1,), grid, *map(i, shape), couplings, i(pitch), i(stride), np.float32(screening))
        py1 = min(py1, (rows + 1) // 2)
        run(
            "pocket_relax", (py1 - py0,), couplings, i(pitch), i(stride), around, i(around_pitch), i(around_stride),
            i(py0), i(px0), i(px1),
        )  # fmt: skip
        run(
            "pocket_blend", (1,), around, i(around_pitch), i(around_stride), grid, *map(i, shape[2:]), *map(i, nodes),
        )  # fmt: skip

    def _reserved(self, name: str, floats: int) -> Any:
        """Memory of at least so many floats."""
        held = self._held.get(name)
        if held is None or held.size < 4 * floats:
            held = self._held[name] = self._launch.zeros(floats)
        return held


def _coarser(grid: Shape) -> Shape:
    """The shape of the grid of every second row and column."""
    rows, columns = (grid[0] + 1) // 2, (grid[1] + 1) // 2
    pitch = PAD + -(-columns // LANES) * LANES + PAD
    return rows, columns, pitch, rows * pitch


def _strips(rows: int) -> int:
    return -(-rows // STRIP_ROWS)


def _nodes(span: Span, grid: Shape) -> tuple[int, int, int, int]:
    """The nodes of the last grid that the samples of a span and those that its last sweeps read depend on."""
    near = LAST_SWEEPS + (1 << COARSENINGS) - 1
    out = []
    for low, high, count in ((span.r0, span.r1, grid[0]), (span.c0, span.c1, grid[1])):
        out += [max(0, (low - near) >> COARSENINGS), min(count, ((high + near) >> COARSENINGS) + 2)]
    return out[0], out[1], out[2], out[3]
