"""Taking back all that one person did and that still stands: what pressing undo to the end would do. Pure.

The journal is replayed once. Of every stroke, layer and setting that the person changed, the stretches are kept in
which nobody else changed it. They are undone from the last to the first against the present document, by the rules of
``undo.py``: what others changed since is kept. What is left to do is one difference between two documents.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Final

from esker import contract as c
from esker.contract import Op
from esker.document.changes import TERRAIN_WORDS, WORDS, Change, Changes, ItemChange, Kind, changes, state_of
from esker.document.history.folding import UNLIMITED
from esker.document.ops import Refusal, StrokeSet
from esker.document.revert import LayerReverter, StrokeReverter, grouped
from esker.document.undo import UndoPlan, plan

Key = tuple[Kind, str]
REVERTERS: Final[dict[Kind, type[StrokeReverter] | type[LayerReverter]]] = {
    "stroke": StrokeReverter,
    "layer": LayerReverter,
}


class Deeds:
    """What some clients, one person's, did to a document."""

    def __init__(self, clients: Collection[str]) -> None:
        self.clients = frozenset(clients)
        self._items: dict[Key, list[ItemChange]] = {}
        self._settings: dict[str, list[Change]] = {}
        self._closed: set[Key] = set()
        """What somebody else changed since the person last did."""
        self._closed_settings: set[str] = set()

    def note(self, author: str, op: Op, before: StrokeSet, after: StrokeSet) -> None:
        """An op that took ``before`` to ``after``, of the person or of anybody else."""
        if author in self.clients:
            self._mine(changes(op, before, after))
            return
        for part in op.ops if isinstance(op, c.Group) else (op,):
            if isinstance(part, c.SetTerrain):
                self._closed_settings |= part.fields.model_fields_set
            else:
                self._closed.add(_key(part))

    def _mine(self, done: Changes) -> None:
        both: tuple[tuple[Kind, dict[str, ItemChange]], ...] = (("stroke", done.strokes), ("layer", done.layers))
        for kind, found in both:
            for item, change in found.items():
                key: Key = (kind, item)
                stretches = self._items.setdefault(key, [])
                if stretches and key not in self._closed:
                    stretches[-1] = stretches[-1].then(change)
                else:
                    stretches.append(change)
                self._closed.discard(key)
        for name, (old, new) in done.terrain.items():
            pairs = self._settings.setdefault(name, [])
            if pairs and name not in self._closed_settings:
                pairs[-1] = (pairs[-1][0], new)
            else:
                pairs.append((old, new))
            self._closed_settings.discard(name)

    def plan(self, present: StrokeSet) -> UndoPlan:
        """The ops that take everything back that still stands, and a sentence for each thing that was left alone."""
        skipped: list[str] = []
        target = present
        for (kind, item), stretches in self._items.items():
            for stretch in reversed(stretches):
                if not stretch.empty:
                    target = _reverted(kind, item, stretch, target, skipped)
        fields: dict[str, Change] = {}
        for name, pairs in self._settings.items():
            now = getattr(present.settings, name)
            value = now
            for old, new in reversed(pairs):
                if value != new:
                    skipped.append(f"Somebody else has changed the {TERRAIN_WORDS[name]} of the terrain since.")
                    break
                value = old
            if value != now:
                fields[name] = (value, now)
        strokes = {item: _difference("stroke", item, target, present) for kind, item in self._items if kind == "stroke"}
        layers = {item: _difference("layer", item, target, present) for kind, item in self._items if kind == "layer"}
        return UndoPlan(plan(Changes(strokes, fields, layers), present).ops, tuple(skipped))


def _reverted(kind: Kind, item: str, change: ItemChange, present: StrokeSet, skipped: list[str]) -> StrokeSet:
    ops: list[c.SimpleOp] = []
    REVERTERS[kind](item, change, present, ops, skipped).run()
    after = present
    try:
        for op in grouped(ops):
            after, _ = after.apply(op, UNLIMITED)
    except Refusal as refusal:
        skipped.append(refusal.message)
        return present
    return after


def _difference(kind: Kind, item: str, before: StrokeSet, after: StrokeSet) -> ItemChange:
    """What takes a stroke or a layer of one document to that of another."""
    (old_state, old), (new_state, new) = state_of(kind, before, item), state_of(kind, after, item)
    fields: dict[str, Change] = {}
    if old is not None and new is not None:
        pairs = {name: (getattr(old, name), getattr(new, name)) for name in WORDS[kind]}
        fields = {name: pair for name, pair in pairs.items() if pair[0] != pair[1]}
    return ItemChange(old_state, new_state, fields, new if old_state != new_state else None)


def _key(part: c.SimpleOp) -> Key:
    match part:
        case c.BeginStroke():
            return "stroke", part.stroke.id
        case c.AddLayer():
            return "layer", part.layer.id
        case c.SetLayer() | c.DeleteLayer() | c.RestoreLayer():
            return "layer", part.layer
        case c.SetTerrain():
            raise AssertionError("the settings are no thing")
        case _:
            return "stroke", part.stroke


def outcome(result: UndoPlan) -> c.NoticeCode:
    """What is told to whoever asked for it."""
    if not result.ops:
        return "nothing_taken_back" if result.skipped else "nothing_stands"
    return "taken_back_but" if result.skipped else "taken_back"
