"""Texts that a client may send, each accepted or refused by the contract (SPEC P1, D310)."""

from __future__ import annotations

import json
from typing import Any

from pydantic import ValidationError

from esker import contract as c
from tests.vectors.op_cases import NEW, PAINTED, SNOW, VALLEY
from tests.vectors.scenes import Json, op

HELLO: Json = {"type": "hello", "protocol": c.PROTOCOL_VERSION, "terrain": "t1", "secret": "s", "client": "c1"}
VIEW: Json = {"type": "view", "eye": [0, 0, 100], "target": [1, 1, 0]}
GROUPING: Json = {"type": "grouping", "group": "g1"}
PRESENCE: Json = {"type": "presence", "cursor": [1, 2, 3.5], "tool": "mountain", "stroke": "c1-1"}


def ops(*raw: Json) -> Json:
    return {"type": "ops", "ops": [{"id": f"c1:{i}", "op": o} for i, o in enumerate(raw)]}


def _set(**fields: Any) -> Json:
    return op("stroke.set", stroke="a", fields=fields)


def _lay(**fields: Any) -> Json:
    return op("layer.set", layer="v", fields=fields)


TARGET: Json = {"size_m": 4096, "level": 2, "low_m": -10.5, "step_m": 0.25, "data": "eJwDAAAAAAE="}
GOALS: list[Json] = [
    {"type": "terrain", "target": TARGET, "tolerance_m": 20},
    {"type": "contours", "target": TARGET, "tolerance_m": 20, "interval_m": 50},
    {"type": "profile", "first": [0, 0], "last": [4096, 4096], "heights": [0, 900.5, 12], "tolerance_m": 15},
    {"type": "volume", "point": [900, 700], "level_m": 120, "at_least_m3": 2e6},
    {"type": "slope", "path": [[0, 0], [100, 50], [300, 0]], "at_most": 0.08},
    {"type": "area", "level_m": 5, "at_least_m2": 1e6, "dry": True},
    {"type": "watershed", "point": [900, 700], "at_least_m2": 1e6},
]


def _task(**fields: Any) -> Json:
    return op("terrain.set", fields={"task": fields})


ACCEPT: list[tuple[str, Json]] = [
    ("hello, short", HELLO),
    ("hello, full", HELLO | {"name": "Ada", "colour": "#00ffaa", "clock": 12}),
    ("hello with a token", HELLO | {"token": "18f." + "0a" * 32}),
    ("hello of another protocol is well formed", HELLO | {"protocol": 99}),
    ("ops", ops(op("stroke.begin", stroke=NEW), op("stroke.finish", stroke="n"))),
    ("group", ops(op("group", ops=[_set(label="x"), op("stroke.delete", stroke="a")]))),
    ("null flank", ops(_set(left=None))),
    ("integers where floats are expected", ops(op("stroke.anchor", stroke="a", which="last", to=[1, 2, 3]))),
    ("view, short", VIEW),
    ("view, full", VIEW | {"fov_deg": 60, "width": 360, "height": 740, "tau_px": 2}),
    ("presence", PRESENCE),
    ("presence, empty", {"type": "presence"}),
    ("paint", ops(op("stroke.begin", stroke=PAINTED), _set(paint=SNOW | {"radius_m": 0}))),
    ("strength and rule of the detail", ops(op("terrain.set", fields={"detail": 4, "rule": "smooth"}))),
    ("layer ops", ops(op("layer.delete", layer="v"), op("layer.restore", layer="v"), _lay(anchor=[1, 2], outline=0))),
    ("a layer, which the server refuses by name", ops(op("layer.add", layer=VALLEY))),
    ("place on Earth", ops(op("terrain.set", fields={"place": {"lat_deg": -89, "lon_deg": 180}}))),
    *((f"a task: {goal['type']}", ops(op("terrain.set", fields={"task": {"goal": goal}}))) for goal in GOALS),
    ("a task without a goal, and no task", ops(_task(title="Look", text="Only\nlook."), _task())),
    ("no pictures of a task", ops(op("terrain.set", fields={"task": None, "task_pictures": []}))),
    ("credit", {"type": "credit", "bytes": 65536}),
    ("rename", {"type": "rename", "name": "Grace", "colour": "#123456"}),
    ("ping", {"type": "ping", "t": 12.5}),
    ("hello to look at the past", HELLO | {"at": 0}),
    ("seek", {"type": "seek", "clock": 12}),
    ("a group of a lesson", GROUPING | {"name": "Rot", "pen": True, "put": ["p1"] * c.MAX_PEOPLE, "out": ["p2"]}),
    ("every group of a lesson", {"type": "grouping", "pen": False}),
    ("a group that is forgotten", GROUPING | {"forget": True}),
]

REFUSE: list[tuple[str, Json | str]] = [
    ("not JSON", "{"),
    ("empty text", ""),
    ("a bare number", "1"),
    ("an array", "[]"),
    ("no type", {}),
    ("unknown type", {"type": "teleport"}),
    ("the past of a clock before the first", HELLO | {"at": -1}),
    ("seek to no clock", {"type": "seek"}),
    ("a group of a long name", GROUPING | {"name": "n" * (c.MAX_GROUP_NAME + 1)}),
    ("a group of too many people", GROUPING | {"put": ["p"] * (c.MAX_PEOPLE + 1)}),
    ("a group of somebody without an id", GROUPING | {"put": ["two words"]}),
    ("a group under no id", GROUPING | {"group": ""}),
    ("seek to a part of a clock", {"type": "seek", "clock": 1.5}),
    ("null type", {"type": None}),
    ("a field that does not exist", HELLO | {"admin": True}),
    ("hello without secret", {k: v for k, v in HELLO.items() if k != "secret"}),
    ("hello with an empty secret", HELLO | {"secret": ""}),
    ("hello with a secret of 129 characters", HELLO | {"secret": "s" * 129}),
    ("hello with a slash in the id", HELLO | {"terrain": "../t1"}),
    ("hello with a long client id", HELLO | {"client": "c" * 41}),
    ("hello with a token of another form", HELLO | {"token": "0a" * 32}),
    ("hello with a long token", HELLO | {"token": "1" * 17 + "." + "0a" * 32}),
    ("hello with a negative clock", HELLO | {"clock": -1}),
    ("hello with a fractional clock", HELLO | {"clock": 1.5}),
    ("hello with a name of 81 characters", HELLO | {"name": "n" * 81}),
    ("hello with a bad colour", HELLO | {"colour": "red"}),
    ("protocol as text", HELLO | {"protocol": "1"}),
    ("no ops", {"type": "ops", "ops": []}),
    ("257 ops in a message", ops(*[op("stroke.finish", stroke="a")] * 257)),
    ("op id without counter", {"type": "ops", "ops": [{"id": "c1", "op": op("stroke.finish", stroke="a")}]}),
    ("unknown op", ops(op("stroke.explode", stroke="a"))),
    ("group in a group", ops(op("group", ops=[op("group", ops=[op("stroke.finish", stroke="a")])]))),
    ("empty group", ops(op("group", ops=[]))),
    ("65 ops in a group", ops(op("group", ops=[op("stroke.finish", stroke="a")] * 65))),
    ("257 points in an append", ops(op("stroke.append", stroke="a", start=0, points=[[0, 0]] * 257, last=[0, 0, 0]))),
    ("4097 points in a curve", ops(_set(curve=[[0, 0]] * 4097))),
    ("point with three numbers", ops(op("stroke.append", stroke="a", start=0, points=[[0, 0, 0]], last=[0, 0, 0]))),
    ("anchor with two numbers", ops(op("stroke.anchor", stroke="a", which="last", to=[1, 2]))),
    ("anchor in the middle", ops(op("stroke.anchor", stroke="a", which="middle", to=[1, 2, 3]))),
    ("number as text", ops(op("stroke.anchor", stroke="a", which="last", to=["1", 2, 3]))),
    ("true as a number", ops(op("stroke.anchor", stroke="a", which="last", to=[True, 2, 3]))),
    ("NaN", '{"type":"presence","cursor":[NaN,0,0]}'),
    ("Infinity", '{"type":"presence","cursor":[Infinity,0,0]}'),
    ("a number beyond float64", '{"type":"presence","cursor":[1e999,0,0]}'),
    ("farther than ten times the largest domain", PRESENCE | {"cursor": [655361, 0, 0]}),
    ("negative start", ops(op("stroke.append", stroke="a", start=-1, points=[], last=[0, 0, 0]))),
    ("negative extent", ops(_set(left={"slope_deg": 30, "extent_m": -1}))),
    ("slope of 86 degrees", ops(_set(left={"slope_deg": 86}))),
    ("roughness of 1.5", ops(_set(roughness=1.5))),
    ("yields more than wholly", ops(_set(yields=1.01))),
    ("yields less than nothing", ops(_set(yields=-0.01))),
    ("a course of an unknown use", ops(_set(course={"use": "canal"}))),
    ("a course with a height that is no number", ops(_set(course={"use": "road", "rises": ["1"]}))),
    ("a course of too many heights", ops(_set(course={"use": "road", "rises": [0] * (c.MAX_COURSE_POINTS + 1)}))),
    ("a course without a grade", ops(_set(course={"use": "road", "grade": 0}))),
    ("a course steeper than 1", ops(_set(course={"use": "road", "grade": 1.01}))),
    ("a course above the ground", ops(_set(course={"use": "river", "depth_m": -1}))),
    ("paint of an unknown channel", ops(_set(paint=SNOW | {"channel": "height"}))),
    ("paint stronger than 1", ops(_set(paint=SNOW | {"value": 1.01}))),
    ("paint weaker than -1", ops(_set(paint=SNOW | {"value": -1.01}))),
    ("paint of a negative radius", ops(_set(paint=SNOW | {"radius_m": -1}))),
    ("paint without a radius", ops(_set(paint={"channel": "snow", "value": 1}))),
    ("paint with a colour", ops(_set(paint=SNOW | {"colour": "#ffffff"}))),
    ("detail of 4.5", ops(op("terrain.set", fields={"detail": 4.5}))),
    ("fewer rivers than none", ops(op("terrain.set", fields={"rivers": -0.1}))),
    ("more rivers than four times as many", ops(op("terrain.set", fields={"rivers": 4.1}))),
    ("rivers without water", ops(op("terrain.set", fields={"wetness": 0}))),
    ("rivers of eleven times the water", ops(op("terrain.set", fields={"wetness": 11}))),
    ("a task with another goal", ops(_task(goal={"type": "win"}))),
    ("a task with half a goal", ops(_task(goal={"type": "area", "level_m": 5}))),
    ("a task with a text of 4001 characters", ops(_task(text="t" * (c.MAX_TASK_TEXT + 1)))),
    ("a target of a finer level", ops(_task(goal=GOALS[0] | {"target": TARGET | {"level": c.TASK_LEVEL + 1}}))),
    ("a target without a step", ops(_task(goal=GOALS[0] | {"target": TARGET | {"step_m": 0}}))),
    ("a target that is no base64", ops(_task(goal=GOALS[0] | {"target": TARGET | {"data": "<b>"}}))),
    (
        "a target of too many characters",
        ops(_task(goal=GOALS[0] | {"target": TARGET | {"data": "A" * (c.MAX_TARGET_CHARACTERS + 1)}})),
    ),
    ("a goal without a tolerance", ops(_task(goal=GOALS[0] | {"tolerance_m": 0}))),
    ("a profile of one height", ops(_task(goal=GOALS[2] | {"heights": [1]}))),
    ("a profile of 258 heights", ops(_task(goal=GOALS[2] | {"heights": [1] * (c.MAX_PROFILE_SAMPLES + 1)}))),
    ("a path of one point", ops(_task(goal=GOALS[4] | {"path": [[1, 2]]}))),
    ("a path of 65 points", ops(_task(goal=GOALS[4] | {"path": [[1, 2]] * (c.MAX_TASK_LINE + 1)}))),
    ("a path that may not climb at all", ops(_task(goal=GOALS[4] | {"at_most": 0}))),
    ("a rule that asks for nothing", ops(_task(goal=GOALS[5] | {"at_least_m2": 0}))),
    ("three pictures of a task", ops(op("terrain.set", fields={"task_pictures": ["AAAA"] * 3}))),
    ("a picture of too many characters", ops(op("terrain.set", fields={"task_pictures": ["A" * 28_004]}))),
    ("unknown rule", ops(op("terrain.set", fields={"rule": "fractal"}))),
    ("the kind of a stroke cannot be set", ops(_set(kind="paint"))),
    ("the size of a terrain cannot be set", ops(op("terrain.set", fields={"size_m": 128}))),
    ("the author of a stroke cannot be set", ops(_set(author="eve"))),
    ("layer content that is no digest", ops(op("layer.add", layer=VALLEY | {"content": "../../etc/passwd"}))),
    ("layer without facts", ops(op("layer.add", layer={k: v for k, v in VALLEY.items() if k != "facts"}))),
    ("layer spacing of zero", ops(_lay(spacing_m=[0, 1]))),
    ("layer spacing of one number", ops(_lay(spacing_m=10))),
    ("layer turned too far", ops(_lay(rotation_deg=361))),
    ("layer accuracy below zero", ops(_lay(accuracy_m=-1))),
    ("layer order of a fraction", ops(_lay(priority=0.5))),
    ("layer outline of 2", ops(_lay(outline=2))),
    ("layer with a source of 241 characters", ops(_lay(source="s" * 241))),
    ("the content of a layer cannot be set", ops(_lay(content="0" * 64))),
    ("place at the pole", ops(op("terrain.set", fields={"place": {"lat_deg": 90, "lon_deg": 0}}))),
    ("reach of zero", ops(op("terrain.set", fields={"reach_m": 0}))),
    ("reach that no float32 can square", ops(op("terrain.set", fields={"reach_m": 1e-300}))),
    ("reach just below the least", ops(op("terrain.set", fields={"reach_m": 0.015}))),
    ("unknown look", ops(op("terrain.set", fields={"look": "neon"}))),
    ("negative credit", {"type": "credit", "bytes": -1}),
    ("credit of a fraction", {"type": "credit", "bytes": 0.5}),
    ("view with a flat lens", VIEW | {"fov_deg": 0}),
    ("view of no pixels", VIEW | {"width": 0}),
    ("tool of 25 characters", PRESENCE | {"tool": "t" * 25}),
    ("ping without time", {"type": "ping"}),
    ("a server's message", {"type": "ack", "ids": [], "clocks": []}),
]


def message_vectors() -> list[Json]:
    """All cases; raises AssertionError when the contract disagrees with the outcome named here."""
    out: list[Json] = []
    for accept, cases in ((True, ACCEPT), (False, REFUSE)):
        for name, raw in cases:
            text = raw if isinstance(raw, str) else json.dumps(raw, separators=(",", ":"))
            assert _accepted(text) == accept, name
            out.append({"name": name, "text": text, "accept": accept})
    return out


def _accepted(text: str) -> bool:
    try:
        c.CLIENT_MESSAGE.validate_json(text)
    except ValidationError:
        return False
    return True
