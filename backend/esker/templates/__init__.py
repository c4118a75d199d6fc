"""The five starting terrains: stroke documents in the repository, drawn by ``draw.py`` (issue: "drawn with care").

They are real input for benchmarks and tests too. ``catalogue()`` lists them, ``load(id)`` gives one.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from esker.contract import Document

FOLDER = Path(__file__).parent
ORDER = ("figure-six", "alpine-ridge", "canyon", "volcanic-island", "archipelago")


@dataclass(frozen=True)
class Template:
    """A starting terrain: what the landing page shows, and the document that a new terrain starts from."""

    id: str
    title: str
    description: str
    document: Document


@cache
def catalogue() -> tuple[Template, ...]:
    """All starting terrains, in the order of the landing page."""
    return tuple(_read(FOLDER / f"{name}.json") for name in ORDER)


def load(template_id: str) -> Template:
    """One starting terrain. Raises KeyError for an unknown id."""
    for template in catalogue():
        if template.id == template_id:
            return template
    raise KeyError(template_id)


def _read(path: Path) -> Template:
    data = json.loads(path.read_text(encoding="utf-8"))
    document = Document.model_validate_json(json.dumps(data["document"]))
    return Template(data["id"], data["title"], data["description"], document)
