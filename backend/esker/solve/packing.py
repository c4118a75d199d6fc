"""From one crest line to its part of the rasteriser's tables (see ``tables``). NumPy float64 on the host."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from esker.contract import Flank
from esker.solve.crest import Crest
from esker.solve.tables import (
    BIN,
    FLATTEST,
    HALF_DIAGONAL,
    INDEX_STRIDE,
    LANES,
    LONGEST_CELLS,
    SEGMENT_FIELDS,
    SOFT_PART,
    SPRING_FLOOR_CELLS,
    STROKE_STRIDE,
    TOE,
    BinBox,
    Floats,
    Ints,
    Window,
)


@dataclass(frozen=True)
class Packed:
    """One stroke's part of the tables. window: the bins that it can reach, within the box it was packed for."""

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


def reach_of(crest: Crest, s: float) -> float:
    """Outermost distance from the crest with any effect, cells."""
    top = float(np.abs(crest.points[:, 2]).max())
    widest = 0.0
    for side in (crest.stroke.left, crest.stroke.right):
        present, slope, extent, shoulder, foot = _flank(side)
        if present:
            widest = max(widest, min(extent, (1 + shoulder + foot) * top / slope))
    return crest.stroke.plateau_radius_m / s + TOE * max(SPRING_FLOOR_CELLS, widest / s) + 0.01


def pack_one(crest: Crest, s: float, box: BinBox) -> Packed | None:
    """One stroke's part of the tables of a box of bins at spacing ``s``, or None when it cannot reach the box."""
    points, stroke = crest.points.copy(), crest.stroke
    points[:, :2] /= s
    reach = reach_of(crest, s)
    by0, by1, bx0, bx1 = box
    corner, far = np.array([bx0, by0]) * BIN, np.array([bx1, by1]) * BIN - 1
    low, high = points[:, :2].min(axis=0) - reach, points[:, :2].max(axis=0) + reach
    if (high < corner).any() or (low > far).any():
        return None
    segments = _segments(points, crest.closed)
    span_index, spans = _spans(points, by0 * BIN, by1 * BIN) if crest.closed else (None, None)
    near = _near_box(segments, reach + HALF_DIAGONAL + 1, corner, far)
    if not near.any() and (spans is None or len(spans) == 0):
        return None
    segments = segments[:, near] if near.any() else segments[:, :1]
    pad = -segments.shape[1] % LANES
    params = [stroke.plateau_radius_m / s, low[0], high[0], reach, *_flank(stroke.left), *_flank(stroke.right)]
    window = _window(segments, reach, box, points if crest.closed else None)
    return Packed(np.pad(segments, ((0, 0), (0, pad)), mode="edge"), params, window, span_index, spans)


def _window(segments: Floats, reach: float, box: BinBox, inside: Floats | None) -> Window:
    """The bins of a box that segments with this reach can touch, by row; those of ``inside`` (an outline) besides."""
    by0, by1, bx0, bx1 = box
    a, b = segments[:2], segments[:2] + segments[3:5]
    low, high = np.minimum(a, b) - reach, np.maximum(a, b) + reach
    if inside is not None:
        low = np.column_stack([low, inside[:, :2].min(axis=0)])
        high = np.column_stack([high, inside[:, :2].max(axis=0)])
    low, high = np.floor(low / BIN), np.ceil(high / BIN)
    first, last = int(np.clip(low[1].min(), by0, by1)), int(np.clip(high[1].max() + 1, by0, by1))
    row = np.arange(first, last)[:, None]
    meets = (low[1] <= row) & (row <= high[1])
    left = np.where(meets, low[0], bx1).min(axis=1, initial=bx1)
    right = np.where(meets, high[0] + 1, bx0).max(axis=1, initial=bx0)
    spans = np.clip(np.column_stack([left, np.maximum(left, right)]), bx0, bx1)
    return Window(first, spans.astype(np.int32))


def _segments(points: Floats, closed: bool) -> Floats:
    """SEGMENT_FIELDS of a polyline in cells, shape (17, segments); a single point is one segment of no length."""
    if len(points) == 1:
        out = np.zeros((len(SEGMENT_FIELDS), 1))
        out[:3, 0] = points[0]
        out[7], out[9], out[11], out[12] = 1.0, 1.0, 1.0, 1.0
        return out
    ring = _cut(np.vstack([points, points[:1]]) if closed else points)
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


def _cut(line: Floats) -> Floats:
    """A polyline (n, 3) whose segments are at most LONGEST_CELLS long in plan."""
    parts = np.ceil(np.hypot(*np.diff(line[:, :2], axis=0).T) / LONGEST_CELLS).astype(int)
    if (parts <= 1).all():
        return line
    knots = np.concatenate([k + np.arange(m) / m for k, m in enumerate(np.maximum(parts, 1))] + [[len(line) - 1.0]])
    return np.column_stack([np.interp(knots, np.arange(len(line)), line[:, axis]) for axis in range(3)])


def _unit_or(v: Floats, fallback: Floats) -> Floats:
    """Rows of ``v`` made unit length; rows that vanish (a fold) take the fallback."""
    length = np.hypot(v[:, 0], v[:, 1])[:, None]
    return np.where(length > 1e-6, v / np.maximum(length, 1e-30), fallback)


def _near_box(segments: Floats, margin: float, low: Floats, high: Floats) -> NDArray[np.bool_]:
    """Segments that come within ``margin`` of a box, cells. With the reach and half a bin's diagonal as margin the
    others are no candidates of any bin of the box: so what a bin gets does not depend on the window that it is in."""
    out = np.ones(segments.shape[1], dtype=bool)
    for axis in (0, 1):
        a, b = segments[axis], segments[axis] + segments[axis + 3]
        out &= (np.maximum(a, b) + margin >= low[axis]) & (np.minimum(a, b) - margin <= high[axis])
    return out


def _spans(points: Floats, row0: int, row1: int) -> tuple[Ints, Floats]:
    """Inside of a closed outline by non-zero winding: per sample row of row0 .. row1 - 1 intervals [x0, x1], cells.

    Returns CSR: index (row1 - row0 + 1), spans (m, 2). A loop drawn twice, or an eight, is inside all that it encloses.
    """
    ring = np.vstack([points[:, :2], points[:1, :2]])
    index, out = np.zeros(row1 - row0 + 1, dtype=np.int32), []
    y0, y1 = ring[:-1, 1], ring[1:, 1]
    first = max(row0, math.ceil(min(y0.min(), y1.min())))
    last = min(row1 - 1, math.floor(max(y0.max(), y1.max())))
    for row in range(first, last + 1):
        cut = (y0 <= row) != (y1 <= row)
        x = ring[:-1, 0][cut] + (row - y0[cut]) / (y1 - y0)[cut] * (ring[1:, 0] - ring[:-1, 0])[cut]
        order = np.argsort(x, kind="stable")
        winding = np.cumsum(np.where(y1[cut] > y0[cut], 1, -1)[order])
        x = x[order]
        pairs = [(x[k], x[k + 1]) for k in range(len(x) - 1) if winding[k]]
        out += pairs
        index[row - row0 + 1] = len(pairs)
    return np.cumsum(index, dtype=np.int32), np.array(out).reshape(-1, 2)


@dataclass
class _Cursor:
    segment: int = 0
    index: int = 0
    span: int = 0


def join(packed: list[Packed], box: BinBox) -> dict[str, Any]:
    """All strokes' tables behind each other, with the lists by row of bins."""
    at = _Cursor()
    rows: list[list[int]] = [[] for _ in range(box[1] - box[0])]
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
            rows[row - box[0]].append(k)
    return {
        "segments": np.hstack([p.segments for p in packed]) if packed else np.zeros((len(SEGMENT_FIELDS), 0)),
        "strokes": params,
        "index": index,
        "row_start": np.cumsum([0, *map(len, rows)]).astype(np.int32),
        "row_items": np.array([k for row in rows for k in row], dtype=np.int32),
        "span_index": np.concatenate(span_indices).astype(np.int32) if span_indices else np.zeros(0, dtype=np.int32),
        "spans": np.vstack(spans) if spans else np.zeros((0, 2)),
    }
