"""What a class does to documents: later additions into a copy, back to the beginning, many into one. Pure.

Strokes go by id. A later addition never undoes what pupils did: a stroke that they changed or deleted stays as they
have it. Doing any of this twice does nothing the second time.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Final

from esker import contract as c
from esker.document.ops import Refusal, StrokeSet, check_document

GROUP_POINTS: Final = 8_000
"""Points of one group: what is told of it stays far below what a member's connection may hold."""
_SETTINGS: Final = tuple(name for name in c.TerrainFields.model_fields if name != "title")
_STROKE: Final = tuple(c.StrokeFields.model_fields)
_LAYER: Final = tuple(c.LayerFields.model_fields)


def additions(before: c.Document, now: c.Document, copy: StrokeSet) -> list[c.SimpleOp]:
    """Ops that bring what changed between two documents of the teacher's into a copy that began as the first."""
    ops: list[c.SimpleOp] = []
    old, new = _by_id(before.strokes), _by_id(now.strokes)
    for key, stroke in new.items():
        mine = copy.strokes.get(key)
        if key not in old:
            if mine is None and key not in copy.deleted:
                ops.append(c.BeginStroke(stroke=stroke))
        elif mine is not None and mine == old[key] != stroke:
            ops += _changed(mine, stroke)
    for key in old.keys() - new.keys():
        mine = copy.strokes.get(key)
        if mine is not None and mine == old[key]:
            ops += _gone(mine)
    ops += _added_layers(before, now, copy)
    fields = {
        name: getattr(now.settings, name)
        for name in _SETTINGS
        if getattr(copy.settings, name) == getattr(before.settings, name) != getattr(now.settings, name)
    }
    return [*ops, c.SetTerrain(fields=c.TerrainFields(**fields))] if fields else ops


def _added_layers(before: c.Document, now: c.Document, copy: StrokeSet) -> Iterator[c.SimpleOp]:
    old, new = {x.id: x for x in before.layers}, {x.id: x for x in now.layers}
    for key, layer in new.items():
        mine = copy.layers.get(key)
        if key not in old:
            if mine is None and key not in copy.deleted_layers:
                yield c.AddLayer(layer=layer)
        elif mine is not None and mine == old[key] != layer:
            yield _set_layer(mine, layer)
    for key in old.keys() - new.keys():
        if copy.layers.get(key) == old[key]:
            yield c.DeleteLayer(layer=key)


def beginning(start: c.Document, copy: StrokeSet) -> list[c.SimpleOp]:
    """Ops that bring a copy back to what it began as. What was drawn stays in its history."""
    ops: list[c.SimpleOp] = []
    wanted = _by_id(start.strokes)
    for key, stroke in copy.strokes.items():
        if key not in wanted:
            ops += _gone(stroke)
    for key, stroke in wanted.items():
        mine = copy.strokes.get(key)
        if mine is None and (mine := copy.deleted.get(key)) is not None:
            ops.append(c.RestoreStroke(stroke=key))
        if mine is None:
            ops.append(c.BeginStroke(stroke=stroke))
        else:
            ops += _changed(mine, stroke)
    layers = {layer.id: layer for layer in start.layers}
    ops += [c.DeleteLayer(layer=key) for key in copy.layers if key not in layers]
    for key, layer in layers.items():
        held = copy.layers.get(key)
        if held is None and (held := copy.deleted_layers.get(key)) is not None:
            ops.append(c.RestoreLayer(layer=key))
        if held is None:
            ops.append(c.AddLayer(layer=layer))
        elif held != layer:
            ops.append(_set_layer(held, layer))
    fields = {
        name: getattr(start.settings, name)
        for name in _SETTINGS
        if getattr(copy.settings, name) != getattr(start.settings, name)
    }
    return [*ops, c.SetTerrain(fields=c.TerrainFields(**fields))] if fields else ops


class Together:
    """Copies as they become one terrain, one after another: no more of them is held than what comes into it.

    A stroke that several have alike is there once. Where they differ under one id, the first keeps the id and the
    others get new ones.
    """

    def __init__(self, start: c.Document) -> None:
        """``start``: whose layers and settings it has."""
        self._start, self._strokes = start, dict[str, c.Stroke]()

    def add(self, copy: Iterable[c.Stroke]) -> None:
        """The strokes of one more copy. Raises Refusal as soon as they are too many for a terrain."""
        for stroke in copy:
            _put(self._strokes, stroke)
            if len(self._strokes) > c.MAX_STROKES:
                raise Refusal("too_many_strokes", f"A terrain holds at most {c.MAX_STROKES} strokes.")

    def document(self, title: str) -> c.Document:
        """All of them as one document. Raises Refusal where they are too much for a terrain."""
        settings = self._start.settings.model_copy(update={"title": title})
        made = self._start.model_copy(update={"settings": settings, "strokes": tuple(self._strokes.values())})
        check_document(made)
        return made


def together(start: c.Document, copies: Iterable[Iterable[c.Stroke]], title: str) -> c.Document:
    """One document with the strokes of several copies. Raises Refusal where they are too many for a terrain."""
    made = Together(start)
    for copy in copies:
        made.add(copy)
    return made.document(title)


def _put(strokes: dict[str, c.Stroke], stroke: c.Stroke) -> None:
    key, n = stroke.id, 1
    while key in strokes:
        if strokes[key].model_copy(update={"id": stroke.id}) == stroke:
            return
        n += 1
        key = f"{stroke.id[:35]}-{n}"
    strokes[key] = stroke.model_copy(update={"id": key})


def groups(ops: Sequence[c.SimpleOp]) -> Iterator[c.Op]:
    """Yields the ops in groups that are neither too many nor too long, in order."""
    held: list[c.SimpleOp] = []
    points = 0
    for op in ops:
        more = _points(op)
        if held and (len(held) == c.MAX_OPS_PER_GROUP or points + more > GROUP_POINTS):
            yield c.Group(ops=tuple(held))
            held, points = [], 0
        held.append(op)
        points += more
    if held:
        yield c.Group(ops=tuple(held))


def _points(op: c.SimpleOp) -> int:
    if isinstance(op, c.BeginStroke):
        return len(op.stroke.curve)
    return len(op.fields.curve or ()) if isinstance(op, c.SetStroke) else 0


def _by_id(strokes: Iterable[c.Stroke]) -> Mapping[str, c.Stroke]:
    return {stroke.id: stroke for stroke in strokes}


def _gone(stroke: c.Stroke) -> list[c.SimpleOp]:
    return [*_unlocked(stroke), c.DeleteStroke(stroke=stroke.id)]


def _unlocked(stroke: c.Stroke) -> list[c.SimpleOp]:
    return [c.SetStroke(stroke=stroke.id, fields=c.StrokeFields(locked=False))] if stroke.locked else []


def _changed(old: c.Stroke, new: c.Stroke) -> list[c.SimpleOp]:
    """Ops that make one stroke of another of the same id; none where they are the same."""
    fields = {name: getattr(new, name) for name in _STROKE if getattr(new, name) != getattr(old, name)}
    ops: list[c.SimpleOp] = []
    if fields:
        if old.locked and fields.keys() != {"locked"}:
            ops += _unlocked(old)
            fields["locked"] = new.locked
        ops.append(c.SetStroke(stroke=new.id, fields=c.StrokeFields(**fields)))
    if new.finished and not old.finished:
        ops.append(c.FinishStroke(stroke=new.id))
    return ops


def _set_layer(old: c.Layer, new: c.Layer) -> c.SetLayer:
    fields = {name: getattr(new, name) for name in _LAYER if getattr(new, name) != getattr(old, name)}
    return c.SetLayer(layer=new.id, fields=c.LayerFields(**fields))
