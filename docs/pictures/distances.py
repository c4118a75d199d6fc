"""Draws the ground from five distances in four looks: ``python docs/pictures/distances.py [look ...]``.

Writes docs/pictures/up-close-<look>.webp: half a metre, 2, 10, 50 and 500 metres from the same place, side by side.
No browser and no GPU are needed; a look takes a minute or two on two cores.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Final, NamedTuple

from PIL import Image

from esker import templates
from esker.contract import DEFAULT_LEVEL
from esker.render.frame import Scene
from esker.render.pictures.studio import prepare
from esker.render.pictures.views import camera_of
from esker.render.reference import Reference
from esker.solve.solver import Solver

HERE: Final = Path(__file__).resolve().parent
SIZE: Final = (480, 300)
DISTANCES: Final = ((0.5, 34), (2, 28), (10, 22), (50, 18), (500, 14))
"""Metres, and degrees above the ground."""


class Place(NamedTuple):
    """What is looked at: a starting terrain, a place on it, from where, and the sun (None: its own)."""

    terrain: str
    at: tuple[float, float]
    azimuth_deg: float
    sun: tuple[float, float] | None


PLACES: Final = {
    "natural": Place("alpine-ridge", (2000, 1370), 200, (160, 26)),
    "alpine": Place("alpine-ridge", (1600, 1950), 190, (160, 20)),
    "desert": Place("canyon", (1500, 1900), 200, None),
    "paper": Place("figure-six", (1500, 1640), 200, None),
}


def row(look: str, reference: Reference, solver: Solver) -> Image.Image:
    """The pictures of a look, side by side."""
    place = PLACES[look]
    template = templates.load(place.terrain)
    changes: dict[str, object] = {"look": look}
    if place.sun is not None:
        changes |= {"sun_azimuth_deg": place.sun[0], "sun_elevation_deg": place.sun[1]}
    settings = template.document.settings.model_copy(update=changes)
    stage = prepare(template.document.model_copy(update={"settings": settings}), solver, grids=template.rasters())
    out = Image.new("RGB", (SIZE[0] * len(DISTANCES), SIZE[1]))
    for k, (distance, elevation) in enumerate(DISTANCES):
        text = f"orbit:{place.azimuth_deg},{elevation},{distance},target:{place.at[0]},{place.at[1]}"
        camera = camera_of(text, stage.surface, settings, *SIZE)
        made = reference.draw(stage.surface, Scene(settings, camera, 1.0, instances=True), stage.channels)
        out.paste(Image.fromarray(made.pixels), (k * SIZE[0], 0))
    return out


def main() -> None:
    """Draws the named looks, or all."""
    reference, solver = Reference("rich"), Solver(max_level=DEFAULT_LEVEL)
    for look in sys.argv[1:] or list(PLACES):
        path = HERE / f"up-close-{look}.webp"
        row(look, reference, solver).save(path, quality=82, method=6)
        sys.stdout.write(f"{look}: {path.stat().st_size // 1024} KiB\n")


if __name__ == "__main__":
    main()
