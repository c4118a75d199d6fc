"""``esker doctor``: what it finds, what it calls broken, and the file that it writes (SPEC H170, H171)."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from importlib import metadata
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from esker import resources
from esker.cli import doctor as command
from esker.cli import main as cli
from esker.doctor import findings, report, solving
from esker.doctor.findings import Finding
from esker.solve.opencl import prepare
from esker.solve.solver import Solver

NAMES = ["python", "packages", "files", "processor", "memory", "disk", "pictures", "browser", "devices", "solve"]


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Less to solve."""
    monkeypatch.setattr(solving, "LEVEL", 1)


def test_it_looks_at_everything_and_solves_right(
    small: None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """SPEC H170."""
    assert cli.main(["doctor", "--json", "--device", "numpy", "--data", str(tmp_path / "data")]) == 0
    told = json.loads(capsys.readouterr().out)["findings"]
    assert [found["name"] for found in told] == NAMES
    facts = {found["name"]: found["facts"] for found in told}
    assert facts["packages"]["numpy"] == np.__version__
    assert facts["disk"]["free_gib"] > 0
    assert not (tmp_path / "data").exists(), "it only looks"
    assert 0 < facts["solve"]["error_quanta"] < 0.5
    assert facts["solve"]["solve_ms"] > 0
    assert {found["state"] for found in told} <= {"good", "poor"}


def test_it_says_in_lines_what_it_found(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(solving, "devices", lambda _: iter([Finding("solve", "broken", "It is lava.")]))
    assert command.main(["--data", str(tmp_path)]) == 1, "broken is no success"
    lines = capsys.readouterr().out.splitlines()
    assert [line.split(":")[0].split()[-1] for line in lines] == [*NAMES[:-2], "solve"]
    assert lines[-1] == "BROKEN solve: It is lava."


def test_wrong_ground_is_broken(small: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """A solver that is off by a step and more, as one with a miscompiled kernel is."""
    true = Solver.solve

    def wrong(self: Solver, *given: Any, **more: Any) -> Any:
        pyramid = true(self, *given, **more)
        return replace(pyramid, levels=tuple(np.float32(1.0) + heights for heights in pyramid.levels))

    monkeypatch.setattr(Solver, "solve", wrong)
    found = {finding.name: finding for finding in solving.devices("numpy")}
    assert found["solve"].state == "broken"
    assert found["solve"].facts["error_quanta"] > 1


def test_a_driver_that_was_refused_is_told(small: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC H181: a graphics card that stays unused is the first thing that its owner wants to know."""
    monkeypatch.setattr(prepare._state, "drivers", {"A card, 550.1": "no such intrinsic", "Another, 1": None})
    found = [finding for finding in solving.devices("numpy") if finding.name == "driver"]
    assert [(one.state, one.text) for one in found] == [("broken", "A card, 550.1 cannot be used: no such intrinsic.")]
    told = solving.kernels("numpy")
    assert "A card, 550.1: no such intrinsic" in told["rows"]["failed"]
    assert not report._absent(told)
    monkeypatch.setattr(prepare._state, "drivers", {})
    assert report._absent(solving.kernels("numpy"))


def test_sources_that_were_never_installed_name_what_they_need(monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC H181: ``python -m esker doctor`` beside ``PYTHONPATH=backend``."""
    installed = set(findings.wanted())

    def missing(name: str) -> list[str]:
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "requires", missing)
    assert set(findings.wanted()) == installed
    monkeypatch.setattr(resources, "CHECKOUT", None)
    assert findings.wanted() == []


def test_a_device_that_is_not_there_is_named(small: None) -> None:
    found = {finding.name: finding for finding in solving.devices("no such device")}
    assert found["solve"].state == "broken"
    assert "no such device" in found["solve"].text


@pytest.mark.parametrize(
    ("target", "value", "name", "state"),
    [
        ("DISK_POOR", 1 << 60, "disk", "poor"),
        ("DISK_BROKEN", 1 << 60, "disk", "broken"),
        ("MEMORY_POOR", 1 << 60, "memory", "poor"),
        ("MEMORY_BROKEN", 1 << 60, "memory", "broken"),
        ("PYTHON", (99, 0), "python", "broken"),
        ("wanted", lambda: ["no-such-package"], "packages", "broken"),
    ],
)
def test_what_is_too_little_is_said(
    target: str, value: Any, name: str, state: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(findings, target, value)
    check = {"disk": lambda: findings.disk(tmp_path)}.get(name, getattr(findings, name))
    assert check().state == state


def test_files_that_are_missing(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(resources, "PAGE", tmp_path)
    assert findings.files().state == "poor", "in a checkout the page can be built"
    monkeypatch.setattr(resources, "CHECKOUT", None)
    assert findings.files().state == "broken"


def test_a_check_that_fails_is_a_finding() -> None:
    def ill() -> Finding:
        raise ZeroDivisionError("of the check")

    assert findings.guarded("pictures", ill).text == "This could not be looked at: ZeroDivisionError: of the check"


def test_kernels_of_both_kinds_are_compared_with_numpy(small: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC H171. Where there is no OpenCL that is said, and is no fault."""
    monkeypatch.setattr(solving, "SCENES", ("five",))
    monkeypatch.setenv("ESKER_KERNELS", "rows")
    found = solving.kernels(None)
    assert os.environ["ESKER_KERNELS"] == "rows", "the setting is as it was"
    if report._absent(found):
        pytest.skip("no OpenCL device")
    assert found["right"]
    for kind in ("rows", "tiles"):
        assert f"{kind[:-1]} kernels" in found[kind]["device"]
        assert 0 <= found[kind]["scenes"]["five"]["of_relief"] < 1e-3
    monkeypatch.setattr(solving, "TOLERANCE", 0.0)
    assert not solving.kernels(None)["right"]


def test_a_soak_edits_settles_and_compares_with_a_new_solver() -> None:
    """SPEC H171."""
    found = solving.soak("numpy", 0.5, level=1)
    assert found["right"], found
    assert found["edits"] >= 1
    assert found["settled_ms"]["p99"] >= found["first_preview_ms"]["p50"] > 0


def test_a_part_that_hangs_or_ends_costs_that_part_only(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """SPEC H171."""
    monkeypatch.setattr(sys, "executable", str(tmp_path / "python"))
    (tmp_path / "python").write_text(
        '#!/bin/sh\ncase "$3" in\n'
        'findings) echo \'[{"state": "good"}]\' ;;\n'
        "kernels) echo '{\"right\": true}' ;;\n"
        "soak) echo 'a driver says hello'; echo 'free(): invalid pointer' >&2; kill -ABRT $$ ;;\n"
        "bench) echo '{\"scenes\": 1}'; echo '{\"scenes\": 2}'; exec sleep 60 ;;\nesac\n"
    )
    (tmp_path / "python").chmod(0o755)
    monkeypatch.setattr(report, "SECONDS", report.SECONDS | {"bench": 1.0})
    file = tmp_path / "report.json"
    made = report.write(file, None, tmp_path, 1.0, lambda _: None)
    assert json.loads(file.read_text()) == made
    assert made["soak"]["failed"].endswith("free(): invalid pointer")
    assert made["bench"]["scenes"] == 2, "what it had by then is kept"
    assert "ended after" in made["bench"]["failed"]
    assert not report.right(made), "a soak that ended its process is no success"
    assert report.right(made | {"soak": {"right": True}})
    assert not report.right(made | {"soak": {"right": True}, "findings": [{"state": "broken"}]})


def test_all_parts_together_end_within_five_minutes(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """SPEC H171: by their bounds alone, where every part hangs to the end of its own; the last one has some time."""
    clock, given = 0.0, {}

    def hang(command: list[str], *, timeout: float, **_: object) -> None:
        nonlocal clock
        clock += timeout
        given[command[3]] = timeout
        raise subprocess.TimeoutExpired(command, timeout)

    monkeypatch.setattr(report, "subprocess", SimpleNamespace(run=hang, TimeoutExpired=subprocess.TimeoutExpired))
    monkeypatch.setattr(report, "time", SimpleNamespace(monotonic=lambda: clock, strftime=time.strftime))
    report.write(tmp_path / "report.json", None, tmp_path, report.SOAK_SECONDS, lambda _: None)
    assert clock <= 300
    assert given["soak"] > report.SOAK_SECONDS + 10, "the soak and what comes before and after it"
    assert given["bench"] >= 15


def test_parts_say_json(capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from esker.doctor.__main__ import main

    def two(device: str | None, levels: tuple[int, ...]) -> Iterator[dict[str, Any]]:
        yield {"device": device}
        yield {"levels": list(levels)}

    monkeypatch.setattr(solving, "times", two)
    given = {"device": "numpy", "data": str(tmp_path), "soak_seconds": 0.1}
    assert main("bench", given) == 0
    assert [json.loads(line) for line in capsys.readouterr().out.splitlines()] == [
        {"device": "numpy"},
        {"levels": [3, 4, 5, 6]},
    ]
