"""The words of the six lessons: what pupils read, and a plan for the teacher each (``lessons/plans.json``, and
``lessons/plans.LANGUAGE.json`` for other languages, decision 74)."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final, Literal

FOLDER: Final = Path(__file__).parent / "lessons"
Language = Literal["en", "de"]
"""Languages that the plans are written in."""


@dataclass(frozen=True)
class Plan:
    """``task`` is for pupils, all else for the teacher.

    ``steps``: minutes and what happens; ``ask``: a question and what one hopes to hear; ``truth``: what of the terrain
    is real, and what is not.
    """

    title: str
    description: str
    minutes: int
    ages: str
    goal: str
    task: str
    before: tuple[str, ...]
    steps: tuple[dict[str, Any], ...]
    ask: tuple[dict[str, str], ...]
    truth: str


@cache
def plans(language: Language = "en") -> dict[str, Plan]:
    """All plans in a language by the ids of their lessons, in the order of the gallery."""
    name = "plans.json" if language == "en" else f"plans.{language}.json"
    data = json.loads((FOLDER / name).read_text(encoding="utf-8"))
    return {name: Plan(**{key: _fixed(value) for key, value in fields.items()}) for name, fields in data.items()}


def _fixed(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value
