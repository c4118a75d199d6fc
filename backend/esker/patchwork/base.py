"""The ground of all visible layers on the levels of a terrain: what the solver adds strokes to (DESIGN 11).

Level l shows the patchwork at tolerance 0 where its samples are as close as the finest data, and at a quarter of its
spacing where they are farther apart: coarse levels are filtered by the data's own mipmaps. Bicubic patches are used
throughout, since tiles finer than the data would show the facets of bilinear ones.
"""

from __future__ import annotations

import hashlib
import itertools
import math
import threading
from typing import Final

import numpy as np
from numpy.typing import NDArray

from esker import grid
from esker.contract import MAX_LEVEL, MAX_SYNTHESIS_LEVEL
from esker.patchwork import blend, outside, survey
from esker.patchwork.blend_device import ClDevice
from esker.patchwork.lod_space import Model

Grid = NDArray[np.float32]

_FORMAT: Final = b"esker base 1"
_CHUNK: Final = 1024
"""Samples along one side of what is evaluated at once: bounds the memory of coefficients."""
_OVERSHOOT: Final = 0.75
"""Share of the data's range by which a bicubic surface may leave it on either side (Lebesgue constant 1.55 an axis)."""


class Base:
    """Ground of the layers of ``model`` on a domain of ``size_m`` metres. Immutable; safe to use from any thread.

    ``digest``: of everything that it follows from. ``low``, ``high``: bounds of its heights, metres. ``spacing_m``:
    finest sample spacing of a layer. ``before``: another one, of which parts that no changed layer reaches are used.
    """

    def __init__(self, model: Model, size_m: float, before: Base | None = None) -> None:  # noqa: ARG002
        self.model, self.size_m = model, size_m
        self.spacing_m = min((min(p.layer.spacing_m) for p in model.placed), default=math.inf)
        self.digest = _digest(model, size_m)
        self.low, self.high = _bounds(model)
        self._lock = threading.RLock()
        self._levels: dict[int, Grid] = {}
        self._surveys: dict[int, Grid] = {}

    def tolerance(self, level: int) -> float:
        """Error in metres that level ``level`` may have."""
        spacing = grid.spacing(level, self.size_m)
        return 0.0 if spacing <= self.spacing_m else spacing / 4

    def level(self, level: int, device: ClDevice | None = None) -> Grid:
        """The whole level: read-only float32 (64 * 2^level + 1 a side), metres, never NaN."""
        if not 0 <= level <= MAX_LEVEL:
            raise ValueError(f"level {level} is not a whole level: 0..{MAX_LEVEL}")
        with self._lock:
            if level not in self._levels:
                made = self._made(level, device)
                made.setflags(write=False)
                self._levels[level] = made
            return self._levels[level]

    def window(self, level: int, rows: slice, cols: slice, device: ClDevice | None = None) -> Grid:
        """Samples ``[rows, cols]`` of a level up to 17: float32, metres, the same bits as ``level`` has.

        Indices beyond the domain give its nearest sample. Raises ValueError for another level or an empty window.
        """
        if not 0 <= level <= MAX_SYNTHESIS_LEVEL:
            raise ValueError(f"level {level} is not one of 0..{MAX_SYNTHESIS_LEVEL}")
        if rows.stop <= rows.start or cols.stop <= cols.start:
            raise ValueError("an empty window")
        last = grid.samples(level) - 1
        row = np.clip(np.arange(rows.start, rows.stop), 0, last)
        col = np.clip(np.arange(cols.start, cols.stop), 0, last)
        inside = slice(int(row[0]), int(row[-1]) + 1), slice(int(col[0]), int(col[-1]) + 1)
        with self._lock:
            found = self._window(level, *inside, device)
        return np.ascontiguousarray(found[np.ix_(row - row[0], col - col[0])])

    def survey(self, level: int) -> Grid:
        """How far down there is data: read-only float32 (64 * 2^level + 1 a side), see ``Channel.SURVEY``."""
        with self._lock:
            if level not in self._surveys:
                made = survey.levels(self.model, self.size_m, grid.samples(level))
                made.setflags(write=False)
                self._surveys[level] = made
            return self._surveys[level]

    def changed(self, other: Base | None) -> grid.Rect | None:
        """A rectangle outside of which this base and the other are the same on every level; None if they are."""
        if other is not None and other.digest == self.digest:
            return None
        return grid.Rect(0.0, 0.0, self.size_m, self.size_m)

    def _made(self, level: int, device: ClDevice | None) -> Grid:
        """A whole level. Coarser than the anchor the membrane is the anchor's, so that all levels show one."""
        whole = slice(0, grid.samples(level))
        if level > outside.ANCHOR:
            return self._window(level, whole, whole, device)
        heights, cover = self._blend(level, whole, whole, device)
        if (cover == 1).all():
            return heights
        if level == outside.ANCHOR:
            return outside.membrane(heights, cover)
        anchor = self.level(outside.ANCHOR, device)
        step = 1 << (outside.ANCHOR - level)
        return cover * heights + (np.float32(1) - cover) * anchor[::step, ::step]

    def _window(self, level: int, rows: slice, cols: slice, device: ClDevice | None) -> Grid:
        """``window`` inside the domain."""
        if level in self._levels:
            return self._levels[level][rows, cols]
        if level <= outside.ANCHOR:
            return self.level(level, device)[rows, cols]
        heights, cover = self._blend(level, rows, cols, device)
        if (cover == 1).all():
            return heights
        sweeps = outside.SWEEPS if grid.spacing(level, self.size_m) >= self.spacing_m / 2 else 0
        n = grid.samples(level)
        tall = slice(max(0, rows.start - sweeps), min(n, rows.stop + sweeps))
        wide = slice(max(0, cols.start - sweeps), min(n, cols.stop + sweeps))
        if sweeps:
            heights, cover = self._blend(level, tall, wide, device)
        half = grid.samples(level - 1)
        up, across = outside.needed(tall, half), outside.needed(wide, half)
        coarse = self._window(level - 1, up, across, device)
        carried = outside.carry(coarse, up.start, across.start, half, tall, wide)
        ground = cover * heights + (np.float32(1) - cover) * carried
        ground = outside.relax(ground, heights, cover, sweeps)
        top, left = rows.start - tall.start, cols.start - wide.start
        return ground[top : top + rows.stop - rows.start, left : left + cols.stop - cols.start]

    def _blend(self, level: int, rows: slice, cols: slice, device: ClDevice | None) -> tuple[Grid, Grid]:
        """Blended heights and cover of a window inside the domain."""
        shape = rows.stop - rows.start, cols.stop - cols.start
        heights, cover = np.empty(shape, dtype=np.float32), np.empty(shape, dtype=np.float32)
        spacing, tolerance = grid.spacing(level, self.size_m), self.tolerance(level)
        for r in _chunks(rows):
            for c in _chunks(cols):
                lattice = blend.Lattice(spacing, r.start, r.stop, c.start, c.stop)
                packed = blend.pack(self.model, _chosen(self.model, tolerance, lattice.rect()), smooth=True)
                up, across = (
                    slice(r.start - rows.start, r.stop - rows.start),
                    slice(c.start - cols.start, c.stop - cols.start),
                )
                heights[up, across], cover[up, across] = blend.evaluate(packed, lattice, device)
        return heights, cover


def _chunks(span: slice) -> list[slice]:
    """Parts of a span that end at multiples of ``_CHUNK``."""
    cuts = [span.start, *range((span.start // _CHUNK + 1) * _CHUNK, span.stop, _CHUNK), span.stop]
    return [slice(a, b) for a, b in itertools.pairwise(cuts)]


def _chosen(model: Model, tolerance: float, rect: tuple[float, float, float, float]) -> NDArray[np.int32]:
    x0, y0, x1, y1 = rect
    index = np.flatnonzero((model.low <= tolerance) & (tolerance < model.max_z))
    kernel = model.kernel[index]
    # A margin is 1.5 cells on either side of at least half a cell: four times the kernel's size is more than enough.
    low, high = kernel.min(axis=1), kernel.max(axis=1)
    reach = 4 * (high - low).max(axis=1, initial=0) if len(index) else np.zeros(0)
    near = (low[:, 0] - reach <= x1) & (high[:, 0] + reach >= x0) & (low[:, 1] - reach <= y1)
    return np.asarray(index[near & (high[:, 1] + reach >= y0)], dtype=np.int32)


def _digest(model: Model, size_m: float) -> bytes:
    """SHA-256 of everything that the ground follows from."""
    lines = sorted(
        repr((p.layer.id, p.layer.content, p.layer.anchor, p.layer.rotation_deg, p.layer.spacing_m, p.layer.scale,
              p.layer.lift_m, p.layer.accuracy_m, p.layer.priority))
        for p in model.placed
    )  # fmt: skip
    return hashlib.sha256(b"\0".join([_FORMAT, repr(size_m).encode(), *(line.encode() for line in lines)])).digest()


def _bounds(model: Model) -> tuple[float, float]:
    """Heights that the ground cannot leave, metres."""
    low, high = math.inf, -math.inf
    for placed in model.placed:
        facts, layer = placed.layer.facts, placed.layer
        ends = sorted((layer.scale * facts.low_m + layer.lift_m, layer.scale * facts.high_m + layer.lift_m))
        low, high = min(low, ends[0]), max(high, ends[1])
    if low > high:
        return 0.0, 0.0
    more = _OVERSHOOT * (high - low) + 1e-3
    return low - more, high + more
