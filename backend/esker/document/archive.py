"""The ``.esker`` file: a whole terrain as a zip (DESIGN 13). Pure but for the files it is given.

Members: ``esker.json`` (format and version), ``document.json`` (a ``contract.Document``) and, for each grid of an
elevation layer, ``grids/<digest>.npy`` (heights, float32, row 0 south) and ``grids/<digest>.warp.npy`` where it has a
control net. What else a grid needs follows from these. Unknown members are ignored. Reading is bounded before anything
is unpacked.
"""

from __future__ import annotations

import errno
import io
import json
import shutil
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, Final, Protocol

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from esker.contract import MAX_GRID_SAMPLES, Document
from esker.document.former import read_document
from esker.document.wire import document_json

FORMAT = "esker-terrain"
VERSION = 7
"""1 had neither paint nor settings of the detail, 2 no elevation layers, 3 no edition, 4 the second at most, 5 no
gullies, 6 no tasks; they are read as they are, with the defaults. A document is written as the oldest that has what is
in it."""
GULLIES_VERSION, PAIRS_VERSION, EDITION_VERSION, LAYERS_VERSION, PLAIN_VERSION = 6, 5, 4, 3, 2
MAX_ARCHIVE_BYTES = 512 * 1024 * 1024
MAX_DOCUMENT_BYTES = 512 * 1024 * 1024
MAX_GRIDS_BYTES = 1 << 30
"""All grids of a file together, unpacked."""
MAX_HEADER_BYTES = 64 * 1024
MAX_RATIO = 200
"""A document never compresses better than this; a bomb does."""
MAX_MEMBERS = 1024
GRID_COMPRESSION: Final = 3
_HEADER, _DOCUMENT, _GRIDS = "esker.json", "document.json", "grids"
_EPOCH = (1980, 1, 1, 0, 0, 0)
_CHUNK = 1 << 20


class ArchiveError(ValueError):
    """Not a terrain file, or not one that may be opened; the message is for a person."""


class Grid(Protocol):
    """What a file keeps of a grid (``patchwork.rasters.Raster`` is one)."""

    @property
    def heights(self) -> NDArray[np.float32]:
        """(rows, cols) float32 metres, NaN for nodata, row 0 south."""

    @property
    def warp(self) -> NDArray[np.float64] | None:
        """(m, n, 2) float64 control net, or None."""


@dataclass(frozen=True, eq=False)
class PlainGrid:
    """A grid as it came out of a file."""

    heights: NDArray[np.float32]
    warp: NDArray[np.float64] | None


def write(file: BinaryIO, document: Document, grids: Mapping[str, Grid] | None = None) -> None:
    """Writes a terrain: the same bytes for the same document.

    ``grids``: by digest, at least those of all layers; a deleted layer whose grid is not among them is left out. Raises
    ArchiveError when the grid of a layer is missing, or all together are larger than a file may hold.
    """
    grids = grids or {}
    for layer in document.layers:
        if layer.content not in grids:
            raise ArchiveError(f"The elevation grid of the layer “{layer.name or layer.id}” is missing.")
    kept = tuple(layer for layer in document.deleted_layers if layer.content in grids)
    document = document.model_copy(update={"deleted_layers": kept})
    named = dict.fromkeys(layer.content for layer in (*document.layers, *kept))
    if sum(4 * grids[digest].heights.size for digest in named) > MAX_GRIDS_BYTES:
        raise ArchiveError(
            f"The elevation grids of this terrain are larger than the {MAX_GRIDS_BYTES >> 20} MiB of a file."
        )
    header = json.dumps({"format": FORMAT, "version": _version(document)}).encode()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in ((_HEADER, header), (_DOCUMENT, document_json(document).encode())):
            archive.writestr(_member(name), data)
        for digest in named:
            _write_array(archive, f"{_GRIDS}/{digest}.npy", grids[digest].heights)
            warp = grids[digest].warp
            if warp is not None:
                _write_array(archive, f"{_GRIDS}/{digest}.warp.npy", warp)


def _version(document: Document) -> int:
    """The oldest version of files that has what is in a document."""
    edition = document.settings.edition
    if document.settings.task is not None or document.settings.task_pictures:
        return VERSION
    strokes = (*document.strokes, *document.deleted)
    if document.settings.erosion > 0 or any(s.paint is not None and s.paint.channel == "erosion" for s in strokes):
        return GULLIES_VERSION
    if edition > 1:
        return PAIRS_VERSION if edition > 2 else EDITION_VERSION
    return LAYERS_VERSION if document.layers or document.deleted_layers else PLAIN_VERSION


def dumps(document: Document, grids: Mapping[str, Grid] | None = None) -> bytes:
    """A terrain as the bytes of an ``.esker`` file; see ``write``."""
    out = io.BytesIO()
    write(out, document, grids)
    return out.getvalue()


def loads(data: bytes) -> Document:
    """The terrain in the bytes of an ``.esker`` file. Raises ArchiveError for anything else."""
    with _opened(io.BytesIO(data)) as archive:
        return _document(archive, len(data))


def load_grids(data: bytes) -> dict[str, PlainGrid]:
    """The grids of the layers in the bytes of an ``.esker`` file, by digest (not verified). Raises ArchiveError."""
    with _opened(io.BytesIO(data)) as archive:
        document = _document(archive, len(data))
        out = {}
        for digest in _named(document):
            heights, warp = _read_grid(archive, digest)
            out[digest] = PlainGrid(_array(heights), None if warp is None else _array(warp))
        return out


def unpack(file: BinaryIO, folder: Path) -> Document:
    """The terrain in an ``.esker`` file; its grids as ``folder/<digest>.npy`` and ``folder/<digest>.warp.npy``, with
    their form checked but not their digests. Raises ArchiveError, OSError."""
    size = file.seek(0, io.SEEK_END)
    with _opened(file) as archive:
        document = _document(archive, size)
        for digest in _named(document):
            for suffix in (".npy", ".warp.npy"):
                name = f"{_GRIDS}/{digest}{suffix}"
                if suffix == ".npy" or name in archive.namelist():
                    with archive.open(name) as member, (folder / f"{digest}{suffix}").open("wb") as out:
                        _copy(member, out, archive.getinfo(name).file_size)
                    with (folder / f"{digest}{suffix}").open("rb") as made:
                        _check_array(made, suffix)
        return document


def document_from_json(text: bytes) -> Document:
    """A document from JSON text. Raises ArchiveError that names the first field that is wrong."""
    try:
        return read_document(text)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        where = ".".join(str(part) for part in first["loc"]) or "it"
        raise ArchiveError(f"The terrain in this file is not valid: {where}: {first['msg']}.") from error


@contextmanager
def _opened(file: BinaryIO) -> Iterator[zipfile.ZipFile]:
    """The zip, with whatever can be wrong with one turned into an ArchiveError."""
    size = file.seek(0, io.SEEK_END)
    if size > MAX_ARCHIVE_BYTES:
        raise ArchiveError(f"The file is larger than {MAX_ARCHIVE_BYTES >> 20} MiB.")
    try:
        with zipfile.ZipFile(file) as archive:
            if len(archive.infolist()) > MAX_MEMBERS:
                raise ArchiveError("The file has too many parts to be a terrain.")
            yield archive
    except ArchiveError:
        raise
    except (zipfile.BadZipFile, zlib.error, NotImplementedError, RuntimeError, EOFError, ValueError) as error:
        raise ArchiveError("This is not an .esker file, or it is damaged.") from error
    except OSError as error:
        if error.errno != errno.EINVAL:  # what a file says to a member that begins before it
            raise
        raise ArchiveError("This is not an .esker file, or it is damaged.") from error


def _document(archive: zipfile.ZipFile, size: int) -> Document:
    """The document, once it is certain that all its grids are there and small enough."""
    _check_header(_read(archive, _HEADER, MAX_HEADER_BYTES))
    limit = min(MAX_DOCUMENT_BYTES, MAX_RATIO * size + MAX_HEADER_BYTES)
    document = document_from_json(_read(archive, _DOCUMENT, limit))
    names = set(archive.namelist())
    for layer in (*document.layers, *document.deleted_layers):
        if f"{_GRIDS}/{layer.content}.npy" not in names:
            raise ArchiveError(f"The file lacks the elevation grid of the layer “{layer.name or layer.id}”.")
    total = sum(info.file_size for info in archive.infolist() if info.filename.startswith(f"{_GRIDS}/"))
    if total > MAX_GRIDS_BYTES:
        raise ArchiveError(f"The elevation grids unpack to more than {MAX_GRIDS_BYTES >> 20} MiB and were not opened.")
    return document


def _named(document: Document) -> dict[str, None]:
    return dict.fromkeys(layer.content for layer in (*document.layers, *document.deleted_layers))


def _member(name: str) -> zipfile.ZipInfo:
    info = zipfile.ZipInfo(name, _EPOCH)
    info.compress_type = zipfile.ZIP_DEFLATED
    return info


def _write_array(archive: zipfile.ZipFile, name: str, array: NDArray[Any]) -> None:
    """Block by block, so that a mapped grid is never whole in memory."""
    info = _member(name)
    info._compresslevel = GRID_COMPRESSION  # type: ignore[attr-defined]  # public only from Python 3.13 on
    order = array.dtype.newbyteorder("<")
    with archive.open(info, "w", force_zip64=True) as out:
        head = {"descr": order.str, "fortran_order": False, "shape": array.shape}
        np.lib.format.write_array_header_1_0(out, head)
        step = max(1, _CHUNK // max(1, array[0].nbytes))
        for row in range(0, array.shape[0], step):
            out.write(np.ascontiguousarray(array[row : row + step], order).tobytes())


def _read_grid(archive: zipfile.ZipFile, digest: str) -> tuple[bytes, bytes | None]:
    heights = _read(archive, f"{_GRIDS}/{digest}.npy", MAX_GRIDS_BYTES)
    name = f"{_GRIDS}/{digest}.warp.npy"
    warp = _read(archive, name, MAX_GRIDS_BYTES) if name in archive.namelist() else None
    for data, suffix in ((heights, ".npy"), (warp, ".warp.npy")):
        if data is not None:
            _check_array(io.BytesIO(data), suffix)
    return heights, warp


def _array(data: bytes) -> NDArray[Any]:
    found: NDArray[Any] = np.load(io.BytesIO(data), allow_pickle=False)
    return found


def _check_array(file: BinaryIO, suffix: str) -> None:
    """Raises ArchiveError unless this is an .npy file of heights or of a control net, as long as it says."""
    dtype, dimensions = (np.dtype("<f4"), 2) if suffix == ".npy" else (np.dtype("<f8"), 3)
    try:
        if np.lib.format.read_magic(file) != (1, 0):
            raise ValueError("another version of the format")
        shape, fortran, found = np.lib.format.read_array_header_1_0(file)
        start = file.tell()
        length = file.seek(0, io.SEEK_END) - start
    except ValueError as error:
        raise ArchiveError("An elevation grid in this file is damaged.") from error
    samples = int(np.prod(shape, dtype=np.float64))
    good = found == dtype and len(shape) == dimensions and not fortran and 0 < samples <= 2 * MAX_GRID_SAMPLES
    if not good or length < samples * dtype.itemsize:
        raise ArchiveError("An elevation grid in this file is damaged.")


def _copy(member: Any, out: BinaryIO, declared: int) -> None:
    """All of a member, never more than it declares."""
    if declared > MAX_GRIDS_BYTES:
        raise ArchiveError("An elevation grid in this file is too large.")
    shutil.copyfileobj(member, out, _CHUNK)  # zipfile itself stops at the declared size


def _read(archive: zipfile.ZipFile, name: str, limit: int) -> bytes:
    """One member, never more than ``limit`` bytes, whatever the archive declares."""
    try:
        info = archive.getinfo(name)
    except KeyError as error:
        raise ArchiveError(f"This is not an .esker file: it has no {name}.") from error
    if info.file_size > limit:
        raise ArchiveError(f"The file unpacks to more than {limit} bytes and was not opened.")
    with archive.open(info) as member:
        out = member.read(limit + 1)
    if len(out) > limit:
        raise ArchiveError(f"The file unpacks to more than {limit} bytes and was not opened.")
    return out


def _check_header(data: bytes) -> None:
    try:
        header = json.loads(data)
    except ValueError as error:
        raise ArchiveError("This is not an .esker file, or it is damaged.") from error
    if not isinstance(header, dict) or header.get("format") != FORMAT:
        raise ArchiveError("This is not an .esker file.")
    version = header.get("version")
    if not isinstance(version, int) or not 1 <= version <= VERSION:
        raise ArchiveError("This file was made by a newer Esker. Update, then open it again.")
