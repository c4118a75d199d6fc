"""The benchmark's own parts: exact solutions, byte model, peers under limits (SPEC S83, S84)."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse.linalg as spla

from bench.solver import _exact, _kernels, _peers
from bench.solver import solve as bench
from esker import grid
from esker.solve import multigrid, reference
from esker.solve.assembly import system
from esker.solve.opencl.device import Device
from esker.solve.opencl.levels import ClWorkspace
from esker.templates import gallery


def problem(device: Device, level: int, name: str) -> tuple[ClWorkspace, _exact.Constraints, _exact.Exact]:
    w = ClWorkspace(device, level)
    document = gallery.load(name)
    c = _exact.load(w, document.strokes, document.settings)
    return w, c, _exact.exact(w, c)


@pytest.mark.parametrize("name", ["fifty", "border", "tiny"])
def test_refinement_gives_the_direct_solution(device: Device, name: str) -> None:
    """SPEC S83: what everything is measured against is right, to float64 rounding."""
    _, c, exact = problem(device, 2, name)
    a, b = system(c.height_d.astype(np.float64), exact.f, c.screening)
    direct = spla.spsolve(a.tocsc(), b).reshape(exact.heights.shape)
    assert np.abs(direct - exact.heights).max() < 1e-11 * exact.relief


def test_residual_in_strips(device: Device) -> None:
    """A strip's residual is the whole grid's, in the middle and at the borders."""
    rng = np.random.default_rng(4)
    n = 2 * _exact.BLOCK + 9
    u, f = rng.normal(size=(2, 2, n, n))
    d = np.where(rng.random((n, n)) < 0.1, -1, rng.random((n, n))).astype(np.float32)
    strips, largest = _exact.residual(u, f, d, 0.01)
    whole = reference.residual(u, f, d[None].astype(np.float64), 0.01)
    assert np.array_equal(strips, whole.astype(np.float32))
    assert largest == np.abs(whole).max()


def test_refinement_that_stalls_says_so(device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    w, c, exact = problem(device, 1, "five")
    monkeypatch.setattr(multigrid, "cycle", lambda _: None)
    with pytest.raises(RuntimeError, match="stalled"):
        _exact.solve(w.height, exact.f[None], c.height_d, c.screening, _exact.at_fixed(exact.f[None], c.height_d))


def test_factor_of_a_cycle_that_does_nothing(device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    """The measure of convergence can fail: sweeps alone hardly converge."""
    w, c, _ = problem(device, 2, "tiny")
    assert _exact.factor(w.height, c.height_d) < 0.4
    monkeypatch.setattr(multigrid, "cycle", multigrid.refresh)
    assert _exact.factor(w.height, c.height_d) > 0.8


def test_byte_model() -> None:
    """SPEC S84: a visit of one channel moves 4 1/2 floats a sample, of two channels 8; the bottom is one launch."""
    samples = grid.samples(4) ** 2
    one, two = _kernels.Recorder(4, 1), _kernels.Recorder(4, 2)
    for model in (one, two):
        model.visit(4, rhs="f", out="v", guess="u", correction="e", residual=True)
    assert one.moved == 18 * samples
    assert two.moved == 32 * samples
    assert two.flops == 2 * one.flops
    cycle = _kernels.Recorder(4, 1)
    multigrid.cycle(cycle)
    assert one.moved < cycle.moved < 2 * one.moved, "coarser levels add a third of a third"
    settled = _kernels.Recorder(4, 1)
    assert list(multigrid.converge(settled, 1e-6)) == [], "a record is at rest after its first cycle"
    assert settled.launches == cycle.launches + 1, "which a look at both fields follows"
    assert settled.moved == cycle.moved + 8 * samples


@pytest.fixture(scope="module")
def saved(device: Device, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The smallest problem that is worth a peer."""
    _, c, exact = problem(device, 1, "five")
    file = tmp_path_factory.mktemp("peers") / "problem.npz"
    targets = {"preview": 1e-3 * exact.relief, "rest": 1e-6 * exact.relief}
    _peers.save(file, c.height_d, exact.f, c.screening, exact.heights, targets)
    return file


@pytest.mark.parametrize("name", _peers.NAMES)
def test_peers_solve_the_same_system(saved: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC S84: every peer reaches the errors that it was asked for, on the system that we solve."""
    pytest.importorskip(_peers.NEEDS[name])
    monkeypatch.setattr(_peers, "MOST_RUNS", 1)
    figures = _peers.solve(name, saved)
    _, _, _, targets = _peers.free_system(saved)
    assert "failed" not in figures
    assert figures["set_up_ms"] > 0
    for target, bound in targets.items():
        assert 0 <= figures["solve"][target]["error_m"] <= bound


def test_a_peer_without_enough_memory_or_time_or_package(saved: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC S84: a peer that cannot says why, and the run goes on."""
    assert "memory" in _peers.run("superlu", saved, 0.3, 240)["failed"]
    assert _peers.run("superlu", saved, 8, 0.05)["failed"] == "out of time"
    monkeypatch.setitem(_peers.NEEDS, "superlu", "no_such_package")
    assert "not installed" in _peers.run("superlu", saved, 8, 240)["failed"]


def test_a_peer_that_is_never_accurate_enough(saved: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("pyamg")
    monkeypatch.setattr(_peers, "MOST_ITERATIONS", 1)
    figures = _peers.solve("pyamg_smoothed_aggregation", saved)
    assert "not as accurate" in figures["failed"]


def test_times_against_ours() -> None:
    """Set-up and solve of the peer over coarsening and cycles of ours."""
    ours = {
        "coarsen_heights_ms": {"least": 1.0},
        "heights_to_target": {"ms": {"least": 9.0}},
        "heights_to_rest": {"ms": {"least": 19.0}},
    }
    peer = {"set_up_ms": 1500.0, "solve": {"preview": {"ms": 500.0}, "rest": {"ms": 900.0}}}
    assert bench.against(peer, ours) == {"preview": 200.0, "rest": 120.0}
    assert bench.against({"failed": "out of memory"}, ours) == {}


def test_the_whole_command(tmp_path: Path) -> None:
    """The smallest run of every part: progress on standard error; the file keeps parts that are not run again."""
    out = tmp_path / "solve.json"
    out.write_text(json.dumps({"runs": {"fanout": {}}, "fanout": "kept"}))
    small = ("--finest", "1", "--scene", "tiny", "--peer", "superlu")
    command = [sys.executable, "-m", "esker", "bench", "solve", *small, "-o", str(out)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=240, check=True)
    result = json.loads(out.read_text())
    assert result["fanout"] == "kept"
    assert result["accuracy"]["tiny"]["129"]["height_factor"] < 0.4
    for count in ("1", "2"):
        assert result["threads"][count]["scenes"]["fifty"]["129"]["two_step"]["error_of_relief"] < 1e-2
    peers = result["peers"]["levels"]["129"]
    assert set(peers) == {"unknowns", "superlu"}
    assert peers["superlu"]["times_ours"]["2"]["preview"] > 1, "it is not faster"
    assert set(result["runs"]) == {"fanout", "accuracy", "threads", "peers"}
    assert done.stdout == ""
    for said in ("accuracy 129² tiny", "2 thread(s), 129² fifty", "peers 129²: superlu"):
        assert said in done.stderr
