"""``esker import``: what elevation files are, and bringing them into a terrain (docs/importing.md)."""

from __future__ import annotations

import argparse
import asyncio
import http.client
import sys
from pathlib import Path
from typing import Final

from pydantic import ValidationError

from esker import contract as c
from esker.api.link import Refused
from esker.api.uploads import Uploads
from esker.importing import run
from esker.importing.answers import given

GOOD: Final = 0
FAILED: Final = 1
QUESTION: Final = 2
REFUSED: Final = 3
SEVERITY: Final = (GOOD, QUESTION, REFUSED, FAILED)
TOO_LARGE: Final = f"It has more than {c.MAX_GRID_BYTES >> 20} MiB: cut out the part that you need, or compress it."
ABOUT_THE_FILE: Final = frozenset({"empty", "too_large"})
"""Codes of a server that takes no such file; others are about the link, the terrain or the server."""
VERDICTS: Final = {"good": GOOD, "ask": QUESTION, "refused": REFUSED}


def main(argv: list[str]) -> int:
    """Runs the command. Exit status: 0 good, 2 a question is open, 3 refused, 1 something else went wrong."""
    parsed = _parser().parse_args(argv)
    try:
        answers = _answers(parsed)
    except ValueError as error:
        return _fail(str(error))
    statuses = [_check(path, answers, parsed.json) for path in parsed.files] if parsed.check else _into(parsed, answers)
    return max(statuses, key=SEVERITY.index)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="esker import",
        description="Say what elevation files are, or bring them into a terrain. Exit status: 0 good, 2 a question is "
        "open, 3 refused, 1 something else went wrong.",
    )
    parser.add_argument("files", nargs="+", type=Path, metavar="FILE")
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--check", action="store_true", help="only say what the files are and what would happen")
    what.add_argument(
        "--into", metavar="LINK", help="a link to a terrain with the right to edit, as esker serve prints it"
    )
    parser.add_argument(
        "--answer", action="append", default=[], metavar="ID=VALUE", help="answer a question (may be given many times)"
    )
    parser.add_argument(
        "--defaults", action="store_true", help="with --into: take the default answer where none is given"
    )
    hand = parser.add_argument_group("by hand", "where a grid lies and what it is, instead of what its file says")
    hand.add_argument("--anchor", nargs=2, type=float, metavar=("X", "Y"), help="its first sample, metres in the world")
    hand.add_argument("--rotation", type=float, metavar="DEGREES", help="counter-clockwise")
    hand.add_argument("--spacing", nargs=2, type=float, metavar=("SX", "SY"), help="metres from sample to sample")
    hand.add_argument("--scale", type=float, help="factor of its heights")
    hand.add_argument("--lift", type=float, metavar="METRES", help="added to its heights")
    hand.add_argument("--accuracy", type=float, metavar="METRES", help="its largest error")
    hand.add_argument("--name", help="of the layer")
    hand.add_argument("--source", help="who made it")
    hand.add_argument("--licence", help="under which licence")
    parser.add_argument("--json", action="store_true", help="with --check: one report a line, as JSON")
    parser.add_argument(
        "--ca-file", type=Path, metavar="PEM", help="the authority of a classroom server (esker-ca.pem)"
    )
    return parser


def _answers(parsed: argparse.Namespace) -> c.ImportAnswers:
    """Raises ValueError with a sentence."""
    answers = {}
    for text in parsed.answer:
        key, equals, value = text.partition("=")
        if not equals or not key or len(key) > 24 or len(value) > 240:
            raise ValueError(f"--answer {text[:40]!r}: write ID=VALUE, for instance nodata=-9999")
        answers[key.strip()] = value.strip()
    try:
        return c.ImportAnswers(
            answers=answers,
            anchor=parsed.anchor and tuple(parsed.anchor),
            rotation_deg=parsed.rotation,
            spacing_m=parsed.spacing and tuple(parsed.spacing),
            scale=parsed.scale,
            lift_m=parsed.lift,
            accuracy_m=parsed.accuracy,
            name=parsed.name,
            source=parsed.source,
            licence=parsed.licence,
        )
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        raise ValueError(f"{first['loc'][0]}: {first['msg']}") from None


def _fail(message: str) -> int:
    sys.stderr.write(f"esker import: {message}\n")
    return FAILED


# --- checking ---------------------------------------------------------------------------------------------------


def _check(path: Path, answers: c.ImportAnswers, as_json: bool) -> int:
    if not path.is_file():
        return _fail(f"there is no file {path}")
    if path.stat().st_size > c.MAX_GRID_BYTES:
        report = c.ImportReport(verdict="refused", file=path.name[: c.MAX_NAME_LENGTH], refusal=TOO_LARGE)
    else:
        report = asyncio.run(run.inspect(path, path.name, answers=answers))
    sys.stdout.write(report.model_dump_json() + "\n" if as_json else describe(report))
    return VERDICTS[report.verdict]


def describe(report: c.ImportReport) -> str:
    """A report for a person, some lines of text."""
    if report.verdict == "refused":
        return f"{report.file}: refused\n  {report.refusal}\n"
    words = {
        "good": "good",
        "ask": "a question" if len(report.questions) == 1 else f"{len(report.questions)} questions",
    }
    lines = [f"{report.file}: {words[report.verdict]}"]
    facts = [report.format, f"{report.cols} x {report.rows} samples", report.dtype, report.crs]
    lines.append("  " + ", ".join(fact for fact in facts if fact))
    if report.spacing_m is not None and report.width_m is not None and report.height_m is not None:
        across, up = report.spacing_m
        turned = f", turned by {report.rotation_deg:.2f}°" if abs(report.rotation_deg) >= 0.005 else ""
        lines.append(
            f"  {across:.4g} x {up:.4g} m apart, {_length(report.width_m)} x {_length(report.height_m)}{turned}"
        )
    if report.at is not None:
        lat, lon = report.at
        north, east = "N" if lat >= 0 else "S", "E" if lon >= 0 else "W"
        lines.append(f"  middle at {abs(lat):.4f}° {north}, {abs(lon):.4f}° {east}")
    if report.low_m is not None and report.high_m is not None and report.valid is not None:
        accuracy = "" if report.accuracy_m is None else f", accuracy taken for {report.accuracy_m:.3g} m"
        lines.append(f"  {report.low_m:.6g} to {report.high_m:.6g} m, {report.valid:.1%} of it data{accuracy}")
    lines += [f"  note: {note}" for note in report.notes]
    for question in report.questions:
        lines.append(f"  ? {question.id}: {question.text}")
        choices = [f"{option} (default)" if option == question.default else option for option in question.options]
        lines.append(f"      --answer {question.id}=…   {' | '.join(choices) or f'default {question.default}'}")
    return "\n".join(lines) + "\n"


def _length(metres: float) -> str:
    return f"{metres / 1000:.4g} km" if metres >= 1000 else f"{metres:.4g} m"


# --- bringing in ------------------------------------------------------------------------------------------------


def _into(parsed: argparse.Namespace, answers: c.ImportAnswers) -> list[int]:
    try:
        with Uploads(parsed.into, parsed.ca_file) as uploads:
            return [_bring(uploads, path, answers, parsed.defaults) for path in parsed.files]
    except Refused as error:
        return [_fail(str(error))]
    except (OSError, ValueError, http.client.HTTPException) as error:
        return [_fail(f"{parsed.into.partition('#')[0]}: {error}")]


def _bring(uploads: Uploads, path: Path, answers: c.ImportAnswers, defaults: bool) -> int:
    """One file, to the end. Raises what ``Uploads`` does."""
    if not path.is_file():
        return _fail(f"there is no file {path}")
    if path.stat().st_size > c.MAX_GRID_BYTES:
        sys.stdout.write(f"{path.name}: refused\n  {TOO_LARGE}\n")
        return REFUSED
    line = Line(path.name)
    try:
        status = uploads.send(path, lambda share: line.show("upload", share), "&hold=true")
    except Refused as error:
        line.end()
        if error.code not in ABOUT_THE_FILE:
            raise
        sys.stdout.write(f"{path.name}: refused\n  {error}\n")
        return REFUSED
    try:
        while (status := uploads.follow(status, lambda s: line.show(s.stage, s.share))).stage == "question":
            chosen = _choose(status, answers, defaults)
            if chosen is None:
                line.end()
                uploads.cancel(status)
                sys.stdout.write(describe(status.report) if status.report is not None else f"{path.name}: a question\n")
                return QUESTION
            for unasked in sorted(answers.answers.keys() - chosen.keys()):
                sys.stderr.write(f"{path.name}: it does not ask for {unasked!r}\n")
            status = uploads.answer(status, answers.model_copy(update={"answers": chosen}))
    except KeyboardInterrupt:
        line.end()
        uploads.cancel(status)
        return _fail(f"{path.name}: cancelled")
    line.end()
    if status.stage == "done":
        sys.stdout.write(f"{path.name}: laid as layer {status.layer}\n")
        return GOOD
    sys.stdout.write(f"{path.name}: {status.stage}\n  {status.text}\n")
    return REFUSED


def _choose(status: c.ImportStatus, answers: c.ImportAnswers, defaults: bool) -> dict[str, str] | None:
    """Answers to all that is asked, None when one is missing."""
    questions = status.report.questions if status.report is not None else ()
    known = given(answers)
    chosen = {q.id: known[q.id] for q in questions if q.id in known}
    if defaults:
        chosen = {q.id: q.default for q in questions} | chosen
    return chosen if len(chosen) == len(questions) else None


class Line:
    """One line of progress on a terminal; elsewhere a line a stage."""

    def __init__(self, name: str) -> None:
        self._name, self._stage, self._shown = name, "", ""
        self._live = sys.stderr.isatty()

    def show(self, stage: str, share: float) -> None:
        """Shows how far it is."""
        text = f"{self._name}: {stage} {share:4.0%}"
        if self._live and text != self._shown:
            sys.stderr.write(f"\r\x1b[K{text}")
        elif not self._live and stage != self._stage:
            sys.stderr.write(f"{self._name}: {stage}\n")
        self._stage, self._shown = stage, text
        sys.stderr.flush()

    def end(self) -> None:
        """Takes the line away."""
        if self._live and self._shown:
            sys.stderr.write("\r\x1b[K")
            sys.stderr.flush()
