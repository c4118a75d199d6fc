"""Ops as JSON text, the same way on the wire and in the journal: every default written out, except in the partial
updates, where an absent field means "unchanged"."""

from __future__ import annotations

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
