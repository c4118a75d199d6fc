"""The fractal is what was asked for, and no lattice shows in it (SPEC F15, F16)."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from numpy.typing import NDArray

from esker import fractal, grid
from esker.solve.device import open_device
from esker.synthesis.interpolate import Window
from esker.synthesis.kernels import Kernels
from esker.synthesis.site import Site
from tests.synthesis.sites import SIZE

LEVEL = 5
OCTAVES = (40.0, 160.0)
"""Cycles along the domain between which the spectrum is fitted: whole octaves, above the coarsest level's 32, and two
octaves below the finest level's end, where the next octave is missing."""


def fractal_of(h: float, patch: pytest.MonkeyPatch) -> NDArray[np.float32]:
    """Detail of a flat, cyclic domain of constant exponent: without what ties it to slope, height and itself."""
    for name in ("FLAT", "STEEP", "VALLEY", "LOW", "NOISE"):
        patch.setattr(fractal, f"SMOOTHNESS_{name}", 0.0)
    patch.setattr(fractal, "SMOOTHNESS", h)
    patch.setattr(fractal, "SMOOTHNESS_MIN", 0.3)
    patch.setattr(fractal, "FLAT_SHARE", 1.0)
    device = open_device()
    if device is None:
        pytest.skip("four million samples are for a device")
    site = Site(SIZE, 3, (np.zeros((65, 65), dtype=np.float32),), look="paper", cyclic=True)
    n = grid.cells(LEVEL)
    made = Kernels(device).detail(site, Window(LEVEL, 0, n, 0, n)).state
    assert abs(made.h - h).max() < 1e-4
    return np.asarray(made.d, dtype=np.float32)


@pytest.fixture(scope="module", params=[0.75, 1.1])
def asked(request: pytest.FixtureRequest) -> tuple[float, NDArray[np.float32]]:
    """An exponent, and detail that was made with it."""
    with pytest.MonkeyPatch.context() as patch:
        return request.param, fractal_of(request.param, patch)


def spectrum(d: NDArray[np.float32]) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Power of one half plane of frequencies, and the frequencies, cycles along the domain."""
    power = np.abs(np.fft.rfft2(d)) ** 2
    n = len(d)
    ky, kx = np.meshgrid(np.fft.fftfreq(n, 1 / n), np.arange(n // 2 + 1), indexing="ij")
    return power, kx.astype(np.float64), ky


def radial(power: NDArray[np.float64], radius: NDArray[np.float64], bins: int) -> tuple[list[float], list[float]]:
    """Logarithms of mean radius and mean power of rings."""
    edges = np.geomspace(*OCTAVES, bins + 1)
    rings = [(radius >= low) & (radius < high) for low, high in itertools.pairwise(edges)]
    return [float(np.log(radius[r]).mean()) for r in rings], [float(np.log(power[r].mean())) for r in rings]


def test_the_spectrum_falls_as_asked(asked: tuple[float, NDArray[np.float32]]) -> None:
    """SPEC F15: radial power of a surface of exponent H falls as f^-(2H + 2); within 10 %."""
    h, d = asked
    power, kx, ky = spectrum(d)
    f, p = radial(power, np.hypot(kx, ky), 16)
    slope = -float(np.polyfit(f, p, 1)[0])
    assert slope == pytest.approx(2 * h + 2, rel=0.1)


def test_no_lattice_shows_in_the_spectrum(asked: tuple[float, NDArray[np.float32]]) -> None:
    """SPEC F16: not along the axes, nor the diagonals, nor in lines or points at the lattices of coarser levels."""
    _, d = asked
    power, kx, ky = spectrum(d)
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
