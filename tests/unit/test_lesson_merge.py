"""What a class does to documents (SPEC L70 to L73)."""

from __future__ import annotations

import pytest

from esker import contract as c
from esker.document.ops import Refusal, StrokeSet
from esker.lesson import merge

LIMITS = None


def _stroke(key: str, height: float = 10.0, **fields: object) -> c.Stroke:
    values = {
        "id": key,
        "kind": "profile",
        "first": (100, 100, height),
        "last": (900, 100, 0),
        "curve": ((0, 0), (1, 0)),
    }
    return c.Stroke.model_validate(values | fields)


def _document(*strokes: c.Stroke, **settings: object) -> c.Document:
    return c.Document(id="t", settings=c.TerrainSettings().model_copy(update=settings), strokes=strokes)


def _after(copy: StrokeSet, ops: list[c.SimpleOp]) -> StrokeSet:
    for op in merge.groups(ops):
        copy, _ = copy.apply(op)
    return copy


def test_additions_reach_what_pupils_left_alone() -> None:
    """SPEC L70: new, changed and deleted strokes; settings; and nothing the second time."""
    before = _document(_stroke("a"), _stroke("b"), _stroke("gone"), sea_level_m=5.0)
    now = _document(_stroke("a", 20.0, locked=True), _stroke("b"), _stroke("new"), sea_level_m=9.0)
    copy = StrokeSet.from_document(before)
    after = _after(copy, merge.additions(before, now, copy))
    assert after.strokes == {s.id: s for s in now.strokes}
    assert after.settings.sea_level_m == 9.0
    assert merge.additions(before, now, after) == []


def test_additions_never_undo_what_pupils_did() -> None:
    """SPEC L70: strokes that they changed or deleted, and settings that they chose, stay."""
    before = _document(_stroke("a"), _stroke("b"), _stroke("c"), sea_level_m=5.0)
    now = _document(_stroke("a", 20.0), _stroke("c", 30.0), sea_level_m=9.0)
    mine = StrokeSet.from_document(before)
    mine = _after(
        mine,
        [
            c.SetStroke(stroke="a", fields=c.StrokeFields(label="mine")),
            c.SetStroke(stroke="b", fields=c.StrokeFields(label="mine too")),
            c.DeleteStroke(stroke="c"),
            c.SetTerrain(fields=c.TerrainFields(sea_level_m=None)),
        ],
    )
    assert merge.additions(before, now, mine) == []


def test_a_copy_goes_back_to_its_beginning() -> None:
    """SPEC L71: whatever was done, locked strokes and trimmed tombstones too; and nothing the second time."""
    start = _document(_stroke("a", locked=True), _stroke("b"), _stroke("c"), sea_level_m=5.0)
    copy = _after(
        StrokeSet.from_document(start),
        [
            c.SetStroke(stroke="a", fields=c.StrokeFields(locked=False)),
            c.SetStroke(stroke="a", fields=c.StrokeFields(first=(1.0, 2.0, 3.0), locked=True)),
            c.DeleteStroke(stroke="b"),
            c.DeleteStroke(stroke="c"),
            c.BeginStroke(stroke=_stroke("mine", locked=True)),
            c.SetTerrain(fields=c.TerrainFields(sea_level_m=77.0, title="Ada's")),
        ],
    )
    del copy.deleted["c"]
    back = _after(copy, merge.beginning(start, copy))
    assert back.strokes == {s.id: s for s in start.strokes}
    assert (back.settings.sea_level_m, back.settings.title) == (5.0, "Ada's")
    assert "mine" in back.deleted
    assert merge.beginning(start, back) == []


def test_many_copies_become_one_terrain() -> None:
    """SPEC L72: alike once, a clash of ids renamed, in whatever order; too many are refused."""
    start = _document(_stroke("a"), sea_level_m=5.0)
    one, two = [_stroke("a"), _stroke("x", 1.0)], [_stroke("a", 50.0), _stroke("x", 2.0), _stroke("y")]
    made = merge.together(start, [one, two, two], "All")
    assert {s.id: s.first[2] for s in made.strokes} == {"a": 10, "x": 1, "a-2": 50, "x-2": 2, "y": 10}
    assert (made.settings.title, made.settings.sea_level_m) == ("All", 5.0)
    other = merge.together(start, [two, one], "All")
    bare = [sorted((s.first[2], s.last, s.curve) for s in each.strokes) for each in (made, other)]
    assert bare[0] == bare[1]
    with pytest.raises(Refusal):
        merge.together(start, [[_stroke(f"s{n}") for n in range(c.MAX_STROKES + 1)]], "")


def test_groups_are_neither_too_many_nor_too_long() -> None:
    """SPEC L73."""
    curve = tuple((n / 4095, 0.0) for n in range(4096))
    ops: list[c.SimpleOp] = [c.BeginStroke(stroke=_stroke(f"s{n}")) for n in range(70)]
    ops += [c.BeginStroke(stroke=_stroke(f"l{n}", curve=curve)) for n in range(3)]
    made = list(merge.groups(ops))
    assert all(isinstance(group, c.Group) for group in made)
    sizes = [len(group.ops) for group in made if isinstance(group, c.Group)]
    assert (sum(sizes), max(sizes)) == (73, c.MAX_OPS_PER_GROUP)
    assert sizes[-2:] == [7, 2] or sizes[-1] <= 1 + 8000 // 4096
