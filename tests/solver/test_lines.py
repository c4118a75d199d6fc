"""Crests along lines of samples that coarse levels share (SPEC S181): once the cycle diverged there, or settled
silently on wrong ground. And ground that hardly anything holds (S183)."""

from __future__ import annotations

import numpy as np
import pytest

from bench.solver import _direct
from bench.solver._direct import Scene
from esker import grid
from esker.api.terrain import Stroke as Make
from esker.api.terrain import Terrain
from esker.contract import MIN_REACH_M, Border, Flank, Stroke, TerrainSettings
from esker.events import Level
from esker.solve.solver import Solver
from tests.solver.scenes import SIZE, flank, ridge
from tests.solver.twins import small_tiles

Points = list[tuple[float, float, float]]

LONG: Points = [(500, 2048, 0), (2000, 2048, 300), (3500, 2048, 0)]
SHORT: Points = [(1448, 2048, 0), (2048, 2048, 300), (2648, 2048, 0)]
LEVEL: Points = [(500, 2048, 100), (3500, 2048, 100)]
BORDER: Points = [(0, 0, 256), (4096, 0, 256)]
COLUMN: Points = [(1024, 300, 100), (1024, 4000, 200)]
BESIDE: Points = [(500, 3072 + 31, 80), (3300, 3072 + 31, 240)]
REPRODUCED = {
    "long": (LONG, None), "short": (SHORT, None), "short, 1800 m": (SHORT, 1800.0), "level": (LEVEL, None),
    "on the border": (BORDER, None), "column": (COLUMN, None), "half a cell beside": (BESIDE, None),
}  # fmt: skip


@pytest.fixture(scope="module")
def solvers(solver: Solver) -> dict[str, Solver]:
    """Row kernels, tile kernels, NumPy."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ESKER_KERNELS", "tiles")
        tiles = small_tiles(Solver())
    return {"rows": solver, "tiles": tiles, "numpy": Solver("numpy")}


def bare(points: Points, name: str = "bare") -> Stroke:
    """A crest without flanks."""
    return Make.profile(points, left=None, right=None, id=name)


def off(scene: Scene, solvers: dict[str, Solver]) -> float:
    """How far the worst ground is off, in tolerances."""
    return max(_direct.measure(scene, solvers).values())


@pytest.mark.parametrize("border", ["free", "pinned"])
@pytest.mark.parametrize("name", REPRODUCED)
def test_a_crest_on_a_shared_line(solvers: dict[str, Solver], name: str, border: Border) -> None:
    """SPEC S181, S4: `DivergedError`, 125.6 m and 13.8 m off at level 2, -194,454 m at level 0."""
    points, reach = REPRODUCED[name]
    settings = TerrainSettings(reach_m=reach, border=border)
    for level in (0, 1, 2):
        assert off(Scene((bare(points),), settings, level), solvers) < 1, f"level {level}"


def test_beside_an_ordinary_stroke(solvers: dict[str, Solver]) -> None:
    """74.7 m off at level 2."""
    ordinary = ridge((700, 900), (2600, 1200), 250, flank(), "ordinary")
    assert off(Scene((bare(SHORT), ordinary), TerrainSettings(reach_m=None), 2), solvers) < 1


def test_posts_along_a_line(solvers: dict[str, Solver]) -> None:
    """Short crests with gaps are a line, too, to a level on which they touch."""
    posts = tuple(bare([(512 * k, 1024, 200), (512 * k + 40, 1024, 200)], f"p{k}") for k in range(9))
    for level in (0, 1):
        assert off(Scene(posts, TerrainSettings(reach_m=None), level), solvers) < 1


def test_the_finer_levels(solver: Solver) -> None:
    """All say the same mountain, but for the ends of the crest: there the ground of a thinner crest is steeper."""
    terrain = Terrain(SIZE, reach_m=None, solver=solver)
    terrain.add(bare(LONG))
    coarse, fine = terrain.heights(level=3), terrain.heights(level=5)
    assert np.quantile(np.abs(fine[::4, ::4] - coarse), 0.99) < 1.5
    assert fine.min() >= -grid.quantum(5, SIZE)
    assert fine.max() <= 300 + grid.quantum(5, SIZE)


@pytest.mark.parametrize("device", [None, "numpy"])
def test_previews_on_a_shared_line_stay_within_the_crest(device: str | None) -> None:
    """A room showed -612 m."""
    settings = TerrainSettings(reach_m=None)
    for result in Solver(device).steps([bare(LONG)], settings, 2):
        if isinstance(result, Level):
            assert -15 < result.heights.min() <= result.heights.max() < 315


@pytest.mark.parametrize("level", [0, 1, 2])
def test_a_crest_on_a_shared_line_is_assembled(level: int) -> None:
    """The gradient step of ``assemble`` is a cycle, too: a band beside a crest on a line, unlimited reach."""
    import scipy.sparse.linalg as spla

    terrain = Terrain(SIZE, reach_m=None)
    terrain.add(Make.profile(LONG, left=(35, 300), right=None, id="a"))
    a, b = terrain.assemble(level)
    scene = Scene(terrain.strokes, terrain.settings, level)
    exact = _direct.Direct().heights(_direct.twin_constraints(scene))
    assert np.abs(spla.spsolve(a.tocsc(), b).reshape(exact.shape) - exact).max() < 1e-4


def test_ground_that_only_slopes_hold_keeps_the_height_of_the_base(solvers: dict[str, Solver]) -> None:
    """SPEC S183: a crest outside the terrain whose fading foot alone reaches in, unlimited reach, free borders."""
    outside = Make.profile([(-300, 500, 200), (-300, 3500, 200)], left=None, right=(35, 290), id="a")
    grounds = {}
    for name, solver in solvers.items():
        heights = solver.solve([outside], TerrainSettings(reach_m=None), 2)[2]
        volumes = np.ones(len(heights))
        volumes[[0, -1]] = 0.5
        assert abs(float(volumes @ heights @ volumes)) / 256**2 < 0.01, name
        grounds[name] = heights
    assert np.abs(grounds["rows"] - grounds["numpy"]).max() < grid.quantum(2, SIZE)
    assert np.abs(grounds["tiles"] - grounds["numpy"]).max() < grid.quantum(2, SIZE)


def test_the_widest_band_holds_the_ground(solvers: dict[str, Solver]) -> None:
    """SPEC S183, found by the search: flat flanks of 233 km beside a terrain of 64 m, with weak springs."""
    sides = Flank(slope_deg=0.0, extent_m=233_021.0, shape="straight")
    far = Stroke(id="s", kind="level", first=(20, 320, 4), last=(80, 320, 4), curve=((0.5, 0),), left=sides)
    settings = TerrainSettings(size_m=64.0, reach_m=None)
    for level in (0, 1, 2):
        for name, solver in solvers.items():
            heights = solver.solve([far], settings, level)[level]
            assert np.abs(heights - 4).max() < grid.quantum(level, 64.0) / 2, name


def test_a_reach_of_less_than_a_cell(solvers: dict[str, Solver]) -> None:
    """SPEC S184, found by the search: the row kernels knew a fixed sample by stiffness and screening together, which
    is positive where screening is strong, and sent its residual to the coarse levels: ground was 0.1 m off beside it.
    """
    crest = Stroke(id="s", kind="profile", first=(0, 0, 256), last=(0, 0, 256), curve=((0, 0),))
    # The reach between the other two is looked at on the coarse levels alone: a third level costs ten times as much.
    for reach, levels in ((4.0, (0, 1, 2)), (1.0, (0, 1)), (MIN_REACH_M, (0, 1, 2))):
        for level in levels:
            assert off(Scene((crest,), TerrainSettings(reach_m=reach), level), solvers) < 0.01
