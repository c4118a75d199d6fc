"""The cross-section that artists prescribe (SPEC S10 to S14)."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from esker import grid
from esker.api.terrain import Stroke as Make
from esker.contract import Stroke, TerrainSettings
from esker.solve.constraints.crest import crest_of, is_closed
from esker.solve.solver import Solver
from tests.solver.scenes import SCENES, SETTINGS, SIZE, flank, loop, ridge, wall

SMALL = TerrainSettings(size_m=1024.0, reach_m=32.0)
"""4 m cells at level 2."""


def profile(
    h: np.ndarray, size: float, start: tuple[float, float], towards: float, distances: list[float]
) -> np.ndarray:
    """Heights at distances from a point in a direction, bilinear."""
    s = size / (len(h) - 1)
    x = start[0] + np.cos(towards) * np.array(distances)
    y = start[1] + np.sin(towards) * np.array(distances)
    return np.asarray(map_coordinates(h.astype(float), [y / s, x / s], order=1))


@pytest.mark.parametrize("slope", [5, 10, 20, 35, 45, 60])
@pytest.mark.parametrize("angle", [0, 17, 30, 45, 63, 90])
@pytest.mark.parametrize("plateau", [0.0, 40.0])
def test_prescribed_slope(solver: Solver, slope: float, angle: float, plateau: float) -> None:
    """SPEC S10: a wall higher than its flank of 160 m can fall, so that the band ends at its extent; the other flank
    has its own slope and extent."""
    other = 90 - slope if slope != 45 else 20
    sides = {90: (slope, 160.0), -90: (min(other, 60), 120.0)}
    rise = max(math.tan(math.radians(a)) * extent for a, extent in sides.values())
    stroke = wall(angle, rise + 30, 600, None, 1024.0)
    left, right = (flank(*sides[k], shape="straight") for k in (90, -90))
    stroke = stroke.model_copy(update={"left": left, "right": right, "plateau_radius_m": plateau})
    h = solver.solve([stroke], SMALL, 2)[2]
    for side, (prescribed, extent) in sides.items():
        for share in (0.25, 0.5, 0.75):
            at = plateau + share * extent
            near, far = profile(h, 1024.0, (512, 512), math.radians(angle + side), [at - 8, at + 8])
            assert (near - far) / 16 == pytest.approx(math.tan(math.radians(prescribed)), rel=0.05)


@pytest.mark.parametrize("slope", [0, 5, 10, 35])
@pytest.mark.parametrize("above", [150, 400])
def test_a_band_cut_high_ends_in_no_cliff(solver: Solver, slope: float, above: float) -> None:
    """SPEC S42: 5 to 12 reaches above the base screening would tear the ground off; the flank keeps its slope."""
    rise = math.tan(math.radians(slope))
    h = solver.solve([wall(30, rise * 160 + above, 600, flank(slope, 160, "straight"), 1024.0)], SMALL, 2)[2]
    z = profile(h, 1024.0, (512, 512), math.radians(120), [float(d) for d in range(0, 481, 8)])
    assert (-np.diff(z) / 8).max() < max(0.8, 1.1 * rise)
    assert np.diff(z).max() < 0.1
    near, far = profile(h, 1024.0, (512, 512), math.radians(120), [112, 128])
    assert (near - far) / 16 == pytest.approx(rise, rel=0.05, abs=2e-3)


def test_endless_reach_has_no_skirt(solver: Solver) -> None:
    """SPEC S42: pure diffusion carries the ground beyond a band by itself."""
    endless = TerrainSettings(size_m=1024.0, reach_m=None)
    h = solver.solve([wall(0, 300, 600, flank(35, 160, "straight"), 1024.0)], endless, 2)[2]
    assert profile(h, 1024.0, (512, 512), math.pi / 2, [400.0])[0] > 100


def test_slope_of_a_band_that_meets_the_base(solver: Solver) -> None:
    """SPEC S10 where the foot lies on the base: 100 m at 35 degrees stand on 143 m."""
    stroke = wall(20, 100, 600, flank(35, 400, "straight"), 1024.0)
    h = solver.solve([stroke], SMALL, 2)[2]
    for at in (36, 71, 107):
        near, far = profile(h, 1024.0, (512, 512), math.radians(110), [at - 8, at + 8])
        assert (near - far) / 16 == pytest.approx(math.tan(math.radians(35)), rel=0.05)


def test_wide_flanks_keep_their_slope(solver: Solver) -> None:
    """A band of eight reaches: screening pulls towards the profile there, not to the base (docs/solver.md)."""
    stroke = wall(0, 1000, 3600, flank(30, 1024, "straight"))
    h = solver.solve([stroke], SETTINGS, 2)[2]
    for share in (0.25, 0.5, 0.75):
        near, far = profile(h, SIZE, (2048, 2048), math.pi / 2, [share * 1024 - 32, share * 1024 + 32])
        assert (near - far) / 64 == pytest.approx(math.tan(math.radians(30)), rel=0.05)


def test_zero_slope_is_flat(solver: Solver) -> None:
    h = solver.solve([wall(30, 80, 500, flank(0, 120, "straight"), 1024.0)], SMALL, 2)[2]
    line = profile(h, 1024.0, (512, 512), math.radians(120), [10, 40, 60, 80])
    assert np.abs(line - 80).max() < 0.05


@pytest.mark.parametrize("shape", ["concave", "convex"])
def test_round_flanks(solver: Solver, shape: str) -> None:
    """A concave flank has its slope near the crest and a flat foot, a convex one the other way round; both end at 1.5
    times height / slope."""
    h = solver.solve([wall(0, 100, 700, flank(45, 400, shape), 1024.0)], SMALL, 2)[2]  # type: ignore[arg-type]
    z = profile(h, 1024.0, (512, 512), math.pi / 2, [12, 28, 120, 136, 180])
    near, foot = (z[0] - z[1]) / 16, (z[2] - z[3]) / 16
    steep, flat = (near, foot) if shape == "concave" else (foot, near)
    assert steep == pytest.approx(1.0, rel=0.1)
    assert flat < 0.5
    assert abs(z[4]) < 3


@pytest.mark.parametrize("angle", [0, 35, 90])
def test_plateau_radius_is_flat(solver: Solver, angle: float) -> None:
    """SPEC S11: to a quantum at every sample within the radius, round the ends too."""
    stroke = wall(angle, 120, 500, flank(40, 200), 1024.0).model_copy(update={"plateau_radius_m": 60.0})
    h = solver.solve([stroke], SMALL, 2)[2]
    y, x = np.mgrid[:257, :257] * 4.0 - 512.0
    c, s = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    beyond = np.maximum(np.abs(x * c + y * s) - 250, 0)
    top = np.hypot(beyond, y * c - x * s) <= 60
    assert top.sum() > 4000
    assert np.abs(h[top] - 120).max() <= grid.quantum(2, 1024.0)


@pytest.mark.parametrize("finished", [True, False])
@pytest.mark.parametrize("turn", [1, -1])
def test_closed_outline_is_plateau_inside(solver: Solver, finished: bool, turn: int) -> None:
    """SPEC S11; in either direction of travel, while drawing and after."""
    stroke = loop(2048, 2048, 700, 200, flank(35, 400)).model_copy(update={"finished": finished})
    if turn < 0:
        stroke = stroke.model_copy(update={"curve": stroke.curve[::-1]})
    h = solver.solve([stroke], SETTINGS, 3)[3]
    y, x = np.mgrid[:513, :513] * 8.0
    inside = np.hypot(x - 2048, y - 2048) < 680
    assert np.abs(h[inside] - 200).max() < 1e-3
    assert abs(profile(h, SIZE, (2048, 2048), 0.3, [1250])[0]) < 2


def test_open_outline_is_no_plateau(solver: Solver) -> None:
    stroke = loop(2048, 2048, 700, 200, flank(35, 400))
    half = stroke.model_copy(update={"curve": stroke.curve[:35]})
    assert not is_closed(crest_of(half).points)  # type: ignore[union-attr]
    assert solver.solve([half], SETTINGS, 3)[3][256, 256] < 50


def test_foot_of_a_mountain(solver: Solver) -> None:
    """SPEC S12: the design's own example."""
    h = solver.solve([ridge((1200, 1500), (2800, 2400), 225, flank(35, 1000, "straight"))], SETTINGS, 4)[4]
    y, x = np.mgrid[:1025, :1025] * 4.0
    d = np.array([1600.0, 900.0]) / math.hypot(1600, 900)
    along, across = (x - 1200) * d[0] + (y - 1500) * d[1], np.abs(-(x - 1200) * d[1] + (y - 1500) * d[0])
    beyond = (across > 321 + 40) | (along < -40) | (along > math.hypot(1600, 900) + 40)
    assert np.abs(h[beyond]).max() < 2
    assert h.max() == pytest.approx(225, abs=1)


def test_crevice_is_a_mountain_upside_down(solver: Solver) -> None:
    up = solver.solve([ridge((900, 1500), (3000, 2400), 180, flank())], SETTINGS, 2)[2]
    down = solver.solve([ridge((900, 1500), (3000, 2400), -180, flank())], SETTINGS, 2)[2]
    assert np.abs(up + down).max() < 0.05


def test_sides(solver: Solver) -> None:
    """Left is left of the direction of travel: travelling east, north."""
    points = [(800, 2048, 200), (3300, 2048, 200)]
    h = solver.solve(
        [Make.profile(points, left=flank(20, 400, "straight"), right=flank(60, 400, "straight"), id="a")], SETTINGS, 3
    )[3]
    north, south = h[256 + 12, 256], h[256 - 12, 256]
    assert north == pytest.approx(200 - 96 * math.tan(math.radians(20)), abs=4)
    assert south == pytest.approx(200 - 96 * math.tan(math.radians(60)), abs=8)


@pytest.mark.parametrize("angles", [(0, 90), (20, 75), (0, 30)])
@pytest.mark.parametrize("heights", [(300, 100), (200, -100)])
def test_crossing_crests(solver: Solver, angles: tuple[int, int], heights: tuple[int, int]) -> None:
    """SPEC S13: their mean where they meet, between the two along both, and without a kink."""
    walls = [wall(a, z, 2600, flank(35), SIZE) for a, z in zip(angles, heights, strict=True)]
    strokes = [w.model_copy(update={"id": name}) for w, name in zip(walls, "ab", strict=True)]
    h = solver.solve(strokes, SETTINGS, 3)[3]
    assert np.array_equal(h, solver.solve(strokes[::-1], SETTINGS, 3)[3])
    renamed = [w.model_copy(update={"id": name}) for w, name in zip(walls, "ba", strict=True)]
    assert np.abs(h - solver.solve(renamed, SETTINGS, 3)[3]).max() < grid.quantum(3, SIZE)
    assert h[256, 256] == pytest.approx(sum(heights) / 2, abs=1)
    apart = heights[0] - heights[1]
    for angle, height in zip(angles, heights, strict=True):
        z = profile(h, SIZE, (2048, 2048), math.radians(angle), [float(d) for d in range(-800, 801, 8)])
        assert min(height, sum(heights) / 2) - 0.02 * apart <= z.min()
        assert z.max() <= max(height, sum(heights) / 2) + 0.02 * apart
        assert np.abs(np.diff(z, 2)).max() < 0.2 * apart, "a kink would be half of it"


def test_overlapping_strokes_commute(solver: Solver) -> None:
    """SPEC S13: flanks over flanks, a stroke drawn twice, an outline over a ridge."""
    a = ridge((900, 1500), (3000, 2400), 300, flank(), "a")
    pile = [a, a.model_copy(update={"id": "b"}), ridge((900, 1650), (3000, 2500), 260, flank(25), "c")]
    pile += [loop(1900, 2000, 500, 120, flank(40), "d")]
    h = solver.solve(pile, SETTINGS, 2)[2]
    assert np.array_equal(h, solver.solve(pile[::-1], SETTINGS, 2)[2])
    alone, twice = (solver.solve(s, SETTINGS, 2)[2] for s in ([a], pile[:2]))
    assert np.abs(alone - twice).max() < grid.quantum(2, SIZE)


@pytest.mark.parametrize("slope", [None, 20, 60])
@pytest.mark.parametrize("tip", [100, 20])
def test_ends_blend_into_the_ground(solver: Solver, slope: float | None, tip: float) -> None:
    """SPEC S14: beyond its end a stroke goes down without a spike or a moat, no steeper than its flank."""
    side = None if slope is None else flank(slope, 400, "straight")
    stroke = Make.profile([(312, 512, tip), (512, 512, 100), (712, 512, tip)], left=side, right=side, id="e")
    h = solver.solve([stroke], SMALL, 3)[3]
    z = profile(h, 1024.0, (712, 512), 0.0, [float(d) for d in range(0, 300, 2)])
    assert z.max() <= tip * 1.001
    assert z.min() >= -0.01 * tip
    assert np.diff(z).max() < 0.002 * tip
    if slope is not None:
        assert (-np.diff(z) / 2).max() < 1.05 * math.tan(math.radians(slope))
    assert h.max() <= 100.5


@pytest.mark.parametrize("side", [None, flank(40, 300)], ids=["bare", "flanks"])
def test_degenerate_strokes(solver: Solver, side: object) -> None:
    """SPEC S14."""
    f = {"left": side, "right": side}
    point = Make.profile([(2000, 2000, 150)], **f, id="point")  # type: ignore[arg-type]
    still = Make.profile([(2000, 2000, 150)] * 5, **f, id="still")  # type: ignore[arg-type]
    level = Make.level([(2000, 2000, 150)] * 3, **f, id="level")  # type: ignore[arg-type]
    repeated = Make.profile(
        [(1000, 1000, 0), (1000, 1000, 0), (2000, 1500, 200), (2000, 1500, 200), (3000, 2000, 0)],
        **f,  # type: ignore[arg-type]
        id="repeated",
    )
    upright = Make.profile([(1000, 1000, 0), (2000, 1500, 90), (2000, 1500, 200), (3000, 2000, 0)], **f, id="u")  # type: ignore[arg-type]
    outside = Make.profile([(-40000, 2000, 900), (40000, 2100, 900)], **f, id="outside")  # type: ignore[arg-type]
    for stroke in (point, still, level, repeated, upright, outside):
        h = solver.solve([stroke], SETTINGS, 2)[2]
        assert np.isfinite(h).all()
        assert h.max() > 100
    assert crest_of(still).points.shape == (1, 3)  # type: ignore[union-attr]


def test_single_point_is_a_cone(solver: Solver) -> None:
    """SPEC S14."""
    f = flank(35, 400, "straight")
    h = solver.solve([Make.profile([(512, 512, 100)], left=f, right=f, id="p")], SMALL, 2)[2]
    ring = [profile(h, 1024.0, (512, 512), a, [70])[0] for a in np.linspace(0, 2 * math.pi, 24)]
    assert np.ptp(ring) < 4
    assert np.mean(ring) == pytest.approx(100 - 70 * math.tan(math.radians(35)), abs=3)


def jagged(seed: int = 4) -> Stroke:
    """A silhouette with teeth of up to 60 m on a broad back, 2,400 m long."""
    rng = np.random.default_rng(seed)
    u = np.linspace(0, 1, 121)
    z = (300 + rng.uniform(-30, 30, 121)) * np.sin(math.pi * u) ** 0.5
    side = flank(35, 2048, "straight")
    return Make.profile(np.column_stack([850 + 2400 * u, np.full(121, 2048), z]), left=side, right=side, id="jagged")


def test_teeth_do_not_run_down_the_flank(solver: Solver) -> None:
    """SPEC S43: the crest is as drawn; the farther from it, the less is left of what is short along it."""
    stroke = jagged()
    h = solver.solve([stroke], SETTINGS, 4)[4].astype(float)
    columns = np.arange(1400, 2700, 4) // 4

    def teeth(row: int) -> float:
        line = h[row, columns]
        return float(np.abs(np.diff(line[::5], 2)).mean())

    crest, near, far = teeth(512), teeth(512 + 20), teeth(512 + 60)
    points = crest_of(stroke).points  # type: ignore[union-attr]
    assert np.abs(np.interp(columns * 4.0, points[:, 0], points[:, 2]) - h[512, columns]).max() < 0.5
    assert near < 0.6 * crest
    assert far < 0.06 * crest


def test_a_short_sharp_peak_keeps_its_height(solver: Solver) -> None:
    """SPEC S43: the shape at large is left alone, however far from it: a cone's flank falls as prescribed."""
    side = flank(35, 2048, "straight")
    stroke = Make.profile([(1948, 2048, 0), (2048, 2048, 200), (2148, 2048, 0)], left=side, right=side, id="p")
    h = solver.solve([stroke], SETTINGS, 4)[4]
    assert h[512, 512] == pytest.approx(200, abs=0.01)
    assert h[512 + 30, 512] == pytest.approx(200 - 120 * math.tan(math.radians(35)), abs=22)


def test_folded_profile_takes_its_outline() -> None:
    """SPEC S14: an overhang becomes the height that is farthest from the base over each place."""
    folded = Make.profile([(0, 0, 0), (600, 0, 300), (400, 0, 500), (1000, 0, 0)], id="f")
    points = crest_of(folded).points  # type: ignore[union-attr]
    assert (np.diff(points[:, 0]) > 0).all()
    assert np.allclose(points, [(0, 0, 0), (400, 0, 500), (600, 0, 1000 / 3), (1000, 0, 0)])


def test_a_fold_by_the_smallest_number_there_is_stands_upright() -> None:
    """SPEC S14: two knots whose distance has no quotient are a wall; the search found them on another processor."""
    folded = Make.profile([(0, 0, 0), (1, 0, 300), (2, 0, 500), (3, 0, 0)], id="f")
    curve = ((0.0, 0.1), (-5e-324, 0.4), (0.75, 0.2), (0.14, 0.3), (1.0, 0.0))
    with np.errstate(all="raise", under="ignore"):
        crest = crest_of(folded.model_copy(update={"curve": curve}))
    assert crest is not None
    assert np.isfinite(crest.points).all()


@pytest.mark.parametrize("scene", list(SCENES))
def test_no_spikes(solver: Solver, scene: str) -> None:
    """No sample is wilder than the strokes: heights stay within theirs by a tenth."""
    h = solver.solve(SCENES[scene], SETTINGS, 3)[3]
    top, low = _range(SCENES[scene])
    assert h.max() <= max(top, 0) * 1.02 + 2
    assert h.min() >= min(low, 0) * 1.1 - 0.05 * (top - low)


def _range(strokes: list[Stroke]) -> tuple[float, float]:
    z = np.concatenate([crest.points[:, 2] for s in strokes if (crest := crest_of(s))])
    return float(z.max()), float(z.min())
