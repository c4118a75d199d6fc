"""NumPy float64 twin of shaders/opencl/nearest.cl and section.cl: what strokes want of samples (DESIGN 5.2, 5.4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from esker.contract import SPRING_CELLS, SPRING_FULL_FRACTION
from esker.solve.constraints.float32 import fused, rounded
from esker.solve.constraints.tables import (
    BALANCE_M,
    CHANNEL_FLOOR_CELLS,
    EDGE_CELLS,
    EDGE_SHARE,
    EXIT_SHARE,
    FAN,
    FULL_SAY,
    HELD_FRACTION,
    INDEX_AT,
    LOWEST_M,
    NEAR_FLOOR,
    NEAR_SHARE,
    NO_LENGTH_M,
    PAIRS_EDITION,
    SKIRT_SLOPE,
    SPRING_FLOOR_CELLS,
    STEEPEST,
    STROKE_AT,
    THINNEST_M,
    TOE,
    Tables,
)

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]
TINY = 1e-20
LEAST = 1e-30
"""Strokes have no say where the sum of their weights is below this."""
SLIGHT = 1e-10


def smoothstep(t: Floats) -> Floats:
    t = np.clip(t, 0.0, 1.0)
    return t * t * (3 - 2 * t)


@dataclass
class Nearest:
    """The nearest crest point of one stroke, per sample: all arrays of one shape, distances in cells.

    rate: change of the height per metre of distance; along: slope of the crest as a vector, metres a cell; left, right:
    shares of the two sides; square: of the distance. What decides something, the nearest segment, the side or the
    square, has the bits of the kernels (``float32``).
    """

    distance: Floats
    height: Floats
    rate: Floats
    rx: Floats
    ry: Floats
    along_x: Floats
    along_y: Floats
    left: Floats
    right: Floats
    square: Floats


def square_of(x: Floats, y: Floats) -> Floats:
    return fused(x, x, rounded(y * y))


def sides(cap: Mask, past: Floats, cross: Floats, square: Floats, distance: Floats) -> tuple[Floats, Floats]:
    """Returns the shares of the left and the right side: one of them, or both on the line itself and around its ends
    (``cap``), where samples are ``past`` an end, as the sine of the angle says. Nearly equal numbers are never
    subtracted, so a small share is exact too."""
    lesser = np.where(cross == 0, 0.5, 0.0)
    lesser = np.where(cap, 0.5 * (past**2 + TINY) / (square + distance * np.abs(cross) + TINY), lesser)
    return np.where(cross > 0, 1 - lesser, lesser), np.where(cross < 0, 1 - lesser, lesser)


def straight(tables: Tables, k: int, x: Floats, y: Floats) -> Nearest:
    """Nearest points of profile ``k`` to samples (x, y)."""
    p = {name: float(tables.strokes[k, at]) for name, at in STROKE_AT.items()}
    px, py = rounded(x - p["ax"]), rounded(y - p["ay"])
    b, c = rounded(py * p["ty"]), rounded(py * p["tx"])
    along = rounded(fused(px, p["tx"], b) + fused(py, p["ty"], -b))
    cross = rounded(fused(py, p["tx"], -c) - fused(px, p["ty"], -c))
    q = np.clip(along, 0.0, p["length"])
    past = rounded(along - q)
    distance = np.hypot(past, cross)
    d = np.clip(distance, p["plateau"], p["reach"]) - p["plateau"]
    height, slope, rate = crest_at(tables, k, q, d * tables.spacing_m)
    slope = slope * (1 - np.minimum(np.abs(past) * p["stop"], 1.0))
    square = square_of(past, cross)
    return Nearest(
        distance,
        height,
        rate,
        past * p["tx"] - cross * p["ty"],
        past * p["ty"] + cross * p["tx"],
        slope * p["tx"],
        slope * p["ty"],
        *sides(past != 0, past, cross, square, distance),
        square,
    )


def crest_at(tables: Tables, k: int, q: Floats, d: Floats) -> tuple[Floats, Floats, Floats]:
    """Height of a crest at q cells from its start as samples d metres beyond its plateau see it, its slope per cell and
    its change per metre of d.

    Octave o is seen from FAN (2^o - 1) first controls away; between two of them a smooth step leads over.
    """
    unit = FAN * tables.octave_m
    z, slope = _octave_at(tables, k, 0, q)
    rate = np.zeros(q.shape)
    for o in range(tables.index[k, INDEX_AT["octaves"]]):
        v = np.clip((d - unit * (2**o - 1)) / (unit * 2**o), 0.0, 1.0)
        share = v * v * (3 - 2 * v)
        smoother, along = _octave_at(tables, k, o + 1, q)
        rate = rate * (1 - share) + 6 / (unit * 2**o) * v * (1 - v) * (smoother - z)
        z, slope = z + share * (smoother - z), slope + share * (along - slope)
    return z, slope, rate


def _octave_at(tables: Tables, k: int, o: int, q: Floats) -> tuple[Floats, Floats]:
    """Height and slope per cell of octave ``o``: 0 is the crest itself, the others are cubic B-splines."""
    at = {name: int(tables.index[k, j]) for name, j in INDEX_AT.items()}
    if o == 0:
        t, z, fall = tables.knots[:, at["first"] : at["first"] + at["count"]].astype(np.float64)
        j = np.clip(np.searchsorted(t, q, side="right") - 1, 0, len(t) - 1)
        steepest = STEEPEST * tables.spacing_m
        return z[j] + fall[j] * (q - t[j]), np.clip(fall[j], -steepest, steepest)
    inverse = tables.spacing_m / (tables.octave_m * 2 ** (o - 1))
    u = (q - float(tables.strokes[k, STROKE_AT["middle"]])) * inverse
    j = np.floor(u).astype(int)
    f = u - j
    pieces = tables.pieces[tables.octaves[at["octave"] + o - 1] + j].astype(np.float64)
    a0, a1, a2, a3 = np.moveaxis(pieces, -1, 0)
    return a0 + f * (a1 + f * (a2 + f * a3)), (a1 + f * (2 * a2 + f * 3 * a3)) * inverse


@dataclass
class Flanks:
    """A stroke's band where samples are: d, ds: distance beyond the plateau in cells and metres; ``full``: width of the
    whole profile, ``end`` of the part within the extent, metres.

    present: how far there is a flank, 0..1: around the end of a stroke with one flank it goes to 0. there: 0 where
    there is none, 1 from a small share on. sure: by how much less it counts beside others where it goes. Places are
    known to 1e-5 of a cell, and beside the skirt of another stroke, whose weight is SLIGHT, a share of the square of
    that would decide.
    """

    d: Floats
    ds: Floats
    present: Floats
    there: Floats
    sure: Floats
    slope: Floats
    k: Floats
    f: Floats
    top: Floats
    full: Floats
    end: Floats
    hard: Mask
    has: Mask
    within: Mask


def flanks_of(near: Nearest, inside: Mask, params: Floats, s: float) -> Flanks:
    p = {name: float(params[at]) for name, at in STROKE_AT.items()}
    d = np.maximum(np.where(inside, 0.0, near.distance) - p["plateau"], 0.0)
    left, right = near.left * p["lh"], near.right * p["rh"]
    present = left + right
    has = present > TINY
    share, rest = (np.minimum(side / np.maximum(present, TINY), 1.0) for side in (left, right))
    there = np.minimum(present / FULL_SAY, 1.0)
    fills = np.clip(near.height / BALANCE_M + 0.5, 0.0, 1.0)
    present = present * (p["cut"] + fills * (p["fill"] - p["cut"]))
    slope, extent, k, f = (rest * p["r" + name] + share * p["l" + name] for name in "sekf")
    slope = np.where(has, slope, 1.0)
    top = np.abs(near.height)
    full = (1 + k + f) * top / slope * np.minimum(top / LOWEST_M, 1.0) ** 3
    end = np.where(has, np.minimum(extent, full), 0.0)
    within = inside | (near.distance <= p["reach"])
    hard = inside | (near.square < p["crest2"])
    return Flanks(d, d * s, present, there, there**3, slope, k, f, top, full, end, hard, has, within)


def flank_profile(b: Flanks, d: Floats) -> tuple[Floats, Floats, Floats]:
    """Height of a flank over the base, its fall per metre and its change with the crest height (DESIGN 5.2).

    d: metres from the crest, at most the full width. From the crest: shoulder, straight part of the prescribed slope,
    foot; k and f are the shares of the crest height taken by the parabolic shoulder and foot.
    """
    top, slope, k, f = b.top, b.slope, b.k, b.f
    ktop, ftop = np.maximum(k * top, TINY), np.maximum(f * top, TINY)
    rest = np.maximum(b.full - d, 0.0)
    shoulder, foot = d < 2 * k * top / slope, rest < 2 * f * top / slope
    z, fall, lift = (1 + k) * top - slope * d, slope + 0 * d, 1 + k + 0 * d
    z = np.where(shoulder, top - slope**2 * d**2 / (4 * ktop), z)
    lift = np.where(shoulder, 1 + slope**2 * d**2 / (4 * ktop * np.maximum(top, TINY)), lift)
    fall = np.where(shoulder, slope**2 * d / (2 * ktop), fall)
    curl = slope**2 / (4 * ftop)
    z = np.where(foot, curl * rest**2, z)
    fall = np.where(foot, 2 * curl * rest, fall)
    lift = np.where(foot, 2 * curl * rest * (1 + k + f) / slope - curl * rest**2 / np.maximum(top, TINY), lift)
    return z, fall, lift


@dataclass
class Skirt:
    """Where a band's extent cuts it so high that screening would break the ground off: need 0..1, width in metres,
    height of the ground where it begins and that height's change with the crest's."""

    need: Floats
    width: Floats
    height: Floats
    lift: Floats


def skirt(b: Flanks, reach_m: float | None) -> Skirt:
    """A parabola that leads from the cut to the base, at first with the flank's slope or SKIRT_SLOPE."""
    height, fall, lift = flank_profile(b, b.end)
    cliff = 0.0 if reach_m is None else 1 / reach_m
    cut = b.has & (b.end < b.full)
    need = np.where(cut, smoothstep(height * cliff / SKIRT_SLOPE - 0.5), 0.0)
    return Skirt(need, need * 2 * height / np.maximum(fall, SKIRT_SLOPE), height, lift)


@dataclass
class Band:
    """A stroke's targets at samples, with their weights and how far they count (``reference_raster``).

    follows: how far the gradient is that of the ground, base included; quiet: how far the bank of a course takes the
    springs of all strokes away.
    """

    reached: Mask
    hard: Mask
    weight: Floats
    toe_weight: Floats
    target: Floats
    stiffness: Floats
    fade: Floats
    held: Floats
    toe_fade: Floats
    gx: Floats
    gy: Floats
    follows: Floats
    quiet: Floats


def nearness(b: Flanks, tables: Tables) -> Floats:
    """Weight of a stroke beside others by the distance from its crest: on any grid the same ground takes over."""
    least = NEAR_FLOOR * max(tables.spacing_m, tables.octave_m)
    return np.asarray(1 / (1 + (b.ds / np.maximum(NEAR_SHARE * b.there * b.end, least)) ** 2))


def cross_section(near: Nearest, inside: Mask, params: Floats, tables: Tables) -> Band:
    """Targets of one stroke at samples whose nearest crest point is known (DESIGN 5.2)."""
    s, decay = tables.spacing_m, 1 / tables.exit_length_m
    b = flanks_of(near, inside, params, s)
    apron = skirt(b, tables.reach_m)
    r = np.minimum(b.ds / np.maximum(b.end, THINNEST_M), 1e6)
    wide = np.maximum(b.end, SPRING_FLOOR_CELLS * s)
    rt = b.ds / wide
    toe_end = np.maximum(TOE, 1 + apron.width / wide)
    z, fall, lift = flank_profile(b, b.there * np.minimum(b.ds, b.end))
    if tables.edition >= PAIRS_EDITION:  # on a plateau, where a crest has no height, too
        on = b.ds <= NO_LENGTH_M
        z, lift = np.where(on, b.top, z), np.where(on, 1.0, lift)
    free = smoothstep((r - SPRING_FULL_FRACTION) / (1 - SPRING_FULL_FRACTION))
    over = np.maximum(b.ds - b.end, 0.0)
    rest = np.maximum(1 - over / np.maximum(apron.width, TINY), 0.0)
    level = np.minimum(8 * (1 - b.end / np.maximum(b.full, TINY)), 1.0)
    out = np.minimum(over / np.maximum(EDGE_CELLS * s, EDGE_SHARE * b.end), 1.0)
    off = free * level * (1 - apron.need)
    leaving = off + out * (1 - off)
    leave = np.minimum(fall, EXIT_SHARE * z * decay) / (1 + over * decay) ** 2
    leave = leave + apron.need * (2 * apron.height * rest / np.maximum(apron.width, TINY) - leave)
    fall = fall + leaving * (leave - fall)
    z = z + out * apron.need * (apron.height * rest**2 - z)
    skirt_lift = apron.need * apron.lift * rest**2
    follows = np.where(b.has, lift * (1 - off) * (1 - out) + out * skirt_lift, 1.0)
    lift = np.where(b.has, lift + out * (skirt_lift - lift), 1.0)
    held = smoothstep((1 - b.ds / np.maximum(b.end + apron.width, THINNEST_M)) / (1 - HELD_FRACTION))
    sign = np.where(near.height < 0, -1.0, 1.0)
    sloping = b.has & (near.square > params[STROKE_AT["plateau2"]]) & ~inside
    down = np.where(sloping, lift * near.rate - sign * fall, 0.0)
    near_weight, skirted = nearness(b, tables) * params[STROKE_AT["say"]], params[STROKE_AT["skirt"]]
    fade = np.where(b.hard, 1.0, b.present * (1 - free))
    toe_fade = np.where(b.has, b.present * smoothstep((toe_end - rt) / (toe_end - 1)), 0.0)
    unit = down / np.maximum(near.distance, 0.5)
    rise = np.where(inside, 0.0, lift / s)
    inner = np.where(b.hard, 1.0, b.sure * np.maximum(1 - r, 0.0) ** 2)
    return Band(
        reached=b.within & (b.hard | (b.has & (rt < toe_end))),
        hard=b.hard,
        weight=near_weight * (fade * inner + SLIGHT * b.present * b.sure * free * held * skirted),
        toe_weight=near_weight * b.sure * toe_fade * np.maximum(1 - rt / toe_end, 0.0) ** 2,
        target=sign * z,
        stiffness=(SPRING_CELLS * s / wide) ** 2,
        fade=fade,
        held=np.where(b.hard, 1.0, b.present * held),
        toe_fade=toe_fade,
        gx=unit * near.rx + rise * near.along_x,
        gy=unit * near.ry + rise * near.along_y,
        follows=follows,
        quiet=np.where(b.within, bank(near, b, params), 0.0),
    )


def bank(near: Nearest, b: Flanks, params: Floats) -> Floats:
    """How far samples lie in the bank of a course, where the diffusion alone leads the ground to its line, 0..1."""
    left, right = (float(params[STROKE_AT[side]]) for side in ("lb", "rb"))
    if left + right == 0:
        return np.zeros(near.distance.shape)
    width = near.left * left + near.right * right
    return smoothstep(1 - b.d / np.maximum(width, TINY))


def channel_section(near: Nearest, inside: Mask, params: Floats, tables: Tables) -> tuple[Floats, Floats]:
    """How far samples know what one stroke asks of a channel, 0..1, and the weight of that (DESIGN 5.4)."""
    s = tables.spacing_m
    b = flanks_of(near, inside, params, s)
    r = b.ds / np.maximum(b.end, CHANNEL_FLOOR_CELLS * s)
    known = np.where(b.hard, 1.0, b.present * smoothstep((TOE - r) / (TOE - 1)))
    known = np.where(b.within, known, 0.0)
    outer = np.where(b.hard, 1.0, b.sure * np.maximum(1 - r / TOE, 0.0) ** 2)
    return known, known * nearness(b, tables) * params[STROKE_AT["say"]] * outer


def brush_section(near: Nearest, params: Floats) -> Floats:
    """How far samples know what one brush has painted: 1 on its line, nothing at its radius (DESIGN 5.4)."""
    return smoothstep(1 - near.distance / float(params[STROKE_AT["brush"]]))
