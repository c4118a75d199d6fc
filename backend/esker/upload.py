"""Reads an uploaded ``.esker`` file in a process of its own, with bounds on its memory and time (DESIGN 13).

``python -m esker.upload FILE FOLDER`` is that process: the document as JSON on stdout, the rasters of its elevation
layers as ``FOLDER/<digest>/``, or a sentence on stderr.
"""

from __future__ import annotations

import asyncio
import resource
import sys
from pathlib import Path
from typing import Final

import numpy as np

from esker.contract import Document
from esker.document import archive
from esker.document.ops import Refusal, check_document

MEMORY_BYTES: Final = 1 << 30
"""Of its own; mapped files do not count."""
ADDRESS_BYTES: Final = 6 << 30
CPU_SECONDS: Final = 10
CPU_SECONDS_A_GIB: Final = 600
"""More for the grids in the file, by its size."""
WALL_FACTOR: Final = 3.0
AT_ONCE: Final = 2
BAD_FILE: Final = 3
"""Exit status for a file that is not good; anything else but 0 means that the reader itself was stopped."""


async def read_archive(path: Path, folder: Path, slots: asyncio.Semaphore) -> Document:
    """The document in an ``.esker`` file; the rasters of its layers come to lie in ``folder`` under their digests.

    Raises archive.ArchiveError with a sentence for a person. ``slots``: at most ``AT_ONCE`` of these run at a time.
    """
    async with slots:
        process = await asyncio.create_subprocess_exec(
            sys.executable,
            "-m",
            "esker.upload",
            str(path),
            str(folder),
            stdin=asyncio.subprocess.DEVNULL,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.PIPE,
        )
        try:
            out, err = await asyncio.wait_for(process.communicate(), WALL_FACTOR * cpu_seconds(path))
        except TimeoutError:
            raise archive.ArchiveError("Reading this file took too long.") from None
        finally:
            if process.returncode is None:
                process.kill()
                await process.wait()
    if process.returncode == BAD_FILE:
        raise archive.ArchiveError(err.decode("utf-8", "replace").strip())
    if process.returncode != 0:
        raise archive.ArchiveError("Reading this file took too much memory or time.")
    return Document.model_validate_json(out)


def cpu_seconds(path: Path) -> int:
    """Seconds that the reader may take."""
    return CPU_SECONDS + CPU_SECONDS_A_GIB * path.stat().st_size // (1 << 28)


def main(path: Path, folder: Path) -> int:
    """The process that reads."""
    resource.setrlimit(resource.RLIMIT_DATA, (MEMORY_BYTES, MEMORY_BYTES))
    resource.setrlimit(resource.RLIMIT_AS, (ADDRESS_BYTES, ADDRESS_BYTES))
    seconds = cpu_seconds(path)
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
    try:
        with path.open("rb") as file:
            document = archive.unpack(file, folder)
        check_document(document)
        for digest in {layer.content for layer in (*document.layers, *document.deleted_layers)}:
            _build(folder, digest)
    except (archive.ArchiveError, Refusal) as error:
        sys.stderr.write(str(error))
        return BAD_FILE
    sys.stdout.write(document.model_dump_json())
    return 0


def _build(folder: Path, digest: str) -> None:
    """The raster of one grid, from its unpacked arrays. Raises ArchiveError."""
    from esker.patchwork import rasters  # compiled loops take a second to load, and most files have no layers

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
    sys.exit(main(Path(sys.argv[1]), Path(sys.argv[2])))
