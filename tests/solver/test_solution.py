"""Settled heights against sparse direct solves and the properties of the equations (SPEC S3 to S9)."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse.linalg as spla

from esker import grid
from esker.contract import TerrainSettings
from esker.solve import multigrid, reference, reference_raster
from esker.solve.assembly import assemble
from esker.solve.constraints import pack
from esker.solve.device import Device
from esker.solve.levels import ClWorkspace
from esker.solve.solver import Solver
from tests.solver.scenes import ENDLESS, PINNED, SCENES, SETTINGS, SIZE, flank, ridge

DIRECT = [
    *((name, SETTINGS, 2) for name in SCENES),
    ("one", ENDLESS, 2), ("fifty", ENDLESS, 2), ("tiny", ENDLESS, 2), ("loops", ENDLESS, 1),
    ("five", PINNED, 2), ("cross", TerrainSettings(border="pinned", reach_m=None), 2),
    ("fifty", SETTINGS, 3), ("five", SETTINGS, 0), ("cross", SETTINGS, 1),
]  # fmt: skip


@pytest.mark.parametrize(("scene", "settings", "level"), DIRECT)
def test_direct_solve(solver: Solver, scene: str, settings: TerrainSettings, level: int) -> None:
    """SPEC S4."""
    heights = solver.solve(SCENES[scene], settings, level)[level]
    a, b = assemble(SCENES[scene], settings, level)
    exact = spla.spsolve(a.tocsc(), b).reshape(heights.shape)
    relief = max(np.ptp(exact), 1.0)
    error = np.abs(heights - exact).max() / relief
    assert error < 1e-3
    assert np.sqrt(np.mean((heights - exact) ** 2)) / relief < 1e-4


@pytest.mark.parametrize("scene", ["fifty", "loops"])
def test_assembled_system(scene: str) -> None:
    """SPEC S5."""
    a, _ = assemble(SCENES[scene], PINNED, 1)
    assert abs(a - a.T).max() < 1e-12
    assert spla.eigsh(a, k=1, sigma=0, return_eigenvectors=False)[0] > 0
    fixed = reference_raster.rasterise(pack(SCENES[scene], PINNED, 1)).height_d.ravel() < 0
    rows = a[np.flatnonzero(fixed)]
    assert rows.nnz == fixed.sum()
    assert (rows.data == 1).all()


@pytest.mark.parametrize("scene", ["fifty", "cross", "tiny", "loops"])
@pytest.mark.parametrize("settings", [SETTINGS, ENDLESS], ids=["reach", "endless"])
@pytest.mark.parametrize("level", [2, 3])
def test_convergence_factor(scene: str, settings: TerrainSettings, level: int) -> None:
    """SPEC S3, on the float64 twin, whose cycle is the same: float32 would soon measure its own rounding."""
    c = reference_raster.rasterise(pack(SCENES[scene], settings, level))
    screening = pack(SCENES[scene], settings, level).screening
    for d, f in ((c.height_d[None], c.height_f[None]), (c.gradient_d[None], c.gradient_f)):
        if not d.any():
            continue
        s = reference.NumpySystem(d, f, screening, level)
        for k in range(level):
            multigrid.start(s, k)
            multigrid.finish(s, k)
        multigrid.start(s, level)
        updates = []
        for _ in range(8):
            multigrid.cycle(s)
            updates.append(s.change("v", "u"))
        if updates[-1] > 1e-9:
            assert (updates[-1] / updates[1]) ** (1 / 6) < 0.4


@pytest.mark.parametrize("settings", [SETTINGS, ENDLESS], ids=["reach", "endless"])
def test_maximum_principle(solver: Solver, settings: TerrainSettings) -> None:
    """SPEC S6."""
    h = solver.solve(SCENES["bare"], settings, 3)[3]
    slack = grid.quantum(3, SIZE)
    assert h.max() <= 300 + slack
    assert h.min() >= -slack
    assert h.max() > 290


@pytest.mark.parametrize(
    ("move", "world"),
    [
        (lambda h: h[:, ::-1], lambda p: (SIZE - p[0], p[1])),
        (lambda h: h[::-1], lambda p: (p[0], SIZE - p[1])),
        (lambda h: h.T, lambda p: (p[1], p[0])),
    ],
    ids=["east-west", "north-south", "diagonal"],
)
def test_symmetry(solver: Solver, move, world) -> None:  # type: ignore[no-untyped-def]
    """SPEC S7. A mirror turns left into right, so both flanks are alike."""
    a, b = (700.0, 900.0), (3100.0, 2300.0)
    c, d = (2500.0, 700.0), (1500.0, 3300.0)
    plain = [ridge(a, b, 400, flank(30), "a"), ridge(c, d, -150, flank(45, shape="straight"), "b")]
    moved = [ridge(world(a), world(b), 400, flank(30), "a"), ridge(world(c), world(d), -150, plain[1].left, "b")]
    h, m = solver.solve(plain, SETTINGS, 2)[2], solver.solve(moved, SETTINGS, 2)[2]
    error = np.abs(move(m) - h)
    assert np.quantile(error, 0.99) < 0.02
    assert error.max() < 1.0, "beyond ties of the rasteriser"


def test_constant_shift(solver: Solver) -> None:
    """SPEC S8."""
    low = SCENES["bare"]
    high = [
        s.model_copy(update={"first": (*s.first[:2], s.first[2] + 500), "last": (*s.last[:2], s.last[2] + 500)})
        for s in low
    ]
    a, b = solver.solve(low, ENDLESS, 2)[2], solver.solve(high, ENDLESS, 2)[2]
    assert np.abs(b - a - 500).max() < grid.quantum(2, SIZE)


@pytest.mark.parametrize("settings", [SETTINGS, ENDLESS, PINNED], ids=["reach", "endless", "pinned"])
def test_nothing_leaves_the_base(solver: Solver, settings: TerrainSettings) -> None:
    """SPEC S9."""
    far = ridge((-9000, -9000), (-8000, -9500), 300, flank(), "far")
    hidden = SCENES["one"][0].model_copy(update={"hidden": True})
    blank = SCENES["one"][0].model_copy(update={"id": "blank", "curve": ()})
    for strokes in ([], [hidden], [blank], [far], [far, hidden, blank]):
        pyramid = solver.solve(strokes, settings, 2)
        assert pyramid.settled
        assert all(not h.any() for h in pyramid.levels)


def test_default_reach_keeps_edits_local(solver: Solver) -> None:
    """DESIGN 5.1: twenty reaches from a stroke the ground does not notice."""
    h = solver.solve([ridge((500, 500), (900, 700), 200, flank(), "corner")], SETTINGS, 3)[3]
    assert np.abs(h[400:, 400:]).max() < 1e-3


def test_float32_noise_floor(device: Device) -> None:
    """Cycling on changes less than a sixteenth of a quantum: the settled heights are at rest."""
    w = ClWorkspace(device, 3)
    w.load(SCENES["fifty"], SETTINGS)
    for s in (w.gradient, w.height):
        for k in range(3):
            multigrid.start(s, k)
            multigrid.finish(s, k)
        multigrid.start(s, 3)
        for _ in range(12):
            multigrid.cycle(s)
        if s is w.gradient:
            for k in range(4):
                w.guide(k)
    assert w.height.change("v", "u") < grid.quantum(3, SIZE) / 16
