"""People of a lesson: who is sent out, their names, all of one taken back (SPEC L9 to L11, L17 to L23)."""

from __future__ import annotations

import time
from pathlib import Path

from esker import contract as c
from tests.sync.classroom import a_class, answer, come, lesson, people, person, refused_at, strokes
from tests.sync.harness import LiveServer, Peer, set_op, stroke


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
    while "Annegret" not in str(room.teacher.wait("members")):
        pass  # told before she changed her name, or came
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
