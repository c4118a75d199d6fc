"""Gradients, curvature, sun and sky visibility of tiles against NumPy twins (SPEC R9, R12, R13)."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.gpu.device import BORDER, HEIGHTS, READ, SLOT, TinyAtlas, job_list, page_table, source, store, sun_list

SIZE = 4096.0
Field = Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]]
Tile = tuple[int, int, int]
FLOATS = NDArray[np.float64]


def hills(x: FLOATS, y: FLOATS) -> FLOATS:
    """A smooth ground with a sharp ridge."""
    ridge = 500.0 * np.maximum(0.0, 1.0 - np.abs(x - 1900.0 - 0.2 * y) / 600.0)
    return ridge + 60.0 * np.sin(x / 180.0) * np.cos(y / 230.0)


def slot_samples(tile: Tile, field: Field) -> NDArray[np.float32]:
    """The 69 x 69 samples of a tile, border from the same field."""
    level, tx, ty = tile
    cell = SIZE / (64 << level)
    i = np.arange(-BORDER, SLOT - BORDER)
    x, y = np.meshgrid((tx * 64 + i) * cell, (ty * 64 + i) * cell)
    return field(x, y).astype(np.float32)


def normals(atlas: TinyAtlas, slots: dict[Tile, int]) -> None:
    jobs = [(slot, *tile) for tile, slot in slots.items()]
    bindings = [
        (READ, atlas.buffer(job_list(SIZE, jobs))),
        (HEIGHTS, atlas.view(atlas.heights)),
        (store("rgba16float"), atlas.view(atlas.slopes)),
    ]
    atlas.run(source("tiles/tile", "tiles/normals"), "compute_normals", bindings, len(jobs))


def sunlight(atlas: TinyAtlas, slots: dict[Tile, int], high: float, sun: tuple[float, float, float, float]) -> None:
    pages = page_table(slots)
    jobs = [(slot, *tile) for tile, slot in slots.items()]
    bindings = [
        (READ, atlas.buffer(sun_list(SIZE, high, sun, jobs))),
        (HEIGHTS, atlas.view(atlas.heights)),
        (READ, atlas.buffer(pages)),
        (store("rgba8unorm"), atlas.view(atlas.light)),
    ]
    atlas.run(source("tiles/tile", "tiles/pages", "tiles/sun"), "compute_sun", bindings, len(jobs))


def sun_vector(azimuth_deg: float, elevation_deg: float) -> tuple[float, float, float, float]:
    a, e = math.radians(azimuth_deg), math.radians(elevation_deg)
    return math.sin(a) * math.cos(e), math.cos(a) * math.cos(e), math.sin(e), 0.02


def place(field: Field, tiles: list[Tile]) -> tuple[TinyAtlas, dict[Tile, int]]:
    """An atlas with these tiles; slots scattered over both rows, so that a wrong address shows."""
    atlas = TinyAtlas()
    slots = {tile: 17 * k % 256 for k, tile in enumerate(tiles)}
    for tile, slot in slots.items():
        atlas.put(slot, slot_samples(tile, field))
    return atlas, slots


INNER = slice(BORDER - 1, SLOT - BORDER + 1)
CORE = slice(BORDER, SLOT - BORDER)


def test_gradients_match_their_twin() -> None:
    """R12: central differences and curvature to half-float precision, border ring included."""
    atlas, slots = place(hills, [(0, 0, 0), (2, 1, 2), (3, 4, 5)])
    normals(atlas, slots)
    for tile, slot in slots.items():
        h = slot_samples(tile, hills).astype(np.float64)
        cell = SIZE / (64 << tile[0])
        gx = np.zeros_like(h)
        gy = np.zeros_like(h)
        bend = np.zeros_like(h)
        gx[:, 1:-1] = (h[:, 2:] - h[:, :-2]) / (2 * cell)
        gy[1:-1] = (h[2:] - h[:-2]) / (2 * cell)
        bend[1:-1, 1:-1] = h[1:-1, 2:] + h[1:-1, :-2] + h[2:, 1:-1] + h[:-2, 1:-1] - 4 * h[1:-1, 1:-1]
        got = atlas.read(atlas.slopes, slot, np.float16, 4).astype(np.float64)
        assert np.isfinite(got[INNER, INNER]).all()
        for channel, twin in enumerate((gx, gy, bend / cell)):
            assert np.abs(got[INNER, INNER, channel] - twin[INNER, INNER]).max() < 2e-3


def test_neighbours_agree_on_their_edge() -> None:
    """R12, R13: a shared edge has the same gradient and light in both tiles, to the bit."""
    tiles = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (1, 0, 1), (1, 1, 1)]
    atlas, slots = place(hills, tiles)
    normals(atlas, slots)
    sunlight(atlas, slots, 600.0, sun_vector(115, 24))
    for texture, dtype in ((atlas.slopes, np.float16), (atlas.light, np.uint8)):
        west = atlas.read(texture, slots[1, 0, 0], dtype, 4)
        east = atlas.read(texture, slots[1, 1, 0], dtype, 4)
        north = atlas.read(texture, slots[1, 0, 1], dtype, 4)
        assert np.array_equal(west[CORE, SLOT - BORDER - 1], east[CORE, BORDER])
        assert np.array_equal(west[SLOT - BORDER - 1, CORE], north[BORDER, CORE])


def bilinear(samples: NDArray[np.float32], x: FLOATS, y: FLOATS) -> FLOATS:
    """Height of the level-0 tile at world positions, as `ground` reads it."""
    s = samples.astype(np.float64)
    u = np.clip(x / SIZE, 0, 0.999999) * 64
    v = np.clip(y / SIZE, 0, 0.999999) * 64
    i, j = u.astype(int), v.astype(int)
    fx, fy = u - i, v - j
    i, j = i + BORDER, j + BORDER
    south = s[j, i] * (1 - fx) + s[j, i + 1] * fx
    north = s[j + 1, i] * (1 - fx) + s[j + 1, i + 1] * fx
    return np.asarray(south * (1 - fy) + north * fy)


def sun_twin(samples: NDArray[np.float32], high: float, sun: tuple[float, float, float, float]) -> FLOATS:
    """`sun_visibility` of tiles/sun.wgsl for the core samples of the level-0 tile, in float64."""
    cell = SIZE / 64
    x, y = np.meshgrid(np.arange(65) * cell, np.arange(65) * cell)
    z0 = samples[CORE, CORE].astype(np.float64) + 0.02 * cell
    flat = math.hypot(sun[0], sun[1])
    dx, dy, rise = sun[0] / flat, sun[1] / flat, sun[2] / flat
    free = np.ones_like(z0)
    live = np.ones_like(z0, bool)
    t = cell
    for _ in range(60):
        px, py, z = x + dx * t, y + dy * t, z0 + rise * t
        live &= (z <= high) & (px >= 0) & (py >= 0) & (px <= SIZE) & (py <= SIZE)
        gap = (z - bilinear(samples, px, py)) / (t * sun[3] + 0.5 * cell * rise)
        free = np.where(live, np.minimum(free, 0.5 + 0.5 * gap), free)
        t += max(cell, t * 0.1)
    free = np.clip(free, 0, 1)
    return np.asarray(free * free * (3 - 2 * free))


@pytest.mark.parametrize(("azimuth", "elevation"), [(115.0, 24.0), (250.0, 8.0), (10.0, 60.0)])
def test_sun_visibility_matches_its_twin(azimuth: float, elevation: float) -> None:
    """R13: the march on the device is the march of the twin."""
    atlas, slots = place(hills, [(0, 0, 0)])
    sun = sun_vector(azimuth, elevation)
    sunlight(atlas, slots, 600.0, sun)
    got = atlas.read(atlas.light, slots[0, 0, 0], np.uint8, 4)[CORE, CORE, 0] / 255.0
    twin = sun_twin(slot_samples((0, 0, 0), hills), 600.0, sun)
    off = np.abs(got - twin)
    # A ray that grazes a sample's border may fall to either side in float32: a handful of samples.
    assert np.mean(off > 0.02) < 0.01
    assert off.mean() < 2e-3
    assert twin.min() == 0 if elevation < 30 else twin.min() > 0.2


def test_a_ridge_casts_a_shadow_of_the_right_length() -> None:
    """R13: height over tangent of the elevation, within four cells, also across tiles of a finer level."""
    high = 300.0

    def ridge(x: FLOATS, y: FLOATS) -> FLOATS:
        return high * np.maximum(0.0, 1.0 - np.abs(x - 2048.0) / 150.0) + 0.0 * y

    tiles = [(0, 0, 0), *((3, x, 4) for x in range(8)), *((2, x, 2) for x in range(4)), *((1, x, 1) for x in range(2))]
    atlas, slots = place(ridge, tiles)
    sunlight(atlas, slots, high, sun_vector(90, 30))
    cell = SIZE / (64 << 3)
    row = np.concatenate([atlas.read(atlas.light, slots[3, x, 4], np.uint8, 4)[20, CORE, 0][:-1] for x in range(8)])
    dark = np.flatnonzero(row < 128)
    west_end = 2048.0 - high / math.tan(math.radians(30))
    assert abs(dark.min() * cell - west_end) < 4 * cell
    # One shadow, without holes but for the penumbra at its tip.
    core = dark[dark * cell > west_end + 60]
    assert np.array_equal(core, np.arange(core.min(), core.max() + 1))
    assert row[(np.arange(row.size) * cell) < west_end - 120].min() > 250
    assert row[(np.arange(row.size) * cell) > 2200].min() > 250


def test_open_sky_on_a_plain_and_less_in_a_trench() -> None:
    """R13: openness is one on flat ground and falls with the depth of a trench."""

    def trench(x: FLOATS, y: FLOATS) -> FLOATS:
        return np.where(np.abs(x - 1024.0) < 70.0, -200.0, 0.0) + 0.0 * y

    atlas, slots = place(trench, [(0, 0, 0), *((1, x, y) for x in (0, 1) for y in (0, 1))])
    sunlight(atlas, slots, 0.0, sun_vector(115, 24))
    sky = atlas.read(atlas.light, slots[1, 0, 0], np.uint8, 4)[CORE, CORE, 1]
    assert sky[:, 50].min() == 255
    middle = sky[:, 32]
    # The ends of the trench lie on the border, where nothing stands against the sky.
    assert 20 < middle.min() <= middle[5:].max() < 200
