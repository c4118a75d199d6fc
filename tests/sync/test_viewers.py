"""A link to look leads to nothing that was deleted and to no name of who is gone (SPEC A400, A402).

A name and a deleted stroke are planted; everything that comes out of every route and frame is searched for them.
"""

from __future__ import annotations

import io
import json
import re
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from esker import contract as c
from esker.contract import Stroke
from tests.sync.harness import LiveServer, Peer, set_op, stroke
from tests.sync.scripted_maker import WANTED, Maker

NAME, LABEL, ID, HEIGHT = "Zerubabel", "Gravenhurst", "xq7deleted", 543.2109375
SECRETS = (NAME, LABEL, str(HEIGHT))
"""What a viewer may not see. The id alone tells nothing, and is in the op that deletes for who is there to see it."""
WORDS = "|".join(SECRETS)


@pytest.fixture
def maker(monkeypatch: pytest.MonkeyPatch) -> Maker:
    made = Maker()
    monkeypatch.setattr("esker.server.run.exporting", made)
    made.gate.set()
    return made


@pytest.fixture
def live(tmp_path: Path, maker: Maker) -> Iterator[LiveServer]:
    assert maker is not None
    with LiveServer(tmp_path) as server:
        yield server


def planted(live: LiveServer) -> tuple[str, str, str]:
    """A terrain with a stroke that is there and one that was deleted, both by somebody who left; owner, viewer."""
    terrain, owner = live.create()
    peer = live.join(terrain, owner, "zed", name=NAME)
    gone, there = stroke(ID), stroke("there", 30.0)
    gone["stroke"] |= {"author": NAME, "label": LABEL, "first": [100, 100, HEIGHT]}
    there["stroke"] |= {"author": NAME}
    ops = [
        gone,
        there,
        set_op(ID, amplitude_m=2.0),
        {"type": "stroke.delete", "stroke": ID},
        set_op("there", label="A"),
    ]
    for n, op in enumerate(ops):
        peer.ops((f"zed:{n}", op))
        peer.wait("ack")
    peer.close()
    view = live.http("POST", f"/api/terrains/{terrain}/links", {"role": "view"}, owner)[1]["secret"]
    return terrain, owner, view


def found(data: bytes) -> list[str]:
    """Secrets in an answer, also in archives within it."""
    hits = re.findall(WORDS, data.decode("utf-8", "replace"))
    if zipfile.is_zipfile(io.BytesIO(data)):
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            for name in archive.namelist():
                hits += found(archive.read(name)) + found(name.encode())
    return hits


def heard(peer: Peer) -> str:
    """All that was sent, as text."""
    return json.dumps(peer.seen)


def said(peer: Peer, after: int, kind: str) -> list[dict[str, Any]]:
    """Messages of a kind behind the first so many."""
    return [each for each in peer.seen[after:] if each["type"] == kind]


def routes(live: LiveServer) -> list[tuple[str, str]]:
    """Method and path of every route below a terrain, as the server describes itself."""
    paths = live.http("GET", "/api/openapi.json")[1]["paths"]
    return [(method.upper(), path) for path, methods in paths.items() for method in methods if "{terrain}" in path]


def test_every_route_that_a_link_to_look_reaches(live: LiveServer, maker: Maker) -> None:
    """SPEC A400. A route that is added is asked too."""
    terrain, owner, view = planted(live)
    status, body, _ = live.raw("GET", f"/api/terrains/{terrain}/document", None, owner)
    assert status == 200
    assert set(found(body)) == set(SECRETS), "the owner sees all of it: the search can find"
    exported = live.http("POST", f"/api/terrains/{terrain}/exports", WANTED, view)[1]["id"]
    asked = 0
    for method, path in routes(live):
        known = {"terrain": terrain, "job": exported, "link_id": "x", "digest": "0" * 64}
        url = re.sub(r"\{(\w+)\}", lambda m, known=known: str(known.get(m[1], "x")), path)  # type: ignore[misc]
        clocks = ("", *(f"?at={n}" for n in range(6))) if method == "GET" else ("",)
        for clock in clocks:
            for content in (None, {}, {"at": 3}) if method != "GET" else (None,):
                _, body, _ = live.raw(method, url + clock, content, view)
                assert found(body) == [], f"{method} {path}{clock}"
                asked += 1
    assert asked > 60
    for task in maker.tasks:
        assert found(task.document.model_dump_json().encode()) == []
    document = live.http("GET", f"/api/terrains/{terrain}/document", None, view)[1]
    assert [s["id"] for s in document["strokes"]] == ["there"]
    at_three = live.http("GET", f"/api/terrains/{terrain}/document?at=3", None, view)[1]
    assert [s["id"] for s in at_three["strokes"]] == ["there"]
    entries = live.http("GET", f"/api/terrains/{terrain}/history", None, view)[1]["entries"]
    assert {"drew a mountain", "deleted a stroke"} & {entry["text"] for entry in entries}


@pytest.mark.parametrize("clock", [None, 0, 1, 2, 3, 4, 5])
def test_every_frame_of_a_viewer_who_comes(live: LiveServer, clock: int | None) -> None:
    """SPEC A400: a snapshot, or the ops since any clock. The names of who is there are no secret."""
    terrain, owner, view = planted(live)
    peer = live.join(terrain, view, "v1", **({} if clock is None else {"clock": clock}))
    owner_here = live.join(terrain, owner, "own", name="Ada")
    while "Ada" not in heard(peer):
        peer.next()
    owner_here.ops(("own:0", set_op("there", label="B")))
    before = len(peer.seen)
    while not (said(peer, before, "ordered") and any(each["settled"] for each in said(peer, before, "progress"))):
        peer.next()  # in either order: a label moves no ground
    assert not re.search(WORDS, heard(peer)), heard(peer)
    for each in (peer, owner_here):
        each.close()


def test_what_comes_back_while_a_viewer_looks(live: LiveServer) -> None:
    """SPEC A401: as something that begins, as the viewer never had it; then it is deleted and comes back as itself."""
    terrain, owner, view = planted(live)
    peer = live.join(terrain, view, "v1")
    drawing = live.join(terrain, owner, "own")
    drawing.ops(("own:0", {"type": "stroke.restore", "stroke": ID}))
    [born] = peer.wait("ordered")["ops"]
    assert (born["op"]["type"], born["op"]["stroke"]["id"], born["op"]["stroke"]["author"]) == ("stroke.begin", ID, "")
    drawing.wait("ack")
    for n, verb in ((1, "delete"), (2, "restore")):
        drawing.ops((f"own:{n}", {"type": f"stroke.{verb}", "stroke": ID}))
        assert peer.wait("ordered")["ops"][0]["op"] == {"type": f"stroke.{verb}", "stroke": ID}
    assert NAME not in heard(peer)
    for each in (peer, drawing):
        each.close()


def test_the_past_shows_a_viewer_the_strokes_that_are_still_there(live: LiveServer) -> None:
    """SPEC A402: at every clock, by every step, forward and back; the ground is as it was."""
    terrain, owner, view = planted(live)
    peer = live.join(terrain, view, "v1", at=3)
    assert [s["id"] for s in peer.welcome["document"]["strokes"]] == ["there"]
    peer.settled(3)
    for clock in (0, 1, 2, 3, 4, 5, 2, 5, 1, 3):
        peer.say("seek", clock=clock)
        peer.settled(clock)
    assert not re.search(WORDS, heard(peer)), heard(peer)
    peer.close()
    editing = live.join(terrain, owner, "own", at=3)
    assert {s["id"] for s in editing.welcome["document"]["strokes"]} == {ID, "there"}
    editing.close()


def test_what_is_deleted_while_a_viewer_looks_at_the_past_is_not_told_there(live: LiveServer) -> None:
    """SPEC A402."""
    terrain, owner, view = planted(live)
    peer = live.join(terrain, view, "v1", at=1)
    drawing = live.join(terrain, owner, "own")
    drawing.ops(("own:0", {"type": "stroke.delete", "stroke": "there"}))
    drawing.wait("ack")
    peer.say("seek", clock=2)
    found_there: Any = peer.wait("welcome")["document"]
    assert found_there["strokes"] == []
    for each in (peer, drawing):
        each.close()


def test_a_stroke_has_no_field_with_a_name_but_its_author() -> None:
    """SPEC A400: a field that is added says here whether it is somebody's name."""
    told = {"label"}  # what is written on the land by people for people
    texts = {name for name, field in Stroke.model_fields.items() if field.annotation is str} - {"id"}
    assert texts - told == {"author"}
    texts = {name for name, field in c.Layer.model_fields.items() if field.annotation is str} - {"id", "content"}
    assert "author" in texts
