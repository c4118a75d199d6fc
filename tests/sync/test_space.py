"""The disk: what may be taken of it, by whom, and what is left over (SPEC J256 to J259)."""

from __future__ import annotations

import http.client
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from esker import contract as c
from esker.document.ops import StrokeSet
from esker.fairness.shares import Rate, Rates
from esker.session.room.core import RoomCore, RoomInfo
from esker.session.room.outbox import Outbox
from esker.store.journal import Loaded
from esker.store.space import LOOK_SECONDS, MEASURE_SECONDS, NoSpace, Space
from tests.store.engines import sqlite
from tests.sync.harness import LiveServer, set_op, stroke

SMALL: dict[str, Any] = {"kind": "profile", "first": (0, 0, 0), "last": (1, 1, 1), "curve": ((0, 0),)}


class Disk:
    """A file system of so many bytes."""

    def __init__(self, total: int, free: int) -> None:
        self.total, self.free, self.time = total, free, 0.0

    def usage(self, _: Path) -> tuple[int, int, int]:
        return self.total, self.total - self.free, self.free

    def space(self, folder: Path, **more: Any) -> Space:
        return Space(folder, now=lambda: self.time, usage=self.usage, **more)


def test_the_floor_stays_free_and_drawing_may_use_half_of_it(tmp_path: Path) -> None:
    """SPEC J256."""
    disk = Disk(10_000, 2_000)
    space = disk.space(tmp_path, floor=1_000)
    space.need(600)
    with pytest.raises(NoSpace):
        space.need(600)  # what was asked for a moment ago counts, though the disk has not been looked at again
    space.need(600, drawing=True)
    with pytest.raises(NoSpace):
        space.need(600, drawing=True)
    disk.time += LOOK_SECONDS
    space.need(600)
    disk.free, disk.time = 400, disk.time + LOOK_SECONDS
    with pytest.raises(NoSpace) as caught:
        space.need(drawing=True)
    assert caught.value.errno is not None
    assert space.low


def test_the_floor_of_a_small_disk_is_a_share_of_it(tmp_path: Path) -> None:
    assert Disk(1_000, 1_000).space(tmp_path).floor == 50


def test_the_quota_of_the_folder(tmp_path: Path) -> None:
    """SPEC J256: it is measured now and then, and added up in between; a second name of a file takes no room."""
    disk = Disk(1 << 40, 1 << 40)
    space = disk.space(tmp_path, quota=1_000)
    (tmp_path / "a").write_bytes(bytes(500))
    (tmp_path / "b").hardlink_to(tmp_path / "a")
    space.need(400)
    with pytest.raises(NoSpace):
        space.need(200)
    disk.time += MEASURE_SECONDS
    space.need(200)


@pytest.fixture
def server(tmp_path: Path) -> Iterator[LiveServer]:
    with LiveServer(tmp_path) as running:
        yield running


def _fill(server: LiveServer, free: Callable[[Space], int]) -> None:
    storing = server.assembly._storing
    assert storing is not None
    space = storing.space
    space._usage = lambda _: (1 << 40, 0, free(space))
    space._free, space._looked = free(space), float("-inf")


def test_a_disk_at_its_floor_takes_no_terrain_but_can_be_drawn_on(server: LiveServer) -> None:
    """SPEC J256."""
    terrain, secret = server.create()
    peer = server.join(terrain, secret, "c1")
    _fill(server, lambda space: space.floor - 1)
    status, problem = server.http("POST", "/api/terrains", {})
    assert (status, problem["code"]) == (507, "storage")
    status, problem = server.http("GET", f"/api/terrains/{terrain}/archive", secret=secret)
    assert (status, problem["code"]) == (507, "storage")
    peer.ops(("c1:1", stroke("s1")))
    assert peer.wait("ack", "reject")["type"] == "ack"
    _fill(server, lambda _: 0)
    peer.ops(("c1:2", stroke("s2")))
    refused = peer.wait("ack", "reject")
    assert (refused["type"], refused["code"]) == ("reject", "unavailable")
    status, _ = server.http("POST", f"/api/terrains/{terrain}/links", {"role": "view", "name": "v"}, secret)
    assert status == 201, "links and their end need no room to speak of"


def test_who_watches_is_told_of_the_disk_and_the_journal(server: LiveServer) -> None:
    """SPEC J264."""
    status, ready = server.http("GET", "/readyz")
    assert (status, ready["ready"], ready["journal"], ready["disk"]) == (200, True, "ok", "ok")
    _fill(server, lambda space: space.floor - 1)
    status, ready = server.http("GET", "/readyz")
    assert (status, ready["reasons"]) == (503, ["disk"])
    _fill(server, lambda space: 2 * space.floor)
    journal = server.assembly._journal
    assert journal is not None
    db, pages = sqlite(journal).writer_db, "PRAGMA max_page_count"
    db.execute(f"{pages}={db.execute('PRAGMA page_count').fetchone()[0]}")
    terrain = c.Document(id="large", strokes=tuple(c.Stroke(**{**SMALL, "id": f"s{k}"}) for k in range(3_000)))
    assert journal.create(terrain).exception() is not None
    journal.submit(lambda db: db.execute("DELETE FROM terrains WHERE id='none'")).result()
    status, ready = server.http("GET", "/readyz")
    assert (status, ready["reasons"]) == (503, ["journal"])
    assert server.http("GET", "/healthz")[0] == 200, "the process is alive, and others may still look"
    db.execute(f"{pages}=1000000")
    server.create()
    assert server.http("GET", "/readyz")[0] == 200


def test_the_history_of_a_terrain_has_a_quota(server: LiveServer) -> None:
    """SPEC J257: one socket wrote 22 GB of journal an hour."""
    terrain, secret = server.create()
    journal = server.assembly._journal
    assert journal is not None
    journal._quota = 2_000
    peer = server.join(terrain, secret, "c1")
    peer.ops(("c1:1", stroke("s1")))
    assert peer.wait("ack", "reject")["type"] == "ack"
    for k in range(2, 30):
        peer.ops((f"c1:{k}", set_op("s1", label="x" * 60)))
        answer = peer.wait("ack", "reject")
        if answer["type"] == "reject":
            break
    assert answer["code"] == "unavailable"
    assert "copy" in answer["message"]
    rows = journal.rows(terrain, 0)
    assert sum(len(row.op) for row in rows) <= 2_000
    status, about = server.http("GET", f"/api/terrains/{terrain}", secret=secret)
    assert (status, about["clock"]) == (200, rows[-1].clock)
    other, other_secret = server.create()
    peer = server.join(other, other_secret, "c2")
    peer.ops(("c2:1", stroke("s1")))
    assert peer.wait("ack", "reject")["type"] == "ack"


def test_links_and_addresses_have_a_rate_of_characters() -> None:
    """SPEC J258: however many connections come by one link, and whatever client ids they claim."""
    now = [0.0]
    rates = Rates(Rate(100, 2_000), link=Rate(50, 1_200))
    loaded = Loaded(StrokeSet.from_document(c.Document(id="t")), [], {})
    core = RoomCore(loaded, lambda *_: None, rates=rates, now=lambda: now[0])
    said: dict[str, list[str]] = {}

    def send(client: str, link: str, counter: int, address: str = "192.0.2.1") -> bool:
        if client not in said:
            said[client] = []
            outbox = Outbox(lambda: None)
            hello = c.Hello(protocol=c.PROTOCOL_VERSION, terrain="t", secret="s" * 20, client=client)
            core.join(hello, "edit", link, outbox, RoomInfo(0, 0, "none"), address)
        op = c.SetTerrain(fields=c.TerrainFields(title="x" * 80))
        return bool(core.submit(core.members.by_client[client], [c.OpEnvelope(id=f"{client}:{counter}", op=op)]))

    size = 0
    while send(f"c{size}", "l1", 1):
        size += 1
    assert 5 <= size <= 12, "1,200 characters, by as many clients as they like"
    assert send("d0", "l2", 1), "another link draws on"
    while send("d0", "l2", size + 2):
        size += 1
    assert not send("e0", "l3", 1), "their address has its bound too"
    assert send("f0", "l3", 1, "192.0.2.2")
    now[0] = 1e3
    assert send("c0", "l1", 1000)


@pytest.mark.parametrize("header", ["bytes=zz", "bytes=999999999-", "bytes=5-2", "chairs=1-2", "bytes=0-3"])
def test_no_temporary_file_outlives_its_answer(server: LiveServer, header: str) -> None:
    """SPEC J259: a refused Range left the archive that was made for it."""
    terrain, secret = server.create()
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=20)
    connection.request(
        "GET", f"/api/terrains/{terrain}/archive", headers={"Authorization": f"Bearer {secret}", "Range": header}
    )
    response = connection.getresponse()
    response.read()
    connection.close()
    assert response.status in (200, 206, 400, 416)
    folder = server.assembly._grids.folder
    deadline = time.monotonic() + 20  # it is removed just after the last byte was sent
    while left := list(folder.glob(".work-*")):
        assert time.monotonic() < deadline, (response.status, left)
        time.sleep(0.01)
