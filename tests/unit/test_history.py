"""The activity_log: ops gathered into what people did (SPEC HI1 to HI6)."""

from __future__ import annotations

from typing import Any

import pytest

from esker import contract as c
from esker.document.history.activity import ActivityLog, Entry, JournalEntry
from esker.document.history.words import facts, sentence
from esker.document.ops import StrokeSet
from esker.document.sync import SyncDoc
from esker.document.wire import op_json

GRID = c.GridFacts(rows=4, cols=4, low_m=0, high_m=1, file="crater.tif")
LAYER = c.Layer(id="g", content="0" * 64, facts=GRID, name="crater-2004", anchor=(0, 0), spacing_m=(2, 2), accuracy_m=1)


def stroke(stroke_id: str, **fields: Any) -> c.Stroke:
    given = {"kind": "profile", "first": (0, 0, 0), "last": (1, 1, 1), "curve": ((0.5, 9.0),), "finished": True}
    return c.Stroke.model_validate({"id": stroke_id, **given, **fields})


class Told_:
    """A terrain that is told what happens, and what its activity log says then."""

    def __init__(self, **birth: Any) -> None:
        self.birth = c.Document(id="t", **birth)
        self.now = StrokeSet.from_document(self.birth)
        self.told: list[JournalEntry] = []

    def does(self, author: str, *ops: c.Op, at: float | None = None) -> None:
        for op in ops:
            self.now, _ = self.now.apply(op)
            self.told.append(JournalEntry(self.now.clock, author, op_json(op), at))

    def entries(self, activity_log: ActivityLog | None = None) -> list[Entry]:
        activity_log = activity_log or ActivityLog(self.birth)
        activity_log.add(self.told)
        return sorted(activity_log.entries, key=lambda e: e.last)

    def says(self) -> list[str]:
        strokes, layers = self.now.deleted | self.now.strokes, self.now.deleted_layers | self.now.layers
        return [f"{e.author} {sentence(e, strokes, layers)}" for e in self.entries()]


def drawn(stroke_id: str, points: int = 3, **fields: Any) -> list[c.Op]:
    """A stroke as the page draws it."""
    begin = stroke(stroke_id, curve=(), finished=False, **fields)
    appends = (
        c.AppendPoints(stroke=stroke_id, start=i, points=((i / 10, 5.0),), last=(float(i), 1, 0)) for i in range(points)
    )
    return [c.BeginStroke(stroke=begin), *appends, c.FinishStroke(stroke=stroke_id)]


def label(stroke_id: str, text: str) -> c.SetStroke:
    return c.SetStroke(stroke=stroke_id, fields=c.StrokeFields(label=text))


def test_a_drawn_stroke_is_one_entry_though_two_draw_at_once() -> None:
    """HI1."""
    t = Told_()
    ana, ben = drawn("a"), drawn("b", kind="level")
    for one, other in zip(ana, ben, strict=True):
        t.does("ana", one)
        t.does("ben", other)
    t.does("ana", *drawn("p", kind="paint", paint=c.Paint(channel="snow", value=1, radius_m=9)))
    assert t.says() == ["ana drew a mountain", "ben drew a plateau", "ana painted snow"]
    first = t.entries()[0]
    assert (first.first, first.last) == (1, 9)


def test_changes_of_the_same_thing_are_merged_within_a_minute() -> None:
    """HI2."""
    t = Told_(strokes=(stroke("a"), stroke("b")))
    for i in range(5):
        t.does("ana", c.MoveAnchor(stroke="a", which="last", to=(9.0 + i, 0, 0)), at=100.0 + i)
    t.does("ana", c.MoveAnchor(stroke="b", which="last", to=(9.0, 0, 0)), at=105)
    t.does("ben", c.MoveAnchor(stroke="b", which="last", to=(8.0, 0, 0)), at=106)
    t.does("ben", c.MoveAnchor(stroke="b", which="last", to=(7.0, 0, 0)), at=300)
    assert t.says() == [f"{who} moved a mountain" for who in ("ana", "ana", "ben", "ben")]
    assert [(e.first, e.last, e.at) for e in t.entries()][:2] == [(1, 5, 104.0), (6, 6, 105)]


@pytest.mark.parametrize(
    ("op", "says"),
    [
        (c.SetStroke(stroke="a", fields=c.StrokeFields(hidden=True)), "hid a mountain"),
        (c.SetStroke(stroke="a", fields=c.StrokeFields(locked=True)), "locked a mountain"),
        (c.SetStroke(stroke="a", fields=c.StrokeFields(curve=((0, -3),))), "reshaped a crevice"),
        (c.SetStroke(stroke="a", fields=c.StrokeFields(left=None, roughness=0.25)), "changed a mountain"),
        (label("a", "Mesa"), "named the mountain “Mesa”"),
        (c.DeleteStroke(stroke="a"), "deleted a mountain"),
        (c.Group(ops=(c.DeleteStroke(stroke="a"), c.DeleteStroke(stroke="b"))), "deleted 2 strokes"),
        (c.SetTerrain(fields=c.TerrainFields(sea_level_m=3.0)), "changed the sea level"),
        (c.SetTerrain(fields=c.TerrainFields(sun_azimuth_deg=3.0, sun_elevation_deg=9.0)), "changed the sun"),
        (c.AddLayer(layer=LAYER), "added layer crater-2004 (2 m)"),
        (
            c.Group(ops=(c.AddLayer(layer=LAYER), c.SetTerrain(fields=c.TerrainFields(seed=9)))),
            "added layer crater-2004 (2 m)",
        ),
        (c.Group(ops=(label("a", ""), c.SetTerrain(fields=c.TerrainFields(seed=9)))), "changed several things"),
    ],
)
def test_what_is_said_of_each_op(op: c.Op, says: str) -> None:
    """HI3."""
    t = Told_(strokes=(stroke("a"), stroke("b")))
    t.does("ana", op)
    assert t.says() == [f"ana {says}"]


def test_the_facts_of_an_entry_are_what_its_sentence_says() -> None:
    """U652."""
    t = Told_(strokes=(stroke("a"), stroke("b")))
    t.does("ana", *drawn("c"))
    t.does("ben", label("a", "Mesa"))
    t.does("ana", c.Group(ops=(c.DeleteStroke(stroke="a"), c.DeleteStroke(stroke="b"))))
    t.does("ben", c.AddLayer(layer=LAYER))
    t.does("ana", c.SetTerrain(fields=c.TerrainFields(sea_level_m=3.0, look="desert")))
    strokes, layers = t.now.deleted | t.now.strokes, t.now.layers
    empty = {"kind": "stroke", "count": 1, "noun": "", "label": "", "paint": ""}
    found = [(entry.action, facts(entry, strokes, layers)) for entry in t.entries()]
    assert found == [
        ("draw", empty | {"noun": "mountain"}),
        ("name", empty | {"noun": "mountain", "label": "Mesa"}),
        ("delete", empty | {"count": 2}),
        ("layer", empty | {"kind": "layer", "label": "crater-2004"}),
        ("settings", empty | {"kind": "terrain", "fields": ["look", "sea_level_m"]}),
    ]
    assert facts(t.entries()[0], {}, {}) == empty, "what the terrain does not know any more has no name"


def test_what_the_undo_of_the_clients_does_is_told_as_such() -> None:
    """HI4: the same steps that ``SyncDoc`` makes, in a page and in Python."""
    t = Told_(strokes=(stroke("b"),))
    sync = SyncDoc("ana")
    welcome = {"server": "", "client": "ana", "token": "", "role": "edit", "colour": "#000000", "device": ""}
    numbers = {"protocol": c.PROTOCOL_VERSION, "levels": 0, "finest": 0, "clock": 0}
    sync.welcome(c.Welcome.model_validate({**welcome, **numbers, "members": (), "document": t.birth}))

    def does(*ops: c.Op, gesture: str | None = None) -> None:
        for op in ops:
            sync.submit(op, gesture)
        flush()

    def flush() -> None:
        for envelope in sync.outgoing():
            t.does("ana", envelope.op)
            sync.ack(c.Ack(ids=(envelope.id,), clocks=(t.now.clock,)))

    does(*drawn("a"), gesture="draw")
    does(*(c.MoveAnchor(stroke="b", which="first", to=(float(i), 3, 3)) for i in range(4)), gesture="drag")
    does(c.SetTerrain(fields=c.TerrainFields(title="X", seed=4)))
    for move in ("undo", "undo", "undo", "redo", "redo"):
        getattr(sync, move)()
        flush()
    does(label("b", "B"))
    assert t.says() == [
        "ana drew a mountain",
        "ana moved the mountain “B”",
        "ana changed the title and seed",
        "ana changed the title and seed back",
        "ana undid moving the mountain “B”",
        "ana undid drawing a mountain",
        "ana redid drawing a mountain",
        "ana redid moving the mountain “B”",
        "ana named the mountain “B”",
    ]


def test_taking_back_what_another_did_is_no_undo() -> None:
    """HI4."""
    t = Told_()
    t.does("ana", *drawn("a"))
    t.does("ben", c.DeleteStroke(stroke="a"), c.RestoreStroke(stroke="a"))
    assert t.says() == ["ana drew a mountain", "ben deleted a mountain", "ben undid deleting a mountain"]


def test_a_log_may_be_continued_or_begin_anywhere() -> None:
    """HI5."""
    t = Told_(strokes=(stroke("b"),))
    t.does("ana", *drawn("a", author="Ana"), label("b", "B"))
    whole = ActivityLog(t.birth)
    for told in t.told:
        whole.add([told])
    whole.add(t.told)
    assert [repr(e) for e in whole.entries] == [repr(e) for e in t.entries()]
    assert whole.names == {"ana": "Ana"}
    late = ActivityLog(None, 2)
    assert [(e.action, e.first, e.last) for e in t.entries(late)] == [("reshape", 3, 4), ("name", 6, 6)]


def test_a_choice_that_was_made_back_by_hand_is_not_called_undone() -> None:
    """HI310."""
    t = Told_()
    for look in ("desert", "natural", "desert"):
        t.does("ana", c.SetTerrain(fields=c.TerrainFields(look=look)))
    assert t.says() == ["ana changed the look", "ana changed the look back", "ana changed the look again"]


def test_who_undoes_half_of_an_entry_undid_that_half() -> None:
    """HI4: two settings changed within a minute are one entry; undone one by one, the last alone is named first."""
    t = Told_()
    t.does("ana", c.SetTerrain(fields=c.TerrainFields(sea_level_m=10.0)), at=0)
    t.does("ana", c.SetTerrain(fields=c.TerrainFields(lakes_m=5.0)), at=5)
    t.does("ana", c.SetTerrain(fields=c.TerrainFields(lakes_m=None)), at=9)
    both, undone = t.entries()
    assert both.fields == {"sea_level_m", "lakes_m"}
    assert undone.turn == "undo"
    assert undone.fields == {"lakes_m"}
    t.does("ana", c.SetTerrain(fields=c.TerrainFields(lakes_m=5.0)), at=12)
    again = t.entries()[-1]
    assert again.turn == "redo"
    assert again.fields == {"lakes_m"}


def test_a_switch_thrown_back_reads_as_what_became_of_the_thing() -> None:
    told = [
        JournalEntry(k + 1, "ann", f'{{"type":"layer.set","layer":"l","fields":{{"hidden":{hidden}}}}}', None)
        for k, hidden in enumerate(["true", "false", "true", "false"])
    ]
    activity_log = ActivityLog(None)
    activity_log.add(told)
    words = [sentence(entry, {}, {}) for entry in activity_log.entries]
    assert words == ["hid a layer", "showed a layer", "hid a layer again", "showed a layer again"]
