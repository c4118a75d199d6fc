"""Pictures of docs/synthesis.md: ``python -m bench.picture.synthesis_plots``.

The graphs come from bench/results/synthesis-statistics.json; the picture of the levels is made anew, by solving a
starting terrain. Writes docs/pictures/synthesis-*.svg|jpg. Needs matplotlib (``pip install 'esker[bench]'``).
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench import report
from bench.picture.synthesis_statistics import OCTAVES, SIZE
from bench.solver.plots import BLUE, GREEN, INK, ORANGE, PICTURES, RED, VIOLET, _figure, _save
from esker import templates
from esker.api.terrain import Terrain

PLACE = (3210.0, 2920.0)
"""On a face of "Figure six", metres."""
PANELS = (3, 5, 7, 9, 11, 13)
PIXELS = 360
SUN = (75.0, 35.0)
"""Azimuth and elevation of the light, degrees."""


def spectrum(spectra: dict[str, Any], path: Path) -> None:
    """Radial power of one exponent everywhere, with the slopes asked for."""
    figure, axes = _figure(6.4, 3.9)
    for (h, row), colour in zip(spectra.items(), (RED, ORANGE, BLUE), strict=True):
        f, p = np.array(row["cycles"]), np.array(row["power"])
        axes.loglog(
            SIZE / f, p, color=colour, lw=1.4, label=f"H = {h}: asked {row['asked']:.2f}, found {row['found']:.2f}"
        )
        inside = (f >= OCTAVES[0]) & (f <= OCTAVES[1])
        level = np.exp(np.mean(np.log(p[inside] * f[inside] ** row["asked"])))
        ends = np.array([20.0, 500.0])
        axes.loglog(SIZE / ends, level * ends ** -row["asked"], color=INK, lw=0.8, ls=":")
    axes.axvspan(*(SIZE / np.array(OCTAVES)), color=INK, alpha=0.1, lw=0)
    axes.set(xlabel="wavelength, metres", ylabel="radial power", xlim=(SIZE / 8, SIZE / 1000))
    axes.set_title("One exponent everywhere; fitted in the grey band", loc="left")
    axes.legend(loc="lower left")
    axes.grid(True, which="major")
    _save(figure, path)


def roughness(grounds: dict[str, Any], path: Path) -> None:
    """What each octave adds on several grounds, as a slope."""
    figure, axes = _figure(6.4, 3.9)
    for (name, row), colour in zip(grounds.items(), (GREEN, ORANGE, RED, BLUE, VIOLET), strict=True):
        cells = [SIZE / 64 / 2**level for level in range(1, len(row["cells"]) + 1)]
        axes.loglog(cells, row["cells"], "o-", color=colour, lw=1.2, ms=3, label=name)
    axes.invert_xaxis()
    axes.set(xlabel="cells, metres", ylabel="added by the octave, cells", ylim=(1e-5, 4))
    axes.set_title("How rough: root mean square of each octave", loc="left")
    axes.legend(loc="lower left")
    axes.grid(True, which="major")
    _save(figure, path)


def shade(heights: NDArray[np.float32], spacing: float) -> NDArray[np.float64]:
    """Brightness 0..1 of ground under the light, and a little of the sky."""
    dy, dx = np.gradient(heights.astype(np.float64), spacing)
    azimuth, elevation = np.radians(SUN)
    light = np.sin(azimuth) * np.cos(elevation), np.cos(azimuth) * np.cos(elevation), np.sin(elevation)
    up = 1 / np.sqrt(1 + dx * dx + dy * dy)
    sun = np.maximum(0, (light[2] - dx * light[0] - dy * light[1]) * up)
    lit: NDArray[np.float64] = np.clip(0.05 + 0.07 * up + 0.8 * sun, 0, 1)
    return lit


def levels(path: Path) -> None:
    """One place from 64-metre cells down to half a centimetre, lit from the east."""
    from PIL import Image, ImageDraw

    terrain = Terrain.from_document(templates.load("figure-six").document)
    rows = -(-len(PANELS) // 3)
    page = Image.new("L", (3 * PIXELS + 8, rows * PIXELS + 4 * (rows - 1)), 255)
    for k, level in enumerate(PANELS):
        half = 0.5 * PIXELS * SIZE / 64 / 2**level
        (x, y), fit = PLACE, SIZE / 2 - half
        x, y = (SIZE / 2 + min(max(v - SIZE / 2, -fit), fit) for v in (x, y))
        window = terrain.window(level, x - half, y - half, x + half, y + half, detail=True)
        lit = shade(window.heights, window.spacing_m)[-PIXELS:, :PIXELS]
        image = Image.fromarray((255 * lit[::-1] ** (1 / 1.6)).astype(np.uint8))
        width = PIXELS * window.spacing_m
        label = f"{width:,.0f} m" if width > 9 else f"{width:.1f} m"
        ImageDraw.Draw(image).text((8, PIXELS - 18), label, fill=255, stroke_width=2, stroke_fill=0)
        page.paste(image, ((k % 3) * (PIXELS + 4), (k // 3) * (PIXELS + 4)))
    page.save(path, quality=88)


def main() -> int:
    """Draw all."""
    data = report.result("synthesis-statistics")
    spectrum(data["spectra"], PICTURES / "synthesis-spectrum.svg")
    roughness(data["roughness"], PICTURES / "synthesis-roughness.svg")
    levels(PICTURES / "synthesis-levels.jpg")
    return 0


if __name__ == "__main__":
    sys.exit(main())
