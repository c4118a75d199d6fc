"""The synthesis of detail in WGSL against its NumPy twin, and what holds among slots (SPEC R9, R26 to R31)."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise, product
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from bench.room._slots import HELD, SLOT, Job, child_of
from esker.contract import fractal
from esker.synthesis.site import BORDER, Site, tile_window
from esker.synthesis.state import State, unpack
from esker.synthesis.subdivide import Samples, interpolated, root, subdivide
from tests.gpu.land import (
    SIZE,
    Land,
    Tile,
    around,
    disagreements,
    fixed,
    hills,
    lineage,
    painted,
    site_of,
    surveyed,
    with_ancestors,
)

TOP = 12
ULP = 2.0**-23
UNORM = 1 / 65535


def twins(site: Site, tiles: list[Tile]) -> list[Samples]:
    """The twin's samples of each tile of a lineage."""
    made = [root(site)]
    for tile in tiles[1:]:
        made.append(subdivide(made[-1], tile_window(*tile), site))
    return made


def assert_same_state(words: NDArray[np.uint32], twin: Samples, cell: float, rounding: float, level: int) -> None:
    """d within a thousandth of the cell, or what float32 gives there; channels within a few units.

    More where the ground is so fine that its slopes are made of rounding.
    """
    got = unpack(words)
    assert np.abs(got.d - twin.state.d).max() <= max(1e-3 * cell, rounding)
    # Rounding of heights over the cell is what slopes are wrong by.
    slack = 3 * UNORM + 0.3 * rounding / cell
    for name in State._fields[1:]:
        scale = 2 if name == "h" else 1
        assert np.abs(getattr(got, name) - getattr(twin.state, name)).max() <= scale * slack, (level, name)


PATHS = ([(1, 0), (0, 1)] * 6, [(1, 1)] * TOP, [(0, 0)] * TOP, [(1, 1), (0, 0), (0, 0), (1, 1), (0, 1)] + [(1, 0)] * 7)


@pytest.mark.parametrize("path", range(len(PATHS)))
def test_detail_is_that_of_the_twin_through_twelve_levels(path: int) -> None:
    """R26: guide, detail and channels, along borders and corners of the domain and inside of it."""
    site = site_of()
    tiles = lineage(PATHS[path])
    land = Land(site, tiles)
    rounding = 8 * ULP * 512
    for tile, twin in zip(tiles, twins(site, tiles), strict=True):
        cell = site.spacing(tile[0])
        ground = land.maker.ground(land.slots[tile])
        assert np.abs(ground[..., 0] - twin.guide).max() <= rounding * (tile[0] > site.solved)
        assert_same_state(land.maker.state(land.slots[tile]), twin, cell, rounding, tile[0])
        shown = land.maker.texels("heights", land.slots[tile])
        wanted = twin.guide + twin.state.d
        assert np.abs(shown - wanted).max() <= max(1e-3 * cell, rounding)


VARIANTS: dict[str, dict[str, Any]] = {
    "smooth": {"rule": "smooth"},
    "plain": {"rule": "plain", "look": "alpine"},
    "desert": {"look": "desert", "detail": 4.0, "sea_level_m": None},
    "paper": {"look": "paper", "seed": 0, "detail": 0.25},
    "strokes": {"channels": painted(5)},
    "strokes on smooth": {"channels": painted(6), "rule": "smooth"},
    "strokes on plain": {
        "channels": {k: v for k, v in painted(7).items() if k in ("snow", "roughness")},
        "rule": "plain",
    },
    "surveyed": {"channels": surveyed(9)},
    "surveyed under strokes": {"channels": painted(9) | surveyed(9)},
    "cyclic": {"cyclic": True, "channels": painted(8)},
    "one level": {"solved": 0},
    "gullies": {"erosion": 1.5, "erosion_scale": 8.0, "hold": 0.5, "channels": fixed(4) | surveyed(4)},
    "gullies by paint alone": {"channels": {"erosion": fixed(5)["erosion"]}},
    "gullies of a cyclic domain": {"erosion": 1.0, "cyclic": True, "channels": painted(6)},
    "laid without a place": {"sea_level_m": None, "ground_m": (120.0, 1500.0)},
}


@pytest.mark.parametrize("name", VARIANTS)
def test_every_rule_look_and_channel_is_that_of_the_twin(name: str) -> None:
    """R26: the three rules, looks, strengths, painted channels, cyclic domains."""
    site = site_of(**VARIANTS[name])
    tiles = lineage([(1, 0), (0, 1), (0, 0), (1, 1)])
    land = Land(site, tiles)
    rounding = 8 * ULP * 512
    for tile, twin in zip(tiles, twins(site, tiles), strict=True):
        ground = land.maker.ground(land.slots[tile])
        assert np.abs(ground[..., 0] - twin.guide).max() <= rounding
        assert_same_state(land.maker.state(land.slots[tile]), twin, site.spacing(tile[0]), rounding, tile[0])


def test_ground_that_nobody_holds_is_interpolated_by_the_rule() -> None:
    """R26: 4-point for `landscape`, B-spline for `smooth`; the guide is 4-point for both."""
    for rule in ("landscape", "smooth"):
        site = site_of(solved=1, rule=rule)
        tiles = lineage([(0, 1), (1, 1), (1, 0), (0, 1)])
        land = Land(site, tiles)
        base = site.guide(tile_window(*tiles[1]))
        for before, tile in pairwise(tiles[1:]):
            base = interpolated(base, tile_window(*before), tile_window(*tile), rule)
            assert np.abs(land.maker.ground(land.slots[tile])[..., 1] - base).max() < 8 * ULP * 512


def test_slots_agree_to_the_bit_through_twelve_levels() -> None:
    """R27: edges, corners and borders, of siblings and of tiles whose parents, and all ancestors, differ."""
    site = site_of(channels=painted(3) | surveyed(3))
    corners = [tile for level in range(1, TOP + 1) for tile in around(level, 1 << (level - 1), 1 << (level - 1))]
    # Along the western border of the domain too, and amid one lineage: siblings and cousins.
    corners += [(level, 0, (1 << (level - 1)) + dy) for level in range(1, TOP + 1) for dy in (-1, 0)]
    corners += around(9, 171, 85) + around(12, 1365, 683)
    land = Land(site, with_ancestors(corners))
    assert disagreements(land) == 0
    # The comparison does see a difference: other noise in one slot.
    land.maker.configure(replace(site, seed=7))
    land.maker.run([land.job((TOP, 1 << (TOP - 1), 1 << (TOP - 1)))])
    assert disagreements(land) > 1000


def test_a_cyclic_domain_meets_itself() -> None:
    """R27: the eastern edge is the western one, the northern the southern."""
    site = site_of(cyclic=True, channels=painted(4))
    ends = [(level, (0, (1 << level) - 1)) for level in range(1, 6)]
    land = Land(site, with_ancestors((level, x, y) for level, both in ends for x, y in product(both, both)))
    for level in range(1, 6):
        last = (1 << level) - 1
        east, west = land.everything((level, last, 0)), land.everything((level, 0, 0))
        assert np.array_equal(east[:, 64:], west[:, : SLOT - 64])
        north = land.everything((level, 0, last))
        assert np.array_equal(north[64:], west[: SLOT - 64])


def scattered(seed: int) -> tuple[Site, set[Tile], dict[Tile, NDArray[np.float32]]]:
    """A terrain with a random choice of refined tiles held, each a bit off what its parent says."""
    rng = np.random.default_rng(seed)
    site = site_of(solved=1)
    tiles = with_ancestors((5, x, y) for x in range(11, 15) for y in range(13, 17))
    tiles |= with_ancestors((5, 0, y) for y in range(13, 17))
    held = {}
    for level, x, y in sorted(tiles):
        if level > 1 and rng.random() < 0.45:
            exact = hills(level)[64 * y : 64 * y + 65, 64 * x : 64 * x + 65]
            held[level, x, y] = (exact + rng.normal(0, 2.0, exact.shape)).astype(np.float32)
    return site, tiles, held


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_held_and_synthetic_tiles_share_their_edges(seed: int) -> None:
    """R28: whatever is held, slots agree; held samples stay as they are, beside them the parent's ground goes on."""
    site, tiles, held = scattered(seed)
    land = Land(site, tiles, held)
    assert disagreements(land) == 0
    for tile in held:
        base = land.maker.ground(land.slots[tile])[..., 1]
        core = base[BORDER + 1 : SLOT - BORDER - 1, BORDER + 1 : SLOT - BORDER - 1]
        assert np.array_equal(core, held[tile][1:-1, 1:-1])
    # The detail does not know what is held.
    bare = Land(site, tiles)
    for tile in tiles:
        assert np.array_equal(land.maker.state(land.slots[tile]), bare.maker.state(bare.slots[tile]))
        guide = land.maker.ground(land.slots[tile])[..., 0]
        assert np.array_equal(guide, bare.maker.ground(bare.slots[tile])[..., 0])


def test_composing_is_making_without_the_detail() -> None:
    """R28: ground that moved above the solved levels: the same bits, from the cheap pass."""
    site, tiles, held = scattered(9)
    land = Land(site, tiles, held)
    moved = {tile: (heights + 3.0).astype(np.float32) for tile, heights in held.items()}
    fresh = Land(site, tiles, moved)
    land.held = moved
    for job in land.jobs:
        if job.level > site.solved:
            land.upload(job)
    land.maker.run([job for job in land.jobs if job.level > site.solved], "compose")
    for tile in tiles:
        assert np.array_equal(land.everything(tile), fresh.everything(tile))
    # The root too: its heights stay.
    before = land.everything((0, 0, 0))
    land.maker.run([land.job((0, 0, 0))], "compose")
    assert np.array_equal(before, land.everything((0, 0, 0)))


def test_the_same_bits_in_any_slot_order_and_batch() -> None:
    """R29: nothing but place, level, ground and settings counts."""
    site = site_of(channels=painted(2))
    tiles = with_ancestors((6, x, y) for x in range(30, 34) for y in (20, 21))
    first, second = Land(site, tiles), Land(site, tiles)
    wanted = {tile: first.everything(tile) for tile in tiles}
    # Again, tile by tile and into other slots.
    second.slots = {tile: 299 - slot if slot else 0 for tile, slot in first.slots.items()}
    for tile in sorted(tiles):
        job = second.job(tile)
        second.upload(job)
        second.maker.run([job])
    assert all(np.array_equal(wanted[tile], second.everything(tile)) for tile in tiles)
    assert child_of(Job(3, 1, 1, 0), 9, 1, 1) == Job(9, 2, 3, 1, 3, 0)


HOSTILE: dict[str, dict[str, Any]] = {
    "spikes": {"detail": 4.0},
    "wild channels": {
        "channels": {"amplitude": 1000 * painted(1)["amplitude"], "roughness": np.ones((2, 2), np.float32)}
    },
    "no detail": {"detail": 0.0, "look": "desert"},
}


@pytest.mark.parametrize("name", HOSTILE)
@pytest.mark.parametrize("rule", ["landscape", "smooth", "plain"])
def test_no_nan_or_infinity(name: str, rule: str) -> None:
    """R9: spikes, deep holes, flat ground, wild channels."""
    rng = np.random.default_rng(4)
    guide = np.where(rng.random((65, 65)) < 0.3, rng.normal(0, 3.0e4, (65, 65)), 0.0).astype(np.float32)
    site = Site(SIZE, 1, (guide,), rule=rule, sea_level_m=0.0, **HOSTILE[name])
    tiles = lineage([(1, 1), (0, 0), (1, 0), (0, 1), (1, 1), (1, 1), (0, 1), (1, 0)])
    land = Land(site, tiles)
    for tile in tiles:
        slot = land.slots[tile]
        assert np.isfinite(land.maker.ground(slot)).all()
        assert np.isfinite(land.maker.texels("heights", slot)).all()
        state = unpack(land.maker.state(slot))
        assert all(np.isfinite(channel).all() for channel in state)
        if name == "no detail" or rule != "landscape":
            assert not state.d.any()


def test_a_level_adds_no_more_than_its_bound() -> None:
    """R30: |d - B(d of the parent)| <= A 2^(-level H), H at least the least exponent: boxes may grow by that."""
    site = site_of(channels={"roughness": np.ones((2, 2), np.float32)}, detail=4.0)
    tiles = lineage([(1, 0), (0, 1)] * 4)
    land = Land(site, tiles)
    made = [unpack(land.maker.state(land.slots[tile])).d for tile in tiles]
    for up, tile, d in zip(made, tiles[1:], made[1:], strict=False):
        level, x, y = tile
        p = np.arange(0, 65, 2) // 2 + BORDER
        r, c = p + 32 * (y & 1), p + 32 * (x & 1)
        rows = (up[r - 1] + 6 * up[r] + up[r + 1]) / 8
        smooth = (rows[:, c - 1] + 6 * rows[:, c] + rows[:, c + 1]) / 8
        added = np.abs(d[BORDER : SLOT - BORDER : 2, BORDER : SLOT - BORDER : 2] - smooth).max()
        rounding = 4 * ULP * np.abs(up).max()
        assert added <= site.amplitude_m * 2.0 ** (-fractal.H_RANGE[0] * level) + rounding
        assert added > 0


@pytest.mark.parametrize(("detail", "erosion"), [(0.25, 0.0), (1.0, 0.0), (4.0, 0.0), (1.0, 1.0), (0.0, 2.0)])
def test_bounds_of_sub_patches(detail: float, erosion: float) -> None:
    """R30, F206: lowest, highest and error against the parent's drawn surface; room for what children add."""
    site = site_of(solved=1, detail=detail, erosion=erosion)
    tiles = with_ancestors((4, x, y) for x in range(4, 8) for y in (8, 9)) | with_ancestors(
        [(9, 200, 300), (9, 201, 300)]
    )
    land = Land(site, tiles)
    found = dict(zip(sorted(tiles), land.maker.bounds(land.jobs), strict=True))
    shown = {tile: land.maker.texels("heights", land.slots[tile]) for tile in tiles}
    for (level, x, y), got in found.items():
        heights = shown[level, x, y][BORDER : SLOT - BORDER, BORDER : SLOT - BORDER]
        error = np.zeros_like(heights)
        if level:
            error = np.abs(heights - drawn_parent(shown[level - 1, x // 2, y // 2], x & 1, y & 1))
        for j in range(4):
            for i in range(4):
                part = slice(16 * j, 16 * j + 17), slice(16 * i, 16 * i + 17)
                assert got[j, i, 0] == heights[part].min()
                assert got[j, i, 1] == heights[part].max()
                assert got[j, i, 2] == error[part].max()
        for east, north in ((0, 0), (1, 0), (0, 1), (1, 1)):
            child = found.get((level + 1, 2 * x + east, 2 * y + north))
            # Children that are held bring bounds of their own.
            if child is not None and level >= site.solved:
                room = got[2 * north : 2 * north + 2, 2 * east : 2 * east + 2, 3]
                worst = child[..., 2].reshape(2, 2, 2, 2).max(axis=(1, 3))
                assert (worst <= room).all()
                assert (worst >= (0.05 if erosion else 0.3) * room).all()


def drawn_parent(samples: NDArray[np.float32], east: int, north: int) -> NDArray[np.float32]:
    """The parent's surface at the 65 x 65 samples of a child: `parent_height` of ground/patch.wgsl."""
    at = np.arange(65)
    low, odd = at >> 1, at & 1
    rows, cols = low + 32 * north + BORDER, low + 32 * east + BORDER
    one = samples[np.ix_(rows, cols + odd)]
    two = samples[np.ix_(rows + odd, cols)]
    return np.asarray(np.float32(0.5) * (one + two), np.float32)


def test_attribute_texels_show_the_state() -> None:
    """R31: rgba8 of snow, wet, foam, h / 2 and of grass, forest, the level's noise, the size of the next level's."""
    site = site_of()
    tiles = lineage([(0, 1), (1, 1), (1, 0)])
    land = Land(site, tiles)
    slot = land.slots[tiles[-1]]
    state = unpack(land.maker.state(slot))
    first = land.maker.texels("attributes0", slot) / 255.0
    second = land.maker.texels("attributes1", slot) / 255.0
    half = 0.5 / 255 + 1e-4
    for k, channel in enumerate((state.snow, state.wet, state.foam, state.h / 2)):
        assert np.abs(first[..., k] - channel).max() <= half
    for k, channel in enumerate((state.grass, state.forest)):
        assert np.abs(second[..., k] - channel).max() <= half
    assert abs(second[..., 2].mean() - 0.5) < 0.02
    assert second[..., 2].std() > 0.25


def test_held_masks_name_all_nine() -> None:
    """R28: the mask of a tile amid solved ones is full; at the domain's corner four tiles are there."""
    land = Land(site_of(), lineage([(0, 0), (1, 1)]))
    assert land.mask(2, 1, 1) == HELD
    assert bin(land.mask(2, 0, 0)).count("1") == 4
