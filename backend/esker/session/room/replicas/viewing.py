"""A terrain as a link to look shows it: all that is there, without what was deleted and who drew it (decision 39).

A viewer's document has no tombstones but of what was deleted while the viewer was here. So a stroke that is brought
back comes as a stroke that begins, to every viewer who was not here when it was deleted.
"""

from __future__ import annotations

import json
import re
from collections import OrderedDict
from collections.abc import Collection, Iterable
from dataclasses import dataclass, field
from typing import Final

from esker import contract as c
from esker.document.ops import StrokeSet
from esker.document.wire import op_json

Key = tuple[str, str]
"""A thing of the document: "stroke" or "layer", and its id."""
_AUTHOR: Final = re.compile(r'"author":"(?:[^"\\]|\\.)*"')
_AUTHORS: Final = re.compile(_AUTHOR.pattern.encode())
_NOBODY: Final = '"author":""'
_ENDS: Final = ('"stroke.delete"', '"stroke.restore"', '"layer.delete"', '"layer.restore"')
MOST_MARKS: Final = 8_000


def shown(document: c.Document, still: Collection[Key] | None = None) -> c.Document:
    """The document without tombstones and names. ``still``: of an earlier document, what is there now as well."""
    return document.model_copy(
        update={
            "strokes": tuple(
                stroke.model_copy(update={"author": ""})
                for stroke in document.strokes
                if still is None or ("stroke", stroke.id) in still
            ),
            "layers": tuple(
                layer.model_copy(update={"author": ""})
                for layer in document.layers
                if still is None or ("layer", layer.id) in still
            ),
            "deleted": (),
            "deleted_layers": (),
        }
    )


def anonymous(document: c.Document) -> c.Document:
    """The document without the names of who drew what."""
    groups = ("strokes", "deleted", "layers", "deleted_layers")
    update = {
        name: tuple(each.model_copy(update={"author": ""}) for each in getattr(document, name)) for name in groups
    }
    return document.model_copy(update=update)


def things(document: StrokeSet) -> frozenset[Key]:
    """Returns what is there."""
    return frozenset((*(("stroke", key) for key in document.strokes), *(("layer", key) for key in document.layers)))


def nameless(ordered: str) -> str:
    """An ordered op as text (``store.journal.ordered_json``) without the names of who drew what it brings.

    In JSON a quote within a text has a backslash before it, so no text of a person's looks like such a field.
    """
    head, op, rest = ordered.partition(',"op":')
    return head + op + _AUTHOR.sub(_NOBODY, rest)


def unsigned(document: bytes) -> bytes:
    """A document as JSON text without the names of who drew what."""
    return _AUTHORS.sub(_NOBODY.encode(), document)


def concerns(op: str, still: Collection[Key]) -> bool:
    """Returns whether an op (JSON text) deletes and brings back nothing and is about what is in ``still`` alone."""
    found = json.loads(op)
    for part in found["ops"] if found["type"] == "group" else (found,):
        kind, _, verb = part["type"].partition(".")
        if verb in ("delete", "restore"):
            return False
        thing = part.get(kind)
        if kind != "terrain" and (kind, thing["id"] if isinstance(thing, dict) else thing) not in still:
            return False
    return True


@dataclass
class _Mark:
    """An op that deletes or brings back. ``back``: what it brings back, and the clock of its last deletion (-1: before
    this room was opened)."""

    ends: bool = False
    back: dict[Key, tuple[c.Stroke | c.Layer, int]] = field(default_factory=dict)


class Viewing:
    """The ops of one room as viewers see them, people who came in by a link to look."""

    def __init__(self) -> None:
        self._deleted: dict[Key, int] = {}
        self._marks: OrderedDict[int, _Mark] = OrderedDict()

    def loaded(self, clock: int, op: str) -> None:
        """Takes an op from before the room was opened."""
        if any(word in op for word in _ENDS):
            self._put(clock, _Mark(ends=True))

    def note(self, before: StrokeSet, op: c.Op, clock: int) -> None:
        """Takes an op that was ordered."""
        mark = _Mark()
        for part in op.ops if isinstance(op, c.Group) else (op,):
            match part:
                case c.DeleteStroke() | c.DeleteLayer():
                    self._deleted[_key(part)] = clock
                    mark.ends = True
                case c.RestoreStroke() | c.RestoreLayer():
                    key = _key(part)
                    kept = before.deleted if key[0] == "stroke" else before.deleted_layers
                    thing = kept.get(key[1])
                    if thing is not None:  # a thing that is in neither was deleted by this very op
                        mark.back[key] = thing, self._deleted.get(key, -1)
        if mark.ends or mark.back:
            self._put(clock, mark)
        if len(self._deleted) > 4 * c.MAX_STROKES:
            alive = {("stroke", key) for key in before.deleted} | {("layer", key) for key in before.deleted_layers}
            self._deleted = {key: at for key, at in self._deleted.items() if key in alive or at == clock}

    def _put(self, clock: int, mark: _Mark) -> None:
        self._marks[clock] = mark
        while len(self._marks) > MOST_MARKS:
            self._marks.popitem(last=False)

    def forget(self, clock: int) -> None:
        """Forgets what was ordered after ``clock``: nothing of it was committed."""
        self._deleted = {key: at for key, at in self._deleted.items() if at <= clock}
        for each in [each for each in self._marks if each > clock]:
            del self._marks[each]

    def resumable(self, clock: int) -> bool:
        """Returns whether the ops after ``clock`` can be sent to who has the document of it: they delete nothing, so
        that all they bring is there, and bring nothing back of which nobody knows whether it is known there."""
        return not any(each > clock for each in self._marks)

    def ended(self, clock: int) -> bool:
        """Returns whether anything was deleted after ``clock``."""
        return any(at > clock and mark.ends for at, mark in self._marks.items())

    def texts(self, ordered: Iterable[tuple[int, str]], since: int) -> list[str]:
        """Yields ordered ops (clock, text) for a viewer who got the document at clock ``since`` and all ops from there
        on."""
        return [self._text(clock, text, since) for clock, text in ordered]

    def _text(self, clock: int, text: str, since: int) -> str:
        born = self._unknown(clock, since)
        if born:
            head, sep, rest = text.partition(',"op":')
            op = c.OP.validate_json(rest[:-1])
            parts = tuple(_born(part, born) for part in (op.ops if isinstance(op, c.Group) else (op,)))
            new = c.Group(ops=parts) if isinstance(op, c.Group) else parts[0]
            text = f"{head}{sep}{op_json(new)}}}"
        return nameless(text)

    def _unknown(self, clock: int, since: int) -> dict[Key, c.Stroke | c.Layer]:
        mark = self._marks.get(clock)
        return {} if mark is None else {key: thing for key, (thing, at) in mark.back.items() if at <= since}

    def variant(self, clocks: Iterable[int], since: int) -> frozenset[tuple[int, Key]]:
        """Returns a key: two viewers for whom it is equal get the same texts of these ops."""
        return frozenset((clock, key) for clock in clocks for key in self._unknown(clock, since))


def _key(part: c.DeleteStroke | c.RestoreStroke | c.DeleteLayer | c.RestoreLayer) -> Key:
    return ("stroke", part.stroke) if isinstance(part, c.DeleteStroke | c.RestoreStroke) else ("layer", part.layer)


def _born(part: c.SimpleOp, born: dict[Key, c.Stroke | c.Layer]) -> c.SimpleOp:
    """Returns what is brought back, as something new."""
    if isinstance(part, c.RestoreStroke | c.RestoreLayer):
        thing = born.pop(_key(part), None)  # once: what the same op deletes and brings back again is known then
        if isinstance(thing, c.Stroke):
            return c.BeginStroke(stroke=thing)
        if thing is not None:
            return c.AddLayer(layer=thing)
    return part
