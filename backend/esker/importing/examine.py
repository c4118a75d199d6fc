"""What a file is and what would happen: the report of an import, and the decisions that a conversion follows."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from esker import contract as c
from esker.importing import questions
from esker.importing.answers import FEET, KEEP, SHIFT, STOP
from esker.importing.formats import colours
from esker.importing.formats.gdal_source import GdalSource
from esker.importing.opening import Opened, open_source, set_encoding
from esker.importing.placement import placing
from esker.importing.placement.georef import horizontal_unit_m
from esker.importing.placement.placing import Placed, Terrain
from esker.importing.refusal import ImportRefused
from esker.importing.scan import Scan, scan
from esker.importing.source import Source

Progress = Callable[[float], None]


@dataclass(eq=False)
class Exam:
    """Everything decided about a file. Metres = ``gain`` * raw + ``bias``."""

    source: Source
    scan: Scan
    masked: tuple[float, ...]
    gain: float
    bias: float
    placed: Placed
    report: c.ImportReport
    lift_m: float = 0.0
    """What is added to all heights, so that the terrain can hold them."""

    @property
    def span_m(self) -> tuple[float, float]:
        """Lowest and highest valid sample, metres."""
        low, high = sorted((self.gain * self.scan.low + self.bias, self.gain * self.scan.high + self.bias))
        return low, high

    @property
    def step_m(self) -> float | None:
        """The smallest difference of heights that the file can say."""
        return None if self.source.step is None else abs(self.gain) * self.source.step


def examine(
    path: Path, name: str, workdir: Path, answers: Mapping[str, str], terrain: Terrain | None, progress: Progress
) -> Exam:
    """Reads a whole file once or twice and says what it is.

    ``answers``: by question id; what is not answered takes the default and stands in ``report.questions``.
    ``terrain``: where it would be laid; None: in a frame of its own. Raises ImportRefused with a sentence.
    """
    opened = open_source(path, name, workdir, answers)
    source = opened.source
    asked = _container_questions(opened, answers)
    found = _first_scan(source, answers, asked, lambda share: progress(0.5 * share))
    masked = _masked(source, found, answers, asked)
    if masked:
        found = scan(source, masked, lambda share: progress(0.5 + 0.5 * share))
    if found.valid == 0:
        raise ImportRefused("It holds no data: every sample is nodata.")
    gain, bias = _heights(source, found, answers, asked)
    placed = placing.place(source, answers, lambda question: _ask(asked, answers, question), terrain)
    unit_m = _unit_m(source, answers, asked)
    gain, bias = unit_m * gain, unit_m * bias
    exam = Exam(source, found, masked, gain, bias, placed, c.ImportReport(verdict="good", file=""))
    exam.lift_m = _lift_m(exam, answers, asked, terrain)
    exam.report = _report(exam, name, asked)
    return exam


def _ask(asked: list[c.ImportQuestion], answers: Mapping[str, str], question: c.ImportQuestion) -> str:
    """The answer to a question; when there is none it stands among those asked, and its default is taken."""
    answer = answers.get(question.id)
    if answer is None:
        asked.append(question)
        return question.default
    return answer.strip()


def _container_questions(opened: Opened, answers: Mapping[str, str]) -> list[c.ImportQuestion]:
    asked: list[c.ImportQuestion] = []
    source = opened.source
    if opened.types:
        _ask(asked, answers, questions.type_question(opened.types))
    if opened.shapes:
        _ask(asked, answers, questions.shape_question(opened.shapes))
    if source.bands > 1:
        _ask(asked, answers, questions.band_question(source.bands))
    if source.eight_bit and not source.colour and _ask(asked, answers, questions.IMAGERY) == STOP:
        raise ImportRefused("It was said to be a picture, not elevation.")
    if not source.row_order_known:
        orders = questions.ROW_ORDERS
        answer = _ask(asked, answers, questions.ROWS)
        if answer not in orders:
            raise ImportRefused(f"{answer[:40]!r} is no order of rows; there are: {', '.join(orders)}.")
    return asked


def _first_scan(source: Source, answers: Mapping[str, str], asked: list[c.ImportQuestion], progress: Progress) -> Scan:
    """A scan with what the file itself declares; of colours, in the code that makes sense."""
    if not source.colour or (isinstance(source, GdalSource) and source.encoding is not None):
        return scan(source, (), progress)
    assert isinstance(source, GdalSource)
    found: dict[colours.Encoding, Scan] = {}
    for encoding in colours.ENCODINGS:
        set_encoding(source, encoding)
        found[encoding] = scan(source, (), progress)
    likely = [e for e in found if found[e].valid and colours.plausible(found[e].low, found[e].high)]
    if not likely:
        raise ImportRefused("It is a picture in colours, and neither Terrarium nor Mapbox heights are coded in them.")
    likely.sort(key=lambda e: found[e].steps / max(found[e].high - found[e].low, 1e-9))
    answer = _ask(asked, answers, questions.encoding_question(colours.ENCODINGS, likely[0]))
    for encoding in colours.ENCODINGS:
        if answer == encoding:
            set_encoding(source, encoding)
            return found[encoding]
    raise ImportRefused(f"{answer[:40]!r} is no code of heights in colours; there are: {', '.join(colours.ENCODINGS)}.")


def _masked(
    source: Source, found: Scan, answers: Mapping[str, str], asked: list[c.ImportQuestion]
) -> tuple[float, ...]:
    suspects = () if source.own is not None else questions.suspects(found, source)
    if "nodata" in answers:
        return questions.parse_nodata(answers["nodata"])
    if not suspects:
        return ()
    return questions.parse_nodata(_ask(asked, answers, questions.nodata_question(suspects, found)))


def _heights(
    source: Source, found: Scan, answers: Mapping[str, str], asked: list[c.ImportQuestion]
) -> tuple[float, float]:
    """Gain and bias that make metres of raw samples. Raises ImportRefused when these are no heights."""
    gain, bias = source.gain, source.bias
    if not source.measured or "range" in answers:
        low, high = questions.parse_range(_ask(asked, answers, questions.range_question(found, source)))
        gain = (high - low) / (found.high - found.low) if found.high > found.low else 0.0
        bias = low - gain * found.low
    lowest, highest = sorted((gain * found.low + bias, gain * found.high + bias))
    if not (lowest >= -c.ABSOLUTE_BOUND_M and highest <= c.ABSOLUTE_BOUND_M):
        raise ImportRefused(f"Its heights run from {lowest:.6g} to {highest:.6g} m: these are no elevations in metres.")
    if lowest < questions.EARTH_M[0] or highest > questions.EARTH_M[1]:
        source.notes.append(f"Its heights run from {lowest:.6g} to {highest:.6g} m: nothing on Earth does.")
    return gain, bias


def _unit_m(source: Source, answers: Mapping[str, str], asked: list[c.ImportQuestion]) -> float:
    """Metres per unit of height where coordinates are in feet and nothing says what heights are in; else 1."""
    crs = source.georef.crs if source.georef is not None else None
    foot = horizontal_unit_m(crs) if crs is not None else None
    said = not source.measured or "range" in answers or source.unit_m is not None or source.colour
    if foot is None or said or not 0.3 < foot < 0.31:
        return 1.0
    answer = _ask(asked, answers, questions.UNIT)
    if answer not in questions.UNIT.options:
        raise ImportRefused(f"{answer[:40]!r} is no unit; there are: {', '.join(questions.UNIT.options)}.")
    return foot if answer == FEET else 1.0


def _lift_m(exam: Exam, answers: Mapping[str, str], asked: list[c.ImportQuestion], terrain: Terrain | None) -> float:
    """Metres by which heights are shifted that are too far from zero for the terrain. Raises ImportRefused."""
    low, high = exam.span_m
    if terrain is None or answers.get("height") == KEEP or max(abs(low), abs(high)) <= questions.held_m(terrain.size_m):
        return 0.0
    question, shift = questions.height_question(low, high, terrain.size_m)
    if _ask(asked, answers, question) != SHIFT:
        raise ImportRefused(f"Its heights reach farther from zero than this terrain of {terrain.size_m:,.0f} m holds.")
    exam.source.notes.append(f"All its heights are shifted by {shift:+,.0f} m, so that the terrain can hold them.")
    return shift


# --- report -----------------------------------------------------------------------------------------------------


def _report(exam: Exam, name: str, asked: list[c.ImportQuestion]) -> c.ImportReport:
    source, found, laid = exam.source, exam.scan, exam.placed.laid
    if found.infinite:
        source.notes.append(f"{found.infinite:,} infinite samples are left out.")
    if found.low == found.high:
        source.notes.append("All its samples have the same height: it is flat.")
    elif found.share < 0.5:
        source.notes.append(f"Only {found.share:.1%} of its samples hold data.")
    low, high = exam.span_m
    spacing = laid.spacing_m if laid is not None else None
    return c.ImportReport(
        verdict="ask" if asked else "good",
        file=name[: c.MAX_NAME_LENGTH],
        format=source.format,
        rows=source.rows,
        cols=source.cols,
        dtype=source.dtype,
        crs=exam.placed.crs,
        spacing_m=spacing,
        rotation_deg=laid.rotation_deg if laid is not None else 0.0,
        width_m=(source.cols - 1) * spacing[0] if spacing else None,
        height_m=(source.rows - 1) * spacing[1] if spacing else None,
        at=laid.at if laid is not None and exam.placed.geo else None,
        low_m=low,
        high_m=high,
        valid=found.share,
        nodata=source.nodata if source.nodata is not None and math.isfinite(source.nodata) else None,
        accuracy_m=questions.accuracy_m(spacing, exam.step_m) if spacing else None,
        notes=tuple(note[:240] for note in source.notes),
        questions=tuple(asked),
        preview=_preview(exam),
    )


def _preview(exam: Exam) -> tuple[tuple[int, ...], ...]:
    """32 x 32 heights 0..255 between the lowest and highest sample, -1 for none, as stored: south first."""
    picture = exam.scan.picture()
    laid = exam.placed.laid
    if laid is None or laid.flip_rows:
        picture = picture[::-1]
    if laid is not None and laid.flip_cols:
        picture = picture[:, ::-1]
    span = exam.scan.high - exam.scan.low
    shade = (picture - exam.scan.low) / span if span > 0 else np.where(np.isnan(picture), np.nan, 0.0)
    if exam.gain < 0:
        shade = 1.0 - shade
    whole = np.where(np.isnan(shade), -1, np.round(255 * np.clip(shade, 0, 1))).astype(int)
    return tuple(tuple(row) for row in whole.tolist())
