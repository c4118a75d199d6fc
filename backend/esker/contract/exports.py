"""How a terrain leaves for other programs: what is wanted, how far it is (docs/exporting.md)."""

from __future__ import annotations

from typing import Annotated, Final, Literal

from pydantic import Field

from esker.contract.values import Clock, Id, Line, Name, Unit, Wire

EXPORT_LEVELS: Final = {
    "257": 2, "505": 3, "513": 3, "1009": 4, "1025": 4, "2017": 5, "2049": 5, "4033": 6, "4097": 6,
}  # fmt: skip
"""Samples a side that an export may have, and the level that they are taken from: its own 2^n + 1, or the few less that
Unreal Engine's landscapes have, interpolated from it."""
EXPORT_MESH_SAMPLES: Final = 1025
"""The most that a mesh may have a side: a million vertices."""
EXPORT_MAP_SAMPLES: Final = 2049
"""The most that a contour map is drawn from a side: more than paper shows."""

ExportFormat = Literal["png16", "r16", "geotiff", "npy", "glb", "masks", "map_pdf", "map_svg", "stl"]
Paper = Literal["a4", "a3"]
ExportStage = Literal["waiting", "solving", "detail", "writing", "done", "failed", "cancelled"]


class PaperOptions(Wire):
    """How a contour map is printed. ``scale``: the denominator, 0 for the largest round one that fits the paper;
    ``interval_m``: height between contours, 0 for a round one that suits the relief."""

    size: Paper = "a4"
    scale: Annotated[int, Field(ge=0, le=50_000_000)] = 0
    interval_m: Annotated[float, Field(ge=0, le=10_000)] = 0.0


class ModelOptions(Wire):
    """The size of a solid for printers. ``width_mm``: its longer side; ``base_mm``: what lies under its lowest point;
    ``exaggeration``: of heights."""

    width_mm: Annotated[float, Field(ge=10, le=2000)] = 150.0
    base_mm: Annotated[float, Field(ge=0.2, le=200)] = 3.0
    exaggeration: Annotated[float, Field(ge=0.1, le=20)] = 1.0


class ExportRequest(Wire):
    """What is to be exported. ``detail``: with the synthesised detail, as the page shows it; masks always are.
    ``weights``: masks that sum to one, for masks. ``paper``: of contour maps only, ``model``: of solids only; None for
    defaults. ``at``: the clock of the document, None for now."""

    format: ExportFormat
    samples: Annotated[int, Field(ge=2, le=4097)] = 1025
    detail: bool = True
    weights: bool = False
    paper: PaperOptions | None = None
    model: ModelOptions | None = None
    at: Clock | None = None


class ExportEstimate(Wire):
    """What an export would cost. ``seconds``: of work, waiting for others' exports not counted."""

    bytes: int
    seconds: float


class ExportStatus(Wire):
    """Where an export stands. ``share``: 0..1 of all the work; once it is done ``file``, ``bytes``, and the range and
    spacing of its heights in metres."""

    id: Id
    stage: ExportStage
    share: Unit = 0.0
    text: Line = ""
    file: Name = ""
    bytes: int = 0
    low_m: float = 0.0
    high_m: float = 0.0
    spacing_m: float = 0.0
