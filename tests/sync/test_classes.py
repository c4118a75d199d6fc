"""A copy for everyone: coming in, what a teacher does to all copies, deletion (SPEC L60 to L80)."""

from __future__ import annotations

import asyncio
import csv
import io
import secrets
import time
import zipfile
from pathlib import Path
from typing import Any

import pytest

from esker import contract as c
from esker.document import archive
from esker.document.ops import Refusal
from esker.document.wire import document_json
from esker.fairness.shares import Rates
from esker.store.classes import ClassStore
from tests.store.engines import sqlite
from tests.sync.harness import PATIENCE, LiveServer, Peer, set_op, stroke


class Teacher:
    """An owner of a terrain with a class."""

    def __init__(self, server: LiveServer, **body: Any) -> None:
        self.server = server
        self.terrain, self.secret = server.create(settings=c.TerrainSettings(title="Valley"))
        status, self.made = server.http("POST", f"/api/terrains/{self.terrain}/classes", body, self.secret)
        assert status == 201, self.made
        self.path = f"/api/terrains/{self.terrain}/classes/{self.made['id']}"

    def ask(self, what: str, body: Any = None) -> tuple[int, Any]:
        return self.server.http("POST", f"{self.path}/{what}", {} if body is None else body, self.secret)

    def told(self) -> dict[str, Any]:
        listed = self.server.http("GET", f"/api/terrains/{self.terrain}/classes", secret=self.secret)[1]
        return next(each for each in listed if each["id"] == self.made["id"])


class Pupil:
    """A device of a class."""

    def __init__(self, teacher: Teacher, name: str = "", seat: str | None = None, **body: Any) -> None:
        self.server, self.seat = teacher.server, seat or secrets.token_urlsafe(24)
        sent = {"code": teacher.made["code"], "seat": self.seat, "name": name, **body}
        self.status, self.got = self.server.http("POST", f"/api/classes/{teacher.made['id']}/seats", sent)

    @property
    def terrain(self) -> str:
        assert self.status == 201, self.got
        return str(self.got["id"])

    def join(self, client: str) -> Peer:
        return self.server.join(self.terrain, self.seat, client)


@pytest.fixture(autouse=True)
def _patient(server: LiveServer) -> None:
    """All these pupils sit behind one address, and are more than one class."""
    state: Any = server.state
    state.new_terrains, state.code_tries = Rates(), Rates()


@pytest.fixture(name="teacher")
def _teacher(server: LiveServer) -> Teacher:
    return Teacher(server)


def _drawn(peer: Peer, client: str, stroke_id: str, n: int = 1) -> None:
    peer.ops((f"{client}:{n}", stroke(stroke_id)))
    peer.wait("ack")


def _strokes(server: LiveServer, terrain: str, secret: str) -> set[str]:
    document = server.http("GET", f"/api/terrains/{terrain}/document", secret=secret)[1]
    return {each["id"] for each in document["strokes"]}


def test_a_code_asks_for_a_name_and_gives_a_copy(server: LiveServer, teacher: Teacher) -> None:
    """SPEC L60: each device its own, with what was drawn before, and it may draw there."""
    status, asked = server.http("POST", "/api/join", {"code": teacher.made["code"].lower()})
    assert (status, asked["class"], asked["title"], asked["groups"]) == (200, teacher.made["id"], "Valley", [])
    assert "secret" not in asked
    ada, ben = Pupil(teacher, "Ada"), Pupil(teacher, "Ben")
    assert ada.terrain != ben.terrain
    assert teacher.terrain not in (ada.terrain, ben.terrain)
    with_ada = ada.join("ada1")
    _drawn(with_ada, "ada1", "s1")
    assert _strokes(server, ada.terrain, ada.seat) == {"s1"}
    assert _strokes(server, ben.terrain, ben.seat) == set()
    assert server.http("GET", f"/api/terrains/{ben.terrain}", secret=ada.seat)[0] == 403
    told = with_ada.seen[-1] if with_ada.seen[-1]["type"] == "class" else with_ada.seen[1]
    lessons = [m for m in with_ada.seen if m["type"] == "class"]
    assert told["type"] in ("class", "progress")
    assert (lessons[0]["number"], lessons[0]["names"], lessons[0]["frozen"]) == (1, ["Ada"], False)


def test_a_class_that_comes_in_reads_and_writes_its_beginning_once(
    server: LiveServer, teacher: Teacher, monkeypatch: pytest.MonkeyPatch
) -> None:
    """SPEC L166: however many there are, and copies are what they were; a new beginning is read anew."""
    done: list[str] = []
    read = ClassStore.document

    def counted(store: ClassStore, lesson: str) -> Any:
        done.append("read")
        return read(store, lesson)

    def noted(document: c.Document) -> str:
        done.append("written")
        return document_json(document)

    monkeypatch.setattr(ClassStore, "document", counted)
    monkeypatch.setattr("esker.lesson.beginnings.document_json", noted)
    own = server.join(teacher.terrain, teacher.secret, "t")
    own.ops(("t:1", stroke("s1")), ("t:2", {"type": "stroke.finish", "stroke": "s1"}))
    own.wait("ack")
    assert teacher.ask("push") == (200, {"changed": 0})
    done.clear()
    pupils = [Pupil(teacher, name) for name in ("Ada", "Ben", "Cleo")]
    assert done == ["read", "written"]
    texts = [server.http("GET", f"/api/terrains/{one.terrain}/document", secret=one.seat)[1] for one in pupils]
    assert len({one.terrain for one in pupils}) == 3
    for one, text in zip(pupils, texts, strict=True):
        assert text.pop("id") == one.terrain
        assert [each["id"] for each in text["strokes"]] == ["s1"]
    assert texts[0] == texts[1] == texts[2]
    own.ops(("t:3", stroke("s2")), ("t:4", {"type": "stroke.finish", "stroke": "s2"}))
    own.wait("ack")
    assert teacher.ask("push") == (200, {"changed": 3})
    late = Pupil(teacher, "Dan")
    assert _strokes(server, late.terrain, late.seat) == {"s1", "s2"}


def test_the_same_seat_is_the_same_copy(server: LiveServer, teacher: Teacher) -> None:
    """SPEC L61: the answer may be lost, the page reloaded: nobody gets a second copy."""
    first = Pupil(teacher, "Ada")
    again = Pupil(teacher, "Somebody else", seat=first.seat)
    assert (again.status, again.got) == (201, first.got)
    assert server.http("GET", "/api/seat", secret=first.seat) == (200, first.got)
    assert teacher.told()["copies"] == 1
    other = Teacher(server)
    assert Pupil(other, seat=first.seat).status == 409
    assert server.http("GET", "/api/seat", secret="x" * 40)[0] == 404


def test_a_class_outlives_the_server(tmp_path: Path) -> None:
    """SPEC L62: restarted mid-lesson, the code still opens it, and whoever was in comes back to their copy."""
    with LiveServer(tmp_path) as server:
        teacher = Teacher(server)
        ada = Pupil(teacher, "Ada")
        _drawn(ada.join("ada1"), "ada1", "s1")
        assert teacher.ask("freeze", {"frozen": True})[0] == 200
    with LiveServer(tmp_path) as server:
        teacher.server = ada.server = server
        assert server.http("GET", "/api/seat", secret=ada.seat)[1] == ada.got
        peer = ada.join("ada2")
        assert [s["id"] for s in peer.welcome["document"]["strokes"]] == ["s1"]
        assert peer.wait("class")["frozen"]
        assert Pupil(teacher, "Ben").got["number"] == 2
        assert teacher.told()["code"] == teacher.made["code"]


@pytest.mark.parametrize("name", ["", "Ada", "Zoë 🏔️", "=1+1"])
def test_names_need_not_be_there_nor_differ(server: LiveServer, teacher: Teacher, name: str) -> None:
    """SPEC L63."""
    assert Pupil(teacher, name).got["name"] == Pupil(teacher, name).got["name"] == name
    assert teacher.told()["pupils"] == 2


def test_a_name_is_bounded(teacher: Teacher) -> None:
    """SPEC L63: 200 emoji are refused with a sentence, and no copy is made."""
    refused = Pupil(teacher, "🏔" * 200)
    assert (refused.status, refused.got["code"]) == (400, "malformed")
    assert teacher.told()["copies"] == 0


def test_one_more_than_the_class_takes(server: LiveServer) -> None:
    """SPEC L64: the thirty-first of thirty is told so; who is in stays in, and comes back."""
    teacher = Teacher(server, places=30)
    pupils = [Pupil(teacher, f"P{n}") for n in range(30)]
    late = Pupil(teacher, "Late")
    assert (late.status, late.got["code"]) == (409, "class_full")
    assert len({pupil.terrain for pupil in pupils}) == 30
    assert server.http("GET", "/api/seat", secret=pupils[3].seat)[1] == pupils[3].got
    assert Pupil(teacher, seat=pupils[7].seat).got == pupils[7].got


def test_groups_share_a_copy(server: LiveServer) -> None:
    """SPEC L65: assigned, chosen, or a new one; never more than the teacher said."""
    teacher = Teacher(server, together=2)
    ada, ben, cleo = Pupil(teacher, "Ada"), Pupil(teacher, "Ben"), Pupil(teacher, "Cleo", number=0)
    assert [p.got["number"] for p in (ada, ben, cleo)] == [1, 1, 2]
    groups = server.http("POST", "/api/join", {"code": teacher.made["code"]})[1]["groups"]
    assert groups == [{"number": 2, "names": ["Cleo"]}]
    assert Pupil(teacher, "Dan", number=1).got["code"] == "group_full"
    assert Pupil(teacher, "Dan", number=9).got["code"] == "group_full"
    assert Pupil(teacher, "Dan", number=2).terrain == cleo.terrain
    _drawn(ada.join("ada3"), "ada3", "s1")
    assert [s["id"] for s in ben.join("ben3").welcome["document"]["strokes"]] == ["s1"]


def test_a_wrong_code_counts_as_a_guess(tmp_path: Path) -> None:
    """SPEC L66: by address and over the whole server, as for any join code; a closed door opens nothing."""
    with LiveServer(tmp_path) as server:
        teacher = Teacher(server)
        assert teacher.ask("door", {"open": False})[1]["code"] is None
        assert Pupil(teacher, "Ada").got["code"] == "bad_code"
        again = teacher.ask("door", {"open": True})[1]
        assert again["code"] != teacher.made["code"]
        teacher.made = again
        assert Pupil(teacher, "Ada").status == 201
        other = Teacher(server)
        other.made = other.made | {"id": teacher.made["id"]}
        assert Pupil(other, "Eve").got["code"] == "bad_code"
        teacher.made = again | {"code": "AAAAAA"}
        answers = [Pupil(teacher, "Eve").got["code"] for _ in range(70)]
        assert set(answers) == {"bad_code", "rate_limited"}
        assert answers[-1] == "rate_limited"


def test_only_owners_of_the_terrain_are_its_teachers(server: LiveServer, teacher: Teacher) -> None:
    """SPEC L67: by no other link, no other terrain, and no copy."""
    ada = Pupil(teacher, "Ada")
    _, link = server.http("POST", f"/api/terrains/{teacher.terrain}/links", {"role": "edit"}, teacher.secret)
    other = Teacher(server)
    for what, body in (("freeze", {"frozen": True}), ("restart", {}), ("push", {}), ("show", {"number": 1}),
                       ("open", {"number": 1}), ("together", {"numbers": [1]}), ("door", {"open": True}),
                       ("collections", {})):  # fmt: skip
        for secret in (link["secret"], ada.seat):
            assert server.http("POST", f"{teacher.path}/{what}", body, secret)[0] == 403, what
        wrong = f"/api/terrains/{other.terrain}/classes/{teacher.made['id']}/{what}"
        assert server.http("POST", wrong, body, other.secret)[0] == 404, what
    assert server.http("DELETE", teacher.path, secret=link["secret"])[0] == 403
    assert server.http("POST", f"/api/terrains/{ada.terrain}/classes", {}, ada.seat)[0] == 403


def test_a_frozen_copy_is_changed_by_nobody_but_owners(server: LiveServer, teacher: Teacher) -> None:
    """SPEC L68: a client that ignores it gains nothing; it goes on once it is let."""
    ada = Pupil(teacher, "Ada")
    peer = ada.join("ada4")
    peer.wait("class")
    assert teacher.ask("freeze", {"frozen": True, "numbers": [1]})[0] == 200
    assert peer.wait("class")["frozen"]
    peer.ops(("ada4:1", stroke("s1")))
    assert peer.wait("reject")["code"] == "frozen"
    _, opened = teacher.ask("open", {"number": 1})
    owner = server.join(opened["id"], opened["secret"], "own4")
    _drawn(owner, "own4", "s2")
    assert teacher.ask("freeze", {"frozen": False})[0] == 200
    assert not peer.wait("class")["frozen"]
    _drawn(peer, "ada4", "s1", 2)
    assert _strokes(server, ada.terrain, ada.seat) == {"s1", "s2"}
    assert teacher.ask("freeze", {"frozen": True, "numbers": [9]})[0] == 404


def test_later_additions_reach_all_copies(server: LiveServer, teacher: Teacher) -> None:
    """SPEC L69, L70: once, also for who comes later; what pupils changed stays."""
    ada, ben = Pupil(teacher, "Ada"), Pupil(teacher, "Ben")
    owner = server.join(teacher.terrain, teacher.secret, "own5")
    _drawn(owner, "own5", "t1")
    owner.ops(("own5:2", {"type": "stroke.finish", "stroke": "t1"}))
    owner.wait("ack")
    _drawn(owner, "own5", "under-way", 3)
    assert teacher.ask("push") == (200, {"changed": 2})
    assert teacher.ask("push") == (200, {"changed": 0})
    assert Pupil(teacher, "Cleo").status == 201
    for each in (ada, ben):
        assert _strokes(server, each.terrain, each.seat) == {"t1"}
    peer = ada.join("ada5")
    peer.ops(("ada5:1", set_op("t1", label="mine")))
    peer.wait("ack")
    owner.ops(("own5:4", {"type": "stroke.delete", "stroke": "t1"}))
    owner.wait("ack")
    assert teacher.ask("push") == (200, {"changed": 2})
    assert _strokes(server, ada.terrain, ada.seat) == {"t1"}
    assert _strokes(server, ben.terrain, ben.seat) == set()


def test_a_copy_starts_again(server: LiveServer, teacher: Teacher) -> None:
    """SPEC L71: its history stays; the others go on."""
    ada, ben = Pupil(teacher, "Ada"), Pupil(teacher, "Ben")
    for each, client in ((ada, "ada6"), (ben, "ben6")):
        _drawn(each.join(client), client, "s1")
    assert teacher.ask("restart", {"numbers": [1]}) == (200, {"changed": 1})
    assert (_strokes(server, ada.terrain, ada.seat), _strokes(server, ben.terrain, ben.seat)) == (set(), {"s1"})
    earlier = server.http("GET", f"/api/terrains/{ada.terrain}/document?at=1", secret=ada.seat)[1]
    assert [each["id"] for each in earlier["strokes"]] == ["s1"]


def test_copies_become_one_terrain(server: LiveServer, teacher: Teacher) -> None:
    """SPEC L72."""
    ada, ben = Pupil(teacher, "Ada"), Pupil(teacher, "Ben")
    for each, client in ((ada, "ada7"), (ben, "ben7")):
        _drawn(each.join(client), client, f"s-{client}")
    status, made = teacher.ask("together", {"numbers": [1, 2], "title": "All of us"})
    assert (status, made["title"]) == (201, "All of us")
    assert _strokes(server, made["id"], made["secret"]) == {"s-ada7", "s-ben7"}


def test_everybody_is_shown_one_copy(server: LiveServer, teacher: Teacher) -> None:
    """SPEC L75: by a link to look, which ends; who comes later is sent there too."""
    ada, ben = Pupil(teacher, "Ada"), Pupil(teacher, "Ben")
    with_ben = ben.join("ben8")
    with_ben.wait("class")
    assert teacher.ask("show", {"number": 1})[0] == 200
    show = with_ben.wait("class")["show"]
    assert (show["terrain"], show["name"]) == (ada.terrain, "Ada")
    looking = server.join(ada.terrain, show["secret"], "ben8b")
    assert looking.welcome["role"] == "view"
    late = Pupil(teacher, "Cleo").join("cleo8")
    assert late.wait("class")["show"] == show
    assert teacher.ask("show", {})[0] == 200
    assert [looking.wait("class")["show"] for _ in range(2)] == [show, None]
    assert with_ben.wait("class")["show"] is None
    assert looking.closed()[0] == c.WS_CLOSE["revoked"]


def test_a_revoked_teacher_loses_the_copies(server: LiveServer, teacher: Teacher) -> None:
    """SPEC L76: what was opened through a link ends with it, in whatever terrain it is; pupils stay."""
    _, second = server.http("POST", f"/api/terrains/{teacher.terrain}/links", {"role": "owner"}, teacher.secret)
    ada = Pupil(teacher, "Ada")
    with_ada = ada.join("ada9")
    _, opened = server.http("POST", f"{teacher.path}/open", {"number": 1}, second["secret"])
    co_teacher = server.join(opened["id"], opened["secret"], "co9")
    assert co_teacher.welcome["role"] == "owner"
    server.http("DELETE", f"/api/terrains/{teacher.terrain}/links/{second['id']}", secret=teacher.secret)
    assert co_teacher.closed()[0] == c.WS_CLOSE["revoked"]
    _drawn(with_ada, "ada9", "s1")


def test_a_class_is_deleted_and_brought_back(server: LiveServer, teacher: Teacher) -> None:
    """SPEC L77: one button; everybody is closed, no link opens a copy; within the grace it comes back whole."""
    ada = Pupil(teacher, "Ada")
    peer = ada.join("ada10")
    _drawn(peer, "ada10", "s1")
    status, gone = server.http("DELETE", teacher.path, secret=teacher.secret)
    assert status == 200
    assert gone["until"] > time.time()
    assert peer.closed()[0] == c.WS_CLOSE["no_terrain"]
    assert server.http("GET", "/api/seat", secret=ada.seat)[0] == 404
    assert server.http("GET", f"/api/terrains/{ada.terrain}", secret=ada.seat)[0] == 410
    assert Pupil(teacher, "Ben").got["code"] == "bad_code"
    assert teacher.ask("freeze", {"frozen": True})[0] == 404
    assert teacher.ask("restore")[0] == 200
    assert server.http("GET", "/api/seat", secret=ada.seat)[1] == ada.got
    assert _strokes(server, ada.terrain, ada.seat) == {"s1"}


def test_a_class_is_deleted_at_once(server: LiveServer, teacher: Teacher) -> None:
    """SPEC L78: then no row of it is left, neither names nor strokes."""
    ada = Pupil(teacher, "Ada Unmistakable")
    _drawn(ada.join("ada11"), "ada11", "s1")
    assert server.http("DELETE", f"{teacher.path}?at_once=true", secret=teacher.secret)[0] == 200
    journal = server.assembly.hub.journal
    assert not journal.exists(ada.terrain)
    text = "\n".join(sqlite(journal).reader().iterdump())
    assert "Ada Unmistakable" not in text
    assert ada.terrain not in text
    assert teacher.ask("restore")[0] == 404


def test_with_the_terrain_go_its_classes(server: LiveServer, teacher: Teacher) -> None:
    """SPEC L79."""
    ada = Pupil(teacher, "Ada")
    assert server.http("DELETE", f"/api/terrains/{teacher.terrain}", secret=teacher.secret)[0] == 200
    assert server.http("GET", "/api/seat", secret=ada.seat)[0] == 404
    assert Pupil(teacher, "Ben").got["code"] == "bad_code"


def test_a_terrain_has_so_many_classes(tmp_path: Path) -> None:
    """SPEC L64: then one must be deleted."""
    with LiveServer(tmp_path) as server:
        teacher = Teacher(server)
        for _ in range(c.MAX_CLASSES - 1):
            assert server.http("POST", f"/api/terrains/{teacher.terrain}/classes", {}, teacher.secret)[0] == 201
        status, refused = server.http("POST", f"/api/terrains/{teacher.terrain}/classes", {}, teacher.secret)
        assert (status, refused["code"]) == (409, "too_many_classes")
        for body in ({"places": 61}, {"places": 0}, {"together": 5}, {"title": "x" * 81}, {"at": -1}):
            assert server.http("POST", f"/api/terrains/{teacher.terrain}/classes", body, teacher.secret)[0] == 400


def test_a_class_begins_at_an_earlier_moment(server: LiveServer) -> None:
    """SPEC L60: what was drawn after it is not in the copies."""
    terrain, owner = server.create()
    peer = server.join(terrain, owner, "own12")
    for n in (1, 2):
        _drawn(peer, "own12", f"s{n}", n)
    _, made = server.http("POST", f"/api/terrains/{terrain}/classes", {"at": 1}, owner)
    seat = secrets.token_urlsafe(24)
    body = {"code": made["code"], "seat": seat}
    _, got = server.http("POST", f"/api/classes/{made['id']}/seats", body)
    assert _strokes(server, got["id"], seat) == {"s1"}


def _collected(teacher: Teacher) -> zipfile.ZipFile:
    status, job = teacher.ask("collections")
    assert status == 202
    path = f"{teacher.path}/collections/{job['id']}"
    deadline = time.monotonic() + PATIENCE
    while job["stage"] not in ("done", "failed"):
        assert time.monotonic() < deadline
        job = teacher.server.http("GET", path, secret=teacher.secret)[1]
    assert job["stage"] == "done", job
    assert teacher.server.http("GET", path, secret=None)[0] == 401
    return zipfile.ZipFile(io.BytesIO(teacher.server.raw("GET", f"{path}/file", None, teacher.secret)[1]))


def test_a_class_is_collected(server: LiveServer, teacher: Teacher) -> None:
    """SPEC L80: a file and a picture of each copy, and a table that no spreadsheet computes with."""
    ada, eve = Pupil(teacher, "Ada / Zoë"), Pupil(teacher, "=1+1")
    _drawn(ada.join("ada13"), "ada13", "s1")
    with _collected(teacher) as collected:
        assert set(collected.namelist()) == {
            "01-ada-zoë.esker",
            "01-ada-zoë.png",
            "02-1-1.esker",
            "02-1-1.png",
            "class.csv",
        }
        document = archive.loads(collected.read("01-ada-zoë.esker"))
        assert [each.id for each in document.strokes] == ["s1"]
        assert collected.read("01-ada-zoë.png").startswith(b"\x89PNG")
        rows = list(csv.DictReader(io.StringIO(collected.read("class.csv").decode("utf-8-sig"))))
    assert [(row["copy"], row["names"], row["strokes"]) for row in rows] == [
        ("1", "Ada / Zoë", "1"),
        ("2", "'=1+1", "0"),
    ]
    assert rows[0]["last_changed"] > "2"
    assert rows[1]["last_changed"] == ""
    assert eve.status == 201


def test_a_laptop_sleeps_and_returns(server: LiveServer, teacher: Teacher) -> None:
    """SPEC L74: it resumes in its copy, with what was pushed and whether it is frozen; it loses nothing of its own."""
    ada = Pupil(teacher, "Ada")
    peer = ada.join("ada20")
    _drawn(peer, "ada20", "mine")
    peer.ws.socket.close()  # no farewell
    owner = server.join(teacher.terrain, teacher.secret, "own20")
    _drawn(owner, "own20", "t1")
    owner.ops(("own20:2", {"type": "stroke.finish", "stroke": "t1"}))
    owner.wait("ack")
    assert teacher.ask("push") == (200, {"changed": 1})
    assert teacher.ask("freeze", {"frozen": True})[0] == 200
    back = server.join(ada.terrain, ada.seat, "ada20", clock=1)
    assert [each["op"]["type"] for each in back.welcome["ops"]] == ["group"]
    assert back.wait("class")["frozen"]
    back.ops(("ada20:2", set_op("mine", label="late")))
    assert back.wait("reject")["code"] == "frozen"
    assert _strokes(server, ada.terrain, ada.seat) == {"mine", "t1"}


def test_a_class_comes_in_behind_one_address(tmp_path: Path) -> None:
    """SPEC L66: a right code counts once for each device, so forty devices of one school come in at once."""
    with LiveServer(tmp_path) as server:
        teacher = Teacher(server)
        for n in range(c.DEFAULT_PUPILS):
            assert server.http("POST", "/api/join", {"code": teacher.made["code"]})[0] == 200
            assert Pupil(teacher, f"P{n}").status == 201


def test_nothing_is_laid_in_a_frozen_copy(server: LiveServer, teacher: Teacher) -> None:
    """SPEC L68: an import that is ready is refused like an op."""
    ada = Pupil(teacher, "Ada")
    peer = ada.join("ada21")
    assert teacher.ask("freeze", {"frozen": True})[0] == 200
    assert [peer.wait("class")["frozen"] for _ in range(2)] == [False, True]
    room = server.assembly.hub.open_room(ada.terrain)
    assert room is not None
    op = c.SetTerrain(fields=c.TerrainFields(title="by an import"))
    with pytest.raises(Refusal, match="frozen"):
        asyncio.run_coroutine_threadsafe(room.perform(op, "import-1", "ada21"), room._loop).result(PATIENCE)
