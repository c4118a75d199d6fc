"""Coming back after a cut or a restart (SPEC P20 to P26, J11)."""

from __future__ import annotations

import json
import time
from pathlib import Path

import pytest

from esker import contract as c
from esker.session.room.replicas.recent import RECENT_OPS
from esker.store.writing import SNAPSHOT_EVERY
from tests.store.engines import sqlite
from tests.sync.harness import LiveServer, Peer, set_op, stroke


def _acked(peer: Peer, *ids: str) -> dict[str, int]:
    clocks: dict[str, int] = {}
    while not set(ids) <= set(clocks):
        ack = peer.wait("ack")
        clocks |= dict(zip(ack["ids"], ack["clocks"], strict=True))
    return clocks


def test_a_resume_gets_the_missing_ops(server: LiveServer) -> None:
    terrain, secret = server.create()
    ada, bob = server.join(terrain, secret, "ada"), server.join(terrain, secret, "bob")
    ada.ops(("ada:1", stroke()))
    _acked(ada, "ada:1")
    bob.close()
    ada.ops(("ada:2", set_op(label="2")), ("ada:3", set_op(label="3")))
    _acked(ada, "ada:2", "ada:3")
    bob = server.join(terrain, secret, "bob", clock=1)
    assert bob.welcome["document"] is None
    assert [(o["clock"], o["id"]) for o in bob.welcome["ops"]] == [(2, "ada:2"), (3, "ada:3")]
    assert bob.welcome["clock"] == 3
    again = server.join(terrain, secret, "carl", clock=3)
    assert (again.welcome["document"], again.welcome["ops"]) == (None, [])
    for peer in (ada, bob, again):
        peer.close()


def test_a_clock_from_the_future_gets_a_snapshot(server: LiveServer) -> None:
    terrain, secret = server.create()
    peer = server.join(terrain, secret, clock=77)
    assert peer.welcome["document"]["clock"] == 0
    assert peer.welcome["ops"] is None
    peer.close()


def test_who_missed_too_much_gets_a_snapshot(tmp_path: Path) -> None:
    with LiveServer(tmp_path) as server:
        terrain, secret = server.create()
        peer = server.join(terrain, secret)
        peer.ops(("c1:0", stroke()))
        count = SNAPSHOT_EVERY + 20
        for i in range(1, count):
            peer.ops((f"c1:{i}", set_op(label=str(i))))
            if i % 100 == 0:
                time.sleep(0.85)  # within the rate
        _acked(peer, f"c1:{count - 1}")
        peer.close()
    assert count < RECENT_OPS
    with LiveServer(tmp_path) as server:
        # After the restart only the ops since the last snapshot are at hand.
        late = server.join(terrain, secret, "late", clock=3)
        assert late.welcome["ops"] is None
        assert late.welcome["document"]["clock"] == count
        assert late.welcome["document"]["strokes"][0]["label"] == str(count - 1)
        late.close()


def test_an_op_sent_again_is_acknowledged_and_not_applied_twice(server: LiveServer) -> None:
    terrain, secret = server.create()
    peer = server.join(terrain, secret)
    peer.ops(("c1:1", stroke()), ("c1:2", set_op(label="a")))
    first = _acked(peer, "c1:1", "c1:2")
    peer.close()
    peer = server.join(terrain, secret, clock=0)
    peer.ops(("c1:1", stroke()), ("c1:2", set_op(label="a")), ("c1:3", set_op(label="b")))
    assert _acked(peer, "c1:1", "c1:2", "c1:3") == {**first, "c1:3": 3}
    _, about = server.http("GET", f"/api/terrains/{terrain}", secret=secret)
    assert about["clock"] == 3
    peer.close()


def test_ids_are_remembered_over_a_restart(tmp_path: Path) -> None:
    with LiveServer(tmp_path) as server:
        terrain, secret = server.create()
        peer = server.join(terrain, secret)
        peer.ops(("c1:5", stroke()))
        _acked(peer, "c1:5")
    with LiveServer(tmp_path) as server:
        peer = server.join(terrain, secret)
        peer.ops(("c1:5", stroke()), ("c1:4", set_op(label="late")))
        assert _acked(peer, "c1:5", "c1:4") == {"c1:5": 1, "c1:4": 2}, "an id never seen is new, whatever its number"
        peer.close()


def test_a_stopping_server_says_so_and_saves(tmp_path: Path) -> None:
    """SPEC P28."""
    with LiveServer(tmp_path) as server:
        terrain, secret = server.create()
        peer = server.join(terrain, secret)
        peer.ops(("c1:1", stroke()), ("c1:2", set_op(label="last words")))
        time.sleep(0.01)
        server._server.should_exit = True
        number, error = peer.closed()
        assert error is not None
        assert (number, error["code"]) == (c.WS_CLOSE["shutting_down"], "shutting_down")
        acked = [i for m in peer.seen if m["type"] == "ack" for i in m["ids"]]
        assert acked == ["c1:1", "c1:2"]
    with LiveServer(tmp_path) as server:
        peer = server.join(terrain, secret)
        assert peer.welcome["clock"] == 2
        peer.close()


def test_a_failing_disk_takes_the_change_back(tmp_path: Path) -> None:
    with LiveServer(tmp_path) as server:
        terrain, secret = server.create()
        ada, bob = server.join(terrain, secret, "ada"), server.join(terrain, secret, "bob")
        ada.ops(("ada:1", stroke()))
        _acked(ada, "ada:1")
        journal = server.assembly.hub.journal

        def fill(db: object) -> None:
            db.execute("PRAGMA query_only=1")  # type: ignore[attr-defined]

        journal.submit(fill).result()
        ada.ops(("ada:2", set_op(label="lost")))
        answer = ada.wait("reject", "ack")
        assert (answer["type"], answer["id"], answer["code"]) == ("reject", "ada:2", "unavailable")
        sqlite(journal).writer_db.execute("PRAGMA query_only=0")
        ada.ops(("ada:3", set_op(label="kept")))
        assert _acked(ada, "ada:3") == {"ada:3": 2}
        seen = [o["id"] for m in [bob.wait("ordered"), bob.wait("ordered")] for o in m["ops"]]
        assert seen == ["ada:1", "ada:3"], "nobody ever sees an op that is not in the journal"
        ada.close()
        bob.close()


def test_order_on_the_wire(server: LiveServer) -> None:
    """Every member gets every op, own ones too, by clock and without gaps; acks come after."""
    terrain, secret = server.create()
    peers = {name: server.join(terrain, secret, name) for name in ("a", "b", "c")}
    for name, peer in peers.items():
        peer.ops((f"{name}:0", stroke(name)))
    for i in range(1, 20):
        for name, peer in peers.items():
            peer.ops((f"{name}:{i}", set_op(name, label=str(i))))
    texts = {}
    for name, peer in peers.items():
        clocks: list[int] = []
        own: list[str] = []
        while len(clocks) < 60 or own[-1:] != [f"{name}:19"]:
            message = peer.wait("ordered", "ack")
            if message["type"] == "ordered":
                clocks += [o["clock"] for o in message["ops"]]
            else:
                assert max(message["clocks"]) <= clocks[-1]
                own += message["ids"]
        assert clocks == list(range(1, 61))
        assert own == [f"{name}:{i}" for i in range(20)]
        texts[name] = [json.dumps(m) for m in peer.seen if m["type"] == "ordered"]
        peer.close()
    assert texts["a"] == texts["b"] == texts["c"], "one text for all"


def test_presence_is_shared_and_forgotten(server: LiveServer) -> None:
    terrain, secret = server.create()
    ada = server.join(terrain, secret, "ada", name="Ada", colour="#010203")
    bob = server.join(terrain, secret, "bob")
    ada.say("presence", cursor=[1, 2, 3], tool="mountain")
    shown = bob.wait("presences")["members"]
    assert [(m["client"], m["cursor"], m["tool"]) for m in shown] == [("ada", [1, 2, 3], "mountain")]
    late = server.join(terrain, secret, "late")
    assert late.wait("presences")["members"][0]["client"] == "ada", "who joins sees where everybody is"
    ada.say("rename", name="Countess")
    names = {m["client"]: m["name"] for m in bob.wait("members")["members"]}
    while names.get("ada") != "Countess":
        names = {m["client"]: m["name"] for m in bob.wait("members")["members"]}
    ada.close()
    while "ada" in names:
        names = {m["client"]: m["name"] for m in bob.wait("members")["members"]}
    _, about = server.http("GET", f"/api/terrains/{terrain}", secret=secret)
    assert about["clock"] == 0, "presence is not on the document's clock"
    for peer in (bob, late):
        peer.close()


def test_presence_is_coalesced(server: LiveServer) -> None:
    terrain, secret = server.create()
    ada, bob = server.join(terrain, secret, "ada"), server.join(terrain, secret, "bob")
    for i in range(c.MAX_PRESENCE_PER_SECOND):
        ada.say("presence", cursor=[i, 0, 0])
    last = c.MAX_PRESENCE_PER_SECOND - 1
    messages = 0
    while True:
        shown = bob.wait("presences")["members"]
        messages += 1
        if shown[0]["cursor"][0] == last:
            break
    assert messages <= 5
    ada.close()
    bob.close()


def test_an_idle_room_closes_and_opens_again(tmp_path: Path) -> None:
    with LiveServer(tmp_path) as server:
        hub = server.assembly.hub
        hub._idle_seconds = 0.1
        terrain, secret = server.create()
        peer = server.join(terrain, secret)
        peer.ops(("c1:1", stroke()))
        _acked(peer, "c1:1")
        peer.close()
        deadline = time.monotonic() + 60
        while hub.open_room(terrain) is not None:
            assert time.monotonic() < deadline
            time.sleep(0.02)
        peer = server.join(terrain, secret, clock=0)
        assert peer.welcome["ops"][0]["id"] == "c1:1"
        time.sleep(0.3)
        assert hub.open_room(terrain) is not None, "a room with somebody in it stays open"
        peer.settled(1)
        peer.close()


@pytest.mark.parametrize("count", [60])
def test_sixty_joins_at_once_into_a_cold_room(tmp_path: Path, count: int) -> None:
    import threading

    with LiveServer(tmp_path) as server:
        terrain, secret = server.create()
        peer = server.join(terrain, secret)
        for i in range(200):
            peer.ops((f"c1:{i}", stroke(f"s{i}")))
        _acked(peer, "c1:199")
        peer.close()
    with LiveServer(tmp_path) as server:
        sockets = [Peer(server.socket()) for _ in range(count)]
        started = time.monotonic()
        times: list[float] = []

        def hello(i: int) -> None:
            sockets[i].say("hello", protocol=c.PROTOCOL_VERSION, terrain=terrain, secret=secret, client=f"m{i}")
            assert sockets[i].wait("welcome")["clock"] == 200
            times.append(time.monotonic() - started)

        threads = [threading.Thread(target=hello, args=(i,)) for i in range(count)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert len(times) == count
        assert max(times) < 5
        for peer in sockets:
            peer.close()
