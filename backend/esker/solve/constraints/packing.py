"""From one crest line to its part of the rasteriser's tables (see ``tables``). NumPy float64 on the host."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from esker.contract import Flank, Stroke, TerrainSettings
from esker.solve.base import FLAT, Base, BaseUnderStroke, ground_under, under
from esker.solve.constraints.channel_targets import Layer, target
from esker.solve.constraints.crest import Crest, crest_of, line_of
from esker.solve.constraints.outline import cut, segments_of, spans_of
from esker.solve.constraints.silhouette import Silhouette, silhouette
from esker.solve.constraints.tables import (
    BIN,
    CHANNEL_FLOOR_CELLS,
    COURSE_SAY,
    CREST_HALF_WIDTH,
    EDGE_CELLS,
    FLATTEST,
    HALF_DIAGONAL,
    INDEX_AT,
    INDEX_STRIDE,
    ITEM_STRIDE,
    KNOT_FIELDS,
    LANES,
    PAIRS_EDITION,
    SEGMENT_FIELDS,
    SKIRT_SAY,
    SKIRT_SLOPE,
    SKIRT_YIELDS,
    SOFT_PART,
    SPRING_FLOOR_CELLS,
    STOPS,
    STROKE_AT,
    STROKE_STRIDE,
    THINNEST_M,
    TOE,
    YIELDING_SAY,
    BinBox,
    Floats,
    Ints,
    Singles,
    Window,
)

SLACK = 0.05
"""Cells by which windows are wider than what is felt: the kernels compute distances in float32."""


@dataclass(frozen=True)
class Side:
    """One flank as numbers: slope (tangent), extent (metres), share of the height in a shoulder and in a foot."""

    slope: float
    extent: float
    shoulder: float
    foot: float


@dataclass(frozen=True)
class Shape:
    """A crest and its band, in metres. The tables of any level and window are made from it.

    cliff: 1 / reach of the terrain, 0 for endless; silhouette: of a profile, None of an outline. For another channel
    than the heights, value: what the stroke asks of it, as a difference from its base; brush_m: radius of paint.
    ground: what is known of the base under it; edition: of the terrain's rules.
    """

    crest: Crest
    left: Side | None
    right: Side | None
    cliff: float
    silhouette: Silhouette | None
    value: float = 0.0
    brush_m: float | None = None
    ground: BaseUnderStroke = FLAT
    edition: int = 1

    def brush(self, s: float) -> float:
        """Radius of paint in cells, 0 for a crest."""
        return 0.0 if self.brush_m is None else max(self.brush_m / s, CHANNEL_FLOOR_CELLS)

    def widths(self, tops: Floats) -> tuple[Floats, Floats]:
        """Widest band and, where its extent cuts it high, widest skirt, for these crest heights; metres."""
        sides = [side for side in (self.left, self.right) if side is not None]
        wide, skirt = np.zeros(len(tops)), np.zeros(len(tops))
        for side in sides:
            round_part = 1 + side.shoulder + side.foot
            wide = np.maximum(wide, np.minimum(side.extent, round_part * tops / side.slope))
        if sides and self.cliff > 0:
            slope, extent = min(s.slope for s in sides), min(s.extent for s in sides)
            round_part = max(1 + s.shoulder + s.foot for s in sides)
            cut_at = np.minimum(np.maximum(round_part * tops - slope * extent, 0.0), tops)
            need = np.minimum(np.maximum(cut_at * self.cliff / SKIRT_SLOPE - 0.5, 0.0), 1.0)
            skirt = need * need * (3 - 2 * need) * 2 * cut_at / SKIRT_SLOPE
        return wide, skirt

    def reach(self, tops: Floats, s: float) -> Floats:
        """Outermost distance with any effect, cells, for these crest heights."""
        if self.brush_m is not None:
            return np.full(len(tops), self.brush(s) + 0.01)
        wide, skirt = self.widths(tops)
        wide = np.maximum(wide / s, SPRING_FLOOR_CELLS)
        felt = np.maximum(np.maximum(TOE * wide, wide + skirt / s), max(_banks(self.crest.stroke)) / s)
        return self.crest.stroke.plateau_radius_m / s + felt + 0.01


@dataclass(frozen=True)
class Packed:
    """One stroke's part of the tables. window: the bins that it can reach, within the box it was packed for.

    segments of an outline; knots, pieces, where each octave's piece 0 is among them, and the length of a piece of the
    first octave in cells, and how many pieces of each are left out at the beginning, of a profile.
    """

    params: Floats
    window: Window
    segments: Floats | None = None
    knots: Floats | None = None
    pieces: Floats | None = None
    octaves: tuple[int, ...] = ()
    octave_cells: float = 1.0
    culled: tuple[int, ...] = ()
    span_index: Ints | None = None
    spans: Floats | None = None

    def octave(self, o: int) -> Floats:
        """The pieces (m, 4) of octave ``o`` of a profile, from piece ``culled[o]`` on."""
        assert self.pieces is not None
        ends = [start + k for start, k in zip(self.octaves, self.culled, strict=True)] + [len(self.pieces)]
        return self.pieces[ends[o] : ends[o + 1]]


def shape_for(layer: Layer | None, stroke: Stroke, settings: TerrainSettings, base: Base | None = None) -> Shape | None:
    """A stroke ready to be packed into the tables of a layer (None: the heights); None when it asks nothing of it."""
    value = 0.0 if layer is None else target(stroke, layer, settings)
    if value is None:
        return None
    if layer is not None and stroke.paint is not None:
        line = line_of(stroke)
        return None if line is None else Shape(line, None, None, 0.0, None, value, stroke.paint.radius_m)
    crest = crest_of(stroke) if base is None else crest_of(stroke, partial(under, base, settings.size_m))
    if crest is None:
        return None
    ground = ground_under(base, crest.points, stroke.plateau_radius_m, crest.closed, settings.size_m)
    return replace(shape_of(crest, settings, ground), value=value)


def shape_of(crest: Crest, settings: TerrainSettings, ground: BaseUnderStroke = FLAT) -> Shape:
    """A crest ready to be packed for any level."""
    stroke = crest.stroke
    left, right = _side(stroke.left), _side(stroke.right)
    cliff = 0.0 if settings.reach_m is None else 1 / settings.reach_m
    shape = Shape(crest, left, right, cliff, None, ground=ground, edition=settings.edition)
    if stroke.kind != "profile":
        return shape
    top = ground.tops(crest.points[:, 2]).max()
    wide, skirt = (float(w[0]) for w in shape.widths(np.array([top])))
    line = silhouette(crest, settings.size_m, TOE * wide + skirt, ground.datum, settings.edition)
    return replace(shape, silhouette=line)


def reach_m(shape: Shape, s: float) -> float:
    """Outermost distance of a stroke with any effect at spacing ``s``, metres."""
    return float(shape.reach(shape.ground.tops(shape.crest.points[:, 2]), s).max()) * s


def pack_one(shape: Shape, s: float, box: BinBox) -> Packed | None:
    """One stroke's part of the tables of a box of bins at spacing ``s``, or None when it cannot reach the box."""
    by0, by1, bx0, bx1 = box
    low, high = np.array([bx0, by0]) * BIN, np.array([bx1, by1]) * BIN - 1
    return (_pack_profile if shape.silhouette is not None else _pack_outline)(shape, s, box, low, high)


def _pack_profile(shape: Shape, s: float, box: BinBox, low: Ints, high: Ints) -> Packed | None:
    line = shape.silhouette
    assert line is not None
    edges, tops = line.blocks
    reach = shape.reach(tops + shape.ground.half, s)
    ends = (line.start + edges[:, None] * line.unit) / s
    a, b = ends[:-1].T, ends[1:].T
    window = window_of(np.minimum(a, b), np.maximum(a, b), reach, box)
    if window is None:
        return None
    ux, uy = line.unit.tolist()
    x0, y0, x1, y1 = (float(v) * s - o for v, o in zip((*low, *high), (*line.start, *line.start), strict=True))
    least, most = min(ux * x0, ux * x1) + min(uy * y0, uy * y1), max(ux * x0, ux * x1) + max(uy * y0, uy * y1)
    first, last = (min(max(v, 0.0), line.length) + e for v, e in ((least, -s), (most, s)))
    j0 = max(0, int(line.t.searchsorted(first, side="right")) - 2)
    j1 = min(len(line.t), int(line.t.searchsorted(last)) + 2)
    t, z = line.t / s, line.z
    slope = np.zeros(len(t))
    steps = np.diff(t.astype(np.float32)).astype(np.float64)  # as kernels see the knots: a wall ends where it should
    np.divide(np.diff(z), steps, out=slope[:-1], where=steps > 0)
    if line.edition > 1 and len(t) > 1:
        slope[-1] = slope[-2]  # as at the first end
    octaves, culled, parts, at = [], [], [], 0
    for o, pieces in enumerate(line.pieces):
        step = line.octave_m * 2**o
        k0 = max(line.firsts[o], math.floor((first - line.middle) / step) - 1)
        part = pieces[k0 - line.firsts[o] : max(math.floor((last - line.middle) / step) + 3 - line.firsts[o], 0)]
        octaves.append(at - k0)
        culled.append(k0)
        parts.append(part)
        at += len(part)
    params = _params(shape, s, float(reach.max()))
    at_crest = STROKE_AT["ax"]
    params[at_crest : at_crest + 5] = (*line.start / s, *line.unit, t[-1])
    params[STROKE_AT["middle"]], params[STROKE_AT["stop"]] = line.middle / s, STOPS[line.edition]
    knots = np.array([t, z, slope])[:, j0:j1]
    return Packed(
        params,
        window,
        None,
        knots,
        np.concatenate([np.zeros((0, 4)), *parts]),
        tuple(octaves),
        line.octave_m / s,
        tuple(culled),
    )


def _pack_outline(shape: Shape, s: float, box: BinBox, low: Ints, high: Ints) -> Packed | None:
    points, closed = shape.crest.points[:, :2] / s, shape.crest.closed
    heights = shape.crest.points[:, 2]
    reach = float(shape.reach(shape.ground.tops(heights), s).max())
    if (points.min(axis=0) - reach > high).any() or (points.max(axis=0) + reach < low).any():
        return None
    line = np.column_stack([points, heights])
    segments = segments_of(cut(np.vstack([line, line[:1]]) if closed else line), closed)
    span_index, spans = spans_of(points, box[0] * BIN, box[1] * BIN) if closed else (None, None)
    ends = segments[:2], segments[:2] + segments[2:4]
    near = _near_box(*ends, reach + HALF_DIAGONAL + 1, low, high)
    if not near.any() and (spans is None or len(spans) == 0):
        return None
    segments = segments[:, near] if near.any() else segments[:, :1]
    from_, to = np.minimum(*ends)[:, near], np.maximum(*ends)[:, near]
    felt = np.full(from_.shape[1], reach)
    if closed:
        from_ = np.column_stack([from_, points.min(axis=0)])
        to = np.column_stack([to, points.max(axis=0)])
        felt = np.append(felt, 0.0)
    window = window_of(from_, to, felt, box)
    if window is None:
        return None
    params = _params(shape, s, reach)
    params[STROKE_AT["height"]], params[STROKE_AT["stop"]] = heights[0], 1 / EDGE_CELLS
    padded = np.pad(segments, ((0, 0), (0, -segments.shape[1] % LANES)), mode="edge")
    return Packed(params, window, padded, span_index=span_index, spans=spans)


def _side(flank: Flank | None) -> Side | None:
    if flank is None or flank.slope_deg is None or flank.extent_m <= 0:
        return None
    slope = max(math.tan(math.radians(flank.slope_deg)), FLATTEST)
    shoulder = SOFT_PART if flank.shape == "convex" else 0.0
    foot = SOFT_PART if flank.shape == "concave" else 0.0
    return Side(slope, max(flank.extent_m, THINNEST_M), shoulder, foot)


def _params(shape: Shape, s: float, reach: float) -> Floats:
    """STROKE_FIELDS of a stroke, but for where its crest is."""
    out, stroke = np.zeros(STROKE_STRIDE), shape.crest.stroke
    values = {
        "plateau": stroke.plateau_radius_m / s,
        "reach": reach,
        "same": float(shape.left == shape.right),
        "run": 1.0,
        "fill": shape.ground.fill,
        "cut": shape.ground.cut,
        "say": YIELDING_SAY**stroke.yields * (COURSE_SAY if stroke.kind == "course" else 1.0),
        "skirt": _skirt(stroke, shape.edition),
    }
    values |= dict(zip(("lb", "rb"), (width / s for width in _banks(stroke)), strict=True))
    plateau = float(np.float32(values["plateau"]))
    values |= {"plateau2": plateau**2, "crest2": (plateau + CREST_HALF_WIDTH) ** 2}
    values |= {"value": shape.value, "brush": shape.brush(s)}
    for letter, side in (("l", shape.left), ("r", shape.right)):
        if side is None:
            values[f"{letter}s"] = 1.0
        else:
            numbers = (1.0, side.slope, side.extent, side.shoulder, side.foot)
            values |= {letter + name: value for name, value in zip("hsekf", numbers, strict=True)}
    if shape.right is not None:
        values["run"] = 1 / shape.right.slope
    for name, value in values.items():
        out[STROKE_AT[name]] = value
    return out


def _banks(stroke: Stroke) -> tuple[float, float]:
    """Widths of a course's banks left and right, metres: flanks without a slope, within which the diffusion decides."""
    if stroke.kind != "course":
        return 0.0, 0.0
    left, right = (
        side.extent_m if side is not None and side.slope_deg is None else 0.0 for side in (stroke.left, stroke.right)
    )
    return left, right


def _skirt(stroke: Stroke, edition: int) -> float:
    """How much more weight a stroke's skirt has than in the first edition."""
    if edition < PAIRS_EDITION:
        return 1.0
    return float(SKIRT_SAY * YIELDING_SAY ** ((SKIRT_YIELDS - 1) * stroke.yields))


def window_of(low: Floats, high: Floats, reach: Floats | float, box: BinBox) -> Window | None:
    """The bins of a box of which a sample may be within ``reach`` (one, or one each) of rectangles (2, m) low .. high,
    all in cells, row by row; None of none. Corners are round, as what a crest reaches is."""
    by0, by1, bx0, bx1 = box
    reach = reach + SLACK
    ends = (low[1] - reach).min() / BIN, (high[1] + reach).max() / BIN + 1
    first, last = (min(max(math.floor(v), by0), by1) for v in ends)
    south = np.arange(first, last)[:, None] * float(BIN)
    away = np.maximum(np.maximum(low[1] - (south + BIN - 1), south - high[1]), 0.0)
    square = reach * reach - away * away
    meets, half = square >= 0, np.sqrt(np.maximum(square, 0.0))
    left = np.where(meets, np.ceil((low[0] - half - (BIN - 1)) / BIN), bx1).min(axis=1, initial=bx1)
    right = np.where(meets, np.floor((high[0] + half) / BIN) + 1, bx0).max(axis=1, initial=bx0)
    spans = np.array([left, np.maximum(left, right)]).T
    spans = np.minimum(np.maximum(spans, bx0), bx1).astype(np.int32)
    return Window(first, spans) if (spans[:, 1] > spans[:, 0]).any() else None


def _near_box(a: Floats, b: Floats, margin: float, low: Ints, high: Ints) -> NDArray[np.bool_]:
    """Segments a .. b that come within ``margin`` of a box, cells. With the reach and half a bin's diagonal as margin
    the others are no candidates of any bin of the box: so what a bin gets does not depend on its window."""
    least, most = np.minimum(a, b) - margin, np.maximum(a, b) + margin
    return np.asarray(((most >= low[:, None]) & (least <= high[:, None])).all(axis=0))


def _stack(parts: list[Any], rows: int) -> Singles:
    return np.hstack(parts).astype(np.float32) if parts else np.zeros((rows, 0), dtype=np.float32)


def join(packed: list[Packed], box: BinBox) -> dict[str, Any]:
    """All strokes' tables behind each other, with the lists by row of bins."""
    index = np.zeros((len(packed), INDEX_STRIDE), dtype=np.int32)
    at = dict.fromkeys(("segment", "knot", "piece", "octave", "index", "span"), 0)
    octaves: list[int] = []
    span_indices, spans = [], []
    for k, p in enumerate(packed):
        outline = p.segments is not None
        table = p.segments if p.segments is not None else p.knots
        assert table is not None
        kind = "segment" if outline else "knot"
        index[k, :] = at[kind], table.shape[1], -1, len(octaves), -1 if outline else len(p.octaves)
        at[kind] += table.shape[1]
        octaves += [at["piece"] + start for start in p.octaves]
        at["piece"] += 0 if p.pieces is None else len(p.pieces)
        if p.span_index is not None and p.spans is not None:
            index[k, INDEX_AT["spans"]] = at["index"]
            span_indices.append(p.span_index + at["span"])
            spans.append(p.spans)
            at["index"] += len(p.span_index)
            at["span"] += len(p.spans)
    row_start, row_items = _rows(packed, box)
    return {
        "segments": _stack([p.segments for p in packed if p.segments is not None], len(SEGMENT_FIELDS)),
        "knots": _stack([p.knots for p in packed if p.knots is not None], len(KNOT_FIELDS)),
        "pieces": _stack([p.pieces.T for p in packed if p.pieces is not None], 4).T,
        "octaves": np.array(octaves, dtype=np.int32),
        "strokes": np.array([p.params for p in packed], dtype=np.float32).reshape(-1, STROKE_STRIDE),
        "index": index,
        "row_start": row_start,
        "row_items": row_items,
        "span_index": np.concatenate(span_indices).astype(np.int32) if span_indices else np.zeros(0, dtype=np.int32),
        "spans": np.vstack(spans or [np.zeros((0, 2))]).astype(np.float32),
    }


def _rows(packed: list[Packed], box: BinBox) -> tuple[Ints, Ints]:
    """row_start and row_items of ``Tables``; strokes keep their order within a row."""
    count = box[1] - box[0]
    if not packed:
        return np.zeros(count + 1, dtype=np.int32), np.zeros((0, ITEM_STRIDE), dtype=np.int32)
    spans = np.concatenate([p.window.spans for p in packed])
    lengths = np.array([len(p.window.spans) for p in packed])
    starts = np.array([p.window.first for p in packed]) - box[0] - (np.cumsum(lengths) - lengths)
    rows = np.arange(len(spans)) + np.repeat(starts, lengths)
    used = np.flatnonzero(spans[:, 1] > spans[:, 0])
    used = used[np.argsort(rows[used], kind="stable")]
    items = np.empty((len(used), ITEM_STRIDE), dtype=np.int32)
    items[:, 0] = np.repeat(np.arange(len(packed)), lengths)[used]
    items[:, 1:] = spans[used]
    return np.concatenate([[0], np.cumsum(np.bincount(rows[used], minlength=count))]).astype(np.int32), items
