"""The server's selection against plain geometry (SPEC Q1 to Q5)."""

from __future__ import annotations

import math
import random

import numpy as np
import pytest
from numpy.typing import NDArray

from esker import grid
from esker.contract import View
from esker.tiles.bounds import Bounds
from esker.tiles.pyramid import Pyramid
from esker.tiles.quadtree import select

SIZE_M = 4096.0
LEVELS = 4


def ground(level: int, rough: float) -> NDArray[np.float32]:
    n = grid.samples(LEVELS)
    y, x = np.mgrid[0:n, 0:n] * (SIZE_M / (n - 1))
    ridge = 400 * np.exp(-(((x - 1500 - 0.3 * y) / 120) ** 2)) + rough * np.sin(x / 9) * np.sin(y / 11)
    return np.asarray(ridge[:: 1 << (LEVELS - level), :: 1 << (LEVELS - level)], dtype=np.float32)


def pyramid(rough: float = 6.0, flat: bool = False) -> Pyramid:
    made = Pyramid(SIZE_M, LEVELS)
    for level in range(LEVELS + 1):
        h = ground(level, rough)
        made.settle(1, level, np.full_like(h, 12.0) if flat else h)
    return made


ROUGH = pyramid()
BOUNDS = ROUGH.bounds()


def a_view(seed: int) -> View:
    rng = random.Random(seed)
    eye = (rng.uniform(-3000, 7000), rng.uniform(-3000, 7000), rng.uniform(2, 3000))
    target = (rng.uniform(0, 4096), rng.uniform(0, 4096), rng.uniform(-100, 600))
    size = rng.choice([(1024, 768), (360, 800), (2560, 1080)])
    tau = rng.choice([0.5, 1.5, 6.0])
    return View(eye=eye, target=target, fov_deg=rng.uniform(20, 90), width=size[0], height=size[1], tau_px=tau)


def counts(bounds: Bounds, view: View) -> list[int]:
    return [int(m.sum()) for m in select(bounds, view)[0]]


@pytest.mark.parametrize("seed", range(40))
def test_selection_is_closed_under_parents_and_restricted_across_corners(seed: int) -> None:
    masks, _ = select(BOUNDS, a_view(seed))
    for level in range(1, LEVELS + 1):
        side = 1 << (level - 1)
        for y, x in np.argwhere(masks[level]):
            py, px = y >> 1, x >> 1
            for ny in range(max(0, py - 1), min(side, py + 2)):
                for nx in range(max(0, px - 1), min(side, px + 2)):
                    assert masks[level - 1][ny, nx], (level, x, y)


def seen(view: View, points: NDArray[np.float64]) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    """Which points project into the picture, and how many pixels a metre is there (by distance)."""
    eye, target = np.array(view.eye), np.array(view.target)
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, [0, 0, 1])
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    d = points - eye
    depth = d @ forward
    t = math.tan(math.radians(view.fov_deg) / 2)
    inside = (depth > 0) & (np.abs(d @ up) <= t * depth) & (np.abs(d @ right) <= t * depth * view.width / view.height)
    return inside, view.height / (2 * t) / np.linalg.norm(d, axis=1)


@pytest.mark.parametrize("seed", range(25))
def test_no_visible_error_is_left_out(seed: int) -> None:
    view = a_view(seed)
    masks, _ = select(BOUNDS, view)
    for level in range(3, LEVELS + 1):
        s = grid.spacing(level, SIZE_M)
        mine, parent = ROUGH.level(level), ROUGH.level(level - 1)
        assert mine is not None
        assert parent is not None
        step = 3
        rows = np.arange(1, mine.samples.shape[0] - 1, step)
        q = grid.quantum(level, SIZE_M)
        h = mine.samples[np.ix_(rows, rows)] * q
        p = parent.samples * 2.0 * q
        lo, hi = rows // 2, (rows + 1) // 2
        drawn = (p[np.ix_(lo, lo)] + p[np.ix_(lo, hi)] + p[np.ix_(hi, lo)] + p[np.ix_(hi, hi)]) / 4
        gy, gx = np.meshgrid(rows * s, rows * s, indexing="ij")
        inside, scale = seen(view, np.stack([gx.ravel(), gy.ravel(), h.ravel()], axis=1))
        off, cell = np.abs(h - drawn).ravel(), 2 * s * scale
        lit = (off > 1.5 / 256 * 2 * s) & (cell > 5 * view.tau_px)
        needed = inside & (cell > view.tau_px) & ((off * scale > view.tau_px) | lit)
        ty, tx = np.minimum(gy // (s * 64), 2**level - 1), np.minimum(gx // (s * 64), 2**level - 1)
        assert masks[level][ty.ravel()[needed].astype(int), tx.ravel()[needed].astype(int)].all()


def test_near_views_are_refined_and_far_ones_less() -> None:
    near = counts(BOUNDS, View(eye=(1500, 900, 120), target=(1600, 1600, 200)))
    far = counts(BOUNDS, View(eye=(2048, -60000, 30000), target=(2048, 2048, 0)))
    assert near[4] > 10
    assert near[4] < 256
    assert far[3:] == [0, 0]
    behind = counts(BOUNDS, View(eye=(1500, 6000, 120), target=(1600, 9000, 200)))
    assert behind == [1, 4, 16, 0, 0]


def test_flat_ground_is_never_refined() -> None:
    flat = pyramid(flat=True).bounds()
    for eye in ((2000.0, 2000.0, 13.0), (2000.0, 2000.0, 12.0), (0.0, 0.0, 500.0)):
        assert counts(flat, View(eye=eye, target=(2100, 2100, 12), tau_px=0.25)) == [1, 4, 16, 0, 0]


@pytest.mark.parametrize(
    "view",
    [
        View(eye=(100, 100, 100), target=(100, 100, 100)),
        View(eye=(2048, 2048, 3000), target=(2048, 2048, 0)),
        View(eye=(2048, 2048, -3000), target=(2048, 2048, 0)),
        View(eye=(6.5e5, 6.5e5, 6.5e5), target=(-6.5e5, 0, 0), width=1, height=16384, fov_deg=169),
    ],
)
def test_levels_0_to_2_come_with_every_camera(view: View) -> None:
    masks, errors = select(BOUNDS, view)
    assert all(m.all() for m in masks[:3])
    assert all(np.isfinite(e).all() for e in errors)


def test_looking_plumb_down_selects_below_the_eye() -> None:
    masks, _ = select(BOUNDS, View(eye=(1500, 1000, 700), target=(1500, 1000, 0)))
    assert masks[4][3, 5]
    assert not masks[4][15, 15]


@pytest.mark.parametrize("seed", range(15))
def test_a_greater_tau_never_selects_more(seed: int) -> None:
    view = a_view(seed)
    fine = select(BOUNDS, view.model_copy(update={"tau_px": 0.5}))[0]
    coarse = select(BOUNDS, view.model_copy(update={"tau_px": 3.0}))[0]
    assert all((f | ~c).all() for f, c in zip(fine, coarse, strict=True))
