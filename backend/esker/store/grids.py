"""Stored elevation grids: directories named by the digest of what is in them, never changed (DESIGN 11, 13).

A grid comes to be in a work folder beside the others; when it is whole, its files and the folder are synced to disk and
it is renamed to its digest, in one step. An op names a grid only after that, so ``kill -9`` leaves a terrain without a
layer or with all of it. What a kill leaves over (work folders, grids that no terrain names) is swept at the next start.
"""

from __future__ import annotations

import logging
import os
import re
import secrets
import shutil
import tempfile
import threading
import weakref
from collections.abc import Collection, Iterable
from pathlib import Path
from typing import Final

from esker.patchwork import rasters
from esker.patchwork.rasters import Raster, RasterError

log = logging.getLogger("esker.grids")

FOLDER: Final = "grids"
_WORK: Final = ".work-"
_DIGEST: Final = re.compile(r"[0-9a-f]{64}")


class MissingGrid(RasterError):
    """No grid of this digest is stored here."""


class GridStore:
    """The grids of one server, of all terrains: who brings the same file twice shares one. Safe from any thread."""

    def __init__(self, data: Path) -> None:
        """``data``: the server's folder. Raises OSError."""
        self.folder = data / FOLDER
        self.folder.mkdir(parents=True, exist_ok=True)
        self._lock = threading.Lock()
        self._open: weakref.WeakValueDictionary[str, Raster] = weakref.WeakValueDictionary()

    def work(self) -> Path:
        """A new, empty work folder, on the same file system as the grids."""
        path = self.folder / f"{_WORK}{secrets.token_hex(8)}"
        path.mkdir()
        return path

    def temporary(self, suffix: str) -> Path:
        """A new, empty file that may become large, for the caller to remove; one that is left over is swept."""
        handle, name = tempfile.mkstemp(prefix=_WORK, suffix=suffix, dir=self.folder)
        os.close(handle)
        return Path(name)

    def drop(self, work: Path) -> None:
        """Removes a work folder with all that is in it. Harmless when it is gone."""
        shutil.rmtree(work, ignore_errors=True)

    def path(self, digest: str) -> Path:
        """Where the grid of this digest lies, or would lie. Raises ValueError for what is no digest."""
        if not _DIGEST.fullmatch(digest):
            raise ValueError(f"{digest!r} is no digest of a grid")
        return self.folder / digest

    def has(self, digest: str) -> bool:
        """True when the grid is stored."""
        return self.path(digest).is_dir()

    def keep(self, raster_dir: Path, digest: str) -> None:
        """Takes a finished raster in, durably, before it returns. Does nothing when it is stored already.

        ``raster_dir``: in a work folder; it is moved. Raises OSError.
        """
        target = self.path(digest)
        for file in (*raster_dir.iterdir(), raster_dir):
            _sync(file)
        with self._lock:
            if not target.is_dir():
                raster_dir.rename(target)
        _sync(self.folder)

    def put(self, raster: Raster) -> None:
        """Stores a raster that is in memory. Raises OSError."""
        if self.has(raster.digest):
            return
        work = self.work()
        try:
            rasters.write(work / "raster", raster)
            self.keep(work / "raster", raster.digest)
        finally:
            self.drop(work)

    def read(self, digest: str) -> Raster:
        """The raster, mapped from disk; who reads it while another holds it gets the same. Raises RasterError."""
        with self._lock:
            found = self._open.get(digest)
            if found is None:
                if not self.has(digest):
                    raise MissingGrid("The elevation grid of this layer is not on this server.")
                found = rasters.read(self.path(digest))
                if found.digest != digest:
                    raise RasterError("The stored elevation grid is not the one that it should be.")
                self._open[digest] = found
            return found

    def size(self, digests: Iterable[str]) -> int:
        """Bytes on disk of these grids together; those that are not stored count nothing."""
        paths = (self.path(digest) for digest in set(digests))
        return sum(file.stat().st_size for path in paths if path.is_dir() for file in path.iterdir())

    def sweep(self, named: Collection[str]) -> None:
        """Removes work folders and the grids that are not ``named``. Call it before anybody imports anything."""
        for path in self.folder.iterdir():
            if path.name.startswith(_WORK) or (_DIGEST.fullmatch(path.name) and path.name not in named):
                log.info("removing %s, which nothing refers to", path.name)
                if path.is_dir():
                    shutil.rmtree(path, ignore_errors=True)
                else:
                    path.unlink(missing_ok=True)


def _sync(path: Path) -> None:
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
