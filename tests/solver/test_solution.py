"""Settled heights against sparse direct solves and the properties of the equations (SPEC S3 to S9)."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse.linalg as spla
from numpy.typing import NDArray

from bench.solver import _exact
from esker import grid
from esker.contract import TerrainSettings
from esker.solve import multigrid, reference
from esker.solve.assembly import assemble, system
from esker.solve.constraints import raster_reference
from esker.solve.constraints.constraints import pack
from esker.solve.opencl.device import Device
from esker.solve.opencl.levels import ClWorkspace
from esker.solve.solver import Solver
from tests.solver.scenes import ENDLESS, PINNED, SCENES, SETTINGS, SIZE, flank, ridge

Field = NDArray[np.float64]

DIRECT = [
    *((name, SETTINGS, 2) for name in SCENES),
    ("one", ENDLESS, 2), ("fifty", ENDLESS, 2), ("tiny", ENDLESS, 2), ("loops", ENDLESS, 1),
    ("five", PINNED, 2), ("cross", TerrainSettings(border="pinned", reach_m=None), 2),
    ("cross", SETTINGS, 3), ("five", SETTINGS, 0), ("cross", SETTINGS, 1),
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
    fixed = raster_reference.rasterise(pack(SCENES[scene], PINNED, 1)).height_d.ravel() < 0
    rows = a[np.flatnonzero(fixed)]
    assert rows.nnz == fixed.sum()
    assert (rows.data == 1).all()


@pytest.mark.parametrize("scene", ["cross", "tiny", "loops"])
@pytest.mark.parametrize("settings", [SETTINGS, ENDLESS], ids=["reach", "endless"])
def test_convergence_factor_of_the_twin(scene: str, settings: TerrainSettings) -> None:
    """SPEC S3 on the float64 twin, whose cycle is the same; ``test_gallery`` measures the kernels."""
    level = 2
    c = raster_reference.rasterise(pack(SCENES[scene], settings, level))
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


def field(n: int) -> Field:
    """A smooth ground (1, n, n), metres, with slopes and curvature everywhere, borders and corners included."""
    y, x = np.mgrid[0:n, 0:n] / (n - 1)
    bump = 80 * np.exp(-40 * ((x - 0.4) ** 2 + (y - 0.6) ** 2))
    return np.asarray(300 * np.sin(3 * x + 1) * np.cos(2 * y - 0.5) + 200 * x * y - 100 * x**3 + bump)[None]


def pin(w: ClWorkspace, d: Field, f: Field) -> None:
    """The height step's own constraints at the finest level and coarser: no screening, no base."""
    w.height.put("d", w.top, d)
    w.height.put(w.height.static, w.top, f)
    w.height.coarsen(0.0)


@pytest.mark.parametrize("level", [1, 2, 3])
def test_manufactured_solution(device: Device, level: int) -> None:
    """SPEC S85: exact differences as guidance and one pinned sample give a known field back, in float32."""
    w, n = ClWorkspace(device, level), grid.samples(level)
    h = field(n)
    d, f = np.zeros_like(h), -reference.laplacian(h)
    d[0, n // 3, n // 2], f[0, n // 3, n // 2] = -1, h[0, n // 3, n // 2]
    pin(w, d, f)
    for k in range(level + 1):
        w.height.put("f", k, w.height.get(w.height.static, k))
    errors = list(_exact.errors_per_cycle(w.height, h[0], 10))
    assert errors[-1] < 2e-6 * np.ptp(h)
    a, b = system(d[0], f[0], 0.0)
    assert np.abs(a @ h.ravel() - b).max() < 1e-9 * np.ptp(h)


def test_manufactured_gradient(device: Device) -> None:
    """SPEC S85 through the guidance kernel: the gradient of a quadratic ground gives its differences exactly."""
    level, size = 3, 4096.0
    w, n = ClWorkspace(device, level), grid.samples(level)
    y, x = np.mgrid[0:n, 0:n] * grid.spacing(level, size)
    h = (0.2 * x - 0.1 * y + 3e-5 * x * x - 5e-5 * x * y + 2e-5 * y * y)[None]
    slope = np.stack([0.2 + 6e-5 * x - 5e-5 * y, -0.1 - 5e-5 * x + 4e-5 * y])
    d, static = np.zeros_like(h), np.zeros_like(h)
    d[0, 100, 200], static[0, 100, 200] = -1, h[0, 100, 200]
    pin(w, d, static)
    w.size_m = size
    for k in range(level + 1):
        step = 1 << (level - k)
        w.gradient.put("u", k, slope[:, ::step, ::step])
        w.guide(k)
    errors = list(_exact.errors_per_cycle(w.height, h[0], 12))
    assert errors[-1] < 2e-6 * np.ptp(h)


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


@pytest.mark.parametrize("reach", [1000.0, 4096.0, None])
@pytest.mark.parametrize("device", [None, "numpy"])
def test_a_pinned_border_holds_at_any_reach(device: str | None, reach: float | None) -> None:
    """SPEC S4: a ridge along the border, whose cycle diverged as long as springs of the border saturated."""
    settings = SETTINGS.model_copy(update={"border": "pinned", "reach_m": reach})
    strokes = [ridge((1500, 350), (2700, 300), 300, flank(), "a")]
    level = 2
    a, b = assemble(strokes, settings, level)
    exact = spla.spsolve(a.tocsc(), b).reshape(grid.samples(level), -1)
    heights = Solver(device).solve(strokes, settings, level)[level]
    assert np.abs(heights - exact).max() < 1e-3 * np.ptp(exact)
    edge = np.ones(heights.shape, dtype=bool)
    edge[1:-1, 1:-1] = False
    assert not heights[edge].any()
