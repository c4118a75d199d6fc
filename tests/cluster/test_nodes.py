"""Nodes as processes over one real PostgreSQL (SPEC P591 to P597; DESIGN 18).

Everybody draws without a pause and says afterwards how much: the journal has to have each of it once.
"""

from __future__ import annotations

import json
import signal

from esker.api.live.client import LiveTerrain
from tests.cluster.pair import Pair
from tests.cluster.processes import PATIENCE, Artist, all_is_there, gone_on, made, until


def test_two_draw_through_different_nodes(pair: Pair) -> None:
    """SPEC P591: one of them on a node that does not have the terrain; clocks of the machines are a day apart."""
    before = sum(each.figures()["esker_fenced_writes_total"] for each in pair.nodes)
    artists, terrain, secret = pair.drawing()
    gone_on(artists)
    all_is_there(artists)
    assert sum(each.figures()["esker_sockets_passed_total"] for each in pair.nodes) >= 1
    assert sum(each.figures()["esker_fenced_writes_total"] for each in pair.nodes) == before
    for each in pair.nodes:  # whoever is asked
        found = json.loads(each.request("GET", f"/api/terrains/{terrain}", secret=secret))
        assert found["clock"] == sum(artist.drawn for artist in artists)


def test_the_owner_is_killed_while_people_draw(pair: Pair) -> None:
    """SPEC P592: the one who came by the other node stays there, the other one is brought there."""
    artists, gone, left = pair.drawn_on()
    for each in artists:
        each.turn_to(left.base)
    gone.end(signal.SIGKILL)
    gone_on(artists)
    assert left.figures()["esker_sockets_passing"] == 0, "it has the terrain itself"
    all_is_there(artists)
    gone.start()


def test_groups_are_seen_through_every_node(pair: Pair) -> None:
    """SPEC L161: by two devices of a teacher at different nodes, also when the node that has the terrain is killed."""
    artists, gone, left = pair.drawn_on()
    teacher, tablet = artists
    person = teacher.live.members[0].person
    teacher.live.group("red", name="Red", put=[person], pen=True)
    until(lambda: [(each.name, each.people) for each in tablet.live.lesson.groups] == [("Red", (person,))])
    tablet.live.group("red", name="Rot")
    until(lambda: [each.name for each in teacher.live.lesson.groups] == ["Rot"])
    for each in artists:
        each.turn_to(left.base)
    gone.end(signal.SIGKILL)
    gone_on(artists)
    with LiveTerrain(left.base + teacher.path, timeout=PATIENCE) as late:
        until(lambda: [(each.name, each.people, each.pen) for each in late.lesson.groups] == [("Rot", (person,), True)])
    all_is_there(artists)
    gone.start()


def test_an_owner_that_was_frozen_writes_nothing_when_it_wakes(pair: Pair) -> None:
    """SPEC P593: somebody draws through it again, and comes to the new owner."""
    artists, frozen, left = pair.drawn_on()
    before = frozen.figures()["esker_terrains_lost_total"]
    frozen.tell(signal.SIGSTOP)
    for each in artists:
        each.turn_to(left.base)
        each.cut()
    gone_on(artists)
    frozen.tell(signal.SIGCONT)
    until(lambda: frozen.figures()["esker_terrains_lost_total"] > before)
    artists[0].turn_to(frozen.base)
    artists[0].cut()
    gone_on(artists)
    assert frozen.figures()["esker_leases"] == 0
    assert frozen.figures()["esker_sockets_passing"] == 1
    all_is_there(artists)


def test_a_node_that_is_cut_off_from_the_database_shuts_its_rooms(pair: Pair) -> None:
    """SPEC P596: only its own line is cut, and people reach it still; later it passes them on."""
    artists, cut, left = pair.drawn_on()
    for each in artists:
        each.turn_to(left.base)
    line = pair.lines[pair.at(cut)]
    line.cut()
    gone_on(artists)
    until(lambda: cut.figures()["esker_leases"] == 0)
    gone_on(artists)
    assert left.figures()["esker_leases"] >= 1
    assert left.figures()["esker_sockets_passing"] == 0, "it has the terrain itself"
    assert cut.refused("GET", "/readyz") == 503
    line.is_open = True
    cut.ready()
    artists[0].turn_to(cut.base)
    artists[0].cut()
    gone_on(artists)
    all_is_there(artists)


def test_a_code_that_was_made_on_one_node_opens_on_another(pair: Pair) -> None:
    """SPEC P585, P595: a join code, a class and its seats, links that end, files; whichever node is asked."""
    a, b = pair.nodes
    for each in pair.nodes:
        each.ready()
    terrain, secret = made(a)
    code = json.loads(a.request("POST", f"/api/terrains/{terrain}/codes", b"{}", secret))["code"]
    joined = json.loads(b.request("POST", "/api/join", json.dumps({"code": code}).encode()))
    assert joined["id"] == terrain
    for each in (a, b):
        assert each.refused("POST", "/api/join", {"code": "ZZZZZZ"}) == 404
    path = f"/api/terrains/{terrain}/classes"
    lesson = json.loads(b.request("POST", path, json.dumps({"title": "Isles", "together": 1}).encode(), secret))
    seats = [
        json.loads(each.request("POST", f"/api/classes/{lesson['id']}/seats", json.dumps(
            {"code": lesson["code"], "seat": letter * 32, "name": letter}).encode()))
        for each, letter in ((a, "A"), (b, "B"), (a, "C"))
    ]  # fmt: skip
    assert len({seat["id"] for seat in seats}) == 3
    again = json.loads(b.request("GET", "/api/seat", secret="A" * 32))
    assert again["id"] == seats[0]["id"]
    artists = [Artist(each.base, seats[0]["id"], "A" * 32, "pupil") for each in (a, b)]
    owners = [pair.owners_of(each) for each in (terrain, seats[0]["id"])]
    assert sorted(map(len, owners)) == [0, 1], "the class and its copies are on one node, under one lease"
    links = json.loads(b.request("GET", f"/api/terrains/{terrain}/links", secret=secret))
    mine = next(link for link in links if link["name"] == "Joined by code")
    a.request("DELETE", f"/api/terrains/{terrain}/links/{mine['id']}", secret=secret)
    assert b.refused("GET", f"/api/terrains/{terrain}", secret=joined["secret"]) == 403
    archives = [each.request("GET", f"/api/terrains/{terrain}/archive", secret=secret) for each in (a, b)]
    assert all(found[:2] == b"PK" for found in archives)
    for artist in artists:
        artist.close()
