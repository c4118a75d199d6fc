"""Pictures and tables of the solver come from committed results alone (SPEC S86)."""

from __future__ import annotations

import copy
from pathlib import Path

import numpy as np
import pytest

from bench import report
from bench.solver import _solver, plots

RESULT = report.result("solve")


def test_tables_in_the_documents_are_fresh() -> None:
    """SPEC S86: figures in docs/solver.md and README.md are those of bench/results."""
    for path, text in report.documents().items():
        assert path.read_text(encoding="utf-8") == text, f"{path.name}: run python -m bench.report"
    assert report.main(["--check"]) == 0


def test_a_document_without_its_marks_is_refused() -> None:
    text = report.SOLVER.read_text(encoding="utf-8")
    with pytest.raises(ValueError, match="peers"):
        _solver.document(text.replace("<!-- peers:", "<!-- others:"), RESULT)


def test_tables_change_with_the_result() -> None:
    """A worse figure shows: the worst scene of each size, and a peer that failed."""
    worse = copy.deepcopy(RESULT)
    next(iter(worse["accuracy"].values()))["257"]["height_factor"] = 0.77
    assert "0.77" in _solver.accuracy(worse)
    assert "0.77" not in _solver.accuracy(RESULT)
    worse["peers"]["levels"]["513"]["superlu"] = {"failed": "out of time", "limit_gib": 14.0, "limit_s": 600.0}
    assert "| 513² | SuperLU | out of time (limits 14 GiB, 600 s) |" in _solver.peers(worse)


def test_the_committed_result_holds_the_bounds() -> None:
    """SPEC S3, S18, S81, S82 at sizes that are too large for tests."""
    sizes = {size for rows in RESULT["accuracy"].values() for size in rows}
    assert {"257", "513", "1025", "2049", "4097"} <= sizes
    for name, rows in RESULT["accuracy"].items():
        for size, row in rows.items():
            where = f"{name} at {size}"
            assert max(row["gradient_factor"], row["height_factor"]) <= 0.4, where
            assert row["preview_by_cycles"]["1+3"] <= 1e-3, where
            assert row["curve_of_relief"][3] <= 1e-3, where
            assert row["rest_of_quantum"] < 0.5, where
            assert row["floor_of_relief"] <= 2e-6, where


def test_pictures(tmp_path: Path) -> None:
    """SPEC S86: the script draws everything from what is committed, and the committed pictures are there."""
    pytest.importorskip("matplotlib")
    with np.load(plots.MAPS) as file:
        maps = {name: file[name].astype(np.float32) for name in file.files}
    assert {name.split(".")[1] for name in maps} == {"heights", "preview", "settled"}
    for path in plots.draw(RESULT, maps, tmp_path):
        data = path.read_bytes()
        assert data.startswith(b"\x89PNG" if path.suffix == ".png" else b"<?xml")
        assert len(data) > 20_000
        assert (plots.PICTURES / path.name).is_file()
    again = tmp_path / "again.svg"
    plots.convergence(RESULT["accuracy"], again)
    assert again.read_bytes() == (tmp_path / "solver-convergence.svg").read_bytes(), "drawn the same every time"
