"""Formats by name and by the suffix of a file."""

from __future__ import annotations

import datetime
import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Final, NamedTuple

from esker import contract
from esker.contract import ExportEstimate, ExportFormat, ExportRequest, ModelOptions, PaperOptions
from esker.exporting.flowmasks import with_flow
from esker.exporting.ground import Extent, Ground, HeightSource, take
from esker.exporting.heightmaps import write_geotiff, write_npy, write_png, write_r16
from esker.exporting.masks import write_masks
from esker.exporting.mesh import write_glb
from esker.exporting.printing import pdf, svg
from esker.exporting.printing.drawing import Drawing
from esker.exporting.printing.layout import contour_map
from esker.exporting.printing.solid import write_solid
from esker.exporting.weights import weighted

Step = Callable[[contract.ExportStage, float], None]
"""Told the stage, and the share of it that is done."""


class Options(NamedTuple):
    """What only some kinds of file have a choice of."""

    paper: PaperOptions
    model: ModelOptions


class Format(NamedTuple):
    """How a kind of file is written. ``covers``: it needs them; ``bytes_each``: of a sample, as measured on terrains
    with detail; of maps, which are lines, of a row of samples; ``sent``: the suffix that the page's file has, where one
    name stands for several files."""

    suffixes: tuple[str, ...]
    write: Callable[[Path, Ground, Options], None]
    media: str
    bytes_each: float
    covers: bool = False
    sent: str = ""
    most: int = 4097


def _plain(write: Callable[[Path, Ground], None]) -> Callable[[Path, Ground, Options], None]:
    """A writer of files that have no choice."""
    return lambda path, ground, _: write(path, ground)


def _map(write: Callable[[Path, Drawing], None]) -> Callable[[Path, Ground, Options], None]:
    """A writer of contour maps, with the day on which they are made."""

    def made(path: Path, ground: Ground, options: Options) -> None:
        write(path, contour_map(ground, options.paper, datetime.datetime.now(datetime.UTC).date()))

    return made


FORMATS: Final[dict[ExportFormat, Format]] = {
    "png16": Format((".png",), _plain(write_png), "image/png", 1.4),
    "r16": Format((".r16", ".raw"), _plain(write_r16), "application/zip", 1.4, sent=".zip"),
    "geotiff": Format((".tif", ".tiff"), _plain(write_geotiff), "image/tiff", 2.6),
    "npy": Format((".npy",), _plain(write_npy), "application/octet-stream", 4.0),
    "glb": Format(
        (".glb",), _plain(write_glb), "model/gltf-binary", 58.5, covers=True, most=contract.EXPORT_MESH_SAMPLES
    ),
    "masks": Format((".zip",), _plain(write_masks), "application/zip", 4.2, covers=True),
    "map_pdf": Format(
        (".pdf",), _map(pdf.write_drawing), "application/pdf", 200.0, covers=True, most=contract.EXPORT_MAP_SAMPLES
    ),
    "map_svg": Format(
        (".svg",), _map(svg.write_drawing), "image/svg+xml", 560.0, covers=True, most=contract.EXPORT_MAP_SAMPLES
    ),
    "stl": Format(
        (".stl",),
        lambda path, ground, options: write_solid(path, ground, options.model),
        "model/stl",
        100.0,
        most=contract.EXPORT_MESH_SAMPLES,
    ),
}
SUFFIXES: Final = {suffix: name for name, made in FORMATS.items() for suffix in made.suffixes}

MASKS: Final = "masks"
MAPS: Final = ("map_pdf", "map_svg")
SOLID: Final = "stl"
ONLY_MAPS: Final = "Only contour maps (.pdf, .svg) have paper, a scale and an interval."
ONLY_SOLIDS: Final = "Only solids (.stl) have a width, a base and an exaggeration."
ONLY_MASKS: Final = "Only masks (.zip) can be made to sum to one."
PLAIN_SECONDS, DETAIL_SECONDS, MASKS_SECONDS, START_SECONDS = 0.6, 1.1, 1.9, 3.0
"""A million samples take so long without and with detail and with masks, and the process's start does, on two cores at
rest (docs/exporting.md)."""
FALLEN: Final = {"solving": (0.0, 0.3), "detail": (0.3, 0.9), "writing": (0.9, 1.0)}


def format_of(path: Path) -> ExportFormat:
    """The format of a file's suffix. Raises ValueError."""
    found = SUFFIXES.get(path.suffix.lower())
    if found is None:
        raise ValueError(f"exports are {', '.join(SUFFIXES)}, not '{path.suffix or path.name}'")
    return found


def refusal(wanted: ExportRequest) -> str:
    """Why there is no such export, as a sentence; empty where there is."""
    if str(wanted.samples) not in contract.EXPORT_LEVELS:
        return f"Samples a side are one of {', '.join(contract.EXPORT_LEVELS)}."
    if wanted.weights and wanted.format != MASKS:
        return ONLY_MASKS
    if wanted.paper is not None and wanted.format not in MAPS:
        return ONLY_MAPS
    if wanted.model is not None and wanted.format != SOLID:
        return ONLY_SOLIDS
    if wanted.samples > FORMATS[wanted.format].most:
        what = {"glb": "A mesh", SOLID: "A solid"}.get(wanted.format, "A contour map")
        return f"{what} has at most {FORMATS[wanted.format].most} samples a side."
    return ""


def estimate(wanted: ExportRequest) -> ExportEstimate:
    """About what an export costs; see Format.bytes_each."""
    form = FORMATS[wanted.format]
    million = wanted.samples**2 / 1e6
    million_seconds = DETAIL_SECONDS if wanted.detail or form.covers else PLAIN_SECONDS
    seconds = START_SECONDS + million * (MASKS_SECONDS if wanted.format == MASKS else million_seconds)
    each = wanted.samples if wanted.format in MAPS else wanted.samples**2
    return ExportEstimate(bytes=round(form.bytes_each * each), seconds=round(seconds, 1))


def export(
    terrain: HeightSource,
    path: Path,
    kind: ExportFormat,
    extent: Extent,
    *,
    detail: bool,
    step: Step,
    weights: bool = False,
    paper: PaperOptions | None = None,
    model: ModelOptions | None = None,
    **levels: int,
) -> Ground:
    """Takes the ground of a terrain and writes it to ``path``; returns what was written. ``weights``: masks that sum to
    one (``exports.weights``); ``paper``, ``model``: how maps and solids are made; ``levels``: as in ``take``.

    A file is whole or is not there. Raises ValueError, OSError, and what solves raise."""
    form = FORMATS[kind]
    if weights and kind != MASKS:
        raise ValueError(ONLY_MASKS)
    if paper is not None and kind not in MAPS:
        raise ValueError(ONLY_MAPS)
    if model is not None and kind != SOLID:
        raise ValueError(ONLY_SOLIDS)
    ground = take(
        terrain,
        extent,
        detail=detail,
        masks=form.covers,
        solved=kind in MAPS,
        progress=lambda share: step("detail", share),
        **levels,
    )
    if weights:
        ground = weighted(ground)
    elif kind == MASKS:
        ground = with_flow(terrain, ground, **levels)
    step("writing", 0.0)
    try:
        form.write(path, ground, Options(paper or PaperOptions(), model or ModelOptions()))
    except BaseException:
        path.unlink(missing_ok=True)
        raise
    return ground


def sent_name(kind: ExportFormat, stem: str) -> str:
    """What the page's file is called."""
    form = FORMATS[kind]
    return stem + (form.sent or form.suffixes[0])


def packed(folder: Path, name: str) -> None:
    """All files of a folder as one .zip in it, in their place: a heightmap with its side-car travels as one file."""
    files = sorted(folder.iterdir())
    with zipfile.ZipFile(folder / name, "w", zipfile.ZIP_DEFLATED, compresslevel=4) as archive:
        for file in files:
            archive.write(file, file.name)
    for file in files:
        file.unlink()


def free_bytes(folder: Path) -> int:
    """Room on the disk of a folder."""
    return shutil.disk_usage(folder).free


def share_of(stage: str, share: float) -> float:
    """The share of the whole work."""
    begin, end = FALLEN[stage]
    return begin + (end - begin) * min(1.0, max(0.0, share))
