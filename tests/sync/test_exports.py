"""Exports over HTTP: who may, how many, cancel, what is kept; and the process that makes them (SPEC X20 to X24)."""

from __future__ import annotations

import asyncio
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest

from esker import Stroke, Terrain
from esker import contract as c
from esker.api import export_child
from esker.api.export_child import Failure, Out, work
from esker.exporting import run, wire
from esker.exporting.run import ExportFailed
from esker.fairness.shares import Places, Share
from esker.jobs import exports
from tests.sync.harness import LiveServer
from tests.sync.scripted_maker import CONTENT, WANTED, Maker


@pytest.fixture
def live(tmp_path: Path, maker: Maker) -> Iterator[LiveServer]:
    with LiveServer(tmp_path) as server:
        yield server
        maker.gate.set()


def begin(live: LiveServer, terrain: str, secret: str, client: str = "", **wanted: Any) -> tuple[int, Any]:
    return live.http("POST", f"/api/terrains/{terrain}/exports?client={client}", WANTED | wanted, secret)


def wait(live: LiveServer, terrain: str, secret: str, job: str, *stages: str, patience: float = 60) -> dict[str, Any]:
    """Until the export is in one of these stages; its share never falls on the way."""
    deadline, share = time.monotonic() + patience, 0.0
    while True:
        status, told = live.http("GET", f"/api/terrains/{terrain}/exports/{job}", secret=secret)
        assert status == 200, told
        assert told["share"] >= share
        share = told["share"]
        if told["stage"] in stages:
            return dict(told)
        assert told["stage"] not in exports.OVER, told
        assert time.monotonic() < deadline, told
        time.sleep(0.01)


def folders(live: LiveServer) -> list[str]:
    folder = live.assembly.settings.data / "exports"
    return sorted(path.name for path in folder.iterdir()) if folder.is_dir() else []


def titled(title: str) -> dict[str, Any]:
    return {"settings": c.TerrainSettings(title=title)}


def test_a_file_is_made_and_given_out(live: LiveServer, maker: Maker) -> None:
    """SPEC X20: to viewers too; of now and of an earlier clock."""
    stroke = Stroke.level([(900, 900, 120), (1500, 1000, 120), (1300, 1500, 120)])
    terrain, owner = live.create(strokes=(stroke,), **titled("Föhn / ridge_1"))
    _, link = live.http("POST", f"/api/terrains/{terrain}/links", {"role": "view"}, owner)
    secret = link["secret"]
    assert live.http("POST", f"/api/terrains/{terrain}/exports/estimate", WANTED, secret)[1]["bytes"] == 4 * 257**2
    status, job = begin(live, terrain, secret)
    assert status == 202
    done = wait(live, terrain, secret, job["id"], "done")
    assert (done["file"], done["bytes"], done["low_m"], done["share"]) == ("a.npy", 1000, -1.0, 1.0)
    path = f"/api/terrains/{terrain}/exports/{job['id']}/file"
    assert live.raw("GET", path, secret=secret) == (200, CONTENT, "application/octet-stream")
    task = maker.tasks[0]
    assert (task.name, task.global_level, len(task.document.strokes)) == ("föhn-ridge-1-257", 1, 1)
    begin(live, terrain, owner, at=0)
    wait(live, terrain, owner, begin(live, terrain, secret, at=0)[1]["id"], "done")
    assert {task.document.clock for task in maker.tasks} == {0}


def test_exports_belong_to_their_link_and_to_owners(live: LiveServer) -> None:
    """SPEC X20."""
    terrain, owner = live.create()
    edit = live.http("POST", f"/api/terrains/{terrain}/links", {"role": "edit"}, owner)[1]["secret"]
    view = live.http("POST", f"/api/terrains/{terrain}/links", {"role": "view"}, owner)[1]["secret"]
    job = begin(live, terrain, edit)[1]["id"]
    wait(live, terrain, edit, job, "done")
    path = f"/api/terrains/{terrain}/exports/{job}"
    for tail in ("", "/file"):
        assert live.http("GET", path + tail, secret=view)[0] == 403
        assert live.http("GET", path + tail, secret="wrong")[0] == 403
        assert live.http("GET", path + tail)[0] == 401
        assert live.http("GET", path + tail, secret=owner)[0] == 200
    assert live.http("DELETE", path, secret=view)[0] == 403
    other, secret = live.create()
    assert live.http("GET", f"/api/terrains/{other}/exports/{job}", secret=secret)[1]["code"] == "no_export"
    assert begin(live, terrain, "wrong")[0] == 403
    assert live.http("POST", f"/api/terrains/{terrain}/exports/estimate", WANTED)[0] == 401


@pytest.mark.parametrize(
    "wanted",
    [
        {"samples": 1000},
        {"format": "glb", "samples": 2049},
        {"format": "obj"},
        {"samples": "257"},
        {"more": 1},
        {"paper": {}},
        {"format": "stl", "model": {"width_mm": 5.0}},
        {"format": "map_svg", "paper": {"size": "a9"}},
    ],
)
def test_requests_that_cannot_be(live: LiveServer, wanted: dict[str, Any]) -> None:
    """SPEC X8, N44."""
    terrain, secret = live.create()
    status, told = begin(live, terrain, secret, **wanted)
    assert (status, told["code"]) == (400, "malformed")
    assert live.http("POST", f"/api/terrains/{terrain}/exports/estimate", WANTED | wanted, secret)[0] == 400
    assert folders(live) == []


def test_how_many_at_once(live: LiveServer, maker: Maker, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC X21."""
    assert live.assembly.exports is not None
    monkeypatch.setattr(live.assembly.exports, "_places", Places(Share(6)))
    terrain, secret = live.create(**titled("slow"))
    jobs = [begin(live, terrain, secret, client)[1]["id"] for client in "abcd"]
    wait(live, terrain, secret, jobs[0], "detail")
    status, told = begin(live, terrain, secret, "a")
    assert (status, told["code"], told["message"][:14]) == (409, "busy", "Another export")
    assert begin(live, terrain, secret, "e")[0] == 503, "four of a terrain"
    told = live.http("GET", f"/api/terrains/{terrain}/exports/{jobs[3]}", secret=secret)[1]
    assert (told["stage"], told["text"]) == ("waiting", exports.WAITING)
    for _ in range(2):
        other, its = live.create()
        assert begin(live, other, its)[0] == 202
    other, its = live.create()
    assert begin(live, other, its)[1]["message"].startswith("Many exports")
    maker.gate.set()
    for job in jobs:
        wait(live, terrain, secret, job, "done")
    assert maker.most == 1
    assert begin(live, other, its)[0] == 202, "there is room again"


def test_too_many_from_one_address(live: LiveServer) -> None:
    """SPEC X21."""
    terrain, secret = live.create()
    answers = [begin(live, terrain, secret, samples=1000)[0] for _ in range(25)]
    assert (answers[0], answers[-1]) == (400, 429)


@pytest.mark.parametrize("waiting", [False, True])
def test_cancel_leaves_nothing(live: LiveServer, maker: Maker, waiting: bool) -> None:
    """SPEC X22."""
    terrain, secret = live.create(**titled("slow"))
    first = begin(live, terrain, secret, "a")[1]["id"]
    wait(live, terrain, secret, first, "detail")
    job = begin(live, terrain, secret, "b")[1]["id"] if waiting else first
    path = f"/api/terrains/{terrain}/exports/{job}"
    assert live.http("DELETE", path, secret=secret)[0] == 204
    assert live.http("GET", path, secret=secret)[0] == 404
    assert maker.stopped == (not waiting)
    assert folders(live) == ([first] if waiting else [])
    maker.gate.set()
    wait(live, terrain, secret, begin(live, terrain, secret, "c")[1]["id"], "done")


@pytest.mark.parametrize(("title", "says"), [("fail", "The ground is lava."), ("crash", run.FAILED)])
def test_what_fails_says_so_and_leaves_nothing(live: LiveServer, title: str, says: str) -> None:
    """SPEC X23."""
    terrain, secret = live.create(**titled(title))
    job = begin(live, terrain, secret)[1]["id"]
    assert wait(live, terrain, secret, job, "failed")["text"] == says
    assert live.http("GET", f"/api/terrains/{terrain}/exports/{job}/file", secret=secret)[0] == 409
    assert folders(live) == []


def test_files_are_kept_for_a_while_and_within_bounds(live: LiveServer) -> None:
    """SPEC X22."""
    service = live.assembly.exports
    assert service is not None
    service._kept_bytes = 2500
    terrain, secret = live.create()
    jobs = []
    for _ in range(3):
        jobs.append(begin(live, terrain, secret)[1]["id"])
        wait(live, terrain, secret, jobs[-1], "done")
    deadline = time.monotonic() + 10
    while folders(live) != sorted(jobs[1:]) and time.monotonic() < deadline:
        time.sleep(0.01)
    assert folders(live) == sorted(jobs[1:]), "the oldest went"
    service._now = lambda: time.monotonic() + exports.KEPT_SECONDS + 1
    begin(live, terrain, secret)
    assert live.http("GET", f"/api/terrains/{terrain}/exports/{jobs[2]}", secret=secret)[1]["code"] == "no_export"


def test_what_is_being_given_to_other_servers_is_not_forgotten(
    live: LiveServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    """SPEC X390: it took so long that everything else that was made by then is."""
    service = live.assembly.exports
    assert service is not None
    given, may_end = threading.Event(), threading.Event()

    async def keep(terrain: str, path: Path, *_: Any) -> bool:
        given.set()
        await asyncio.to_thread(may_end.wait, 60)
        assert path.exists()
        return False

    terrain, secret = live.create()
    first = begin(live, terrain, secret)[1]["id"]
    wait(live, terrain, secret, first, "done")
    monkeypatch.setattr(service._kept, "keep", keep)
    second = begin(live, terrain, secret)[1]["id"]
    assert given.wait(60)
    service._now = lambda: time.monotonic() + exports.KEPT_SECONDS + 1
    assert live.http("GET", f"/api/terrains/{terrain}/exports/{second}", secret=secret)[1]["stage"] == "done"
    assert service.has(terrain)
    assert folders(live) == [second], "only what has ended goes"
    may_end.set()
    while service._jobs[second].ended is None:
        time.sleep(0.01)
    status, _ = live.http("GET", f"/api/terrains/{terrain}/exports/{second}/file", secret=secret)
    assert status == 200


def test_the_estimate_follows_the_pace_of_this_server(live: LiveServer, maker: Maker) -> None:
    """SPEC X30."""
    service = live.assembly.exports
    assert service is not None
    terrain, secret = live.create(**titled("slow"))
    path = f"/api/terrains/{terrain}/exports/estimate"
    before = live.http("POST", path, WANTED, secret)[1]["seconds"]
    maker.gate.clear()
    job = begin(live, terrain, secret)[1]["id"]
    wait(live, terrain, secret, job, "detail")
    service._now = lambda: time.monotonic() + 9.0 * before
    maker.gate.set()
    wait(live, terrain, secret, job, "done")
    assert live.http("POST", path, WANTED, secret)[1]["seconds"] > 3 * before


def test_a_full_disk(live: LiveServer, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC X23."""
    monkeypatch.setattr("esker.exporting.formats.free_bytes", lambda _: 1 << 20)
    terrain, secret = live.create()
    assert begin(live, terrain, secret)[1]["code"] == "storage"
    assert folders(live) == []


def test_a_server_that_stops_keeps_nothing(tmp_path: Path, maker: Maker) -> None:
    """SPEC X22: neither what it stops nor what an earlier one left, which was killed."""
    left = tmp_path / "exports" / "old"
    left.mkdir(parents=True)
    with LiveServer(tmp_path) as live:
        assert folders(live) == []
        terrain, secret = live.create(**titled("slow"))
        wait(live, terrain, secret, begin(live, terrain, secret)[1]["id"], "detail")
    assert maker.stopped == 1
    assert not (tmp_path / "exports").exists()


# --- the process itself ---------------------------------------------------------------------------------------------


def ridge() -> Terrain:
    made = Terrain(size_m=512)
    made.add(Stroke.profile([(60, 250, 0), (440, 250, 90)], left=(35, 250), right=(45, 250)))
    return made


def task_of(terrain: Terrain, folder: Path, **more: Any) -> wire.Task:
    wanted = c.ExportRequest(format="npy", samples=257)
    made: dict[str, Any] = {"wanted": wanted, "grids": str(folder / "grids"), "folder": str(folder), "name": "a"}
    return wire.Task(document=terrain.document, **(made | more))


def test_the_process_makes_the_file_of_the_python_interface(tmp_path: Path) -> None:
    """SPEC X23, X24: on the next device where one does not work, and in order."""
    terrain = ridge()
    told: list[tuple[str, float]] = []
    task = task_of(terrain, tmp_path, device="no such device")
    made = asyncio.run(run.make(task, lambda stage, share: told.append((stage, share))))
    heights = np.load(tmp_path / made.file)
    np.testing.assert_array_equal(heights, terrain.heights(2, detail=True))
    assert (made.file, made.bytes) == ("a.npy", (tmp_path / "a.npy").stat().st_size)
    assert (made.low_m, made.high_m, made.spacing_m) == (float(heights.min()), float(heights.max()), 2.0)
    shares = [share for _, share in told]
    assert shares == sorted(shares)
    assert [stage for k, (stage, _) in enumerate(told) if k == 0 or told[k - 1][0] != stage][-2:] == [
        "detail",
        "writing",
    ]


def test_the_process_makes_maps_and_solids(tmp_path: Path) -> None:
    """SPEC N44, N47: those of ``Terrain.export``; a map that does not fit its paper is a sentence."""
    terrain = ridge()
    model = c.ModelOptions(width_mm=90, exaggeration=2)
    wanted = c.ExportRequest(format="stl", samples=257, detail=False, model=model)
    made = asyncio.run(run.make(task_of(terrain, tmp_path, wanted=wanted), lambda *_: None))
    terrain.export(tmp_path / "b.stl", level=2, detail=False, model=model)
    assert made.file == "a.stl"
    assert (tmp_path / "a.stl").read_bytes() == (tmp_path / "b.stl").read_bytes()
    wanted = c.ExportRequest(format="map_pdf", samples=257, detail=False, paper=c.PaperOptions(scale=500))
    with pytest.raises(ExportFailed, match="larger than A4 paper"):
        asyncio.run(run.make(task_of(terrain, tmp_path, wanted=wanted), lambda *_: None))


def test_missing_ground_is_a_sentence(tmp_path: Path) -> None:
    """SPEC X23: ground without a layer that belongs to it would be another ground."""
    terrain = ridge()
    terrain.add_grid(np.zeros((9, 9), dtype=np.float32), spacing=10.0, name="Valley")
    with pytest.raises(Failure, match="“Valley” cannot be read"):
        work(task_of(terrain, tmp_path), Out())


def test_a_cancelled_process_is_gone(tmp_path: Path) -> None:
    """SPEC X22."""

    async def cancelled() -> None:
        begun = asyncio.Event()
        wanted = c.ExportRequest(format="npy", samples=4097)
        task = asyncio.create_task(run.make(task_of(ridge(), tmp_path, wanted=wanted), lambda *_: begun.set()))
        await begun.wait()
        mine = psutil.Process().children()
        assert any("esker.api.export_child" in process.cmdline() for process in mine)
        assert all(
            process.nice() >= export_child.NICENESS for process in mine if "esker.api.export_child" in process.cmdline()
        )
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task

    asyncio.run(cancelled())
    assert not any("esker.api.export_child" in process.cmdline() for process in psutil.Process().children())


def test_a_process_that_the_system_kills(tmp_path: Path) -> None:
    """SPEC X23: for want of memory; the server goes on."""

    async def killed() -> None:
        def kill(*_: object) -> None:
            for process in psutil.Process().children():
                if "esker.api.export_child" in process.cmdline():
                    process.kill()

        await run.make(task_of(ridge(), tmp_path), kill)

    with pytest.raises(ExportFailed, match="want of memory"):
        asyncio.run(killed())


def test_the_process_ends_with_the_server(tmp_path: Path) -> None:
    """SPEC X23."""
    wanted = c.ExportRequest(format="npy", samples=4097)
    text = task_of(ridge(), tmp_path, wanted=wanted).model_dump_json().encode() + b"\n"
    child = subprocess.Popen(
        [sys.executable, "-m", "esker.api.export_child"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
    )
    try:
        assert child.stdin is not None
        assert child.stdout is not None
        child.stdin.write(text)
        child.stdin.flush()
        assert b'"stage":"solving"' in child.stdout.readline()
        child.stdin.close()
        assert child.wait(60) == 9
    finally:
        child.kill()
        child.wait()
        if child.stdout is not None:
            child.stdout.close()
