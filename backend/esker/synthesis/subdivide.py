"""The detail of a terrain, level by level, in NumPy (docs/synthesis.md): the twin that every kernel is compared with.

What a sample gets is a function of the guide, the channels and the settings alone, so windows of any size, made apart,
agree bit for bit where they overlap.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from esker import grid
from esker.contract import MAX_SYNTHESIS_LEVEL, fractal
from esker.synthesis.interpolate import (
    B_SPLINE,
    DERIVATIVE,
    FOUR_POINT,
    SECOND,
    Window,
    along_x,
    along_y,
    upsampled,
)
from esker.synthesis.rules import RULES
from esker.synthesis.rules.landscape import landscape_relief
from esker.synthesis.rules.targets import lie, relief_targets, targets
from esker.synthesis.site import BORDER, Ground, Site
from esker.synthesis.state import Array, Relief, State, stored, stored_relief


class Samples(NamedTuple):
    """Guide heights (metres, float32 values) and state of a window, both in the site's dtype."""

    window: Window
    guide: Array
    state: State


def finest_level(size_m: float) -> int:
    """The coarsest level whose cells are no larger than a centimetre, but MAX_SYNTHESIS_LEVEL at most."""
    return min(MAX_SYNTHESIS_LEVEL, max(0, int(np.ceil(np.log2(size_m / grid.cells(0) / fractal.FINEST_CELL_M)))))


def root(site: Site, window: Window | None = None) -> Samples:
    """Level 0: the rule on the guide itself, whose missing parent is replaced by constants and targets.

    The window is the whole level with its border if none is given. In a bounded domain derivatives end at the border,
    where indices are clamped.
    """
    window = window or whole(0)
    ground = _root_ground(site, window)
    mid, t = ground.height, targets(site, ground)
    before = State(np.zeros_like(mid), np.full_like(mid, fractal.SMOOTHNESS), *t[1:])
    state = RULES[site.rule](site, ground, before, window, site.biases(window))
    return Samples(window, mid, stored(state))


def _root_ground(site: Site, window: Window) -> Ground:
    near = Window(0, window.r0 - 1, window.r1 + 1, window.c0 - 1, window.c1 + 1)
    if site.cyclic:
        z = site.guide(near)
    else:
        last = grid.cells(0) + BORDER
        rows, cols = (np.clip(a, -BORDER, last) + BORDER for a in (near.rows, near.cols))
        z = site.guide(whole(0))[np.ix_(rows, cols)]
    s = site.spacing(0)
    mid = z[1:-1, 1:-1]
    gx = (z[1:-1, 2:] - z[1:-1, :-2]) / (2 * s)
    gy = (z[2:, 1:-1] - z[:-2, 1:-1]) / (2 * s)
    c = (z[1:-1, :-2] - 2 * mid + z[1:-1, 2:]) / s + (z[:-2, 1:-1] - 2 * mid + z[2:, 1:-1]) / s
    return Ground(0, mid, gx, gy, np.clip(fractal.CONCAVITY_SCALE * c, -1, 1), np.sqrt(gx * gx + gy * gy))


def subdivide(parent: Samples, window: Window, site: Site) -> Samples:
    """The samples of a window of the next level. Raises ValueError where ``parent`` does not hold ``window.parent()``.

    The guide is the site's where that level was solved, else interpolated.
    """
    if window.level != parent.window.level + 1:
        raise ValueError(f"level {window.level} is not made from level {parent.window.level}")
    window.parent().within(parent.window)
    guide = _guide(parent.guide, parent.window, window, site)
    ground = _ground(parent.guide, parent.state.d, parent.window, window, site)
    before = State(*(upsampled(x, B_SPLINE, parent.window, window) for x in parent.state))
    state = RULES[site.rule](site, ground, before, window, site.biases(window))
    return Samples(window, guide, stored(state))


def _guide(above: Array, at: Window, window: Window, site: Site) -> Array:
    return site.guide(window) if window.level <= site.solved else interpolated(above, at, window)


def interpolated(z: Array, parent: Window, child: Window, rule: str = "landscape") -> Array:
    """Heights that were not solved: 4-point, or B-spline for the base of rule ``smooth``; float32 after each axis."""
    taps = B_SPLINE if rule == "smooth" else FOUR_POINT
    across = along_x(z, taps, parent, child).astype(np.float32).astype(z.dtype)
    return along_y(across, taps, parent, child).astype(np.float32).astype(z.dtype)


def _ground(guide: Array, d: Array, at: Window, window: Window, site: Site) -> Ground:
    """The ground of ``window`` from its parent's guide and detail in ``at``."""
    z, s = guide + d, site.spacing(at.level)
    b, d, l2 = (along_x(z, taps, at, window) for taps in (B_SPLINE, DERIVATIVE, SECOND))
    height = along_y(b, B_SPLINE, at, window)
    gx = along_y(d, B_SPLINE, at, window) / s
    gy = along_y(b, DERIVATIVE, at, window) / s
    c = (along_y(l2, B_SPLINE, at, window) + along_y(b, SECOND, at, window)) / s
    guide_x = along_y(along_x(guide, DERIVATIVE, at, window), B_SPLINE, at, window) / s
    guide_y = along_y(along_x(guide, B_SPLINE, at, window), DERIVATIVE, at, window) / s
    steep = np.sqrt(guide_x * guide_x + guide_y * guide_y)
    return Ground(window.level, height, gx, gy, np.clip(fractal.CONCAVITY_SCALE * c, -1, 1), steep)


def whole(level: int) -> Window:
    """All samples of a level with the border of its outermost tiles."""
    return Window(level, -BORDER, grid.cells(level) + 1 + BORDER, -BORDER, grid.cells(level) + 1 + BORDER)


def chain(window: Window) -> list[Window]:
    """The windows of levels 0, 1, ... from which a window is made, itself last."""
    windows = [window]
    while windows[0].level > 0:
        windows.insert(0, windows[0].parent())
    return windows


def levels(site: Site, top: int) -> list[Samples]:
    """Whole levels 0..``top`` with their borders."""
    out = [root(site)]
    for level in range(1, top + 1):
        out.append(subdivide(out[-1], whole(level), site))
    return out


def detail(site: Site, window: Window) -> Samples:
    """The samples of a window of any level, through windows of all levels above it, at what the window costs."""
    first, *rest = chain(window)
    samples = root(site, first)
    for w in rest:
        samples = subdivide(samples, w, site)
    return samples


def relief(site: Site, window: Window) -> Array:
    """The detail d of a window, metres: that of ``detail`` to the bit, without the channels that heights do not follow
    from, for half of the time. Its memory is that of a few windows."""
    if site.rule != "landscape":
        return np.zeros(window.shape, dtype=site.dtype)
    at, *rest = chain(window)
    ground = _root_ground(site, at)
    guide = ground.height
    snow = relief_targets(site, ground, lie(site, ground))[1]
    before = Relief(np.zeros_like(guide), np.full_like(guide, fractal.SMOOTHNESS), snow)
    state = stored_relief(landscape_relief(site, ground, before, at, site.biases(at)))
    for w in rest:
        ground = _ground(guide, state.d, at, w, site)
        before = Relief(*(upsampled(x, B_SPLINE, at, w) for x in state))
        state = stored_relief(landscape_relief(site, ground, before, w, site.biases(w)))
        guide, at = _guide(guide, at, w, site), w
    return state.d
