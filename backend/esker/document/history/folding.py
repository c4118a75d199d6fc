"""Finds the operations of a history that can go because a later one of the same gesture says it all. Pure.

A pen sends its curve again with every move, a handle its place, a slider its value: a row of operations by one person,
of the same field of the same thing, of which only the last counts once the gesture is over. ``fold`` keeps the last of
such a row, a burst, with its clock and its id; the clocks before it are silent (``SILENT``): nothing happens at them.
So no clock changes its meaning but those inside of a gesture (docs/decisions/0038-folding.md).
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field, replace
from typing import Final, NamedTuple

from esker import contract as c
from esker.contract import Op
from esker.document.ops import Limits, Refusal, StrokeSet
from esker.document.wire import op_json

BURST_SECONDS: Final = 2.0
"""Operations of a burst follow each other within this time; the journal knows times to a second."""
RETURNS: Final = 8
"""A row of at most so many operations may be steps of undo: the values that they go back to are kept."""
SWITCHES: Final = frozenset({"hidden", "locked"})
"""Fields that a click sets, not a drag: each click is a thing that somebody did."""
SILENT: Final = op_json(c.SetTerrain(fields=c.TerrainFields()))
"""The operation of a clock at which nothing happens any more: it sets no field."""
UNLIMITED: Final = Limits(strokes=2**31, points=2**31, layers=2**31, all_points=2**31)


class Dated(NamedTuple):
    """One op of a history. ``at``: when, seconds since 1970, None where that is not known."""

    clock: int
    client: str
    author: str
    op: Op
    at: float | None


class Folded(NamedTuple):
    """``into``: for each clock that falls silent the later one whose operation says it all; ``changed``: operations
    that stand at their clock instead of those that were there."""

    into: dict[int, int]
    changed: dict[int, Op]


@dataclass
class _Burst:
    who: tuple[str, str]
    key: Hashable
    subjects: frozenset[str]
    members: list[Dated] = field(default_factory=list)

    def goes_on(self, dated: Dated) -> bool:
        last = self.members[-1].at
        return last is None or dated.at is None or abs(dated.at - last) <= BURST_SECONDS


def silent(document: StrokeSet) -> StrokeSet:
    """The document one clock later, at which nothing happened."""
    return replace(document, clock=document.clock + 1)


def fold(history: Sequence[Dated]) -> Folded:
    """Folds operations in the order of their clocks. Whoever stores the result checks it with ``same`` first."""
    done: list[_Burst] = []
    going: list[_Burst] = []
    for dated in history:
        who, key, subjects = (dated.client, dated.author), _key(dated.op), _subjects(dated.op)
        mine = next((b for b in going if b.who == who and b.key == key and b.goes_on(dated)), None)
        # What else touches the same thing ends a burst: it may follow from what the burst has done so far.
        going = [b for b in going if b is mine or b.subjects.isdisjoint(subjects)]
        if mine is None and key is not None:
            mine = _Burst(who, key, subjects)
            going.append(mine)
            done.append(mine)
        if mine is not None:
            mine.members.append(dated)
    into: dict[int, int] = {}
    changed: dict[int, Op] = {}
    for burst, returns in zip(done, _returns(done), strict=True):
        _fold_one(burst.members, returns, into, changed)
    return Folded(into, changed)


def same(start: StrokeSet, end: StrokeSet, history: Sequence[Dated], folded: Folded) -> bool:
    """Whether the folded history makes ``end`` of ``start``, as the history does."""
    now = start
    for dated in history:
        if dated.clock in folded.into:
            now = silent(now)
            continue
        try:
            now, _ = now.apply(folded.changed.get(dated.clock, dated.op), UNLIMITED)
        except Refusal:
            return False
    return now.to_document() == end.to_document()


def _fold_one(members: list[Dated], returns: frozenset[str], into: dict[int, int], changed: dict[int, Op]) -> None:
    if isinstance(members[-1].op, c.AppendPoints):
        _fold_points(members, into, changed)
        return
    texts = [op_json(member.op) for member in members]
    kept = len(members) - 1
    for i in range(len(members) - 2, -1, -1):
        # Somebody went back to this value later: the list of what was done tells an undo by it.
        if texts[i] in returns and texts[i] not in texts[i + 1 :]:
            kept = i
        else:
            into[members[i].clock] = members[kept].clock


def _fold_points(members: list[Dated], into: dict[int, int], changed: dict[int, Op]) -> None:
    """One curve of all that was appended, in as many operations as it needs."""
    ops = [member.op for member in members if isinstance(member.op, c.AppendPoints)]
    start, points = ops[0].start, ops[0].points
    for op in ops[1:]:
        if op.start < start:
            start, points = op.start, op.points
        else:  # it goes on from what the burst has so far: nothing else touched the stroke
            points = points[: op.start - start] + op.points
    step = c.MAX_POINTS_PER_APPEND
    needed = max(1, -(-len(points) // step))
    if needed >= len(members):
        return
    tail = members[-needed:]
    for k, member in enumerate(tail):
        part = points[k * step : (k + 1) * step]
        changed[member.clock] = c.AppendPoints(
            stroke=ops[-1].stroke, start=start + k * step, points=part, last=ops[-1].last
        )
    into |= {member.clock: members[-1].clock for member in members[:-needed]}


def _returns(bursts: Sequence[_Burst]) -> list[frozenset[str]]:
    """For each burst, values that short bursts after it, of the same person and fields, set again."""
    later: dict[tuple[tuple[str, str], Hashable], frozenset[str]] = {}
    out: list[frozenset[str]] = []
    for burst in reversed(bursts):
        place = burst.who, burst.key
        known = later.get(place, frozenset())
        out.append(known)
        if len(burst.members) <= RETURNS and not isinstance(burst.members[0].op, c.AppendPoints):
            later[place] = known | {op_json(member.op) for member in burst.members}
    out.reverse()
    return out


def _key(op: Op) -> Hashable:
    """What an operation sets, so that the next one with the same key sets all of it again; None where it does more."""
    match op:
        case c.AppendPoints():
            return op.type, op.stroke
        case c.MoveAnchor():
            return op.type, op.stroke, op.which
        case c.SetStroke() | c.SetTerrain() | c.SetLayer():
            names = frozenset(op.fields.model_fields_set)
            if not names or names & SWITCHES:
                return None
            return op.type, next(iter(_subjects(op))), names
        case c.Group():
            keys = tuple(None if isinstance(part, c.AppendPoints) else _key(part) for part in op.ops)
            return None if None in keys else keys
        case _:
            return None


def _subjects(op: Op) -> frozenset[str]:
    """Returns the thing that an operation changes."""
    match op:
        case c.Group():
            return frozenset[str]().union(*(_subjects(part) for part in op.ops))
        case c.SetTerrain():
            return frozenset({"terrain"})
        case c.BeginStroke():
            return frozenset({f"stroke {op.stroke.id}"})
        case c.AddLayer():
            return frozenset({f"layer {op.layer.id}"})
        case c.SetLayer() | c.DeleteLayer() | c.RestoreLayer():
            return frozenset({f"layer {op.layer}"})
        case _:
            return frozenset({f"stroke {op.stroke}"})
