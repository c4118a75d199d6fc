"""Noise, state, interpolation and places: what the rule is made of (SPEC F1, F2, F3, F4)."""

from __future__ import annotations

import numpy as np
import pytest

from esker import grid
from esker.contract import MAX_SYNTHESIS_LEVEL
from esker.synthesis import hash as noise
from esker.synthesis import subdivide
from esker.synthesis.interpolate import B_SPLINE, DERIVATIVE, FOUR_POINT, SECOND, Taps, Window, along_x, along_y
from esker.synthesis.site import Site, extended, tile_window
from esker.synthesis.state import State, pack, stored, unpack
from tests.synthesis.sites import SIZE, hill

ROWS = np.arange(-2, 510)


def test_noise_is_even_and_its_streams_are_strangers() -> None:
    """SPEC F1."""
    words = {
        key: noise.hashed(seed, level, stream, ROWS, ROWS)
        for key, (seed, level, stream) in {"a": (1, 5, 0), "b": (1, 5, 1), "c": (1, 6, 0), "d": (2, 5, 0)}.items()
    }
    for w in words.values():
        full = noise.full(w, np.float64)
        assert full.min() >= -1
        assert full.max() < 1
        assert abs(full.mean()) < 0.005
        assert abs(full.var() - 1 / 3) < 0.005
        halves = noise.low(w, np.float64), noise.high(w, np.float64)
        assert all(abs(h.mean()) < 0.005 and abs(h).max() < 1 for h in halves)
        assert abs(np.corrcoef(halves[0].ravel(), halves[1].ravel())[0, 1]) < 0.01
        for ahead in (np.roll(full, 1, 0), np.roll(full, 1, 1), np.roll(full, 2, 1)):
            assert abs(np.corrcoef(full.ravel(), ahead.ravel())[0, 1]) < 0.01
        bits = np.unpackbits(w.view(np.uint8))
        assert abs(bits.mean() - 0.5) < 0.002
    for other in "bcd":
        flips = np.bitwise_count(words["a"] ^ words[other]).mean() / 32
        assert abs(flips - 0.5) < 0.005


def _spelled_out(seed: int, level: int, stream: int, i: int, j: int) -> int:
    """The hash in whole numbers of any length, as docs/synthesis.md has it."""

    def mix(x: int) -> int:
        x ^= x >> 16
        x = x * 0x7FEB352D % 2**32
        x ^= x >> 15
        x = x * 0x846CA68B % 2**32
        return x ^ x >> 16

    word = mix((seed + 0x9E3779B9 * (8 * level + stream)) % 2**32)
    return mix((mix((word + j) % 2**32) + i) % 2**32)


@pytest.mark.parametrize(
    "key", [(0, 0, 0, 0, 0), (1, 0, 3, -2, 5), (2**32 - 1, 17, 2, 8388610, -1), (77, 9, 1, 5, 32768)]
)
def test_noise_is_the_hash_that_is_written_down(key: tuple[int, int, int, int, int]) -> None:
    """SPEC F1."""
    seed, level, stream, i, j = key
    found = noise.hashed(seed, level, stream, np.array([j]), np.array([i]))
    assert int(found[0, 0]) == _spelled_out(*key)


def test_noise_is_exact_in_float32() -> None:
    words = noise.hashed(3, 17, 3, ROWS, ROWS)
    for value in (noise.full, noise.low, noise.high):
        assert np.array_equal(value(words, np.float32).astype(np.float64), value(words, np.float64))


def test_storing_rounds_to_the_nearest_and_keeps_what_is_stored() -> None:
    """SPEC F2."""
    rng = np.random.default_rng(0)
    state = State(*(rng.uniform(-0.2, 1.2, (9, 7)) for _ in State._fields))
    kept = stored(state)
    assert np.abs(kept.d - state.d).max() <= 2**-24
    assert np.abs(kept.h - np.clip(state.h, 0, 2)).max() <= 1 / 65535
    for x, y in zip(kept[2:], state[2:], strict=True):
        assert np.abs(x - np.clip(y, 0, 1)).max() <= 0.5 / 65535 + 1e-12
    assert np.array_equal(pack(stored(kept)), pack(kept))
    assert pack(state).nbytes == 16 * 63
    assert np.array_equal(pack(unpack(pack(state), np.float32)), pack(state))
    assert stored(state._replace(snow=np.full((9, 7), np.nan))).snow.max() == 0


@pytest.mark.parametrize(
    ("taps", "order", "exact", "degree"),
    [(B_SPLINE, 0, 1, 3), (FOUR_POINT, 0, 3, 3), (DERIVATIVE, 1, 2, 3), (SECOND, 2, 3, 3)],
    ids=["spline", "four-point", "derivative", "second"],
)
def test_stencils_are_exact_for_polynomials(taps: Taps, order: int, exact: int, degree: int) -> None:
    """SPEC F3: of degree 1 for means, 3 for the 4-point rule and second differences, 2 for slopes."""
    child = Window(1, 3, 29, -5, 22)
    parent = child.parent()
    for power in range(degree + 1):
        p = np.polynomial.Polynomial.basis(power).deriv(order) if order else np.polynomial.Polynomial.basis(power)
        z = np.polynomial.Polynomial.basis(power)(parent.cols.astype(float))[None, :] * np.ones((parent.shape[0], 1))
        found, wanted = along_x(z, taps, parent, child)[0], p(child.cols / 2)
        assert (np.abs(found - wanted).max() < 1e-9) == (power <= exact)
        upright = along_y(np.ascontiguousarray(z.T), taps, Window(0, parent.c0, parent.c1, 0, 9), Window(
            1, child.c0, child.c1, 0, 9))  # fmt: skip
        assert np.allclose(upright[:, 0], found, atol=1e-9)


def test_a_border_is_made_from_its_parents_border() -> None:
    """SPEC F4: for every tile and quadrant, what is needed of the parent is what the parent's slot holds."""
    for level, x, y in ((1, 0, 0), (1, 1, 1), (2, 2, 1), (9, 300, 17), (17, 131071, 131071)):
        child, parent = tile_window(level, x, y), tile_window(level - 1, x >> 1, y >> 1)
        rows, cols = child.parent().within(parent)
        assert {rows.start, cols.start} <= {0, 32}
        assert {rows.stop, cols.stop} <= {37, 69}
    with pytest.raises(ValueError, match="does not lie in"):
        tile_window(1, 0, 0).within(tile_window(1, 1, 0))
    with pytest.raises(ValueError, match="level 2"):
        tile_window(2, 0, 0).within(tile_window(1, 0, 0))


def test_beyond_an_edge_ground_goes_on_point_symmetrically() -> None:
    """SPEC F4: by rows and columns one after the other, whatever window asks, and as tiles beside it have it."""
    z = hill().guides[1].astype(np.float64)
    n = len(z)
    out = extended(z, Window(1, -2, n + 2, -2, n + 2))
    assert np.array_equal(out[2:-2, 2:-2], z)
    assert np.array_equal(out[2:-2, 0], 2 * z[:, 0] - z[:, 2])
    assert np.array_equal(out[-1, 2:-2], 2 * z[-1] - z[-3])
    assert np.allclose(out[0, 0], 2 * (2 * z[0, 0] - z[0, 2]) - (2 * z[2, 0] - z[2, 2]), atol=1e-9)
    part = Window(1, -2, 7, n - 9, n + 2)
    assert np.array_equal(extended(z, part), out[0:9, n - 7 : n + 4])
    assert np.array_equal(extended(z[:20, n - 20 :], part, origin=(0, n - 20)), out[0:9, n - 7 : n + 4])
    around = extended(z, Window(1, -2, n + 2, -2, n + 2), cyclic=True)
    assert np.array_equal(around[:, 1], around[:, n - 1 + 1])
    assert np.array_equal(around[2 : n + 1, 2 : n + 1], z[:-1, :-1])


def test_channels_are_bilinear_and_exact_at_their_own_samples() -> None:
    """SPEC F4."""
    values = np.arange(25, dtype=np.float32).reshape(5, 5) / 32
    site = hill(channels={"snow": values})
    level = 3
    n = grid.cells(level)
    whole = site.biases(Window(level, -2, n + 3, -2, n + 3))
    assert np.array_equal(whole.snow[2 : n + 3 : n // 4, 2 : n + 3 : n // 4], values)
    assert np.array_equal(whole.snow[0], whole.snow[2])
    assert np.array_equal(whole.snow[:, -1], whole.snow[:, -3])
    assert whole.snow[2, 3] == pytest.approx(values[0, 0] + (values[0, 1] - values[0, 0]) * 4 / n)
    assert not whole.grass.any()
    assert (whole.roughness == 0.5).all()
    coarse = hill(channels={"snow": np.linspace(0, 1, 257, dtype=np.float32)[None].repeat(257, 0)})
    assert np.allclose(coarse.biases(Window(0, 0, 65, 0, 65)).snow[0], np.linspace(0, 1, 65))


@pytest.mark.parametrize(("size", "finest"), [(65536.0, 17), (4096.0, 13), (64.0, 7), (1000.0, 11)])
def test_the_finest_level_has_cells_of_a_centimetre(size: float, finest: int) -> None:
    assert subdivide.finest_level(size) == finest <= MAX_SYNTHESIS_LEVEL
    assert grid.spacing(finest, size) <= 0.01 < grid.spacing(finest - 1, size)


def test_what_does_not_fit_is_refused() -> None:
    good = hill().guides
    for guides, more, words in (
        ((), {}, "level 0"),
        (good[1:], {}, "65x65"),
        (good, {"look": "moon"}, "look"),
        (good, {"rule": "moon"}, "rule"),
        (good, {"channels": {"lava": np.zeros((3, 3), dtype=np.float32)}}, "lava"),
        (good, {"channels": {"snow": np.zeros((4, 4), dtype=np.float32)}}, "snow"),
        (good, {"channels": {"snow": np.zeros((3, 5), dtype=np.float32)}}, "snow"),
    ):
        with pytest.raises(ValueError, match=words):
            Site(SIZE, 1, guides, **more)
    samples = subdivide.root(hill())
    with pytest.raises(ValueError, match="not made from"):
        subdivide.subdivide(samples, Window(2, 0, 5, 0, 5), hill())
    with pytest.raises(ValueError, match="does not lie in"):
        subdivide.subdivide(samples, Window(1, 0, 500, 0, 5), hill())
