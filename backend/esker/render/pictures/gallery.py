"""Pictures of the starting terrains for the landing page: ``python -m esker.render.pictures.gallery [id ...]``."""

from __future__ import annotations

import sys
from typing import Final

from PIL import Image

from esker import templates
from esker.contract import DEFAULT_LEVEL
from esker.document.layers import span_m
from esker.render.frame import Scene
from esker.render.pictures.studio import prepare
from esker.render.pictures.views import camera_of
from esker.render.reference import Reference
from esker.resources import sources
from esker.solve.solver import Solver

OUT: Final = sources() / "frontend" / "public" / "templates"
SIZE: Final = (640, 400)
OVERSAMPLED: Final = 2
VIEWS: Final = {
    "figure-six": "orbit:165,21,4100,target:2048,2000,200",
    "alpine-ridge": "orbit:160,15,3700,target:2100,2150,330",
    "canyon": "orbit:150,27,3100,target:2048,1950,60",
    "volcanic-island": "orbit:165,13,2900,target:2048,2048,150",
    "archipelago": "orbit:160,17,3100,target:2048,1950,20",
    "delta": "orbit:172,20,3300,target:2060,2050,10",
    "badland": "orbit:168,16,2700,target:2000,1750,90",
    "rainier": "orbit:335,8,19000,target:56000,11500,2300",
    "helens": "orbit:352,20,2050,target:1480,1050,2130",
}


def main(names: list[str]) -> int:
    """Draws the named pictures, or all."""
    reference, solver = Reference("rich"), Solver(max_level=DEFAULT_LEVEL)
    for name in names or list(VIEWS):
        template = templates.load(name)
        stage = prepare(template.document, solver, grids=template.rasters())
        settings = stage.document.settings
        camera = camera_of(VIEWS[name], stage.surface, settings, *(OVERSAMPLED * n for n in SIZE))
        made = reference.draw(
            stage.surface,
            Scene(settings, camera, ground_m=span_m(stage.document.layers), instances=True),
            stage.channels,
        )
        path = OUT / f"{name}.webp"
        Image.fromarray(made.pixels).resize(SIZE, Image.Resampling.LANCZOS).save(path, quality=84, method=6)
        sys.stdout.write(f"{name}: {path.stat().st_size // 1024} KiB\n")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
