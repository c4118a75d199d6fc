"""The ``.esker`` file: a whole terrain as a zip of JSON (DESIGN 13). Pure bytes in, bytes out.

Members: ``esker.json`` (format and version) and ``document.json`` (a ``contract.Document``). Unknown members are
ignored, so that later versions can add layers. Reading is bounded before anything is unpacked.
"""

from __future__ import annotations

import io
import json
import zipfile
import zlib

from pydantic import ValidationError

from esker.contract import Document

FORMAT = "esker-terrain"
VERSION = 2
"""1 had neither paint nor settings of the detail; its documents are read as they are, with the defaults."""
MAX_ARCHIVE_BYTES = 64 * 1024 * 1024
MAX_DOCUMENT_BYTES = 512 * 1024 * 1024
MAX_HEADER_BYTES = 64 * 1024
MAX_RATIO = 200
"""A document never compresses better than this; a bomb does."""
MAX_MEMBERS = 1024
_HEADER, _DOCUMENT = "esker.json", "document.json"
_EPOCH = (1980, 1, 1, 0, 0, 0)


class ArchiveError(ValueError):
    """Not a terrain file, or not one that may be opened; the message is for a person."""


def dumps(document: Document) -> bytes:
    """A terrain as the bytes of an ``.esker`` file: the same bytes for the same document."""
    header = json.dumps({"format": FORMAT, "version": VERSION}).encode()
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as file:
        for name, data in ((_HEADER, header), (_DOCUMENT, document.model_dump_json().encode())):
            info = zipfile.ZipInfo(name, _EPOCH)
            info.compress_type = zipfile.ZIP_DEFLATED
            file.writestr(info, data)
    return out.getvalue()


def loads(data: bytes) -> Document:
    """The terrain in the bytes of an ``.esker`` file. Raises ArchiveError for anything else."""
    if len(data) > MAX_ARCHIVE_BYTES:
        raise ArchiveError(f"The file is larger than {MAX_ARCHIVE_BYTES >> 20} MiB.")
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as file:
            if len(file.infolist()) > MAX_MEMBERS:
                raise ArchiveError("The file has too many parts to be a terrain.")
            _check_header(_read(file, _HEADER, MAX_HEADER_BYTES))
            text = _read(file, _DOCUMENT, min(MAX_DOCUMENT_BYTES, MAX_RATIO * len(data) + MAX_HEADER_BYTES))
    except (zipfile.BadZipFile, zlib.error, NotImplementedError, RuntimeError, EOFError, OSError) as error:
        raise ArchiveError("This is not an .esker file, or it is damaged.") from error
    return document_from_json(text)


def document_from_json(text: bytes) -> Document:
    """A document from JSON text. Raises ArchiveError that names the first field that is wrong."""
    try:
        return Document.model_validate_json(text)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        where = ".".join(str(part) for part in first["loc"])
        raise ArchiveError(f"The terrain in this file is not valid: {where}: {first['msg']}.") from error


def _read(file: zipfile.ZipFile, name: str, limit: int) -> bytes:
    """One member, never more than ``limit`` bytes, whatever the archive declares."""
    try:
        info = file.getinfo(name)
    except KeyError as error:
        raise ArchiveError(f"This is not an .esker file: it has no {name}.") from error
    if info.file_size > limit:
        raise ArchiveError(f"The file unpacks to more than {limit} bytes and was not opened.")
    with file.open(info) as member:
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
