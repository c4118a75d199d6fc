"""NumPy float64 twin of shaders/opencl/raster.cl: constraints from packed tables (DESIGN 5.2, 5.4, 5.5)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from esker.contract import CREST_STIFFNESS
from esker.solve.constraints.float32 import fused, rounded
from esker.solve.constraints.section_reference import (
    LEAST,
    TINY,
    Band,
    Nearest,
    brush_section,
    channel_section,
    cross_section,
    sides,
    square_of,
    straight,
)
from esker.solve.constraints.tables import (
    AGREEMENT,
    AGREEMENT_NOISE,
    BIN,
    HALF_DIAGONAL,
    INDEX_AT,
    OVERLAP_STIFFENING,
    OVERLAP_STIFFEST,
    PAIRS_EDITION,
    PINNED,
    STROKE_AT,
    Tables,
)

Floats = NDArray[np.float64]
Places = tuple[NDArray[np.int64], NDArray[np.int64]]

HARD = -1.0
"""Stiffness that marks a sample as fixed, on a crest; on a pinned border it is ``tables.PINNED``."""
_SUMS = ("w", "wt", "wtt", "wa", "fade", "held", "g", "gx", "gy", "toe", "hard", "follows", "joint", "quiet")


@dataclass(frozen=True)
class Constraints:
    """Constraints of the strokes in a box of a level (all of it or a window).

    Every array float64, (rows, columns) or (2, rows, columns), row 0 south. height_d: spring stiffness, HARD where
    fixed. height_f: stiffness times target (plus what the screening must give back), or the fixed height. gradient_d:
    stiffness for both gradient components. gradient_f: stiffness times target (d/dx, d/dy), metres per metre. share:
    how far the gradient is that of the ground, base included; target: heights above the base that are wanted, 0 where
    none are (``reference.over_base``).
    """

    height_d: Floats
    height_f: Floats
    gradient_d: Floats
    gradient_f: Floats
    share: Floats
    target: Floats


def rasterise(tables: Tables, base: NDArray[np.floating] | None = None) -> Constraints:
    """The constraints of the samples of the tables' box, shape ``tables.shape``; ``base``: the base there, metres."""
    total = _sums(tables)
    for k, at, near, inside in _strokes(tables, base):
        band = cross_section(near, inside, tables.strokes[k].astype(np.float64), tables)
        _add(total, at, band, in_pairs=tables.edition >= PAIRS_EDITION)
    rows, columns = tables.shape
    total = {name: a[:rows, :columns] for name, a in total.items()}
    w = np.maximum(total["w"], LEAST)
    target, square = total["wt"] / w, total["wtt"] / w
    if tables.edition >= PAIRS_EDITION:
        share = total["joint"] / (total["joint"] + AGREEMENT * w)
        quarrel = square / (square + AGREEMENT * (square + target**2) + TINY) * share
    else:
        apart = np.maximum(square * (1 - AGREEMENT_NOISE) - target**2, 0.0)
        quarrel = apart / (apart + AGREEMENT * square + TINY)
    stiffness = total["wa"] / w
    stiffer = np.minimum(OVERLAP_STIFFENING * stiffness, OVERLAP_STIFFEST) * quarrel**2
    stiffness = (stiffness + stiffer) * total["fade"] * (1 - total["quiet"])
    hard = total["hard"] > 0
    height_d = np.where(hard, HARD, stiffness)
    height_f = np.where(hard, target, (stiffness + tables.screening * total["held"]) * target)
    if tables.pinned:
        y, x = (o + np.arange(count) for o, count in zip(tables.origin, tables.shape, strict=True))
        edge = ((y == 0) | (y == tables.samples - 1))[:, None] | (x == 0) | (x == tables.samples - 1)
        height_d, height_f = np.where(edge, PINNED, height_d), np.where(edge, 0.0, height_f)
    share = total["toe"] * total["follows"] / np.maximum(total["g"], LEAST)
    return Constraints(height_d, height_f, *_two(total, tables), share, target)


def rasterise_channel(tables: Tables, base: NDArray[np.floating] | None = None) -> tuple[Floats, Floats, Floats]:
    """Targets of the strokes for the tables' channel, as a difference from its base (DESIGN 5.4).

    d: stiffness; f: stiffness times value; its cover, that of a value of 1; all of shape ``tables.shape``. As far as a
    sample is known, screening pulls to its value too, and not to the base. Where strokes meet they come to a mean that
    does not depend on their order: paint and paint by how near its line is in its radius.
    """
    total = _sums(tables)
    for k, at, near, inside in _strokes(tables, base):
        params = tables.strokes[k].astype(np.float64)
        if params[STROKE_AT["brush"]] > 0:
            known = weight = brush_section(near, params)
        else:
            known, weight = channel_section(near, inside, params, tables)
        total["g"][at] += weight
        total["gx"][at] += weight * params[STROKE_AT["value"]]
        total["toe"][at] = np.maximum(total["toe"][at], known)
    rows, columns = tables.shape
    total = {name: a[:rows, :columns] for name, a in total.items()}
    d = CREST_STIFFNESS * total["toe"]
    cover = d + tables.screening * total["toe"]
    return d, cover * total["gx"] / np.maximum(total["g"], LEAST), cover


def _sums(tables: Tables) -> dict[str, Floats]:
    by0, by1, bx0, bx1 = tables.box
    return {name: np.zeros(((by1 - by0) * BIN, (bx1 - bx0) * BIN)) for name in _SUMS}


def _two(total: dict[str, Floats], tables: Tables) -> tuple[Floats, Floats]:
    """D and f of the gradient. A stiffness fades on the ground, not on the grid: in cells of level 4 (of a coarser
    level its own), else bands would seem wider on every finer level, and the free ground between them would move."""
    excess = max(tables.octave_m / tables.spacing_m, 1.0) ** 2 - 1
    toe, g = total["toe"], np.maximum(total["g"], LEAST)
    d = CREST_STIFFNESS * toe / (1 + excess * (1 - toe**2))
    return d, np.stack([d * total["gx"] / g, d * total["gy"] / g])


def _strokes(
    tables: Tables, base: NDArray[np.floating] | None = None
) -> Iterator[tuple[int, Places, Nearest, NDArray[np.bool_]]]:
    """Per stroke the samples of its bins (places in the box), their nearest crest points, as high as they are above the
    base there, and which are inside."""
    by0, by1, bx0, _ = tables.box
    stroke, first, last = tables.row_items.T
    row = np.repeat(np.arange(by0, by1), np.diff(tables.row_start))
    offset = np.arange(BIN)
    over = None if base is None else _bordered(base, (by1 - by0) * BIN, (tables.box[3] - bx0) * BIN)
    for k in range(len(tables.index)):
        mine = np.flatnonzero(stroke == k)
        if len(mine) == 0:
            continue
        gx = np.concatenate([np.arange(first[i], last[i]) for i in mine])
        gy = np.repeat(row[mine], (last - first)[mine])
        y = (gy[:, None, None] * BIN + offset[:, None]) + 0 * offset
        x = (gx[:, None, None] * BIN + offset) + 0 * offset[:, None]
        inside = np.zeros(x.shape, dtype=bool)
        if tables.index[k, INDEX_AT["octaves"]] >= 0:
            near = straight(tables, k, x.astype(float), y.astype(float))
        else:
            near = _nearest(tables, k, x.astype(float), y.astype(float))
            if tables.index[k, INDEX_AT["spans"]] >= 0:
                inside = _inside(tables, int(tables.index[k, INDEX_AT["spans"]]), x, y)
        at = y - by0 * BIN, x - bx0 * BIN
        if over is not None:
            near.height = near.height - over[at]
        yield k, at, near, inside


def _bordered(base: NDArray[np.floating], rows: int, columns: int) -> Floats:
    """A base that fills whole bins."""
    return np.pad(base.astype(np.float64), ((0, rows - base.shape[0]), (0, columns - base.shape[1])), mode="edge")


def _add(total: dict[str, Floats], at: Places, band: Band, in_pairs: bool) -> None:
    """Adds a stroke's weights and weighted targets to the sums at samples.

    ``in_pairs``: wtt is the sum of w (target - mean)^2, from pairs of strokes (West 1979), and joint that of what
    a pair weighs, w v / (w + v): no difference of nearly equal numbers.
    """
    w, g = np.where(band.reached, band.weight, 0.0), np.where(band.reached, band.toe_weight, 0.0)
    if in_pairs:
        known = total["w"][at]
        joint = known * (w / np.maximum(known + w, LEAST))
        gap = band.target - total["wt"][at] / np.maximum(known, LEAST)
        total["wtt"][at] += joint * gap**2
        total["joint"][at] += joint
    else:
        total["wtt"][at] += w * band.target**2
    for name, value in (("w", w), ("wt", w * band.target), ("wa", w * band.stiffness)):
        total[name][at] += value
    for name, value in (("g", g), ("gx", g * band.gx), ("gy", g * band.gy), ("follows", g * band.follows)):
        total[name][at] += value
    for name, value in (("fade", band.fade), ("held", band.held), ("toe", band.toe_fade), ("hard", band.hard)):
        total[name][at] = np.maximum(total[name][at], np.where(band.reached, value, 0.0))
    total["quiet"][at] = np.maximum(total["quiet"][at], band.quiet)


def _nearest(tables: Tables, k: int, x: Floats, y: Floats) -> Nearest:
    """Nearest points of outline ``k`` to blocks of samples (blocks, BIN, BIN); only candidates are visited."""
    first, count = tables.index[k, :2]
    segments = tables.segments[:, first : first + count].astype(np.float64)
    params = tables.strokes[k].astype(np.float64)
    cx, cy = x[:, :1, :].mean(axis=2), y[:, :, :1].mean(axis=1)
    middle = np.sqrt(_distance2(segments[:, None, :], cx, cy))
    reach = params[STROKE_AT["reach"]]
    bound = np.minimum(middle.min(axis=1) + 2 * HALF_DIAGONAL, reach + HALF_DIAGONAL)[:, None] + 1e-3
    order = np.argsort(~(middle <= bound), axis=1, kind="stable")
    counts = (middle <= bound).sum(axis=1)
    distance, square = np.full(x.shape, 1e15), np.full(x.shape, 1e30)
    zeros = [np.zeros(x.shape) for _ in range(7)]
    out = Nearest(distance, *zeros, np.ones(x.shape), square)  # type: ignore[call-arg]
    out.height[:] = params[STROKE_AT["height"]]
    for rank in range(int(counts.max(initial=0))):
        blocks = np.flatnonzero(counts > rank)
        candidates = segments[:, order[blocks, rank]][:, :, None, None]
        _update(out, candidates, x[blocks], y[blocks], blocks, params[STROKE_AT["stop"]])
    return out


def _distance2(seg: Floats, x: Floats, y: Floats) -> Floats:
    u = np.clip(((x - seg[0]) * seg[2] + (y - seg[1]) * seg[3]) * seg[4], 0, 1)
    rx, ry = x - (seg[0] + u * seg[2]), y - (seg[1] + u * seg[3])
    return np.asarray(rx * rx + ry * ry)


def _update(out: Nearest, seg: Floats, x: Floats, y: Floats, blocks: NDArray[np.intp], stop: float) -> None:
    ax, ay, dx, dy, il2, t0x, t0y, t1x, t1y, cap0, cap1, z, rise = seg
    px, py = rounded(x - ax), rounded(y - ay)
    u = np.clip(rounded(fused(px, dx, rounded(py * dy)) * il2), 0, 1)
    rx, ry = fused(-u, dx, px), fused(-u, dy, py)
    distance, square = np.hypot(rx, ry), square_of(rx, ry)
    at0, at1 = u <= 0, u >= 1
    tx, ty = np.where(at0, t0x, np.where(at1, t1x, dx)), np.where(at0, t0y, np.where(at1, t1y, dy))
    cross = fused(tx, ry, -rounded(ty * rx))
    cap = (at0 & (cap0 > 0)) | (at1 & (cap1 > 0))
    past = fused(tx, rx, rounded(ty * ry))
    left, right = sides(cap, past, cross, square, distance)
    along = rise * il2 * (1 - np.where(cap, np.minimum(np.abs(past) * stop, 1.0), 0.0))
    better = square < out.square[blocks]
    for name, value in (
        ("distance", distance),
        ("height", z + u * rise),
        ("along_x", along * dx),
        ("along_y", along * dy),
        ("square", square),
        ("rx", rx),
        ("ry", ry),
        ("left", left),
        ("right", right),
    ):
        field = getattr(out, name)
        field[blocks] = np.where(better, value, field[blocks])


def _inside(tables: Tables, span: int, x: NDArray[np.int64], y: NDArray[np.int64]) -> NDArray[np.bool_]:
    out = np.zeros(x.shape, dtype=bool)
    row0 = tables.box[0] * BIN
    index = tables.span_index[span : span + (tables.box[1] - tables.box[0]) * BIN + 1]
    for block in range(len(x)):
        for row in range(BIN):
            at = y[block, row, 0] - row0
            for x0, x1 in tables.spans[index[at] : index[at + 1]]:
                out[block, row] |= (x[block, row] >= x0) & (x[block, row] <= x1)
    return out
