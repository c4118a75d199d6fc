"""The starting terrains: seven stroke documents, drawn by ``draw.py``, two of real ground, cut out by ``real.py``, and
six lessons with their tasks and plans, written by ``teaching.py``.

They are real input for benchmarks and tests too. ``catalogue()`` lists them, ``load(id)`` gives one. It may know
``api``, ``contract``, ``document``, ``importing``, ``lesson``, ``patchwork``, ``resources`` and ``tasks``.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from esker.contract import Document
from esker.patchwork.raster import rasters
from esker.patchwork.raster.rasters import Raster
from esker.templates import survey
from esker.templates.plans import Language as Language
from esker.templates.plans import Plan as Plan
from esker.templates.plans import plans as plans

FOLDER = Path(__file__).parent
DRAWN = FOLDER / "drawn"
ORDER = ("figure-six", "alpine-ridge", "canyon", "volcanic-island", "archipelago")
"""Those that are drawn, and scenes of the gallery too."""
LOWLANDS = ("delta", "badland")
"""Those that are drawn and show what water does."""
REAL = ("rainier", "helens")
"""Those of real ground."""


@dataclass(frozen=True)
class Template:
    """A starting terrain: what the landing page shows, and the document that a new terrain starts from.

    ``grids``: names of the kept grids of its elevation layers, by ``Layer.content``.
    """

    id: str
    title: str
    description: str
    document: Document
    grids: Mapping[str, str] = field(default_factory=dict)

    def rasters(self) -> dict[str, Raster]:
        """The grids of its elevation layers, by ``Layer.content``: made at the first call, which takes a second.

        Raises ValueError for a kept grid that is not the one that the document names.
        """
        return dict(_rasters(self.id))


@cache
def _rasters(template_id: str) -> dict[str, Raster]:
    made = {}
    for content, name in load(template_id).grids.items():
        kept = survey.read(survey.FOLDER / f"{name}.npz")
        made[content] = rasters.build(kept.heights, kept.warp)
        if made[content].digest != content:
            raise ValueError(f"{name}.npz is not the grid that {template_id}.json names: run esker.templates.real")
    return made


@cache
def catalogue() -> tuple[Template, ...]:
    """All starting terrains, in the order of the landing page."""
    drawn = (DRAWN / f"{name}.json" for name in (*ORDER, *LOWLANDS))
    return tuple(_read(path) for path in (*drawn, *(FOLDER / f"{name}.json" for name in REAL)))


@cache
def lessons() -> tuple[Template, ...]:
    """All lessons, in the order of the landing page."""
    return tuple(_read(FOLDER / "lessons" / f"{name}.json") for name in plans())


def document(template_id: str, language: Language = "en") -> Document:
    """What a new terrain starts from. A lesson has its title and what pupils read in a language.

    Raises KeyError for an unknown id.
    """
    found = load(template_id).document
    plan, task = plans(language).get(template_id), found.settings.task
    if plan is None or task is None:
        return found
    words = {"title": plan.title, "task": task.model_copy(update={"title": plan.title, "text": plan.task})}
    return found.model_copy(update={"settings": found.settings.model_copy(update=words)})


def load(template_id: str) -> Template:
    """One starting terrain or lesson. Raises KeyError for an unknown id."""
    for template in (*catalogue(), *lessons()):
        if template.id == template_id:
            return template
    raise KeyError(template_id)


def _read(path: Path) -> Template:
    data = json.loads(path.read_text(encoding="utf-8"))
    document = Document.model_validate_json(json.dumps(data["document"]))
    return Template(data["id"], data["title"], data["description"], document, data.get("grids", {}))
