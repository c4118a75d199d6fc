"""Disks without room, dates that are set, peers that are gone without a word (SPEC P128 to P130)."""

from __future__ import annotations

import json
import socket
import time
import urllib.error
import urllib.request
from pathlib import Path
from typing import Any

import pytest

from esker.server import serving, starting
from esker.server.wire import websocket
from tests.store.engines import sqlite
from tests.sync.harness import LiveServer, Peer, raw_socket, set_op, sleeping_member, stroke

LAST_ANSWER_TO_OUT = 41.0


def _writer(server: LiveServer, statement: str) -> Any:
    """Runs a statement on the journal's connection that writes, between its commits."""
    journal = server.assembly._journal
    assert journal is not None
    return journal.submit(lambda db: db.execute(statement).fetchone())


def _post(server: LiveServer, path: str, body: Any, secret: str | None = None) -> tuple[int, Any, str | None]:
    """Status, body and Retry-After of a POST."""
    headers = {"Content-Type": "application/json"} | ({"Authorization": f"Bearer {secret}"} if secret else {})
    request = urllib.request.Request(server.base + path, json.dumps(body).encode(), headers)
    try:
        with urllib.request.urlopen(request, timeout=20) as answer:
            return answer.status, json.loads(answer.read()), answer.headers["Retry-After"]
    except urllib.error.HTTPError as error:
        return error.code, json.loads(error.read()), error.headers["Retry-After"]


def test_a_full_disk_makes_nothing_by_halves_and_says_so(server: LiveServer) -> None:
    terrain, owner = server.create()
    links = f"/api/terrains/{terrain}/links"
    pages = _writer(server, "PRAGMA page_count").result()[0]
    _writer(server, f"PRAGMA max_page_count={pages}").result()
    made = 0
    while (answer := _post(server, links, {"role": "edit", "name": "x" * 80}, owner))[0] == 201 and made < 200:
        made += 1
    status, error, again = answer
    assert (status, error["code"], again) == (507, "storage", "30")
    assert "disk full" in error["message"]
    assert "Nothing was changed" in error["message"]
    assert len(server.http("GET", links, secret=owner)[1]) == made + 1
    births = 0
    while _post(server, "/api/terrains", {})[0] == 201 and births < 50:
        births += 1
    orphans = _writer(server, "SELECT count(*) FROM terrains WHERE id NOT IN (SELECT terrain FROM links)")
    assert orphans.result()[0] == 0
    peer = server.join(terrain, owner)
    peer.ops(*((f"c1:{i}", stroke(f"s{i}")) for i in range(100)))
    assert peer.wait("reject")["code"] == "unavailable"
    _writer(server, "PRAGMA max_page_count=1000000").result()
    assert _post(server, links, {"role": "edit"}, owner)[0] == 201
    assert _post(server, "/api/terrains", {})[0] == 201
    peer.ops(("c1:1000", stroke("late")))
    while "c1:1000" not in peer.wait("ack")["ids"]:
        pass
    peer.close()


def test_a_database_that_takes_no_writes_is_told_apart(server: LiveServer) -> None:
    terrain, owner = server.create()
    links = f"/api/terrains/{terrain}/links"
    guest = _post(server, links, {"role": "edit"}, owner)[1]
    _writer(server, "PRAGMA query_only=1").result()
    for method, path, body in (
        ("POST", "/api/terrains", {}),
        ("POST", links, {"role": "edit"}),
        ("POST", f"{links}/{guest['id']}/rotate", None),
        ("DELETE", f"{links}/{guest['id']}", None),
    ):
        status, error = server.http(method, path, body, owner)
        assert (status, error["code"]) == (503, "unavailable"), path
    assert _post(server, "/api/terrains", {})[2] == "30"
    assert server.http("GET", f"/api/terrains/{terrain}", secret=guest["secret"])[0] == 200, "the link is as it was"
    assert server.http("GET", "/healthz")[0] == 200
    # The pragma forbids the writer's own transactions, so it is lifted beside them.
    journal = server.assembly._journal
    assert journal is not None
    sqlite(journal).writer_db.execute("PRAGMA query_only=0")
    assert _post(server, "/api/terrains", {})[0] == 201


def test_the_history_goes_on_when_the_date_is_set_back(server: LiveServer) -> None:
    terrain, secret = server.create()
    journal = server.assembly._journal
    assert journal is not None
    peer = server.join(terrain, secret, name="Ana")
    dates = (2e9, 2e9 - 3600, 2e9 - 3590, 2e9 + 3600)
    for number, date in enumerate(dates):
        journal._now = lambda date=date: date  # type: ignore[misc]
        peer.ops((f"c1:{number}", stroke() if number == 0 else set_op(label=f"name {number}")))
        peer.wait("ack")
    page = server.http("GET", f"/api/terrains/{terrain}/history", secret=secret)[1]
    told = [(entry["first"], entry["last"], entry["at"]) for entry in page["entries"]]
    assert told == [(4, 4, dates[3]), (2, 3, dates[2]), (1, 1, dates[0])]
    peer.close()


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """A server that asks soon, and whose sockets hold little."""
    monkeypatch.setattr(serving, "PING_SECONDS", 0.4)
    monkeypatch.setattr(serving, "PONG_SECONDS", 0.4)
    monkeypatch.setattr(starting, "SEND_BUFFER", 4096)
    monkeypatch.setattr(websocket, "FAREWELL_SECONDS", 0.2)


def _members(peer: Peer) -> set[str]:
    return {member["client"] for member in peer.wait("members")["members"]}


@pytest.mark.usefixtures("impatient")
@pytest.mark.parametrize("waiting", [0, 30_000])
def test_a_peer_that_just_stops_is_out_in_a_bounded_time(tmp_path: Path, waiting: int) -> None:
    """``waiting``: characters on their way to it, more than the kernel takes and less than makes the server wait."""
    assert serving.PING_SECONDS + serving.PONG_SECONDS < 1
    with LiveServer(tmp_path, level=0) as server:
        terrain, secret = server.create()
        ana = server.join(terrain, secret, "ana")
        with sleeping_member(server.port, terrain, secret):
            while "sleeper" not in _members(ana):
                pass
            began = time.monotonic()
            if waiting:
                ana.ops(("ana:1", {"type": "terrain.set", "fields": {"title": "x" * 80}}))
                points = [[i / 250, 1 / 3] for i in range(250)]
                ana.ops(("ana:2", stroke()))
                for i in range(waiting // 5_000):
                    op = {"type": "stroke.append", "stroke": "s1", "start": 0, "points": points, "last": [900, 100, 0]}
                    ana.ops((f"ana:{i + 3}", op))
            while "sleeper" in _members(ana):
                pass
            assert time.monotonic() - began < 6.0, "before a slow reader would be"
        assert server.assembly.hub.open_room(terrain) is not None
        ana.close()


def test_the_defaults_keep_what_is_promised() -> None:
    assert serving.PING_SECONDS + serving.PONG_SECONDS + websocket.FAREWELL_SECONDS <= LAST_ANSWER_TO_OUT


def test_half_a_goodbye_is_one(server: LiveServer) -> None:
    """A peer that closes its side alone is not waited for."""
    with raw_socket(server.port) as tcp:
        tcp.sendall(b"GET /ws HTTP/1.1\r\nHost: x\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n")
        tcp.sendall(b"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n")
        assert b"101" in tcp.recv(64)
        tcp.shutdown(socket.SHUT_WR)
        tcp.settimeout(10)
        while tcp.recv(4096):
            pass
