"""What the server and the process that reads say to each other: one line of JSON in, lines of JSON out."""

from __future__ import annotations

from typing import Annotated, Final, Literal

from pydantic import Field, TypeAdapter

from esker import contract as c

OWN_FORMAT: Final = "PNG by Esker"
"""A heightmap of Esker's own: its text says how high it is and where it lay."""


class Task(c.Wire):
    """What to do. ``name``: the file's own; ``workdir``: where archives are unpacked, empty, removed by the parent."""

    task: Literal["inspect", "convert"]
    path: str
    name: str
    workdir: str
    out_dir: str = ""
    answers: c.ImportAnswers = c.ImportAnswers()
    place: c.Place | None = None
    size_m: float | None = None


class Step(c.Wire):
    """How far it is."""

    type: Literal["step"] = "step"
    stage: c.ImportStage
    share: c.Unit


class Inspected(c.Wire):
    """An inspection is done."""

    type: Literal["inspected"] = "inspected"
    report: c.ImportReport


class Converted(c.Wire):
    """A conversion is done; the raster lies in ``out_dir``."""

    type: Literal["converted"] = "converted"
    layer: c.Layer


class Refused(c.Wire):
    """It cannot be done."""

    type: Literal["refused"] = "refused"
    sentence: str


Line = Annotated[Step | Inspected | Converted | Refused, Field(discriminator="type")]
LINE: TypeAdapter[Step | Inspected | Converted | Refused] = TypeAdapter(Line)
