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
