"""Seeded sessions of people who draw as the page does: curves sent again with every move, drags, sliders, undo."""

from __future__ import annotations

import random
from collections.abc import Iterator
from typing import NamedTuple

from esker import contract as c
from esker.document.ops import Refusal, StrokeSet
from esker.document.undo import UndoStack
from esker.document.wire import op_json
from esker.store.journal import Row

PEOPLE = ("ada", "bob", "eve")
STEP = 0.05
"""Seconds between two operations of a gesture."""
REST = 5.0
"""Between the last operation of one gesture and the first of the next by the same person."""


class Done(NamedTuple):
    """One op as a journal has it, with its time and the document after it."""

    row: Row
    at: float
    after: StrokeSet


def session(seed: int, length: int, birth: c.Document) -> list[Done]:
    """At least ``length`` ops of three people whose gestures lie within each other."""
    rng = random.Random(seed)
    now, at = StrokeSet.from_document(birth), 1e9
    stacks = {person: UndoStack() for person in PEOPLE}
    busy: dict[str, Iterator[c.Op]] = {}
    names: dict[str, int] = dict.fromkeys(PEOPLE, 0)
    counters, free = dict.fromkeys(PEOPLE, 0), dict.fromkeys(PEOPLE, 0.0)
    out: list[Done] = []
    while len(out) < length or busy:
        at += STEP
        person = rng.choice(PEOPLE)
        if person not in busy:
            if at < free[person] or len(out) >= length:
                continue
            names[person] += 1
            busy[person] = _gesture(rng, f"{person}{names[person]}", now, stacks[person])
        op = next(busy[person], None)
        if op is None:
            del busy[person]
            free[person] = at + REST
            continue
        try:
            after, _ = now.apply(op)
        except Refusal:
            del busy[person]
            continue
        stacks[person].record(now, op, after, f"{person}{names[person]}")
        now = after
        counters[person] += 1
        out.append(Done(Row(now.clock, person, counters[person], person, op_json(op)), at, now))
    return out


def _gesture(rng: random.Random, name: str, now: StrokeSet, stack: UndoStack) -> Iterator[c.Op]:
    mine = list(now.strokes)
    kind = rng.choice(("draw", "draw", "sketch", "anchor", "slider", "several", "title", "delete", "undo"))
    if kind in ("draw", "sketch") or not mine:
        yield from _drawn(rng, name, again=kind == "draw")
    elif kind == "anchor":
        stroke = rng.choice(mine)
        for _ in range(rng.randint(2, 12)):
            yield c.MoveAnchor(stroke=stroke, which="last", to=(rng.uniform(0, 4000), 1.0, 2.0))
    elif kind == "slider":
        stroke, value = rng.choice(mine), rng.uniform(0, 50)
        for _ in range(rng.randint(2, 12)):
            value += rng.uniform(0.1, 9)
            yield c.SetStroke(stroke=stroke, fields=c.StrokeFields(amplitude_m=value))
    elif kind == "several":
        moved = rng.sample(mine, min(len(mine), 3))
        for _ in range(rng.randint(2, 8)):
            to = (rng.uniform(0, 4000), 7.0, 1.0)
            yield c.Group(ops=tuple(c.MoveAnchor(stroke=each, which="first", to=to) for each in moved))
    elif kind == "title":
        for _ in range(rng.randint(1, 5)):
            yield c.SetTerrain(fields=c.TerrainFields(title=f"{name} {rng.randrange(10**9)}"))
    elif kind == "delete":
        stroke = rng.choice(mine)
        yield c.SetStroke(stroke=stroke, fields=c.StrokeFields(hidden=not now.strokes[stroke].hidden))
        yield c.DeleteStroke(stroke=stroke)
    else:
        yield from stack.undo(now).ops


def _drawn(rng: random.Random, name: str, *, again: bool) -> Iterator[c.Op]:
    """``again``: the whole curve comes with every move, as of a profile whose plane turns with the pen."""
    ends = {"first": (10.0, 20.0, 0.0), "last": (30.0, 20.0, 0.0)}
    yield c.BeginStroke(stroke=c.Stroke.model_validate({"id": name, "kind": "profile", "curve": (), **ends}))
    curve: list[c.CurvePoint] = []
    for _ in range(rng.randint(2, 30)):
        fresh = [(rng.random(), rng.uniform(0, 300)) for _ in range(rng.randint(1, 20))]
        last = (rng.uniform(0, 4000), 20.0, 5.0)
        start = 0 if again else len(curve)
        curve += fresh
        for at in range(start, len(curve), c.MAX_POINTS_PER_APPEND):
            points = tuple(curve[at : at + c.MAX_POINTS_PER_APPEND])
            yield c.AppendPoints(stroke=name, start=at, points=points, last=last)
    yield c.FinishStroke(stroke=name)
