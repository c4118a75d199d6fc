"""Crest lines packed as the flat tables that the rasteriser reads (DESIGN 5.2, 5.5). NumPy on the host.

The ground is cut into bins of 16 x 16 samples. Per row of bins the tables list the strokes that can reach it; the
rasteriser finds for itself, per bin, the few segments of a stroke that can be nearest. Horizontal lengths are in
cells of the level, heights in metres. Strokes are ordered by id, so no result depends on the order of edits.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from esker import grid
from esker.contract import (
    CREST_STIFFNESS,
    DEFAULT_REACH_FRACTION,
    SPRING_CELLS,
    SPRING_FULL_FRACTION,
    Flank,
    Stroke,
    TerrainSettings,
)
from esker.solve.crest import Crest, crest_of

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

BIN = 16
"""Samples along one side of a bin: one float16 vector wide."""
LANES = 16
"""Segment tables are padded per stroke to a multiple of this with copies of the last segment."""
CREST_HALF_WIDTH = 0.71
"""Samples nearer than this many cells to a crest line are crest: never a gap, at any angle."""
SPRING_FLOOR_CELLS = 8.0
"""A spring is never stiffer than that of a band this wide."""
TOE = 1.3
"""Beyond its end a band still tells the gradient, fading out at this multiple of its width: nothing overshoots."""
EXIT_SHARE = 0.25
"""Where a band ends above the base the gradient leaves as if this share of the height there decayed over the reach:
more, and the ground beyond sinks below the base; less, and a step shows."""
HELD_FRACTION = 0.93
"""Up to this share of a band screening pulls to the profile instead of the base, then fades to the base at its end."""
SOFT_PART = 0.5
"""Share of the crest height that the round part of a concave foot or a convex shoulder takes."""
FLATTEST = 1e-9
"""Slopes below this count as this: the width of a band is height / slope."""

THINNEST_M = 1e-3
"""Bands narrower than this are as wide as this, so that the tip of a stroke is no special case."""

SEGMENT_FIELDS = (
    *("ax", "ay", "az", "dx", "dy", "dz", "il2", "t0x", "t0y", "t1x", "t1y", "cap0", "cap1"),
    *("s0x", "s0y", "s1x", "s1y"),
)
STROKE_FIELDS = ("plateau", "xmin", "xmax", "reach", "lh", "ls", "le", "lk", "lf", "rh", "rs", "re", "rk", "rf")
STROKE_STRIDE = 16
INDEX_FIELDS = ("first", "count", "spans")
INDEX_STRIDE = 4


@dataclass(frozen=True)
class Tables:
    """The constraints of one level, packed.

    segments: (17, m) by SEGMENT_FIELDS. a: start; d: end - start; il2: 1 / plan length^2, or 0 for a point; t0, t1:
      unit directions of travel at the ends; cap: 1 where the line ends there; s0, s1: slope of the crest at the ends
      as a vector, metres a cell, the mean of the two segments that meet (0 at a cap).
    strokes: (k, 16) by STROKE_FIELDS. plateau, xmin, xmax, reach in cells (reach: outermost distance with any
      effect); per side h: 1 if there is a flank, s: slope (tangent), e: extent in metres, k and f: shares of the
      crest height taken by a round shoulder and a round foot.
    index: (k, 4) by INDEX_FIELDS: first segment, number of segments, start in span_index or -1.
    row_start, row_items: strokes by row of bins (CSR). span_index, spans: inside intervals of closed outlines per
      sample row (CSR within the stroke), in cells.
    """

    level: int
    size_m: float
    segments: Floats
    strokes: Floats
    index: Ints
    row_start: Ints
    row_items: Ints
    span_index: Ints
    spans: Floats
    screening: float
    exit_length_m: float
    pinned: bool

    @property
    def samples(self) -> int:
        return grid.samples(self.level)

    @property
    def spacing_m(self) -> float:
        return grid.spacing(self.level, self.size_m)

    @property
    def empty(self) -> bool:
        return len(self.index) == 0


def bins(samples: int) -> int:
    """Bins along one side."""
    return -(-samples // BIN)


def defines() -> dict[str, float | int]:
    """The constants that the OpenCL twin is compiled with."""
    return {
        "BIN": BIN,
        "CREST_HALF_WIDTH": CREST_HALF_WIDTH,
        "SPRING_FLOOR_CELLS": SPRING_FLOOR_CELLS,
        "TOE": TOE,
        "HELD_FRACTION": HELD_FRACTION,
        "EXIT_SHARE": EXIT_SHARE,
        "THINNEST_M": THINNEST_M,
        "STROKE_STRIDE": STROKE_STRIDE,
        "INDEX_STRIDE": INDEX_STRIDE,
        "CREST_STIFFNESS": CREST_STIFFNESS,
        "SPRING_CELLS": SPRING_CELLS,
        "SPRING_FULL_FRACTION": SPRING_FULL_FRACTION,
    }


def pack(strokes: Sequence[Stroke], settings: TerrainSettings, level: int) -> Tables:
    """The tables of a stroke set at one level. The order of ``strokes`` does not matter."""
    return Packer(level).pack(strokes, settings)[0]


@dataclass(frozen=True)
class Window:
    """Bins: of row ``first + j`` the columns spans[j, 0] .. spans[j, 1] - 1. ``spans`` (rows, 2) int32."""

    first: int
    spans: Ints

    @property
    def sample_rows(self) -> tuple[int, int]:
        """Sample rows that the bins cover, half open; may run past the last row."""
        return self.first * BIN, (self.first + len(self.spans)) * BIN

    @property
    def width(self) -> int:
        """Most bins of a row."""
        return int((self.spans[:, 1] - self.spans[:, 0]).max(initial=0))


def everything(samples: int) -> Window:
    """All bins."""
    count = bins(samples)
    return Window(0, np.tile(np.array([0, count], dtype=np.int32), (count, 1)))


class Packer:
    """Packs stroke sets of one level, reusing what did not change since the last one."""

    def __init__(self, level: int) -> None:
        self.level = level
        self._settings: tuple[float, float | None, str] | None = None
        self._packed: dict[str, tuple[Stroke, _Packed | None]] = {}

    def likeness(self, strokes: Sequence[Stroke], settings: TerrainSettings) -> int:
        """How many strokes of this set were in the last one; -1 when nothing of it can be kept."""
        if self._settings != _settings_key(settings):
            return -1
        return sum(1 for s in strokes if s.id in self._packed and self._packed[s.id][0] is s)

    def pack(self, strokes: Sequence[Stroke], settings: TerrainSettings) -> tuple[Tables, Window | None]:
        """The tables, and the bins whose constraints may differ from the last set's (None: no bin does)."""
        s, n = grid.spacing(self.level, settings.size_m), grid.samples(self.level)
        fresh = self._settings != _settings_key(settings)
        old = {} if fresh else self._packed
        new: dict[str, tuple[Stroke, _Packed | None]] = {}
        for stroke in sorted(strokes, key=lambda k: k.id):
            known = old.get(stroke.id)
            if known is not None and (known[0] is stroke or known[0] == stroke):
                new[stroke.id] = (stroke, known[1])
                continue
            crest = crest_of(stroke)
            new[stroke.id] = (stroke, _pack_one(crest, s, n) if crest is not None else None)
        window = everything(n) if fresh else _changed(old, new)
        self._settings, self._packed = _settings_key(settings), new
        reach = settings.reach_m
        tables = Tables(
            level=self.level,
            size_m=settings.size_m,
            screening=0.0 if reach is None else (s / reach) ** 2,
            exit_length_m=min(reach or math.inf, settings.size_m * DEFAULT_REACH_FRACTION),
            pinned=settings.border == "pinned",
            **_join([p for _, p in new.values() if p is not None], n),
        )
        return tables, window

    def forget(self) -> None:
        """Make the next set a fresh one."""
        self._settings, self._packed = None, {}


def _settings_key(settings: TerrainSettings) -> tuple[float, float | None, str]:
    return settings.size_m, settings.reach_m, settings.border


def _changed(
    old: dict[str, tuple[Stroke, _Packed | None]], new: dict[str, tuple[Stroke, _Packed | None]]
) -> Window | None:
    """Bins that strokes only in one of the sets, or different in both, can reach."""
    touched = [
        side[key][1]
        for key in old.keys() | new.keys()
        if key not in old or key not in new or old[key][1] is not new[key][1]
        for side in (old, new)
        if key in side
    ]
    windows = [p.window for p in touched if p is not None]
    if not windows:
        return None
    first, last = min(w.first for w in windows), max(w.first + len(w.spans) for w in windows)
    low = np.full(last - first, 1 << 30, dtype=np.int32)
    high = np.zeros(last - first, dtype=np.int32)
    for w in windows:
        rows = slice(w.first - first, w.first - first + len(w.spans))
        low[rows] = np.minimum(low[rows], w.spans[:, 0])
        high[rows] = np.maximum(high[rows], w.spans[:, 1])
    return Window(first, np.column_stack([np.minimum(low, high), high]))


@dataclass(frozen=True)
class _Packed:
    segments: Floats
    params: list[float]
    window: Window
    span_index: Ints | None
    spans: Floats | None


def _flank(flank: Flank | None) -> tuple[float, float, float, float, float]:
    if flank is None or flank.slope_deg is None or flank.extent_m <= 0:
        return 0.0, 0.0, 0.0, 0.0, 0.0
    slope = max(math.tan(math.radians(flank.slope_deg)), FLATTEST)
    shoulder = SOFT_PART if flank.shape == "convex" else 0.0
    foot = SOFT_PART if flank.shape == "concave" else 0.0
    return 1.0, slope, flank.extent_m, shoulder, foot


def _reach(crest: Crest, s: float) -> float:
    """Outermost distance from the crest with any effect, cells."""
    top = float(np.abs(crest.points[:, 2]).max())
    widest = 0.0
    for side in (crest.stroke.left, crest.stroke.right):
        present, slope, extent, shoulder, foot = _flank(side)
        if present:
            widest = max(widest, min(extent, (1 + shoulder + foot) * top / slope))
    return crest.stroke.plateau_radius_m / s + TOE * max(SPRING_FLOOR_CELLS, widest / s) + 0.01


def _pack_one(crest: Crest, s: float, n: int) -> _Packed | None:
    """One stroke's tables, or None when it cannot reach the domain."""
    points, stroke = crest.points.copy(), crest.stroke
    points[:, :2] /= s
    reach = _reach(crest, s)
    low, high = points[:, :2].min(axis=0) - reach, points[:, :2].max(axis=0) + reach
    if (high < 0).any() or (low > n - 1).any():
        return None
    segments = _segments(points, crest.closed)
    span_index, spans = _spans(points, n) if crest.closed else (None, None)
    near = _near_domain(segments, reach, n)
    if not near.any() and span_index is None:
        return None
    segments = segments[:, near] if near.any() else segments[:, :1]
    pad = -segments.shape[1] % LANES
    params = [stroke.plateau_radius_m / s, low[0], high[0], reach, *_flank(stroke.left), *_flank(stroke.right)]
    window = _window(segments, reach, n, points if crest.closed else None)
    return _Packed(np.pad(segments, ((0, 0), (0, pad)), mode="edge"), params, window, span_index, spans)


def _window(segments: Floats, reach: float, n: int, inside: Floats | None) -> Window:
    """The bins that segments with this reach can touch, row by row; those of ``inside`` (an outline) besides."""
    count = bins(n)
    a, b = segments[:2], segments[:2] + segments[3:5]
    low, high = np.minimum(a, b) - reach, np.maximum(a, b) + reach
    if inside is not None:
        low = np.column_stack([low, inside[:, :2].min(axis=0)])
        high = np.column_stack([high, inside[:, :2].max(axis=0)])
    low, high = np.floor(low / BIN), np.ceil(high / BIN)
    first, last = int(max(0, low[1].min())), int(min(count, high[1].max() + 1))
    row = np.arange(first, max(last, first + 1))[:, None]
    meets = (low[1] <= row) & (row <= high[1])
    left = np.where(meets, low[0], count).min(axis=1)
    right = np.where(meets, high[0] + 1, 0).max(axis=1)
    spans = np.clip(np.column_stack([left, np.maximum(left, right)]), 0, count)
    return Window(first, spans.astype(np.int32))


def _segments(points: Floats, closed: bool) -> Floats:
    """SEGMENT_FIELDS of a polyline in cells, shape (17, segments); a single point is one segment of no length."""
    if len(points) == 1:
        out = np.zeros((len(SEGMENT_FIELDS), 1))
        out[:3, 0] = points[0]
        out[7], out[9], out[11], out[12] = 1.0, 1.0, 1.0, 1.0
        return out
    ring = np.vstack([points, points[:1]]) if closed else points
    d = np.diff(ring, axis=0)
    length2 = d[:, 0] ** 2 + d[:, 1] ** 2
    unit = d[:, :2] / np.sqrt(length2)[:, None]
    joint = unit[:-1] + unit[1:]
    wrap = unit[-1] + unit[0] if closed else unit[0]
    before = np.vstack([wrap, joint])
    after = np.vstack([joint, wrap if closed else unit[-1]])
    before, after = _unit_or(before, unit), _unit_or(after, unit)
    caps = np.zeros((2, len(d)))
    slope = d[:, :2] * (d[:, 2] / length2)[:, None]
    mean = (slope[:-1] + slope[1:]) / 2
    turn = (slope[-1] + slope[0]) / 2 if closed else np.zeros(2)
    if not closed:
        caps[0, 0] = caps[1, -1] = 1.0
    slopes = np.vstack([turn, mean]), np.vstack([mean, turn])
    return np.vstack([ring[:-1].T, d.T, 1 / length2, before.T, after.T, caps, slopes[0].T, slopes[1].T])


def _unit_or(v: Floats, fallback: Floats) -> Floats:
    """Rows of ``v`` made unit length; rows that vanish (a fold) take the fallback."""
    length = np.hypot(v[:, 0], v[:, 1])[:, None]
    return np.where(length > 1e-6, v / np.maximum(length, 1e-30), fallback)


def _near_domain(segments: Floats, reach: float, n: int) -> NDArray[np.bool_]:
    """Segments whose reach touches the domain: the others cannot be the nearest of any sample within reach."""
    out = np.ones(segments.shape[1], dtype=bool)
    for axis in (0, 1):
        a, b = segments[axis], segments[axis] + segments[axis + 3]
        out &= (np.maximum(a, b) + reach >= 0) & (np.minimum(a, b) - reach <= n - 1)
    return out


def _spans(points: Floats, n: int) -> tuple[Ints, Floats]:
    """Inside of a closed outline by non-zero winding: per sample row a list of intervals [x0, x1], cells.

    Returns CSR: index (n + 1), spans (m, 2). A loop drawn twice, or an eight, is inside everywhere it encloses.
    """
    ring = np.vstack([points[:, :2], points[:1, :2]])
    index, out = np.zeros(n + 1, dtype=np.int32), []
    y0, y1 = ring[:-1, 1], ring[1:, 1]
    first = max(0, math.ceil(min(y0.min(), y1.min())))
    last = min(n - 1, math.floor(max(y0.max(), y1.max())))
    for row in range(first, last + 1):
        cut = (y0 <= row) != (y1 <= row)
        x = ring[:-1, 0][cut] + (row - y0[cut]) / (y1 - y0)[cut] * (ring[1:, 0] - ring[:-1, 0])[cut]
        order = np.argsort(x, kind="stable")
        winding = np.cumsum(np.where(y1[cut] > y0[cut], 1, -1)[order])
        x = x[order]
        pairs = [(x[k], x[k + 1]) for k in range(len(x) - 1) if winding[k]]
        out += pairs
        index[row + 1] = len(pairs)
    return np.cumsum(index, dtype=np.int32), np.array(out).reshape(-1, 2)


@dataclass
class _Cursor:
    segment: int = 0
    index: int = 0
    span: int = 0


def _join(packed: list[_Packed], n: int) -> dict[str, Any]:
    """All strokes' tables behind each other, with the lists by row of bins."""
    at = _Cursor()
    rows: list[list[int]] = [[] for _ in range(bins(n))]
    params = np.zeros((len(packed), STROKE_STRIDE))
    index = np.zeros((len(packed), INDEX_STRIDE), dtype=np.int32)
    span_indices, spans = [], []
    for k, p in enumerate(packed):
        params[k, : len(p.params)] = p.params
        index[k, :3] = at.segment, p.segments.shape[1], -1
        at.segment += p.segments.shape[1]
        if p.span_index is not None and p.spans is not None:
            index[k, 2] = at.index
            span_indices.append(p.span_index + at.span)
            spans.append(p.spans)
            at.index += len(p.span_index)
            at.span += len(p.spans)
        for row in range(p.window.first, p.window.first + len(p.window.spans)):
            rows[row].append(k)
    return {
        "segments": np.hstack([p.segments for p in packed]) if packed else np.zeros((len(SEGMENT_FIELDS), 0)),
        "strokes": params,
        "index": index,
        "row_start": np.cumsum([0, *map(len, rows)]).astype(np.int32),
        "row_items": np.array([k for row in rows for k in row], dtype=np.int32),
        "span_index": np.concatenate(span_indices).astype(np.int32) if span_indices else np.zeros(0, dtype=np.int32),
        "spans": np.vstack(spans) if spans else np.zeros((0, 2)),
    }
