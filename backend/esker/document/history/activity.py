"""The journal as people remember it: ops gathered into entries, one for each thing that somebody did. Pure.

A stroke drawn is one entry however many ops brought its points, and so is a row of changes of the same thing by the
same person. An op that gives every field that it names the value from before its author's last step is an undo,
whatever button made it; one that then gives them the values from after it is a redo (docs/decisions/0021-history.md).
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final, Literal, NamedTuple

from esker import contract as c

Action = Literal[
    "draw", "paint", "edit", "move", "reshape", "hide", "show", "name", "lock", "unlock",
    "delete", "restore", "settings", "layer", "order", "several",
]  # fmt: skip
Turn = Literal["", "undo", "redo"]
Key = tuple[str, str, str]
"""The thing that a change is of: "stroke", "layer" or "terrain"; its id; the field. The field "alive": being there."""

MERGE_SECONDS: Final = 60.0
"""Changes of the same thing by the same person within this time are one entry."""
STEPS: Final = 64
"""Steps of an entry, and entries of a person, that undo is recognised in."""
_APPEND: Final = re.compile(r'\{"type":"stroke\.append","stroke":"([^"]+)"')
_LAST: Final = re.compile(r'"last":(\[[^\]]*\])\}$')
_UNKNOWN: Final = object()
"""The value of a field that no op has told yet."""


class JournalEntry(NamedTuple):
    """One op of the journal: its clock, the client that did it, its JSON text, when (seconds since 1970, or None)."""

    clock: int
    author: str
    op: str
    at: float | None


Step = dict[Key, tuple[object, object]]
"""Fields with their values before and after."""


@dataclass(eq=False)
class Entry:
    """One thing that somebody did, from clock ``first`` to ``last``. ``fields``: names of what was changed."""

    first: int
    last: int
    at: float | None
    author: str
    action: Action
    kind: str
    subjects: tuple[str, ...]
    fields: frozenset[str]
    turn: Turn = ""
    of: Entry | None = None
    """For an undo or a redo: what was undone, or done again."""
    steps: list[Step] = field(default_factory=list, repr=False)


@dataclass(eq=False)
class _Person:
    """What one author did last: for merging and for recognising undo."""

    last: Entry | None = None
    done: list[Entry] = field(default_factory=list)
    undone: list[tuple[Entry, list[Step]]] = field(default_factory=list)


class ActivityLog:
    """Entries of one terrain, from its beginning or from any clock on; ``add`` continues it."""

    def __init__(self, document: c.Document | None, clock: int = 0) -> None:
        """``document``: the terrain at ``clock``, None when it is not at hand; then what a field was is only known
        once an op has named it, and undo is recognised from there on."""
        self.clock = clock if document is None else document.clock
        self.first = self.clock
        """Clock after which the entries begin."""
        self.entries: list[Entry] = []
        self.names: dict[str, str] = {}
        """Names by author, as the strokes that they drew tell them."""
        self._values: dict[Key, object] = {}
        self._drawing: dict[str, Entry] = {}
        self._people: dict[str, _Person] = {}
        for stroke in () if document is None else (*document.strokes, *document.deleted):
            self._learn("stroke", stroke.id, stroke.model_dump(mode="json", exclude={"curve"}))
        for layer in () if document is None else (*document.layers, *document.deleted_layers):
            self._learn("layer", layer.id, layer.model_dump(mode="json"))
        if document is not None:
            self._learn("terrain", "", document.settings.model_dump(mode="json"))

    def add(self, ops: Iterable[JournalEntry]) -> None:
        """Goes on with the next ops, in the order of their clocks; earlier ones are left out."""
        for written in ops:
            if written.clock <= self.clock:
                continue
            self.clock = written.clock
            append = _APPEND.match(written.op)
            if append is None:
                self._one(written, json.loads(written.op))
            else:
                self._append(written, append.group(1))

    # --- one op -------------------------------------------------------------------------------------------------

    def _append(self, written: JournalEntry, stroke: str) -> None:
        """Points come often and are long: only where the last anchor is now is read."""
        last = _LAST.search(written.op)
        if last is not None:
            self._values["stroke", stroke, "last"] = _seen(json.loads(last.group(1)))
        self._values["stroke", stroke, "curve"] = _UNKNOWN
        entry = self._drawing.get(stroke)
        if entry is not None and entry.author == written.author:
            self._extend(entry, written)
        else:
            self._enter(written, "reshape", "stroke", (stroke,), frozenset({"curve"}), {})

    def _one(self, written: JournalEntry, op: dict[str, Any]) -> None:
        parts: list[dict[str, Any]] = op["ops"] if op["type"] == "group" else [op]
        step: Step = {}
        for part in parts:
            step |= self._changes(part)
            born = part.get(_subject(part)[0])
            if isinstance(born, dict) and born.get("author"):
                self.names[written.author] = born["author"]
        if op["type"] == "stroke.finish":
            entry = self._drawing.pop(op["stroke"], None)
            if entry is not None and entry.author == written.author:
                self._extend(entry, written)
            return
        # The first grid that has one also gives the terrain its place: that goes without saying.
        parts = [part for part in parts if part["type"] == "layer.add"] or parts
        action, kind = _what(parts)
        subjects = tuple(dict.fromkeys(_subject(part)[1] for part in parts))
        fields = frozenset(name for part in parts for name in part.get("fields", {}))
        if op["type"] == "stroke.anchor":
            fields = frozenset({op["which"]})
        entry = self._enter(written, action, kind, subjects, fields, step)
        if op["type"] == "stroke.begin" and not op["stroke"].get("finished"):
            self._drawing[op["stroke"]["id"]] = entry

    def _changes(self, op: dict[str, Any]) -> Step:
        """What an op changes, which is then what the values are."""
        kind, subject = _subject(op)
        match op["type"]:
            case "stroke.begin" | "layer.add":
                whole = op[kind]
                self._learn(kind, subject, {k: v for k, v in whole.items() if k != "curve"})
                return {(kind, subject, "alive"): (False, True)}
            case "stroke.delete" | "layer.delete":
                new: dict[str, object] = {"alive": False}
            case "stroke.restore" | "layer.restore":
                new = {"alive": True}
            case "stroke.anchor":
                new = {op["which"]: _seen(op["to"])}
            case "stroke.finish":
                return {}
            case _:
                new = {name: _seen(value) for name, value in op["fields"].items()}
        step: Step = {}
        for name, value in new.items():
            key = (kind, subject, name)
            step[key] = (self._values.get(key, _UNKNOWN), value)
            self._values[key] = value
        return step

    def _learn(self, kind: str, subject: str, fields: Mapping[str, Any]) -> None:
        self._values |= {(kind, subject, name): _seen(value) for name, value in fields.items()}
        self._values[kind, subject, "alive"] = True

    # --- entries ------------------------------------------------------------------------------------------------

    def _enter(
        self,
        written: JournalEntry,
        action: Action,
        kind: str,
        subjects: tuple[str, ...],
        fields: frozenset[str],
        step: Step,
    ) -> Entry:
        """Undoes, does again, goes on with the author's last entry, or begins a new one."""
        person = self._people.setdefault(written.author, _Person())
        turned = self._turn(person, step, written)
        if turned is not None:
            return turned
        person.undone.clear()
        last = person.last
        if last is not None and _continues(last, action, subjects, written):
            self._extend(last, written)
            last.fields |= fields
        else:
            last = Entry(written.clock, written.clock, written.at, written.author, action, kind, subjects, fields)
            self.entries.append(last)
            person.last = last
            person.done = [*person.done[1 - STEPS :], last]
        last.steps = [*last.steps[1 - STEPS :], step]
        return last

    def _turn(self, person: _Person, step: Step, written: JournalEntry) -> Entry | None:
        """The entry of an undo or a redo; None when this is neither."""
        if not step:
            return None
        last = person.last
        if last is not None and last.turn == "undo" and last.of is not None and person.undone:
            undone = person.undone[-1]
            if undone[0] is last.of and _before(undone[1], step) == 0:  # one undo of several ops
                self._extend(last, written)
                return last
        if person.done:
            top = person.done[-1]
            at = _before(top.steps, step)
            if at is not None:
                person.undone.append((top, top.steps[at:]))
                top.steps = top.steps[:at]
                if not top.steps:
                    person.done.pop()
                return self._turned(person, written, top, "undo", person.undone[-1][1])
        if person.undone:
            entry, steps = person.undone[-1]
            if _after(steps, step):
                person.undone.pop()
                if not person.done or person.done[-1] is not entry:
                    person.done.append(entry)
                entry.steps = [*entry.steps, *steps]
                return self._turned(person, written, entry, "redo", steps)
        return None

    def _turned(self, person: _Person, written: JournalEntry, of: Entry, turn: Turn, steps: list[Step]) -> Entry:
        """``steps``: what of the entry is undone or done again. Only their fields are named."""
        fields = of.fields & {name for step in steps for _, _, name in step} or of.fields
        entry = replace(
            of,
            first=written.clock,
            last=written.clock,
            at=written.at,
            author=written.author,
            fields=fields,
            turn=turn,
            of=of,
            steps=[],
        )
        self.entries.append(entry)
        person.last = entry
        return entry

    def _extend(self, entry: Entry, written: JournalEntry) -> None:
        entry.last, entry.at = written.clock, written.at if written.at is not None else entry.at


def _subject(op: dict[str, Any]) -> tuple[str, str]:
    kind = op["type"].partition(".")[0]
    if kind == "terrain":
        return kind, ""
    value = op[kind]
    return kind, value["id"] if isinstance(value, dict) else value


_FIELDS: Final[Mapping[str, Action]] = {
    "first": "move",
    "last": "move",
    "anchor": "move",
    "rotation_deg": "move",
    "curve": "reshape",
    "label": "name",
    "name": "name",
    "priority": "order",
}


def _what(parts: list[dict[str, Any]]) -> tuple[Action, str]:
    """The action of ops that belong together, and what it is done to."""
    found = {(_action(part), _subject(part)[0]) for part in parts}
    if len(found) == 1:
        return found.pop()
    kinds = {kind for _, kind in found}
    return "several", kinds.pop() if len(kinds) == 1 else ""


def _action(op: dict[str, Any]) -> Action:
    kind, _, verb = op["type"].partition(".")
    if verb == "begin":
        return "paint" if op["stroke"]["kind"] == "paint" else "draw"
    if verb == "add":
        return "layer"
    if verb == "delete":
        return "delete"
    if verb == "restore":
        return "restore"
    if verb == "anchor":
        return "move"
    if verb == "append":
        return "reshape"
    if kind == "terrain":
        return "settings"
    fields = op.get("fields", {})
    if set(fields) == {"hidden"}:
        return "hide" if fields["hidden"] else "show"
    if set(fields) == {"locked"}:
        return "lock" if fields["locked"] else "unlock"
    actions = {_FIELDS.get(name, "edit") for name in fields}
    return actions.pop() if len(actions) == 1 else "edit"


def _continues(entry: Entry, action: Action, subjects: tuple[str, ...], written: JournalEntry) -> bool:
    """Whether this is more of the same."""
    if entry.turn or entry.action != action or entry.subjects != subjects or action in ("draw", "paint", "layer"):
        return False
    return entry.at is None or written.at is None or abs(written.at - entry.at) <= MERGE_SECONDS


def _before(steps: list[Step], new: Step) -> int | None:
    """The step before which all fields of ``new`` had the values that it gives them; None when there is none.

    Steps that changed just those fields come first: others of the entry were not taken back.
    """
    found: int | None = None
    for i in range(len(steps)):
        olds: dict[Key, object] = {}
        for step in reversed(steps[i:]):
            olds |= {key: old for key, (old, _) in step.items()}
        if all(key in olds and olds[key] is not _UNKNOWN and olds[key] == value for key, (_, value) in new.items()):
            if olds.keys() == new.keys():
                return i
            found = i if found is None else found
    return found


def _after(steps: list[Step], new: Step) -> bool:
    """Whether ``new`` gives its fields the values that they had after all the steps."""
    values = {key: value for step in steps for key, (_, value) in step.items()}
    return all(key in values and values[key] == value for key, (_, value) in new.items())


def _seen(value: Any) -> object:
    """A value to compare with: short ones as they are, long ones by their text's hash."""
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    text = json.dumps(value)
    return text if len(text) <= 64 else hash(text)
