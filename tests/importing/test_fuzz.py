"""Damaged files never do more than be refused (SPEC G30)."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from tests.importing.conftest import HERE


def test_damaged_files(files: Path) -> None:
    """Some three hundred variants, cut off and changed, in one process with the bounds of a reader; then in time."""
    done = subprocess.run(
        [sys.executable, "-m", "tests.importing.fuzz", str(files), "20260"],
        cwd=HERE.parents[1], capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-1000:]
    lines = done.stdout.splitlines()
    assert len(lines) > 250
    assert sum("refused" in line for line in lines) > 80
