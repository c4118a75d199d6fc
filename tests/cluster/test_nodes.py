"""Nodes as processes over one real PostgreSQL (SPEC P591 to P597; DESIGN 18).

Everybody draws without a pause and says afterwards how much: the journal has to have each of it once.
"""

from __future__ import annotations

import json
import signal
from collections.abc import Sequence
from pathlib import Path

from tests.cluster.processes import (
    Artist,
    NodeProcess,
    all_is_there,
    drawing,
    gone_on,
    made,
    nodes,
    running,
    until,
)
from tests.store.engines import Database
from tests.store.proxy import Proxy


def owner_of(some: Sequence[NodeProcess]) -> NodeProcess:
    """The node that has a lease."""
    return next(each for each in some if each.figures()["esker_leases"] >= 1)


def test_two_draw_through_different_nodes(database: Database, tmp_path: Path) -> None:
    """SPEC P591: one of them on a node that does not have the terrain; clocks of the machines are a day apart."""
    with nodes(database.new(), tmp_path, "a", "b", hours={"a": 11.0, "b": -13.0}) as (a, b):
        artists, terrain, secret = drawing([a], [b])
        gone_on(artists)
        all_is_there(artists)
        assert sum(each.figures()["esker_sockets_passed_total"] for each in (a, b)) >= 1
        assert sum(each.figures()["esker_fenced_writes_total"] for each in (a, b)) == 0
        for each in (a, b):  # whoever is asked
            found = json.loads(each.request("GET", f"/api/terrains/{terrain}", secret=secret))
            assert found["clock"] == sum(artist.drawn for artist in artists)


def test_the_owner_is_killed_while_people_draw(database: Database, tmp_path: Path) -> None:
    """SPEC P592: the one who came by the other node stays there, the other one is brought there."""
    with nodes(database.new(), tmp_path, "a", "b") as some:
        artists, _, _ = drawing([some[0]], [some[1]])
        gone = owner_of(some)
        left = next(each for each in some if each is not gone)
        for each in artists:
            each.turn_to(left.base)
        gone.end(signal.SIGKILL)
        gone_on(artists)
        assert left.figures()["esker_leases"] == 1
        all_is_there(artists)


def test_an_owner_that_was_frozen_writes_nothing_when_it_wakes(database: Database, tmp_path: Path) -> None:
    """SPEC P593: somebody draws through it again, and comes to the new owner."""
    with nodes(database.new(), tmp_path, "a", "b") as some:
        artists, _, _ = drawing([some[0]], [some[1]])
        frozen = owner_of(some)
        left = next(each for each in some if each is not frozen)
        frozen.tell(signal.SIGSTOP)
        for each in artists:
            each.turn_to(left.base)
            each.cut()
        gone_on(artists)
        frozen.tell(signal.SIGCONT)
        until(lambda: frozen.figures()["esker_terrains_lost_total"] == 1)
        artists[0].turn_to(frozen.base)
        artists[0].cut()
        gone_on(artists)
        assert frozen.figures()["esker_leases"] == 0
        assert frozen.figures()["esker_sockets_passing"] == 1
        all_is_there(artists)


def test_nodes_are_restarted_one_after_the_other(database: Database, tmp_path: Path) -> None:
    """SPEC P594: people are told that the terrain moves, and go with it."""
    with nodes(database.new(), tmp_path, "a", "b") as some:
        artists, _, _ = drawing([some[0]], [some[1]])
        for node, other in (some, reversed(some)):
            for each in artists:
                each.turn_to(other.base)
            node.end(signal.SIGTERM)
            gone_on(artists)
            node.start()
            node.ready()
        assert "gives 1 terrains away" in some[0].log() + some[1].log()
        all_is_there(artists)


def test_a_node_that_is_cut_off_from_the_database_shuts_its_rooms(database: Database, tmp_path: Path) -> None:
    """SPEC P596: only its own line is cut, and people reach it still; later it passes them on."""
    url, server = database.new(), database.server.folder
    lines = [Proxy(tmp_path / f"line-{name}", server / ".s.PGSQL.5432") for name in ("a", "b")]
    urls = [url.replace(str(server), str(tmp_path / f"line-{name}")) for name in ("a", "b")]
    made_of = [NodeProcess(name, found, tmp_path / name) for name, found in zip(("a", "b"), urls, strict=True)]
    with running(made_of) as some:
        artists, _, _ = drawing([some[0]], [some[1]])
        cut = owner_of(some)
        left = next(each for each in some if each is not cut)
        for each in artists:
            each.turn_to(left.base)
        lines[some.index(cut)].cut()
        gone_on(artists)
        until(lambda: left.figures()["esker_leases"] == 1)
        until(lambda: cut.figures()["esker_leases"] == 0)
        gone_on(artists)
        assert cut.refused("GET", "/readyz") == 503
        lines[some.index(cut)].is_open = True
        cut.ready()
        artists[0].turn_to(cut.base)
        artists[0].cut()
        gone_on(artists)
        all_is_there(artists)
    for line in lines:
        line.close()


def test_a_code_that_was_made_on_one_node_opens_on_another(database: Database, tmp_path: Path) -> None:
    """SPEC P585, P595: a join code, a class and its seats, links that end, files; whichever node is asked."""
    with nodes(database.new(), tmp_path, "a", "b") as (a, b):
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
        leases = [each.figures()["esker_leases"] for each in (a, b)]
        assert sorted(leases) == [0, 1], "the class and its copies are on one node, under one lease"
        links = json.loads(b.request("GET", f"/api/terrains/{terrain}/links", secret=secret))
        mine = next(link for link in links if link["name"] == "Joined by code")
        a.request("DELETE", f"/api/terrains/{terrain}/links/{mine['id']}", secret=secret)
        assert b.refused("GET", f"/api/terrains/{terrain}", secret=joined["secret"]) == 403
        archives = [each.request("GET", f"/api/terrains/{terrain}/archive", secret=secret) for each in (a, b)]
        assert all(found[:2] == b"PK" for found in archives)
        for artist in artists:
            artist.close()
