"""Whoever is sent away is away: spare links, rooms that open, views, uploads, downloads (SPEC P286 to P289)."""

from __future__ import annotations

import asyncio
import socket
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from esker import contract as c
from esker.server.wire import sending
from esker.session.room.core import Denied
from esker.store.access import Access, Ended, JoinCode, OwnLink
from tests.store.engines import Store
from tests.sync.harness import PATIENCE, LiveServer, Peer, raw_socket, sleeping_member, stroke
from tests.sync.scripted_reader import Reader, layers, no_works, send, works


class Pause:
    """Holds calls of one function until it is let go: the moment in which a link is revoked."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, owner: Any, name: str) -> None:
        self.reached, self._go = threading.Event(), threading.Event()
        inner = getattr(owner, name)

        def held(*arguments: Any, **more: Any) -> Any:
            self.reached.set()
            assert self._go.wait(PATIENCE)
            return inner(*arguments, **more)

        monkeypatch.setattr(owner, name, held)

    def meanwhile(self, act: Callable[[], object]) -> None:
        assert self.reached.wait(PATIENCE)
        act()
        self._go.set()


@pytest.fixture
def live(tmp_path: Path, reader: Reader) -> Iterator[LiveServer]:
    with LiveServer(tmp_path) as server:
        yield server
        reader.gate.set()


def link(live: LiveServer, terrain: str, by: str, role: str = "edit") -> tuple[str, str]:
    status, made = live.http("POST", f"/api/terrains/{terrain}/links", {"role": role}, by)
    assert status == 201, made
    return made["id"], made["secret"]


def spare(live: LiveServer, terrain: str, by: str, role: str = "edit") -> str:
    """The secret of a link that somebody made for himself, with his own join code."""
    status, made = live.http("POST", f"/api/terrains/{terrain}/codes", {"role": role}, by)
    assert status == 201
    status, joined = live.http("POST", "/api/join", {"code": made["code"]})
    assert (status, joined["id"]) == (200, terrain)
    return str(joined["secret"])


def revoke(live: LiveServer, terrain: str, owner: str, link_id: str) -> None:
    assert live.raw("DELETE", f"/api/terrains/{terrain}/links/{link_id}", secret=owner)[0] == 204


def greet(live: LiveServer, terrain: str, secret: str, **hello: Any) -> Peer:
    peer = Peer(live.socket())
    peer.say("hello", protocol=c.PROTOCOL_VERSION, terrain=terrain, secret=secret, client="guest", **hello)
    return peer


def opens(live: LiveServer, terrain: str, secret: str) -> str:
    status, answer = live.http("GET", f"/api/terrains/{terrain}", secret=secret)
    return "yes" if status == 200 else str(answer["code"])


# --- the tree ---------------------------------------------------------------------------------------------------


def test_a_spare_link_ends_with_the_link_that_made_it(live: LiveServer) -> None:
    """SPEC P286: however long the chain of codes; who is in by it is closed."""
    terrain, owner = live.create()
    edit, secret = link(live, terrain, owner)
    other = link(live, terrain, owner)[1]
    first = spare(live, terrain, secret)
    second = spare(live, terrain, first, "view")
    peers = [live.join(terrain, each, f"c{i}") for i, each in enumerate((secret, first, second))]
    status, code = live.http("POST", f"/api/terrains/{terrain}/codes", {}, first)
    assert status == 201
    revoke(live, terrain, owner, edit)
    assert [opens(live, terrain, each) for each in (secret, first, second)] == ["revoked"] * 3
    assert [peer.closed()[0] for peer in peers] == [c.WS_CLOSE["revoked"]] * 3
    assert live.http("POST", "/api/join", code)[0] != 200, "a code of a spare link"
    assert [opens(live, terrain, each) for each in (owner, other)] == ["yes"] * 2
    listed = live.http("GET", f"/api/terrains/{terrain}/links", secret=owner)[1]
    parents = {each["id"]: each["parent"] for each in listed}
    assert [each["role"] for each in listed if parents[each["id"]] is None] == ["owner"]
    assert sum(each["parent"] == edit for each in listed) == 1


def test_renewing_a_link_to_draw_ends_its_spare_links(live: LiveServer) -> None:
    """SPEC P286; what an owner made stays when the owner's link is renewed, and stands in the list."""
    terrain, owner = live.create()
    edit, secret = link(live, terrain, owner)
    kept = spare(live, terrain, secret)
    assert live.http("POST", f"/api/terrains/{terrain}/links/{edit}/rotate", secret=owner)[0] == 200
    assert [opens(live, terrain, each) for each in (secret, kept)] == ["bad_secret", "revoked"]
    class_link = link(live, terrain, owner)[1]
    listed = live.http("GET", f"/api/terrains/{terrain}/links", secret=owner)[1]
    root = next(each["id"] for each in listed if each["parent"] is None)
    fresh = live.http("POST", f"/api/terrains/{terrain}/links/{root}/rotate", secret=owner)[1]["secret"]
    assert [opens(live, terrain, each) for each in (owner, fresh, class_link)] == ["bad_secret", "yes", "yes"]


def test_nobody_ends_the_link_that_one_s_own_came_from(live: LiveServer) -> None:
    """SPEC P286: the own link would end with it."""
    terrain, owner = live.create()
    second_id, second = link(live, terrain, owner, "owner")
    root = next(e["id"] for e in live.http("GET", f"/api/terrains/{terrain}/links", secret=owner)[1] if not e["parent"])
    status, error = live.http("DELETE", f"/api/terrains/{terrain}/links/{root}", secret=second)
    assert (status, error["code"]) == (409, "own_link")
    assert [opens(live, terrain, each) for each in (owner, second)] == ["yes", "yes"]
    revoke(live, terrain, owner, second_id)


def test_who_comes_is_looked_up_by_one_question_at_a_time(live: LiveServer) -> None:
    """SPEC P662."""
    terrain, secret = live.create()
    hub = live.assembly.hub
    link = hub.door.authorise(terrain, secret, "192.0.2.7")
    asked: list[str] = []
    hub.journal.reader().set_trace_callback(asked.append)  # type: ignore[attr-defined]
    assert hub.door.authorise(terrain, secret, "192.0.2.7") == link
    assert len(asked) == 1
    hub.door.demand(link)
    assert len(asked) == 2


def test_authority_is_asked_in_the_commit_itself(store: Store) -> None:
    """SPEC P287: what was asked before a revocation and is written after it is not done."""
    journal = store.open()
    journal.create(c.Document(id="t")).result()
    access = Access(journal)
    root, _ = access.add("t", "owner", "").result()
    second, _ = access.add("t", "owner", "", root).result()
    edit, _ = access.add("t", "edit", "", second).result()
    code = access.make_code("t", "edit", edit.id)
    opened = access.open_code(code)
    assert opened == JoinCode("t", "edit", edit.id)
    with pytest.raises(OwnLink):
        access.revoke("t", root.id, second).result()
    assert access.revoke("t", second.id, root).result() == [second.id, edit.id]
    for late in (
        lambda: access.add("t", "edit", "", opened.link),
        lambda: access.add("t", "owner", "", second),
        lambda: access.revoke("t", root.id, edit),
        lambda: access.rotate("t", root.id, second),
    ):
        with pytest.raises(Ended):
            late().result()
    assert access.alive(root)
    renewed = access.rotate("t", root.id, root).result()
    assert renewed is not None
    assert not access.alive(root), "the old secret of a renewed link"
    assert access.revoke("t", second.id).result() == []
    journal.close()


# --- what opens meanwhile ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("hello", [{}, {"at": 0}], ids=["room", "past"])
def test_what_opens_while_the_link_is_revoked_stays_shut(
    live: LiveServer, monkeypatch: pytest.MonkeyPatch, hello: dict[str, Any]
) -> None:
    """SPEC P287: a room, and a view of the past, whose terrain is being read."""
    terrain, owner = live.create()
    edit, secret = link(live, terrain, owner)
    pause = Pause(monkeypatch, live.assembly.hub.journal, "load")
    peer = greet(live, terrain, secret, **hello)
    pause.meanwhile(lambda: revoke(live, terrain, owner, edit))
    number, error = peer.closed()
    assert (number, error and error["code"]) == (c.WS_CLOSE["revoked"], "revoked")
    assert not [m for m in peer.seen if m["type"] == "welcome"]


GETS = ("", "/archive", "/document", "/history", "/document?at=0")


@pytest.mark.parametrize("path", GETS)
def test_what_is_read_while_the_link_is_revoked_is_not_sent(
    live: LiveServer, monkeypatch: pytest.MonkeyPatch, path: str
) -> None:
    """SPEC P287."""
    terrain, owner = live.create()
    edit, secret = link(live, terrain, owner)
    pause = Pause(monkeypatch, live.assembly.hub.journal, "document")
    with ThreadPoolExecutor(1) as pool:
        asked = pool.submit(live.http, "GET", f"/api/terrains/{terrain}{path}", None, secret)
        pause.meanwhile(lambda: revoke(live, terrain, owner, edit))
        status, error = asked.result(PATIENCE)
    assert (status, error["code"]) == (403, "revoked")


def test_a_copy_begun_before_is_not_made(live: LiveServer, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC P287."""
    terrain, owner = live.create()
    edit, secret = link(live, terrain, owner)
    pause = Pause(monkeypatch, live.assembly.hub.journal, "document")
    before = live.assembly.hub.journal.reader().execute("SELECT count(*) FROM terrains").fetchone()
    with ThreadPoolExecutor(1) as pool:
        asked = pool.submit(live.http, "POST", f"/api/terrains/{terrain}/fork", {}, secret)
        pause.meanwhile(lambda: revoke(live, terrain, owner, edit))
        assert asked.result(PATIENCE)[0] == 403
    assert live.assembly.hub.journal.reader().execute("SELECT count(*) FROM terrains").fetchone() == before


# --- files ------------------------------------------------------------------------------------------------------


def test_an_upload_begun_before_is_not_laid(live: LiveServer) -> None:
    """SPEC P287: its bytes come slowly, and the link ends in the middle of them."""
    terrain, owner = live.create()
    edit, secret = link(live, terrain, owner)
    tcp = raw_socket(live.port)
    head = (
        f"POST /api/terrains/{terrain}/imports?name=a.tif HTTP/1.1\r\nHost: 127.0.0.1:{live.port}\r\n"
        f"Authorization: Bearer {secret}\r\nContent-Length: 1000\r\n\r\n"
    )
    tcp.sendall(head.encode() + b"x" * 500)
    _until(lambda: works(live) != [])
    revoke(live, terrain, owner, edit)
    tcp.sendall(b"x" * 500)
    tcp.settimeout(PATIENCE)
    assert b" 4" in tcp.recv(4096).split(b"\r\n")[0]
    tcp.close()
    _until(lambda: works(live) == [])
    assert not layers(live, terrain)


def test_an_import_under_way_ends_with_its_link(live: LiveServer, reader: Reader) -> None:
    """SPEC P287: while the file is converted."""
    terrain, owner = live.create()
    edit, secret = link(live, terrain, owner)
    status, job = send(live, terrain, secret, "slow")
    assert status == 202
    _until(lambda: reader.at_once > 0)
    revoke(live, terrain, owner, edit)
    reader.gate.set()
    path = f"/api/terrains/{terrain}/imports/{job['id']}"
    _until(lambda: live.http("GET", path, secret=owner)[1]["stage"] == "cancelled")
    assert "revoked" in live.http("GET", path, secret=owner)[1]["text"]
    assert not layers(live, terrain)
    assert no_works(live)


def test_an_import_is_not_laid_in_the_last_moment(live: LiveServer, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC P287: while its grid is being stored."""
    terrain, owner = live.create()
    edit, secret = link(live, terrain, owner)
    pause = Pause(monkeypatch, live.assembly._grids, "keep")
    status, job = send(live, terrain, secret, "x")
    assert status == 202
    pause.meanwhile(lambda: revoke(live, terrain, owner, edit))
    path = f"/api/terrains/{terrain}/imports/{job['id']}"
    _until(lambda: live.http("GET", path, secret=owner)[1]["stage"] in ("cancelled", "refused"))
    assert not layers(live, terrain)


def test_a_download_under_way_is_cut_off(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC P288: and the file that was made for it is removed."""
    monkeypatch.setattr(sending, "ASK_SECONDS", 0.0)
    path = tmp_path / "archive"
    path.write_bytes(bytes(1 << 20))
    lives = [True]

    def demand(_: object) -> None:
        if not lives[0]:
            raise Denied("revoked", "gone")

    door, access = SimpleNamespace(demand=demand), SimpleNamespace(alive=lambda _: lives[0])
    hub = cast(Any, SimpleNamespace(door=door, access=access))
    sent: list[Any] = []

    async def send_part(message: Any) -> None:
        sent.append(message)
        if len(sent) == 3:
            lives[0] = False

    async def receive() -> Any:
        await asyncio.Event().wait()

    answer = sending.Sent(hub, cast(Any, None), path, "application/zip", "a.esker", passing=True)
    scope = {"type": "http", "method": "GET", "headers": [], "extensions": {}}
    asyncio.run(answer(scope, receive, send_part))
    assert len(sent) == 3
    assert sent[-1]["more_body"]
    assert not path.exists()
    path.write_bytes(b"x")
    with pytest.raises(Denied):
        sending.Sent(hub, cast(Any, None), path, "application/zip", "a.esker", passing=True)
    assert not path.exists(), "nothing is left of an answer that was never given"


@pytest.mark.parametrize("ranges", ["bytes=zz", "bytes=9999999999-", "bytes=0-1"])
def test_no_range_leaves_a_file_behind(live: LiveServer, ranges: str) -> None:
    """SPEC P288: a range that cannot be is refused before any task of the answer runs."""
    import urllib.error
    import urllib.request

    terrain, owner = live.create()
    for _ in range(3):
        request = urllib.request.Request(f"{live.base}/api/terrains/{terrain}/archive")
        request.add_header("Authorization", f"Bearer {owner}")
        request.add_header("Range", ranges)
        try:
            with urllib.request.urlopen(request) as answer:
                answer.read()
        except urllib.error.HTTPError as error:
            error.close()
    _until(lambda: not list(live.assembly.settings.data.rglob("*.esker")))


# --- open sockets -----------------------------------------------------------------------------------------------


def test_a_member_who_never_reads_is_gone_as_well(live: LiveServer) -> None:
    """SPEC P289."""
    terrain, owner = live.create()
    edit, secret = link(live, terrain, owner)
    sleeper = sleeping_member(live.port, terrain, secret)
    ada = live.join(terrain, owner, "ada")
    _until(lambda: len(_members(live, terrain)) == 2)
    for i in range(40):
        ada.ops((f"ada:{i}", stroke(f"s{i}")))
    revoke(live, terrain, owner, edit)
    _until(lambda: _members(live, terrain) == {"ada"})
    assert isinstance(sleeper, socket.socket)
    sleeper.close()
    ada.close()


def _members(live: LiveServer, terrain: str) -> set[str]:
    room = live.assembly.hub.open_room(terrain)
    return set() if room is None else set(room.core.members.by_client)


def _until(holds: Callable[[], bool]) -> None:
    deadline = time.monotonic() + PATIENCE
    while not holds():
        assert time.monotonic() < deadline
        time.sleep(0.005)
