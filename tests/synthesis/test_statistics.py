"""The fractal is what was asked for, and no lattice shows in it (SPEC F15, F16)."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from bench.picture import synthesis_statistics as bench


@pytest.fixture(scope="module", params=[0.75, 1.1])
def asked(request: pytest.FixtureRequest) -> tuple[float, NDArray[np.float32]]:
    """An exponent, and detail of a flat, cyclic domain that was made with it."""
    return request.param, bench.surface(request.param)


def test_the_spectrum_falls_as_asked(asked: tuple[float, NDArray[np.float32]]) -> None:
    """SPEC F15: radial power of a surface of exponent H falls as f^-(2H + 2); within 10 %."""
    h, d = asked
    power, kx, ky = bench.power(d)
    slope = bench.fitted_slope(power, np.hypot(kx, ky))
    assert slope == pytest.approx(2 * h + 2, rel=0.1)


def test_no_lattice_shows_in_the_spectrum(asked: tuple[float, NDArray[np.float32]]) -> None:
    """SPEC F16: not along the axes, nor the diagonals, nor in lines or points at the lattices of coarser levels."""
    _, d = asked
    power, kx, ky = bench.power(d)
    radius = np.hypot(kx, ky)
    for centre in (40, 64, 100, 128, 200, 256, 400):
        ring = np.abs(radius - centre) < 0.1 * centre
        mean = power[ring].mean()
        for part in ((kx == 0) | (ky == 0), np.abs(kx - np.abs(ky)) <= 1):
            assert 0.4 < power[ring & part].mean() / mean < 2.2
        line = (np.abs(kx % 64) <= 1) | (np.abs(ky % 64) <= 1)
        assert 0.5 < power[ring & line].mean() / mean < 1.7
    for k in (64, 128, 256, 512):
        near = power[abs(kx - k) + abs(ky) <= 6]
        assert near.max() < 25 * near.mean()  # the greatest of 85 exponential values is some 5 times their mean


def test_no_lattice_shows_in_the_samples(asked: tuple[float, NDArray[np.float32]]) -> None:
    """SPEC F16: samples that lie on coarser levels and those between vary alike, in height, slope and bend."""
    _, d = asked
    d = d.astype(np.float64)
    bend = np.roll(d, -1, 1) - 2 * d + np.roll(d, 1, 1)
    for z, most in ((d, 0.03), (np.roll(d, -1, 1) - d, 0.05), (np.roll(d, -1, 0) - d, 0.05), (bend, 0.15)):
        whole = np.mean(z * z)
        for step in (2, 4, 8):
            for row, col in ((0, 0), (0, step // 2), (step // 2, 0), (step // 2, step // 2)):
                assert np.mean(z[row::step, col::step] ** 2) == pytest.approx(whole, rel=most)
