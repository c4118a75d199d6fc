"""Where PoCL finds its library and its linker, and where it keeps what it compiled.

PoCL's key for compiled programs does not know the CPU's name: code for one level, found by another in a folder that
they share, has no kernels or crashes. So each level has a folder of its own. All of this must be settled before PoCL is
loaded, and holds for the life of the process.
"""

from __future__ import annotations

import atexit
import contextlib
import ctypes
import importlib.util
import os
import shlex
import shutil
import sys
import tempfile
from functools import lru_cache
from pathlib import Path
from typing import Final

from esker.process import caches
from esker.solve.opencl.pocl import cpu, link

LIMIT: Final = "ESKER_CPU_LEVEL"
"""Names the widest level that may be used: for tests, and for a processor that a level does not suit."""
ROOT: Final = "ESKER_CACHE_DIR"
"""Names the folder for everything that is compiled; default: ``esker`` in the user's folder for caches."""
_FOLDER, _CACHE, _LINKER = "POCL_CACHE_DIR", "POCL_KERNEL_CACHE", "COMPILER_PATH"
_LIBRARIES = "pocl_binary_distribution/.libs"
_FILES = f"{_LIBRARIES}/share/pocl"
_loaded: list[ctypes.CDLL] = []


def limit() -> str | None:
    """The level that ESKER_CPU_LEVEL names, None where it names none."""
    return os.environ.get(LIMIT, "").lower() or None


def site() -> Path | None:
    """The folder that PoCL's wheel is installed in, None where it is not installed."""
    found = importlib.util.find_spec("pyopencl")
    if found is None or found.origin is None:
        return None
    folder = Path(found.origin).parent.parent
    return folder if any((folder / "pyopencl" / ".libs").glob("libpocl-*")) else None


def root() -> Path:
    """The folder for what is compiled. Where none can be written: one that goes when the process ends."""
    named = os.environ.get(ROOT) or os.environ.get(_FOLDER)
    folder = Path(named) if named else caches.users() / "esker"
    if os.environ.get(_CACHE) == "0" or not caches.writable(folder):
        folder = _passing()
    os.environ[ROOT] = str(folder)
    return folder


@lru_cache(maxsize=1)
def _passing() -> Path:
    folder = Path(tempfile.mkdtemp(prefix="esker-kernels-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


def folder(level: cpu.Level) -> Path:
    """Returns where PoCL keeps what it compiled for a level."""
    return root() / f"pocl-{level.name}"


def settle(level: cpu.Level) -> None:
    """Makes PoCL, which is not loaded yet, use this level's library and folder, and Esker's linker."""
    folder(level).mkdir(parents=True, exist_ok=True)
    os.environ[_FOLDER] = str(folder(level))
    os.environ[_CACHE] = "1"
    linker = str(_linker())
    if linker not in os.environ.get(_LINKER, "").split(os.pathsep):
        os.environ[_LINKER] = os.pathsep.join(filter(None, (linker, os.environ.get(_LINKER))))
    place = site()
    if place is not None and level.library != cpu.own_library(cpu.flags()) and not _loaded:
        _load(_mirror(place, level))


def _linker() -> Path:
    """A folder with the program ``ld``, which is ``api/link.py``: Clang looks for it there first."""
    made = root() / "linker"
    made.mkdir(parents=True, exist_ok=True)
    text = f'#!/bin/sh\nexec {shlex.quote(sys.executable)} -I -S -B {shlex.quote(link.__file__)} "$@"\n'
    program = made / "ld"
    with contextlib.suppress(OSError):
        if program.read_text(encoding="utf-8") == text and os.access(program, os.X_OK):
            return made
    _replace(program, text)
    return made


def _replace(path: Path, text: str) -> None:
    """Writes a program; whoever starts it meanwhile finds the old one or the new one."""
    handle, name = tempfile.mkstemp(dir=path.parent)
    with os.fdopen(handle, "w", encoding="utf-8") as file:
        file.write(text)
    os.chmod(name, 0o755)
    os.replace(name, path)


def _mirror(place: Path, level: cpu.Level) -> Path:
    """A folder like PoCL's own, of links, in which every library of built-in functions is the level's."""
    made = folder(level) / "pocl"
    for part in ("pyopencl/.libs", _LIBRARIES, _FILES):
        (made / part).mkdir(parents=True, exist_ok=True)
        for entry in (place / part).iterdir():
            if entry.name == "share" or entry.suffix == ".icd":
                continue
            source = entry
            if entry.name.startswith("kernel-"):
                source = entry.with_name(f"{entry.stem.rpartition('-')[0]}-{level.library}.bc")
            link_to = made / part / entry.name
            if not link_to.is_symlink() or link_to.readlink() != source:
                with contextlib.suppress(FileNotFoundError):
                    link_to.unlink()
                with contextlib.suppress(FileExistsError):
                    link_to.symlink_to(source)
    return made


def _load(mirror: Path) -> None:
    """Has the loader of OpenCL find the mirrored PoCL. It looks once, so that nothing later finds the other one."""
    libraries = mirror / "pyopencl" / ".libs"
    library = next(libraries.glob("libpocl-*"))
    (libraries / "pocl.icd").write_text(str(library), encoding="utf-8")
    before = os.environ.get("PYOPENCL_HOME")
    os.environ["PYOPENCL_HOME"] = str(mirror / "pyopencl")
    try:
        loader = ctypes.CDLL(str(next(libraries.glob("libOpenCL-*"))), mode=ctypes.RTLD_GLOBAL)
        _loaded.append(loader)
        loader.clGetPlatformIDs(0, None, ctypes.byref(ctypes.c_uint()))
    finally:
        if before is None:
            del os.environ["PYOPENCL_HOME"]
        else:
            os.environ["PYOPENCL_HOME"] = before
