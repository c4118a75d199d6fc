"""Undo by person (DESIGN 4, "Undo"): the inverse of *my* step, evaluated against the present document. Pure.

While a person works, each op is recorded as the fields it changed, with the value before and after. Undoing compares
every such field with the present document: where it still holds what I left, it gets its old value back; where
somebody else has changed it since, it is kept and reported. A stroke that I drew is deleted only while it is still
what I left. So undoing never touches the work of others, whatever they did in between.

``frontend/src/doc/undo.ts`` is the twin; ``tests/vectors/undo.json`` holds the cases that both read.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from typing import Final, Literal

from esker import contract as c
from esker.contract import Op, Stroke
from esker.document.ops import Refusal, StrokeSet

State = Literal["absent", "live", "deleted"]
Change = tuple[object, object]

STROKE_WORDS: Final[dict[str, str]] = {
    "first": "start",
    "last": "end",
    "curve": "line",
    "left": "left flank",
    "right": "right flank",
    "plateau_radius_m": "plateau radius",
    "amplitude_m": "noise amplitude",
    "roughness": "roughness",
    "paint": "paint",
    "locked": "lock",
    "hidden": "visibility",
    "label": "label",
}
"""The undoable fields of a stroke in the order in which they are restored, with the word a person reads."""
TERRAIN_WORDS: Final[dict[str, str]] = {
    "title": "title",
    "reach_m": "reach",
    "border": "border",
    "sea_level_m": "sea level",
    "seed": "seed",
    "look": "look",
    "detail": "detail",
    "rule": "rule",
    "sun_azimuth_deg": "direction of the sun",
    "sun_elevation_deg": "height of the sun",
}

DELETED: Final = "Somebody else has deleted this stroke since; your change of it was not undone."
DELETED_ALREADY: Final = "This stroke is deleted already."
RESTORED_ALREADY: Final = "This stroke is back already."
NOT_RESTORABLE: Final = "This stroke can no longer be restored."
CHANGED: Final = "Somebody else has changed this stroke since; it was kept."
LOCKED: Final = "Somebody else has locked this stroke since; it was kept."

LARGE_CURVE_POINTS: Final = 1_024
"""A longer curve is restored by appends, since one message of 64 KiB does not hold it."""
DEFAULT_DEPTH: Final = 500


@dataclass(frozen=True)
class UndoPlan:
    """What to submit, in order, and what was left alone: a sentence each. Nothing to submit: nothing was undone."""

    ops: tuple[Op, ...]
    skipped: tuple[str, ...]


@dataclass(frozen=True)
class StrokeChange:
    """What one step of mine did to a stroke. ``content`` is the stroke as I left it when it came to life or died."""

    before: State
    after: State
    fields: dict[str, Change]
    content: Stroke | None = None

    def then(self, later: StrokeChange) -> StrokeChange:
        """This change followed by a later one of the same step."""
        fields = dict(self.fields)
        for name, (old, new) in later.fields.items():
            fields[name] = (fields[name][0] if name in fields else old, new)
        content = later.content
        if content is None and self.content is not None:
            content = self.content.model_copy(update={name: new for name, (_, new) in later.fields.items()})
        return StrokeChange(self.before, later.after, fields, content)


@dataclass(frozen=True)
class Changes:
    """The effect of one op, or of several merged: by stroke id and by terrain field."""

    strokes: dict[str, StrokeChange]
    terrain: dict[str, Change]

    @property
    def empty(self) -> bool:
        """True when there is nothing that undo could put back."""
        alive = (s for s in self.strokes.values() if s.fields or s.before != s.after)
        return not self.terrain and not any(True for _ in alive)

    def then(self, later: Changes) -> Changes:
        """These changes followed by later ones."""
        strokes, terrain = dict(self.strokes), dict(self.terrain)
        for stroke_id, change in later.strokes.items():
            strokes[stroke_id] = strokes[stroke_id].then(change) if stroke_id in strokes else change
        for name, (old, new) in later.terrain.items():
            terrain[name] = (terrain[name][0] if name in terrain else old, new)
        return Changes(strokes, terrain)


def changes(op: Op, before: StrokeSet, after: StrokeSet) -> Changes:
    """What ``op`` changed between the two documents, field by field."""
    strokes: dict[str, StrokeChange] = {}
    terrain: dict[str, Change] = {}
    for part in op.ops if isinstance(op, c.Group) else (op,):
        if isinstance(part, c.SetTerrain):
            for name in TERRAIN_WORDS:
                old, new = getattr(before.settings, name), getattr(after.settings, name)
                if name in part.fields.model_fields_set and old != new:
                    terrain[name] = (old, new)
            continue
        stroke_id = part.stroke.id if isinstance(part, c.BeginStroke) else part.stroke
        strokes[stroke_id] = _stroke_change(stroke_id, before, after)
    return Changes(strokes, terrain)


def inverse(op: Op, before: StrokeSet) -> tuple[Op, ...]:
    """The ops that take back ``op`` right after it was applied to ``before``; empty when it changed nothing.

    Raises Refusal when ``op`` does not apply to ``before``.
    """
    after, _ = before.apply(op)
    return plan(changes(op, before, after), after).ops


def plan(done: Changes, present: StrokeSet) -> UndoPlan:
    """The ops that take ``done`` back in the present document, leaving everything that others changed since."""
    ops: list[c.SimpleOp] = []
    skipped: list[str] = []
    for stroke_id, change in reversed(done.strokes.items()):
        _Reverter(stroke_id, change, present, ops, skipped).run()
    fields: dict[str, object] = {}
    for name, word in TERRAIN_WORDS.items():
        if name in done.terrain:
            old, new = done.terrain[name]
            if getattr(present.settings, name) == new:
                fields[name] = old
            else:
                skipped.append(f"Somebody else has changed the {word} of the terrain since; that was kept.")
    if fields:
        ops.append(c.SetTerrain(fields=c.TerrainFields.model_validate(fields)))
    return UndoPlan(tuple(_grouped(ops)), tuple(skipped))


def _state(document: StrokeSet, stroke_id: str) -> tuple[State, Stroke | None]:
    if stroke_id in document.strokes:
        return "live", document.strokes[stroke_id]
    if stroke_id in document.deleted:
        return "deleted", document.deleted[stroke_id]
    return "absent", None


def _stroke_change(stroke_id: str, before: StrokeSet, after: StrokeSet) -> StrokeChange:
    old_state, old = _state(before, stroke_id)
    new_state, new = _state(after, stroke_id)
    fields: dict[str, Change] = {}
    if old is not None and new is not None:
        for name in STROKE_WORDS:
            pair = (getattr(old, name), getattr(new, name))
            if pair[0] != pair[1]:
                fields[name] = pair
    return StrokeChange(old_state, new_state, fields, new if old_state != new_state else None)


class _Reverter:
    """Takes one stroke's change back: appends to ``ops`` and ``skipped``."""

    def __init__(
        self, stroke_id: str, change: StrokeChange, present: StrokeSet, ops: list[c.SimpleOp], skipped: list[str]
    ) -> None:
        self.id, self.change, self.ops, self.skipped = stroke_id, change, ops, skipped
        self.state, self.stroke = _state(present, stroke_id)

    def run(self) -> None:
        match self.change.before, self.change.after:
            case ("absent", "live") | ("deleted", "live"):
                self._take_away()
            case "live", "deleted":
                self._bring_back()
            case "live", "live":
                if self.stroke is None or self.state != "live":
                    self.skipped.append(DELETED)
                else:
                    self._fields(self.stroke)
            case _:
                pass  # drawn and cancelled within one step: nothing is left of it

    def _take_away(self) -> None:
        if self.stroke is None or self.state != "live":
            self.skipped.append(DELETED_ALREADY)
            return
        if any(getattr(self.stroke, name) != getattr(self.change.content, name) for name in STROKE_WORDS):
            self.skipped.append(CHANGED)
            return
        locked = self.stroke.locked
        if self.change.before == "deleted" and self.change.fields:
            locked = bool(self._fields(self.stroke))
        if locked:
            self.ops.append(c.SetStroke(stroke=self.id, fields=c.StrokeFields(locked=False)))
        self.ops.append(c.DeleteStroke(stroke=self.id))

    def _bring_back(self) -> None:
        if self.stroke is None:
            self.skipped.append(NOT_RESTORABLE)
            return
        if self.state == "live":
            self.skipped.append(RESTORED_ALREADY)
            return
        self.ops.append(c.RestoreStroke(stroke=self.id))
        self._fields(self.stroke)

    def _fields(self, stroke: Stroke) -> bool:
        """Puts the fields back that are still as I left them; returns whether the stroke is locked afterwards."""
        update: dict[str, object] = {}
        for name, word in STROKE_WORDS.items():
            if name not in self.change.fields:
                continue
            old, new = self.change.fields[name]
            if getattr(stroke, name) == new:
                update[name] = old
            else:
                self.skipped.append(f"Somebody else has changed the {word} of this stroke since; that was kept.")
        if stroke.locked and update:
            if "locked" not in update:
                self.skipped.append(LOCKED)
                return True
            self._set({"locked": update.pop("locked")})
        relock = update.pop("locked", None)
        curve = update.get("curve")
        if isinstance(curve, tuple) and len(curve) > LARGE_CURVE_POINTS:
            del update["curve"]
            self._append(curve, update.pop("last", stroke.last))
        if update:
            self._set(update)
        if relock is not None:
            self._set({"locked": relock})
        return bool(relock)

    def _set(self, update: dict[str, object]) -> None:
        self.ops.append(c.SetStroke(stroke=self.id, fields=c.StrokeFields.model_validate(update)))

    def _append(self, curve: tuple[c.CurvePoint, ...], last: object) -> None:
        step = c.MAX_POINTS_PER_APPEND
        for start in range(0, len(curve), step):
            points = curve[start : start + step]
            op = {"stroke": self.id, "start": start, "points": points, "last": last}
            self.ops.append(c.AppendPoints.model_validate(op))


def _points(op: c.SimpleOp) -> int:
    if isinstance(op, c.AppendPoints):
        return len(op.points)
    return len(op.fields.curve or ()) if isinstance(op, c.SetStroke) else 0


def _grouped(ops: Iterable[c.SimpleOp]) -> Iterator[Op]:
    """One op if it fits in one message, a group if there are several, more groups only beyond the limits."""
    batch: list[c.SimpleOp] = []
    points = 0
    for op in ops:
        if batch and (len(batch) == c.MAX_OPS_PER_GROUP or points + _points(op) > LARGE_CURVE_POINTS):
            yield batch[0] if len(batch) == 1 else c.Group(ops=tuple(batch))
            batch, points = [], 0
        batch.append(op)
        points += _points(op)
    if batch:
        yield batch[0] if len(batch) == 1 else c.Group(ops=tuple(batch))


@dataclass(frozen=True)
class _Step:
    gesture: str | None
    parts: tuple[tuple[str | None, Changes], ...]

    def merged(self) -> Changes:
        total = Changes({}, {})
        for _, part in self.parts:
            total = total.then(part)
        return total


@dataclass
class UndoStack:
    """The steps of one person on one terrain. Consecutive ops with the same ``gesture`` token are one step."""

    depth: int = DEFAULT_DEPTH
    _done: list[_Step] = field(default_factory=list)
    _undone: list[_Step] = field(default_factory=list)

    @property
    def can_undo(self) -> bool:
        """True when there is a step to take back."""
        return bool(self._done)

    @property
    def can_redo(self) -> bool:
        """True when the last thing done was an undo."""
        return bool(self._undone)

    def record(
        self, before: StrokeSet, op: Op, after: StrokeSet, gesture: str | None = None, op_id: str | None = None
    ) -> None:
        """Remembers an op of mine that took ``before`` to ``after``. Clears what could be redone."""
        self._undone.clear()
        part = (op_id, changes(op, before, after))
        last = self._done[-1] if self._done else None
        if last is not None and gesture is not None and last.gesture == gesture:
            self._done[-1] = replace(last, parts=(*last.parts, part))
        else:
            self._push(_Step(gesture, (part,)))

    def forget(self, op_id: str) -> None:
        """Drops an op that the server refused, so that it is neither undone nor redone."""
        for stack in (self._done, self._undone):
            kept = [replace(s, parts=tuple(p for p in s.parts if p[0] != op_id)) for s in stack]
            stack[:] = [s for s in kept if s.parts]

    def undo(self, present: StrokeSet) -> UndoPlan:
        """Takes back my last step. The returned ops must be submitted in order; they are not recorded again."""
        return self._move(self._done, self._undone, present)

    def redo(self, present: StrokeSet) -> UndoPlan:
        """Takes back my last undo, by the same rules."""
        return self._move(self._undone, self._done, present)

    def _push(self, step: _Step) -> None:
        self._done.append(step)
        del self._done[: -self.depth]

    def _move(self, source: list[_Step], target: list[_Step], present: StrokeSet) -> UndoPlan:
        while source:
            step = source.pop()
            merged = step.merged()
            if merged.empty:
                continue
            result = plan(merged, present)
            parts: list[tuple[str | None, Changes]] = []
            try:
                for op in result.ops:
                    after, _ = present.apply(op)
                    parts.append((None, changes(op, present, after)))
                    present = after
            except Refusal as refusal:
                return UndoPlan((), (*result.skipped, refusal.message))
            if parts:
                target.append(_Step(None, tuple(parts)))
            return result
        return UndoPlan((), ())
