"""NumPy float64 twin of shaders/opencl/raster.cl: constraints of one level from packed tables (DESIGN 5.2, 5.5)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from esker.contract import CREST_STIFFNESS, SPRING_CELLS, SPRING_FULL_FRACTION
from esker.solve.tables import (
    BIN,
    CREST_HALF_WIDTH,
    EXIT_SHARE,
    HELD_FRACTION,
    SPRING_FLOOR_CELLS,
    THINNEST_M,
    TOE,
    Tables,
)

Floats = NDArray[np.float64]

HARD = -1.0
"""Stiffness that marks a sample as fixed (a crest, or a pinned border)."""
_TINY = 1e-20


@dataclass(frozen=True)
class Constraints:
    """What the strokes say in a box of a level (all of it or a window).

    Every array float64, (rows, columns) or (2, rows, columns), row 0 south. height_d: spring stiffness, HARD where
    fixed. height_f: stiffness times target (plus what the screening must give back), or the fixed height. gradient_d:
    stiffness for both gradient components. gradient_f: stiffness times target (d/dx, d/dy), metres per metre.
    """

    height_d: Floats
    height_f: Floats
    gradient_d: Floats
    gradient_f: Floats


def smoothstep(t: Floats) -> Floats:
    t = np.clip(t, 0.0, 1.0)
    return t * t * (3 - 2 * t)


@dataclass
class _Nearest:
    """The nearest crest point of one stroke, per sample: all arrays of one shape, distances in cells."""

    d2: Floats
    height: Floats
    rx: Floats
    ry: Floats
    along_x: Floats
    along_y: Floats
    left: Floats


@dataclass
class _Band:
    """A stroke's cross-section at samples: see ``cross_section``."""

    hard: NDArray[np.bool_]
    weight: Floats
    toe_weight: Floats
    target: Floats
    stiffness: Floats
    fade: Floats
    held: Floats
    toe_fade: Floats
    gx: Floats
    gy: Floats


def flank_profile(top: Floats, slope: Floats, k: Floats, f: Floats, d: Floats) -> tuple[Floats, Floats, Floats]:
    """Height of a flank over the base, its fall per metre and its change with the crest height (DESIGN 5.2).

    top: crest height over the base >= 0, metres; k, f: shares of it taken by the parabolic shoulder and foot; d:
    metres from the crest. From the crest: shoulder, straight part of the prescribed slope, foot.
    """
    end = (1 + k + f) * top / slope
    ktop, ftop = np.maximum(k * top, _TINY), np.maximum(f * top, _TINY)
    shoulder, foot = d < 2 * k * top / slope, d > end - 2 * f * top / slope
    z, fall, lift = (1 + k) * top - slope * d, slope + 0 * d, 1 + k + 0 * d
    rest = np.maximum(end - d, 0.0)
    z = np.where(shoulder, top - slope**2 * d**2 / (4 * ktop), z)
    lift = np.where(shoulder, 1 + slope**2 * d**2 / (4 * ktop * np.maximum(top, _TINY)), lift)
    fall = np.where(shoulder, slope**2 * d / (2 * ktop), fall)
    curl = slope**2 / (4 * ftop)
    z = np.where(foot, curl * rest**2, z)
    fall = np.where(foot, 2 * curl * rest, fall)
    lift = np.where(foot, 2 * curl * rest * (1 + k + f) / slope - curl * rest**2 / np.maximum(top, _TINY), lift)
    return z, fall, lift


def cross_section(near: _Nearest, inside: NDArray[np.bool_], params: Floats, tables: Tables) -> _Band:
    """What one stroke wants at samples whose nearest crest point is known (DESIGN 5.2)."""
    s = tables.spacing_m
    plateau = params[0]
    lh, ls, le, lk, lf, rh, rs, re, rk, rf = params[4:14]
    distance = np.where(inside, 0.0, np.sqrt(near.d2))
    d = np.maximum(distance - plateau, 0.0)
    hard = d < CREST_HALF_WIDTH
    left, right = near.left * lh, (1 - near.left) * rh
    present = left + right
    share = np.where(present > 0, left / np.maximum(present, _TINY), 0.0)
    slope, extent = rs + share * (ls - rs), re + share * (le - re)
    k, f = rk + share * (lk - rk), rf + share * (lf - rf)
    slope = np.where(present > 0, slope, 1.0)
    top, sign = np.abs(near.height), np.where(near.height < 0, -1.0, 1.0)
    end = np.where(present > 0, np.minimum(extent, (1 + k + f) * top / slope), 0.0)
    r = np.minimum(d * s / np.maximum(end, THINNEST_M), 1e6)
    z, fall, lift = flank_profile(top, slope, k, f, np.minimum(d * s, end))
    beyond = r > 1
    free = smoothstep((r - SPRING_FULL_FRACTION) / (1 - SPRING_FULL_FRACTION))
    past = 1 + np.maximum(d * s - end, 0.0) / tables.exit_length_m
    cut = np.minimum(8 * (1 - end / np.maximum((1 + k + f) * top / slope, _TINY)), 1.0)
    leaving = np.where(beyond, 1.0, free * cut)
    fall = fall + leaving * (np.minimum(fall, EXIT_SHARE * z / tables.exit_length_m) / past**2 - fall)
    lift = np.where(beyond, 0.0, lift)
    unit = np.maximum(distance, 0.5)
    off_plateau = distance > plateau
    down = np.where(off_plateau, -sign * fall, 0.0) * (present > 0)
    lift = np.where(present > 0, lift, 1.0)
    near_weight = 1 / (1 + d * d)
    fade = np.where(hard, 1.0, present * (1 - free))
    rt = np.minimum(d * s / np.maximum(end, SPRING_FLOOR_CELLS * s), 1e6)
    toe_fade = np.where(present > 0, present * (1 - smoothstep((rt - 1) / (TOE - 1))), 0.0)
    return _Band(
        hard=hard,
        weight=near_weight * fade * np.where(hard, 1.0, np.maximum(1 - r, 0.0) ** 2 + _TINY),
        toe_weight=near_weight * toe_fade * np.maximum(1 - rt / TOE, 0.0) ** 2,
        target=sign * z,
        stiffness=(SPRING_CELLS / np.maximum(end / s, SPRING_FLOOR_CELLS)) ** 2,
        fade=fade,
        held=np.where(hard, 1.0, present * (1 - smoothstep((r - HELD_FRACTION) / (1 - HELD_FRACTION)))),
        toe_fade=toe_fade,
        gx=down * near.rx / unit + lift * near.along_x / s,
        gy=down * near.ry / unit + lift * near.along_y / s,
    )


def rasterise(tables: Tables) -> Constraints:
    """The constraints of the samples of the tables' box, shape ``tables.shape``."""
    by0, by1, bx0, bx1 = tables.box
    size = (by1 - by0) * BIN, (bx1 - bx0) * BIN
    total = {name: np.zeros(size) for name in ("w", "wt", "wa", "fade", "held", "g", "gx", "gy", "toe", "hard")}
    for k in range(len(tables.index)):
        _add_stroke(tables, k, total)
    rows, columns = tables.shape
    total = {name: a[:rows, :columns] for name, a in total.items()}
    w = np.maximum(total["w"], _TINY)
    target, stiffness = total["wt"] / w, total["wa"] / w * total["fade"]
    hard = total["hard"] > 0
    height_d = np.where(hard, HARD, stiffness)
    height_f = np.where(hard, target, (stiffness + tables.screening * total["held"]) * target)
    if tables.pinned:
        y, x = (o + np.arange(count) for o, count in zip(tables.origin, tables.shape, strict=True))
        edge = ((y == 0) | (y == tables.samples - 1))[:, None] | (x == 0) | (x == tables.samples - 1)
        height_d, height_f = np.where(edge, HARD, height_d), np.where(edge, 0.0, height_f)
    gradient_d = CREST_STIFFNESS * total["toe"]
    g = np.maximum(total["g"], _TINY)
    return Constraints(
        height_d, height_f, gradient_d, np.stack([gradient_d * total["gx"] / g, gradient_d * total["gy"] / g])
    )


def _add_stroke(tables: Tables, k: int, total: dict[str, Floats]) -> None:
    """One stroke's share in every sample that it can reach."""
    by0, by1, bx0, bx1 = tables.box
    params, (first, number, span) = tables.strokes[k], tables.index[k, :3]
    segments = tables.segments[:, first : first + number]
    bx = np.arange(max(bx0, int(params[1]) // BIN), min(bx1 - 1, int(np.ceil(params[2])) // BIN) + 1)
    items, start = tables.row_items, tables.row_start
    rows = [by0 + b for b in range(by1 - by0) if k in items[start[b] : start[b + 1]]]
    if len(bx) == 0 or not rows:
        return
    gy, gx = (a.ravel() for a in np.meshgrid(rows, bx, indexing="ij"))
    offset = np.arange(BIN)
    y = (gy[:, None, None] * BIN + offset[:, None]) + 0 * offset
    x = (gx[:, None, None] * BIN + offset) + 0 * offset[:, None]
    near = _nearest(segments, x.astype(float), y.astype(float), params[3])
    inside = _inside(tables, span, x, y) if span >= 0 else np.zeros(x.shape, dtype=bool)
    near.height = np.where(inside, tables.segments[2, first], near.height)
    for name in ("along_x", "along_y"):
        setattr(near, name, np.where(inside, 0.0, getattr(near, name)))
    band = cross_section(near, inside, params, tables)
    reached = inside | (near.d2 <= params[3] ** 2)
    _accumulate(total, (y - by0 * BIN, x - bx0 * BIN), band, reached)


def _accumulate(total: dict[str, Floats], at: tuple[Any, Any], band: _Band, reached: NDArray[np.bool_]) -> None:
    """Adds a stroke's weights and weighted wishes to the sums at samples."""
    w, g = np.where(reached, band.weight, 0.0), np.where(reached, band.toe_weight, 0.0)
    for name, value in (("w", w), ("wt", w * band.target), ("wa", w * band.stiffness)):
        total[name][at] += value
    for name, value in (("g", g), ("gx", g * band.gx), ("gy", g * band.gy)):
        total[name][at] += value
    for name, value in (("fade", band.fade), ("held", band.held), ("toe", band.toe_fade), ("hard", band.hard)):
        total[name][at] = np.maximum(total[name][at], np.where(reached, value, 0.0))


def _nearest(segments: Floats, x: Floats, y: Floats, reach: float) -> _Nearest:
    """Nearest crest point for blocks of samples, shape (blocks, BIN, BIN); only candidate segments are visited."""
    half = np.hypot(BIN - 1, BIN - 1) / 2
    cx, cy = x[:, :1, :].mean(axis=2), y[:, :, :1].mean(axis=1)
    middle = np.sqrt(_distance2(segments[:, None, :], cx, cy))
    bound = np.minimum(middle.min(axis=1) + 2 * half, reach + half)[:, None] + 1e-3
    order = np.argsort(~(middle <= bound), axis=1, kind="stable")
    counts = (middle <= bound).sum(axis=1)
    out = _Nearest(np.full(x.shape, 1e30), *(np.zeros(x.shape) for _ in range(6)))
    for rank in range(int(counts.max(initial=0))):
        blocks = np.flatnonzero(counts > rank)
        _update(out, segments[:, order[blocks, rank]][:, :, None, None], x[blocks], y[blocks], blocks)
    return out


def _distance2(seg: Floats, x: Floats, y: Floats) -> Floats:
    u = np.clip(((x - seg[0]) * seg[3] + (y - seg[1]) * seg[4]) * seg[6], 0, 1)
    rx, ry = x - (seg[0] + u * seg[3]), y - (seg[1] + u * seg[4])
    return np.asarray(rx * rx + ry * ry)


def _update(out: _Nearest, seg: Floats, x: Floats, y: Floats, blocks: NDArray[np.intp]) -> None:
    ax, ay, az, dx, dy, dz, il2, t0x, t0y, t1x, t1y, cap0, cap1, s0x, s0y, s1x, s1y = seg
    u = np.clip(((x - ax) * dx + (y - ay) * dy) * il2, 0, 1)
    rx, ry = x - (ax + u * dx), y - (ay + u * dy)
    d2 = rx * rx + ry * ry
    at0, at1 = u <= 0, u >= 1
    tx, ty = np.where(at0, t0x, np.where(at1, t1x, dx)), np.where(at0, t0y, np.where(at1, t1y, dy))
    cross = tx * ry - ty * rx
    cap = (at0 & (cap0 > 0)) | (at1 & (cap1 > 0))
    flat = 0.5 + 0.5 * cross / np.maximum(np.sqrt(d2), 1e-6)
    left = np.where(cap, flat, np.where(cross > 0, 1.0, np.where(cross < 0, 0.0, 0.5)))
    near0, near1 = np.maximum(1 - 2 * u, 0.0), np.maximum(2 * u - 1, 0.0)
    along = (1 - near0 - near1) * dz * il2
    along_x, along_y = along * dx + near0 * s0x + near1 * s1x, along * dy + near0 * s0y + near1 * s1y
    better = d2 < out.d2[blocks]
    new = _Nearest(d2, az + u * dz, rx, ry, along_x, along_y, left)
    for name, value in vars(new).items():
        field = getattr(out, name)
        field[blocks] = np.where(better, value, field[blocks])


def _inside(tables: Tables, span: int, x: NDArray[np.int_], y: NDArray[np.int_]) -> NDArray[np.bool_]:
    out = np.zeros(x.shape, dtype=bool)
    row0 = tables.box[0] * BIN
    index = tables.span_index[span : span + (tables.box[1] - tables.box[0]) * BIN + 1]
    for block in range(len(x)):
        for row in range(BIN):
            at = y[block, row, 0] - row0
            if y[block, row, 0] < tables.samples:
                for x0, x1 in tables.spans[index[at] : index[at + 1]]:
                    out[block, row] |= (x[block, row] >= x0) & (x[block, row] <= x1)
    return out
