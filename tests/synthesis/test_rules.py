"""What the rules do to the ground (SPEC F10, F11, F12, F13, F14)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from esker import contract, grid
from esker.contract import fractal
from esker.contract.fractal import PAINT_LESS
from esker.synthesis.detailed import DetailedTerrain
from esker.synthesis.interpolate import FOUR_POINT, Window, upsampled
from esker.synthesis.site import Site
from esker.synthesis.state import Array, State
from esker.synthesis.subdivide import detail, levels
from tests.synthesis.sites import SIZE, channels, everywhere, heights, hill, plane, rms

LEVEL = 8


def somewhere(site: Site, level: int = LEVEL, side: int = 150) -> State:
    """A window in the middle of the domain."""
    start = grid.cells(level) // 2
    return detail(site, Window(level, start, start + side, start, start + side)).state


def grain(d: Array) -> float:
    """How rough a surface is at the spacing of its samples."""
    return rms(np.diff(d, 2, axis=0)[:, 1:-1] + np.diff(d, 2, axis=1)[1:-1])


def test_steep_ground_is_rough_and_level_ground_is_calm() -> None:
    """SPEC F10."""
    by_slope = [somewhere(plane(slope, height=900)) for slope in (0.02, 0.4, 1.2)]
    grains = [grain(s.d) for s in by_slope]
    assert grains[1] > 10 * grains[0]
    assert grains[2] > 1.5 * grains[1]
    assert by_slope[0].h.mean() > by_slope[1].h.mean() > by_slope[2].h.mean()


def test_valleys_are_smoother_than_ridges() -> None:
    """SPEC F10: of the same slopes; and low ground is smoother than high."""
    x = np.linspace(0, 8 * np.pi, 65)
    z = np.asarray(np.cos(x) * 90 * np.ones((65, 1)), dtype=np.float32)
    site = Site(SIZE, 1, (z,), detail=0.0, look="paper")
    state = levels(site, 1)[1].state
    bend = np.cos(np.linspace(0, 8 * np.pi, 129))
    valleys, ridges = (state.h[2:-2, 2:-2][:, side].mean() for side in (bend < -0.9, bend > 0.9))
    assert valleys > ridges + 0.1
    low, high = (somewhere(plane(0.2, height=h, look="paper"), 0, 20).h.mean() for h in (-500.0, 900.0))
    assert low > high + 0.05


def test_thick_snow_damps_detail() -> None:
    """SPEC F11 (paper 1, section 4): by what it adds to the exponent, 2^(-level * SNOW_TO_H) of the grain."""
    bare, thick = (somewhere(plane(0.5, channels=everywhere(snow=bias))) for bias in (-1.0, 1.0))
    assert thick.snow.min() == 1
    assert bare.snow.max() == 0
    assert grain(thick.d) < 4 * 2.0 ** (-LEVEL * fractal.SNOW_TO_H) * grain(bare.d)


def test_channels_follow_the_ground_strictly_when_coarse_and_loosely_when_fine() -> None:
    """SPEC F10: and are fractals themselves, with detail on every scale."""
    site = plane(0.0, height=0.155 * SIZE)
    coarse, fine = (somewhere(site, level, side) for level, side in ((0, 25), (6, 700)))
    for name in ("h", "snow"):
        strict, loose = getattr(coarse, name), getattr(fine, name)
        assert loose.std() > 3 * strict.std() > 0
        for far in (1, 4, 16):  # it varies over every distance, more over greater ones
            assert 0.002 < rms(loose[:, far:] - loose[:, :-far]) < rms(loose[:, 2 * far :] - loose[:, : -2 * far])


def test_snow_and_plants_know_their_ground() -> None:
    """SPEC F10: snow is high and not on walls, forest below the trees' line, grass above it, nothing in a desert."""
    at = {h: somewhere(plane(0.2, height=h - 410.0)) for h in (100.0, 420.0, 1200.0)}  # the middle lies 410 m higher
    assert at[1200.0].snow.mean() > 0.95
    assert at[100.0].snow.max() < 0.05
    assert at[100.0].forest.mean() > 0.3 > at[420.0].forest.mean()
    assert at[420.0].grass.mean() > 0.5
    assert at[1200.0].grass.mean() < 0.05
    assert somewhere(plane(1.5, height=-1500.0)).snow.mean() < 0.2
    assert somewhere(plane(0.2, height=800.0, look="desert")).snow.max() < 0.05
    assert somewhere(plane(0.2, height=-310.0, look="desert")).forest.max() < 0.1
    assert somewhere(plane(0.2, height=-390.0, look="alpine")).snow.mean() > 0.9
    sea = somewhere(plane(0.05, height=-120.0, sea_level_m=0.0))
    assert sea.wet.mean() > 0.95 > 0.3 > somewhere(plane(0.05, height=200.0, sea_level_m=0.0)).wet.mean()


@pytest.mark.parametrize("rule", ["landscape", "smooth", "plain"])
@pytest.mark.parametrize(("name", "field"), [("snow", "snow"), ("grass", "grass"), ("forest", "forest"),
                                             ("wetness", "wet")])  # fmt: skip
def test_paint_is_obeyed(rule: str, name: str, field: str) -> None:
    """SPEC F12: +1 gives all of a channel, -1 none, nothing in between moves it the wrong way."""
    values = []
    for bias in (-1.0, -0.5, 0.0, 0.5, 1.0):
        state = somewhere(plane(0.3, height=-500.0, rule=rule, channels=everywhere(**{name: bias})), 5, 40)
        values.append(getattr(state, field))
    assert values[0].max() == 0
    assert values[4].min() == 1
    means = [float(v.mean()) for v in values]
    assert means == sorted(means)
    assert means[3] > means[1] + 0.4


def test_roughness_and_amplitude_are_obeyed() -> None:
    """SPEC F12."""
    by_roughness = [somewhere(plane(0.5, channels=everywhere(roughness=r))) for r in (0.0, 0.5, 1.0)]
    grains = [grain(s.d) for s in by_roughness]
    assert grains[1] > 4 * grains[0]
    assert grains[2] > 4 * grains[1]
    all_there_is = fractal.ALPHA * grid.spacing(0, SIZE)
    flat = somewhere(plane(0.5, channels=everywhere(amplitude=-PAINT_LESS * all_there_is)))
    assert not flat.d.any()
    plain, more = (somewhere(plane(0.0, channels=everywhere(amplitude=a)), 3, 60).d for a in (0.0, all_there_is))
    assert rms(more) == pytest.approx((1 + fractal.FLAT_SHARE) / fractal.FLAT_SHARE * rms(plain), rel=0.01)


def test_detail_begins_below_the_data() -> None:
    """SPEC F19: no noise on levels down to the spacing of the data, all of it from one level below."""
    bare, data = (somewhere(plane(0.5, channels=c), 5, 60) for c in ({}, everywhere(survey=5.0)))
    assert bare.d.any()
    assert not data.d.any()
    roots = [somewhere(plane(0.5, channels=c), 0, 30) for c in ({}, everywhere(survey=5.0))]
    assert all(np.array_equal(a, b) for a, b in zip(roots[0][1:], roots[1][1:], strict=True))
    assert data.h.std() > 0.05
    first, half = (somewhere(plane(0.5, channels=everywhere(survey=at)), 6, 60).d for at in (5.0, 5.5))
    assert rms(first) > 0
    assert np.abs(half - first / 2).max() < 1e-2 * rms(first)
    none = everywhere(survey=contract.BASE_SURVEY)
    assert np.array_equal(somewhere(plane(0.5, channels=none)).d, somewhere(plane(0.5)).d)


def test_a_place_on_earth_has_its_own_snow_line() -> None:
    """SPEC F20: whatever the size of the domain; without a place elevations are shares of it."""
    for size, lat, below, above in (
        (SIZE, 46.8, 2000.0, 3000.0),
        (65536.0, 46.8, 2000.0, 3000.0),
        (SIZE, 70.0, 250.0, 1200.0),
    ):
        flat = np.zeros((65, 65), dtype=np.float32)
        snow = [
            somewhere(Site(size, 1, (flat + np.float32(h),), lat_deg=lat), 3, 60).snow.mean() for h in (below, above)
        ]
        assert snow[0] < 0.02
        assert snow[1] > 0.9
    assert Site(SIZE, 1, (flat,)).relief_m == SIZE


@pytest.mark.parametrize("ground", [(1900.0, 2100.0), (-4800.0, -4500.0), (100.0, 2600.0)])
def test_laid_ground_without_a_place_has_the_climate_of_its_own_relief(ground: tuple[float, float]) -> None:
    """SPEC F21: its lowland is green; snow, if it reaches so high, lies above seven tenths of its relief."""
    low, high = ground
    flat = np.zeros((65, 65), dtype=np.float32)
    line = max(0.7 * (high - low), 0.15 * SIZE)

    def at(height: float) -> State:
        return somewhere(Site(SIZE, 1, (flat + np.float32(height),), ground_m=ground), 3, 60)

    lowland = at(low + 0.1 * line)
    assert lowland.snow.mean() < 0.02
    assert lowland.forest.mean() + lowland.grass.mean() > 0.5
    assert at(low + 0.8 * line).snow.mean() < 0.05
    assert at(low + 1.4 * line).snow.mean() > 0.9
    # A sea or a place on Earth says more than the layers do.
    assert Site(SIZE, 1, (flat,), sea_level_m=7.0, ground_m=ground).zero_m == 7.0
    assert Site(SIZE, 1, (flat,), lat_deg=46.0, ground_m=ground).zero_m == 0.0
    assert (
        Site(SIZE, 1, (flat,), lat_deg=46.0, ground_m=ground).relief_m == Site(SIZE, 1, (flat,), lat_deg=46.0).relief_m
    )


def test_strength_scales_detail() -> None:
    base, double, none = (somewhere(plane(0.0, detail=strength), 3, 50).d for strength in (1.0, 2.0, 0.0))
    assert rms(double) == pytest.approx(2 * rms(base), rel=0.02)
    assert not none.any()


@pytest.mark.parametrize("rule", ["smooth", "plain"])
def test_rules_without_noise_know_no_seed_and_add_nothing(rule: str) -> None:
    """SPEC F13."""
    a, b = (somewhere(hill(rule=rule, seed=seed, channels=channels()), 6, 40) for seed in (1, 2))
    assert all(np.array_equal(x, y) for x, y in zip(a, b, strict=True))
    assert not a.d.any()


def test_plain_channels_are_their_targets() -> None:
    """SPEC F13: the same on every level where the ground is the same; smooth ones come there in the end."""
    site = plane(0.62, height=-900.0)
    plain = replace(site, rule="plain")
    one, other = somewhere(plain, 4, 30), somewhere(plain, 5, 30)
    assert abs(one.grass[0, 0] - other.grass[0, 0]) < 1e-3
    assert 0.1 < one.grass[0, 0] < 0.9
    late = somewhere(replace(site, rule="smooth"), 9, 30)
    assert np.abs(late.grass - one.grass[0, 0]).max() < 0.02


def _bends(z: Array, spacing: float) -> float:
    """Largest step of the second derivative from one sample to the next."""
    second = np.diff(z.astype(np.float64), 2, axis=0)[:, 1:-1] / spacing**2
    return float(np.abs(np.diff(second, axis=0)).max())


def test_smooth_ground_has_continuous_second_derivatives() -> None:
    """SPEC F14 (paper 1, section 4): steps of the second derivative halve with every level, which 4-point's do not."""
    rng = np.random.default_rng(4)
    z = np.asarray(heights(0) + rng.normal(0, 60, (65, 65)), dtype=np.float32)
    steps: dict[str, list[float]] = {"smooth": [], "landscape": []}
    for rule, found in steps.items():
        terrain = DetailedTerrain(Site(SIZE, 1, (z,), rule=rule, detail=0.0))
        for level in (2, 3, 4):
            n = grid.cells(level)
            base = terrain.base(Window(level, n // 4, n // 2, n // 2, n // 2 + n // 4))
            found.append(_bends(base, grid.spacing(level, SIZE)))
    smooth, plain = (np.array(steps[rule]) for rule in ("smooth", "landscape"))
    assert (smooth[1:] < 0.6 * smooth[:-1]).all()
    assert (plain[1:] > 0.8 * plain[:-1]).all()


def test_landscape_base_keeps_the_samples_that_were_solved() -> None:
    """SPEC F14."""
    site = hill(1)
    terrain = DetailedTerrain(site)
    fine = terrain.base(Window(3, 0, grid.samples(3), 0, grid.samples(3)))
    assert np.array_equal(fine[::4, ::4], site.guides[1])
    parent = Window(1, -2, 131, -2, 131)
    once = upsampled(site.guide(parent), FOUR_POINT, parent, Window(2, 0, 257, 0, 257))
    assert np.abs(fine[::2, ::2] - once).max() < 1e-4
