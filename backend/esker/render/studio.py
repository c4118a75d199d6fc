"""From a terrain to what can be drawn: the document, the settled ground with its detail, the scene."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from esker import templates
from esker.contract import DEFAULT_LEVEL, DEFAULT_REFINED_LEVEL, Document
from esker.document import archive
from esker.render.reference import PLAIN_CHANNELS, Channels
from esker.render.surface import Surface
from esker.solve.detail import detailed, settle
from esker.solve.solver import LevelResult, Solver
from esker.synthesis.subdivide import finest_level

GONE: Final = "There is no file, starting terrain or link {!r}. The starting terrains are {}."


@dataclass(frozen=True)
class Stage:
    """A terrain that is ready to be drawn."""

    document: Document
    surface: Surface
    channels: Channels


def open_document(name: str) -> Document:
    """The document of a file (.esker or .json), a starting terrain, or a link to a terrain on a server.

    Raises ValueError with a sentence, OSError, and what ``esker.connect`` raises for links.
    """
    if name.startswith(("http://", "https://")):
        from esker.client import connect

        with connect(name, "Picture") as live:
            return live.document
    path = Path(name)
    if path.is_file():
        data = path.read_bytes()
        return archive.loads(data) if data[:2] == b"PK" else archive.document_from_json(data)
    try:
        return templates.load(name).document
    except KeyError:
        known = ", ".join(t.id for t in templates.catalogue())
        raise ValueError(GONE.format(name, known)) from None


def prepare(
    document: Document,
    solver: Solver,
    *,
    level: int = DEFAULT_LEVEL,
    refined: int = DEFAULT_REFINED_LEVEL,
    step: Callable[[LevelResult | None], None] | None = None,
) -> Stage:
    """Settles the ground: levels 0..``level`` as a whole, finer ones where they are drawn, refined up to ``refined``,
    synthesised beyond. ``step`` is told the steps of the solve. Raises what solves raise."""
    settings = document.settings
    terrain = detailed(solver, settle(solver, document.strokes, settings, level, step), refined)
    asked = terrain.site.channels
    channels = Channels(
        np.asarray(asked.get("amplitude", PLAIN_CHANNELS.amplitude)),
        np.asarray(asked.get("roughness", PLAIN_CHANNELS.roughness)),
    )
    return Stage(document, Surface.of(terrain, finest_level(settings.size_m)), channels)
