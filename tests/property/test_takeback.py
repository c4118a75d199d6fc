"""Taking back all of one person takes back all that still stands, and nothing of others (SPEC L20, L21)."""

from __future__ import annotations

import random
from typing import Any

import pytest

from esker import contract as c
from esker.document.changes import changes
from esker.document.ops import Refusal, StrokeSet
from esker.document.takeback import Deeds, outcome
from esker.document.undo import UndoPlan

SEEDS = 120


def _stroke(stroke_id: str, x: float) -> c.Stroke:
    return c.Stroke(id=stroke_id, kind="profile", first=(x, 0, 0), last=(x, 500, 0), curve=((0, 0), (1, 5)))


def _layer(layer_id: str) -> c.Layer:
    facts = c.GridFacts(rows=9, cols=9, low_m=0.0, high_m=10.0)
    fields: Any = {
        "content": "0" * 64,
        "facts": facts,
        "anchor": (0.0, 0.0),
        "spacing_m": (1.0, 1.0),
        "accuracy_m": 1.0,
    }
    return c.Layer(id=layer_id, **fields)


def _op(rng: random.Random, document: StrokeSet, n: int) -> c.Op:
    target = rng.choice([*document.strokes, *document.deleted])
    x = float(rng.randrange(4000))
    fields: dict[str, object] = {"label": f"{n}"} if rng.random() < 0.6 else {"hidden": rng.random() < 0.5}
    moves: list[c.SimpleOp] = [
        c.BeginStroke(stroke=_stroke(f"n{n}", x)),
        c.AppendPoints(stroke=target, start=rng.randrange(3), points=((0.5, x),), last=(x, x, 0)),
        c.MoveAnchor(stroke=target, which="first", to=(x, 1, 2)),
        c.SetStroke(stroke=target, fields=c.StrokeFields.model_validate(fields)),
        c.SetStroke(stroke=target, fields=c.StrokeFields(locked=rng.random() < 0.3)),
        c.DeleteStroke(stroke=target),
        c.RestoreStroke(stroke=target),
        c.SetTerrain(fields=c.TerrainFields(title=f"{n}") if n % 2 else c.TerrainFields(sea_level_m=x)),
        c.DeleteLayer(layer="v") if rng.random() < 0.5 else c.RestoreLayer(layer="v"),
        c.SetLayer(layer="v", fields=c.LayerFields(name=f"{n}")),
    ]
    if rng.random() < 0.1:
        return c.Group(ops=tuple(rng.sample(moves, 2)))
    return rng.choice(moves)


def _birth() -> StrokeSet:
    return StrokeSet("t", strokes={f"s{k}": _stroke(f"s{k}", 100.0 * k) for k in range(3)}, layers={"v": _layer("v")})


def _after(plan: UndoPlan, document: StrokeSet) -> StrokeSet:
    for op in plan.ops:
        document, _ = document.apply(op)
    return document


@pytest.mark.parametrize("block", range(6))
def test_what_others_did_stays(block: int) -> None:
    """SPEC L20: every value that somebody else wrote last; and strokes that were the person's alone are gone."""
    for seed in range(block, SEEDS, 6):
        _others_stay(seed)


def _others_stay(seed: int) -> None:
    rng = random.Random(seed)
    document, deeds = _birth(), Deeds({"ben", "ben-again"})
    writers: dict[tuple[str, str], bool] = {}
    touched: dict[str, set[bool]] = {}
    for n in range(40):
        author = rng.choice(["ben", "ben-again", "anne", "teacher"])
        op = _op(rng, document, n)
        before = document
        try:
            document, _ = before.apply(op)
        except Refusal:
            continue
        deeds.note(author, op, before, document)
        mine, done = author in deeds.clients, changes(op, before, document)
        for key, change in (done.strokes | done.layers).items():
            touched.setdefault(key, set()).add(mine)
            writers |= {(key, name): mine for name in change.fields}
        writers |= {("terrain", name): mine for name in done.terrain}
    left = _after(deeds.plan(document), document)
    for (key, name), mine in writers.items():
        here, there = document.strokes.get(key), left.strokes.get(key)
        if not mine and here is not None and there is not None:
            assert getattr(there, name) == getattr(here, name), f"seed {seed}: {key}.{name}"
        if not mine and key == "terrain":
            assert getattr(left.settings, name) == getattr(document.settings, name), f"seed {seed}: {name}"
    for key, by in touched.items():
        if by == {True} and key.startswith("n"):
            assert key not in left.strokes, f"seed {seed}: {key}"
        if by == {False}:
            assert left.strokes.get(key) == document.strokes.get(key), f"seed {seed}: {key}"


@pytest.mark.parametrize("block", range(6))
def test_who_was_alone_leaves_nothing(block: int) -> None:
    """SPEC L21: the land is what it was."""
    for seed in range(block, SEEDS, 6):
        rng = random.Random(1_000 + seed)
        document, deeds = _birth(), Deeds({"ben"})
        for n in range(40):
            op = _op(rng, document, n)
            before = document
            try:
                document, _ = before.apply(op)
            except Refusal:
                continue
            deeds.note("ben", op, before, document)
        left = _after(deeds.plan(document), document)
        birth = _birth()
        for part in ("strokes", "settings", "layers"):
            assert getattr(left, part) == getattr(birth, part), f"seed {seed}: {part}"


def test_nobody_did_anything() -> None:
    """SPEC L20."""
    document = StrokeSet("t", strokes={"s": _stroke("s", 0.0)})
    plan = Deeds({"ben"}).plan(document)
    assert plan.ops == ()
    assert outcome(plan) == "nothing_stands"


def test_a_value_goes_back_to_what_somebody_else_wrote() -> None:
    """SPEC L21: not to what it was before the person came."""
    document, deeds = _birth(), Deeds({"ben"})
    for author, label in (("ben", "A"), ("teacher", "B"), ("ben", "C")):
        op = c.SetStroke(stroke="s0", fields=c.StrokeFields(label=label))
        before = document
        document, _ = before.apply(op)
        deeds.note(author, op, before, document)
        title = c.SetTerrain(fields=c.TerrainFields(title=label))
        before = document
        document, _ = before.apply(title)
        deeds.note(author, title, before, document)
    left = _after(deeds.plan(document), document)
    assert (left.strokes["s0"].label, left.settings.title) == ("B", "B")
