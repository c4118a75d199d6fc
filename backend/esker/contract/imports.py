"""How an elevation file comes in: what it is, what it asks, how far it is (DESIGN 11)."""

from __future__ import annotations

from typing import Annotated, Final, Literal

from pydantic import Field, StringConstraints

from esker.contract.document import Step, Stretch, Turn
from esker.contract.values import Id, Length, Line, Metres, Name, Unit, Wire


class ImportQuestion(Wire):
    """Something that a file does not say, or seems to say wrongly.

    ``id``: "nodata" | "place" | "size" | "range" | "imagery" | "accuracy" | ...; ``options``: values that may be
    answered (empty: any number); ``default``: what is taken when nobody answers otherwise.
    """

    id: Annotated[str, StringConstraints(max_length=24)]
    text: Line
    options: tuple[Line, ...] = ()
    default: Line = ""


class ImportReport(Wire):
    """What an elevation file is and what would happen (``esker import --check``). ``verdict``: good, ask or refused.

    ``spacing_m``, ``rotation_deg``, ``width_m``, ``height_m``: on the ground. ``at``: WGS 84 of its middle, (lat, lon).
    ``preview``: 32 rows (south first) of 32 heights, 0..255 between low and high, -1 where there is none.
    """

    verdict: Literal["good", "ask", "refused"]
    file: Name
    format: Name = ""
    rows: int = 0
    cols: int = 0
    dtype: Name = ""
    crs: Name = ""
    spacing_m: tuple[float, float] | None = None
    rotation_deg: float = 0.0
    width_m: float | None = None
    height_m: float | None = None
    at: tuple[float, float] | None = None
    low_m: float | None = None
    high_m: float | None = None
    valid: float | None = None
    nodata: float | None = None
    accuracy_m: float | None = None
    notes: tuple[Line, ...] = ()
    questions: tuple[ImportQuestion, ...] = ()
    refusal: Line = ""
    preview: tuple[tuple[int, ...], ...] = ()


ImportStage = Literal["upload", "reading", "question", "mipmaps", "errors", "saving", "done", "refused", "cancelled"]
ENDED_IMPORT: Final = frozenset({"done", "refused", "cancelled"})
"""Stages after which an import goes on no more."""


class ImportStatus(Wire):
    """Where an import stands. ``share``: 0..1 of all the work; ``layer``: its id once it is done."""

    id: Id
    stage: ImportStage
    share: Unit = 0.0
    text: Line = ""
    report: ImportReport | None = None
    layer: Id | None = None


class ImportAnswers(Wire):
    """How an import goes on: answers by question id, and where to lay a grid that has no place of its own."""

    answers: dict[Annotated[str, StringConstraints(max_length=24)], Line] = Field(default_factory=dict)
    anchor: tuple[Metres, Metres] | None = None
    rotation_deg: Turn | None = None
    spacing_m: tuple[Step, Step] | None = None
    scale: Stretch | None = None
    lift_m: Metres | None = None
    accuracy_m: Length | None = None
    name: Name | None = None
    source: Line | None = None
    licence: Line | None = None
