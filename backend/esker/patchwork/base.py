"""The ground of all visible layers on the levels of a terrain: what the solver adds strokes to (DESIGN 11).

Level l shows the patchwork with an error of up to a quarter of its spacing, but never by patches coarser than its own
samples: coarse levels are filtered by the data's own mipmaps, and levels as fine as a layer's data show the data. That
is a rule of each layer by itself, so that a finer layer somewhere changes nothing elsewhere. Bicubic patches are used
throughout, since tiles finer than the data would show the facets of bilinear ones.
"""

from __future__ import annotations

import hashlib
import itertools
import math
import threading
from collections import OrderedDict
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from esker import grid
from esker.contract import MAX_LEVEL, MAX_SYNTHESIS_LEVEL
from esker.patchwork import data_level, outside
from esker.patchwork.blend import lattice as blend
from esker.patchwork.blend import points as blend_points
from esker.patchwork.blend import reuse
from esker.patchwork.blend.device import ClDevice
from esker.patchwork.blend.loops import BIN
from esker.patchwork.lod.space import Model
from esker.patchwork.query.queries import Index
from esker.patchwork.seams.seam_blend import SeamBlend

Grid = NDArray[np.float32]
Floats = NDArray[np.float64]

_FORMAT: Final = b"esker base 3"
BENT_EDITION: Final = 3
"""From this edition of a terrain on grids go on beyond their borders with the bend that they have there."""
_CHUNK: Final = 1024
"""Samples along one side of what is evaluated at once: bounds the memory of coefficients."""
_KEPT_LEVELS: Final = 5
"""Levels up to this one keep blend and cover, so that a later base can take over what no changed layer reaches."""
_KEPT_BLOCKS: Final = 8192
"""Blocks of BIN x BIN samples of finer levels beyond the data that are kept: 32 MiB."""
_OVERSHOOT: Final = 0.75
"""Share of the data's range by which a bicubic surface may leave it on either side (Lebesgue constant 1.55 an axis)."""


class Blended(NamedTuple):
    """Blended heights and cover of a whole level."""

    heights: Grid
    cover: Grid


class Sample(NamedTuple):
    """The ground at n places: heights (n,) in metres; gradient (n, 2) dz/dx, dz/dy; hessian (n, 3) d2z/dx2, d2z/dxdy,
    d2z/dy2 per metre. All float64; no derivatives where none were asked for."""

    heights: Floats
    gradient: Floats | None = None
    hessian: Floats | None = None


class Base:
    """Ground of the layers of ``model`` on a domain of ``size_m`` metres. Immutable; safe to use from any thread.

    ``digest``: of everything that it follows from. ``low``, ``high``: bounds of its heights, metres. ``spacing_m``:
    finest sample spacing of a layer. ``before``: another one, of which parts that no changed layer reaches are used.
    ``edition``: that of the terrain (``contract.CURRENT_EDITION``).
    Kinds of devices differ in their last bits: each level stays with the device that it was first asked for with, and
    so does that of a base made from one before.
    """

    def __init__(self, model: Model, size_m: float, before: Base | None = None, edition: int = 1) -> None:
        self.model, self.size_m, self.edition = model, size_m, edition
        self._bent = edition >= BENT_EDITION
        self.spacing_m = min((min(p.layer.spacing_m) for p in model.placed), default=math.inf)
        self.digest = _digest(model, size_m, self._bent)
        self.low, self.high = _bounds(model)
        self.index: Index = Index(model) if before is None else before.index.updated(model)
        self._lock = threading.RLock()
        self._levels: dict[int, Grid] = {}
        self._blended: dict[int, Blended] = {}
        self._surveys: dict[int, Grid] = {}
        self._blocks: OrderedDict[tuple[int, int, int], Grid] = OrderedDict()
        self._devices: dict[int, ClDevice | None] = {}
        self._seam_blend: SeamBlend | None = None
        self._before: tuple[Model, SeamBlend, dict[int, Blended]] | None = None
        if before is not None and before.size_m == size_m and before._bent == self._bent:
            with before._lock:
                if before._seam_blend is not None:
                    self._before = before.model, before._seam_blend, dict(before._blended)
                self._devices = dict(before._devices)

    def tolerance(self, level: int) -> float:
        """Error in metres that level ``level`` may have where its samples are farther apart than the data's."""
        return grid.spacing(level, self.size_m) / 4

    @property
    def seam_blend(self) -> SeamBlend:
        """How the ground of older layers is bent to meet newer ones."""
        with self._lock:
            if self._seam_blend is None:
                before = None if self._before is None else self._before[1]
                self._seam_blend = SeamBlend(self.model, self.size_m, before, self._bent)
            return self._seam_blend

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
        return np.array(found[np.ix_(row - row[0], col - col[0])])

    def survey(self, level: int) -> Grid:
        """How far down there is data: read-only float32 (64 * 2^level + 1 a side), see ``Channel.SURVEY``."""
        with self._lock:
            if level not in self._surveys:
                made = data_level.levels(self.model, self.size_m, grid.samples(level))
                made.setflags(write=False)
                self._surveys[level] = made
            return self._surveys[level]

    def sample(
        self,
        points: Floats,
        tolerance: float = 0.0,
        smooth: bool = True,
        derivatives: bool = False,
        device: ClDevice | None = None,
    ) -> Sample:
        """The ground at world places (n, 2) with an error up to ``tolerance`` metres (the data's own at 0), by the
        patches that a level of four times that spacing shows.

        ``smooth``: bicubic patches, twice continuously differentiable; else bilinear ones, continuous. Beyond the data
        the same continuation as on levels, made smooth, clamped to the domain. Raises ValueError for points that are
        not (n, 2) finite numbers or a tolerance below 0.
        """
        points = np.asarray(points, dtype=np.float64)
        if points.ndim != 2 or points.shape[1] != 2 or not np.isfinite(points).all():
            raise ValueError("places must be finite numbers of shape (n, 2)")
        if not tolerance >= 0:
            raise ValueError(f"a tolerance of {tolerance} m is not 0 or more")
        if len(points) == 0:
            return Sample(np.zeros(0), *((np.zeros((0, 2)), np.zeros((0, 3))) if derivatives else ()))
        low, high = points.min(axis=0), points.max(axis=0)
        # As on a level: beside newer ground all patches of the older are stale, and the finest are shown.
        spacing = max(4 * tolerance, self.spacing_m / 64)
        chosen = self.index.resolved(spacing, tolerance, (low[0], low[1], high[0], high[1]))
        packed = blend.pack(self.model, chosen, smooth, tolerance, self._bent)
        jets = blend_points.evaluate(packed, points)
        self.seam_blend.lay_jets(packed, points, jets.heights)
        bare = np.flatnonzero(jets.cover[:, 0] < 1)
        heights = jets.heights
        if len(bare):
            beyond = self._beyond(points[bare], device)
            heights[bare] = blend_points.joined(jets.heights[bare], jets.cover[bare], beyond)
        return Sample(heights[:, 0].copy(), *((heights[:, 1:3].copy(), heights[:, 3:].copy()) if derivatives else ()))

    def changed(self, other: Base | None) -> grid.Rect | None:
        """A rectangle outside of which this base and the other have the same heights on every level; None if all have.

        Where there is ground beyond the data, levels up to ``outside.ANCHOR`` are made and compared.
        """
        whole = grid.Rect(0.0, 0.0, self.size_m, self.size_m)
        if other is None or other.size_m != self.size_m or other._bent != self._bent:
            return whole
        if other.digest == self.digest:
            return None
        rect = reuse.reached(self.model, other.model)
        for corrected in self.seam_blend.changed(other.seam_blend):
            rect = grid.Rect(*corrected).union(rect)
        step = grid.spacing(outside.ANCHOR, self.size_m)
        for level in range(outside.ANCHOR + 1):
            device = self._devices.get(level, other._devices.get(level))
            differ = np.argwhere(self.level(level, device) != other.level(level, device))
            if len(differ):
                (y0, x0), (y1, x1) = (end * grid.spacing(level, self.size_m) for end in (differ.min(0), differ.max(0)))
                rect = grid.Rect(float(x0), float(y0), float(x1), float(y1)).union(rect)
        # The anchor's cells around a sample that differs carry the difference to finer levels: two, and their sweeps.
        grown = rect.grown((2 + outside.SWEEPS) * step) if rect is not None else None
        if grown is None or not grown.intersects(whole):
            return None
        return grid.Rect(max(grown.x0, 0.0), max(grown.y0, 0.0), min(grown.x1, self.size_m), min(grown.y1, self.size_m))

    def _made(self, level: int, device: ClDevice | None) -> Grid:
        """A whole level. Coarser than the anchor the membrane is the anchor's, so that all levels show one."""
        whole = slice(0, grid.samples(level))
        if level > outside.ANCHOR:
            return np.ascontiguousarray(self._window(level, whole, whole, device))
        heights, cover = self._whole(level, device)
        if (cover == 1).all():
            return heights.copy()
        if level == outside.ANCHOR:
            return outside.membrane(*self._with_specks(heights, cover))
        anchor = self.level(outside.ANCHOR, device)
        step = 1 << (outside.ANCHOR - level)
        return cover * heights + (np.float32(1) - cover) * anchor[::step, ::step]

    def _with_specks(self, heights: Grid, cover: Grid) -> tuple[Grid, Grid]:
        """The anchor's blend with layers that are too small for its samples: their mean at the nearest one.

        Else such a layer would be unknown to the membrane, and stand on it as a spike on the levels that resolve it.
        """
        heights, cover = heights.copy(), cover.copy()
        spacing, last = grid.spacing(outside.ANCHOR, self.size_m), grid.samples(outside.ANCHOR) - 1
        for placed, first, held in zip(self.model.placed, self.model.first, self.model.layers, strict=True):
            corners = self.model.kernel[first : first + held.count].reshape(-1, 2)
            if len(corners) == 0 or np.ptp(corners, axis=0).max() > 2 * spacing:
                continue
            col, row = np.round((corners.min(axis=0) + corners.max(axis=0)) / (2 * spacing)).astype(int)
            if 0 <= row <= last and 0 <= col <= last and cover[row, col] < 1:
                mean = float(np.nanmean(placed.raster.mips[-1], dtype=np.float64))
                heights[row, col], cover[row, col] = placed.layer.scale * mean + placed.layer.lift_m, 1
        return heights, cover

    def _window(self, level: int, rows: slice, cols: slice, device: ClDevice | None) -> Grid:
        """``window`` inside the domain: from what is kept, else made and kept."""
        if level in self._levels:
            return self._levels[level][rows, cols]
        if level <= outside.ANCHOR:
            return self.level(level, device)[rows, cols]
        n = grid.samples(level)
        tall, wide = (slice(s.start // BIN * BIN, min(n, -(-s.stop // BIN) * BIN)) for s in (rows, cols))
        places = [(level, r, c) for r in range(tall.start, tall.stop, BIN) for c in range(wide.start, wide.stop, BIN)]
        few = len(places) <= _KEPT_BLOCKS // 4
        if not few or any(place not in self._blocks for place in places):
            made = self._joined(level, tall, wide, device)
            if few:
                self._keep(places, made, tall.start, wide.start)
        else:
            made = np.empty((tall.stop - tall.start, wide.stop - wide.start), dtype=np.float32)
            for place in places:
                block = self._blocks[place]
                self._blocks.move_to_end(place)
                r, c = place[1] - tall.start, place[2] - wide.start
                made[r : r + block.shape[0], c : c + block.shape[1]] = block
        return made[rows.start - tall.start : rows.stop - tall.start, cols.start - wide.start : cols.stop - wide.start]

    def _keep(self, places: list[tuple[int, int, int]], made: Grid, top: int, left: int) -> None:
        for place in places:
            r, c = place[1] - top, place[2] - left
            self._blocks[place] = made[r : r + BIN, c : c + BIN].copy()
            self._blocks.move_to_end(place)
        while len(self._blocks) > _KEPT_BLOCKS:
            self._blocks.popitem(last=False)

    def _joined(self, level: int, rows: slice, cols: slice, device: ClDevice | None) -> Grid:
        """Blend and continuation on a window of a level above the anchor."""
        heights, cover = self._blend(level, rows, cols, device)
        if (cover == 1).all():
            return heights
        sweeps = outside.SWEEPS
        n = grid.samples(level)
        tall = slice(max(0, rows.start - sweeps), min(n, rows.stop + sweeps))
        wide = slice(max(0, cols.start - sweeps), min(n, cols.stop + sweeps))
        if (tall, wide) != (rows, cols):
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
        n = grid.samples(level)
        if level <= _KEPT_LEVELS and (rows.start, rows.stop, cols.start, cols.stop) == (0, n, 0, n):
            return self._whole(level, device)
        if level in self._blended:
            kept = self._blended[level]
            return kept.heights[rows, cols], kept.cover[rows, cols]
        return self._fresh(level, rows, cols, device)

    def _whole(self, level: int, device: ClDevice | None) -> tuple[Grid, Grid]:
        """Blended heights and cover of a whole level, kept; from the base before where no changed layer reaches."""
        if level not in self._blended:
            found = self._taken_over(level, device)
            if found is None:
                whole = slice(0, grid.samples(level))
                found = self._fresh(level, whole, whole, device)
            self._blended[level] = Blended(*found)
            for array in found:
                array.setflags(write=False)
        return self._blended[level].heights, self._blended[level].cover

    def _taken_over(self, level: int, device: ClDevice | None) -> tuple[Grid, Grid] | None:
        if self._before is None:
            return None
        model, seam_blend, kept = self._before
        old = kept.pop(level, None)
        if old is None:
            return None
        n = grid.samples(level)
        lattice = blend.Lattice(grid.spacing(level, self.size_m), 0, n, 0, n)
        differ = reuse.changed_bins(self.model, model, self.tolerance(level), lattice)
        hit = np.argwhere(differ | reuse.met_bins(self.seam_blend.changed(seam_blend), lattice))
        if len(hit) == 0:
            return old.heights, old.cover
        (r0, c0), (r1, c1) = hit.min(axis=0) * BIN, np.minimum((hit.max(axis=0) + 1) * BIN, n)
        heights, cover = old.heights.copy(), old.cover.copy()
        rows, cols = slice(int(r0), int(r1)), slice(int(c0), int(c1))
        heights[rows, cols], cover[rows, cols] = self._fresh(level, rows, cols, device)
        return heights, cover

    def _fresh(self, level: int, rows: slice, cols: slice, device: ClDevice | None) -> tuple[Grid, Grid]:
        shape = rows.stop - rows.start, cols.stop - cols.start
        heights, cover = np.empty(shape, dtype=np.float32), np.empty(shape, dtype=np.float32)
        spacing, tolerance = grid.spacing(level, self.size_m), self.tolerance(level)
        device = self._devices.setdefault(level, device)
        for r, c in itertools.product(_chunks(rows), _chunks(cols)):
            lattice = blend.Lattice(spacing, r.start, r.stop, c.start, c.stop)
            chosen = self.index.resolved(spacing, tolerance, lattice.rect())
            packed = blend.pack(self.model, chosen, True, tolerance, self._bent)
            up, across = (
                slice(r.start - rows.start, r.stop - rows.start),
                slice(c.start - cols.start, c.stop - cols.start),
            )
            heights[up, across], cover[up, across] = blend.evaluate(packed, lattice, device)
            self.seam_blend.lay(packed, lattice, heights[up, across])
        # Ground that goes on beyond a grid, or is raised as far as lower ground beside it, might leave the bounds.
        low, high = np.float32(self.low), np.float32(self.high)
        np.clip(heights, np.nextafter(low, high), np.nextafter(high, low), out=heights)
        return heights, cover

    def _beyond(self, points: Floats, device: ClDevice | None) -> Floats:
        """Jets (n, 6) of the continuation at places, by blocks of the level that is twice as fine as the data."""
        finest = math.ceil(math.log2(max(1.0, 2 * grid.spacing(0, self.size_m) / self.spacing_m)))
        level = min(max(finest, outside.ANCHOR), MAX_SYNTHESIS_LEVEL)
        spacing, last = grid.spacing(level, self.size_m), grid.samples(level) - 1
        at = np.clip(points / spacing, 0, last)
        out = np.empty((len(points), 6))
        blocks = at.astype(np.int64) // BIN
        _, which = np.unique(blocks[:, 1] * (last // BIN + 1) + blocks[:, 0], return_inverse=True)
        order = np.argsort(which, kind="stable")
        for part in np.split(order, np.flatnonzero(np.diff(which[order])) + 1):
            col, row = (int(c) * BIN - 3 for c in blocks[part[0]])
            window = self.window(level, slice(row, row + BIN + 7), slice(col, col + BIN + 7), device)
            out[part] = outside.smooth_jets(window, at[part] - (col, row), spacing)
        return out


def _chunks(span: slice) -> list[slice]:
    """Parts of a span that end at multiples of ``_CHUNK``."""
    cuts = [span.start, *range((span.start // _CHUNK + 1) * _CHUNK, span.stop, _CHUNK), span.stop]
    return [slice(a, b) for a, b in itertools.pairwise(cuts)]


def _digest(model: Model, size_m: float, bent: bool) -> bytes:
    """SHA-256 of everything that the ground follows from."""
    lines = sorted(
        repr((p.layer.id, p.layer.content, p.layer.anchor, p.layer.rotation_deg, p.layer.spacing_m, p.layer.scale,
              p.layer.lift_m, p.layer.accuracy_m, p.layer.priority))
        for p in model.placed
    )  # fmt: skip
    bending = [b"bent"] if bent else []
    return hashlib.sha256(
        b"\0".join([_FORMAT, *bending, repr(size_m).encode(), *(line.encode() for line in lines)])
    ).digest()


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
