"""Draws starting terrains as hillshades beside real ground: ``python docs/pictures/hillshades.py``.

Writes docs/pictures/hillshades.webp. Above stand the terrains that are drawn, with the detail made on them; below
real ground: Mount Rainier, and what the arguments name (``name=metres=file.npy``: spacing of the samples; heights in
metres, row 0 in the south). Under each stands its hypsometric curve: the share of the ground that lies above a height.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from esker import templates
from esker.contract import TILE_CELLS
from esker.render.pictures.studio import prepare
from esker.render.surface import Surface
from esker.solve.solver import Solver
from esker.synthesis.site import BORDER

HERE: Final = Path(__file__).resolve().parent
DRAWN: Final = ("alpine-ridge", "delta", "badland", "volcanic-island")
LEVEL: Final = 3
SIDE: Final = 400
CURVE: Final = 56
Floats = NDArray[np.float64]


def grid_of(surface: Surface) -> Floats:
    """Heights of a level with their detail, row 0 south."""
    n = 1 << LEVEL
    out = np.empty((n * TILE_CELLS, n * TILE_CELLS))
    for y in range(n):
        for x in range(n):
            tile = surface.slot(LEVEL, x, y).heights[BORDER : BORDER + TILE_CELLS, BORDER : BORDER + TILE_CELLS]
            out[y * TILE_CELLS : (y + 1) * TILE_CELLS, x * TILE_CELLS : (x + 1) * TILE_CELLS] = tile
    return out


def panel(heights: Floats, cell_m: float, words: str) -> Image.Image:
    """Hillshade lit from the north-west, and the curve below it."""
    south, west = np.gradient(heights, cell_m)
    n = 1 / np.sqrt(1 + west**2 + south**2)
    light = np.clip((-0.5 * -west + 0.5 * -south + 0.7071) * n, 0, 1) ** 0.8
    image = Image.fromarray((255 * light[::-1]).astype(np.uint8)).resize((SIDE, SIDE), Image.Resampling.LANCZOS)
    out = Image.new("L", (SIDE, SIDE + CURVE), 255)
    out.paste(image, (0, 0))
    draw = ImageDraw.Draw(out)
    shares = np.linspace(0, 1, SIDE - 20)
    levels = np.quantile(heights, 1 - shares)
    span = max(float(np.ptp(heights)), 1e-9)
    points = [(10 + k, SIDE + CURVE - 6 - (CURVE - 14) * float(z - heights.min()) / span) for k, z in enumerate(levels)]
    draw.line(points, fill=40, width=2)
    draw.text((8, 6), words, fill=0 if light[-20:, :100].mean() > 0.45 else 255)
    return out


def main() -> None:
    """Draws all panels."""
    solver = Solver(max_level=LEVEL)
    above, below = [], []
    for name in (*DRAWN, "rainier"):
        template = templates.load(name)
        stage = prepare(template.document, solver, grids=template.rasters(), level=LEVEL, refined=LEVEL)
        size = template.document.settings.size_m
        made = panel(grid_of(stage.surface), size / (TILE_CELLS << LEVEL), f"{template.title}, {size / 1000:.0f} km")
        (below if name == "rainier" else above).append(made)
    for argument in sys.argv[1:]:
        name, cell, path = argument.split("=")
        heights = np.load(path).astype(np.float64)
        below.append(panel(heights, float(cell), f"{name}, {float(cell) * heights.shape[1] / 1000:.0f} km"))
    columns = max(len(above), len(below))
    sheet = Image.new("L", (columns * (SIDE + 8), 2 * (SIDE + CURVE)), 255)
    for r, panels in enumerate((above, below)):
        for k, image in enumerate(panels):
            sheet.paste(image, (k * (SIDE + 8), r * (SIDE + CURVE)))
    sheet.save(HERE / "hillshades.webp", quality=80, method=6)


if __name__ == "__main__":
    main()
