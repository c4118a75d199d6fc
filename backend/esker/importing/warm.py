"""Compiles the loops that readers of files run, in a process that reads nothing of strangers'.

``python -m esker.importing.warm`` is that process. What it compiles is kept where readers may look and may not write
(``patchwork/kept_loops.py``, SPEC A446): without it each reader would compile for half a minute.
"""

from __future__ import annotations

import asyncio
import logging
import os
import sys
import tempfile
from collections.abc import MutableMapping
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path
from typing import Final
from weakref import WeakKeyDictionary

import numpy as np

from esker.importing import limits
from esker.patchwork import kept_loops
from esker.process import caches, child_process

log = logging.getLogger("esker.importing")

SECONDS: Final = 600.0
SIDE: Final = 200
"""Cells along a side of the built-in grid: several patches, so that every loop has something to do."""

_going: MutableMapping[asyncio.AbstractEventLoop, asyncio.Task[None]] = WeakKeyDictionary()
_tried = False


def record() -> Path:
    """Returns the file that says that the loops of this text and of this numba are there."""
    return kept_loops.folder() / f"readers-{kept_loops.digest()}-{version('numba')}"


def begin() -> asyncio.Task[None] | None:
    """Has the loops compiled, unless they are there or that was tried in vain; None then. Called in an event loop."""
    if _tried or record().exists():
        return None
    loop = asyncio.get_running_loop()
    if loop not in _going:
        _going[loop] = loop.create_task(_compiled())
    return _going[loop]


async def loops() -> None:
    """Returns when readers find their loops, or when that was tried in vain. Readers compile for themselves then."""
    if (task := begin()) is not None:
        await asyncio.shield(task)


async def _compiled() -> None:
    global _tried
    try:
        process = await child_process.start("esker.importing.warm", env=limits.environment())
        try:
            assert process.stdout is not None
            assert process.stderr is not None
            async with asyncio.timeout(SECONDS):
                _, complaint = await asyncio.gather(process.stdout.read(), process.stderr.read())
        finally:
            await child_process.put_down(process)
    except (OSError, TimeoutError) as error:
        complaint = str(error).encode()
    _tried = True
    if not record().exists():
        log.warning("loops of readers could not be kept: %s", complaint[-400:].decode("utf-8", "replace").strip())


def work(folder: Path) -> None:
    """Reads and converts built-in grids as readers do: text, an array that is mapped, one that lies in a net."""
    from esker import contract as c
    from esker.importing.answers import given
    from esker.importing.convert import convert
    from esker.importing.examine import examine
    from esker.importing.placement.placing import Terrain
    from esker.patchwork.raster import rasters

    path = folder / "built-in.asc"
    rows = [" ".join(str((row * col) % 97 if row > 9 else -9999) for col in range(SIDE)) for row in range(SIDE)]
    head = f"ncols {SIDE}\nnrows {SIDE}\nxllcorner 0\nyllcorner 0\ncellsize 10\nNODATA_value -9999\n"
    path.write_text(head + "\n".join(rows) + "\n", encoding="ascii")
    terrain = Terrain(None, c.DEFAULT_SIZE_M)
    report = examine(path, path.name, folder, given(c.ImportAnswers()), terrain, lambda _: None).report
    answers = c.ImportAnswers(answers={question.id: question.default or "" for question in report.questions})
    convert(path, path.name, answers, terrain, folder / "text", folder, lambda *_: None)
    np.save(folder / "heights.npy", np.random.default_rng(1).random((SIDE, SIDE), dtype=np.float32))
    heights = np.load(folder / "heights.npy", mmap_mode="r")
    net = np.stack(np.meshgrid(np.linspace(0, 1, 9), np.linspace(0, 1, 9)), axis=-1) * 1.01
    for name, warp in (("mapped", None), ("net", net)):
        with suppress(rasters.RasterError):
            rasters.build_out_of_core(heights, folder / name, warp)


def main() -> int:
    """The process that compiles."""
    child_process.end_with_parent()
    limits.apply("convert")
    os.environ.setdefault(caches.LOOPS, str(kept_loops.beside()))
    with tempfile.TemporaryDirectory(prefix="esker-warm-") as folder:
        work(Path(folder))
    record().touch()
    sys.stdout.flush()
    return 0


if __name__ == "__main__":
    sys.exit(main())
