"""Client ids belong to who claimed them first (SPEC P299 to P301)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from esker import contract as c
from esker.document.ops import StrokeSet
from esker.session.room.core import Denied, RoomCore, RoomInfo
from esker.session.room.outbox import Outbox
from esker.store.claims import KEY_BYTES, Claims, key_in
from esker.store.journal import Loaded
from tests.sync.harness import TOKENS, LiveServer, Peer, set_op, stroke
from tests.sync.scripted_reader import Reader, send, wait

INFO = RoomInfo(1, 1, "none")


def link(server: LiveServer, terrain: str, owner: str, role: str = "edit") -> str:
    return str(server.http("POST", f"/api/terrains/{terrain}/links", {"role": role}, owner)[1]["secret"])


def claim(server: LiveServer, terrain: str, secret: str, client: str, **hello: Any) -> Peer:
    """A hello of who knows a client id, and nothing else of it."""
    peer = Peer(server.socket())
    peer.say("hello", protocol=c.PROTOCOL_VERSION, terrain=terrain, secret=secret, client=client, **hello)
    return peer


def test_whoever_claims_another_s_id_is_refused(tmp_path: Path) -> None:
    """SPEC P299: by the same link or another, while its owner is there, away, and after a restart of the server."""
    with LiveServer(tmp_path) as server:
        terrain, owner = server.create()
        secret = link(server, terrain, owner)
        ada = server.join(terrain, secret, "ada")
        ada.ops(("ada:1", stroke()))
        ada.wait("ack")
        for key in (secret, link(server, terrain, owner), link(server, terrain, owner, "view")):
            assert claim(server, terrain, key, "ada").closed()[0] == c.WS_CLOSE["bad_hello"]
            forged = f"{1:x}.{'0' * 64}"
            assert claim(server, terrain, key, "ada", token=forged).closed()[0] == c.WS_CLOSE["bad_hello"]
        ada.ops(("ada:2", set_op(label="still here")))
        ada.wait("ack")
        ada.close()
        assert claim(server, terrain, secret, "ada").closed()[0] == c.WS_CLOSE["bad_hello"]
    with LiveServer(tmp_path) as server:
        assert claim(server, terrain, secret, "ada").closed()[0] == c.WS_CLOSE["bad_hello"]
        stolen = claim(server, terrain, owner, "ada", token=TOKENS[terrain, "ada"])
        assert stolen.closed()[0] == c.WS_CLOSE["bad_hello"], "a token is bound to its link"
        back = server.join(terrain, secret, "ada", clock=2)
        back.ops(("ada:2", set_op(label="again")), ("ada:3", set_op(label="newer")))
        clocks = [clock for _ in range(2) for clock in back.wait("ack")["clocks"]]
        assert sorted(clocks) == [2, 3]
        back.close()


def test_the_owner_of_an_id_replaces_the_own_older_connection(tmp_path: Path) -> None:
    """SPEC P299, P26."""
    with LiveServer(tmp_path) as server:
        terrain, secret = server.create()
        first = server.join(terrain, secret, "ada")
        second = server.join(terrain, secret, "ada")
        assert first.closed()[0] == c.WS_CLOSE["bad_hello"]
        second.say("ping", t=1)
        second.wait("pong")
        second.close()


def _core(claims: Claims) -> RoomCore:
    return RoomCore(Loaded(StrokeSet.from_document(c.Document(id="t")), [], {}), lambda *_: None, claims=claims)


def _join(core: RoomCore, link_id: str, token: str | None = None) -> tuple[Any, str]:
    hello = c.Hello(protocol=c.PROTOCOL_VERSION, terrain="t", secret="s", client="ada", token=token)
    outbox = Outbox(lambda: None)
    member = core.join(hello, "edit", link_id, outbox, INFO)
    told = c.Welcome.model_validate_json(str(outbox.pop() or ""))
    return member, told.token


def test_who_never_got_the_welcome_comes_again(tmp_path: Path) -> None:
    """SPEC P299: by the same link, until something is heard."""
    core = _core(Claims())
    _, token = _join(core, "mine")
    with pytest.raises(Denied):
        _join(core, "another")
    member, again = _join(core, "mine")
    assert again == token
    core.heard(member)
    with pytest.raises(Denied):
        _join(core, "mine")
    assert _join(core, "mine", token)[1] == token


def test_of_two_who_claimed_an_id_the_first_has_it() -> None:
    """SPEC P299: an id without ops, taken by somebody else while the server was down."""
    now = [1000.0]
    claims = Claims(now=lambda: now[0])
    _, mine = _join(_core(claims), "mine")
    now[0] += 1
    core = _core(claims)
    thief, stolen = _join(core, "theirs")
    core.heard(thief)
    assert not core.belongs("ada", "mine")
    owner, token = _join(core, "mine", mine)
    assert token == mine
    assert thief.outbox.closing is not None
    assert core.members.by_client["ada"] is owner
    with pytest.raises(Denied):
        _join(core, "theirs", stolen)
    core.leave(owner)
    with pytest.raises(Denied):
        _join(core, "theirs", stolen)
    assert core.belongs("ada", "mine")


def test_tokens_are_of_one_server_terrain_client_and_link(tmp_path: Path) -> None:
    """SPEC P299."""
    claims = Claims(key_in(tmp_path))
    token = claims.token("t", "ada", "l", 7)
    c.Hello(protocol=1, terrain="t", secret="s", client="ada", token=token)
    again = Claims(key_in(tmp_path))
    assert again.since(token, "t", "ada", "l") == 7
    for wrong in (("u", "ada", "l"), ("t", "bob", "l"), ("t", "ada", "m"), ("t\0ada", "l", "")):
        assert again.since(token, *wrong) is None
    assert again.since("8" + token[1:], "t", "ada", "l") is None
    assert Claims().since(token, "t", "ada", "l") is None
    path = tmp_path / "clients.key"
    assert path.stat().st_mode & 0o077 == 0
    path.write_bytes(b"cut")
    assert len(key_in(tmp_path)) == KEY_BYTES


def _rows(server: LiveServer) -> dict[str, int]:
    db = server.assembly.hub.journal.reader()
    tables = [row[0] for row in db.execute("SELECT name FROM sqlite_master WHERE type='table'")]
    return {table: db.execute(f"SELECT count(*) FROM {table}").fetchone()[0] for table in tables}


def test_a_link_to_look_writes_nothing(tmp_path: Path) -> None:
    """SPEC P300."""
    with LiveServer(tmp_path) as server:
        terrain, owner = server.create()
        view = link(server, terrain, owner, "view")
        before = _rows(server)
        viewer = server.join(terrain, view, "viewer", name="Vi")
        viewer.say("rename", name="Eve")
        viewer.say("presence", tool="mountain")
        viewer.ops(("viewer:1", stroke()))
        viewer.wait("reject")
        past = server.join(terrain, view, "looker", at=0)
        past.say("seek", clock=0)
        past.say("ping", t=1)
        past.wait("pong")
        assert _rows(server) == before
        past.close()
        viewer.close()


def test_nothing_is_brought_in_in_another_s_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC P301: the layer is not another's to undo."""
    reader = Reader()
    monkeypatch.setattr("esker.server.run.importing", reader)
    with LiveServer(tmp_path) as server:
        terrain, owner = server.create()
        ada = server.join(terrain, owner, "ada", name="Ada")
        ada.say("ping", t=1)
        status, job = send(server, terrain, link(server, terrain, owner), "x", "name=a.tif&client=ada")
        assert status == 202
        wait(server, terrain, owner, job["id"], "done")
        assert ada.wait("ordered")["ops"][0]["author"].startswith("import-")
        ada.close()
