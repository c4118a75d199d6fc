"""A lesson over real sockets: clients that ignore every switch gain nothing (SPEC L1 to L23)."""

from __future__ import annotations

import shutil
import time
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from esker import contract as c
from esker.session.room import conducting
from tests.sync.harness import LiveServer, Peer, set_op, stroke


class Class(NamedTuple):
    """A terrain with a teacher and two pupils, who came by one link that lets draw."""

    terrain: str
    owner: str
    edit: str
    teacher: Peer
    anne: Peer
    ben: Peer


def person(peer: Peer) -> str:
    """Who a member is."""
    client = peer.welcome["client"]
    return str(next(m["person"] for m in peer.welcome["members"] if m["client"] == client))


def come(server: LiveServer, room: tuple[str, str], client: str, **hello: Any) -> Peer:
    """Somebody who comes in by a link (terrain, secret)."""
    return server.join(*room, client, **hello)


def a_class(server: LiveServer, tag: str) -> Class:
    terrain, owner = server.create()
    _, made = server.http("POST", f"/api/terrains/{terrain}/links", {"role": "edit"}, owner)
    edit = made["secret"]
    teacher = server.join(terrain, owner, f"{tag}-t", name="Ms Ray")
    anne = server.join(terrain, edit, f"{tag}-a", name="Anne")
    ben = server.join(terrain, edit, f"{tag}-b", name="Ben")
    return Class(terrain, owner, edit, teacher, anne, ben)


def lesson(peer: Peer, **wanted: Any) -> dict[str, Any]:
    """The next state of the lesson that has these values."""
    while True:
        found = peer.wait("lesson")
        if all(found[key] == value for key, value in wanted.items()):
            return found


def people(peer: Peer, action: str, *others: Peer) -> None:
    peer.say("people", action=action, people=[person(each) for each in others])


def answer(peer: Peer, op_id: str, op: dict[str, Any]) -> dict[str, Any]:
    """What the server says to an op: ``ack`` or ``reject``."""
    peer.ops((op_id, op))
    return peer.wait("ack", "reject")


def strokes(server: LiveServer, room: Class) -> dict[str, Any]:
    _, document = server.http("GET", f"/api/terrains/{room.terrain}/document", secret=room.owner)
    return {each["id"]: each for each in document["strokes"]}


def test_hands_off_holds_against_who_ignores_it(server: LiveServer) -> None:
    """SPEC L1, L2: and the refusal is a sentence; the teacher goes on; a pen lets one draw."""
    room = a_class(server, "off")
    assert answer(room.anne, "off-a:0", stroke("s-anne"))["type"] == "ack"
    room.teacher.say("conduct", hands_off=True)
    assert lesson(room.teacher, hands_off=True)["draws"] is True
    assert lesson(room.anne, hands_off=True)["draws"] is False
    attacks = [
        stroke("s-new"),
        {"type": "stroke.append", "stroke": "s-anne", "start": 2, "points": [[2, 9]], "last": [0, 0, 0]},
        {"type": "stroke.finish", "stroke": "s-anne"},
        set_op("s-anne", label="mine"),
        {"type": "stroke.anchor", "stroke": "s-anne", "which": "first", "to": [1, 1, 1]},
        {"type": "stroke.delete", "stroke": "s-anne"},
        {"type": "terrain.set", "fields": {"title": "mine"}},
        {"type": "layer.delete", "layer": "g"},
        {"type": "group", "ops": [{"type": "terrain.set", "fields": {"title": "mine"}}]},
    ]
    for number, op in enumerate(attacks, 1):
        refused = answer(room.anne, f"off-a:{number}", op)
        assert (refused["type"], refused["code"]) == ("reject", "hands_off")
        assert refused["message"].startswith("Hands off")
    assert answer(room.teacher, "off-t:0", stroke("s-teacher"))["type"] == "ack"
    people(room.teacher, "pen", room.ben)
    assert lesson(room.ben, draws=True)["hands_off"] is True
    assert answer(room.ben, "off-b:0", stroke("s-ben"))["type"] == "ack"
    assert answer(room.anne, "off-a:90", stroke("s-more"))["code"] == "hands_off"
    people(room.teacher, "no_pen", room.ben)
    lesson(room.ben, draws=False)
    assert answer(room.ben, "off-b:1", stroke("s-ben2"))["code"] == "hands_off"
    room.teacher.say("conduct", hands_off=False)
    lesson(room.anne, draws=True)
    assert answer(room.anne, "off-a:91", stroke("s-more"))["type"] == "ack"
    assert set(strokes(server, room)) == {"s-anne", "s-teacher", "s-ben", "s-more"}


def test_a_stroke_in_hand_ends_as_it_is(server: LiveServer) -> None:
    """SPEC L3: by an op in its author's name, so that it stays theirs to undo."""
    room = a_class(server, "hand")
    answer(room.anne, "hand-a:0", stroke("s-hand"))
    room.teacher.say("conduct", hands_off=True)
    lesson(room.anne, hands_off=True)
    finishes = {"type": "group", "ops": [{"type": "stroke.finish", "stroke": "s-hand"}]}
    told = None
    while told is None:
        ordered = [op for message in room.anne.seen if message["type"] == "ordered" for op in message["ops"]]
        told = next((each for each in ordered if each["op"] == finishes), None)
        if told is None:
            room.anne.next()
    assert told["author"] == "hand-a"
    assert strokes(server, room)["s-hand"]["finished"] is True


def test_only_conductors_switch_and_name(server: LiveServer) -> None:
    """SPEC L4: whoever else sends what conductors send is told so, and nothing happens."""
    room = a_class(server, "who")
    looker = server.http("POST", f"/api/terrains/{room.terrain}/links", {"role": "view"}, room.owner)[1]["secret"]
    viewer = server.join(room.terrain, looker, "who-v")
    for peer in (room.anne, viewer):
        peer.say("conduct", hands_off=True, protect=True, hide=True, animals="en", look=True)
        assert "Only whoever leads" in peer.wait("notice")["text"]
        for action in ("pen", "conductor", "remove", "let_in", "undo"):
            people(peer, action, room.ben)
            assert "Only whoever leads" in peer.wait("notice")["text"]
    again = server.join(room.terrain, room.edit, "who-x")
    assert again.welcome["lesson"] == c.Lesson().model_dump(mode="json")


def test_an_owner_hands_the_baton_on(server: LiveServer) -> None:
    """SPEC L5: to a person, over reloads of the page; who has it cannot hand it on, nor send an owner out."""
    room = a_class(server, "baton")
    people(room.teacher, "conductor", room.anne)
    lesson(room.anne, conducts=True)
    room.anne.say("conduct", hands_off=True)
    assert lesson(room.ben, hands_off=True)["draws"] is False
    people(room.anne, "conductor", room.ben)
    assert "Only an owner" in room.anne.wait("notice")["text"]
    people(room.anne, "remove", room.teacher)
    assert "owner" in room.anne.wait("notice")["text"]
    room.anne.close()
    back = server.join(room.terrain, room.edit, "baton-a2", ticket=room.anne.welcome["ticket"])
    assert back.welcome["lesson"]["conducts"] is True
    people(room.teacher, "no_conductor", back)
    assert lesson(back, conducts=False)["draws"] is False


def test_the_last_order_of_two_teachers_counts(server: LiveServer) -> None:
    """SPEC L6."""
    room = a_class(server, "two")
    people(room.teacher, "conductor", room.anne)
    lesson(room.anne, conducts=True)
    for turn in range(6):
        room.teacher.say("conduct", hands_off=True, hide=bool(turn % 2))
        lesson(room.teacher, hands_off=True, hide=bool(turn % 2))
        room.anne.say("conduct", hands_off=False)
        assert lesson(room.anne, hands_off=False)["hide"] is bool(turn % 2)
    assert lesson(room.ben, hands_off=False, hide=True)["draws"] is True


def test_forged_ops_cost_their_sender(server: LiveServer) -> None:
    """SPEC L7: while hands are off a flood is refused and then closed; others do not notice."""
    room = a_class(server, "flood")
    room.teacher.say("conduct", hands_off=True)
    lesson(room.anne, hands_off=True)
    for batch in range(40):
        room.anne.ops(*((f"flood-a:{64 * batch + k}", set_op("none", label="x")) for k in range(64)))
    code, error = room.anne.closed()
    assert code == c.WS_CLOSE["rate_limited"]
    assert error is not None
    assert answer(room.teacher, "flood-t:0", stroke("s"))["type"] == "ack"
    assert set(strokes(server, room)) == {"s"}


def test_a_restart_in_the_middle_of_a_lesson(tmp_path: Path) -> None:
    """SPEC L8: switches, pens, conductors, who was removed and what is protected are there again."""
    with LiveServer(tmp_path) as server:
        room = a_class(server, "re")
        answer(room.teacher, "re-t:0", stroke("s-teacher"))
        answer(room.anne, "re-a:0", stroke("s-anne"))
        people(room.teacher, "pen", room.anne)
        lesson(room.anne)
        people(room.teacher, "remove", room.ben)
        room.teacher.say("conduct", hands_off=True, protect=True, look=True, held=True)
        lesson(room.teacher, hands_off=True, protect=True)
    with LiveServer(tmp_path) as server:
        anne = server.join(room.terrain, room.edit, "re-a2", ticket=room.anne.welcome["ticket"])
        stands = anne.welcome["lesson"]
        assert (stands["hands_off"], stands["protect"], stands["draws"]) == (True, True, True)
        assert answer(anne, "re-a2:0", set_op("s-teacher", label="mine"))["code"] == "protected"
        assert answer(anne, "re-a2:1", set_op("s-anne", label="mine"))["type"] == "ack"
        assert stands["look"] is None
        teacher = server.join(room.terrain, room.owner, "re-t2", ticket=room.teacher.welcome["ticket"])
        assert lesson(anne, look="re-t2")["held"] is True
        assert [each["name"] for each in teacher.welcome["lesson"]["removed"]] == ["Ben"]
        ben = Peer(server.socket())
        ticket = room.ben.welcome["ticket"]
        ben.say("hello", protocol=c.PROTOCOL_VERSION, terrain=room.terrain, secret=room.edit, client="z", ticket=ticket)
        assert ben.closed()[0] == c.WS_CLOSE["removed"]


def test_a_kill_in_the_middle_of_a_lesson(tmp_path: Path) -> None:
    """SPEC L8: what was told is on the disk; a copy of it at that moment is what a killed server leaves."""
    with LiveServer(tmp_path / "living") as server:
        room = a_class(server, "kill")
        room.teacher.say("conduct", hands_off=True, animals="en")
        lesson(room.anne, hands_off=True, animals="en")
        shutil.copytree(tmp_path / "living", tmp_path / "killed")
    with LiveServer(tmp_path / "killed") as server:
        anne = server.join(room.terrain, room.edit, "kill-a2", ticket=room.anne.welcome["ticket"])
        assert (anne.welcome["lesson"]["hands_off"], anne.welcome["lesson"]["animals"]) == (True, "en")
        assert answer(anne, "kill-a2:0", stroke("s"))["code"] == "hands_off"


def refused_at(server: LiveServer, room: Class, client: str, secret: str = "", **hello: Any) -> dict[str, Any]:
    """The farewell of somebody who may not come in."""
    peer = Peer(server.socket())
    fields = {"protocol": c.PROTOCOL_VERSION, "terrain": room.terrain, "secret": secret or room.edit, "client": client}
    peer.say("hello", **fields, **hello)
    code, error = peer.closed()
    assert code == c.WS_CLOSE["removed"]
    assert error is not None
    return error


def test_who_was_removed_stays_out(server: LiveServer) -> None:
    """SPEC L9, L10: by the same link under a new client id, without or with the ticket; others go on and come again."""
    room = a_class(server, "out")
    people(room.teacher, "remove", room.ben)
    assert room.ben.closed()[0] == c.WS_CLOSE["removed"]
    assert "let you in" in refused_at(server, room, "out-1", ticket=room.ben.welcome["ticket"])["message"]
    assert "let you in" in refused_at(server, room, "out-2")["message"]
    own = room.ben.welcome["ticket"]
    forged = own[:-1] + ("0" if own[-1] != "0" else "1")
    refused_at(server, room, "out-3", ticket=forged)
    assert answer(room.anne, "out-a:0", stroke("s"))["type"] == "ack"
    room.anne.close()
    anne = server.join(room.terrain, room.edit, "out-a2", ticket=room.anne.welcome["ticket"])
    assert lesson(room.teacher, conducts=True)["removed"] == [{"person": person(room.ben), "name": "Ben"}]
    # A stranger from the same address waits, and is let in by name; so is who was removed.
    knock = refused_at(server, room, "out-4", name="Cleo")
    cleo = None
    while cleo is None:
        cleo = next((each["person"] for each in lesson(room.teacher)["waiting"] if each["name"] == "Cleo"), None)
    room.teacher.say("people", action="let_in", people=[cleo])
    lesson(anne)
    assert come(server, (room.terrain, room.edit), "out-5", ticket=knock["ticket"]).welcome["type"] == "welcome"
    refused_at(server, room, "out-6", ticket=room.ben.welcome["ticket"])
    people(room.teacher, "let_in", room.ben)
    lesson(anne)
    back = come(server, (room.terrain, room.edit), "out-7", ticket=room.ben.welcome["ticket"])
    assert back.welcome["type"] == "welcome"


def test_who_left_in_time_is_removed_all_the_same(server: LiveServer) -> None:
    """SPEC L10."""
    room = a_class(server, "fled")
    room.ben.close()
    while any(m["client"] == "fled-b" for m in room.teacher.wait("members")["members"]):
        pass
    people(room.teacher, "remove", room.ben)
    assert lesson(room.teacher)["removed"][0]["name"] == "Ben"
    refused_at(server, room, "fled-b2")


def test_a_code_lets_nobody_back_who_was_removed(server: LiveServer) -> None:
    """SPEC L11: the link that the code made ends, over HTTP too; the same code gives no way around."""
    room = a_class(server, "code")
    code = server.http("POST", f"/api/terrains/{room.terrain}/codes", {"role": "edit"}, room.owner)[1]["code"]
    first = server.http("POST", "/api/join", {"code": code})[1]["secret"]
    cleo = server.join(room.terrain, first, "code-c", name="Cleo")
    people(room.teacher, "remove", cleo)
    assert cleo.closed()[0] == c.WS_CLOSE["removed"]
    deadline = time.monotonic() + 60
    while server.http("GET", f"/api/terrains/{room.terrain}", secret=first)[0] != 403:
        assert time.monotonic() < deadline
    second = server.http("POST", "/api/join", {"code": code})[1]["secret"]
    refused_at(server, room, "code-c2", second)
    refused_at(server, room, "code-c3", second, ticket=cleo.welcome["ticket"])
    refused_at(server, room, "code-c4", second, at=0)
    status, found = server.http("POST", f"/api/terrains/{room.terrain}/imports?name=a.asc", b"x", second)
    assert (status, found["code"]) == (403, "removed")
    assert answer(room.anne, "code-a:0", stroke("s"))["type"] == "ack"


def test_files_wait_while_hands_are_off(server: LiveServer) -> None:
    """SPEC L12: no file comes in around the switch."""
    room = a_class(server, "file")
    room.teacher.say("conduct", hands_off=True)
    lesson(room.anne, hands_off=True)
    status, found = server.http("POST", f"/api/terrains/{room.terrain}/imports?name=a.asc", b"x", room.edit)
    assert (status, found["code"]) == (403, "hands_off")
    assert server.http("POST", f"/api/terrains/{room.terrain}/imports?name=a.asc", b"x", room.owner)[0] == 202


def test_views_follow_who_shows(server: LiveServer, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC L13, L14: late joiners too; a reload within the grace goes on showing; who stays away ends it."""
    room = a_class(server, "look")
    room.teacher.say("presence", eye=[1, 2, 3], target=[4, 5, 6])
    room.teacher.say("conduct", look=True, held=True)
    assert lesson(room.anne, look="look-t")["held"] is True
    late = server.join(room.terrain, room.edit, "look-late")
    assert late.welcome["lesson"]["look"] == "look-t"
    shown = late.wait("presences")["members"]
    assert [each["eye"] for each in shown if each["client"] == "look-t"] == [[1, 2, 3]]
    room.teacher.close()
    assert lesson(room.anne, look=None)["held"] is True
    teacher = server.join(room.terrain, room.owner, "look-t2", ticket=room.teacher.welcome["ticket"])
    assert lesson(room.anne, look="look-t2")["held"] is True
    monkeypatch.setattr(conducting, "GRACE_SECONDS", 0.0)
    teacher.close()
    assert lesson(room.anne, look=None, held=False)["type"] == "lesson"
    assert (
        server.join(room.terrain, room.owner, "look-t3", ticket=teacher.welcome["ticket"]).welcome["lesson"]["look"]
        is None
    )


def test_what_the_teacher_drew_is_protected(server: LiveServer) -> None:
    """SPEC L15, L16: from every op of a client that ignores it; settings too; what pupils drew stays theirs."""
    room = a_class(server, "keep")
    answer(room.teacher, "keep-t:0", stroke("s-teacher"))
    answer(room.teacher, "keep-t:1", stroke("s-gone"))
    answer(room.teacher, "keep-t:2", {"type": "stroke.delete", "stroke": "s-gone"})
    answer(room.anne, "keep-a:0", stroke("s-anne"))
    room.teacher.say("conduct", protect=True)
    lesson(room.ben, protect=True)
    attacks: list[dict[str, Any]] = [
        {"type": "stroke.append", "stroke": "s-teacher", "start": 2, "points": [[2, 9]], "last": [0, 0, 0]},
        {"type": "stroke.finish", "stroke": "s-teacher"},
        set_op("s-teacher", hidden=True),
        {"type": "stroke.anchor", "stroke": "s-teacher", "which": "first", "to": [1, 1, 1]},
        {"type": "stroke.delete", "stroke": "s-teacher"},
        {"type": "stroke.restore", "stroke": "s-gone"},
        {"type": "terrain.set", "fields": {"sea_level_m": 100}},
        {"type": "group", "ops": [set_op("s-anne", label="x"), {"type": "stroke.delete", "stroke": "s-teacher"}]},
    ]
    for number, op in enumerate(attacks):
        assert answer(room.ben, f"keep-b:{number}", op)["code"] == "protected"
    assert answer(room.ben, "keep-b:90", set_op("s-anne", label="ours"))["type"] == "ack"
    answer(room.teacher, "keep-t:3", stroke("s-later"))
    assert answer(room.ben, "keep-b:91", {"type": "stroke.delete", "stroke": "s-later"})["code"] == "protected"
    assert strokes(server, room)["s-anne"]["label"] == "ours"
    people(room.teacher, "conductor", room.anne)
    lesson(room.anne, conducts=True)
    assert answer(room.ben, "keep-b:92", {"type": "stroke.delete", "stroke": "s-anne"})["code"] == "protected"
    room.teacher.say("conduct", protect=False)
    lesson(room.ben, protect=False)
    assert answer(room.ben, "keep-b:93", {"type": "stroke.delete", "stroke": "s-teacher"})["type"] == "ack"


def test_names_and_cursors_are_not_sent(server: LiveServer) -> None:
    """SPEC L17, L18: to who does not conduct, by no message and no route."""
    room = a_class(server, "hide")
    named = stroke("s-anne")
    named["stroke"]["author"] = "Anne"
    answer(room.anne, "hide-a:0", named)
    room.teacher.say("conduct", hide=True)
    lesson(room.ben, hide=True)
    late = server.join(room.terrain, room.edit, "hide-l", name="Lou")
    assert {m["client"] for m in late.welcome["members"]} == {"hide-l", "hide-t"}
    assert late.welcome["document"]["strokes"][0]["author"] == ""
    room.ben.seen.clear()
    room.anne.say("presence", cursor=[1, 2, 3])
    room.anne.say("rename", name="Annegret")
    again = stroke("s-again")
    again["stroke"]["author"] = "Annegret"
    answer(room.anne, "hide-a:1", again)
    room.teacher.say("presence", cursor=[7, 8, 9])
    while not any(each["client"] == "hide-t" for each in room.ben.wait("presences")["members"]):
        pass
    assert "Anne" not in str(room.ben.seen)
    assert "[1.0, 2.0, 3.0]" not in str(room.ben.seen)
    assert "Anne" in str(room.teacher.wait("members"))
    for path in ("history", "document"):
        assert "Anne" not in str(server.http("GET", f"/api/terrains/{room.terrain}/{path}", secret=room.edit))
    assert "Anne" in str(server.http("GET", f"/api/terrains/{room.terrain}/history", secret=room.owner))


def test_the_server_names_people_after_animals(server: LiveServer) -> None:
    """SPEC L19: other names than those are neither told nor stored; each has one, the same after a reload."""
    room = a_class(server, "zoo")
    room.teacher.say("conduct", animals="de")
    lesson(room.anne, animals="de")
    named = stroke("s-anne")
    named["stroke"]["author"] = "Anne"
    answer(room.anne, "zoo-a:0", named)
    crowd = [server.join(room.terrain, room.edit, f"zoo-{k}", name=f"Child {k}") for k in range(40)]
    names = {m["client"]: m["name"] for m in crowd[-1].welcome["members"]}
    assert len(set(names.values())) == 43
    assert names["zoo-t"] == "Ms Ray"
    assert "Child" not in str(names)
    assert "Anne" not in str(names)
    crowd[3].say("rename", name="Child again")
    crowd[3].close()
    back = server.join(room.terrain, room.edit, "zoo-back", ticket=crowd[3].welcome["ticket"])
    assert next(m["name"] for m in back.welcome["members"] if m["client"] == "zoo-back") == names["zoo-3"]
    assert strokes(server, room)["s-anne"]["author"] == names["zoo-a"]
    history = server.http("GET", f"/api/terrains/{room.terrain}/history", secret=room.owner)[1]
    assert history["people"]["zoo-a"]["name"] == names["zoo-a"]


def test_animals_stay_the_same_over_a_restart(tmp_path: Path) -> None:
    """SPEC L19: whoever comes back first."""
    with LiveServer(tmp_path) as server:
        room = a_class(server, "ark")
        room.teacher.say("conduct", animals="en")
        lesson(room.anne, animals="en")
        crowd = [server.join(room.terrain, room.edit, f"ark-{k}") for k in range(60)]
        names = {m["person"]: m["name"] for m in crowd[-1].welcome["members"]}
    with LiveServer(tmp_path) as server:
        for k, pupil in reversed(list(enumerate(crowd))):
            ticket = pupil.welcome["ticket"]
            last = server.join(room.terrain, room.edit, f"ark2-{k}", ticket=ticket)
        now = {m["person"]: m["name"] for m in last.welcome["members"]}
    assert len(now) == 60
    assert all(names[each] == name for each, name in now.items())


def test_everything_of_one_person_is_taken_back(server: LiveServer) -> None:
    """SPEC L20 to L22: as one step of the conductor's, over all pages of the person; what others changed stays."""
    room = a_class(server, "undo")
    answer(room.teacher, "undo-t:0", stroke("s-teacher", 50.0))
    answer(room.ben, "undo-b:0", stroke("s-1"))
    answer(room.ben, "undo-b:1", set_op("s-teacher", label="ben was here"))
    answer(room.ben, "undo-b:2", stroke("s-2"))
    answer(room.anne, "undo-a:0", set_op("s-2", label="mended"))
    answer(room.anne, "undo-a:1", stroke("s-anne"))
    answer(room.ben, "undo-b:3", {"type": "stroke.delete", "stroke": "s-anne"})
    room.ben.close()
    ben = server.join(room.terrain, room.edit, "undo-b2", name="Ben", ticket=room.ben.welcome["ticket"])
    answer(ben, "undo-b2:0", {"type": "terrain.set", "fields": {"title": "Ben's"}})
    for k in range(80):
        answer(ben, f"undo-b2:{k + 1}", stroke(f"s-b{k:02}"))
    people(room.teacher, "undo", ben)
    said = room.teacher.wait("notice")["text"]
    assert said.startswith("Everything that Ben did was taken back. What others have changed since was kept.")
    left = strokes(server, room)
    assert set(left) == {"s-teacher", "s-2", "s-anne"}
    assert (left["s-teacher"]["label"], left["s-2"]["label"]) == ("", "mended")
    _, document = server.http("GET", f"/api/terrains/{room.terrain}/document", secret=room.owner)
    assert document["settings"]["title"] == "Untitled terrain"
    people(room.teacher, "undo", ben)
    assert "Nothing" in room.teacher.wait("notice")["text"]


def test_thirty_pupils_delete_at_once_and_all_is_taken_back(server: LiveServer) -> None:
    """SPEC L20: a brawl ends with hands off and the land as it was."""
    room = a_class(server, "brawl")
    for k in range(30):
        answer(room.teacher, f"brawl-t:{k}", stroke(f"s-{k}"))
    crowd = [server.join(room.terrain, room.edit, f"brawl-{k}") for k in range(28)]
    for k, pupil in enumerate(crowd):
        pupil.ops(*((f"brawl-{k}:{n}", {"type": "stroke.delete", "stroke": f"s-{n}"}) for n in range(30)))
    for pupil in crowd:
        pupil.wait("ack", "reject")
    room.teacher.say("conduct", hands_off=True)
    lesson(room.teacher, hands_off=True)
    people(room.teacher, "undo", *crowd)
    room.teacher.wait("notice")
    assert set(strokes(server, room)) == {f"s-{k}" for k in range(30)}


def test_hands_off_is_told_within_half_a_second_to_a_whole_class(server: LiveServer) -> None:
    """SPEC L1: everybody is told; `esker bench` measures how soon."""
    room = a_class(server, "all")
    crowd = [server.join(room.terrain, room.edit, f"all-{k}") for k in range(30)]
    room.teacher.say("conduct", hands_off=True)
    for pupil in crowd:
        assert lesson(pupil, hands_off=True)["draws"] is False


def test_two_hundred_emoji_and_no_name(server: LiveServer) -> None:
    """SPEC L23: names that are the same, empty or too long hurt nobody."""
    room = a_class(server, "emoji")
    same = [server.join(room.terrain, room.edit, f"emoji-{k}", name=name) for k, name in enumerate(["", "", "Anne"])]
    peer = Peer(server.socket())
    hello = {"protocol": c.PROTOCOL_VERSION, "terrain": room.terrain, "secret": room.edit, "client": "emoji-200"}
    peer.say("hello", **hello, name="🙂" * 200)
    assert peer.closed()[0] == c.WS_CLOSE["bad_hello"]
    people(room.teacher, "remove", same[2])
    assert same[2].closed()[0] == c.WS_CLOSE["removed"]
    assert answer(room.anne, "emoji-a:0", stroke("s"))["type"] == "ack"
