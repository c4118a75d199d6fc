"""The changes of an op, field by field, which undo remembers (``undo.py``). Twin of ``frontend/src/doc/changes.ts``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final, Literal

from esker import contract as c
from esker.contract import Layer, Op, Stroke
from esker.document.ops import StrokeSet

State = Literal["absent", "live", "deleted"]
Change = tuple[object, object]
Kind = Literal["stroke", "layer"]

STROKE_WORDS: Final[dict[str, str]] = {
    "first": "start",
    "last": "end",
    "curve": "line",
    "left": "left flank",
    "right": "right flank",
    "plateau_radius_m": "plateau radius",
    "amplitude_m": "noise amplitude",
    "roughness": "roughness",
    "yields": "yielding",
    "paint": "paint",
    "course": "course",
    "locked": "lock",
    "hidden": "visibility",
    "label": "label",
}
"""The undoable fields of a stroke in the order in which they are restored, with the word a person reads."""
LAYER_WORDS: Final[dict[str, str]] = {
    "name": "name",
    "anchor": "place",
    "rotation_deg": "rotation",
    "spacing_m": "spacing",
    "scale": "vertical scale",
    "lift_m": "lift",
    "accuracy_m": "accuracy",
    "priority": "order",
    "hidden": "visibility",
    "outline": "outline",
    "source": "source",
    "licence": "licence",
}
TERRAIN_WORDS: Final[dict[str, str]] = {
    "title": "title",
    "reach_m": "reach",
    "border": "border",
    "sea_level_m": "sea level",
    "lakes_m": "lakes",
    "rivers": "rivers",
    "wetness": "wetness",
    "seed": "seed",
    "look": "look",
    "detail": "detail",
    "rule": "rule",
    "erosion": "erosion",
    "erosion_scale": "size of the gullies",
    "hold": "hold of the crests",
    "sun_azimuth_deg": "direction of the sun",
    "sun_elevation_deg": "height of the sun",
    "place": "place on Earth",
    "task": "task",
    "task_pictures": "pictures of the task",
}
WORDS: Final[dict[Kind, dict[str, str]]] = {"stroke": STROKE_WORDS, "layer": LAYER_WORDS}


@dataclass(frozen=True)
class ItemChange:
    """One step's changes of a stroke or a layer.

    ``content`` is the stroke or layer as I left it when it came to life or died.
    """

    before: State
    after: State
    fields: dict[str, Change]
    content: Stroke | Layer | None = None

    def then(self, later: ItemChange) -> ItemChange:
        """This change followed by a later one of the same step."""
        fields = merged(self.fields, later.fields)
        content = later.content
        if content is None and self.content is not None:
            content = self.content.model_copy(update={name: new for name, (_, new) in later.fields.items()})
        return ItemChange(self.before, later.after, fields, content)

    @property
    def empty(self) -> bool:
        """True when there is nothing that undo could put back."""
        return not self.fields and self.before == self.after


@dataclass(frozen=True)
class Changes:
    """The effect of one op, or of several merged: by stroke id, by layer id and by terrain field."""

    strokes: dict[str, ItemChange]
    terrain: dict[str, Change]
    layers: dict[str, ItemChange] = field(default_factory=dict)

    @property
    def empty(self) -> bool:
        """True when there is nothing that undo could put back."""
        return not self.terrain and all(i.empty for i in (*self.strokes.values(), *self.layers.values()))

    def then(self, later: Changes) -> Changes:
        """These changes followed by later ones."""
        return Changes(
            _joined(self.strokes, later.strokes),
            merged(self.terrain, later.terrain),
            _joined(self.layers, later.layers),
        )


def merged(earlier: Mapping[str, Change], later: Mapping[str, Change]) -> dict[str, Change]:
    """The fields of two changes in a row: the older value of the first, the newer one of the last."""
    out = dict(earlier)
    for name, (old, new) in later.items():
        out[name] = (out[name][0] if name in out else old, new)
    return out


def _joined(earlier: Mapping[str, ItemChange], later: Mapping[str, ItemChange]) -> dict[str, ItemChange]:
    out = dict(earlier)
    for item_id, change in later.items():
        out[item_id] = out[item_id].then(change) if item_id in out else change
    return out


def changes(op: Op, before: StrokeSet, after: StrokeSet) -> Changes:
    """Returns the changes between the two documents that ``op`` made, field by field."""
    out = Changes({}, {})
    for part in op.ops if isinstance(op, c.Group) else (op,):
        if isinstance(part, c.SetTerrain):
            for name in TERRAIN_WORDS:
                old, new = getattr(before.settings, name), getattr(after.settings, name)
                if name in part.fields.model_fields_set and old != new:
                    out.terrain[name] = (old, new)
        elif isinstance(part, c.AddLayer | c.SetLayer | c.DeleteLayer | c.RestoreLayer):
            layer_id = part.layer.id if isinstance(part, c.AddLayer) else part.layer
            out.layers[layer_id] = _item_change("layer", layer_id, before, after)
        else:
            stroke_id = part.stroke.id if isinstance(part, c.BeginStroke) else part.stroke
            out.strokes[stroke_id] = _item_change("stroke", stroke_id, before, after)
    return out


def state_of(kind: Kind, document: StrokeSet, item_id: str) -> tuple[State, Stroke | Layer | None]:
    """Whether the stroke or layer is there, and it (or its tombstone)."""
    live: Mapping[str, Stroke | Layer] = document.strokes if kind == "stroke" else document.layers
    if item_id in live:
        return "live", live[item_id]
    gone: Mapping[str, Stroke | Layer] = document.deleted if kind == "stroke" else document.deleted_layers
    if item_id in gone:
        return "deleted", gone[item_id]
    return "absent", None


def _item_change(kind: Kind, item_id: str, before: StrokeSet, after: StrokeSet) -> ItemChange:
    old_state, old = state_of(kind, before, item_id)
    new_state, new = state_of(kind, after, item_id)
    fields: dict[str, Change] = {}
    if old is not None and new is not None:
        for name in WORDS[kind]:
            pair = (getattr(old, name), getattr(new, name))
            if pair[0] != pair[1]:
                fields[name] = pair
    return ItemChange(old_state, new_state, fields, new if old_state != new_state else None)
