"""Who takes a server's memory, descriptors or places and gives nothing back (SPEC P121 to P125)."""

from __future__ import annotations

import errno
import json
import socket
import time
from pathlib import Path

import pytest

from esker import contract as c
from esker.server.starting import CannotServe
from esker.server.wire import http
from esker.store.access import MAX_CODES, Access
from esker.store.journal import Journal
from tests.sync.harness import LiveServer, raw_socket, sleeping_member


@pytest.fixture
def hasty(monkeypatch: pytest.MonkeyPatch) -> None:
    """Patience of a quarter of a second."""
    monkeypatch.setattr(http, "LOOK_SECONDS", 0.05)
    monkeypatch.setattr(http, "HEADER_SECONDS", 0.25)
    monkeypatch.setattr(http, "BODY_SECONDS", 0.25)


def _ends(tcp: socket.socket, seconds: float = 60.0) -> bytes:
    """What the server says before it ends the connection."""
    tcp.settimeout(seconds)
    said = b""
    try:
        while part := tcp.recv(65536):
            said += part
    except ConnectionResetError:
        pass
    return said


def _head(path: str, secret: str, *fields: str) -> bytes:
    lines = (f"POST {path} HTTP/1.1", "Host: 127.0.0.1", f"Authorization: Bearer {secret}", *fields, "", "")
    return "\r\n".join(lines).encode()


def test_the_body_of_a_request_is_bounded(server: LiveServer) -> None:
    status, error = server.http("POST", "/api/terrains", {"title": "x" * c.MAX_MESSAGE_BYTES})
    assert (status, error["code"]) == (413, "too_large")
    with raw_socket(server.port) as tcp:
        chunk = b"%x\r\n%b\r\n" % (20_000, b" " * 20_000)
        tcp.sendall(_head("/api/terrains", "-", "Transfer-Encoding: chunked", "Content-Type: application/json"))
        tcp.sendall(5 * chunk)
        tcp.settimeout(10)
        assert tcp.recv(65536).startswith(b"HTTP/1.1 413 ")
    fits = {"title": "x", "template": None, "size_m": None}
    padded = json.dumps(fits).ljust(c.MAX_MESSAGE_BYTES).encode()
    assert server.http("POST", "/api/terrains", padded)[0] == 201


@pytest.mark.parametrize("endless", [b"a", b"a: b\r\n"])
def test_a_header_without_end_is_refused(server: LiveServer, endless: bytes) -> None:
    with raw_socket(server.port) as tcp:
        tcp.sendall(b"GET /healthz HTTP/1.1\r\n" if b":" in endless else b"GET /")
        tcp.sendall(endless * (3 * http.MAX_HEADER_BYTES // len(endless)))
        said = _ends(tcp)
    assert said.startswith(b"HTTP/1.1 431 ") or said == b"", "the refusal, unless more was on its way"
    assert server.http("GET", "/healthz")[0] == 200


@pytest.mark.parametrize("begun", [b"", b"GET /healthz HTTP/1.1\r\nHost: x\r\n", b"\r\n"])
@pytest.mark.usefixtures("hasty")
def test_who_never_finishes_a_header_is_dropped(server: LiveServer, begun: bytes) -> None:
    with raw_socket(server.port) as tcp:
        tcp.sendall(begun)
        assert _ends(tcp) == b""
    with raw_socket(server.port) as tcp:  # nor does a first answer buy more time
        tcp.sendall(b"GET /healthz HTTP/1.1\r\nHost: x\r\n\r\nGET /")
        assert _ends(tcp).startswith(b"HTTP/1.1 200 ")


@pytest.mark.usefixtures("hasty")
def test_an_upload_that_stops_gives_its_place_back(tmp_path: Path) -> None:
    with LiveServer(tmp_path) as server:
        terrain, secret = server.create()
        path = f"/api/terrains/{terrain}/imports?name=a.asc&client=c1"
        with raw_socket(server.port) as tcp:
            tcp.sendall(_head(path, secret, "Content-Length: 1000000") + b"ncols 5")
            assert _ends(tcp) == b""
        deadline = time.monotonic() + 60
        while (answer := server.http("POST", path, b"ncols", secret))[0] == 409:
            assert time.monotonic() < deadline
        assert answer[0] == 202


def test_an_upload_that_goes_on_slowly_is_not_dropped(server: LiveServer, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(http, "LOOK_SECONDS", 0.02)
    monkeypatch.setattr(http, "HEADER_SECONDS", 0.6)
    monkeypatch.setattr(http, "BODY_SECONDS", 0.6)
    monkeypatch.setattr(http, "BODY_BYTES", 10)
    with raw_socket(server.port) as tcp:
        tcp.sendall(_head("/api/terrains/import", "-", "Content-Length: 1000"))
        for _ in range(10):
            time.sleep(0.1)
            tcp.sendall(b"x" * 100)
        tcp.settimeout(60)
        assert tcp.recv(65536).startswith(b"HTTP/1.1 400 "), "it is no terrain file, and was read to its end"


@pytest.mark.usefixtures("hasty")
def test_an_answer_that_nobody_reads_is_taken_back(tmp_path: Path) -> None:
    page = tmp_path / "page"
    page.mkdir()
    (page / "index.html").write_text("<html></html>")
    (page / "large.bin").write_bytes(bytes(32 << 20))
    with LiveServer(tmp_path / "data", page=page) as server, socket.socket() as tcp:
        tcp.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        tcp.connect(("127.0.0.1", server.port))
        tcp.sendall(b"GET /large.bin HTTP/1.1\r\nHost: x\r\n\r\n")
        time.sleep(1.0)
        assert len(_ends(tcp)) < 8 << 20, "what was on its way, not the file"


def test_a_disk_without_room_is_told(server: LiveServer, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC P36: of a terrain file; elevation files say so themselves (tests/importing/test_run.py)."""
    before = sorted((server.assembly.settings.data / "grids").iterdir())

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("esker.server.routes.terrains.read_archive", full)
    status, error = server.http("POST", "/api/terrains/import", b"x")
    assert (status, error["code"]) == (507, "storage")
    assert "disk" in error["message"]
    assert sorted((server.assembly.settings.data / "grids").iterdir()) == before
    monkeypatch.setattr("esker.server.routes.terrains.read_archive", lambda *_: open("/nowhere/at/all"))  # noqa: SIM115
    assert server.http("POST", "/api/terrains/import", b"x")[0] == 500


def test_one_server_at_a_time_has_a_data_folder(tmp_path: Path) -> None:
    with LiveServer(tmp_path) as server:
        with pytest.raises(CannotServe, match=r"process \d+.*--data"):
            LiveServer(tmp_path)
        assert server.http("GET", "/healthz")[0] == 200
    LiveServer(tmp_path).assembly.close()


def test_the_codes_of_a_link_are_few_and_end_with_it(tmp_path: Path, server: LiveServer) -> None:
    journal = Journal(tmp_path)
    access = Access(journal)
    mine = [access.make_code("t", "edit", "mine") for _ in range(2)]
    theirs = [access.make_code("t", "edit", "theirs") for _ in range(MAX_CODES + 3)]
    assert all(access.open_code(code) for code in (*mine, *theirs[3:]))
    assert not any(access.open_code(code) for code in theirs[:3])
    journal.close()

    terrain, owner = server.create()
    link = server.http("POST", f"/api/terrains/{terrain}/links", {"role": "edit"}, owner)[1]
    made = server.http("POST", f"/api/terrains/{terrain}/codes", {}, link["secret"])[1]["code"]
    assert server.raw("DELETE", f"/api/terrains/{terrain}/links/{link['id']}", secret=owner)[0] == 204
    assert server.http("POST", "/api/join", {"code": made})[1]["code"] == "bad_code"


def test_who_reads_a_long_document_slowly_gets_it_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(c, "STALL_SECONDS", 1.0)
    strokes = tuple(
        c.Stroke(id=f"s{i}", kind="profile", first=(0, 0, 0), last=(9, 9, 9), curve=((0.1234567, 7.654321),) * 4096)
        for i in range(30)
    )
    with LiveServer(tmp_path) as server:
        terrain, secret = server.create(strokes=strokes)
        with sleeping_member(server.port, terrain, secret) as tcp:
            tcp.settimeout(10)
            began, got = time.monotonic(), 0
            while got < 2_300_000:  # of 2.5 MB, 0.9 a second
                part = tcp.recv(65536)
                assert part, f"dropped after {got} bytes"
                got += len(part)
                time.sleep(max(0.0, began + got / 900_000 - time.monotonic()))
        assert time.monotonic() - began > 2 * c.STALL_SECONDS
