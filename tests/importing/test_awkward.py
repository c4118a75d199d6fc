"""Odd, broken and hostile files: a good import, a question, or a refusal that names the reason (SPEC G2, G5, G10, G30).

Kept originals (files/NOTICE) and, for those that are large, files with the same defect from ``make_files``.
"""

from __future__ import annotations

import asyncio
import json
import subprocess
import sys
from pathlib import Path

import pytest

from esker import contract as c
from esker.importing import limits, run, wire
from esker.importing.refusal import ImportRefused
from tests.importing.conftest import KEPT, look

KEPT_FILES = [
    ("asc_nodata0.asc", "ask", ["place"], ""),
    ("bigtiff_100000x1.tif", "refused", [], "100000 x 1"),
    ("comma_bom.asc", "refused", [], "3 x 2"),
    ("empty.tif", "refused", [], "empty"),
    ("gray8.png", "ask", ["imagery", "range", "size"], ""),
    ("huge_header.asc", "refused", [], "2,000,000 x 2,000,000"),
    ("huge_sparse_200k.tif", "refused", [], "200,000 x 200,000"),
    ("invalid.tif", "refused", [], "no format"),
    ("mars_srs.tif", "ask", ["imagery", "place"], ""),
    ("rio_all-nodata.tif", "refused", [], "every sample is nodata"),
    ("rio_rotated.tif", "ask", ["imagery", "place"], ""),
    ("hugo_site.asc", "ask", ["place"], ""),
]
MADE_FILES = [
    ("corrupt.tif", "refused", [], "data are broken"),
    ("shade.tif", "ask", ["imagery"], ""),
    ("undeclared_9999.asc", "ask", ["nodata", "place"], ""),
    ("mercator_wedges.tif", "ask", ["nodata"], ""),
    ("big.tif", "good", [], ""),
    ("void_no_tag.tif", "ask", ["nodata"], ""),
    ("south_up.tif", "good", [], ""),
    ("feet.tif", "good", [], ""),
    ("rotated.tif", "good", [], ""),
    ("nan_inf.tif", "good", [], ""),
    ("no_crs.tif", "ask", ["place"], ""),
    ("cog.tif", "good", [], ""),
]


def _check(path: Path, verdict: str, questions: list[str], reason: str) -> c.ImportReport:
    try:
        report = look(path).report
    except ImportRefused as refusal:
        report = c.ImportReport(verdict="refused", file=path.name, refusal=str(refusal))
    assert (report.verdict, [q.id for q in report.questions]) == (verdict, questions), report
    assert reason in report.refusal
    assert bool(report.refusal) == (verdict == "refused")
    assert all(question.default for question in report.questions)
    return report


@pytest.mark.parametrize(("name", "verdict", "questions", "reason"), KEPT_FILES)
def test_kept(name: str, verdict: str, questions: list[str], reason: str) -> None:
    _check(KEPT / name, verdict, questions, reason)


@pytest.mark.parametrize(("name", "verdict", "questions", "reason"), MADE_FILES)
def test_made(name: str, verdict: str, questions: list[str], reason: str, files: Path) -> None:
    _check(files / name, verdict, questions, reason)


def test_answering_the_defaults_leaves_nothing_open() -> None:
    """SPEC G11."""
    report = asyncio.run(run.inspect(KEPT / "gray8.png", "gray8.png", size_m=4096.0))
    answers = c.ImportAnswers(answers={q.id: q.default for q in report.questions})
    again = asyncio.run(run.inspect(KEPT / "gray8.png", "gray8.png", answers=answers, size_m=4096.0))
    assert again.verdict == "good"


def test_no_cliff_around_the_gully() -> None:
    """SPEC G5: declared zeros are nodata; the lowest sample left is the gully's."""
    report = look(KEPT / "asc_nodata0.asc").report
    assert report.low_m == pytest.approx(1680.78, abs=0.01)
    assert report.valid == pytest.approx(0.284, abs=1e-3)


def test_turned_cells() -> None:
    """SPEC G22: 30 degrees and cells of 20 x 10, from all six coefficients."""
    report = look(KEPT / "rio_rotated.tif").report
    assert report.spacing_m == pytest.approx((20.0, 10.0), rel=1e-4)
    assert report.rotation_deg == pytest.approx(30.0, abs=1e-2)


def test_mars() -> None:
    """SPEC G24: laid by hand, in its own metres, without a place on Earth."""
    report = look(KEPT / "mars_srs.tif").report
    assert report.at is None
    assert report.spacing_m == pytest.approx((606.98, 603.32), abs=0.01)


HOSTILE = ["huge_sparse_200k.tif", "huge_header.asc", "mars_srs.tif"]


LAUNCH = """
import json, resource, subprocess, sys
pipe = subprocess.PIPE
with subprocess.Popen([sys.executable, "-m", "esker.importing"], stdin=pipe, stdout=pipe) as reader:
    reader.stdin.write(sys.stdin.buffer.read())
    reader.stdin.flush()
    said = json.loads(reader.stdout.read().splitlines()[-1])["type"]
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(json.dumps([reader.returncode, said, used.ru_maxrss, used.ru_utime + used.ru_stime]))
"""
"""Measures from a small process: what a process takes at most counts what its parent had when it was made."""


def test_memory_of_the_process_that_reads() -> None:
    """SPEC G2, G30: hostile files end soon, and in far less than 1 GiB."""
    for name in HOSTILE:
        task = wire.Task(task="inspect", path=str(KEPT / name), name=name, workdir="/nonexistent")
        ran = subprocess.run(
            [sys.executable, "-c", LAUNCH],
            input=task.model_dump_json().encode() + b"\n",
            env=limits.environment(),
            capture_output=True,
            check=True,
        )
        status, said, most, seconds = json.loads(ran.stdout)
        assert status == 0
        assert said == ("inspected" if name == "mars_srs.tif" else "refused")
        assert most < 300 * 1024, name  # KiB
        assert seconds < 20, name
