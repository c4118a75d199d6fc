"""Applying operations to a document (DESIGN 4). Pure: a document and an op give a new document or a Refusal.

``apply`` is the only way a document changes, on the server, in the Python client and (as ``doc/apply.ts``) in the
page; ``tests/vectors/ops.json`` holds the cases that both languages read.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from esker import contract as c
from esker.contract import Layer, Op, Stroke, TerrainSettings
from esker.document.layers import LayerEditor
from esker.document.refusal import Limits, Refusal, changed, trim, trim_points
from esker.document.revisions import revision
from esker.document.strokes import CurveBox, bounds, curve_box, misfit, reach, world_points
from esker.grid import Rect

__all__ = [
    "CHANNEL_FIELDS", "GROUND_FIELDS", "Limits", "Refusal", "StrokeSet", "changed", "check_document", "check_put",
    "check_stroke",
]  # fmt: skip

GROUND_FIELDS: Final = frozenset(c.StrokeFields.model_fields) - {"label", "locked"}
"""Fields of a stroke that the ground depends on; changing another one leaves the ground alone."""
CHANNEL_FIELDS: Final = frozenset({"amplitude_m", "roughness", "paint"})
"""Those of them that no height depends on, only the other channels."""


class _Bounds(NamedTuple):
    """Bounds that were found of a stroke, and the very stroke of which they are true."""

    stroke: Stroke
    box: CurveBox | None
    rect: Rect | None


@dataclass(frozen=True)
class StrokeSet:
    """The document as the room holds it: strokes, layers and tombstones by id, settings, clock. Treat as immutable."""

    id: str
    settings: TerrainSettings = field(default_factory=TerrainSettings)
    strokes: dict[str, Stroke] = field(default_factory=dict)
    deleted: dict[str, Stroke] = field(default_factory=dict)
    clock: int = 0
    layers: dict[str, Layer] = field(default_factory=dict)
    deleted_layers: dict[str, Layer] = field(default_factory=dict)
    heights_rev: int = field(default_factory=revision, compare=False, repr=False)
    """Revision of what the heights follow from. A successor has the same exactly when nothing of that changed."""
    channels_rev: int = field(default_factory=revision, compare=False, repr=False)
    """Revision of what the other channels follow from: amplitude, roughness, paint, and where strokes lie."""
    paint_rev: int = field(default_factory=revision, compare=False, repr=False)
    """Revision of paint alone."""
    layers_rev: int = field(default_factory=revision, compare=False, repr=False)
    """Revision of what the base under the strokes follows from: the visible layers, without their names and credits."""
    _rects: dict[str, _Bounds] = field(default_factory=dict, compare=False, repr=False)
    """Bounds of strokes as last seen: a cache that successors share."""
    _points: int = field(default=-1, compare=False, repr=False)
    """Points of all live strokes; below zero: not counted yet."""

    @classmethod
    def from_document(cls, document: c.Document) -> StrokeSet:
        """The set that a snapshot describes."""
        return cls(
            document.id,
            document.settings,
            {s.id: s for s in document.strokes},
            {s.id: s for s in document.deleted},
            document.clock,
            {layer.id: layer for layer in document.layers},
            {layer.id: layer for layer in document.deleted_layers},
        )

    def to_document(self) -> c.Document:
        """A snapshot as sent and stored."""
        return c.Document(
            id=self.id,
            clock=self.clock,
            settings=self.settings,
            strokes=tuple(self.strokes.values()),
            deleted=tuple(self.deleted.values()),
            layers=tuple(self.layers.values()),
            deleted_layers=tuple(self.deleted_layers.values()),
        )

    def apply(self, op: Op, limits: Limits | None = None) -> tuple[StrokeSet, Rect | None]:
        """The set after ``op`` (clock + 1) and the ground where the constraints of heights changed (None: nowhere).

        Raises Refusal, leaving this set as it was.
        """
        editor = _Editor(self, limits or Limits())
        editor.run(op)
        heights_rev = self.heights_rev if editor.dirty is None else revision()
        channels_rev = revision() if editor.said or editor.dirty is not None else self.channels_rev
        paint_rev = revision() if editor.painted else self.paint_rev
        layers_rev = revision() if editor.layers.grounded else self.layers_rev
        after = StrokeSet(
            self.id,
            editor.settings,
            editor.strokes,
            editor.deleted,
            self.clock + 1,
            editor.layers.layers,
            editor.layers.deleted,
            heights_rev,
            channels_rev,
            paint_rev,
            layers_rev,
            self._rects,
            editor.points,
        )
        return after, editor.dirty


def check_document(document: c.Document, limits: Limits | None = None) -> None:
    """Refuses a document from outside that no sequence of ops could have made: ids used twice, limits, far points,
    strokes that lack what their kind needs, layers that are too high.

    Raises Refusal.
    """
    limits = limits or Limits()
    everything = (*document.strokes, *document.deleted)
    if len({stroke.id for stroke in everything}) != len(everything):
        raise Refusal("duplicate_stroke", "Two strokes have the same id.")
    if len(document.strokes) > limits.strokes or len(document.deleted) > c.MAX_STROKES:
        raise _too_many_strokes(limits.strokes)
    for strokes, most in ((document.strokes, limits.all_points), (document.deleted, c.MAX_POINTS_PER_TERRAIN)):
        if _points_of(strokes) > most:
            raise _too_many_points(most)
    editor = _Editor(StrokeSet(document.id, document.settings), limits)
    for stroke in everything:
        editor.check(stroke)
    layers = (*document.layers, *document.deleted_layers)
    if len({layer.id for layer in layers}) != len(layers):
        raise Refusal("duplicate_layer", "Two elevation layers have the same id.")
    if len(document.layers) > limits.layers or len(document.deleted_layers) > c.MAX_LAYERS:
        raise Refusal("too_many_layers", f"A terrain holds at most {limits.layers} elevation layers.")
    for layer in layers:
        editor.layers.check(layer)


def check_stroke(
    stroke: Stroke, size_m: float, limits: Limits | None = None, box: CurveBox | None = None
) -> CurveBox | None:
    """The box of the curve of a stroke, which may be known already, once the stroke is good for a terrain of this size.

    Raises Refusal for too many or too far points, and for fields that are not of its kind.
    """
    limits = limits or Limits()
    if len(stroke.curve) > limits.points:
        raise Refusal("too_many_points", f"A stroke holds at most {limits.points} points.")
    bound = c.DOMAIN_MARGIN * size_m
    anchors = (*stroke.first, *stroke.last)
    if max(anchors) > bound or min(anchors) < -bound:
        raise Refusal("out_of_domain", "An anchor lies farther than ten times the terrain from its corner.")
    wrong = misfit(stroke)
    if wrong is not None:
        raise Refusal("bad_field", wrong)
    box = box or curve_box(stroke.curve)
    # Points are made where the box says that one may lie too far.
    if box is not None and reach(stroke, box) > bound and abs(world_points(stroke)).max() > bound:
        raise Refusal("out_of_domain", "A point lies farther than ten times the terrain from its corner.")
    return box


def check_put(stroke: Stroke, strokes: Mapping[str, Stroke], size_m: float, limits: Limits | None = None) -> None:
    """Refuses a stroke that a terrain with these strokes cannot take, new or in place of the one of its id.

    Raises Refusal.
    """
    limits = limits or Limits()
    check_stroke(stroke, size_m, limits)
    if stroke.id not in strokes and len(strokes) >= limits.strokes:
        raise _too_many_strokes(limits.strokes)
    others = _points_of(other for key, other in strokes.items() if key != stroke.id)
    if others + len(stroke.curve) > limits.all_points:
        raise _too_many_points(limits.all_points)


def _too_many_strokes(most: int) -> Refusal:
    return Refusal("too_many_strokes", f"A terrain holds at most {most} strokes.")


def _points_of(strokes: Iterable[Stroke]) -> int:
    return sum(len(stroke.curve) for stroke in strokes)


def _too_many_points(most: int) -> Refusal:
    return Refusal("too_many_points", f"The strokes of a terrain hold at most {most} points together.")


class _Editor:
    """One application in progress. Copies the dictionaries on first write only."""

    def __init__(self, base: StrokeSet, limits: Limits) -> None:
        self.strokes, self.deleted, self.settings = base.strokes, base.deleted, base.settings
        self.limits = limits
        self.layers = LayerEditor(base.layers, base.deleted_layers, base.settings.size_m, limits)
        self._rects = base._rects
        self.points = base._points if base._points >= 0 else _points_of(base.strokes.values())
        self.dirty: Rect | None = None
        self.said = False
        """Whether a channel other than the heights may have changed."""
        self.painted = False
        """Whether it may have by paint."""
        self._copied = False

    def run(self, op: Op) -> None:
        if isinstance(op, c.Group):
            for part in op.ops:
                self._one(part)
        else:
            self._one(op)

    def _one(self, op: c.SimpleOp) -> None:
        match op:
            case c.BeginStroke():
                self._begin(op.stroke)
            case c.AppendPoints():
                self._append(op)
            case c.FinishStroke():
                self._relabel(self._live(op.stroke).model_copy(update={"finished": True}))
            case c.SetStroke():
                self._set(op)
            case c.MoveAnchor():
                old = self._editable(op.stroke)
                self._put(old.model_copy(update={op.which: op.to}))
            case c.DeleteStroke():
                self._delete(op.stroke)
            case c.RestoreStroke():
                self._restore(op.stroke)
            case c.SetTerrain():
                self._set_terrain(op)
            case c.AddLayer() | c.SetLayer() | c.DeleteLayer() | c.RestoreLayer():
                self.layers.run(op)

    def _own(self) -> None:
        if not self._copied:
            self.strokes, self.deleted, self._copied = dict(self.strokes), dict(self.deleted), True

    def _live(self, stroke_id: str) -> Stroke:
        stroke = self.strokes.get(stroke_id)
        if stroke is None:
            if stroke_id in self.deleted:
                raise Refusal("deleted_stroke", "This stroke was deleted. Restore it before you change it.")
            raise Refusal("unknown_stroke", "There is no such stroke in this terrain.")
        return stroke

    def _editable(self, stroke_id: str) -> Stroke:
        stroke = self._live(stroke_id)
        if stroke.locked:
            raise Refusal("locked_stroke", "This stroke is locked. Unlock it to change it.")
        return stroke

    def _relabel(self, stroke: Stroke) -> None:
        """Replaces a stroke by one that is the same to the ground."""
        self._own()
        known = self._rects.get(stroke.id)
        if known is not None and known.stroke is self.strokes[stroke.id]:
            self._rects[stroke.id] = known._replace(stroke=stroke)
        self.strokes[stroke.id] = stroke

    def _put(self, stroke: Stroke, moved: bool = True, box: CurveBox | None = None) -> None:
        """``moved`` False: no height follows from what changed; ``box``: of its curve, where that is known."""
        box = self.check(stroke, box)
        self._own()
        old = self.strokes.get(stroke.id)
        more = len(stroke.curve) - (0 if old is None else len(old.curve))
        if more > 0 and self.points + more > self.limits.all_points:
            raise _too_many_points(self.limits.all_points)
        self.points += more
        before = None if old is None else self._bounds(old)
        rect = bounds(stroke, box)
        self._rects[stroke.id] = _Bounds(stroke, box, rect)
        for touched in (before, rect):
            self._touch(stroke, touched, moved)
        self.strokes[stroke.id] = stroke

    def _bounds(self, stroke: Stroke) -> Rect | None:
        known = self._rects.get(stroke.id)
        if known is None or known.stroke is not stroke:
            box = curve_box(stroke.curve)
            known = self._rects[stroke.id] = _Bounds(stroke, box, bounds(stroke, box))
        return known.rect

    def _touch(self, stroke: Stroke, rect: Rect | None, moved: bool = True) -> None:
        if rect is None:
            return
        self.said = True
        if stroke.kind == "paint":
            self.painted = True
        elif moved:
            self.dirty = rect.union(self.dirty)

    def check(self, stroke: Stroke, box: CurveBox | None = None) -> CurveBox | None:
        """See ``check_stroke``."""
        return check_stroke(stroke, self.settings.size_m, self.limits, box)

    def _begin(self, stroke: Stroke) -> None:
        if stroke.id in self.strokes or stroke.id in self.deleted:
            raise Refusal("duplicate_stroke", "A stroke with this id exists already.")
        if len(self.strokes) >= self.limits.strokes:
            raise _too_many_strokes(self.limits.strokes)
        self._put(stroke)

    def _append(self, op: c.AppendPoints) -> None:
        old = self._editable(op.stroke)
        if op.start > len(old.curve):
            raise Refusal("bad_index", "The points do not continue the stroke that the server holds.")
        known = self._rects.get(op.stroke)
        goes_on = op.start == len(old.curve) and known is not None and known.stroke is old
        box = curve_box(op.points, known.box) if goes_on and known is not None else None
        self._put(old.model_copy(update={"curve": old.curve[: op.start] + op.points, "last": op.last}), box=box)

    def _set(self, op: c.SetStroke) -> None:
        old = self._live(op.stroke)
        update = changed(op.fields, c.NULLABLE_STROKE_FIELDS)
        if old.locked and set(update) - {"locked"}:
            raise Refusal("locked_stroke", "This stroke is locked. Unlock it to change it.")
        changed_stroke = old.model_copy(update=update)
        if GROUND_FIELDS.isdisjoint(update):
            self._relabel(changed_stroke)
        else:
            self._put(changed_stroke, moved=not CHANNEL_FIELDS.issuperset(update))

    def _delete(self, stroke_id: str) -> None:
        old = self._editable(stroke_id)
        self._own()
        self._touch(old, self._bounds(old))
        self._rects.pop(stroke_id, None)
        del self.strokes[stroke_id]
        self.deleted[stroke_id] = old
        self.points -= len(old.curve)
        trim(self.deleted, c.MAX_STROKES)
        trim_points(self.deleted, c.MAX_POINTS_PER_TERRAIN)

    def _restore(self, stroke_id: str) -> None:
        if stroke_id in self.strokes:
            raise Refusal("duplicate_stroke", "This stroke is not deleted.")
        stroke = self.deleted.get(stroke_id)
        if stroke is None:
            raise Refusal("unknown_stroke", "There is no such deleted stroke to restore.")
        if len(self.strokes) >= self.limits.strokes:
            raise _too_many_strokes(self.limits.strokes)
        self._own()
        del self.deleted[stroke_id]
        self._put(stroke)

    def _set_terrain(self, op: c.SetTerrain) -> None:
        update = changed(op.fields, c.NULLABLE_TERRAIN_FIELDS)
        self.settings = self.settings.model_copy(update=update)
        if update.keys() & {"reach_m", "border"}:
            size = self.settings.size_m
            self.dirty = Rect(0, 0, size, size).union(self.dirty)
            self.painted = True
        if "erosion" in update:  # distances from strokes are there for gullies alone
            self.said = self.painted = True
