"""Viewers' documents go on from ops that tell them of nothing deleted (SPEC A400, A401)."""

from __future__ import annotations

import random
from typing import Any

import pytest

from esker import contract as c
from esker.document.ops import Refusal, StrokeSet
from esker.document.sync import Diverged, SyncDoc
from esker.document.wire import document_json
from esker.session.room.core import RoomCore, RoomInfo
from esker.session.room.outbox import Long, Outbox
from esker.session.room.replicas.viewing import nameless
from esker.store.journal import Loaded, ordered_json

INFO = RoomInfo(4, 4, "none")
NAME = 'Ann"e\\ "author":"'


def stroke(name: str) -> c.Stroke:
    return c.Stroke(
        id=name, author=NAME, kind="profile", first=(0, 0, 7.25), last=(9, 9, 0), curve=((0, 0),), label=NAME
    )


class Viewer:
    """Reads what the room sends, as the page does; counts how often it had to ask for a snapshot."""

    def __init__(self, core: RoomCore, name: str) -> None:
        self.core, self.name, self.token = core, name, ""
        self.doc, self.diverged, self.left = SyncDoc(name), 0, False
        self.texts: list[str] = []
        self.enter()

    def enter(self) -> None:
        self.outbox = Outbox(lambda: None)
        hello = c.Hello(
            protocol=c.PROTOCOL_VERSION, terrain="t", secret="s", client=self.name, clock=self.doc.clock,
            token=self.token or None,
        )  # fmt: skip
        self.member = self.core.join(hello, "view", "look", self.outbox, INFO)
        self.read()

    def leave(self) -> None:
        self.read()
        self.core.leave(self.member)

    def read(self) -> None:
        while (text := self.outbox.pop()) is not None:
            self.texts.append(str(text))
            message = c.SERVER_MESSAGE.validate_json(str(text))
            try:
                if isinstance(message, c.Welcome):
                    self.token = message.token
                    self.doc.welcome(message)
                elif isinstance(message, c.OpsBroadcast):
                    self.doc.ordered(message)
            except Diverged:
                self.diverged += 1
                self.doc.start_over()
                self.leave()
                self.enter()


def room() -> tuple[RoomCore, Any]:
    core = RoomCore(Loaded(StrokeSet("t"), [], {}), lambda *_: None)
    hello = c.Hello(protocol=c.PROTOCOL_VERSION, terrain="t", secret="s", client="anne", name=NAME)
    return core, core.join(hello, "edit", "draw", Outbox(lambda: None), INFO)


def commit(core: RoomCore) -> None:
    batch = core.take()
    if batch is not None:
        core.committed(batch)


def test_names_of_what_ops_bring_are_taken_out_of_their_text_and_nothing_else() -> None:
    op = c.Group(ops=(c.BeginStroke(stroke=stroke("a")), c.BeginStroke(stroke=stroke("b"))))
    text = nameless(ordered_json(3, "anne:3", "anne", op.model_dump_json()))
    found = c.OrderedOp.model_validate_json(text)
    assert (found.author, found.id) == ("anne", "anne:3")
    assert isinstance(found.op, c.Group)
    born = [part.stroke for part in found.op.ops if isinstance(part, c.BeginStroke)]
    assert [each.author for each in born] == ["", ""]
    assert [each.label for each in born] == [NAME, NAME]


def test_a_viewer_gets_no_tombstone_and_no_name() -> None:
    """SPEC A400."""
    core, anne = room()
    ops: list[c.Op] = [c.BeginStroke(stroke=stroke("a")), c.BeginStroke(stroke=stroke("b")), c.DeleteStroke(stroke="b")]
    core.submit(anne, [c.OpEnvelope(id=f"anne:{n}", op=op) for n, op in enumerate(ops)])
    commit(core)
    core.leave(anne)
    fresh = Viewer(core, "fresh")
    assert not fresh.doc.confirmed.deleted
    known = Viewer.__new__(Viewer)
    known.core, known.name, known.token, known.texts = core, "known", "", []
    known.doc = SyncDoc("known")
    known.doc._confirmed = StrokeSet("t")
    known.enter()
    for viewer in (fresh, known):
        text = "".join(viewer.texts)
        assert '"b"' not in text, "what was begun and deleted since is not told either"
        assert NAME not in [s.author for s in viewer.doc.confirmed.strokes.values()]
        assert list(viewer.doc.confirmed.strokes) == ["a"]


@pytest.mark.parametrize("seed", range(30))
def test_viewers_who_come_and_go_have_the_strokes_that_are_there(seed: int) -> None:
    """SPEC A401: strokes are deleted and brought back, alone and in groups, seen by some and not by others."""
    rng, (core, anne) = random.Random(seed), room()
    viewers: list[Viewer] = []
    away: list[Viewer] = []
    names = [f"s{n}" for n in range(6)]
    counter = made = 0
    for _ in range(250):
        parts: list[c.SimpleOp] = []
        for _ in range(rng.choice((1, 1, 1, 2, 3))):
            name = rng.choice(names)
            parts.append(
                rng.choice((
                    c.BeginStroke(stroke=stroke(name)), c.DeleteStroke(stroke=name), c.DeleteStroke(stroke=name),
                    c.RestoreStroke(stroke=name), c.RestoreStroke(stroke=name), c.FinishStroke(stroke=name),
                    c.MoveAnchor(stroke=name, which="first", to=(float(counter % 50), 1.0, 2.0)),
                ))
            )  # fmt: skip
        op: c.Op = parts[0] if len(parts) == 1 else c.Group(ops=tuple(parts))
        try:
            core.head.apply(op)
        except Refusal:
            continue
        made += core.submit(anne, [c.OpEnvelope(id=f"anne:{counter}", op=op)])
        counter += 1
        if rng.random() < 0.6:
            commit(core)
        if rng.random() < 0.1:
            viewers.append(Viewer(core, f"v{counter}"))
        if viewers and rng.random() < 0.05:
            away.append(viewers.pop(rng.randrange(len(viewers))))
            away[-1].leave()
        if away and rng.random() < 0.05:
            viewers.append(away.pop())
            viewers[-1].left = True
            viewers[-1].enter()
        for viewer in viewers:
            viewer.read()
    commit(core)
    assert made > 30
    there = {key: s.model_copy(update={"author": ""}) for key, s in core.document.strokes.items()}
    for viewer in viewers:
        viewer.read()
        assert viewer.doc.confirmed.strokes == there
        assert list(viewer.doc.confirmed.strokes) == list(there)
    never_left = [viewer for viewer in viewers if not viewer.left]
    assert not any(viewer.diverged for viewer in never_left), "who only ever listened has no need of a snapshot"


def test_a_heavy_document_of_before_a_deletion_is_not_given_to_a_viewer_who_comes_after(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """SPEC A400: one who had come before, and waited for it, gets it and the deletion."""
    monkeypatch.setattr("esker.session.room.replicas.replicas.HEAVY_BYTES", 10)
    monkeypatch.setattr("esker.session.room.replicas.replicas.HEAVY_POINTS", 0)
    core, anne = room()
    core.submit(anne, [c.OpEnvelope(id="anne:0", op=c.BeginStroke(stroke=stroke("gone")))])
    commit(core)
    first = Viewer(core, "first")
    assert "gone" in first.doc.confirmed.strokes
    core.submit(anne, [c.OpEnvelope(id="anne:1", op=c.DeleteStroke(stroke="gone"))])
    commit(core)
    assert core.ready(None, view=True, asked=1)
    assert not core.ready(None, view=True, asked=2)
    second = Viewer(core, "second")
    assert "gone" not in "".join(second.texts)
    assert '"gone"' in document_json(core.document.to_document())
    assert isinstance(core._welcome(second.member, None, INFO)[0], Long)
