"""The Python client and the ground that is streamed to it, with the real solver (SPEC P45 to P47)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from esker import Stroke, Terrain, connect, grid
from esker import contract as c
from esker.api.link import Refused
from esker.document.birth import new_document
from esker.events import Done, Settled
from esker.grid import TileKey
from esker.solve.channels import ChannelSolver
from esker.solve.solver import Solver
from tests.sync.harness import LiveServer

RIDGE = Stroke.profile(
    [(1200, 1800, 0), (1700, 2100, 260), (2300, 2000, 320), (2900, 2200, 0)],
    left=(38, 300),
    right=(42, 260),
    amplitude_m=20.0,
    roughness=0.8,
    id="ridge",
)


@pytest.fixture(scope="module")
def solver() -> Solver:
    return Solver(max_level=4)


def test_refined_ground_arrives_as_the_solver_makes_it(tmp_path: Path, solver: Solver) -> None:
    with LiveServer(tmp_path, solver, level=1, refine=3) as server:
        terrain, secret = server.create()
        link = f"{server.base}/t/{terrain}#{secret}"
        with connect(link, ground=True) as t, connect(link, "Eve", ground=True) as eve:
            t.add(RIDGE)
            t.wait()
            t.ground.wait()
            assert {k.level for k in t.ground.tiles()} == {0, 1}, "nobody looks"
            for guest in (t, eve):
                guest.ground.look((2100.0, 1750.0, 330.0), (2150.0, 2050.0, 250.0), width=800, height=600, tau_px=1.0)
            assert t.ground.wait() == 1
            fine = {k for k in t.ground.tiles() if k.level == 3}
            assert fine
            eve.wait_clock(1)
            eve.ground.wait()
            assert {k for k in eve.ground.tiles() if k.level == 3} == fine
            check(t.ground, fine, solver)
            t.set("ridge", plateau_radius_m=12.0)
            t.wait()
            t.ground.wait()
            eve.ground.wait()
            fine = {k for k in t.ground.tiles() if k.level == 3}
            for key in fine:
                mine, theirs = t.ground.tile(*key), eve.ground.tile(*key)
                assert np.array_equal(mine, theirs)
            check(t.ground, fine, solver, plateau_radius_m=12.0)
            assert np.array_equal(t.ground.heights(1), eve.ground.heights(1))
            with pytest.raises(KeyError, match="not here"):
                t.ground.heights(3)


def test_paint_on_a_live_terrain(tmp_path: Path, solver: Solver) -> None:
    """SPEC P82: drawn by one, seen by the other, replaced, undone; the numbers are the solver's."""
    snow = Stroke.paint([(1000, 1000), (2000, 1400), (3000, 1000)], "snow", 0.75, radius_m=200, id="snow")
    with LiveServer(tmp_path, solver, level=2, refine=2) as server:
        terrain, secret = server.create()
        link = f"{server.base}/t/{terrain}#{secret}"
        with connect(link, ground=True) as t, connect(link, "Eve", ground=True) as eve:
            t.add(RIDGE)
            t.add(snow)
            t.wait()
            eve.wait_clock(2)
            for guest in (t, eve):
                assert guest.ground.wait() == 2
            seen = eve.ground.channel("snow", 0)
            assert np.array_equal(seen, t.ground.channel("snow", 0))
            expected = dict(ChannelSolver(None, 0).solve([snow], c.TerrainSettings()))[c.Channel.SNOW]
            assert np.abs(seen - expected).max() < 2 / c.BIAS_QUANTA
            assert not eve.ground.channel("wetness", 0).any()
            heights = eve.ground.heights(2)
            t.add(snow.model_copy(update={"paint": c.Paint(channel="wetness", value=-1.0, radius_m=90.0)}))
            t.add(RIDGE)
            t.set_terrain(detail=2.5, rule="smooth")
            t.wait()
            eve.wait_clock(5)
            assert eve.ground.wait() == 5
            assert not eve.ground.channel("snow", 0).any()
            assert eve.ground.channel("wetness", 0).min() < -0.9
            assert np.array_equal(eve.ground.heights(2), heights)
            assert eve.settings.rule == "smooth"
            for _ in range(2):  # adding what is there already was no step
                t.undo()
            t.wait()
            t.ground.wait()
            assert np.array_equal(t.ground.channel("snow", 0), seen)
            with pytest.raises(Refused, match="only a paint stroke"):
                t.set("ridge", paint=snow.paint)


def check(ground: object, keys: set[TileKey], solver: Solver, **fields: float) -> None:
    """Whole levels are the solver's to half a quantum, refined tiles its refiner's."""
    from esker.api.live.ground import StreamedGround

    assert isinstance(ground, StreamedGround)
    strokes = (RIDGE.model_copy(update={"finished": True, **fields}),)
    settings = new_document().settings
    *_, finest, last = solver.steps(strokes, settings, 1, basis=True)
    assert isinstance(finest, Settled)
    assert isinstance(last, Done)
    assert np.abs(ground.heights(1) - finest.heights).max() <= 0.51 * grid.quantum(1, settings.size_m)
    order = sorted(keys)
    parents = sorted({k.parent() for k in order})
    made = {t.key: t for t in solver.refiner(last.basis).tiles([*parents, *order]) if t is not None}
    for key in order:
        off = np.abs(ground.tile(*key) - made[key].heights).max()
        assert off <= 0.51 * grid.quantum(key.level, settings.size_m), key


def test_channels_are_read_as_values(tmp_path: Path, solver: Solver) -> None:
    with LiveServer(tmp_path, solver, level=2) as server:
        terrain, secret = server.create()
        with connect(f"{server.base}/t/{terrain}#{secret}", ground=True) as t:
            t.ground.wait()
            assert np.array_equal(t.ground.amplitude(0), np.full((65, 65), c.BASE_AMPLITUDE_M, dtype=np.float32))
            assert np.array_equal(t.ground.roughness(0), np.full((65, 65), c.BASE_ROUGHNESS, dtype=np.float32))
            t.add(RIDGE)
            t.wait()
            t.ground.wait()
            amplitude, roughness = t.ground.amplitude(0), t.ground.roughness(0)
            r, col = round(2050 / 64), round(2100 / 64)
            assert amplitude[r, col] == pytest.approx(20, abs=4)
            assert roughness[r, col] == pytest.approx(0.8, abs=0.06)
            assert amplitude[0, 0] == pytest.approx(0, abs=0.1)
            with pytest.raises(KeyError):
                t.ground.amplitude(1)


def test_without_asking_nothing_is_taken(tmp_path: Path, solver: Solver) -> None:
    with LiveServer(tmp_path, solver, level=0) as server:
        terrain, secret = server.create()
        link = f"{server.base}/t/{terrain}#{secret}"
        with connect(link) as t, pytest.raises(RuntimeError, match="ground=True"):
            t.ground.tiles()


def test_offline_and_streamed_heights_agree(tmp_path: Path, solver: Solver) -> None:
    with LiveServer(tmp_path, solver, level=2) as server:
        terrain, secret = server.create()
        with connect(f"{server.base}/t/{terrain}#{secret}", ground=True) as t:
            t.add(RIDGE)
            t.wait()
            t.ground.wait()
            offline = Terrain(solver=solver)
            offline.add(RIDGE)
            assert np.abs(t.ground.heights(2) - offline.heights(2)).max() <= 0.51 * grid.quantum(2, 4096.0)
