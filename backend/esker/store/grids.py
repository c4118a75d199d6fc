"""Stored elevation grids: directories named by the digest of what is in them, never changed (DESIGN 11, 13).

A grid comes to be in a work folder beside the others; when it is whole, its files and the folder are synced to disk and
it is renamed to its digest, in one step. An op names a grid only after that, so ``kill -9`` leaves a terrain without a
layer or with all of it. What a kill leaves over is swept at the next start: work folders are removed, and grids that no
terrain names go to a trash, ``.trash/<digest>-<seconds since 1970>``, from which they are removed two weeks later. A
database that lost its memory of a grid cannot take the grid with it.

Where several servers share a store of objects a grid is there, as ``grids/<digest>.tar``, before it is here, and the
folder is a cache of it. Objects that no terrain names are removed by their age alone, two weeks after they were stored.
"""

from __future__ import annotations

import logging
import math
import os
import re
import secrets
import shutil
import tarfile
import tempfile
import threading
import time
import weakref
from collections.abc import Collection, Iterable
from pathlib import Path
from typing import Final

from esker import contract as c
from esker.document import archive
from esker.patchwork.raster import rasters
from esker.patchwork.raster.rasters import Raster, RasterError
from esker.process import system
from esker.store.engine.objects import NoSuchObject, Objects
from esker.store.space import NoSpace, Space

log = logging.getLogger("esker.grids")

FOLDER: Final = "grids"
_WORK: Final = ".work-"
_TRASH: Final = ".trash"
TRASH_SECONDS: Final = 14 * 86_400.0
"""How long a grid that no terrain names is kept in the trash."""
NAMED_WITHIN: Final = 86_400.0
"""Seconds within which an op names a grid that was stored, or brought a second time."""
_DIGEST: Final = re.compile(r"[0-9a-f]{64}")


class MissingGrid(RasterError):
    """No grid of this digest is stored here."""


class GridStore:
    """The grids of one server, of all terrains: who brings the same file twice shares one. Safe from any thread."""

    def __init__(self, data: Path, space: Space | None = None, objects: Objects | None = None) -> None:
        """``data``: the server's folder; ``space``: the disk that it may use; ``objects``: where servers have their
        grids together. Raises OSError."""
        self._objects = objects
        self.folder = data / FOLDER
        self.folder.mkdir(parents=True, exist_ok=True)
        self.space = Space(self.folder) if space is None else space
        self._lock = threading.Lock()
        self._open: weakref.WeakValueDictionary[str, Raster] = weakref.WeakValueDictionary()

    def work(self) -> Path:
        """A new, empty work folder, on the same file system as the grids. Raises OSError, space.NoSpace among them."""
        self.space.need()
        path = self.folder / f"{_WORK}{secrets.token_hex(8)}"
        path.mkdir()
        return path

    def temporary(self, suffix: str) -> Path:
        """A new, empty file that may become large, for the caller to remove; one that is left over is swept.

        Raises OSError, space.NoSpace among them.
        """
        self.space.need()
        handle, name = tempfile.mkstemp(prefix=_WORK, suffix=suffix, dir=self.folder)
        os.close(handle)
        return Path(name)

    def drop(self, work: Path) -> None:
        """Removes a work folder with all that is in it. Harmless when it is gone."""
        shutil.rmtree(work, ignore_errors=True)

    def path(self, digest: str) -> Path:
        """Returns where the grid of this digest lies, or would lie. Raises ValueError for what is no digest."""
        if not _DIGEST.fullmatch(digest):
            raise ValueError(f"{digest!r} is no digest of a grid")
        return self.folder / digest

    def has(self, digest: str) -> bool:
        """True when the grid is stored. Asks the store of objects where it is not here. Raises OSError."""
        return self.path(digest).is_dir() or (self._objects is not None and self._objects.has(_object(digest)))

    def has_all(self, document: c.Document) -> bool:
        """Whether the grids of all layers of a document are stored. Raises OSError."""
        return all(self.has(layer.content) for layer in document.layers)

    def fetch_all(self, document: c.Document) -> None:
        """Brings the grids of all layers of a document here, for processes that read the folder."""
        self.fetch(layer.content for layer in document.layers)

    def keep(self, raster_dir: Path, digest: str) -> None:
        """Takes a finished raster in, durably, before it returns. Does nothing when it is stored already.

        ``raster_dir``: in a work folder; it is moved. Raises OSError.
        """
        target = self.path(digest)
        for file in (*raster_dir.iterdir(), raster_dir):
            system.sync(file)
        if self._objects is not None:
            self._send(raster_dir, digest, self._objects)
        with self._lock:
            if target.is_dir():
                os.utime(target)  # an op is about to name this grid, so a sweep must not take it for forgotten
            else:
                raster_dir.rename(target)
        system.sync(self.folder)

    def put(self, raster: Raster) -> None:
        """Stores a raster that is in memory. Raises OSError, space.NoSpace among them."""
        with self._lock:
            if self.path(raster.digest).is_dir() and self._objects is None:
                os.utime(self.path(raster.digest))
                return
        self.space.need(raster.heights.nbytes)
        work = self.work()
        try:
            rasters.write(work / "raster", raster)
            self.keep(work / "raster", raster.digest)
        finally:
            self.drop(work)

    def read(self, digest: str) -> Raster:
        """The raster, mapped from disk; who reads it while another holds it gets the same. Raises RasterError."""
        self.fetch([digest])
        with self._lock:
            found = self._open.get(digest)
            if found is None:
                if not self.path(digest).is_dir():
                    raise MissingGrid("The elevation grid of this layer is not on this server.")
                found = rasters.read(self.path(digest))
                if found.digest != digest:
                    raise RasterError("The stored elevation grid is not the one that it should be.")
                self._open[digest] = found
            return found

    def verified(self, digest: str) -> Raster:
        """The raster, once all of its heights were read and are what the digest says. Raises RasterError."""
        found = self.read(digest)
        if not rasters.verify(found):
            raise RasterError(f"The stored elevation grid {digest} is damaged.")
        return found

    def fetch(self, digests: Iterable[str]) -> None:
        """Brings grids here from the store of objects, those that are there. What cannot be had is logged."""
        for digest in set(digests):
            if self._objects is None or self.path(digest).is_dir():
                continue
            try:
                self._bring(digest, self._objects)
            except NoSuchObject:
                continue
            except (OSError, RasterError, tarfile.TarError) as error:
                log.error("the grid %s cannot be fetched: %s", digest, error)

    def _bring(self, digest: str, objects: Objects) -> None:
        """Raises NoSuchObject, NoObjects, OSError, RasterError, TarError."""
        self._make_room(objects.size(_object(digest)))
        work = self.work()
        try:
            objects.get(_object(digest), work / "grid.tar")
            with tarfile.open(work / "grid.tar") as packed:
                packed.extractall(work / "raster", filter="data")
            if rasters.read(work / "raster").digest != digest or not rasters.verify(rasters.read(work / "raster")):
                raise RasterError("The stored elevation grid is not the one that it should be.")
            with self._lock:
                if not self.path(digest).is_dir():
                    (work / "raster").rename(self.path(digest))
        finally:
            self.drop(work)

    def _send(self, raster_dir: Path, digest: str, objects: Objects) -> None:
        """Stores a raster as one object, whole. Raises OSError."""
        packed = self.temporary(".tar")
        try:
            with tarfile.open(packed, "w") as tar:
                for file in sorted(raster_dir.iterdir()):
                    tar.add(file, file.name)
            objects.put(_object(digest), packed)
        finally:
            packed.unlink(missing_ok=True)

    def _make_room(self, more: int) -> None:
        """Room for ``more`` bytes, by what nobody has used for longest where need be. Raises NoSpace."""
        kept = sorted((p for p in self.folder.iterdir() if _DIGEST.fullmatch(p.name)), key=lambda p: p.stat().st_atime)
        while True:
            try:
                self.space.need(more)
                return
            except NoSpace:
                if not kept:
                    raise
                with self._lock:
                    oldest = kept.pop(0)
                    if oldest.name not in self._open:
                        _remove(oldest)

    def pack(self, document: c.Document) -> Path:
        """A temporary .esker file of a document. Raises document.archive.ArchiveError, RasterError: a grid that is
        missing or damaged."""
        self.fetch(layer.content for layer in (*document.layers, *document.deleted_layers))
        live = {layer.content: self.read(layer.content) for layer in document.layers}
        gone = {layer.content for layer in document.deleted_layers if layer.content not in live}
        found = live | {digest: self.read(digest) for digest in gone if self.path(digest).is_dir()}
        path = self.temporary(".esker")
        with path.open("wb") as file:
            try:
                archive.write(file, document, found)
            except BaseException:
                path.unlink()
                raise
        return path

    def size(self, digests: Iterable[str]) -> int:
        """Bytes on disk of these grids together; those that are not stored count nothing."""
        total = 0
        for digest in set(digests):
            path = self.path(digest)
            if path.is_dir():
                total += sum(file.stat().st_size for file in path.iterdir())
            elif self._objects is not None:
                total += self._objects.size(_object(digest))
        return total

    def sweep(self, named: Collection[str], now: float | None = None, forgotten: bool = True) -> None:
        """Removes work folders; grids that are not ``named`` go to the trash, and old ones from there.

        Call it before anybody imports anything. ``forgotten`` False: grids stay where they are, whoever names them.
        """
        now = time.time() if now is None else now
        self.bring_back(named)
        for path in self.folder.iterdir():
            if path.name.startswith(_WORK):
                log.info("removing %s, which an import left", path.name)
                _remove(path)
            elif forgotten and _DIGEST.fullmatch(path.name) and path.name not in named:
                self._throw(path, now)
        self.empty_trash(now)

    def throw_forgotten(self, named: Collection[str], now: float | None = None) -> None:
        """Puts grids that are not ``named`` into the trash while people import; not those of the last day, which an op
        may be about to name."""
        now = time.time() if now is None else now
        for path in list(self.folder.iterdir()):
            if _DIGEST.fullmatch(path.name) and path.name not in named:
                with self._lock:
                    if path.is_dir() and now - path.stat().st_mtime > NAMED_WITHIN:
                        self._throw(path, now)

    def throw_old_objects(self, named: Collection[str]) -> None:
        """Removes objects that no terrain names and that were stored more than two weeks ago. Raises OSError."""
        if self._objects is None:
            return
        for name, age in list(self._objects.ages(f"{FOLDER}/")):
            digest = name.rpartition("/")[2].removesuffix(".tar")
            if age > TRASH_SECONDS and _DIGEST.fullmatch(digest) and digest not in named:
                log.info("no terrain names the grid %s: its object is removed", digest)
                self._objects.delete(name)

    def _throw(self, path: Path, now: float) -> None:
        log.info("no terrain names the grid %s: it goes to the trash for two weeks", path.name)
        self._trash.mkdir(exist_ok=True)
        path.rename(self._trash / f"{path.name}-{int(now)}")

    def empty_trash(self, now: float | None = None) -> None:
        """Removes what has been in the trash for two weeks."""
        now = time.time() if now is None else now
        for path in self._trashed():
            if now - _time_of(path) > TRASH_SECONDS:
                log.info("removing %s from the trash", path.name)
                _remove(path)

    def bring_back(self, named: Collection[str]) -> None:
        """Takes grids that are ``named`` out of the trash again. Raises OSError."""
        for path in self._trashed():
            digest = path.name.partition("-")[0]
            if digest in named and not self.path(digest).is_dir():
                log.info("taking the grid %s out of the trash", digest)
                path.rename(self.path(digest))

    @property
    def _trash(self) -> Path:
        return self.folder / _TRASH

    def _trashed(self) -> list[Path]:
        return sorted(self._trash.iterdir()) if self._trash.is_dir() else []


def _object(digest: str) -> str:
    """The name under which servers have a grid together."""
    return f"{FOLDER}/{digest}.tar"


def _time_of(trashed: Path) -> float:
    """Returns when a grid went to the trash; the end of time for what is not a name of ours."""
    seconds = trashed.name.partition("-")[2]
    return float(seconds) if seconds.isdigit() else math.inf


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)
