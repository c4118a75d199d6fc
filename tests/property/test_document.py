"""Random ops on a document and everybody's undo, as a state machine (SPEC D1 to D21)."""

from __future__ import annotations

import random
from typing import Any, get_args

import hypothesis.strategies as st
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from esker import contract as c
from esker.document.layers import CREDIT_FIELDS
from esker.document.ops import CHANNEL_FIELDS, GROUND_FIELDS, Limits, Refusal, StrokeSet, check_document
from esker.document.strokes import bounds
from esker.document.undo import LAYER_WORDS, STROKE_WORDS, UndoStack, inverse
from esker.document.wire import op_json
from esker.grid import Rect

PEOPLE = ("ada", "bob", "eve")
HEIGHT_FIELDS = GROUND_FIELDS - CHANNEL_FIELDS
IDS = tuple(f"s{i}" for i in range(4))
LIMITS = Limits(strokes=4, points=6, layers=2)
LAYER_IDS = tuple(f"v{i}" for i in range(3))

metres = st.floats(-50_000, 50_000, allow_nan=False).map(lambda x: round(x, 3))
near = st.floats(0, 4096).map(lambda x: round(x, 3))
vec = st.tuples(near, near, near)
curve = st.lists(st.tuples(st.floats(-1, 2), st.floats(-300, 300)), max_size=7).map(tuple)
flank = st.one_of(
    st.none(),
    st.builds(
        c.Flank,
        slope_deg=st.one_of(st.none(), st.floats(0, 85)),
        extent_m=st.floats(0, 1000),
        shape=st.sampled_from(("straight", "concave", "convex")),
    ),
)
stroke_id = st.sampled_from(IDS)
paint = st.builds(
    c.Paint,
    channel=st.sampled_from(get_args(c.PaintChannel)),
    value=st.floats(-1, 1),
    radius_m=st.floats(0, 500),
)
crests = st.builds(
    c.Stroke,
    id=stroke_id,
    kind=st.sampled_from(("profile", "level")),
    first=vec,
    last=vec,
    curve=curve,
    left=flank,
    right=flank,
    hidden=st.booleans(),
    locked=st.just(False),
)
brushes = st.builds(
    c.Stroke,
    id=stroke_id,
    kind=st.just("paint"),
    first=vec,
    last=vec,
    curve=curve,
    paint=st.one_of(paint, paint, st.none()),
    hidden=st.booleans(),
)
course = st.builds(c.Course, use=st.sampled_from(get_args(c.CourseUse)), rises=st.lists(metres, max_size=4).map(tuple))
courses = st.builds(
    c.Stroke,
    id=stroke_id,
    kind=st.just("course"),
    first=vec,
    last=vec,
    curve=curve,
    course=st.one_of(course, course, st.none()),
    left=flank,
    hidden=st.booleans(),
)
strokes = st.one_of(crests, crests, brushes, courses)
field_values: dict[str, st.SearchStrategy[Any]] = {
    "first": vec,
    "last": st.one_of(vec, st.tuples(metres, metres, metres)),
    "curve": curve,
    "left": flank,
    "right": flank,
    "plateau_radius_m": st.floats(0, 500),
    "amplitude_m": st.floats(0, 50),
    "roughness": st.floats(0, 1),
    "yields": st.floats(0, 1),
    "paint": paint,
    "locked": st.booleans(),
    "hidden": st.booleans(),
    "label": st.sampled_from(("", "a", "b", "山")),
}
fields = st.sets(st.sampled_from(sorted(field_values)), max_size=4).flatmap(
    lambda names: st.fixed_dictionaries({n: field_values[n] for n in sorted(names)})
)
terrain_fields = st.fixed_dictionaries(
    {},
    optional={
        "title": st.sampled_from(("x", "y")),
        "reach_m": st.one_of(st.none(), st.floats(1, 1000)),
        "sea_level_m": st.one_of(st.none(), st.floats(-10, 10)),
        "lakes_m": st.one_of(st.none(), st.floats(0, 50)),
        "rivers": st.floats(0, c.MAX_RIVERS),
        "wetness": st.floats(c.MIN_WETNESS, c.MAX_WETNESS),
        "border": st.sampled_from(("free", "pinned")),
        "seed": st.integers(0, 2**32 - 1),
        "detail": st.floats(0, 4),
        "rule": st.sampled_from(get_args(c.Rule)),
    },
)
layer_id = st.sampled_from(LAYER_IDS)
layers = st.builds(
    c.Layer,
    id=layer_id,
    content=st.sampled_from(("0" * 64, "f" * 64)),
    facts=st.just(c.GridFacts(rows=9, cols=9, low_m=-10.0, high_m=900.0)),
    anchor=st.tuples(metres, metres),
    spacing_m=st.just((1.0, 2.0)),
    accuracy_m=st.floats(0, 5),
    hidden=st.booleans(),
)
layer_fields = st.fixed_dictionaries(
    {},
    optional={
        "name": st.sampled_from(("x", "山")),
        "anchor": st.tuples(metres, metres),
        "rotation_deg": st.floats(-360, 360),
        "scale": st.sampled_from((0.0, 1.0, -2.0, 1000.0)),
        "lift_m": metres,
        "priority": st.integers(-3, 3),
        "hidden": st.booleans(),
        "outline": st.floats(0, 1),
    },
)
layer_ops = st.one_of(
    st.builds(c.AddLayer, layer=layers),
    st.builds(c.SetLayer, layer=layer_id, fields=layer_fields.map(c.LayerFields.model_validate)),
    st.builds(c.DeleteLayer, layer=layer_id),
    st.builds(c.RestoreLayer, layer=layer_id),
)
simple = st.one_of(
    layer_ops,
    layer_ops,
    st.builds(c.BeginStroke, stroke=strokes),
    st.builds(c.AppendPoints, stroke=stroke_id, start=st.integers(0, 7), points=curve, last=vec),
    st.builds(c.FinishStroke, stroke=stroke_id),
    st.builds(c.SetStroke, stroke=stroke_id, fields=fields.map(c.StrokeFields.model_validate)),
    st.builds(c.MoveAnchor, stroke=stroke_id, which=st.sampled_from(("first", "last")), to=vec),
    st.builds(c.DeleteStroke, stroke=stroke_id),
    st.builds(c.RestoreStroke, stroke=stroke_id),
    st.builds(c.SetTerrain, fields=terrain_fields.map(c.TerrainFields.model_validate)),
)
ops = st.one_of(simple, st.lists(simple, min_size=1, max_size=4).map(lambda parts: c.Group(ops=tuple(parts))))


def test_nothing_but_shape_dirties_the_heights() -> None:
    """SPEC D11, D26: amplitude, roughness and paint are for the other channels."""
    anchors: Any = {"first": (0, 0, 0), "last": (90, 0, 0), "curve": ((0, 0), (1, 0))}
    snow = c.Paint(channel="snow", value=1, radius_m=5)
    crest = c.Stroke(id="m", kind="level", **anchors)
    brush = c.Stroke(id="p", kind="paint", paint=snow, **anchors)
    document = StrokeSet("t", strokes={"m": crest, "p": brush})
    untouched = (False, False)
    cases: list[tuple[c.Op, tuple[bool, bool]]] = [
        (c.SetStroke(stroke="m", fields=c.StrokeFields(amplitude_m=3, roughness=1)), (False, True)),
        (c.SetStroke(stroke="m", fields=c.StrokeFields(amplitude_m=4, plateau_radius_m=1)), (True, True)),
        (c.SetStroke(stroke="m", fields=c.StrokeFields(label="x")), untouched),
        (c.SetStroke(stroke="p", fields=c.StrokeFields(paint=snow.model_copy(update={"value": -1.0}))), (False, True)),
        (c.SetStroke(stroke="p", fields=c.StrokeFields(label="x")), untouched),
        (c.MoveAnchor(stroke="p", which="last", to=(0, 90, 0)), (False, True)),
        (c.AppendPoints(stroke="p", start=2, points=((2, 0),), last=(90, 90, 0)), (False, True)),
        (c.FinishStroke(stroke="p"), untouched),
        (c.DeleteStroke(stroke="p"), (False, True)),
        (c.RestoreStroke(stroke="p"), (False, True)),
        (c.SetStroke(stroke="p", fields=c.StrokeFields(hidden=True)), (False, True)),
        (c.DeleteStroke(stroke="p"), untouched),
        (c.SetTerrain(fields=c.TerrainFields(detail=2, rule="smooth", seed=9)), untouched),
        (c.SetTerrain(fields=c.TerrainFields(reach_m=9)), (True, True)),
    ]
    for op, expected in cases:
        after, dirty = document.apply(op)
        found = after.heights_rev != document.heights_rev, after.channels_rev != document.channels_rev
        brushed = isinstance(op, c.SetTerrain) or getattr(op, "stroke", "") == "p"
        assert (after.paint_rev != document.paint_rev) == (expected[1] and brushed), op
        assert (found, dirty is not None) == (expected, expected[0]), op
        document = after


def _state(document: StrokeSet) -> dict[str, object]:
    """The whole content, field by field. ``finished`` is progress, not content: undo leaves it."""
    found: dict[str, object] = {f"terrain.{k}": v for k, v in document.settings}
    for place, some in (("live", document.strokes), ("deleted", document.deleted)):
        for stroke in some.values():
            found[f"{stroke.id}.state"] = place
            found |= {f"{stroke.id}.{name}": getattr(stroke, name) for name in STROKE_WORDS}
    for place, laid in (("live", document.layers), ("deleted", document.deleted_layers)):
        for layer in laid.values():
            found[f"{layer.id}.state"] = place
            found |= {f"{layer.id}.{name}": getattr(layer, name) for name in LAYER_WORDS}
    return found


def test_a_label_leaves_the_ground_alone() -> None:
    document = StrokeSet(
        "t", strokes={"s": c.Stroke(id="s", kind="level", first=(0, 0, 0), last=(9, 0, 0), curve=((0, 0),))}
    )
    for fields in ({"label": "x"}, {"locked": True}, {"locked": False}):
        document, dirty = document.apply(c.SetStroke(stroke="s", fields=c.StrokeFields.model_validate(fields)))
        assert dirty is None
    _, dirty = document.apply(c.SetStroke(stroke="s", fields=c.StrokeFields(plateau_radius_m=5.0)))
    assert dirty == Rect(-5, -5, 5, 5)


def _long(stroke_id: str, points: int) -> c.Stroke:
    return c.Stroke(id=stroke_id, kind="profile", first=(0, 0, 0), last=(9, 0, 0), curve=((0.5, 1.0),) * points)


def test_the_points_of_a_terrain_are_bounded() -> None:
    """SPEC D7: however they come, and what was deleted makes room."""
    limits = Limits(all_points=10)
    document = StrokeSet.from_document(c.Document(id="t", strokes=(_long("a", 6), _long("b", 3))))
    longer = c.SetStroke(stroke="b", fields=c.StrokeFields(curve=((0, 0),) * 5))
    further = c.AppendPoints(stroke="b", start=2, points=((2, 0),) * 3, last=(9, 0, 0))
    for op in (c.BeginStroke(stroke=_long("c", 2)), longer, further):
        with pytest.raises(Refusal, match="at most 10 points"):
            document.apply(op, limits)
    full, _ = document.apply(c.AppendPoints(stroke="b", start=2, points=((2, 0),) * 2, last=(9, 0, 0)), limits)
    without, _ = full.apply(c.DeleteStroke(stroke="a"), limits)
    other, _ = without.apply(c.BeginStroke(stroke=_long("c", 6)), limits)
    with pytest.raises(Refusal, match="at most 10 points"):
        other.apply(c.RestoreStroke(stroke="a"), limits)
    full.apply(c.MoveAnchor(stroke="a", which="last", to=(5, 5, 5)), Limits(all_points=1))  # what is there may change
    with pytest.raises(Refusal, match="at most 9 points"):
        check_document(full.to_document(), Limits(all_points=9))
    check_document(full.to_document(), limits)


def test_tombstones_hold_no_more_points_than_a_terrain() -> None:
    """SPEC D9: the same as in doc/tombstones.test.ts."""
    document = StrokeSet("t", strokes={f"s{i}": _long(f"s{i}", c.MAX_POINTS_PER_STROKE) for i in range(124)})
    for i in range(124):
        document, _ = document.apply(c.DeleteStroke(stroke=f"s{i}"))
    assert list(document.deleted) == [f"s{i}" for i in range(2, 124)]


@given(op=ops)
def test_ops_survive_the_wire(op: c.Op) -> None:
    text = op_json(op)
    again = c.OP.validate_json(text)
    assert again == op
    assert op_json(again) == text
    if isinstance(op, c.SetStroke | c.SetTerrain | c.SetLayer):
        assert again.fields.model_fields_set == op.fields.model_fields_set


@settings(suppress_health_check=[HealthCheck.too_slow], deadline=None)
@given(before=st.lists(ops, max_size=12), op=ops)
def test_an_inverse_takes_back_exactly_its_op(before: list[c.Op], op: c.Op) -> None:
    document = StrokeSet("t")
    for one in before:
        document = _try(document, one) or document
    after = _try(document, op)
    if after is None:
        return
    back = after
    for one in inverse(op, document):
        back, _ = back.apply(one)
    assert back.strokes.keys() == document.strokes.keys()
    assert back.layers.keys() == document.layers.keys()
    expected = _state(document)
    for key, value in _state(back).items():
        if key in expected and not _in_tombstone(key, document):
            assert value == expected[key], key


def _in_tombstone(key: str, document: StrokeSet) -> bool:
    """What a deleted stroke holds inside is nobody's concern, only that it is deleted."""
    item, _, name = key.partition(".")
    return name != "state" and (item in document.deleted or item in document.deleted_layers)


def _born_layer(layer_id: str, **fields: Any) -> c.Layer:
    facts = c.GridFacts(rows=9, cols=9, low_m=-10.0, high_m=900.0)
    given: dict[str, Any] = {"content": "0" * 64, "facts": facts, "anchor": (0.0, 0.0), "spacing_m": (1.0, 2.0)}
    return c.Layer(id=layer_id, **(given | {"accuracy_m": 1.0} | fields))


def _laid(document: StrokeSet) -> list[dict[str, object]]:
    """All that the base follows from (SPEC D30), by id."""
    some = [layer.model_dump(exclude=set(CREDIT_FIELDS)) for layer in document.layers.values() if not layer.hidden]
    return sorted(some, key=lambda layer: str(layer["id"]))


def _returned(op: c.Op) -> bool:
    """A group may change the ground and change it back: a new object for the same ground is no mistake."""
    return isinstance(op, c.Group)


def _try(document: StrokeSet, op: c.Op) -> StrokeSet | None:
    try:
        return document.apply(op, LIMITS)[0]
    except Refusal:
        return None


def _apply(document: StrokeSet, op: c.Op) -> tuple[StrokeSet, Rect | None] | Refusal:
    try:
        return document.apply(op, LIMITS)
    except Refusal as refusal:
        return refusal


class Session(RuleBasedStateMachine):
    """Three people on one document, each with an undo stack."""

    @initialize()
    def start(self) -> None:
        born = (c.Stroke(id=i, kind="profile", first=(0, 0, 0), last=(9, 9, 9), curve=((0, 0),)) for i in IDS[:3])
        laid = {i: _born_layer(i, hidden=i == "v1") for i in LAYER_IDS}
        self.document = StrokeSet(
            "t",
            strokes={stroke.id: stroke for stroke in born},
            layers={i: laid[i] for i in LAYER_IDS[:2]},
            deleted_layers={LAYER_IDS[2]: laid[LAYER_IDS[2]]},
        )
        self.stacks = {name: UndoStack() for name in PEOPLE}
        self.claims: dict[tuple[str, str], set[str]] = {}
        """Who ever gave a field this value, by their own hand or by taking something back."""

    def _note(self, who: str, before: StrokeSet, after: StrokeSet) -> None:
        old, new = _state(before), _state(after)
        for key in old.keys() | new.keys():
            if old.get(key) != new.get(key):
                self.claims.setdefault((key, repr(new.get(key))), set()).add(who)

    @rule(who=st.sampled_from(PEOPLE), op=ops, gesture=st.sampled_from((None, "g1", "g2")))
    def act(self, who: str, op: c.Op, gesture: str | None) -> None:
        before = self.document
        frozen = before.to_document()
        applied = _apply(before, op)
        assert before.to_document() == frozen, "apply never changes its operand, refused or not"
        if isinstance(applied, Refusal):
            assert len(applied.message) > 10
            return
        after, dirty = applied
        assert after.clock == before.clock + 1
        self._check_dirty(before, after, dirty)
        assert (before.layers_rev == after.layers_rev) == (_laid(before) == _laid(after)) or _returned(op)
        self.stacks[who].record(before, op, after, gesture)
        self._note(who, before, after)
        self.document = after

    def _check_dirty(self, before: StrokeSet, after: StrokeSet, dirty: Rect | None) -> None:
        """Whatever constrains the ground differently lies in the dirty rectangle."""
        for stroke in before.strokes.keys() | after.strokes.keys():
            old, new = before.strokes.get(stroke), after.strokes.get(stroke)
            if old is not None and new is not None and all(getattr(old, n) == getattr(new, n) for n in GROUND_FIELDS):
                continue
            if any(s is not None and not s.hidden and s.curve for s in (old, new)):
                assert after.channels_rev != before.channels_rev
            if (old or new).kind == "paint":  # type: ignore[union-attr]
                continue
            if old is not None and new is not None and all(getattr(old, n) == getattr(new, n) for n in HEIGHT_FIELDS):
                continue
            for rect in (bounds(s) for s in (old, new) if s is not None):
                if rect is not None:
                    assert dirty is not None
                    assert dirty.x0 <= rect.x0
                    assert dirty.y0 <= rect.y0
                    assert dirty.x1 >= rect.x1
                    assert dirty.y1 >= rect.y1

    @rule(who=st.sampled_from(PEOPLE), stroke=stroke_id, name=st.sampled_from(("label", "first")), n=st.integers(0, 2))
    def contend(self, who: str, stroke: str, name: str, n: int) -> None:
        """Few fields, few values: people get in each other's way."""
        value: object = str(n) if name == "label" else (float(n), 0.0, 0.0)
        self.act(who, c.SetStroke(stroke=stroke, fields=c.StrokeFields.model_validate({name: value})), None)

    @rule(who=st.sampled_from(PEOPLE), op=layer_ops)
    def lay(self, who: str, op: c.Op) -> None:
        self.act(who, op, None)

    @rule(who=st.sampled_from(PEOPLE), redo=st.booleans())
    def travel(self, who: str, redo: bool) -> None:
        before = self.document
        stack = self.stacks[who]
        plan = stack.redo(before) if redo else stack.undo(before)
        after = before
        for op in plan.ops:
            after, _ = after.apply(op)  # limits of the room may refuse a restore; the plan itself must be sound
        old, new = _state(before), _state(after)
        for key in old.keys() & new.keys():
            if old[key] != new[key] and not key.endswith(".state"):
                claimed = self.claims.get((key, repr(old[key])), set())
                assert who in claimed, f"{who} took back {key} = {old[key]}, which {claimed or 'nobody'} wrote"
        if len(after.strokes) > LIMITS.strokes or len(after.layers) > LIMITS.layers:
            return
        self._note(who, before, after)
        self.document = after

    @invariant()
    def sound(self) -> None:
        if not hasattr(self, "document"):
            return
        assert not self.document.strokes.keys() & self.document.deleted.keys()
        assert len(self.document.strokes) <= LIMITS.strokes
        assert not self.document.layers.keys() & self.document.deleted_layers.keys()
        assert len(self.document.layers) <= LIMITS.layers
        assert all(len(s.curve) <= LIMITS.points for s in self.document.strokes.values())
        text = self.document.to_document().model_dump_json()
        assert StrokeSet.from_document(c.Document.model_validate_json(text)) == self.document


Session.TestCase.settings = settings(
    max_examples=120, stateful_step_count=30, deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
TestSession = Session.TestCase


@pytest.mark.parametrize("seed", range(40))
def test_contention(seed: int) -> None:
    """The same rules at random, but denser than a search for small examples makes them."""
    rng = random.Random(seed)
    session = Session()
    session.start()
    for n in range(150):
        who, stroke = rng.choice(PEOPLE), rng.choice(IDS[:2])
        roll = rng.random()
        if roll < 0.3:
            session.travel(who, redo=rng.random() < 0.3)
        elif roll < 0.8:
            session.contend(who, stroke, rng.choice(("label", "first")), n)
        else:
            name = rng.choice(("delete", "restore", "lock", "begin"))
            born = c.Stroke(id=f"n{n}", kind="level", first=(n, 0, 0), last=(1, 1, 1), curve=())
            choices: dict[str, c.Op] = {
                "delete": c.DeleteStroke(stroke=stroke),
                "restore": c.RestoreStroke(stroke=stroke),
                "lock": c.SetStroke(stroke=stroke, fields=c.StrokeFields(locked=rng.random() < 0.3)),
                "begin": c.BeginStroke(stroke=born),
            }
            session.act(who, choices[name], rng.choice((None, "g")))
        session.sound()
