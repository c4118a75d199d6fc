"""From a terrain to what can be drawn: the document, the settled ground with its detail, the scene."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from esker import templates
from esker.api.layers import Patchwork, unpacked
from esker.contract import DEFAULT_LEVEL, DEFAULT_REFINED_LEVEL, Document
from esker.document import archive
from esker.document.layers import span_m
from esker.events import SolveEvent
from esker.patchwork.raster.rasters import Raster
from esker.render.camera import Land
from esker.render.reference import PLAIN_CHANNELS, Channels
from esker.render.surface import Surface
from esker.solve.detail import detailed, settle
from esker.solve.solver import Solver
from esker.synthesis.subdivide import finest_level

GONE: Final = "There is no file, starting terrain or link {!r}. The starting terrains are {}."


@dataclass(frozen=True)
class Stage:
    """A terrain that is ready to be drawn."""

    document: Document
    surface: Surface
    channels: Channels

    @property
    def land(self) -> Land | None:
        """What a view from home looks at where the land is real (the page's stage.ts)."""
        if not self.document.layers:
            return None
        step = self.document.settings.size_m / 128
        mean, low = self.surface.coarse_m
        return Land(step * math.floor(mean / step + 0.5), step * math.floor(low / step + 0.5))


class Opened(NamedTuple):
    """A document and the grids of its elevation layers, by ``Layer.content``."""

    document: Document
    grids: Mapping[str, Raster]


def open_terrain(name: str) -> Opened:
    """The terrain of a file (.esker or .json), a starting terrain, or a link to a terrain on a server.

    Raises ValueError with a sentence, OSError, and what ``esker.connect`` raises for links.
    """
    if name.startswith(("http://", "https://")):
        from esker.api.live.client import connect

        with connect(name, "Picture") as live:
            return Opened(live.document, live.grids)
    path = Path(name)
    if path.is_file():
        data = path.read_bytes()
        if data[:2] != b"PK":
            return Opened(archive.document_from_json(data), {})
        return Opened(archive.loads(data), unpacked(data))
    try:
        template = templates.load(name)
        return Opened(template.document, template.rasters())
    except KeyError:
        known = ", ".join(t.id for t in templates.catalogue())
        raise ValueError(GONE.format(name, known)) from None


def prepare(
    document: Document,
    solver: Solver,
    *,
    grids: Mapping[str, Raster] | None = None,
    level: int = DEFAULT_LEVEL,
    refined: int = DEFAULT_REFINED_LEVEL,
    step: Callable[[SolveEvent], None] | None = None,
) -> Stage:
    """Settles the ground: levels 0..``level`` as a whole, finer ones where they are drawn, refined up to ``refined``,
    synthesised beyond. ``grids``: those of the elevation layers. ``step`` is told the steps of the solve. Raises
    ValueError where a grid is missing, and what solves raise."""
    settings = document.settings
    base = Patchwork(settings, document.layers, grids).base
    settled = settle(solver, document.strokes, settings, level, step, base=base)
    terrain = detailed(solver, settled, refined, span_m(document.layers))
    asked = terrain.site.channels
    channels = Channels(
        np.asarray(asked.get("amplitude", PLAIN_CHANNELS.amplitude)),
        np.asarray(asked.get("roughness", PLAIN_CHANNELS.roughness)),
    )
    return Stage(document, Surface.of(terrain, finest_level(settings.size_m)), channels)
