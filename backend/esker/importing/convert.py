"""From an examined file to a raster on disk and the layer that lays it on the terrain."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import BinaryIO, Final

import numpy as np
from numpy.lib import format as npy

from esker import contract as c
from esker.importing import questions
from esker.importing.answers import MIDDLE, given
from esker.importing.examine import Exam, examine
from esker.importing.placement.fitting import Laid
from esker.importing.placement.placing import Terrain
from esker.importing.refusal import ImportRefused
from esker.importing.scan import usable
from esker.patchwork.raster import rasters

Progress = Callable[[c.ImportStage, float], None]
UNNAMED: Final = "new"
"""Id of a layer that has none yet: the server gives it one."""


def convert(
    path: Path, name: str, answers: c.ImportAnswers, terrain: Terrain, out_dir: Path, workdir: Path, progress: Progress
) -> c.Layer:
    """Writes the raster to ``out_dir`` and returns the layer (id, author and priority are for the caller to set).

    ``progress``: stage and share of the whole conversion. Raises ImportRefused; ``out_dir`` is then of no use.
    """
    exam = examine(path, name, workdir, given(answers), terrain, lambda share: progress("reading", 0.25 * share))
    if exam.placed.far_m is not None and "place" not in answers.answers and answers.anchor is None:
        raise ImportRefused(
            f"It lies {exam.placed.far_m / 1000:,.0f} km from this terrain. Answer place={MIDDLE} "
            "to lay it in the middle."
        )
    _check_heights(exam, answers, terrain)
    laid = _laid(exam, answers)
    out_dir.mkdir(parents=True, exist_ok=True)
    _write_heights(exam, laid, out_dir / rasters.HEIGHTS, lambda share: progress("reading", 0.25 + 0.15 * share))
    exam.source.close()
    heights = np.load(out_dir / rasters.HEIGHTS, mmap_mode="r")
    spans: dict[str, tuple[c.ImportStage, float, float]] = {
        "mipmaps": ("mipmaps", 0.4, 0.1),
        "errors": ("errors", 0.5, 0.45),
    }

    def built(stage: str, share: float) -> None:
        named, start, length = spans[stage]
        progress(named, start + length * share)

    try:
        raster = rasters.build_out_of_core(heights, out_dir, laid.warp, built)
    except rasters.RasterError as error:
        raise ImportRefused(f"No grid can be made of it: {error}.") from error
    progress("saving", 1.0)
    return _layer(exam, laid, answers, raster)


def _laid(exam: Exam, answers: c.ImportAnswers) -> Laid:
    """The place by the file, or by the hand of whoever answered."""
    laid = exam.placed.laid
    assert laid is not None  # a terrain was given, so that even a grid without a place is fitted to it
    if answers.rotation_deg is not None:
        laid = replace(laid, rotation_deg=answers.rotation_deg)
    if answers.spacing_m is not None:
        laid = replace(laid, spacing_m=answers.spacing_m)
    if answers.anchor is not None:
        laid = replace(laid, anchor=answers.anchor)
    if max(map(abs, laid.anchor)) > c.ABSOLUTE_BOUND_M:
        raise ImportRefused("It reaches too far out of the terrain. Cut out the part that you need first.")
    return laid


def _check_heights(exam: Exam, answers: c.ImportAnswers, terrain: Terrain) -> None:
    """Raises ImportRefused for a scale and a lift by hand that the terrain could not hold, before anything is made."""
    scale = 1.0 if answers.scale is None else answers.scale
    lift = exam.lift_m if answers.lift_m is None else answers.lift_m
    farthest = max(abs(scale * z + lift) for z in exam.span_m)
    held = questions.held_m(terrain.size_m)
    if farthest > held:
        raise ImportRefused(
            f"Laid so, its heights would reach {farthest:,.0f} m from zero; a terrain {terrain.size_m:,.0f} m wide "
            f"holds {held:,.0f} m. Lower it, or make a terrain at least {questions.size_for_m(farthest):,.0f} m wide."
        )


def _write_heights(exam: Exam, laid: Laid, path: Path, progress: Callable[[float], None]) -> None:
    """Writes float32 metres with NaN for nodata as an NPY file, the first row in the south, without mapping it."""
    source = exam.source
    done = 0
    with path.open("wb") as file:
        shape = (source.rows, source.cols)
        npy.write_array_header_1_0(file, {"descr": "<f4", "fortran_order": False, "shape": shape})
        start = file.tell()
        file.truncate(start + 4 * source.rows * source.cols)
        for piece in source.pieces():
            metres = piece.values * exam.gain + exam.bias
            metres[~usable(piece, exam.masked)] = np.nan
            row, col = piece.row, piece.col
            if laid.flip_rows:
                metres, row = metres[::-1], source.rows - row - metres.shape[0]
            if laid.flip_cols:
                metres, col = metres[:, ::-1], source.cols - col - metres.shape[1]
            _put(file, start, source.cols, row, col, metres.astype("<f4"))
            done += metres.size
            progress(done / (source.rows * source.cols))


def _put(file: BinaryIO, start: int, cols: int, row: int, col: int, values: np.ndarray) -> None:
    if values.shape[1] == cols:
        file.seek(start + 4 * row * cols)
        file.write(np.ascontiguousarray(values).data)
        return
    for k, line in enumerate(values):
        file.seek(start + 4 * ((row + k) * cols + col))
        file.write(np.ascontiguousarray(line).data)


def _layer(exam: Exam, laid: Laid, answers: c.ImportAnswers, raster: rasters.Raster) -> c.Layer:
    name = exam.report.file
    accuracy = questions.accuracy_m(laid.spacing_m, exam.step_m)
    placed = exam.placed
    geo = placed.geo and answers.anchor is None
    facts = raster.facts(geo=geo, crs=placed.crs, format=exam.source.format, file=name)
    scale = answers.scale if answers.scale is not None else 1.0
    return c.Layer(
        id=UNNAMED,
        content=raster.digest,
        facts=facts,
        name=answers.name if answers.name is not None else os.path.splitext(name)[0],
        anchor=laid.anchor,
        rotation_deg=laid.rotation_deg,
        spacing_m=laid.spacing_m,
        scale=scale,
        lift_m=answers.lift_m if answers.lift_m is not None else exam.lift_m,
        accuracy_m=answers.accuracy_m if answers.accuracy_m is not None else accuracy * max(1.0, abs(scale)),
        source=answers.source or "",
        licence=answers.licence or "",
    )
