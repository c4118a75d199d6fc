"""Each level that this processor can run, from empty caches: built within its bounds, and right (SPEC S430).

All of them take some minutes of processor time: `make test-levels` asks for them. `make test` builds the narrowest,
which no other test does.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from esker.solve.opencl.pocl import cpu, home

ROOT = Path(__file__).resolve().parents[2]
HERE = [level.name for level in cpu.levels(cpu.flags())] if home.site() is not None else []
ASKED = HERE if "ESKER_EVERY_LEVEL" in os.environ else HERE[-1:]
SCRIPT = """
import sys
import numpy as np
from esker.solve.opencl import prepare
from esker.solve.solver import Solver
from tests.solver.scenes import SCENES, SETTINGS
said = []
assert prepare.ready(None, None, lambda step: said.append(step.said)), said
assert prepare.level().name == sys.argv[1], said
exact = Solver("numpy")
solver = Solver("PoCL", max_level=4)
for name in ("five", "loops"):
    for x, y in zip(solver.solve(SCENES[name], SETTINGS, 3), exact.solve(SCENES[name], SETTINGS, 3)):
        assert np.quantile(np.abs(x - y), 0.99) < 1 / 16, (name, np.abs(x - y).max())
"""


@pytest.mark.parametrize("level", ASKED)
def test_each_level_is_built_within_its_bounds_and_settles_what_numpy_settles(level: str, tmp_path: Path) -> None:
    """SPEC S430: past a bound the next level would have been taken, and the name would be another."""
    env = os.environ | {"ESKER_CACHE_DIR": str(tmp_path), "ESKER_CPU_LEVEL": level, "PYTHONPATH": str(ROOT)}
    env.pop("POCL_CACHE_DIR", None)
    command = [sys.executable, "-c", SCRIPT, level]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, env=env, timeout=900, check=False)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-4000:]
