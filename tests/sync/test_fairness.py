"""One stranger takes nothing from anybody: history rooms, seats, imports, exports, threads, sockets (SPEC P290 to
P293)."""

from __future__ import annotations

import http.client
import json
import resource
import socket
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from esker import contract as c
from esker.fairness.shares import Full, Rate, Rates, Who
from esker.render.pictures.previews import CannotDraw, Previews
from esker.server.wire import descriptors
from esker.server.wire.http import Connections
from esker.session.room import history_view
from esker.session.room.members import seats
from tests.sync.harness import PATIENCE, LiveServer, Peer
from tests.sync.scripted_maker import WANTED, Maker
from tests.sync.scripted_reader import Reader

STRANGER, CITIZEN = "192.0.2.66", "192.0.2.7"


@pytest.fixture
def live(tmp_path: Path, reader: Reader, maker: Maker) -> Iterator[LiveServer]:
    """A server to whom the tests are a proxy: what they say is where a request comes from."""
    with LiveServer(tmp_path) as server:
        yield server
        reader.gate.set()
        maker.gate.set()


def ask(live: LiveServer, address: str, method: str, path: str, body: Any = None, secret: str = "") -> tuple[int, Any]:
    data = body if isinstance(body, bytes) or body is None else json.dumps(body).encode()
    request = urllib.request.Request(live.base + path, data=data, method=method)
    request.add_header("X-Forwarded-For", address)
    request.add_header("Content-Type", "application/json")
    if secret:
        request.add_header("Authorization", f"Bearer {secret}")
    try:
        with urllib.request.urlopen(request, timeout=PATIENCE) as answer:
            content = answer.read()
            return answer.status, json.loads(content) if content[:1] in b"{[" else content
    except urllib.error.HTTPError as error:
        return error.code, json.loads(error.read())


def enter(live: LiveServer, address: str, terrain: str, secret: str, client: str, **hello: Any) -> Peer:
    peer = Peer(live.socket(additional_headers={"X-Forwarded-For": address}))
    peer.say("hello", protocol=c.PROTOCOL_VERSION, terrain=terrain, secret=secret, client=client, **hello)
    return peer


def link(live: LiveServer, terrain: str, owner: str, role: str) -> str:
    return str(live.http("POST", f"/api/terrains/{terrain}/links", {"role": role}, owner)[1]["secret"])


def test_a_stranger_in_all_rooms_of_the_past_gives_one_up(live: LiveServer) -> None:
    """SPEC P290: eight ids of one address, then somebody else comes."""
    strange, key = live.create()
    mine, secret = live.create()
    strangers = [enter(live, STRANGER, strange, key, f"s{i}", at=0) for i in range(c.MAX_HISTORY_ROOMS)]
    for peer in strangers:
        peer.wait("welcome")
    ninth = enter(live, STRANGER, strange, key, "s9", at=0)
    assert ninth.closed()[0] == c.WS_CLOSE["room_full"]
    me = enter(live, CITIZEN, mine, secret, "me", at=0)
    me.wait("welcome")
    code, error = strangers[0].closed()
    assert (code, error and error["message"]) == (c.WS_CLOSE["room_full"], history_view.YIELDED)
    for peer in (*strangers[1:], me):
        peer.close()


def test_views_of_the_history_come_at_a_rate(live: LiveServer) -> None:
    """SPEC A448: a viewer opened 40 a second, each of which reads the journal, and the server grew by 1.6 GB."""
    live.assembly.hub.door._history_hellos = Rates(Rate(1e-6, 3.0))
    terrain, secret = live.create()
    for i in range(3):
        looking = enter(live, STRANGER, terrain, secret, f"h{i}", at=0)
        looking.wait("welcome")
        looking.close()
    code, error = enter(live, STRANGER, terrain, secret, "h3", at=0).closed()
    assert (code, error and error["code"]) == (c.WS_CLOSE["rate_limited"], "rate_limited")
    for address, more in ((STRANGER, {}), (CITIZEN, {"at": 0})):
        others = enter(live, address, terrain, secret, f"o{len(more)}", **more)
        others.wait("welcome")
        others.close()


def test_a_link_to_look_does_not_take_all_seats(tmp_path: Path) -> None:
    """SPEC P291: half of them at most; those who draw, and owners, come in."""
    with LiveServer(tmp_path, max_members=20) as live:
        terrain, owner = live.create()
        view, edit = (link(live, terrain, owner, role) for role in ("view", "edit"))
        share, peers = seats(20), []
        for i in range(20):
            peers.append(enter(live, f"192.0.2.{100 + i}", terrain, view, f"v{i}"))
            if i < 10:
                peers[-1].wait("welcome")
            else:
                assert peers[-1].closed()[0] == c.WS_CLOSE["room_full"]
        assert share.link == 10
        for i in range(9):
            peers.append(enter(live, STRANGER, terrain, edit, f"e{i}"))
            peers[-1].wait("welcome")
        assert enter(live, STRANGER, terrain, edit, "e9").closed()[0] == c.WS_CLOSE["room_full"]
        enter(live, CITIZEN, terrain, owner, "boss").wait("welcome")


def test_small_rooms_have_no_seat_that_nobody_may_take() -> None:
    """SPEC P291."""
    for most in range(1, 12):
        share = seats(most)
        assert share.address is not None
        assert 1 <= share.address <= most
        assert share.reserve[0] < most


def test_a_stranger_s_imports_leave_places(live: LiveServer) -> None:
    """SPEC P290: as many links and client ids as one likes, eight by address, four by link."""
    answers = []
    for i in range(10):
        terrain, secret = live.create()
        path = f"/api/terrains/{terrain}/imports?name=a.tif&client=s{i}"
        answers.append(ask(live, STRANGER, "POST", path, b"slow", secret)[0])
    assert answers == [202] * 8 + [503] * 2
    terrain, secret = live.create()
    path = f"/api/terrains/{terrain}/imports?name=a.tif"
    codes = [ask(live, f"192.0.2.{i}", "POST", f"{path}&client=c{i}", b"slow", secret)[0] for i in range(1, 6)]
    assert codes == [202] * 4 + [503]


def test_a_stranger_s_exports_leave_places(live: LiveServer, maker: Maker) -> None:
    """SPEC P290, P283: and somebody else's is made after the one under way and one more, not after eight."""
    answers = []
    for i in range(10):
        terrain, secret = live.create(settings=c.TerrainSettings(title=f"slow {i}"))
        answers.append(ask(live, STRANGER, "POST", f"/api/terrains/{terrain}/exports?client=s{i}", WANTED, secret)[0])
    assert answers == [202] * 8 + [503] * 2
    terrain, secret = live.create(settings=c.TerrainSettings(title="mine"))
    status, job = ask(live, CITIZEN, "POST", f"/api/terrains/{terrain}/exports", WANTED, secret)
    assert status == 202
    maker.gate.set()
    path = f"/api/terrains/{terrain}/exports/{job['id']}"
    deadline = time.monotonic() + PATIENCE
    while ask(live, CITIZEN, "GET", path, None, secret)[1]["stage"] != "done":
        assert time.monotonic() < deadline
        time.sleep(0.01)
    made = [task.document.settings.title for task in maker.tasks]
    assert made.index("mine") <= 2


def test_links_to_look_leave_exports_of_a_terrain_to_those_who_draw(live: LiveServer, maker: Maker) -> None:
    """SPEC A443: one link to look, under four ids of clients, took all four that a terrain has at a time."""
    terrain, secret = live.create(settings=c.TerrainSettings(title="slow"))
    made = [
        live.http("POST", f"/api/terrains/{terrain}/links", {"role": role}, secret)[1]["secret"]
        for role in ("view", "view", "edit")
    ]

    def asks(address: str, key: str, client: str) -> int:
        return ask(live, address, "POST", f"/api/terrains/{terrain}/exports?client={client}", WANTED, key)[0]

    assert [asks(STRANGER, made[0], f"s{i}") for i in range(4)] == [202, 202, 503, 503]
    assert asks("198.51.100.20", made[1], "other") == 503, "all links to look together have no more"
    assert [asks("198.51.100.30", made[2], f"e{i}") for i in range(2)] == [202, 503]
    assert asks(STRANGER, secret, "owner") == 202, "behind the address of the viewer, too"
    maker.gate.set()
    deadline = time.monotonic() + PATIENCE
    while asks(STRANGER, made[0], "later") != 202:
        assert time.monotonic() < deadline, "places come back"
        time.sleep(0.01)


def test_a_stranger_s_reading_does_not_hold_all_threads(live: LiveServer, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC P292: thirty requests that take long, and another terrain opens meanwhile."""
    strange, key = live.create()
    mine, secret = live.create()
    held, document = threading.Event(), live.assembly.hub.journal.document

    def slow(terrain: str, upto: int | None = None) -> Any:
        if terrain == strange:
            assert held.wait(PATIENCE)
        return document(terrain, upto)

    monkeypatch.setattr(live.assembly.hub.journal, "document", slow)
    with ThreadPoolExecutor(30) as pool:
        path = f"/api/terrains/{strange}/archive"
        asked = [pool.submit(ask, live, STRANGER, "GET", path, None, key) for _ in range(30)]
        try:
            me = enter(live, CITIZEN, mine, secret, "me")
            me.wait("welcome")
            assert ask(live, CITIZEN, "GET", f"/api/terrains/{mine}/archive", None, secret)[0] == 200
            me.close()
        finally:
            held.set()
        assert {each.result(PATIENCE)[0] for each in asked} <= {200, 429}


def test_steps_through_the_past_take_turns_too(live: LiveServer, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC P452: they were done in the threads that all of the server shares."""
    run, done = live.assembly.hub.reading.run, list[str]()

    async def noted(who: Who, work: Any, *args: Any, **more: Any) -> Any:
        done.append(work.__name__)
        return await run(who, work, *args, **more)

    monkeypatch.setattr(live.assembly.hub.reading, "run", noted)
    terrain, secret = live.create()
    peer = enter(live, STRANGER, terrain, secret, "s1", at=0)
    peer.wait("welcome")
    peer.say("seek", clock=0)
    peer.wait("welcome", "ordered")
    peer.close()
    assert "go" in done


def test_what_is_read_for_a_picture_counts_for_who_asks(live: LiveServer, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC P452: it counted for the server itself, whose turns one stranger could fill."""
    run, asked = live.assembly.hub.reading.run, list[str]()

    async def noted(who: Who, work: Any, *args: Any, **more: Any) -> Any:
        asked.append(who.address)
        return await run(who, work, *args, **more)

    async def undrawn(*_: Any) -> Path:
        raise CannotDraw("what counts is read before anything is drawn")

    monkeypatch.setattr(live.assembly.hub.reading, "run", noted)
    monkeypatch.setattr(Previews, "_draw", undrawn)
    terrain, secret = live.create()
    token = ask(live, STRANGER, "GET", f"/api/terrains/{terrain}/preview", None, secret)[1]["token"]
    assert ask(live, STRANGER, "GET", f"/preview/{token}.jpg")[1]["code"] == "no_pictures"
    assert asked
    assert set(asked) == {STRANGER}


def test_connections_have_a_share_by_address() -> None:
    """SPEC P293."""
    connections = Connections(40, {"10.0.0.1"}.__contains__)
    mine = [connections.take(STRANGER) for _ in range(10)]
    with pytest.raises(Full):
        connections.take(STRANGER)
    spread = 0
    with suppress(Full):
        for i in range(64):
            connections.take(f"2001:db8:7:{i}::1")
            spread += 1
    assert spread == 20, "of one /48"
    proxied = [connections.take("10.0.0.1") for _ in range(10)]
    with pytest.raises(Full):
        connections.take("10.0.0.1")
    for place in (*mine, *proxied):
        place.release()
    assert len(connections) == 20


def test_a_server_without_descriptors_says_so_once_and_comes_back(tmp_path: Path) -> None:
    """SPEC A403: the limit is lowered to what is in use, so that accepting itself fails (EMFILE)."""
    command = (sys.executable, "-m", "esker", "serve", "--port", "0", "--device", "numpy", "--data", str(tmp_path))
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        line = next(text for text in process.stdout if b"http://" in text)
        port = int(line.split(b"://")[1].split(b"/")[0].split(b":")[1])
        known = http.client.HTTPConnection("127.0.0.1", port, timeout=PATIENCE)
        taken: list[socket.socket] = []
        said: list[bytes] = []
        stderr = process.stderr
        listening = threading.Thread(target=lambda: said.extend(iter(stderr.readline, b"")), daemon=True)
        listening.start()

        def healthy() -> bool:
            known.request("GET", "/healthz")
            answer = known.getresponse()
            answer.read()
            return answer.status == 200

        def heard(sentence: str) -> int:
            return sum(sentence.encode() in line for line in said)

        try:
            assert healthy()
            before = resource.prlimit(process.pid, resource.RLIMIT_NOFILE)
            in_use = len(list(Path(f"/proc/{process.pid}/fd").iterdir()))
            resource.prlimit(process.pid, resource.RLIMIT_NOFILE, (in_use + 2, before[1]))
            # What a start still had open goes meanwhile, so nobody knows how many connections use up the rest.
            while not heard(descriptors.USED_UP):
                tcp = socket.socket()
                tcp.bind(("127.0.0.2", 0))
                tcp.settimeout(0.5)
                taken.append(tcp)
                with suppress(OSError):
                    tcp.connect(("127.0.0.1", port))
            assert all(healthy() for _ in range(20)), "who has a connection goes on"
            resource.prlimit(process.pid, resource.RLIMIT_NOFILE, before)
            for tcp in taken:
                tcp.close()
            while not heard(descriptors.AGAIN):
                assert healthy()
            with urllib.request.urlopen(f"http://127.0.0.1:{port}/healthz", timeout=PATIENCE) as answer:
                assert answer.status == 200
        finally:
            known.close()
            for tcp in taken:
                tcp.close()
            process.kill()
        listening.join()
        assert b"Traceback" not in b"".join(said)
        assert heard(descriptors.USED_UP) == 1, "once"


def test_whoever_opens_all_the_sockets_one_may_keeps_nobody_out(tmp_path: Path) -> None:
    """SPEC P293: a server that may open 200 files, a stranger with 300 sockets that say nothing."""
    command = (sys.executable, "-m", "esker", "serve", "--port", "0", "--device", "numpy", "--data", str(tmp_path))
    limit = lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (200, 200))  # noqa: E731
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, preexec_fn=limit) as process:
        assert process.stdout is not None
        line = next(text for text in process.stdout if b"http://" in text)
        port = int(line.split(b"://")[1].split(b"/")[0].split(b":")[1])
        taken: list[socket.socket] = []
        try:
            for _ in range(300):
                tcp = socket.socket()
                tcp.bind(("127.0.0.2", 0))
                taken.append(tcp)
                with suppress(OSError):
                    tcp.connect(("127.0.0.1", port))
            for _ in range(20):
                with urllib.request.urlopen(f"http://127.0.0.1:{port}/healthz", timeout=PATIENCE) as answer:
                    assert answer.status == 200
        finally:
            for tcp in taken:
                tcp.close()
            process.kill()
        assert process.stderr is not None
        assert b"Traceback" not in process.stderr.read()
