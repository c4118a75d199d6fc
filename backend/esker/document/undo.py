"""Undo by person (DESIGN 4, "Undo"): the inverse of *my* step, evaluated against the present document. Pure.

While a person works, each op is recorded as the fields it changed, with the value before and after. Undoing compares
every such field with the present document: where it still holds what I left, it gets its old value back; where
somebody else has changed it since, it is kept and reported. A stroke that I drew is deleted only while it is still
what I left. So undoing never touches the work of others, whatever they did in between.

``frontend/src/doc/undo.ts`` is the twin; ``tests/vectors/undo.json`` holds the cases that both read.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Final

from esker import contract as c
from esker.contract import Op
from esker.document.changes import LAYER_WORDS, STROKE_WORDS, TERRAIN_WORDS, Changes, changes
from esker.document.ops import Refusal, StrokeSet
from esker.document.revert import LayerReverter, StrokeReverter, grouped

__all__ = ["LAYER_WORDS", "STROKE_WORDS", "TERRAIN_WORDS", "UndoPlan", "UndoStack", "changes", "inverse", "plan"]

DEFAULT_DEPTH: Final = 500


@dataclass(frozen=True)
class UndoPlan:
    """Ops to submit, in order, and a sentence for each thing that was left alone. Without ops nothing was undone."""

    ops: tuple[Op, ...]
    skipped: tuple[str, ...]


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
        StrokeReverter(stroke_id, change, present, ops, skipped).run()
    for layer_id, change in reversed(done.layers.items()):
        LayerReverter(layer_id, change, present, ops, skipped).run()
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
    return UndoPlan(tuple(grouped(ops)), tuple(skipped))


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
