"""How surveys of a starting terrain meet the ground around them, with the seam blend and without: the figures and the
picture of docs/patchwork.md.

``python -m bench.ground.seams [--picture FILE]`` prints, for each survey that disagrees with ground below it, the steps
from its border to 1, 2 and 4 of its cells outside (median and greatest, metres), and how far the ground was bent.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from esker import grid, templates
from esker.patchwork.base import Base
from esker.patchwork.lod import space
from esker.patchwork.lod.space import Placed
from esker.patchwork.seams.seam_blend import SeamBlend

CELLS: Final = (1, 2, 4)
LEVEL: Final = 5
SUN: Final = (0.55, -0.28, 0.79)
"""Towards the light: x east, y north, z up."""


class Plain(Base):
    """The ground as the blend alone leaves it."""

    @property
    def seam_blend(self) -> SeamBlend:
        """Returns a seam blend that bends nothing."""
        return SeamBlend(space.build([]), self.size_m)


def steps(base: Base, plain: Base, place: int) -> dict[str, Any]:
    """Returns figures of the survey at ``place`` in the order of precedence. Outwards means away from the middle of the
    survey."""
    found = base.seam_blend.differences(place)
    away = found.points - found.points.mean(axis=0)
    away /= np.hypot(*away.T)[:, None]
    out: dict[str, Any] = {
        "points": len(found.points),
        "difference_m": [round(float(q), 1) for q in np.quantile(np.abs(found.difference), [0.5, 1])],
    }
    for name, ground in (("blended", base), ("plain", plain)):
        border = ground.sample(found.points).heights
        for cells in CELLS:
            moved = np.abs(ground.sample(found.points + away * cells * found.pitch).heights - border)
            out[f"{name}_{cells}"] = [round(float(q), 2) for q in np.quantile(moved, [0.5, 0.95, 1])]
    return out


def shaded(heights: NDArray[np.float32], spacing: float) -> NDArray[np.uint8]:
    """Grey values of ground lit from ``SUN``, row 0 north."""
    north, east = np.gradient(heights.astype(np.float64), spacing)
    light = (SUN[2] - SUN[0] * east - SUN[1] * north) / np.sqrt(1 + east**2 + north**2)
    return np.asarray(np.clip(light, 0, 1) * 255, dtype=np.uint8)[::-1]


def main(argv: list[str]) -> int:
    """The command line."""
    parser = argparse.ArgumentParser(prog="python -m bench.ground.seams")
    parser.add_argument("--terrain", default="helens", choices=templates.REAL)
    parser.add_argument("--picture", type=Path)
    asked = parser.parse_args(argv)
    template = templates.load(asked.terrain)
    rasters = template.rasters()
    model = space.build([Placed(layer, rasters[layer.content]) for layer in template.document.layers])
    size = template.document.settings.size_m
    base, plain = Base(model, size), Plain(model, size)
    print(json.dumps([steps(base, plain, place) for place in base.seam_blend.zones], indent=2))
    if asked.picture:
        spacing = grid.spacing(LEVEL, size)
        rects = np.array([zone.rect for zone in base.seam_blend.zones.values()])
        (x0, y0), (x1, y1) = (np.clip(e / spacing, 0, 64 << LEVEL) for e in (rects[:, :2].min(0), rects[:, 2:].max(0)))
        part = slice(int(y0), int(y1)), slice(int(x0), int(x1))
        both = [shaded(b.level(LEVEL)[part], spacing) for b in (plain, base)]
        Image.fromarray(np.hstack(both)).save(asked.picture)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
