"""Small documents and ops that the vector generator and the tests share."""

from __future__ import annotations

from typing import Any

from esker import contract as c

Json = dict[str, Any]


def stroke(stroke_id: str, **over: Any) -> Json:
    """A ridge of three points from west to east, with overridden fields, as JSON."""
    base: Json = {
        "id": stroke_id,
        "author": "ada",
        "kind": "profile",
        "first": [500, 2000, 0],
        "last": [3500, 2000, 0],
        "curve": [[0, 0], [0.5, 225.5], [1, 0]],
        "left": {"slope_deg": 35, "extent_m": 512, "shape": "concave"},
        "right": {"slope_deg": None, "extent_m": 256.25, "shape": "straight"},
        "finished": True,
    }
    return dump(c.Stroke.model_validate_json(_text(base | over)))


def layer(layer_id: str, **over: Any) -> Json:
    """A layer of 100 x 80 samples of 10 m, with overridden fields, as JSON."""
    base: Json = {
        "id": layer_id,
        "content": "0123456789abcdef" * 4,
        "facts": {"rows": 80, "cols": 100, "low_m": 12.5, "high_m": 840, "file": "valley.tif"},
        "author": "ada",
        "name": "valley.tif",
        "anchor": [500, 600.5],
        "rotation_deg": 27,
        "spacing_m": [10, 12.5],
        "accuracy_m": 0.5,
    }
    return dump(c.Layer.model_validate_json(_text(base | over)))


def document(
    *strokes: Json,
    deleted: tuple[Json, ...] = (),
    layers: tuple[Json, ...] = (),
    deleted_layers: tuple[Json, ...] = (),
    clock: int = 7,
    **settings: Any,
) -> Json:
    """A document of these strokes and layers, as JSON."""
    raw = {"id": "t1", "clock": clock, "strokes": strokes, "deleted": deleted, "settings": settings}
    raw |= {"layers": layers, "deleted_layers": deleted_layers}
    return dump(c.Document.model_validate_json(_text(raw)))


def op(kind: str, **fields: Any) -> Json:
    """An op as JSON, exactly as it would be sent."""
    return {"type": kind, **fields}


def dump(value: c.Wire) -> Json:
    """A wire value as JSON-compatible data, all fields written out."""
    out: Json = value.model_dump(mode="json")
    return out


def _text(value: Any) -> str:
    import json

    return json.dumps(value)
