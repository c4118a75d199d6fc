"""Reads an uploaded ``.esker`` file in a process of its own, with bounds on its memory and time (DESIGN 13).

``python -m esker.server.upload FILE FOLDER LOOPS`` is that process: the document as JSON on stdout, the rasters of its
elevation layers as ``FOLDER/<digest>/``, or a sentence on stderr. ``LOOPS`` is a ``Loops``.
"""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Callable
from contextlib import AbstractAsyncContextManager
from enum import StrEnum
from pathlib import Path
from typing import Final

import numpy as np

from esker.contract import Document
from esker.document import archive
from esker.document.former import read_document
from esker.document.ops import Refusal, check_document
from esker.importing import limits, warm
from esker.process import child_process, system
from esker.process.bounds import Bounds
from esker.process.child_process import end_with_parent, put_down

MEMORY_BYTES: Final = 1 << 30
"""Bytes that the process may take of its own; mapped files do not count."""
ADDRESS_BYTES: Final = 6 << 30
CPU_SECONDS: Final = 20
"""The largest document takes 4 of a fast core."""
CPU_SECONDS_A_GIB: Final = 600
"""Further bytes for the grids in the file, by its size."""
CPU_SECONDS_TO_COMPILE: Final = 300
"""Further ones for a file with grids where nothing compiled is kept: half a minute of a fast core."""
WALL_FACTOR: Final = 3.0
AT_ONCE: Final = 2
BAD_FILE, NO_LOOPS = 3, 4
"""Exit status for a file that is not good, and for one with grids before there are loops for them; anything else but 0
means that the reader itself was stopped."""


class Loops(StrEnum):
    """Where the compiled loops are that a reader of grids runs."""

    KEPT = "kept"
    COMING = "coming"
    """Being compiled by another process."""
    MISSING = "missing"
    """Nowhere, and no other process compiles them: the reader does."""


async def read_archive(path: Path, folder: Path, turn: Callable[[], AbstractAsyncContextManager[object]]) -> Document:
    """The document in an ``.esker`` file; the rasters of its layers come to lie in ``folder`` under their digests.

    Raises archive.ArchiveError with a sentence for a person. ``turn``: at most ``AT_ONCE`` of these run at a time. The
    first file with grids on a machine is read again once their loops are compiled; most files have none, and wait for
    nothing.
    """
    loops = Loops.COMING if warm.begin() is not None else _kept()
    status, out, err = await _read(path, folder, turn, loops)
    if status == NO_LOOPS:
        await warm.loops()
        status, out, err = await _read(path, folder, turn, _kept())
    if status == BAD_FILE:
        raise archive.ArchiveError(err.decode("utf-8", "replace").strip())
    if status != 0:
        raise archive.ArchiveError("Reading this file took too much memory or time.")
    return await asyncio.to_thread(read_document, out)  # stroke by stroke: the event loop goes on meanwhile


def _kept() -> Loops:
    return Loops.KEPT if warm.record().exists() else Loops.MISSING


async def _read(
    path: Path, folder: Path, turn: Callable[[], AbstractAsyncContextManager[object]], loops: Loops
) -> tuple[int | None, bytes, bytes]:
    """Runs one reader; returns its exit status and all that it says. Raises ArchiveError where that takes too long."""
    async with turn():
        reader = "esker.server.upload"
        process = await child_process.start(reader, str(path), str(folder), loops, env=limits.environment())
        try:
            out, err = await asyncio.wait_for(_answer(process), WALL_FACTOR * cpu_seconds(path, loops))
        except TimeoutError:
            raise archive.ArchiveError("Reading this file took too long.") from None
        finally:
            await put_down(process)
    return process.returncode, out, err


async def _answer(process: asyncio.subprocess.Process) -> tuple[bytes, bytes]:
    """Returns all that the reader says.

    Its stdin stays open until then: the end of it tells the reader that the server is gone.
    """
    assert process.stdout is not None
    assert process.stderr is not None
    out, err, _ = await asyncio.gather(process.stdout.read(), process.stderr.read(), process.wait())
    return out, err


def cpu_seconds(path: Path, loops: Loops) -> int:
    """Seconds that the reader may take."""
    compiling = CPU_SECONDS_TO_COMPILE if loops is Loops.MISSING else 0
    return CPU_SECONDS + compiling + CPU_SECONDS_A_GIB * path.stat().st_size // (1 << 28)


def bound(path: Path, loops: Loops) -> None:
    """Bounds this process from now on, and puts it behind everything that rooms do."""
    system.step_back(limits.NICENESS)
    Bounds(
        memory_bytes=MEMORY_BYTES,
        address_bytes=ADDRESS_BYTES,
        cpu_seconds=cpu_seconds(path, loops),
        file_bytes=limits.FILE_BYTES,
        open_files=limits.OPEN_FILES,
        core_bytes=0,
    ).apply()


def main(path: Path, folder: Path, loops: Loops) -> int:
    """Starts the process that reads."""
    system.speak_utf8()
    limits.keep_to(path, [folder])
    end_with_parent()
    bound(path, loops)
    try:
        with path.open("rb") as file:
            document = archive.unpack(file, folder)
        check_document(document)
        digests = {layer.content for layer in (*document.layers, *document.deleted_layers)}
        if digests and loops is Loops.COMING:
            return NO_LOOPS
        for digest in digests:
            _build(folder, digest)
    except (archive.ArchiveError, Refusal) as error:
        sys.stderr.write(str(error))
        return BAD_FILE
    sys.stdout.write(document.model_dump_json())
    return 0


def _build(folder: Path, digest: str) -> None:
    """Returns the raster of one grid, from its unpacked arrays. Raises ArchiveError."""
    from esker.patchwork.raster import rasters  # compiled loops take a second to load, and most files have no layers

    heights, warp = folder / f"{digest}.npy", folder / f"{digest}.warp.npy"
    try:
        net = np.load(warp, allow_pickle=False) if warp.exists() else None
        raster = rasters.build_out_of_core(np.load(heights, mmap_mode="r", allow_pickle=False), folder / digest, net)
    except rasters.RasterError as error:
        raise archive.ArchiveError(f"An elevation grid in this file cannot be used: {error}.") from error
    if raster.digest != digest:
        raise archive.ArchiveError("An elevation grid in this file is not the one that its layer names.")
    heights.unlink()
    warp.unlink(missing_ok=True)


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]), Path(sys.argv[2]), Loops(sys.argv[3])))
