"""What the server and the process that exports say to each other: one line of JSON in, lines of JSON out."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, TypeAdapter

from esker import contract as c
from esker.document.wire import document_json


class Task(c.Wire):
    """What to do. ``grids``: the folder of the layers' rasters, by digest; ``folder``: where the file goes, empty;
    ``name``: of the file, without a suffix. ``device``, ``threads``: as for ``Solver``."""

    document: c.Document
    wanted: c.ExportRequest
    grids: str
    folder: str
    name: str
    device: str | None = None
    threads: int | None = None
    global_level: int = c.DEFAULT_LEVEL
    refined_level: int = c.DEFAULT_REFINED_LEVEL


def task_line(task: Task) -> str:
    """The line of a task, without its end. A heavy document takes long: this is for a thread."""
    head = task.model_dump_json(exclude={"document"})
    return f'{{"document":{document_json(task.document)},{head[1:]}'


class Step(c.Wire):
    """How far it is."""

    type: Literal["step"] = "step"
    stage: c.ExportStage
    share: c.Unit


class Made(c.Wire):
    """The file is whole. Metres."""

    type: Literal["made"] = "made"
    file: str
    bytes: int
    low_m: float
    high_m: float
    spacing_m: float


class Failed(c.Wire):
    """There will be no file."""

    type: Literal["failed"] = "failed"
    sentence: str


Line = Annotated[Step | Made | Failed, Field(discriminator="type")]
LINE: TypeAdapter[Step | Made | Failed] = TypeAdapter(Line)
