"""Cases of ``StrokeSet.apply``: every op, every refusal that a small document can show (SPEC D25, D27 to D29, D401)."""

from __future__ import annotations

import json
from typing import Any

from esker import contract as c
from esker.document.ops import Refusal, StrokeSet
from tests.vectors.scenes import Json, document, dump, layer, op, stroke

RIDGE = stroke("a")
MESA = stroke("m", kind="level", first=[1000, 1000, 120], last=[1500, 1000, 120], curve=[[0, 0], [0.5, 0.25], [1, 0]])
LOCKED = stroke("l", locked=True, label="Grandmother's hill")
GONE = stroke("g", label="gone")
LONG = stroke("x", curve=[[0.5, 1]] * c.MAX_POINTS_PER_STROKE)
BASE = document(RIDGE, MESA, LOCKED, deleted=(GONE,))
SNOW: Json = {"channel": "snow", "value": 1.0, "radius_m": 80.0}
PAINTED = stroke(
    "p", kind="paint", first=[500, 500, 0], last=[900, 700, 0], curve=[[0, 0], [0.5, 0.1], [1, 0]], paint=SNOW
)
RUN: Json = {"use": "river", "rises": [0.0, -4.5, -4.5], "depth_m": 3.0}
RIVER = stroke(
    "r", kind="course", first=[500, 500, 90], last=[900, 700, 80], curve=[[0, 0], [0.5, 0.1], [1, 0], [1.5, 0]],
    course=RUN, left=None, right={"slope_deg": None, "extent_m": 40},
)  # fmt: skip
VALLEY = layer("v")
CRATER = layer("k", name="crater 2004", priority=2, spacing_m=[2, 2], hidden=True)
LOST = layer("d", name="lost")
LAID = document(RIDGE, layers=(VALLEY, CRATER), deleted_layers=(LOST,))
FULL = document(layers=tuple(layer(f"f{i}") for i in range(c.MAX_LAYERS)), deleted_layers=(LOST,))
TASK: Json = {
    "title": "Dam the valley",
    "text": "Hold water.\n\nWhere is it cheapest?",
    "goal": {"type": "volume", "point": [900.0, 700.5], "level_m": 120.0, "at_least_m3": 2e6},
    "difference": True,
}
NEW = stroke("n", curve=[], finished=False, first=[0, 0, 0], last=[0, 0, 0])


def _applies() -> list[tuple[str, Json, Json]]:
    """(name, document, op) of cases that must apply."""
    set_ = "stroke.set"
    return [
        ("begin on an empty terrain", document(), op("stroke.begin", stroke=NEW)),
        (
            "append continues the curve",
            BASE,
            op("stroke.append", stroke="a", start=3, points=[[1.25, 3]], last=[9, 9, 9]),
        ),
        (
            "append replaces the tail",
            BASE,
            op("stroke.append", stroke="a", start=1, points=[[0.3, 2]], last=[3500, 1, 0]),
        ),
        ("append replaces everything", BASE, op("stroke.append", stroke="a", start=0, points=[[0, 1]], last=[1, 2, 3])),
        (
            "append of no points cuts the curve",
            BASE,
            op("stroke.append", stroke="a", start=2, points=[], last=[1, 2, 3]),
        ),
        ("finish", document(NEW), op("stroke.finish", stroke="n")),
        ("finish twice changes nothing", BASE, op("stroke.finish", stroke="a")),
        ("finish works on a locked stroke", BASE, op("stroke.finish", stroke="l")),
        ("set one field", BASE, op(set_, stroke="a", fields={"label": "Äskulap — 山"})),
        (
            "set many fields",
            BASE,
            op(set_, stroke="m", fields={"plateau_radius_m": 40.5, "hidden": True, "roughness": 1, "yields": 0.25}),
        ),
        (
            "a label loses what nobody sees and what turns text around",
            BASE,
            op(
                set_,
                stroke="a",
                fields={"label": "a\u202eb\u0007c\n\td\u200be \u2067f\u2069 \U0001f469\u200d\U0001f33e \u200f\u05d0"},
            ),
        ),
        (
            "so do names of a new stroke",
            BASE,
            op("stroke.begin", stroke=NEW | {"author": "A\u202eda\u0000", "label": "\ufeffHill\u2028"}),
        ),
        ("and the title", BASE, op("terrain.set", fields={"title": "T\u2066o\u007fr"})),
        ("and a layer's", LAID, op("layer.set", layer="v", fields={"name": "T\u061cal", "source": "a\r\nb"})),
        ("set no field", BASE, op(set_, stroke="a", fields={})),
        ("a mountain has null for paint", BASE, op(set_, stroke="a", fields={"label": "x", "paint": None})),
        ("null flank means no flank", BASE, op(set_, stroke="a", fields={"left": None})),
        (
            "set a flank",
            BASE,
            op(set_, stroke="a", fields={"right": {"slope_deg": 60, "extent_m": 1, "shape": "convex"}}),
        ),
        ("set the whole curve", BASE, op(set_, stroke="a", fields={"curve": [[0, 0.5], [1, 0.5]]})),
        ("lock", BASE, op(set_, stroke="a", fields={"locked": True})),
        ("unlock alone", BASE, op(set_, stroke="l", fields={"locked": False})),
        ("anchor first", BASE, op("stroke.anchor", stroke="a", which="first", to=[0.125, -3, 7])),
        ("anchor last", BASE, op("stroke.anchor", stroke="m", which="last", to=[1500.5, 1400, 99])),
        ("delete keeps a tombstone", BASE, op("stroke.delete", stroke="a")),
        ("restore", BASE, op("stroke.restore", stroke="g")),
        ("terrain title", BASE, op("terrain.set", fields={"title": "Tor"})),
        ("terrain reach null is infinity", BASE, op("terrain.set", fields={"reach_m": None, "border": "pinned"})),
        ("terrain sea on", BASE, op("terrain.set", fields={"sea_level_m": 12.5, "look": "desert", "seed": 4294967295})),
        ("terrain sea off", document(sea_level_m=3), op("terrain.set", fields={"sea_level_m": None})),
        ("terrain lakes on", BASE, op("terrain.set", fields={"lakes_m": 4.0})),
        ("terrain rivers on", BASE, op("terrain.set", fields={"rivers": 1.5, "wetness": 3.0})),
        ("terrain rivers off", document(rivers=1.0), op("terrain.set", fields={"rivers": 0.0})),
        ("a task", BASE, op("terrain.set", fields={"task": TASK})),
        (
            "a task whose text hides nothing",
            BASE,
            op("terrain.set", fields={"task": TASK | {"title": "Dam\u202e\t1", "text": "One.\r\n\u200bTwo.\tThree"}}),
        ),
        ("no task", document(task=TASK), op("terrain.set", fields={"task": None, "task_pictures": []})),
        ("terrain lakes off", document(lakes_m=4.0), op("terrain.set", fields={"lakes_m": None})),
        ("terrain sun", BASE, op("terrain.set", fields={"sun_azimuth_deg": 0, "sun_elevation_deg": 90})),
        ("group is one tick", BASE, op("group", ops=[_set("a", label="1"), _set("m", label="2")])),
        (
            "group sees its own effects",
            BASE,
            op("group", ops=[_set("l", locked=False), op("stroke.delete", stroke="l")]),
        ),
        ("group begin and fill", BASE, op("group", ops=[op("stroke.begin", stroke=NEW), _append("n"), _finish("n")])),
        ("point at the bound", document(NEW), op("stroke.anchor", stroke="n", which="last", to=[40960, -40960, 40960])),
        ("begin paint", BASE, op("stroke.begin", stroke=PAINTED)),
        (
            "append to paint",
            document(PAINTED),
            op("stroke.append", stroke="p", start=3, points=[[1.5, -0.25]], last=[950, 700, 0]),
        ),
        (
            "set paint",
            document(PAINTED),
            op(set_, stroke="p", fields={"paint": {"channel": "wetness", "value": -0.5, "radius_m": 12}}),
        ),
        ("begin a river whose last points have one height", BASE, op("stroke.begin", stroke=RIVER)),
        (
            "append to a river",
            document(RIVER),
            op("stroke.append", stroke="r", start=4, points=[[2, 0.5]], last=[950, 700, 80]),
        ),
        (
            "a river becomes a road that rises",
            document(RIVER),
            _set("r", course=RUN | {"use": "road", "rises": [0, 9]}),
        ),
        ("a course without heights", BASE, op("stroke.begin", stroke=RIVER | {"course": {"use": "ridge"}})),
        ("delete paint", document(PAINTED), op("stroke.delete", stroke="p")),
        ("terrain detail and rule", BASE, op("terrain.set", fields={"detail": 2.5, "rule": "plain"})),
        ("exactly the most points", document(NEW), op("stroke.begin", stroke=LONG)),
    ]


def _layer_applies() -> list[tuple[str, Json, Json]]:
    add, set_ = "layer.add", "layer.set"
    return [
        ("lay a grid", document(), op(add, layer=VALLEY)),
        ("lay a grid beside others", LAID, op(add, layer=layer("n", scale=0.3048, lift_m=-40, outline=0))),
        ("name a layer", LAID, op(set_, layer="v", fields={"name": "Tal — 谷", "source": "USGS", "licence": "CC0"})),
        (
            "move and turn a layer",
            LAID,
            op(set_, layer="v", fields={"anchor": [-100, 0.125], "rotation_deg": -33.5, "spacing_m": [11, 13]}),
        ),
        (
            "weigh a layer",
            LAID,
            op(set_, layer="k", fields={"priority": -7, "accuracy_m": 3, "hidden": False, "outline": 1}),
        ),
        ("scale and lift a layer", LAID, op(set_, layer="v", fields={"scale": -2, "lift_m": 1000})),
        ("set nothing of a layer", LAID, op(set_, layer="v", fields={})),
        ("delete a layer", LAID, op("layer.delete", layer="v")),
        ("restore a layer", LAID, op("layer.restore", layer="d")),
        (
            "delete and restore a layer as one",
            LAID,
            op("group", ops=[op("layer.delete", layer="v"), op("layer.restore", layer="v")]),
        ),
        (
            "strokes and layers in one group",
            LAID,
            op("group", ops=[_set("a", label="dam"), _lay("v", hidden=True), op("stroke.delete", stroke="a")]),
        ),
        ("deleting forgets the oldest tombstone", _graves(), op("layer.delete", layer="v")),
        ("layer as high as may be", LAID, _lay("v", scale=1, lift_m=5 * 4096 - 840)),
        ("place on Earth", BASE, op("terrain.set", fields={"place": {"lat_deg": 46.2, "lon_deg": -122.18}})),
        ("no place on Earth", document(place={"lat_deg": 1, "lon_deg": 2}), op("terrain.set", fields={"place": None})),
    ]


def _layer_refuses() -> list[tuple[str, Json, Json, str]]:
    add = "layer.add"
    return [
        ("lay a grid twice", LAID, op(add, layer=VALLEY), "duplicate_layer"),
        ("lay a grid with the id of a deleted one", LAID, op(add, layer=LOST), "duplicate_layer"),
        ("one layer too many", FULL, op(add, layer=VALLEY), "too_many_layers"),
        ("restore one layer too many", FULL, op("layer.restore", layer="d"), "too_many_layers"),
        ("lay a grid too high", document(), op(add, layer=VALLEY | {"scale": 1000}), "out_of_domain"),
        ("lift a layer too high", LAID, _lay("v", lift_m=5 * 4096 - 839), "out_of_domain"),
        ("sink a layer too low", LAID, _lay("v", lift_m=-5 * 4096 - 13), "out_of_domain"),
        ("set on no layer", LAID, _lay("zz", name="x"), "unknown_layer"),
        ("set on a deleted layer", LAID, _lay("d", name="x"), "deleted_layer"),
        ("set a layer's name to null", LAID, _lay("v", name=None), "bad_field"),
        ("a stroke is no layer", LAID, op("layer.delete", layer="a"), "unknown_layer"),
        ("a layer is no stroke", LAID, op("stroke.delete", stroke="v"), "unknown_stroke"),
        ("delete no layer", LAID, op("layer.delete", layer="zz"), "unknown_layer"),
        ("delete a layer twice", LAID, op("layer.delete", layer="d"), "deleted_layer"),
        ("restore a live layer", LAID, op("layer.restore", layer="v"), "duplicate_layer"),
        ("restore no layer", LAID, op("layer.restore", layer="zz"), "unknown_layer"),
        (
            "a group with a bad layer does nothing",
            LAID,
            op("group", ops=[_set("a", label="1"), _lay("zz", name="2")]),
            "unknown_layer",
        ),
    ]


def _lay(layer_id: str, **fields: Any) -> Json:
    return op("layer.set", layer=layer_id, fields=fields)


def _graves() -> Json:
    return document(layers=(VALLEY,), deleted_layers=tuple(layer(f"f{i}") for i in range(c.MAX_LAYERS)))


def _refuses() -> list[tuple[str, Json, Json, str]]:
    """(name, document, op, code) of cases that must be refused."""
    return [
        ("begin twice", BASE, op("stroke.begin", stroke=RIDGE), "duplicate_stroke"),
        ("begin with the id of a deleted stroke", BASE, op("stroke.begin", stroke=GONE), "duplicate_stroke"),
        ("append to nothing", BASE, _append("zz"), "unknown_stroke"),
        ("append to a deleted stroke", BASE, _append("g"), "deleted_stroke"),
        ("append to a locked stroke", BASE, _append("l"), "locked_stroke"),
        (
            "append leaves a gap",
            BASE,
            op("stroke.append", stroke="a", start=4, points=[[1, 1]], last=[1, 1, 1]),
            "bad_index",
        ),
        (
            "append too far",
            BASE,
            op("stroke.append", stroke="a", start=3, points=[[14, 0]], last=[3500, 2000, 0]),
            "out_of_domain",
        ),
        (
            "append one too many",
            document(LONG),
            op("stroke.append", stroke="x", start=4096, points=[[1, 1]], last=[3500, 2000, 0]),
            "too_many_points",
        ),
        ("finish nothing", BASE, _finish("zz"), "unknown_stroke"),
        ("finish a deleted stroke", BASE, _finish("g"), "deleted_stroke"),
        ("set on nothing", BASE, _set("zz", label="x"), "unknown_stroke"),
        ("set on a deleted stroke", BASE, _set("g", label="x"), "deleted_stroke"),
        ("set on a locked stroke", BASE, _set("l", label="x"), "locked_stroke"),
        ("unlock together with a change", BASE, _set("l", locked=False, label="x"), "locked_stroke"),
        ("null where a value is needed", BASE, _set("a", label=None), "bad_field"),
        (
            "anchor of a locked stroke",
            BASE,
            op("stroke.anchor", stroke="l", which="last", to=[0, 0, 0]),
            "locked_stroke",
        ),
        ("paint without paint", BASE, op("stroke.begin", stroke=PAINTED | {"paint": None}), "bad_field"),
        ("a mountain with paint", BASE, op("stroke.begin", stroke=NEW | {"paint": SNOW}), "bad_field"),
        ("paint set on a mountain", BASE, _set("a", paint=SNOW), "bad_field"),
        ("paint taken from a paint stroke", document(PAINTED), _set("p", paint=None), "bad_field"),
        ("a course without course", BASE, op("stroke.begin", stroke=RIVER | {"course": None}), "bad_field"),
        ("a mountain with a course", BASE, _set("a", course=RUN), "bad_field"),
        ("a river that rises", document(RIVER), _set("r", course=RUN | {"rises": [0, -5, -4]}), "bad_field"),
        (
            "a course of too many points",
            document(RIVER),
            _set("r", curve=[[0, 0]] * (c.MAX_COURSE_POINTS + 1)),
            "bad_field",
        ),
        ("a course too high", document(RIVER), _set("r", course={"use": "ridge", "rises": [40960]}), "out_of_domain"),
        ("paint too far", document(PAINTED), _set("p", curve=[[200, 0]]), "out_of_domain"),
        ("terrain detail null", BASE, op("terrain.set", fields={"detail": None}), "bad_field"),
        ("anchor too far", BASE, op("stroke.anchor", stroke="a", which="last", to=[40961, 0, 0]), "out_of_domain"),
        ("anchor too high", BASE, op("stroke.anchor", stroke="a", which="last", to=[0, 0, 40961]), "out_of_domain"),
        ("curve point too high", BASE, _set("a", curve=[[0, 50000]]), "out_of_domain"),
        ("delete nothing", BASE, op("stroke.delete", stroke="zz"), "unknown_stroke"),
        ("delete twice", BASE, op("stroke.delete", stroke="g"), "deleted_stroke"),
        ("delete a locked stroke", BASE, op("stroke.delete", stroke="l"), "locked_stroke"),
        ("restore a live stroke", BASE, op("stroke.restore", stroke="a"), "duplicate_stroke"),
        ("restore nothing", BASE, op("stroke.restore", stroke="zz"), "unknown_stroke"),
        ("terrain title null", BASE, op("terrain.set", fields={"title": None}), "bad_field"),
        (
            "group is all or nothing",
            BASE,
            op("group", ops=[_set("a", label="1"), _set("zz", label="2")]),
            "unknown_stroke",
        ),
    ]


def _set(stroke_id: str, **fields: Any) -> Json:
    return op("stroke.set", stroke=stroke_id, fields=fields)


def _append(stroke_id: str) -> Json:
    return op("stroke.append", stroke=stroke_id, start=0, points=[[0, 0], [1, 2.5]], last=[100, 200, 30])


def _finish(stroke_id: str) -> Json:
    return op("stroke.finish", stroke=stroke_id)


def op_vectors() -> list[Json]:
    """All cases; raises AssertionError when the implementation disagrees with the outcome named here."""
    out: list[Json] = []
    for name, before, raw in (*_applies(), *_layer_applies()):
        after, _ = _set_of(before).apply(c.OP.validate_json(json.dumps(raw)))
        out.append({"name": name, "document": before, "op": raw, "result": dump(after.to_document())})
    for name, before, raw, code in (*_refuses(), *_layer_refuses()):
        assert _refusal(before, raw) == code, name
        out.append({"name": name, "document": before, "op": raw, "refusal": code})
    return out


def _refusal(before: Json, raw: Json) -> str | None:
    try:
        _set_of(before).apply(c.OP.validate_json(json.dumps(raw)))
    except Refusal as refusal:
        return refusal.code
    return None


def _set_of(raw: Json) -> StrokeSet:
    return StrokeSet.from_document(c.Document.model_validate_json(json.dumps(raw)))
