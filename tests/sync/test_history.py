"""The history over the wire: its list, looking at an earlier clock, copies from there (SPEC HI7 to HI14)."""

from __future__ import annotations

import itertools
import shutil
import sqlite3
import time
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import esker
from esker import contract as c
from esker.cli.main import main
from esker.document.ops import StrokeSet
from esker.document.wire import op_json
from esker.fairness.shares import Places, Share
from esker.grid import TileKey, quantum
from esker.patchwork.raster import rasters
from esker.session.room import history_view
from esker.store.activity import ActivityLogs
from esker.store.journal import Journal, Row
from esker.store.timestamps import Person
from esker.store.writing import SNAPSHOT_EVERY
from esker.tiles.decoder import FrameDecoder
from tests.sync.harness import LiveServer, Peer, set_op, stroke

PATIENCE = 120.0
"""Seconds for a solve on a machine that has other things to do, and for compiling the loops that lay a grid before it:
in a clean checkout nobody may have done that yet."""
PROFILE = {"kind": "profile", "first": (0, 0, 0), "last": (1, 1, 1), "curve": ((0, 1),), "finished": True}


def begin(stroke_id: str) -> c.BeginStroke:
    return c.BeginStroke(stroke=c.Stroke.model_validate({"id": stroke_id, **PROFILE}))


def rows(first: int, count: int, author: str = "c") -> list[Row]:
    clocks = range(first, first + count)
    return [Row(clock, author, clock, author, op_json(begin(f"s{clock}"))) for clock in clocks]


def says(page: dict[str, Any]) -> list[str]:
    return [f"{page['people'][e['author']]['name']} {e['text']}" for e in page["entries"]]


def drawn(server: LiveServer, count: int = 3, **document: Any) -> tuple[str, str, Peer]:
    """A terrain with strokes s0, s1, ... of 10 m, 20 m, ... by Ana, who is still there."""
    terrain, secret = server.create(**document)
    ana = server.join(terrain, secret, "ana", name="Ana", colour="#112233")
    for i in range(count):
        ana.ops((f"ana:{i}", stroke(f"s{i}", 10.0 * (i + 1))))
        ana.wait("ack")
    return terrain, secret, ana


# --- the list ---------------------------------------------------------------------------------------------------


def test_the_list_is_of_what_people_did_newest_first_in_pages(tmp_path: Path) -> None:
    """HI7."""
    with LiveServer(tmp_path) as server:
        began = time.time()
        terrain, secret, ana = drawn(server)
        ben = server.join(terrain, secret, "ben", name="Ben")
        ben.ops(("ben:0", set_op("s1", label="Peak")))
        ben.wait("ack")
        ana.say("rename", name="Anna", colour="#445566")
        ana.ops(("ana:3", {"type": "stroke.delete", "stroke": "s2"}))
        ana.wait("ack")
        status, page = server.http("GET", f"/api/terrains/{terrain}/history?limit=3", secret=secret)
        assert status == 200
        assert says(page) == ["Anna undid drawing a mountain", "Ben named the mountain “Peak”", "Anna drew a mountain"]
        assert page["people"]["ana"] == {"name": "Anna", "colour": "#445566"}
        assert (page["clock"], page["more"], page["first"]) == (5, True, 0)
        assert [e["last"] for e in page["entries"]] == [5, 4, 3]
        assert all(began - 1 <= e["at"] <= time.time() for e in page["entries"])
        _, rest = server.http("GET", f"/api/terrains/{terrain}/history?limit=3&before=3", secret=secret)
        assert ([e["last"] for e in rest["entries"]], rest["more"]) == ([2, 1], False)
        for query in ("limit=0", f"limit={c.MAX_HISTORY_PAGE + 1}", "before=-1"):
            assert server.http("GET", f"/api/terrains/{terrain}/history?{query}", secret=secret)[0] == 400
        assert server.http("GET", f"/api/terrains/{terrain}/history", secret="wrong")[0] == 403


def test_a_journal_of_before_has_a_history_without_names_and_times(tmp_path: Path) -> None:
    """HI8."""
    journal = Journal(tmp_path)
    journal.create(c.Document(id="t")).result()
    journal.append("t", rows(1, 3)).result()
    for table in ("moments", "people"):
        journal.submit(partial(_empty, table)).result()
    journal.close()
    journal = Journal(tmp_path, now=lambda: 1000.0)
    journal.append("t", rows(4, 1, "d"), (Person("d", "Dan", "#000000"),)).result()
    page = ActivityLogs(journal).page("t", None, 10)
    assert [(e.author, e.at) for e in page.entries] == [("d", 1000.0), ("c", None), ("c", None), ("c", None)]
    assert page.people == {"d": Person("d", "Dan", "#000000")}
    journal.close()


def _empty(table: str, db: sqlite3.Connection) -> None:
    db.execute(f"DELETE FROM {table}")


def test_the_list_reaches_back_a_bounded_number_of_ops(tmp_path: Path) -> None:
    """HI9."""
    journal = Journal(tmp_path)
    journal.create(c.Document(id="t")).result()
    journal.append("t", rows(1, 30)).result()
    activity_logs = ActivityLogs(journal, reach=10)
    assert (activity_logs.page("t", None, 50).first, len(activity_logs.page("t", None, 50).entries)) == (20, 10)
    journal.append("t", rows(31, 10)).result()
    assert activity_logs.page("t", None, 50).first == 20
    journal.append("t", rows(41, 1)).result()
    assert activity_logs.page("t", None, 50).first == 31
    journal.close()


def test_no_clock_is_far_from_a_snapshot(tmp_path: Path) -> None:
    """HI10: and there are few of them, however long the history is."""
    journal = Journal(tmp_path)
    document = c.Document(id="t")
    journal.create(document).result()
    for i in range(1, 101):
        journal.keep_snapshot(document.model_copy(update={"clock": i * SNAPSHOT_EVERY})).result()
        query = "SELECT clock FROM snapshots WHERE terrain='t' ORDER BY clock"
        clocks = [row[0] for row in journal.reader().execute(query)]
        gaps = [b - a for a, b in itertools.pairwise(clocks)]
        assert clocks[0] == 0
        assert clocks[-1] == i * SNAPSHOT_EVERY
        assert len(clocks) <= 12
        assert max(gaps) <= max(2 * SNAPSHOT_EVERY, i * SNAPSHOT_EVERY / 2)
    journal.close()


# --- looking ----------------------------------------------------------------------------------------------------


def ground_is(peer: Peer, height: float, channel: c.Channel = c.Channel.HEIGHT) -> None:
    """Waits until the tiles say this height: with ``PlainSolver`` the sum of the strokes' first anchors."""
    want, deadline = round(height / quantum(0, c.DEFAULT_SIZE_M)), time.monotonic() + PATIENCE
    while True:
        decoder = FrameDecoder()
        for frame in peer.frames:
            decoder.decode(frame)
        root = decoder.channels[channel].get(TileKey(0, 0, 0))
        if root is not None and (root.samples == want).all():
            return
        assert time.monotonic() < deadline, root
        with suppress(TimeoutError):
            peer.next(0.1)


def test_one_looks_at_an_earlier_clock_and_the_live_room_does_not_notice(tmp_path: Path) -> None:
    """HI11."""
    with LiveServer(tmp_path) as server:
        terrain, secret, ana = drawn(server)
        past_ = server.join(terrain, secret, "past", at=2)
        assert past_.welcome["role"] == "view"
        assert past_.welcome["clock"] == past_.welcome["document"]["clock"] == 2
        assert [s["id"] for s in past_.welcome["document"]["strokes"]] == ["s0", "s1"]
        past_.settled(2, PATIENCE)
        ground_is(past_, 30)
        past_.ops(("past:0", stroke("mine")))
        assert past_.wait("reject")["code"] == "view_only"
        ana.ops(("ana:3", stroke("s3")))
        assert [o["clock"] for o in ana.wait("ordered")["ops"]] == [4]
        assert len(server.assembly.hub.open_room(terrain).core.members) == 1  # type: ignore[union-attr]
        assert not [m for m in past_.seen if m["type"] == "ordered"]
        late = server.join(terrain, secret, "late", at=10**6)
        assert late.welcome["clock"] == 4


def test_a_seek_goes_forward_by_ops_and_back_by_a_document(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """HI12: and the ground follows, also to a clock whose strokes are those of a later one."""
    with LiveServer(tmp_path) as server:
        terrain, secret, _ = drawn(server, 5)
        peer = server.join(terrain, secret, "past", at=1)
        peer.settled(1, PATIENCE)
        peer.say("seek", clock=3)
        assert [o["clock"] for o in peer.wait("ordered", "welcome")["ops"]] == [2, 3]
        peer.settled(3, PATIENCE)
        ground_is(peer, 60)
        assert peer.seen[-1]["clock"] == 3
        peer.say("seek", clock=2)
        back = peer.wait("ordered", "welcome")
        assert (back["type"], back["document"]["clock"], len(back["document"]["strokes"])) == ("welcome", 2, 2)
        peer.settled(2, PATIENCE)
        ground_is(peer, 30)
        monkeypatch.setattr(history_view, "STEP_CHARACTERS", 10)
        peer.say("seek", clock=99)
        assert peer.wait("ordered", "welcome")["document"]["clock"] == 5
        peer.settled(5, PATIENCE)
        peer.say("seek", clock=0)
        assert peer.wait("welcome")["document"]["strokes"] == []
        peer.settled(0, PATIENCE)
        ground_is(peer, 0)


def test_only_who_looks_at_the_past_may_seek(tmp_path: Path) -> None:
    """HI12."""
    with LiveServer(tmp_path) as server:
        _, _, ana = drawn(server, 1)
        ana.say("seek", clock=0)
        assert ana.closed()[0] == c.WS_CLOSE["malformed"]


def test_rooms_of_the_past_are_few_and_not_for_ever(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """HI13."""
    with LiveServer(tmp_path) as server:
        terrain, secret, _ = drawn(server, 1)
        rooms = server.assembly.hub._history_rooms
        rooms._places = Places(Share(2))
        first = server.join(terrain, secret, "p0", at=0)
        again = server.join(terrain, secret, "p0", at=1)
        assert first.closed()[0] == c.WS_CLOSE["bad_hello"]
        other = server.join(terrain, secret, "p1", at=1)
        third = Peer(server.socket())
        third.say("hello", protocol=c.PROTOCOL_VERSION, terrain=terrain, secret=secret, client="p2", at=1)
        code, error = third.closed()
        assert (code, error and error["message"]) == (c.WS_CLOSE["room_full"], history_view.CROWDED)
        for peer in (again, other):
            peer.close()
        empty(rooms)
        monkeypatch.setattr(c, "HISTORY_IDLE_SECONDS", 0.3)
        code, error = server.join(terrain, secret, "p3", at=1).closed()
        assert (code, error and error["message"]) == (c.WS_CLOSE["room_full"], history_view.IDLE)
        empty(rooms)


def empty(rooms: history_view.HistoryRooms) -> None:
    """Waits until nobody looks at the past."""
    deadline = time.monotonic() + 60
    while len(rooms):
        assert time.monotonic() < deadline
        time.sleep(0.02)


def test_a_revoked_link_ends_looking_back_too(tmp_path: Path) -> None:
    """HI13."""
    with LiveServer(tmp_path) as server:
        terrain, secret, _ = drawn(server, 1)
        _, link = server.http("POST", f"/api/terrains/{terrain}/links", {"role": "view", "name": "x"}, secret)
        peer = server.join(terrain, link["secret"], "past", at=0)
        assert server.http("DELETE", f"/api/terrains/{terrain}/links/{link['id']}", secret=secret)[0] == 204
        assert peer.closed()[0] == c.WS_CLOSE["revoked"]


def test_the_past_of_any_clock_is_what_the_journal_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """HI12: back and forth, with waypoints dropped and the journal asked in between."""
    monkeypatch.setattr(history_view, "FAR_OPS", 7)
    monkeypatch.setattr(history_view, "WAYPOINT_OPS", 3)
    monkeypatch.setattr(history_view, "WAYPOINTS", 4)
    journal = Journal(tmp_path)
    journal.create(c.Document(id="t")).result()
    journal.append("t", rows(1, 40)).result()
    reader = history_view.HistoryReader(journal, StrokeSet("t"))
    for clock in (5, 9, 30, 28, 40, 0, 1, 12, 39, 20, 99):
        document, steps = reader.go(clock)
        assert document.clock == min(clock, 40)
        assert len(document.strokes) == document.clock
        assert steps is None or [row.clock for row in steps] == list(
            range(document.clock - len(steps) + 1, document.clock + 1)
        )
    journal.close()


# --- copies -----------------------------------------------------------------------------------------------------


def test_a_copy_is_a_terrain_of_its_own_from_that_clock(tmp_path: Path) -> None:
    """HI14."""
    with LiveServer(tmp_path) as server:
        terrain, secret, ana = drawn(server, 2, settings=c.TerrainSettings(title="Home"))
        ana.ops(("ana:2", {"type": "stroke.delete", "stroke": "s0"}))
        ana.wait("ack")
        status, made = server.http("POST", f"/api/terrains/{terrain}/fork", {"at": 1}, secret)
        assert (status, made["title"], made["role"], made["clock"]) == (201, "Copy of Home", "owner", 1)
        copy = server.join(made["id"], made["secret"], "c")
        assert [s["id"] for s in copy.welcome["document"]["strokes"]] == ["s0"]
        copy.ops(("c:0", stroke("new")))
        copy.wait("ack")
        _, now = server.http("POST", f"/api/terrains/{terrain}/fork", {"title": "Mine"}, secret)
        document = server.join(now["id"], now["secret"], "d").welcome["document"]
        assert [s["id"] for s in document["strokes"]] == ["s1"]
        assert (document["deleted"], document["settings"]["title"], document["clock"]) == ([], "Mine", 0)
        _, original = server.http("GET", f"/api/terrains/{terrain}/document", secret=secret)
        assert (original["clock"], [s["id"] for s in original["strokes"]]) == (3, ["s1"])


def test_who_may_only_look_sees_the_past_and_copies_nothing(tmp_path: Path) -> None:
    """HI14."""
    with LiveServer(tmp_path) as server:
        terrain, secret, _ = drawn(server, 2)
        _, link = server.http("POST", f"/api/terrains/{terrain}/links", {"role": "view", "name": "x"}, secret)
        look = link["secret"]
        assert server.http("GET", f"/api/terrains/{terrain}/history", secret=look)[0] == 200
        assert len(server.http("GET", f"/api/terrains/{terrain}/document?at=1", secret=look)[1]["strokes"]) == 1
        assert server.join(terrain, look, "past", at=1).welcome["clock"] == 1
        status, answer = server.http("POST", f"/api/terrains/{terrain}/fork", {"at": 1}, look)
        assert (status, answer["code"]) == (403, "view_only")


def test_python_and_a_shell_read_and_copy_the_history(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """HI7, HI14."""
    with LiveServer(tmp_path) as server:
        terrain, secret, _ = drawn(server, 2)
        link = f"{server.base}/t/{terrain}#{secret}"
        with esker.connect(link, "Py") as live:
            live.set("s1", label="Peak")
            live.wait()
            assert [str(e) for e in live.history()] == [
                "Py named the mountain “Peak”",
                "Ana drew the mountain “Peak”",
                "Ana drew a mountain",
            ]
            assert [e.last for e in live.history(before=3)] == [2, 1]
            assert [s.id for s in live.at(1).strokes] == ["s0"]
            with esker.connect(live.fork(1, "Mine")) as copy:
                assert ([s.id for s in copy.strokes], copy.settings.title) == (["s0"], "Mine")
        assert main(["history", link, "--most", "1"]) == 0
        assert capsys.readouterr().out.rstrip().endswith("Py named the mountain “Peak”")
        assert main(["fork", link, "--at", "2"]) == 0
        with esker.connect(capsys.readouterr().out.strip()) as copy:
            assert len(copy.strokes) == 2
        assert main(["fork", link[:-3]]) == 1
        assert "does not open this terrain" in capsys.readouterr().err


def test_elevation_layers_are_in_the_past_and_in_copies(tmp_path: Path) -> None:
    """HI11, HI14: also those that were deleted since; a grid that is gone is said to be."""
    with LiveServer(tmp_path) as server:
        raster = rasters.build(np.full((40, 50), 128, dtype=np.float32))
        server.assembly._grids.put(raster)
        facts = c.GridFacts(rows=40, cols=50, low_m=128, high_m=128)
        layer = c.Layer(
            id="v", content=raster.digest, facts=facts, anchor=(0, 0), spacing_m=(90, 110), accuracy_m=1, name="Table"
        )
        terrain, secret = server.create(layers=(layer,))
        ana = server.join(terrain, secret, "ana", name="Ana")
        ana.ops(("ana:0", {"type": "layer.delete", "layer": "v"}))
        ana.wait("ack")
        _, page = server.http("GET", f"/api/terrains/{terrain}/history", secret=secret)
        assert says(page) == ["Ana deleted layer Table"]
        peer = server.join(terrain, secret, "past", at=0)
        peer.settled(0, PATIENCE)
        ground_is(peer, 128, c.Channel.BASE)
        peer.say("seek", clock=1)
        peer.settled(1, PATIENCE)
        ground_is(peer, 0, c.Channel.BASE)
        status, made = server.http("POST", f"/api/terrains/{terrain}/fork", {"at": 0}, secret)
        assert status == 201
        assert server.assembly.hub.journal.grids(made["id"]) == {raster.digest}
        assert server.join(made["id"], made["secret"], "c").welcome["document"]["layers"][0]["name"] == "Table"
        shutil.rmtree(server.assembly._grids.path(raster.digest))
        assert server.http("POST", f"/api/terrains/{terrain}/fork", {"at": 0}, secret)[1]["code"] == "no_grid"
        assert server.http("POST", f"/api/terrains/{terrain}/fork", {"at": 1}, secret)[0] == 201
