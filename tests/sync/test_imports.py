"""Elevation files over HTTP: who may, questions, cancel, bounds, what everybody sees (SPEC P100 to P110)."""

from __future__ import annotations

import asyncio
import io
import time
from collections.abc import AsyncIterator, Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import esker
from esker import contract as c
from esker import grid
from esker.api.live.client import LiveTerrain, Refused
from esker.errors import Cannot
from esker.fairness.shares import Who
from esker.patchwork.base import Base
from esker.patchwork.lod import space
from esker.patchwork.lod.space import Placed
from esker.patchwork.raster import rasters
from esker.store.kept import count_kept
from tests.sync.harness import LiveServer
from tests.sync.scripted_reader import GRID, Reader, layers, no_works, nothing_left, send, wait


@pytest.fixture
def live(tmp_path: Path, reader: Reader) -> Iterator[LiveServer]:
    with LiveServer(tmp_path, grid_quota_mb=1) as server:
        yield server
        reader.gate.set()


def test_a_file_becomes_a_layer_that_everybody_sees(live: LiveServer) -> None:
    """SPEC P100, P106."""
    terrain, secret = live.create()
    ada, bob = live.join(terrain, secret, "ada", name="Ada"), live.join(terrain, secret, "bob")
    status, job = send(live, terrain, secret, "x", "name=../up/valley%0A.tif&client=ada")
    assert status == 202
    done = wait(live, terrain, secret, job["id"], "done")
    layer = layers(live, terrain)[0]
    assert (done["layer"], done["share"]) == (layer.id, 1.0)
    assert (layer.author, layer.priority, layer.facts.file) == ("Ada", 0, "valley.tif")
    for peer in (ada, bob):
        stages: list[str] = []
        while not stages or stages[-1] != "done":
            message = peer.wait("importing")
            assert (message["author"], message["file"]) == ("Ada", "valley.tif")
            assert message["status"]["report"] is None
            stages.append(message["status"]["stage"])
        assert stages[0] == "upload"
        ordered = [m for m in peer.seen if m["type"] == "ordered"] or [peer.wait("ordered")]
        assert ordered[0]["ops"][0]["author"] == "ada"
        peer.close()
    assert no_works(live)


def test_no_client_adds_a_layer_by_itself(live: LiveServer) -> None:
    """SPEC P101."""
    terrain, secret = live.create()
    peer = live.join(terrain, secret)
    layer = c.Layer(
        id="x", content="0" * 64, facts=c.GridFacts(rows=9, cols=9, low_m=0, high_m=1), anchor=(0, 0), spacing_m=(1, 1),
        accuracy_m=1,
    ).model_dump(mode="json")  # fmt: skip
    add = {"type": "layer.add", "layer": layer}
    peer.ops(("c1:1", add), ("c1:2", {"type": "group", "ops": [add]}))
    assert [peer.wait("reject")["code"] for _ in range(2)] == ["server_only", "server_only"]
    peer.close()


@pytest.mark.parametrize(("role", "code"), [("view", 403), ("edit", 202)])
def test_who_may_bring_files_in(live: LiveServer, role: str, code: int) -> None:
    """SPEC P102."""
    terrain, owner = live.create()
    _, link = live.http("POST", f"/api/terrains/{terrain}/links", {"role": role}, owner)
    status, answer = send(live, terrain, link["secret"], "ask")
    assert status == code
    if role == "view":
        assert answer["code"] == "view_only"
        _, job = send(live, terrain, owner, "ask")
        status, _ = live.http("DELETE", f"/api/terrains/{terrain}/imports/{job['id']}", secret=link["secret"])
        assert status == 403
    assert send(live, terrain, "wrong", "x")[0] == 403
    other, secret = live.create()
    assert live.http("GET", f"/api/terrains/{other}/imports/{answer.get('id')}", secret=secret)[0] == 404


def test_questions_and_answers(live: LiveServer) -> None:
    """SPEC P103."""
    terrain, owner = live.create()
    _, job = send(live, terrain, owner, "ask")
    path = f"/api/terrains/{terrain}/imports/{job['id']}"
    asked = wait(live, terrain, owner, job["id"], "question")
    assert asked["report"]["questions"][0]["id"] == "size"
    _, link = live.http("POST", f"/api/terrains/{terrain}/links", {"role": "edit"}, owner)
    assert live.http("POST", f"{path}/answers", {}, link["secret"])[0] == 403, "another's import"
    assert live.http("POST", f"{path}/answers", {"answers": {"colour": "red"}}, owner)[0] == 400
    assert live.http("POST", f"{path}/answers", {"spacing_m": [0, 1]}, owner)[0] == 400
    answers = {"answers": {"size": "500"}, "anchor": [1, 2], "spacing_m": [3, 4], "name": "Tal"}
    assert live.http("POST", f"{path}/answers", answers, owner)[0] == 200
    wait(live, terrain, owner, job["id"], "done")
    layer = layers(live, terrain)[0]
    assert (layer.anchor, layer.spacing_m, layer.name) == ((1.0, 2.0), (3.0, 4.0), "Tal")
    assert live.http("POST", f"{path}/answers", answers, owner)[1]["code"] == "not_asked"


def test_wrong_answers_are_asked_for_again(live: LiveServer) -> None:
    """SPEC P103."""
    terrain, secret = live.create()
    _, job = send(live, terrain, secret, "ask")
    path = f"/api/terrains/{terrain}/imports/{job['id']}/answers"
    wait(live, terrain, secret, job["id"], "question")

    def answer(asks: str, **answers: str) -> dict[str, Any]:
        assert live.http("POST", path, {"answers": answers}, secret)[0] == 200
        status = wait(live, terrain, secret, job["id"], "question", "done", "refused")
        assert [q["id"] for q in status["report"]["questions"]] == ([asks] if asks else [])
        return status

    assert answer("size", size="no")["text"] == "That is no size."
    assert answer("shape", size="twice")["text"] == "", "an answer may raise another question"
    assert answer("", shape="3 x 4")["stage"] == "done"
    _, job = send(live, terrain, secret, "ask")
    path = f"/api/terrains/{terrain}/imports/{job['id']}/answers"
    wait(live, terrain, secret, job["id"], "question")
    live.http("POST", path, {"answers": {"size": "stop"}}, secret)
    assert wait(live, terrain, secret, job["id"], "done", "refused")["stage"] == "done", "the reader knows what to stop"


@pytest.mark.parametrize(
    ("words", "says"),
    [("refuse", "cat"), ("crash", "failed"), ("ask", "no size")],
)
def test_what_is_refused_leaves_nothing(live: LiveServer, words: str, says: str) -> None:
    """SPEC P104."""
    terrain, secret = live.create()
    _, job = send(live, terrain, secret, words)
    if words == "ask":
        wait(live, terrain, secret, job["id"], "question")
        body = {"answers": {"size": "late"}}
        live.http("POST", f"/api/terrains/{terrain}/imports/{job['id']}/answers", body, secret)
    assert says in wait(live, terrain, secret, job["id"], "refused")["text"]
    assert layers(live, terrain) == ()
    assert nothing_left(live.assembly.settings.data / "grids")


def test_progress_moves_while_a_file_is_examined(live: LiveServer, reader: Reader) -> None:
    """SPEC P106: examining the largest files takes a while too."""
    terrain, secret = live.create()
    _, job = send(live, terrain, secret, "long")
    deadline = time.monotonic() + 60
    shares = [job["share"]]
    while shares[-1] < 0.25 and time.monotonic() < deadline:
        shares.append(live.http("GET", f"/api/terrains/{terrain}/imports/{job['id']}", secret=secret)[1]["share"])
        time.sleep(0.01)
    assert shares[-1] == pytest.approx(0.25)
    assert shares == sorted(shares)
    reader.gate.set()
    assert wait(live, terrain, secret, job["id"], "done")["share"] == 1.0


@pytest.mark.parametrize("words", ["slow", "ask"])
def test_cancel_leaves_nothing(live: LiveServer, reader: Reader, words: str) -> None:
    """SPEC P104."""
    terrain, secret = live.create()
    _, job = send(live, terrain, secret, words)
    wait(live, terrain, secret, job["id"], "errors" if words == "slow" else "question")
    path = f"/api/terrains/{terrain}/imports/{job['id']}"
    assert live.http("DELETE", path, secret=secret)[0] == 204
    assert wait(live, terrain, secret, job["id"], "cancelled")["layer"] is None
    assert live.http("DELETE", path, secret=secret)[0] == 204, "again is harmless"
    assert reader.stopped == (words == "slow")
    assert layers(live, terrain) == ()
    assert no_works(live)
    assert send(live, terrain, secret, "x")[0] == 202, "there is room for the next one"


def test_one_at_a_time_of_a_person_and_two_of_the_server(live: LiveServer, reader: Reader) -> None:
    """SPEC P105."""
    terrain, secret = live.create()
    jobs = []
    for name in ("ada", "bob", "eve"):
        status, job = send(live, terrain, secret, f"slow {name}", f"name=a.tif&client={name}")
        assert status == 202
        jobs.append(job["id"])
    assert send(live, terrain, secret, "x", "name=b.tif&client=ada")[1]["code"] == "busy"
    wait(live, terrain, secret, jobs[1], "errors")
    reader.gate.set()
    for job in jobs:
        wait(live, terrain, secret, job, "done")
    assert reader.most == 2
    assert [layer.priority for layer in layers(live, terrain)] == [0, 1, 2], "what comes later is believed"


def test_bounds_of_size(live: LiveServer, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC P107."""
    terrain, secret = live.create()
    assert send(live, terrain, secret, "")[1]["code"] == "empty"
    monkeypatch.setattr(c, "MAX_GRID_BYTES", 1000)
    assert send(live, terrain, secret, "x" * 1001)[1]["code"] == "too_large"
    assert no_works(live)
    monkeypatch.undo()
    monkeypatch.setattr("esker.store.grids.GridStore.size", lambda *_: 1 << 20)
    assert send(live, terrain, secret, "x")[1]["code"] == "quota"


def test_a_question_that_nobody_answers(live: LiveServer, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC P108."""
    monkeypatch.setattr(live.assembly.imports, "_question_seconds", 0.05)
    terrain, secret = live.create()
    _, job = send(live, terrain, secret, "ask")
    assert "Nobody answered" in wait(live, terrain, secret, job["id"], "refused")["text"]
    assert no_works(live)


def test_a_terrain_made_from_a_file(live: LiveServer) -> None:
    """SPEC P109."""
    status, made = live.http("POST", "/api/terrains/from-grid?name=tal.tif", b"ask")
    assert (status, made["title"], made["role"]) == (201, "tal", "owner")
    path = f"/api/terrains/{made['id']}/imports/{made['import']['id']}"
    wait(live, made["id"], made["secret"], made["import"]["id"], "question")
    assert live.http("POST", f"{path}/answers", {}, made["secret"])[0] == 200
    wait(live, made["id"], made["secret"], made["import"]["id"], "done")
    document = asyncio.run(live.assembly.hub.document(made["id"]))
    assert (document.settings.size_m, len(document.layers)) == (1234.0, 1)
    status, error = live.http("POST", "/api/terrains/from-grid?name=cat.png", b"refuse")
    assert (status, error["code"], error["message"]) == (400, "refused", "It is a picture of a cat.")


def test_two_people_behind_one_address_start_at_once(live: LiveServer) -> None:
    """SPEC P348: one file of each person; whose it is can cancel it, and then bring in another."""
    start = "/api/terrains/from-grid?name=tal.tif&client="
    made = {}
    for person in ("ann", "bea"):
        status, made[person] = live.http("POST", start + person, b"ask")
        assert status == 201, made[person]
    status, error = live.http("POST", start + "ann", b"x")
    assert (status, error["code"]) == (409, "busy")
    mine = made["ann"]
    path = f"/api/terrains/{mine['id']}/imports/{mine['import']['id']}"
    assert live.http("DELETE", path, secret=made["bea"]["secret"])[0] == 403
    assert live.http("DELETE", path, secret=mine["secret"])[0] == 204
    assert live.http("POST", start + "ann", b"ask")[0] == 201


def test_a_file_that_nobody_waits_for_makes_no_terrain(live: LiveServer) -> None:
    """SPEC P348."""
    imports = live.assembly.imports
    assert imports is not None
    before = count_kept(live.assembly.hub.journal)

    async def body() -> AsyncIterator[bytes]:
        yield b"ask"

    async def gone() -> bool:
        return True

    with pytest.raises(Cannot) as caught:
        asyncio.run(imports.upload_new("t.tif", "9.9.9.9 x", body(), 3, "x", Who("9.9.9.9"), gone))
    assert caught.value.code == "cancelled"
    assert count_kept(live.assembly.hub.journal) == before


def test_a_grid_comes_back_and_travels_in_a_terrain_file(live: LiveServer) -> None:
    """SPEC P110, D33."""
    terrain, secret = live.create()
    _, job = send(live, terrain, secret, "x")
    wait(live, terrain, secret, job["id"], "done")
    layer = layers(live, terrain)[0]
    status, data = live.http("GET", f"/api/terrains/{terrain}/grids/{layer.content}", secret=secret)
    assert status == 200
    np.testing.assert_array_equal(np.load(io.BytesIO(data))["heights"], GRID + 1)
    other, key = live.create()
    assert live.http("GET", f"/api/terrains/{other}/grids/{layer.content}", secret=key)[0] == 404, "not its own"
    assert live.http("GET", f"/api/terrains/{terrain}/grids/{'x' * 64}", secret=secret)[0] == 400
    status, file = live.http("GET", f"/api/terrains/{terrain}/archive", secret=secret)
    status, made = live.http("POST", "/api/terrains/import", file)
    assert status == 201, made
    assert [found.content for found in layers(live, made["id"])] == [layer.content]
    status, file = live.http("GET", f"/api/terrains/{made['id']}/archive", secret=made["secret"])
    assert status == 200


def test_undo_of_an_import_is_its_authors(live: LiveServer) -> None:
    """SPEC D31: what the server did in my name is mine to take back, and nobody else's."""
    link = "{}/t/{}#{}".format(live.base, *live.create())
    with esker.connect(link, "Ada") as ada, esker.connect(link, "Bob") as bob:
        layer = ada.add_grid(
            GRID, anchor=(100, 200), rotation=30, spacing=(8, 9), accuracy=0.5, answers={"size": "fit"}
        )
        _until(bob, lambda: bob.layers)
        assert (bob.layers[0].id, bob.layers[0].anchor, bob.layers[0].spacing_m) == (layer, (100.0, 200.0), (8.0, 9.0))
        assert not bob.undo().ops, "Bob has done nothing"
        assert ada.undo().ops
        ada.wait()
        _until(bob, lambda: not bob.layers)
        assert ada.redo().ops
        ada.wait()
        _until(bob, lambda: bob.layers)
        bob.set_grid(layer, lift_m=3.0)
        bob.wait()
        _until(ada, lambda: ada.layers[0].lift_m == 3.0)
        assert "changed this layer" in ada.undo().skipped[0]
        bob.remove_grid(layer)
        bob.wait()
        _until(ada, lambda: not ada.layers)
        ada.restore_grid(layer)
        ada.wait()
        _until(bob, lambda: [found.lift_m for found in bob.layers] == [3.0])
        bob.remove_grid(layer)
        bob.wait()
        _until(ada, lambda: not ada.layers)
        with pytest.raises(Refused, match="cat"):
            bob.add_grid(_file(live, "refuse"))
        with pytest.raises(Refused, match="How wide"):
            bob.add_grid(_file(live, "ask"))
        with pytest.raises(ValueError, match="spacing"):
            bob.add_grid(GRID)


def _file(server: LiveServer, words: str) -> Path:
    path = server.assembly.settings.data / f"{words}.tif"
    path.write_text(words)
    return path


def _until(terrain: LiveTerrain, ready: Callable[[], object]) -> None:
    deadline = time.monotonic() + 60
    while not ready():
        assert time.monotonic() < deadline
        terrain.wait_clock(0)
        time.sleep(0.005)


def test_a_real_file_is_real_ground_for_everybody(tmp_path: Path) -> None:
    """SPEC P100: through the process that reads files, the store, the base and the tiles to another program."""
    rows, cols = np.mgrid[0:60, 0:70]
    heights = (400 + 90 * np.sin(rows / 9) * np.cos(cols / 7)).astype(np.float32)
    with LiveServer(tmp_path, level=2) as server:
        link = "{}/t/{}#{}".format(server.base, *server.create())
        with esker.connect(link, "Ada") as ada, esker.connect(link, "Bob", ground=True) as bob:
            layer = ada.add_grid(heights, anchor=(500, 700), rotation=27, spacing=(40, 45), accuracy=0.1, name="waves")
            _until(bob, lambda: bob.layers)
            assert (bob.layers[0].id, bob.layers[0].name, bob.layers[0].rotation_deg) == (layer, "waves", 27.0)
            assert (bob.layers[0].source, bob.layers[0].author) == ("", "Ada")
            made = rasters.build(heights)
            assert bob.layers[0].content == made.digest
            np.testing.assert_array_equal(bob.grids[made.digest].heights, heights)
            bob.ground.wait(120)
            model = space.build([Placed(bob.layers[0], made)])
            base = Base(model, bob.settings.size_m, edition=bob.settings.edition)
            for level in (0, 1, 2):
                quantum = grid.quantum(level, bob.settings.size_m)
                np.testing.assert_allclose(bob.ground.heights(level), base.level(level), rtol=0, atol=quantum)
            ada.undo()
            ada.wait()
            _until(bob, lambda: not bob.layers)
            bob.ground.wait(120)
            assert not bob.ground.heights(2).any()


def test_a_server_that_stops_leaves_no_half_import(tmp_path: Path, reader: Reader) -> None:
    """SPEC P104: whoever waits is told, and the reader is stopped."""
    with LiveServer(tmp_path) as server:
        terrain, secret = server.create()
        peer = server.join(terrain, secret)
        _, job = send(server, terrain, secret, "slow")
        wait(server, terrain, secret, job["id"], "errors")
    stages = [m["status"]["stage"] for m in peer.seen if m["type"] == "importing"]
    while not stages or stages[-1] != "cancelled":
        stages.append(peer.wait("importing")["status"]["stage"])
    assert reader.stopped == 1
    assert nothing_left(tmp_path / "grids")
