"""The process that reads one elevation file: a ``wire.Task`` on stdin, ``wire.Line`` lines on stdout.

It ends when its stdin ends, so that it never outlives the server.
"""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path
from typing import Final

from esker import contract as c
from esker.importing import limits, wire
from esker.process.child_process import end_with_parent

STEP_SECONDS: Final = 0.1


class Out:
    """Writes lines; of steps within a stage at most ten a second. The share never falls."""

    def __init__(self) -> None:
        self._stage: c.ImportStage | None = None
        self._share = 0.0
        self._last = 0.0

    def step(self, stage: c.ImportStage, share: float) -> None:
        """Says how far it is, if that is news."""
        now = time.monotonic()
        if stage == self._stage and now - self._last < STEP_SECONDS:
            return
        self._stage, self._last = stage, now
        self._share = max(self._share, min(1.0, share))
        self.line(wire.Step(stage=stage, share=self._share))

    def line(self, line: wire.Step | wire.Inspected | wire.Converted | wire.Refused) -> None:
        """Writes one line at once."""
        sys.stdout.write(line.model_dump_json() + "\n")
        sys.stdout.flush()


def _work(task: wire.Task, out: Out) -> wire.Inspected | wire.Converted:
    from esker.importing.answers import given
    from esker.importing.convert import convert
    from esker.importing.examine import examine
    from esker.importing.placement.placing import Terrain

    path, workdir = Path(task.path), Path(task.workdir)
    terrain = None if task.size_m is None else Terrain(task.place, task.size_m)
    if task.task == "inspect":
        exam = examine(path, task.name, workdir, given(task.answers), terrain, lambda share: out.step("reading", share))
        return wire.Inspected(report=exam.report)
    terrain = terrain or Terrain(task.place, c.DEFAULT_SIZE_M)
    layer = convert(path, task.name, task.answers, terrain, Path(task.out_dir), workdir, out.step)
    return wire.Converted(layer=layer)


def main() -> int:
    """Runs one task. The exit status is 0 whenever the last line says how it ended."""
    from esker.importing.refusal import ImportRefused

    task = wire.Task.model_validate_json(sys.stdin.buffer.readline())
    limits.confine(task)
    end_with_parent()
    limits.apply(task.task)
    out = Out()
    try:
        out.line(_work(task, out))
    except ImportRefused as refusal:
        out.line(wire.Refused(sentence=str(refusal)))
    except MemoryError:
        out.line(wire.Refused(sentence="Reading it would take too much memory."))
    sys.stdout.flush()
    os._exit(0)  # not held up by threads of libraries, nor by their tidying up


if __name__ == "__main__":
    sys.exit(main())
