"""Bounds on the process that reads files: memory, time, disk, and what GDAL and PROJ may touch."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from esker.importing import wire
from esker.patchwork import kept_loops
from esker.process import confinement, system
from esker.process.bounds import Bounds

MEMORY_BYTES: Final = 1 << 30
"""Memory of its own (RLIMIT_DATA) that reading may take; files that it maps do not count."""
ADDRESS_BYTES: Final = {"inspect": 3 << 29, "convert": 6 << 30}
"""Address space (RLIMIT_AS): a conversion maps the grid, its mipmap and its errors, 2 GiB for the largest."""
CPU_SECONDS: Final = {"inspect": 120, "convert": 900}
WALL_SECONDS: Final = {"inspect": 600.0, "convert": 2400.0}
"""Against readers that hang: processor time is what bounds the others, and on a busy machine they have little of it."""
FILE_BYTES: Final = 3 << 30
OPEN_FILES: Final = 128
NICENESS: Final = 5
LOOPS: Final = ".loops"
"""The folder of compiled loops within a reader's work folder."""

KEPT: Final = (
    "PATH",
    "LD_LIBRARY_PATH",
    "PYTHONPATH",
    "HOME",
    "TMPDIR",
    "NUMBA_CACHE_DIR",
    "VIRTUAL_ENV",
    # Windows: without the first two no process starts there, and the others are its HOME and TMPDIR.
    "SYSTEMROOT",
    "PATHEXT",
    "USERPROFILE",
    "LOCALAPPDATA",
    "TEMP",
    "TMP",
)
"""What the process gets of the server's environment; nothing that could hold a secret."""
ALONE: Final[Mapping[str, str]] = {
    "GDAL_DISABLE_READDIR_ON_OPEN": "EMPTY_DIR",
    "GDAL_GEOREF_SOURCES": "INTERNAL",
    "GDAL_PAM_ENABLED": "NO",
    "GDAL_VRT_ENABLE_PYTHON": "NO",
    "CPL_VSIL_CURL_ALLOWED_EXTENSIONS": ".none",
}
"""GDAL's settings that make it look at one file and nothing beside it."""
HARDENED: Final[Mapping[str, str]] = {
    **ALONE,
    "LANG": "C.UTF-8",
    "PYTHONUTF8": "1",
    "MALLOC_MMAP_THRESHOLD_": "131072",  # else freed blocks of files stay with the process
    "MALLOC_ARENA_MAX": "4",
    "OPENBLAS_NUM_THREADS": "1",
    "OMP_NUM_THREADS": "1",
    "GDAL_NUM_THREADS": "1",
    "GDAL_CACHEMAX": "272",
    "GDAL_DRIVER_PATH": "disable",
    "GDAL_HTTP_MAX_RETRY": "0",
    "GDAL_HTTP_TIMEOUT": "1",
    "GDAL_HTTP_PROXY": "127.0.0.1:9",
    "CPL_TMPDIR": "/nonexistent",
    "PROJ_NETWORK": "OFF",
}


def environment() -> dict[str, str]:
    """The whole environment of the process that reads."""
    return {name: os.environ[name] for name in KEPT if name in os.environ} | dict(HARDENED)


def confine(task: wire.Task) -> None:
    """Keeps this process to the file and its work folders, without a network, where that is to be had.

    Call it before any thread is started.
    """
    folders = [Path(path) for path in (task.workdir, os.path.dirname(task.out_dir)) if path]
    keep_to(Path(task.path), folders)


def keep_to(file: Path, folders: list[Path]) -> None:
    """Keeps this process to a file and to folders, in the first of which it keeps the loops that it compiles.

    Nothing that another process loads can be written: neither compiled loops nor compiled modules.
    """
    confinement.confine([file, kept_loops.folder()], folders)
    kept_loops.use_own(folders[0] / LOOPS)


def apply(task: str) -> None:
    """Bounds this process from now on. ``task``: "inspect" or "convert"."""
    system.step_back(NICENESS)
    Bounds(
        memory_bytes=MEMORY_BYTES,
        address_bytes=ADDRESS_BYTES[task],
        cpu_seconds=CPU_SECONDS[task],
        file_bytes=FILE_BYTES,
        open_files=OPEN_FILES,
        core_bytes=0,
    ).apply()
