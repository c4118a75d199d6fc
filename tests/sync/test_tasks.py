"""Tasks over real sockets: who may set one, what everybody is told, the wall and the table (SPEC L94 to L108)."""

from __future__ import annotations

import base64
import csv
import io
import time
import zipfile
from pathlib import Path
from typing import Any

import pytest

from esker import contract as c
from esker.fairness.shares import Rates
from tests.sync.classroom import a_class, answer, lesson, people
from tests.sync.harness import PATIENCE, LiveServer, Peer, set_op, stroke
from tests.sync.test_classes import Pupil, Teacher
from tests.sync.test_wall import Wall

GOAL = {"type": "area", "level_m": 1.0, "at_least_m2": 20e6, "dry": False}
TASK = {"title": "Raise land", "text": "Out of the sea.", "goal": GOAL, "difference": True}
SMALL_PNG = "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg=="


def set_task(task: Any = TASK, **more: Any) -> dict[str, Any]:
    return {"type": "terrain.set", "fields": {"task": task, **more}}


def scored(peer: Peer, points: int | None) -> dict[str, Any]:
    """The next score that has so many points."""
    while True:
        found = peer.wait("score")
        if found["points"] == points:
            return found


@pytest.fixture(autouse=True)
def _patient(server: LiveServer) -> None:
    state: Any = server.state
    state.new_terrains, state.code_tries = Rates(), Rates()


def test_a_client_that_ignores_who_leads_gains_nothing(server: LiveServer) -> None:
    """SPEC L95: nor in a group, nor by undoing; who was named a conductor may."""
    room = a_class(server, "task")
    assert answer(room.teacher, "task-t:0", set_task(task_pictures=[SMALL_PNG]))["type"] == "ack"
    attacks = [
        set_task(None),
        set_task(TASK | {"goal": GOAL | {"at_least_m2": 1.0}}),
        {"type": "terrain.set", "fields": {"title": "T", "task_pictures": []}},
        {"type": "group", "ops": [stroke("s-in-a-group"), set_task(None)]},
    ]
    for number, op in enumerate(attacks):
        refused = answer(room.anne, f"task-a:{number}", op)
        assert (refused["type"], refused["code"]) == ("reject", "leaders_only")
        assert refused["message"] == "Only whoever leads this terrain changes its task."
    assert answer(room.anne, "task-a:80", {"type": "terrain.set", "fields": {"title": "T"}})["type"] == "ack"
    people(room.teacher, "conductor", room.ben)
    lesson(room.ben, conducts=True)
    assert answer(room.ben, "task-b:0", set_task(TASK | {"title": "Ben's"}))["type"] == "ack"
    document = server.http("GET", f"/api/terrains/{room.terrain}/document", secret=room.owner)[1]
    assert document["settings"]["task"] == TASK | {"title": "Ben's"}
    assert document["settings"]["task_pictures"] == [SMALL_PNG]
    assert document["strokes"] == []


def webp(wide: int, high: int) -> str:
    """The header of an extended WebP that declares so many pixels."""
    sides = (wide - 1).to_bytes(3, "little") + (high - 1).to_bytes(3, "little")
    return base64.b64encode(b"RIFF\x16\0\0\0WEBPVP8X\x0a\0\0\0\0\0\0\0" + sides).decode()


@pytest.mark.parametrize("picture", ["AAAA", webp(c.MAX_PICTURE_SIDE + 1, 1), webp(1 << 24, 1 << 24)])
def test_a_picture_that_is_none_or_too_large_is_refused(server: LiveServer, picture: str) -> None:
    """SPEC L96: its header is read and nothing of it is decoded."""
    room = a_class(server, "pict")
    assert answer(room.teacher, "pict-t:0", set_task(task_pictures=[webp(1024, 1024)]))["type"] == "ack"
    refused = answer(room.teacher, "pict-t:1", set_task(task_pictures=[picture]))
    assert (refused["type"], refused["code"]) == ("reject", "malformed")


def test_everybody_is_told_how_far_the_ground_is(server: LiveServer) -> None:
    """SPEC L105: when it settles, and who comes later; nothing is scored without a goal."""
    room = a_class(server, "score")
    answer(room.teacher, "score-t:0", set_task())
    first = scored(room.anne, 0)
    assert first["text"] == "0 of 100: 0 ha of the 20 km² asked for are above 1.0 m."
    answer(room.ben, "score-b:0", stroke("s-land", 400.0))
    raised = scored(room.teacher, 83)
    assert scored(room.anne, raised["points"])["text"] == raised["text"]
    late = server.join(room.terrain, room.edit, "score-late")
    assert scored(late, raised["points"])["text"] == raised["text"]
    answer(room.teacher, "score-t:1", set_task(TASK | {"goal": None}))
    assert scored(late, None)["text"] == ""


def test_undo_all_takes_a_task_back(server: LiveServer) -> None:
    """SPEC L94: it is a setting like any other."""
    room = a_class(server, "back")
    people(room.teacher, "conductor", room.ben)
    lesson(room.ben, conducts=True)
    answer(room.ben, "back-b:0", set_task())
    people(room.teacher, "undo", room.ben)
    while room.teacher.wait("notice")["text"] != "Everything that Ben did was taken back.":
        pass
    document = server.http("GET", f"/api/terrains/{room.terrain}/document", secret=room.owner)[1]
    assert document["settings"]["task"] is None


def test_a_task_outlives_the_server(tmp_path: Path) -> None:
    """SPEC L94."""
    with LiveServer(tmp_path) as before:
        room = a_class(before, "kept")
        answer(room.teacher, "kept-t:0", set_task(task_pictures=[SMALL_PNG]))
    with LiveServer(tmp_path) as after:
        again = after.join(room.terrain, room.edit, "kept-2")
        settings = again.welcome["document"]["settings"]
        assert (settings["task"], settings["task_pictures"]) == (TASK, [SMALL_PNG])
        assert scored(again, 0)["points"] == 0


def test_copies_of_a_class_have_the_task_the_wall_its_score_and_the_table_too(server: LiveServer) -> None:
    """SPEC L106, L107: a later task comes with the additions; pupils cannot change it."""
    teacher = Teacher(server)
    own = server.join(teacher.terrain, teacher.secret, "own")
    own.ops(("own:1", set_task()))
    own.wait("ack")
    status, teacher.made = server.http("POST", f"/api/terrains/{teacher.terrain}/classes", {}, teacher.secret)
    assert status == 201
    teacher.path = f"/api/terrains/{teacher.terrain}/classes/{teacher.made['id']}"
    pupil = Pupil(teacher, "Ada")
    peer = pupil.join("ada")
    assert peer.welcome["document"]["settings"]["task"] == TASK
    assert answer(peer, "ada:1", set_task(None))["code"] == "leaders_only"
    assert answer(peer, "ada:2", stroke("s-ada", 500.0))["type"] == "ack"
    mine = scored(peer, 83)
    wall = Wall(server, terrain=teacher.terrain, secret=teacher.secret, lesson=teacher.made["id"])
    wall.until(lambda: wall.copies and (wall.copies[1]["score"] or {}).get("points") == mine["points"])
    assert wall.copies[1]["score"]["text"] == mine["text"]
    assert wall.copies[1]["settings"]["task"] is None
    easier = TASK | {"goal": GOAL | {"at_least_m2": 1e3}}
    own.ops(("own:2", set_task(easier)))
    own.wait("ack")
    assert teacher.ask("push")[0] == 200
    assert scored(peer, 100)["text"].startswith("100 of 100: ")
    row = collected(teacher)[0]
    assert (row["names"], row["score"]) == ("Ada", "100")
    assert row["score_text"].startswith("100 of 100: ")


def collected(teacher: Teacher) -> list[dict[str, str]]:
    status, job = teacher.ask("collections")
    assert status == 202, job
    deadline = time.monotonic() + PATIENCE
    while job["stage"] not in ("done", "failed"):
        assert time.monotonic() < deadline
        job = teacher.server.http("GET", f"{teacher.path}/collections/{job['id']}", secret=teacher.secret)[1]
    _, data, _ = teacher.server.raw("GET", f"{teacher.path}/collections/{job['id']}/file", secret=teacher.secret)
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        return list(csv.DictReader(io.StringIO(archive.read("class.csv").decode("utf-8-sig"))))


def test_a_task_that_nobody_changes_is_not_scored_again(server: LiveServer) -> None:
    """SPEC L108: a change that the ground does not follow from tells nobody anything."""
    room = a_class(server, "calm")
    answer(room.teacher, "calm-t:0", set_task())
    scored(room.anne, 0)
    answer(room.teacher, "calm-t:1", stroke("s-label", 0.0))
    answer(room.teacher, "calm-t:2", set_op("s-label", label="A"))
    room.anne.settled(3)
    assert sum(message["type"] == "score" for message in room.anne.seen) == 1
