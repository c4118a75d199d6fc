"""Windows, tiles and kernels agree (SPEC F5, F6, F7, F8, F9)."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from esker import grid
from esker.contract import fractal
from esker.synthesis.detailed import Maker, NumpyMaker
from esker.synthesis.interpolate import B_SPLINE, Window, upsampled
from esker.synthesis.kernels import Kernels
from esker.synthesis.rules import RULES
from esker.synthesis.rules.landscape import amplitude
from esker.synthesis.site import Site, tile_window
from esker.synthesis.state import State, pack, unpack
from esker.synthesis.subdivide import Samples, chain, detail, levels, root, subdivide, whole
from tests.synthesis.sites import SIZE, TOP, channels, heights, hill, same
from tests.vectors import make_synthesis


@pytest.fixture(params=["twin", "kernels"])
def maker(request: pytest.FixtureRequest) -> Maker:
    return NumpyMaker() if request.param == "twin" else request.getfixturevalue("kernels")


def descend(site: Site, x: int, y: int, top: int) -> dict[tuple[int, int, int], Samples]:
    """Tiles with borders on the way to one tile, each made from its parent's slot alone, as the page makes them; at
    every level those beside it that have a parent."""
    made = {(0, 0, 0): root(site)}
    for level in range(1, top + 1):
        tx, ty = x >> (top - level), y >> (top - level)
        for ny in range(ty - 1, ty + 2):
            for nx in range(tx - 1, tx + 2):
                parent = made.get((level - 1, nx >> 1, ny >> 1))
                if parent is not None and 0 <= nx < 1 << level and 0 <= ny < 1 << level:
                    made[level, nx, ny] = subdivide(parent, tile_window(level, nx, ny), site)
    return made


@pytest.mark.parametrize(("x", "y"), [(1777, 2048), (0, 4095)])
def test_neighbouring_tiles_hold_the_same_bits_through_twelve_levels(x: int, y: int) -> None:
    """SPEC F5: on shared edges, corners and in each other's borders, siblings or children of other parents, and as any
    other window has them."""
    site = replace(hill(), channels=channels(), dtype=np.float32)
    made = descend(site, x, y, 12)
    compared = 0
    for (level, tx, ty), samples in made.items():
        a = samples.window
        for dx, dy in ((1, 0), (0, 1), (1, 1), (1, -1)):
            other = made.get((level, tx + dx, ty + dy))
            if other is None:
                continue
            b = other.window
            common = Window(level, max(a.r0, b.r0), min(a.r1, b.r1), max(a.c0, b.c0), min(a.c1, b.c1))
            at, there = common.within(a), common.within(b)
            assert np.array_equal(samples.guide[at], other.guide[there])
            assert same(samples.state, other.state, at, there), (level, tx, ty, dx, dy)
            compared += 1
    assert compared >= 12 * 6
    last = made[12, x, y]
    middle = Window(12, last.window.r0 + 20, last.window.r0 + 31, last.window.c0, last.window.c0 + 9)
    assert same(last.state, detail(site, middle).state, middle.within(last.window), (slice(None), slice(None)))


@pytest.mark.parametrize("level", [1, 4, 9, TOP])
def test_windows_made_apart_agree(maker: Maker, level: int) -> None:
    """SPEC F5."""
    site = replace(hill(channels=channels()), dtype=np.float32)
    n = grid.cells(level)
    for r, c in ((-2, n - 60), (n // 3, n // 2 - 3), (n + 3 - 70, -2)):
        a = Window(level, r, r + 70, c, min(c + 75, n + 3))
        b = Window(level, r + 13, r + 52, c + 7, c + 59)
        x, y = maker.detail(site, a), maker.detail(site, b)
        at = b.within(a)
        assert np.array_equal(x.guide[at], y.guide)
        assert same(x.state, y.state, at, (slice(None), slice(None)))


def test_a_cyclic_domain_meets_itself(maker: Maker) -> None:
    """SPEC F6: east and west edges, south and north, corners and borders hold the same bits through twelve levels."""
    site = Site(SIZE, 9, (heights(0, periodic=True), heights(1, periodic=True)), channels(), cyclic=True)
    for level in (0, 1, 2, 3, 6, 9, 12):
        n = grid.cells(level)
        for r, c in ((-2, -2), (n // 3, -2), (-2, n // 5)):
            near = maker.detail(site, Window(level, r, r + 5, c, c + 5))
            for dr, dc in ((0, n), (n, 0), (n, n)):
                far = maker.detail(site, Window(level, r + dr, r + dr + 5, c + dc, c + dc + 5))
                assert np.array_equal(near.guide, far.guide)
                assert np.array_equal(pack(near.state), pack(far.state))


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("place", [(1, -2, -2), (3, 200, 250), (7, 3000, 4000), (12, 90000, 118000), (TOP, 4000, -2)])
def test_kernels_are_the_twin(kernels: Kernels, rule: str, place: tuple[int, int, int]) -> None:
    """SPEC F7: the guide to the bit, d within 10^-3 of the cell, other channels within two units of their 16 bits."""
    level, r, c = place
    window = Window(level, r, r + 50, c, c + 45)
    for site in (
        hill(channels=channels(), rule=rule, sea_level_m=3.0),
        hill(rule=rule, look="alpine", detail=4.0, ground_m=(40.0, 1500.0)),
    ):
        twin, found = detail(site, window), kernels.detail(site, window)
        assert found.guide.dtype == np.float32
        assert np.array_equal(found.guide, twin.guide)
        assert np.abs(found.state.d - twin.state.d).max() <= 1e-3 * site.spacing(level)
        for name, unit in (("h", 2.0), ("snow", 1), ("wet", 1), ("grass", 1), ("forest", 1), ("foam", 1)):
            off = np.abs(getattr(found.state, name) - getattr(twin.state, name)).max()
            assert off <= 2.5 * unit / 65535, name
    assert (rule == "landscape") == bool(found.state.d.any())


def test_a_level_adds_no_more_than_its_bound() -> None:
    """SPEC F8: |d - B(parent's d)| <= A 2^(-level H_min), by which boxes grow until they are measured."""
    rough = channels() | {"roughness": np.ones((2, 2), dtype=np.float32)}
    site = hill(channels=rough, detail=4.0, look="paper")
    for level in range(1, 7):
        n = grid.cells(level)
        window = Window(level, int(0.36 * n), int(0.36 * n) + 40, int(0.4 * n), int(0.4 * n) + 40)
        first, *rest = chain(window)
        parent = root(site, first)
        for w in rest[:-1]:
            parent = subdivide(parent, w, site)
        child = subdivide(parent, window, site)
        added = np.abs(child.state.d - upsampled(parent.state.d, B_SPLINE, parent.window, window))
        most = amplitude(site, np.full(window.shape, 9.0), site.biases(window).amplitude)
        bound = most * 2.0 ** (-fractal.H_RANGE[0] * level)
        assert (added <= bound + 1e-5).all()
        assert added.max() > 0.05 * bound.max()


def hostile(kind: str) -> Site:
    """Ground and channels that no solver makes, but a broken one could."""
    rng = np.random.default_rng(2)
    z = heights(0).astype(np.float64)
    more: dict[str, Any] = {}
    if kind == "cliffs":
        z = rng.choice([-6.5e5, 6.5e5], z.shape)
    elif kind == "spikes":
        z[rng.random(z.shape) < 0.2] = 1e5
    elif kind == "asks":
        more = {"channels": {k: 1e3 * (v - 0.5) for k, v in channels().items()}, "detail": 4.0}
    elif kind == "deep":
        more = {"sea_level_m": -6e5, "look": "desert", "seed": 2**32 - 1}
    return replace(Site(SIZE, 1, (z.astype(np.float32),)), **more)


@pytest.mark.parametrize("kind", ["cliffs", "spikes", "asks", "deep"])
def test_nothing_ever_is_not_a_number(maker: Maker, kind: str) -> None:
    """SPEC F9: for every rule, on every level, whatever ground and channels say; attributes stay in their range."""
    for rule in RULES:
        site = replace(hostile(kind), rule=rule)
        for level in (0, 1, 3, 8, TOP):
            n = grid.cells(level)
            made = maker.detail(site, Window(level, n // 2, n // 2 + 40, -2, 38))
            for values in (made.guide, *made.state):
                assert np.isfinite(values).all()
            for values in made.state[2:]:
                assert values.min() >= 0
                assert values.max() <= 1
            assert made.state.h.min() >= 0
            assert made.state.h.max() <= 2


def test_whole_levels_are_the_windows() -> None:
    site = hill(1, channels=channels())
    made = levels(site, 2)
    assert [m.window for m in made] == [whole(level) for level in range(3)]
    window = Window(2, 30, 90, -2, 51)
    assert same(made[2].state, detail(site, window).state, window.within(made[2].window), (slice(None), slice(None)))


def test_seeds_differ_and_the_same_comes_twice() -> None:
    window = Window(5, 700, 720, 900, 930)
    words = [pack(detail(hill(seed=seed), window).state) for seed in (1, 1, 2)]
    assert np.array_equal(words[0], words[1])
    assert not np.array_equal(words[0], words[2])


def test_the_vectors_of_the_other_languages_are_what_the_twin_says() -> None:
    """SPEC F7: made anew they differ by rounding at most, on any machine."""
    kept = json.loads(make_synthesis.PATH.read_text(encoding="utf-8"))
    fresh = json.loads(make_synthesis.text())
    assert {k: v for k, v in fresh.items() if k not in {"steps", "places"}} == {
        k: v for k, v in kept.items() if k not in {"steps", "places"}
    }, "run python tests/vectors/make_synthesis.py"
    for name in ("steps", "places"):
        for new, old in zip(fresh[name], kept[name], strict=True):
            assert new["window"] == old["window"]
            assert np.allclose(new["guide"], old["guide"], rtol=1e-6, atol=1e-6)
            a, b = (_state(case) for case in (new, old))
            for x, y in zip(a, b, strict=True):
                assert np.abs(x - y).max() <= 1e-5, "run python tests/vectors/make_synthesis.py"


def _state(case: dict[str, Any]) -> State:
    return unpack(np.asarray(case["state"], dtype=np.uint32).reshape(-1, 4))
