"""The first build of the kernels: in a child, bounded, level by level, once on a machine (SPEC S141, S144)."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import psutil
import pytest

from esker.solve.opencl import prepare
from esker.solve.opencl.pocl import home

ROOT = Path(__file__).resolve().parents[2]
needs_pocl = pytest.mark.skipif(home.site() is None, reason="PoCL's wheel is not installed")


@pytest.fixture
def broken(monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> None:
    """A child that goes wrong as the test's parameter says."""
    monkeypatch.setattr(prepare, "MODULE", "tests.solver.breaking_build")
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    monkeypatch.setenv("BREAK", request.param)


def children() -> set[int]:
    return {p.pid for p in psutil.Process().children(recursive=True) if p.status() != psutil.STATUS_ZOMBIE}


@pytest.mark.parametrize(
    ("broken", "why"), [("abort", r"ended \(-6\)"), ("words", r"ended \(0\)")], indirect=["broken"]
)
def test_a_compiler_that_ends_ends_nothing_else(broken: None, why: str) -> None:
    """SPEC S141."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(prepare, "PATIENCE", 60.0)
        assert re.search(why, prepare.bounded([])["failed"])


@pytest.mark.parametrize(
    ("broken", "bound", "why"),
    [
        ("turns", ("SECONDS", 0.3), "not compiled within"),
        ("waits", ("PATIENCE", 0.5), "not compiled within"),
        ("memory", ("BYTES", 60 << 20), "more than 0.1 GiB"),
    ],
    indirect=["broken"],
)
def test_a_child_past_its_bounds_is_ended(
    broken: None, bound: tuple[str, float], why: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """SPEC S141: and what it started."""
    before = children()
    monkeypatch.setattr(prepare, *bound)
    assert why in prepare.bounded([])["failed"]
    assert children() == before


@pytest.mark.parametrize("broken", ["waits"], indirect=True)
def test_what_a_child_starts_while_it_is_ended_ends_too(broken: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC S141: it held the pipes of the child open, and who had ended the child waited for them."""
    monkeypatch.setattr(prepare, "PATIENCE", 2.0)
    monkeypatch.setattr(psutil.Process, "children", lambda *_, **__: [])  # as one looks just before it starts one
    done: list[dict[str, Any]] = []
    thread = threading.Thread(target=lambda: done.append(prepare.bounded([])), daemon=True)
    thread.start()
    thread.join(60)
    assert done, "it waits for ten minutes"


@pytest.mark.parametrize("broken", ["waits"], indirect=True)
def test_whoever_wants_it_no_more_ends_it(broken: None) -> None:
    """SPEC S141."""
    before, stopped, looks = children(), threading.Event(), 0

    def look() -> None:
        nonlocal looks
        looks += 1
        if looks > 3:
            stopped.set()

    with pytest.raises(prepare.Stopped):
        prepare.bounded([], look, stopped)
    assert children() == before


SCRIPT = """
import logging, sys
from dataclasses import replace
logging.basicConfig(level="INFO", stream=sys.stdout, format="%(message)s")
from esker.solve.opencl import prepare
from esker.solve.opencl.pocl import cpu, home
real, task = cpu.levels, prepare.task
wide = cpu.LEVELS[0]
# A processor of which LLVM 14 knows a narrower name than its library's, and the next level that this one can run.
cpu.levels = lambda has, limit=None: (wide, real(cpu.flags(), "haswell")[0])
prepare.task = lambda one, *rest: task(one, *rest) | ({"name": "znver3"} if one is wide else {})
prepare.SECONDS = float(sys.argv[1])
from esker.solve.solver import Solver
"""
FIRST = (
    SCRIPT
    + """
prepare._built_before = prepare._built
def then_patient(*arguments):
    result = prepare._built_before(*arguments)
    prepare.SECONDS = 60.0
    return result
prepare._built = then_patient
steps = []
assert prepare.ready(None, None, lambda step: steps.append(step)), steps
assert any(0 < s.done < s.of for s in steps), steps
assert not any(s.done for s in steps if "for skylake" in s.said), "5 s of a fitting pair compile half of all kernels"
solver = Solver()
assert prepare.level().name == real(cpu.flags(), "haswell")[0].name
print("device", solver.device_name)
"""
)
SECOND = (
    SCRIPT
    + """
def never(*_): raise AssertionError("a child was started")
prepare.bounded = never
from esker.contract import TerrainSettings
from esker.server.first_build import Slope
from esker.grid import TileKey
import numpy as np
from esker.events import Done
from tests.solver.scenes import SCENES, SETTINGS
FIVE = SCENES['five']
kept = lambda: {str(p): p.stat().st_mtime_ns for p in home.root().rglob("*.so")}
before = kept()
solver = Solver(max_level=4)
x, y = (s.solve(FIVE, SETTINGS, 2)[2] for s in (solver, Solver("numpy")))
assert np.quantile(np.abs(x - y), 0.99) < 1 / 16, np.abs(x - y).max()
for level in (2, 4):
    for base in (None, Slope()):
        for strokes in (FIVE, FIVE[:4]):
            for result in solver.steps(strokes, SETTINGS, level, basis=True, base=base):
                basis = result.basis if isinstance(result, Done) else None
        for _ in solver.refiner(basis).tiles([TileKey(level + 1, 5, 7)]): pass
assert kept() == before, set(kept()) ^ set(before)
print("device", solver.device_name)
"""
)


@needs_pocl
def test_the_wrong_name_is_given_up_and_the_next_level_built_without_a_toolchain(tmp_path: Path) -> None:
    """SPEC S141, S142, S144: and the next process compiles nothing, whatever it solves.

    The first level is the pair that hangs: Zen 3's name with the AVX-512 library. Any processor can compile for it.
    """
    (tmp_path / "none").mkdir()
    keep = ("HOME", "LANG", "LD_LIBRARY_PATH", "SYSTEMROOT", "TMPDIR")
    env = {name: os.environ[name] for name in keep if name in os.environ} | {
        "PATH": str(tmp_path / "none"),
        "PYTHONPATH": str(ROOT),
        "ESKER_CACHE_DIR": str(tmp_path / "cache"),
        "ESKER_KERNELS": "rows",
    }
    said = []
    for code, seconds in ((FIRST, "5"), (SECOND, "5")):
        command = [sys.executable, "-c", code, seconds]
        done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, env=env, timeout=600, check=False)
        assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-4000:]
        assert "device PoCL" in done.stdout
        said.append(done.stdout)
    # Which bound ends it first, time or memory, depends on the processor.
    assert re.search(r"Kernels for skylake-avx512: (not compiled within 5 s|the compiler took .*); trying", said[0])
    assert said[0].count("once on this machine") == 2
    assert "not long ago; trying" in said[1], "a level that failed is left alone for a day"
