"""Gullies: what they are made of, what holds them, and what they leave as it was (SPEC F200 to F206)."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from esker.contract import fractal
from esker.synthesis.interpolate import B_SPLINE, Window, upsampled
from esker.synthesis.kernels import Kernels
from esker.synthesis.rules import gullies
from esker.synthesis.site import Ground, Site
from esker.synthesis.subdivide import Samples, chain, detail, relief, root, subdivide
from tests.synthesis.sites import channels, everywhere, heights, hill, plane, rms, same

WINDOW = Window(4, 300, 420, 330, 460)
SLOPE = 0.6


def worn(**fields: Any) -> Site:
    """The mountain by the sea with gullies and without noise."""
    return hill(**{"erosion": 1.0, "detail": 0.0, **fields})


def test_sine_and_arc_tangent_are_those_of_the_books() -> None:
    """SPEC F200: within 10^-6, and without a step where a phase begins anew."""
    turns = np.linspace(-3, 3, 60001)
    s, c = gullies.turned(turns)
    assert abs(s - np.sin(2 * np.pi * turns)).max() < 1e-6
    assert abs(c - np.cos(2 * np.pi * turns)).max() < 1e-6
    found = gullies.half_turns(s, c)
    assert abs(found - abs(np.arctan2(s, c)) / np.pi).max() < 1e-6
    assert abs(np.diff(found)).max() < 3e-4
    ends = gullies.profile(np.array([0.0, 1.0]))
    assert ends == pytest.approx([fractal.GULLY_MIDDLE, -fractal.GULLY_MOST])


@pytest.mark.parametrize("cyclic", [False, True])
@pytest.mark.parametrize("scale", [1.0, 3.0])
def test_the_compiled_octave_is_the_twins_to_the_bit(cyclic: bool, scale: float) -> None:
    """SPEC F560: on slopes of every direction, level ground, and where there is no gully."""
    site, random = worn(cyclic=cyclic, erosion_scale=scale), np.random.default_rng(3)
    slope_x, slope_y, where = random.normal(size=(3, *WINDOW.shape))
    slope_x[::7], slope_y[::7], where[:, ::5] = 0, 0, 0
    ground = Ground(4, np.zeros(WINDOW.shape), slope_x, slope_y, np.zeros(WINDOW.shape), np.zeros(WINDOW.shape))
    found = gullies.octave(site, ground, WINDOW, where)
    assert np.array_equal(found, gullies.octave_reference(site, ground, WINDOW, where))
    assert np.ptp(found) > 0.5


@pytest.mark.parametrize("rule", ["landscape", "smooth", "plain"])
@pytest.mark.parametrize("fields", [{}, {"erosion": 0.0}, {"ground_m": (0.0, 900.0)}, {"cyclic": True}])
def test_heights_alone_are_those_beside_all_channels(rule: str, fields: dict[str, Any]) -> None:
    """SPEC F561: what heights do not follow from may be left out, on solved levels and below them."""
    site = hill(channels=channels(), rule=rule, **{"erosion": 1.0, **fields})
    for window in (WINDOW, Window(1, -2, 60, 4, 131), Window(0, -2, 67, -2, 67)):
        assert np.array_equal(relief(site, window), detail(site, window).state.d)


def test_ground_without_gullies_keeps_its_bits() -> None:
    """SPEC F201: strength 0 and no paint of more is the rule of before, whatever distances say."""
    plain = detail(hill(), WINDOW).state
    silent = hill(channels=everywhere(erosion=-1.0, far=0.0), erosion_scale=7.0, hold=0.0)
    everything = slice(None), slice(None)
    assert same(plain, detail(silent, WINDOW).state, everything, everything)
    taken = detail(hill(erosion=1.0, channels=everywhere(erosion=-1.0)), WINDOW).state
    assert same(plain, taken, everything, everything)


@pytest.mark.parametrize("erosion", [1.0, 2.0])
def test_a_level_adds_an_octave_within_its_bound(erosion: float) -> None:
    """SPEC F202: d moves by 0.55 of the depth at most, about as much up as down; each octave is less than the last."""
    before = np.inf
    for level in range(1, 7):
        site = Site(4096.0, 3, (heights(0),), detail=0.0, erosion=erosion)
        k = 2**level
        *above, window = chain(Window(level, 12 * k, 12 * k + 60, 26 * k, 26 * k + 70))
        samples = root(site, above[0])
        for w in above[1:]:
            samples = subdivide(samples, w, site)
        child = subdivide(samples, window, site)
        added = child.state.d - upsampled(samples.state.d, B_SPLINE, samples.window, window)
        most = fractal.GULLY_MOST * erosion * gullies.depth_m(site, level) * fractal.GULLY_STEEP
        assert 0.2 * most < abs(added).max() <= most + 1e-4
        assert abs(added.mean()) < 0.25 * rms(added)
        assert most < before
        before = most
    assert most == pytest.approx(erosion * gullies.depth_m(site, 1) * 0.44 * fractal.GULLY_FALL**5)


def test_windows_made_apart_hold_the_same_gullies(kernels: Kernels) -> None:
    """SPEC F203: to the bit, by the twin and by kernels, which agree within a thousandth of the cell."""
    site = worn(channels=channels(), erosion_scale=9.0)
    part = Window(4, 350, 380, 401, 440)
    there = part.within(WINDOW)
    everything = slice(None), slice(None)
    whole: list[Samples] = []
    for maker in (detail, kernels.detail):
        whole.append(maker(site, WINDOW))
        assert same(maker(site, part).state, whole[-1].state, everything, there)
    assert rms(whole[0].state.d) > 1
    assert abs(whole[0].state.d - whole[1].state.d).max() < 1e-3 * site.spacing(4)


def test_what_strokes_fix_keeps_its_height_as_far_as_it_is_held() -> None:
    """SPEC F204: with hold 1 no gully and next to no noise lies there; with hold 0 distances say nothing."""
    fixed = everywhere(far=0.0)
    assert not detail(worn(channels=fixed), WINDOW).state.d.any()
    free = detail(worn(hold=0.0, channels=fixed), WINDOW).state.d
    assert np.array_equal(free, detail(worn(hold=0.0), WINDOW).state.d)
    assert rms(detail(worn(hold=0.5, channels=fixed), WINDOW).state.d) < 0.7 * rms(free)
    noise = detail(hill(), WINDOW).state.d
    assert rms(detail(hill(erosion=1.0, channels=fixed), WINDOW).state.d) < 0.02 * rms(noise)


def test_gullies_follow_slope_paint_and_data() -> None:
    """SPEC F205: level ground has none, paint gives and takes, data silence them as they silence noise."""

    def made(**fields: Any) -> float:
        return rms(detail(replace(plane(SLOPE, detail=0.0), **{"erosion": 1.0, **fields}), WINDOW).state.d)

    full = made()
    assert full > 3
    assert rms(detail(plane(0.03, detail=0.0, erosion=2.0), WINDOW).state.d) == 0
    assert made(erosion=0.5) < 0.7 * full
    assert made(channels=everywhere(erosion=-1.0)) == 0
    assert made(erosion=0.0, channels=everywhere(erosion=1.0)) == full
    assert made(erosion=0.0, channels=everywhere(erosion=0.5)) == made(erosion=0.5)
    assert made(erosion=2.0, channels=everywhere(erosion=1.0)) == made(erosion=2.0)
    assert made(channels=everywhere(survey=4.0)) == 0
    assert 0 < made(channels=everywhere(survey=2.5)) < 0.5 * full


def test_gullies_run_down_the_slope_at_the_scale_that_is_asked_for() -> None:
    """SPEC F205: on a plane that rises to the north one octave changes across the slope; longer waves change less."""

    def steps(scale: float) -> tuple[float, float]:
        window = Window(1, 10, 118, 10, 118)
        d = detail(plane(SLOPE, detail=0.0, erosion=1.0, erosion_scale=scale), window).state.d
        return rms(np.diff(d, axis=0) / d.std()), rms(np.diff(d, axis=1) / d.std())

    along, across = steps(10.0)
    assert along < 0.5 * across
    assert steps(14.0)[1] < 0.85 * steps(7.0)[1]


def test_broken_ground_makes_numbers() -> None:
    """SPEC F9, F205: spikes, cliffs and channels beyond their bounds."""
    z = np.random.default_rng(2).choice([-6.5e5, 6.5e5], (65, 65)).astype(np.float32)
    cases: tuple[dict[str, Any], ...] = ({}, {"channels": {name: 50 * values for name, values in channels().items()}})
    for asked in cases:
        state = detail(Site(4096.0, 1, (z,), erosion=2.0, erosion_scale=14.0, **asked), WINDOW).state
        assert all(np.isfinite(part).all() for part in state)
