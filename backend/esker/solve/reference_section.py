"""NumPy float64 twin of shaders/opencl/section.cl: what strokes want of samples (DESIGN 5.2, 5.4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from esker.contract import SPRING_CELLS, SPRING_FULL_FRACTION
from esker.solve.tables import (
    CHANNEL_FLOOR_CELLS,
    CREST_HALF_WIDTH,
    EXIT_SHARE,
    FAN,
    HELD_FRACTION,
    INDEX_AT,
    NEAR_FLOOR,
    NEAR_SHARE,
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
SLIGHT = 1e-10


def smoothstep(t: Floats) -> Floats:
    t = np.clip(t, 0.0, 1.0)
    return t * t * (3 - 2 * t)


@dataclass
class Nearest:
    """The nearest crest point of one stroke, per sample: all arrays of one shape, distances in cells.

    rate: change of the height per metre of distance; along: slope of the crest as a vector, metres a cell; left: share
    of the left side.
    """

    distance: Floats
    height: Floats
    rate: Floats
    rx: Floats
    ry: Floats
    along_x: Floats
    along_y: Floats
    left: Floats


def straight(tables: Tables, k: int, x: Floats, y: Floats) -> Nearest:
    """Nearest points of profile ``k`` to samples (x, y)."""
    p = {name: tables.strokes[k, at] for name, at in STROKE_AT.items()}
    px, py = x - p["ax"], y - p["ay"]
    along, cross = px * p["tx"] + py * p["ty"], p["tx"] * py - p["ty"] * px
    q = np.clip(along, 0.0, p["length"])
    past = along - q
    distance = np.hypot(past, cross)
    d = np.clip(distance, p["plateau"], p["reach"]) - p["plateau"]
    height, slope, rate = crest_at(tables, k, q, d * tables.spacing_m)
    slope = np.where(past != 0, 0.0, slope)
    side = np.where(cross > 0, 1.0, np.where(cross < 0, 0.0, 0.5))
    return Nearest(
        distance,
        height,
        rate,
        past * p["tx"] - cross * p["ty"],
        past * p["ty"] + cross * p["tx"],
        slope * p["tx"],
        slope * p["ty"],
        np.where(past != 0, 0.5 + 0.5 * cross / np.maximum(distance, 1e-6), side),
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
        t, z, fall = tables.knots[:, at["first"] : at["first"] + at["count"]]
        j = np.clip(np.searchsorted(t, q, side="right") - 1, 0, len(t) - 1)
        steepest = STEEPEST * tables.spacing_m
        return z[j] + fall[j] * (q - t[j]), np.clip(fall[j], -steepest, steepest)
    inverse = tables.spacing_m / (tables.octave_m * 2 ** (o - 1))
    u = q * inverse
    j = np.floor(u).astype(int)
    f = u - j
    a0, a1, a2, a3 = np.moveaxis(tables.pieces[tables.octaves[at["octave"] + o - 1] + j], -1, 0)
    return a0 + f * (a1 + f * (a2 + f * a3)), (a1 + f * (2 * a2 + f * 3 * a3)) * inverse


@dataclass
class Flanks:
    """A stroke's band where samples are: d, ds: distance beyond the plateau in cells and metres; ``full``: width of the
    whole profile, ``end`` of the part within the extent, metres."""

    d: Floats
    ds: Floats
    present: Floats
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
    p = {name: params[at] for name, at in STROKE_AT.items()}
    d = np.maximum(np.where(inside, 0.0, near.distance) - p["plateau"], 0.0)
    left = near.left * p["lh"]
    present = left + (1 - near.left) * p["rh"]
    has = present > 0
    present = present * np.where(near.height < 0, p["cut"], p["fill"])
    share = left / np.maximum(present, TINY)
    slope = np.where(has, p["rs"] + share * (p["ls"] - p["rs"]), 1.0)
    extent = p["re"] + share * (p["le"] - p["re"])
    k, f = p["rk"] + share * (p["lk"] - p["rk"]), p["rf"] + share * (p["lf"] - p["rf"])
    top = np.abs(near.height)
    full = (1 + k + f) * top / slope
    end = np.where(has, np.minimum(extent, full), 0.0)
    within = inside | (near.distance <= p["reach"])
    return Flanks(d, d * s, present, slope, k, f, top, full, end, d < CREST_HALF_WIDTH, has, within)


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
    """A stroke's wishes at samples: targets with their weights and how far they count (``reference_raster``).

    follows: how far the gradient is that of the ground, base included.
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


def nearness(b: Flanks, tables: Tables) -> Floats:
    """Weight of a stroke beside others by the distance from its crest: on any grid the same ground takes over."""
    least = NEAR_FLOOR * max(tables.spacing_m, tables.octave_m)
    return np.asarray(1 / (1 + (b.ds / np.maximum(NEAR_SHARE * b.end, least)) ** 2))


def cross_section(near: Nearest, inside: Mask, params: Floats, tables: Tables) -> Band:
    """What one stroke wants at samples whose nearest crest point is known (DESIGN 5.2)."""
    s, decay = tables.spacing_m, 1 / tables.exit_length_m
    b = flanks_of(near, inside, params, s)
    apron = skirt(b, tables.reach_m)
    r = np.minimum(b.ds / np.maximum(b.end, THINNEST_M), 1e6)
    wide = np.maximum(b.end, SPRING_FLOOR_CELLS * s)
    rt = b.ds / wide
    toe_end = np.maximum(TOE, 1 + apron.width / wide)
    z, fall, lift = flank_profile(b, np.minimum(b.ds, b.end))
    beyond = r > 1
    free = smoothstep((r - SPRING_FULL_FRACTION) / (1 - SPRING_FULL_FRACTION))
    over = np.maximum(b.ds - b.end, 0.0)
    rest = np.maximum(1 - over / np.maximum(apron.width, TINY), 0.0)
    level = np.minimum(8 * (1 - b.end / np.maximum(b.full, TINY)), 1.0)
    leaving = np.where(beyond, 1.0, free * level * (1 - apron.need))
    leave = np.minimum(fall, EXIT_SHARE * z * decay) / (1 + over * decay) ** 2
    leave = leave + apron.need * (2 * apron.height * rest / np.maximum(apron.width, TINY) - leave)
    fall = fall + leaving * (leave - fall)
    z = np.where(beyond, z + apron.need * (apron.height * rest**2 - z), z)
    lift = np.where(beyond, apron.need * apron.lift * rest**2, lift)
    lift = np.where(b.has, lift, 1.0)
    follows = lift * np.where(beyond, 1.0, 1 - leaving)
    held = 1 - smoothstep((b.ds / np.maximum(b.end + apron.width, THINNEST_M) - HELD_FRACTION) / (1 - HELD_FRACTION))
    sign = np.where(near.height < 0, -1.0, 1.0)
    sloping = b.has & (near.distance > params[STROKE_AT["plateau"]]) & ~inside
    down = np.where(sloping, lift * near.rate - sign * fall, 0.0)
    near_weight = nearness(b, tables)
    fade = np.where(b.hard, 1.0, b.present * (1 - free))
    toe_fade = np.where(b.has, b.present * (1 - smoothstep((rt - 1) / (toe_end - 1))), 0.0)
    unit = down / np.maximum(near.distance, 0.5)
    rise = np.where(inside, 0.0, lift / s)
    inner = np.where(b.hard, 1.0, np.maximum(1 - r, 0.0) ** 2 + TINY)
    return Band(
        reached=b.within & (b.hard | (b.has & (rt < toe_end))),
        hard=b.hard,
        weight=near_weight * (fade * inner + np.where(beyond, SLIGHT * held, 0.0)),
        toe_weight=near_weight * toe_fade * np.maximum(1 - rt / toe_end, 0.0) ** 2,
        target=sign * z,
        stiffness=(SPRING_CELLS * s / wide) ** 2,
        fade=fade,
        held=np.where(b.hard, 1.0, b.present * held),
        toe_fade=toe_fade,
        gx=unit * near.rx + rise * near.along_x,
        gy=unit * near.ry + rise * near.along_y,
        follows=follows,
    )


def channel_section(near: Nearest, inside: Mask, params: Floats, tables: Tables) -> tuple[Floats, Floats]:
    """How far samples know what one stroke says of a channel, 0..1, and the weight of that (DESIGN 5.4)."""
    s = tables.spacing_m
    b = flanks_of(near, inside, params, s)
    r = b.ds / np.maximum(b.end, CHANNEL_FLOOR_CELLS * s)
    known = np.where(b.hard, 1.0, b.present * (1 - smoothstep((r - 1) / (TOE - 1))))
    known = np.where(b.within, known, 0.0)
    outer = np.where(b.hard, 1.0, np.maximum(1 - r / TOE, 0.0) ** 2)
    return known, known * nearness(b, tables) * outer


def brush_section(near: Nearest, params: Floats) -> Floats:
    """How far samples know what one brush has painted: 1 on its line, nothing at its radius (DESIGN 5.4)."""
    return 1 - smoothstep(near.distance / params[STROKE_AT["brush"]])
