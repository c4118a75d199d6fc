"""Compiled loops are kept for the text that they were compiled from (SPEC PW59)."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

from esker import compiled
from esker.patchwork import jit

INNER = "from esker.patchwork.jit import kernel\n\n\n@kernel\ndef inner(x: float) -> float:\n    return x + {}\n"
OUTER = """from esker.patchwork.inner import inner
from esker.patchwork.jit import kernel


@kernel
def outer(x: float) -> float:
    return inner(x)


print(outer(1.0))
"""


def test_a_change_in_another_file_is_compiled_anew(tmp_path: Path) -> None:
    """PW59: numba by itself goes on with the old code of a function that is called from elsewhere."""
    room = tmp_path / "esker" / "patchwork"
    room.mkdir(parents=True)
    (room / "__init__.py").touch()
    (room.parent / "__init__.py").touch()
    for name in ("jit.py", "kept_loops.py"):
        shutil.copy(Path(jit.__file__).parent / name, room / name)
    shutil.copy(compiled.__file__, room.parent / "compiled.py")
    process = Path(jit.__file__).parents[1] / "process"
    shutil.copytree(process, room.parent / "process", ignore=shutil.ignore_patterns("__pycache__"))
    (room / "outer.py").write_text(OUTER)
    environment = {k: v for k, v in os.environ.items() if k != "NUMBA_CACHE_DIR"} | {"PYTHONPATH": str(tmp_path)}
    said = []
    for added in (1, 20):
        (room / "inner.py").write_text(INNER.format(added))
        ran = subprocess.run(
            [sys.executable, "-m", "esker.patchwork.outer"], env=environment, capture_output=True, text=True, check=True
        )
        said.append(float(ran.stdout))
    assert said == [2.0, 21.0]
    assert len(list((room / "__pycache__").glob("compiled-*"))) == 1
