"""Cross-sections over a base (SPEC S98, S99): what artists prescribe holds for the ground that they see."""

from __future__ import annotations

import math

import numpy as np
import pytest

from esker import grid
from esker.api.terrain import Stroke as Make
from esker.contract import Stroke
from esker.events import Level
from esker.solve import base as rules
from esker.solve.base import ground_under
from esker.solve.constraints.crest import crest_of
from esker.solve.solver import Solver
from tests.solver.bases import Analytic, Floats, hills, plane, rough
from tests.solver.scenes import SETTINGS, SIZE, flank, loop, mixed, wall
from tests.solver.test_base import lifted
from tests.solver.test_shape import SMALL, profile

TILTS = [(0.15, 0.0), (0.3, 0.1), (-0.2, 0.35)]


def ground(solver: Solver, strokes: list[Stroke], base: Analytic, level: int) -> Floats:
    """The ground that one sees, float64."""
    settings = SETTINGS if base.size_m == SIZE else SMALL
    offsets = solver.solve(strokes, settings, level, base=base)[level]
    return offsets.astype(np.float64) + base.level(level)


@pytest.mark.parametrize("slope", [10, 35, 60])
@pytest.mark.parametrize("angle", [0, 30, 63])
@pytest.mark.parametrize("tilt", TILTS)
@pytest.mark.parametrize("up", [1, -1])
def test_prescribed_slope_on_a_slope(
    solver: Solver, slope: float, angle: float, tilt: tuple[float, float], up: int
) -> None:
    """SPEC S98: a crest of one height above, or below, a tilted base: both flanks as steep as prescribed."""
    base = plane(*tilt, at=200, size_m=1024.0)
    rise = math.tan(math.radians(slope)) * 160
    stroke = wall(angle, 200 + up * (rise + 110), 600, flank(slope, 160, "straight"), 1024.0)
    h = ground(solver, [stroke], base, 2)
    for side in (90, -90):
        for share in (0.25, 0.5, 0.75):
            at = [share * 160 - 8, share * 160 + 8]
            near, far = profile(h, 1024.0, (512, 512), math.radians(angle + side), at)
            assert up * (near - far) / 16 == pytest.approx(math.tan(math.radians(slope)), rel=0.05)


def test_a_road_over_rough_hills(solver: Solver) -> None:
    """SPEC S98: flat to a quantum at every sample of its width, in cuts and on embankments; straight flanks although
    the base is rough to its last sample; beyond its feet the base as it was, where that is smooth to 2 m (S12)."""
    base, height, slope = rough(6.0, 4.0), 330.0, math.tan(math.radians(35))
    stroke = wall(20, height, 2500, flank(35, 512, "straight")).model_copy(update={"plateau_radius_m": 60.0})
    h, under = ground(solver, [stroke], base, 4), base.level(4).astype(np.float64)
    y, x = np.mgrid[:1025, :1025] * 4.0 - 2048
    c, s = math.cos(math.radians(20)), math.sin(math.radians(20))
    beyond = np.maximum(np.abs(x * c + y * s) - 1250, 0)
    r = np.hypot(beyond, y * c - x * s) - 60
    top, flanks = r <= 0, (r > 8) & (beyond == 0)
    assert np.abs(h[top] - height).max() <= grid.quantum(4, SIZE)
    for sign in (1, -1):
        above = sign * (height - under)
        held = flanks & (above - slope * r > 6)
        error = h[held] - (height - sign * slope * r[held])
        assert held.sum() > 5000
        assert np.sqrt(np.mean(error**2)) < 0.2
        assert np.quantile(np.abs(error), 0.99) < 1
    smooth = ground(solver, [stroke], hills(), 4)
    for there, low, most in ((smooth, hills(), 2), (h, base, 6)):
        bare = low.level(4).astype(np.float64)
        foot = flanks & (np.abs(height - bare) - slope * r < -20)
        assert foot.sum() > 10000
        assert np.abs(there - bare)[foot].max() < most


def valley(steep: float) -> Analytic:
    """A V-shaped valley from south to north, 50 m high at its bottom."""
    return Analytic(f"valley {steep}", lambda x, y: 50 + steep * np.abs(x - 512) + 0 * y, 0, 50 + 512 * steep, 1024.0)


def dam() -> Stroke:
    """From one wall of the valley to the other, 80 m above its bottom; the ends are a little in the ground."""
    side = flank(35, 400, "straight")
    return Make.profile([(430, 512, 130), (594, 512, 130)], left=side, right=side, id="dam")


def test_a_dam_leaves_the_walls_alone(solver: Solver, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC S99: walls steeper than its flanks, higher than its crest and within its reach are none of its business."""
    base = valley(1.0)
    h = ground(solver, [dam()], base, 3)
    lowered = base.level(3) - h
    assert h[256, 256] == pytest.approx(130, abs=0.01)
    assert lowered.max() < 3
    monkeypatch.setattr(rules, "_ramp", math.ceil)
    unruly = Solver().solve([dam()], SMALL, 3, base=base)[3]
    assert unruly.min() < -30, "the rule is what keeps them"


def test_a_plateau_on_a_hillside_cuts_and_fills(solver: Solver) -> None:
    """SPEC S98, S99: flat inside; a bank above it, an embankment below it, as steep as prescribed."""
    base = plane(0.0, 0.4, 300)
    h = ground(solver, [loop(2048, 2048, 300, 300, flank(45, 600, "straight"))], base, 3)
    y, x = np.mgrid[:513, :513] * 8.0
    inside = np.hypot(x - 2048, y - 2048) < 280
    assert np.abs(h[inside] - 300).max() <= grid.quantum(3, SIZE)
    for towards, sign in ((90, 1), (-90, -1)):
        near, far = profile(h, SIZE, (2048, 2048), math.radians(towards), [340, 400])
        assert (far - near) / 60 == pytest.approx(sign, rel=0.05)
    assert np.abs(h - base.level(3))[np.hypot(x - 2048, y - 2048) > 900].max() < 1


@pytest.mark.parametrize(
    ("points", "plateau", "fill", "cut"),
    [
        pytest.param([(600, 2048, 900), (3500, 2048, 900)], 0, 1, 0, id="ridge"),
        pytest.param([(600, 2048, 20), (3500, 2048, 20)], 0, 0, 1, id="gorge"),
        pytest.param([(600, 2048, 300), (3500, 2048, 300)], 0, 1, 1, id="railway"),
        pytest.param([(2048, 2048, 900)], 0, 1, 0, id="summit"),
    ],
)
def test_what_a_stroke_does(points: list[tuple[float, float, float]], plateau: float, fill: float, cut: float) -> None:
    """SPEC S99: ridges fill, gorges cut, railways do both."""
    crest = crest_of(Make.profile(points, id="s"))
    assert crest is not None
    found = ground_under(hills(), crest.points, plateau, closed=False, size_m=SIZE)
    assert (found.fill, found.cut) == (fill, cut)
    assert found.datum - found.half <= 150
    assert found.datum + found.half >= 450


def test_a_terrace_along_a_contour_does_both() -> None:
    """SPEC S99: its line lies on the ground, but the edges of its plateau do not."""
    points = np.array([(600.0, 2048.0, 500.0), (3500.0, 2048.0, 500.0)])
    found = ground_under(plane(0, 0.5, 500), points, 80.0, closed=False, size_m=SIZE)
    assert (found.fill, found.cut) == (1, 1)


def cliff(high: float = 300.0) -> Analytic:
    """Low in the west, high in the east, with nothing between; it runs askew to the samples."""
    return Analytic(f"cliff {high}", lambda x, y: 100 + np.where(x - 2048 > 0.3 * y - 614.4, high, 0.0), 99, 101 + high)


@pytest.mark.parametrize(
    ("first", "last", "height"),
    [
        pytest.param((1000, 2048), (3000, 2048), 550.0, id="a ridge across it"),
        pytest.param((1000, 2048), (3000, 2048), 250.0, id="a road, a dam below and a gorge above"),
        pytest.param((1000, 2048), (3000, 2048), 140.0, id="a gorge"),
        pytest.param((1900, 1000), (1900, 3000), 350.0, id="a ridge along it"),
    ],
)
def test_strokes_leave_no_spikes_at_a_cliff(
    solver: Solver, first: tuple[int, int], last: tuple[int, int], height: float
) -> None:
    """SPEC S100: the ground is that of the section or the base, on both sides of the cliff."""
    base, slope = cliff(), math.tan(math.radians(35))
    side = flank(35, 800, "straight")
    stroke = Make.profile([(*first, height), (*last, height)], left=side, right=side, id="s")
    h, under = ground(solver, [stroke], base, 3), base.level(3).astype(np.float64)
    y, x = np.mgrid[:513, :513] * 8.0
    beyond = np.hypot(np.clip(x, first[0], last[0]) - x, np.clip(y, first[1], last[1]) - y)
    section = np.where(
        height > under, np.maximum(under, height - slope * beyond), np.minimum(under, height + slope * beyond)
    )
    assert np.abs(h - section).max() < 20


def test_levels_agree_over_a_base(solver: Solver) -> None:
    """SPEC S13 over hills: a finer level does not weigh strokes anew."""
    strokes = lifted(mixed(12, 9), 300)
    base = hills()
    fine = solver.solve(strokes, SETTINGS, 5, base=base)[5]
    apart = np.abs(solver.solve(strokes, SETTINGS, 4, base=base)[4] - fine[::2, ::2])
    relief = float(np.ptp(fine))
    assert float((apart > 0.005 * relief).mean()) < 0.02
    assert float(np.median(apart)) < 3e-4 * relief


@pytest.mark.parametrize("scene_base", [hills(), rough()], ids=["hills", "rough"])
def test_previews_over_a_base(solver: Solver, scene_base: Analytic) -> None:
    """SPEC S18 over a base: the finest preview is within 10^-3 of the relief of the ground at rest."""
    strokes = lifted(mixed(12, 9), 300)
    finest = [
        r.heights for r in solver.steps(strokes, SETTINGS, 3, base=scene_base) if isinstance(r, Level) and r.level == 3
    ]
    preview, settled = finest
    assert np.abs(preview - settled).max() <= 1e-3 * np.ptp(settled)
