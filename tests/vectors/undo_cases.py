"""Scripts of one person's undo stack while others work on the same document (SPEC D23, D24).

A step is one of ``{"mine": op, "gesture": token or null}``, ``{"theirs": op}``, and ``{"undo": {"ops", "skipped"}}`` or
``{"redo": ...}`` with what must come out; the ops that come out are applied to the document.
"""

from __future__ import annotations

import json
from typing import Any

from esker import contract as c
from esker.document.ops import StrokeSet
from esker.document.undo import UndoStack
from tests.vectors.op_cases import BASE, GONE, LAID, NEW, PAINTED, SNOW, _append, _finish, _lay, _set
from tests.vectors.scenes import Json, document, dump, layer, op

UNDO: Json = {"undo": None}
REDO: Json = {"redo": None}


def mine(raw: Json, gesture: str | None = None) -> Json:
    return {"mine": raw, "gesture": gesture}


def theirs(raw: Json) -> Json:
    return {"theirs": raw}


def _anchor(x: float, which: str = "last") -> Json:
    return op("stroke.anchor", stroke="a", which=which, to=[x, 10, 0])


DRAW = [mine(op("stroke.begin", stroke=NEW), "d1"), mine(_append("n"), "d1"), mine(_finish("n"), "d1")]
DRAG = [mine(_anchor(x), "drag") for x in (3400, 3300, 3200)]
DELETE = op("stroke.delete", stroke="a")
RESTORE = op("stroke.restore", stroke="g")

LAY = mine(op("layer.add", layer=layer("n")))
SHIFT = [mine(_lay("v", anchor=[x, 0]), "shift") for x in (1, 2, 3)]

LAYER_SCRIPTS: list[tuple[str, Json, list[Json]]] = [
    ("a laid grid", LAID, [LAY, UNDO, REDO, UNDO]),
    ("a laid grid that somebody moved is kept", LAID, [LAY, theirs(_lay("n", rotation_deg=3)), UNDO]),
    ("a laid grid that somebody deleted", LAID, [LAY, theirs(op("layer.delete", layer="n")), UNDO]),
    ("a laid grid and its first move", LAID, [LAY, mine(_lay("n", lift_m=4)), UNDO, UNDO, REDO, REDO]),
    ("a layer's drag is one step", LAID, [*SHIFT, UNDO, REDO]),
    ("others' other field of the layer is untouched", LAID, [*SHIFT, theirs(_lay("v", name="x")), UNDO, REDO]),
    ("others' same field of the layer is kept", LAID, [*SHIFT, theirs(_lay("v", anchor=[9, 9])), UNDO, REDO]),
    ("a drag of a layer that somebody deleted", LAID, [*SHIFT, theirs(op("layer.delete", layer="v")), UNDO]),
    ("delete a layer and undo", LAID, [mine(op("layer.delete", layer="v")), UNDO, REDO, UNDO]),
    (
        "delete a layer, restored by another",
        LAID,
        [mine(op("layer.delete", layer="v")), theirs(op("layer.restore", layer="v")), UNDO],
    ),
    (
        "restore a layer, change it, undo as one gesture",
        LAID,
        [mine(op("layer.restore", layer="d"), "r"), mine(_lay("d", hidden=True, outline=0.5), "r"), UNDO, REDO],
    ),
    (
        "strokes and layers in one step",
        LAID,
        [mine(op("group", ops=[_lay("v", hidden=True), _set("a", label="x"), _lay("k", priority=9)])), UNDO, REDO],
    ),
    (
        "place on Earth",
        LAID,
        [mine(op("terrain.set", fields={"place": {"lat_deg": 46.2, "lon_deg": -122.18}})), UNDO, REDO],
    ),
]

SCRIPTS: list[tuple[str, Json, list[Json]]] = [
    ("nothing to undo", BASE, [UNDO, REDO]),
    ("a drawn stroke is one step", BASE, [*DRAW, UNDO, REDO, UNDO]),
    ("a drawn stroke that somebody changed is kept", BASE, [*DRAW, theirs(_set("n", label="ours")), UNDO, UNDO]),
    ("a drawn stroke that somebody deleted", BASE, [*DRAW, theirs(op("stroke.delete", stroke="n")), UNDO]),
    ("a cancelled stroke leaves no step", BASE, [*DRAW[:2], mine(op("stroke.delete", stroke="n"), "d1"), UNDO]),
    ("a drag is one step", BASE, [*DRAG, UNDO, REDO]),
    ("others' other field is untouched", BASE, [*DRAG, theirs(_set("a", label="theirs")), UNDO, REDO]),
    ("others' same field is kept", BASE, [*DRAG, theirs(_anchor(1)), UNDO, REDO]),
    (
        "one field kept, one undone",
        BASE,
        [mine(_set("a", label="1", hidden=True)), theirs(_set("a", label="2")), UNDO, REDO],
    ),
    ("another's change in the midst of my drag", BASE, [DRAG[0], theirs(_set("a", label="x")), *DRAG[1:], UNDO]),
    ("delete and undo", BASE, [mine(DELETE), UNDO, REDO, UNDO]),
    ("delete, restored by another", BASE, [mine(DELETE), theirs(op("stroke.restore", stroke="a")), UNDO]),
    ("restore and undo", BASE, [mine(RESTORE), UNDO, REDO]),
    ("restore, changed by another", BASE, [mine(RESTORE), theirs(_set("g", roughness=0)), UNDO]),
    ("change of a stroke that another deleted", BASE, [*DRAG, theirs(DELETE), UNDO]),
    ("lock and undo", BASE, [mine(_set("a", locked=True)), UNDO, REDO]),
    (
        "unlock, change, undo as one gesture",
        BASE,
        [mine(_set("l", locked=False), "u"), mine(_set("l", label="x"), "u"), UNDO, REDO],
    ),
    (
        "change and lock as one gesture",
        BASE,
        [mine(_set("a", label="x"), "u"), mine(_set("a", locked=True), "u"), UNDO, REDO],
    ),
    ("another locked it", BASE, [*DRAG, theirs(_set("a", locked=True)), UNDO]),
    ("terrain settings", BASE, [mine(op("terrain.set", fields={"title": "A", "seed": 5})), UNDO, REDO]),
    (
        "terrain title changed by another",
        BASE,
        [
            mine(op("terrain.set", fields={"title": "A", "seed": 5})),
            theirs(op("terrain.set", fields={"title": "B"})),
            UNDO,
        ],
    ),
    (
        "reach back from infinity",
        document(reach_m=100),
        [mine(op("terrain.set", fields={"reach_m": None})), UNDO, REDO],
    ),
    (
        "strength and rule of the detail",
        BASE,
        [
            mine(op("terrain.set", fields={"detail": 0, "rule": "smooth"})),
            theirs(op("terrain.set", fields={"rule": "plain"})),
            UNDO,
            REDO,
        ],
    ),
    (
        "painted, then another channel",
        document(),
        [
            mine(op("stroke.begin", stroke=PAINTED)),
            mine(_set("p", paint=SNOW | {"channel": "forest"})),
            UNDO,
            UNDO,
            REDO,
        ],
    ),
    (
        "paint that somebody changed is kept",
        document(PAINTED),
        [mine(_set("p", paint=SNOW | {"value": -1.0})), theirs(_set("p", paint=SNOW | {"radius_m": 9.0})), UNDO],
    ),
    ("null flank comes back", BASE, [mine(_set("a", left=None)), UNDO]),
    (
        "a group is one step",
        BASE,
        [mine(op("group", ops=[_set("a", label="1"), _set("m", label="2"), RESTORE])), UNDO, REDO],
    ),
    (
        "a group with one part kept",
        BASE,
        [mine(op("group", ops=[_set("a", label="1"), _set("m", label="2")])), theirs(_set("m", label="3")), UNDO],
    ),
    ("no effect, no step", BASE, [mine(_set("a", label="x")), mine(_set("m", label="")), UNDO]),
    ("a new op clears redo", BASE, [mine(_set("a", label="x")), UNDO, mine(_set("a", label="y")), REDO, UNDO]),
    (
        "steps come back in reverse order",
        BASE,
        [mine(_set("a", label="1")), mine(_set("a", label="2")), UNDO, UNDO, REDO, REDO],
    ),
    ("different gestures are different steps", BASE, [mine(_anchor(1), "p"), mine(_anchor(2), "q"), UNDO, UNDO]),
    ("no gesture never merges", BASE, [mine(_set("a", label="1")), mine(_set("a", label="2")), UNDO]),
    (
        "append on a finished stroke",
        BASE,
        [mine(op("stroke.append", stroke="a", start=2, points=[[0.75, 60], [1, 1]], last=[3000, 2000, 0])), UNDO, REDO],
    ),
    (
        "a long curve comes back by appends",
        document(*(s for s in BASE["strokes"]), NEW | {"curve": [[0.25, 1]] * 1100}),
        [mine(_set("n", curve=[[0, 0]])), UNDO],
    ),
    (
        "deleted stroke that is gone for good",
        document(deleted=(GONE,)),
        [mine(RESTORE), theirs(op("stroke.delete", stroke="g")), UNDO],
    ),
]


def undo_vectors() -> list[Json]:
    """Runs every script and writes down what comes out."""
    return [_run(name, raw, script) for name, raw, script in (*SCRIPTS, *LAYER_SCRIPTS)]


def _run(name: str, raw: Json, script: list[Json]) -> Json:
    present = StrokeSet.from_document(c.Document.model_validate_json(json.dumps(raw)))
    stack = UndoStack()
    steps: list[Json] = []
    for step in script:
        if "undo" in step or "redo" in step:
            kind = "undo" if "undo" in step else "redo"
            plan = stack.undo(present) if kind == "undo" else stack.redo(present)
            for planned in plan.ops:
                present, _ = present.apply(planned)
            steps.append({kind: {"ops": [_dump_op(o) for o in plan.ops], "skipped": list(plan.skipped)}})
            continue
        parsed = c.OP.validate_json(json.dumps(step.get("mine", step.get("theirs"))))
        after, _ = present.apply(parsed)
        if "mine" in step:
            stack.record(present, parsed, after, step["gesture"])
        present = after
        steps.append(step)
    return {"name": name, "document": raw, "steps": steps, "result": dump(present.to_document())}


def _dump_op(value: c.Op) -> Json:
    """An op as it is sent: type always, other fields only where they are set."""
    out: Any = c.OP.dump_python(value, mode="json", exclude_unset=True)
    return _typed(value, out)


def _typed(value: c.Op, out: Json) -> Json:
    out = {"type": value.type, **out}
    if isinstance(value, c.Group):
        out["ops"] = [_typed(part, dumped) for part, dumped in zip(value.ops, out["ops"], strict=True)]
    return out
