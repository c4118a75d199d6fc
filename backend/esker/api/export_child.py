"""The process that makes one export: a ``wire.Task`` on stdin, ``wire.Line`` lines on stdout.

It ends when its stdin ends, so that it never outlives the server, and stands behind everything that rooms do.
"""

from __future__ import annotations

import errno
import logging
import math
import os
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from esker import contract as c
from esker.exporting import wire
from esker.exporting.printing.drawing import CannotPrint
from esker.process import system
from esker.process.bounds import Bounds
from esker.process.child_process import end_with_parent

if TYPE_CHECKING:
    from esker.exporting.ground import Ground
    from esker.patchwork.raster.rasters import Raster

log = logging.getLogger("esker.exporting")

NICENESS: Final = 5
"""As far as readers of files step back: a third of a core that somebody busy wants too. At 15 it is a thirtieth."""
FILE_BYTES: Final = 4 << 30
CPU_SECONDS: Final = 4 * 3600
"""Processor time of all threads together; the server looks at the clock (``run.WALL_SECONDS``)."""
OPEN_FILES: Final = 1_024
STEP_SECONDS: Final = 0.1
EXPECTED_CYCLES: Final = 10
"""Steps of the solver that most scenes take to rest, for the share only."""
NO_ROOM: Final = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG})


class Failure(Exception):
    """There is no export; the message is a sentence."""


class Out:
    """Writes lines; of steps within a stage at most ten a second. The share never falls, whatever is begun again."""

    def __init__(self) -> None:
        self._stage: c.ExportStage | None = None
        self._share, self._last = 0.0, 0.0

    def step(self, stage: c.ExportStage, share: float) -> None:
        """Says how far it is, if that is news. ``share``: of the stage."""
        from esker.exporting.formats import share_of

        now = time.monotonic()
        if stage == self._stage and now - self._last < STEP_SECONDS:
            return
        self._stage, self._last = stage, now
        self._share = max(self._share, share_of(stage, share))
        self.line(wire.Step(stage=stage, share=self._share))

    def line(self, line: wire.Step | wire.Made | wire.Failed) -> None:
        """Writes one line at once."""
        sys.stdout.write(line.model_dump_json() + "\n")
        sys.stdout.flush()


def _step_back() -> None:
    """Behind everything that rooms do, and bounded; where memory runs out, this process goes and not the server.

    Its memory has no bound of its own: drivers of graphics cards reserve far more than they use."""
    system.step_back(NICENESS)
    system.first_to_end()
    Bounds(file_bytes=FILE_BYTES, cpu_seconds=CPU_SECONDS, open_files=OPEN_FILES, core_bytes=0).apply()


def _grids(task: wire.Task) -> dict[str, Raster]:
    """The rasters of the document's layers. Raises Failure for one that is missing or damaged: ground without it would
    be another ground."""
    from esker.patchwork.raster import rasters

    found = {}
    for layer in task.document.layers:
        try:
            found[layer.content] = rasters.read(Path(task.grids) / layer.content)
        except (rasters.RasterError, OSError) as error:
            name = layer.name or layer.facts.file or layer.id
            raise Failure(
                f"The elevation data of the layer “{name}” cannot be read. Remove it to export the rest."
            ) from (error)
    return found


def _solver(device: str | None, level: int, threads: int | None, out: Out) -> Any:
    """A solver that says how far it is."""
    from esker.events import PAUSE, Pause, SolveEvent
    from esker.solve.solver import Solver

    class Watched(Solver):
        steps_done = 0

        def tell(self, event: SolveEvent) -> None:
            if isinstance(event, Pause):
                self.steps_done += 1
            out.step("solving", self.steps_done / (self.steps_done + EXPECTED_CYCLES))

        def steps(self, *given: Any, **more: Any) -> Any:
            for result in (solving := super().steps(*given, **more)):
                self.tell(result)
                yield result
            solving.close()

        def heights(self, *given: Any, **more: Any) -> Any:
            return super().heights(*given, **{"step": lambda: self.tell(PAUSE)} | more)

    return Watched(device, max_level=level, threads=threads)


def _made(task: wire.Task, device: str | None, grids: dict[str, Raster], out: Out) -> Ground:
    from esker.api.terrain import Terrain
    from esker.exporting.formats import FORMATS, export, packed, sent_name
    from esker.exporting.ground import Extent

    wanted, folder = task.wanted, Path(task.folder)
    form = FORMATS[wanted.format]
    extent = Extent.of(None, wanted.samples)
    out.step("solving", 0.0)
    solver = _solver(device, task.global_level, task.threads, out)
    terrain = Terrain.from_document(task.document, grids, solver, trusted=True)
    levels = {"global_level": task.global_level, "refined_level": max(task.refined_level, task.global_level)}
    path = folder / (task.name + form.suffixes[0])

    def step(stage: c.ExportStage, share: float) -> None:
        if (stage, share) in (("detail", 1.0), ("writing", 0.0)):  # what follows needs memory of its own
            solver.tidy(math.inf)
            system.give_memory_back()
        out.step(stage, share)

    ground = export(
        terrain, path, wanted.format, extent, detail=wanted.detail, step=step, weights=wanted.weights,
        paper=wanted.paper, model=wanted.model, **levels,
    )  # fmt: skip
    if form.sent:
        packed(folder, sent_name(wanted.format, task.name))
    return ground


def work(task: wire.Task, out: Out) -> wire.Made:
    """Tries one device after the other, as rooms do; NumPy, the last, has none that could fail."""
    from esker.exporting.formats import sent_name
    from esker.solve.opencl.device import candidates
    from esker.solve.opencl.faults import DeviceError

    grids = _grids(task)
    names: list[str | None] = [task.device] if task.device else []
    names += [name for name in candidates(task.threads) if name != task.device]
    ground = None
    for at, device in enumerate(names):
        try:
            ground = _made(task, device, grids, out)
            break
        except (DeviceError, MemoryError) as error:
            if at == len(names) - 1:
                raise
            log.warning("exporting on %s failed: %s", device, error)
    assert ground is not None, "numpy is always there"
    file = sent_name(task.wanted.format, task.name)
    low, high = ground.range_m
    size = (Path(task.folder) / file).stat().st_size
    return wire.Made(file=file, bytes=size, low_m=low, high_m=high, spacing_m=ground.spacing_m)


def main() -> int:
    """Runs one task. The exit status is 0 whenever the last line says how it ended."""
    task = wire.Task.model_validate_json(sys.stdin.buffer.readline())
    system.speak_utf8()
    end_with_parent()
    _step_back()
    out = Out()
    try:
        out.line(work(task, out))
    except Failure as failure:
        out.line(wire.Failed(sentence=str(failure)))
    except CannotPrint as cannot:
        out.line(wire.Failed(sentence=str(cannot)))
    except MemoryError:
        out.line(wire.Failed(sentence="This export needs more memory than the server has. Take fewer samples."))
    except OSError as error:
        if error.errno not in NO_ROOM:
            raise
        out.line(wire.Failed(sentence="The server has no room for this file (is its disk full?)."))
    sys.stdout.flush()
    os._exit(0)  # not held up by threads of drivers, nor by their tidying up


if __name__ == "__main__":
    sys.exit(main())
