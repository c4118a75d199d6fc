"""The Python client against a real server (SPEC P40 to P44)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import esker
from esker import contract as c
from esker.api.live.client import Link, LiveTerrain, Refused, connect
from esker.solve.solver import Solver
from tests.sync.harness import LiveServer, stroke
from tests.unit import test_examples


def _link(server: LiveServer, terrain: str, secret: str) -> str:
    return f"{server.base}/t/{terrain}#{secret}"


@pytest.fixture
def link(server: LiveServer) -> str:
    return _link(server, *server.create())


RIDGE = c.Stroke(id="ridge", kind="profile", first=(500, 2000, 0), last=(3500, 2000, 0), curve=((0, 0), (1, 9)))


def test_a_change_here_is_a_change_there(link: str) -> None:
    with connect(link, "Ada") as ada, connect(link, "Bob") as bob:
        assert ada.role == "owner"
        ada.add(RIDGE)
        assert ada.strokes == (RIDGE,), "it shows before it is confirmed"
        bob.wait_clock(ada.wait())
        assert bob.strokes == (RIDGE,)
        bob.set("ridge", label="Höhe", left=None)
        bob.set_terrain(title="Together")
        ada.wait_clock(bob.wait())
        assert (ada.strokes[0].label, ada.settings.title) == ("Höhe", "Together")
        assert ada.document == bob.document
        ada.remove("ridge")
        ada.wait()
        with pytest.raises(Refused, match="deleted"):
            ada.set("ridge", label="x")


@pytest.mark.parametrize("name", sorted(test_examples.SERVED))
def test_examples_of_live_terrains_run(link: str, name: str) -> None:
    """SPEC H511."""
    assert test_examples.failures(name, {"link": link}) == ""


def test_undo_is_my_own(link: str) -> None:
    with connect(link) as ada, connect(link) as bob:
        ada.add(RIDGE)
        bob.wait_clock(ada.wait())
        ada.set("ridge", label="mine", roughness=0.25)
        bob.wait_clock(ada.wait())
        bob.set("ridge", label="yours")
        ada.wait_clock(bob.wait())
        plan = ada.undo()
        assert len(plan.ops) == 1
        assert "label" in plan.skipped[0]
        bob.wait_clock(ada.wait())
        assert (bob.strokes[0].label, bob.strokes[0].roughness) == ("yours", 0.5)
        assert ada.redo().skipped == ()
        bob.wait_clock(ada.wait())
        assert bob.strokes[0].roughness == 0.25


def test_a_long_stroke_is_one_step(link: str) -> None:
    curve = tuple((i / 4095, float(i % 7) + 0.123456789) for i in range(4096))
    long = RIDGE.model_copy(update={"id": "long", "curve": curve, "finished": True, "locked": True})
    with connect(link) as ada, connect(link) as bob:
        ada.add(long)
        bob.wait_clock(ada.wait())
        assert bob.strokes == (long,)
        ada.undo()
        bob.wait_clock(ada.wait())
        assert len(bob.strokes) == 0


def test_many_changes_are_paced_not_refused(link: str) -> None:
    with connect(link) as ada:
        ada.add(RIDGE)
        for i in range(300):
            ada.set("ridge", label=str(i))
        ada.wait(20)
        assert ada.document.strokes[0].label == "299"


def test_heights_are_those_of_the_offline_terrain(link: str) -> None:
    solver = Solver("numpy", max_level=1)
    with connect(link, solver=solver) as live:
        live.add(RIDGE)
        live.wait()
        offline = esker.Terrain(live.settings.size_m, solver=solver)
        offline.add(RIDGE)
        assert live.heights(1).shape == (129, 129)
        np.testing.assert_array_equal(live.heights(1), offline.heights(1))


def test_a_viewer_is_refused(server: LiveServer) -> None:
    terrain, owner = server.create()
    _, made = server.http("POST", f"/api/terrains/{terrain}/links", {"role": "view"}, owner)
    viewer = connect(_link(server, terrain, made["secret"]))
    assert viewer.role == "view"
    viewer.add(RIDGE)
    with pytest.raises(Refused, match="look"):
        viewer.wait()
    assert viewer.strokes == (), "it is rolled back"
    viewer.close()


def test_wrong_links(server: LiveServer) -> None:
    terrain, secret = server.create()
    for text in ("", "nonsense", f"{server.base}/t/{terrain}", f"ftp://h/t/{terrain}#{secret}", f"{server.base}/x#y"):
        with pytest.raises(ValueError, match="link"):
            Link(text)
    with pytest.raises(Refused) as caught:
        connect(f"{server.base}/t/{terrain}#wrong")
    assert caught.value.code == "bad_secret"
    with pytest.raises(TimeoutError):
        connect("http://127.0.0.1:9/t/a#b", timeout=0.3)


def test_what_is_no_stroke_and_what_comes_after_the_end(server: LiveServer) -> None:
    """SPEC P40: told at once, where it was written."""
    terrain, secret = server.create()
    live = connect(f"{server.base}/t/{terrain}#{secret}")
    for wrong in (None, "ridge", {"kind": "profile"}, [(0, 0, 0), (1, 1, 1)]):
        with pytest.raises(TypeError, match=r"Stroke\.profile"):
            live.add(wrong)  # type: ignore[arg-type]
    for flank in ("steep", (35,), 35):
        with pytest.raises(ValueError, match="slope in degrees"):
            esker.Stroke.profile([(0, 0, 0), (9, 9, 9)], left=flank)  # type: ignore[arg-type]
    kept = live.add(esker.Stroke.profile([(0, 0, 0), (9, 9, 9)]))
    live.wait()
    live.close()
    for change in (
        lambda: live.add(esker.Stroke.profile([(0, 0, 0), (9, 9, 9)])),
        lambda: live.remove(kept),
        live.undo,
    ):
        with pytest.raises(RuntimeError, match="closed"):
            change()


def test_it_comes_back_after_a_restart_with_what_it_did_meanwhile(tmp_path: Path) -> None:
    with LiveServer(tmp_path) as server:
        terrain, secret = server.create()
        port = server.port
        live = connect(_link(server, terrain, secret))
        live.add(RIDGE)
        live.wait()
    live.set("ridge", label="offline")
    assert live.strokes[0].label == "offline"
    with LiveServer(tmp_path, port=port) as server:
        live.wait(20)
        peer = server.join(terrain, secret, "other")
        assert peer.welcome["document"]["strokes"][0]["label"] == "offline"
        peer.ops(("other:1", stroke("s9")))
        peer.wait("ack")
        live.wait_clock(3)
        assert [s.id for s in live.strokes] == ["ridge", "s9"]
        peer.close()
        live.close()


def test_over_https_with_the_servers_own_authority(tmp_path: Path) -> None:
    with LiveServer(tmp_path, lan=True) as server:
        terrain, secret = server.create()
        assert server.base.startswith("https://")
        authority = tmp_path / "authority.pem"
        authority.write_bytes(server.raw("GET", "/esker-ca.pem")[1])
        with connect(_link(server, terrain, secret), ca_file=authority) as live:
            live.add(RIDGE)
            assert live.wait() == 1
        with pytest.raises(TimeoutError):
            LiveTerrain(_link(server, terrain, secret), timeout=1)
    with LiveServer(tmp_path, lan=True) as server:
        assert server.raw("GET", "/esker-ca.pem")[1] == authority.read_bytes(), "the authority is kept"


def test_a_program_leads_a_lesson_and_is_led(server: LiveServer) -> None:
    """SPEC L1, L4: what is refused is a sentence; a program that leads switches for all."""
    terrain, secret = server.create()
    made = server.http("POST", f"/api/terrains/{terrain}/links", {"role": "edit"}, secret)[1]
    with (
        connect(f"{server.base}/t/{terrain}#{secret}") as teacher,
        connect(f"{server.base}/t/{terrain}#{made['secret']}") as pupil,
    ):
        teacher.conduct(hands_off=True)
        pupil._await(lambda: pupil.lesson.hands_off, 60, "nobody was told")
        assert (teacher.lesson.draws, pupil.lesson.draws) == (True, False)
        pupil.set_terrain(title="mine")
        with pytest.raises(Refused, match="Hands off"):
            pupil.wait(60)
        pupil.conduct(hands_off=False)
        pupil._await(lambda: bool(pupil.notices), 60, "no notice came")
        assert "Only whoever leads" in pupil.notices[-1]
        teacher._await(lambda: len(teacher.members) == 2, 60, "nobody came")
        person = next(m.person for m in teacher.members if m.role == "edit")
        teacher.about("pen", person)
        pupil._await(lambda: pupil.lesson.draws, 60, "no pen came")
        pupil.set_terrain(title="ours")
        assert pupil.wait(60) == 1
        with pytest.raises(ValueError, match="hands"):
            teacher.conduct(hands=True)
