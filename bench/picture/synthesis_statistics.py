"""What the fractal is: spectra, how rough each kind of ground is, how far kernel and twin are apart.

``python -m bench.picture.synthesis_statistics`` writes bench/results/synthesis-statistics.json; nothing in it depends
on how fast the machine is. ``synthesis_plots`` draws it for docs/synthesis.md.
"""

from __future__ import annotations

import itertools
import json
import math
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from bench import report
from esker import grid
from esker.contract import DEFAULT_SIZE_M, fractal
from esker.solve.opencl.device import open_device
from esker.synthesis import subdivide
from esker.synthesis.detailed import Maker, NumpyMaker
from esker.synthesis.interpolate import B_SPLINE, Window, upsampled
from esker.synthesis.kernels import Kernels
from esker.synthesis.site import Site

SIZE: Final = DEFAULT_SIZE_M
RESULT: Final = report.RESULTS / "synthesis-statistics.json"
LEVEL: Final = 5
"""Level of which spectra are taken: 2,048 samples a side."""
OCTAVES: Final = (40.0, 160.0)
"""Cycles along the domain between which a spectrum is fitted: whole octaves, above the coarsest level's 32, and two
octaves below the finest level's end, where the next octave is missing."""
EXPONENTS: Final = (0.75, 0.95, 1.2)
GROUNDS: Final[dict[str, tuple[float, float, dict[str, float]]]] = {
    "meadow": (0.03, 0.02, {}),
    "hillside": (0.35, 0.05, {}),
    "face": (1.0, 0.12, {}),
    "face under snow": (1.0, 0.12, {"snow": 1.0}),
    "face, roughness 1": (1.0, 0.12, {"roughness": 1.0}),
}
"""Slope, elevation as a share of the domain, and what is asked of the channels."""


@contextmanager
def one_exponent(h: float) -> Iterator[None]:
    """The rule with one exponent everywhere: without what ties it to slope, height and itself."""
    changed: dict[str, Any] = dict.fromkeys(
        ("SMOOTHNESS_FLAT", "SMOOTHNESS_STEEP", "SMOOTHNESS_VALLEY", "SMOOTHNESS_LOW", "SMOOTHNESS_NOISE"), 0.0
    ) | {"SMOOTHNESS": h, "SMOOTHNESS_MIN": 0.3, "FLAT_SHARE": 1.0, "H_RANGE": (0.3, 2.5)}
    kept = {name: getattr(fractal, name) for name in changed}
    try:
        for name, value in changed.items():
            setattr(fractal, name, value)
        yield
    finally:
        for name, value in kept.items():
            setattr(fractal, name, value)


def new_maker() -> Maker:
    """Kernels with the constants as they are now, the twin where there is no device."""
    device = open_device()
    return NumpyMaker() if device is None else Kernels(device)


def surface(h: float) -> NDArray[np.float32]:
    """Detail of a flat, cyclic domain of one exponent, metres: (2048, 2048), periodic."""
    with one_exponent(h):
        site = Site(SIZE, 3, (np.zeros((65, 65), dtype=np.float32),), look="paper", cyclic=True)
        n = grid.cells(LEVEL)
        d = new_maker().detail(site, Window(LEVEL, 0, n, 0, n)).state.d
    return np.asarray(d, dtype=np.float32)


def power(d: NDArray[np.float32]) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Power of one half plane of frequencies, and the frequencies along x and y, cycles along the domain."""
    n = len(d)
    ky, kx = np.meshgrid(np.fft.fftfreq(n, 1 / n), np.arange(n // 2 + 1, dtype=np.float64), indexing="ij")
    return np.abs(np.fft.rfft2(d)) ** 2, kx, ky


def rings(
    spectrum: NDArray[np.float64], radius: NDArray[np.float64], ends: tuple[float, float], count: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Mean radius (geometric) and mean power of rings, equally wide in octaves."""
    edges = np.geomspace(*ends, count + 1)
    masks = [(radius >= low) & (radius < high) for low, high in itertools.pairwise(edges)]
    return (
        np.array([np.exp(np.log(radius[m]).mean()) for m in masks]),
        np.array([spectrum[m].mean() for m in masks]),
    )


def fitted_slope(spectrum: NDArray[np.float64], radius: NDArray[np.float64]) -> float:
    """-d log power / d log frequency over OCTAVES; 2H + 2 is asked for."""
    f, p = rings(spectrum, radius, OCTAVES, 16)
    return -float(np.polyfit(np.log(f), np.log(p), 1)[0])


def spectra() -> dict[str, Any]:
    """Radial spectra of several exponents, with the slope asked for and the one found."""
    out = {}
    for h in EXPONENTS:
        p, kx, ky = power(surface(h))
        radius = np.hypot(kx, ky)
        f, mean = rings(p, radius, (8.0, 1000.0), 56)
        out[f"{h}"] = {
            "asked": 2 * h + 2,
            "found": round(fitted_slope(p, radius), 3),
            "cycles": [round(float(v), 2) for v in f],
            "power": [float(f"{v:.4g}") for v in mean],
        }
    return out


def _apart(ratio: float) -> float:
    return abs(math.log(ratio))


def lattice() -> dict[str, Any]:
    """Returns how far what lies on a lattice stands out: power on axes and diagonals over that of their ring, the
    farthest from 1; mean squares of samples on coarser levels over those of all, the farthest from 1."""
    d = surface(EXPONENTS[1]).astype(np.float64)
    p, kx, ky = power(d.astype(np.float32))
    radius = np.hypot(kx, ky)
    lines = {"axes": (kx == 0) | (ky == 0), "diagonals": np.abs(kx - np.abs(ky)) <= 1}
    out: dict[str, Any] = {}
    for name, part in lines.items():
        ratios: list[float] = []
        for centre in (40, 64, 100, 128, 200, 256, 400):
            ring = np.abs(radius - centre) < 0.1 * centre
            ratios.append(float(p[ring & part].mean() / p[ring].mean()))
        out[name] = round(float(max(ratios, key=_apart)), 2)
    slope, bend = np.roll(d, -1, 1) - d, np.roll(d, -1, 1) - 2 * d + np.roll(d, 1, 1)
    for name, z in (("height", d), ("slope", slope), ("bend", bend)):
        squares: NDArray[np.float64] = z * z
        places = [(step, j, i) for step in (2, 4, 8) for j in (0, step // 2) for i in (0, step // 2)]
        parts: list[float] = [float(squares[j::step, i::step].mean() / squares.mean()) for step, j, i in places]
        out[name] = round(float(max(parts, key=_apart)), 3)
    return out


def _plane(slope: float, middle: float, channels: Mapping[str, float]) -> Site:
    y = np.linspace(-0.5, 0.5, grid.samples(0))[:, None] * SIZE
    z = np.asarray(middle * SIZE + slope * y * np.ones(grid.samples(0)), dtype=np.float32)
    grids = {name: np.full((2, 2), value, dtype=np.float32) for name, value in channels.items()}
    return Site(SIZE, 1, (z,), grids)


def roughness() -> dict[str, Any]:
    """Returns what each level adds, root mean square in its own cells, on several grounds; smoothness h there."""
    out = {}
    for name, (slope, middle, asked) in GROUNDS.items():
        site = _plane(slope, middle, asked)
        added, h = [], []
        for level in range(1, subdivide.finest_level(SIZE) + 1):
            start = grid.cells(level) // 2
            window = (
                Window(level, start, start + 200, start, start + 200) if level > 2 else Window(level, 30, 90, 30, 90)
            )
            first, *rest = subdivide.chain(window)
            parent = subdivide.root(site, first)
            for w in rest[:-1]:
                parent = subdivide.subdivide(parent, w, site)
            child = subdivide.subdivide(parent, window, site)
            noise = child.state.d - upsampled(parent.state.d, B_SPLINE, parent.window, window)
            added.append(float(f"{np.sqrt(np.mean(noise**2)) / site.spacing(level):.4g}"))
            h.append(round(float(child.state.h.mean()), 3))
        out[name] = {"cells": added, "smoothness": h}
    return out


def agreement() -> dict[str, Any]:
    """Largest difference of kernel and twin by level: d in cells, guide in metres, other channels in 1/65535."""
    device = open_device()
    if device is None:
        return {}
    kernels, out = Kernels(device), {}
    n = grid.samples(0)
    y, x = np.mgrid[0:n, 0:n] / (n - 1)
    z = 900 * np.exp(-(((x - 0.45) / 0.2) ** 2) - ((y - 0.4) / 0.15) ** 2) - 60 * np.cos(7 * x + 3 * y)
    site = Site(SIZE, 1, (np.asarray(z, dtype=np.float32),))
    for level in range(1, subdivide.finest_level(SIZE) + 1):
        r, c = int(0.41 * grid.cells(level)), int(0.38 * grid.cells(level))
        window = Window(level, r, r + 48, c, c + 48)
        twin, found = subdivide.detail(site, window), kernels.detail(site, window)
        shares = [np.abs(a - b).max() for a, b in zip(found.state[2:], twin.state[2:], strict=True)]
        shares.append(np.abs(found.state.h - twin.state.h).max() / 2)
        out[str(level)] = {
            "d_cells": float(f"{np.abs(found.state.d - twin.state.d).max() / site.spacing(level):.2g}"),
            "guide_m": float(np.abs(found.guide - twin.guide).max()),
            "channels": round(float(max(shares)) * 65535, 1),
        }
    return out


def main() -> int:
    """Measure and write."""
    device = open_device()
    data = {
        "device": "NumPy" if device is None else device.name,
        "spectra": spectra(),
        "lattice": lattice(),
        "roughness": roughness(),
        "agreement": agreement(),
    }
    RESULT.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
