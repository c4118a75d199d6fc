"""A lesson over real sockets: clients that ignore every switch gain nothing (SPEC L1 to L8, L12 to L16)."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import pytest

from esker import contract as c
from esker.session.room import conducting
from tests.sync.classroom import a_class, answer, lesson, people, person, strokes
from tests.sync.harness import LiveServer, Peer, set_op, stroke


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


def grouping(peer: Peer, group: str | None, *members: Peer, **changes: Any) -> None:
    peer.say("grouping", group=group, **changes, **({"put": [person(each) for each in members]} if members else {}))


def test_groups_are_seen_by_all_who_lead_and_by_nobody_else(tmp_path: Path) -> None:
    """SPEC L161: by a co-teacher, by another device of the teacher, after a kill of the server."""
    with LiveServer(tmp_path / "living") as server:
        room = a_class(server, "see")
        grouping(room.teacher, "red", room.anne, room.ben, name="Red")
        made = {"id": "red", "name": "Red", "people": [person(room.anne), person(room.ben)], "pen": False}
        lesson(room.teacher, groups=[made])
        tablet = server.join(room.terrain, room.owner, "see-t2")
        assert tablet.welcome["lesson"]["groups"] == [made]
        people(room.teacher, "conductor", room.anne)
        assert lesson(room.anne, conducts=True)["groups"] == [made]
        grouping(room.anne, "blue", room.ben, name="Blue")
        apart = [
            {**made, "people": [person(room.anne)]},
            {**made, "id": "blue", "name": "Blue", "people": [person(room.ben)]},
        ]
        for peer in (room.anne, tablet, room.teacher):
            lesson(peer, groups=apart)
        people(tablet, "no_conductor", room.anne)
        assert lesson(room.anne, conducts=False)["groups"] == []
        shutil.copytree(tmp_path / "living", tmp_path / "killed")
    with LiveServer(tmp_path / "killed") as server:
        back = server.join(room.terrain, room.owner, "see-t3")
        assert back.welcome["lesson"]["groups"] == apart
        pupil = server.join(room.terrain, room.edit, "see-b3", ticket=room.ben.welcome["ticket"])
        back.say("conduct", hands_off=True)
        assert lesson(pupil, hands_off=True)["groups"] == []
        for peer in (room.ben, pupil):
            told = [peer.welcome["lesson"], *(message for message in peer.seen if message["type"] == "lesson")]
            assert all(message["groups"] == [] for message in told), "no list of people reaches a pupil"


def test_nobody_but_who_leads_changes_groups(server: LiveServer) -> None:
    """SPEC L4, L164: pupils, who only looks, and a client that sends too much."""
    room = a_class(server, "bad")
    grouping(room.teacher, "red", room.anne, name="Red")
    made = lesson(room.teacher)["groups"]
    looker = server.http("POST", f"/api/terrains/{room.terrain}/links", {"role": "view"}, room.owner)[1]["secret"]
    for peer in (room.anne, server.join(room.terrain, looker, "bad-v")):
        for change in ({"name": "Mine"}, {"pen": True}, {"put": [person(room.ben)]}, {"forget": True}):
            peer.say("grouping", group="red", **change)
            assert "Only whoever leads" in peer.wait("notice")["text"]
        peer.say("grouping", group=None, pen=True)
        assert "Only whoever leads" in peer.wait("notice")["text"]
    assert server.join(room.terrain, room.owner, "bad-t2").welcome["lesson"]["groups"] == made
    for k in range(1, c.MAX_GROUPS):
        grouping(room.teacher, f"g{k}", name="")
    lesson(room.teacher)
    grouping(room.teacher, "more", name="")
    assert f"at most {c.MAX_GROUPS} groups" in room.teacher.wait("notice")["text"]
    room.teacher.say("grouping", group="red", name="n" * (c.MAX_GROUP_NAME + 1))
    code, error = room.teacher.closed()
    assert code == c.WS_CLOSE["malformed"]
    assert error is not None


def test_a_group_has_its_pens_by_one_order(tmp_path: Path) -> None:
    """SPEC L160: whoever of it is away too, over reloads and a restart; nobody puts themself into a group."""
    with LiveServer(tmp_path) as server:
        room = a_class(server, "group")
        cho = server.join(room.terrain, room.edit, "group-c", name="Cho")
        room.teacher.say("conduct", hands_off=True)
        lesson(cho, hands_off=True)
        cho.close()
        grouping(room.anne, "red", room.anne, cho, name="Red", pen=True)
        assert "Only whoever leads" in room.anne.wait("notice")["text"]
        grouping(room.teacher, "red", room.ben, cho, name="Red", pen=True)
        lesson(room.ben, draws=True)
        back = server.join(room.terrain, room.edit, "group-c2", ticket=cho.welcome["ticket"])
        assert back.welcome["lesson"]["draws"] is True
        assert answer(back, "group-c2:0", stroke("s-cho"))["type"] == "ack"
        assert answer(room.anne, "group-a:0", stroke("s-anne"))["code"] == "hands_off"
    with LiveServer(tmp_path) as server:
        ben, cho = (
            server.join(room.terrain, room.edit, client, ticket=peer.welcome["ticket"])
            for client, peer in (("group-b3", room.ben), ("group-c3", back))
        )
        teacher = server.join(room.terrain, room.owner, "group-t3", ticket=room.teacher.welcome["ticket"])
        assert [peer.welcome["lesson"]["draws"] for peer in (ben, cho)] == [True, True]
        grouping(teacher, "red", pen=False)
        for peer, client in ((ben, "group-b3"), (cho, "group-c3")):
            lesson(peer, draws=False)
            assert answer(peer, f"{client}:0", stroke(f"s-{client}"))["code"] == "hands_off"


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


def test_hands_off_is_told_within_half_a_second_to_a_whole_class(server: LiveServer) -> None:
    """SPEC L1: everybody is told; `esker bench` measures how soon."""
    room = a_class(server, "all")
    crowd = [server.join(room.terrain, room.edit, f"all-{k}") for k in range(30)]
    room.teacher.say("conduct", hands_off=True)
    for pupil in crowd:
        assert lesson(pupil, hands_off=True)["draws"] is False
