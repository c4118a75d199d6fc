"""Ops as JSON text, the same way on the wire and in the journal: every default written out, except in the partial
updates, where an absent field means "unchanged". Whole documents are kept compressed."""

from __future__ import annotations

import zlib
from typing import Final, NamedTuple

from esker import contract as c
from esker.contract import Op


def op_json(op: Op) -> str:
    """The JSON text of an op; ``contract.OP.validate_json`` reads it back to an equal op."""
    if isinstance(op, c.Group):
        return f'{{"type":"group","ops":[{",".join(op_json(part) for part in op.ops)}]}}'
    if isinstance(op, c.SetStroke):
        return op.model_dump_json(include={"type": True, "stroke": True, "fields": op.fields.model_fields_set})
    if isinstance(op, c.SetLayer):
        return op.model_dump_json(include={"type": True, "layer": True, "fields": op.fields.model_fields_set})
    if isinstance(op, c.SetTerrain):
        return op.model_dump_json(include={"type": True, "fields": op.fields.model_fields_set})
    return op.model_dump_json()


def document_json(document: c.Document) -> str:
    """``document.model_dump_json()``, stroke by stroke: of a heavy document that holds the interpreter for seconds, and
    whoever encodes one in a thread of its own wants others to go on."""
    lists = ("strokes", "deleted", "layers", "deleted_layers")
    parts = [document.model_dump_json(exclude=set(lists))[:-1]]
    for name in lists:
        items = ",".join([item.model_dump_json() for item in getattr(document, name)])
        parts.append(f',"{name}":[{items}]')
    parts.append("}")
    return "".join(parts)


LEVEL: Final = 1
"""The level of zlib. A heavy document shrinks to less than a half, at 15 ms a megabyte. Level 6 takes five times as
long for a sixth less."""


class Compressed(NamedTuple):
    """A document as a database keeps it: zlib streams one after another, whose contents together are its JSON text."""

    data: bytes
    characters: int
    """Characters of the text. Reading takes as long as the text is."""
    title: str

    @classmethod
    def of(cls, document: c.Document) -> Compressed:
        """Encodes and compresses a document. Of a heavy one that takes hundreds of milliseconds.

        >>> from esker.document.former import read_document
        >>> born = c.Document(id="tor")
        >>> read_document(decompressed(Compressed.of(born).data)) == born
        True
        """
        text = document_json(document)
        return cls(compressed(text), len(text), document.settings.title)


def compressed(text: str) -> bytes:
    """One stream of a text. Others go on meanwhile: zlib gives the interpreter's lock away."""
    return zlib.compress(text.encode(), LEVEL)


def decompressed(data: bytes) -> str:
    """The text of all streams. Raises ValueError where the data is no whole stream."""
    parts = []
    while data:
        stream = zlib.decompressobj()
        try:
            parts.append(stream.decompress(data))
        except zlib.error as error:
            raise ValueError(f"a compressed document is damaged: {error}") from None
        if not stream.eof:
            raise ValueError("a compressed document is cut off")
        data = stream.unused_data
    return b"".join(parts).decode()
