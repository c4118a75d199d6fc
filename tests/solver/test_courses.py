"""Rivers, roads and ridges drawn over the ground (SPEC S540 to S544)."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from esker import contract as c
from esker import grid
from esker.api.strokes import Stroke as Make
from esker.contract import Flank, Stroke
from esker.solve.constraints.constraints import pack
from esker.solve.opencl.device import Device
from esker.solve.solver import Solver
from tests.solver.scenes import SETTINGS, SIZE, flank
from tests.solver.test_ties import differences

LEVEL = 4
Ground = NDArray[np.float32]


def mountain() -> Stroke:
    """A ridge of 700 m with wide flanks."""
    points = [(500, 2000, 0), (2000, 2200, 700), (3500, 2000, 0)]
    return Make.profile(points, left=flank(35, 2000), right=flank(35, 2000), id="mountain")


def line() -> NDArray[np.float64]:
    """A winding line down the northern flank, (n, 2) metres, from high to low."""
    y = np.linspace(2350, 3600, 26)
    return np.column_stack([2000 + 120 * np.sin(y / 200), y])


def sampled(h: Ground, places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Ground at places (n, 2), bilinear."""
    x, y = places.T / (SIZE / (len(h) - 1))
    i, j = x.astype(int), y.astype(int)
    u, v = x - i, y - j
    low, high = (h[j + k, i] * (1 - u) + h[j + k, i + 1] * u for k in (0, 1))
    return np.asarray(low * (1 - v) + high * v, dtype=np.float64)


def river(ground: Ground, depth: float = 6.0, width: float = 20.0, bank: float = 60.0) -> Stroke:
    bed = np.minimum.accumulate(sampled(ground, line()) - depth)
    side = Flank(slope_deg=None, extent_m=bank) if bank else None
    return Make.course(np.column_stack([line(), bed]), "river", width, side, side, id="river")


@pytest.fixture(scope="module")
def before(solver: Solver) -> Ground:
    return np.array(solver.solve([mountain()], SETTINGS, LEVEL)[LEVEL])


@pytest.fixture(scope="module")
def after(solver: Solver, before: Ground) -> Ground:
    return np.array(solver.solve([mountain(), river(before)], SETTINGS, LEVEL)[LEVEL])


def test_a_bed_has_the_heights_that_were_drawn_on_a_flank_of_another_stroke(before: Ground, after: Ground) -> None:
    """SPEC S540: it leads where both say something, to a few centimetres, and all along its way it falls."""
    points = line()
    wanted = np.minimum.accumulate(sampled(before, points) - 6)
    assert np.abs(sampled(after, points) - wanted)[1:-1].max() < 0.1
    between = (points[:-1] + points[1:]) / 2
    bed = sampled(after, np.array([p for pair in zip(points[:-1], between, strict=True) for p in pair]))
    assert (np.diff(bed) < 0.05).all()


def test_beyond_its_banks_the_ground_stays(before: Ground, after: Ground) -> None:
    """SPEC S541: on the flank, where springs hold the ground, little moves two banks away."""
    s = SIZE / (len(before) - 1)
    y, x = np.mgrid[: len(before), : len(before)] * s
    away = np.min([np.hypot(x - px, y - py) for px, py in line()], axis=0)
    moved = np.abs(after - before)
    assert moved[away < 10].max() > 5
    assert moved[(away > 190) & (y < 2700)].max() < 0.3


def test_banks_lead_down_to_a_bed_that_a_stiff_flank_would_wall_in(solver: Solver) -> None:
    """SPEC S541: 40 m beside a bed of 8 m the ground comes down by three times as much with a bank of 60 m."""
    steep = flank(50, 200)
    wall = Make.profile([(500, 2000, 0), (900, 2000, 200), (3100, 2000, 200), (3500, 2000, 0)], steep, steep, id="m")
    x = np.linspace(1200, 2800, 30)
    way = np.column_stack([x, np.full(30, 2100.0), np.full(30, 40.0)])
    lower = {}
    for bank in (0.0, 60.0):
        side = Flank(slope_deg=None, extent_m=bank) if bank else None
        h = np.array(solver.solve([wall, Make.course(way, "river", 8, side, side, id="r")], SETTINGS, LEVEL)[LEVEL])
        lower[bank] = float(h[2080 // 4, 500])
    alone = float(np.array(solver.solve([wall], SETTINGS, LEVEL)[LEVEL])[2080 // 4, 500])
    assert alone - lower[60.0] > 3 * (alone - lower[0.0]) > 0


def test_without_banks_nothing_but_the_bed_changes_springs(before: Ground) -> None:
    """SPEC S541: a bank takes springs away, and only a course has one."""
    with_bank, without = (pack([mountain(), river(before, bank=b)], SETTINGS, 2) for b in (60.0, 0.0))
    assert not np.array_equal(with_bank.strokes, without.strokes)
    plain = mountain().model_copy(update={"left": Flank(slope_deg=None, extent_m=60)})
    none = mountain().model_copy(update={"left": None})
    assert np.array_equal(pack([plain], SETTINGS, 2).strokes, pack([none], SETTINGS, 2).strokes)


@pytest.mark.parametrize("bank", [0.0, 60.0])
def test_kernels_agree_with_their_twin(device: Device, before: Ground, bank: float) -> None:
    """SPEC S542."""
    strokes = [mountain(), river(before, bank=bank)]
    assert max(differences(device, strokes, SETTINGS, 3).values()) < 5e-4


def test_a_level_course_is_a_level_stroke(solver: Solver) -> None:
    """SPEC S543: to the bit, away from others; a loop of it encloses nothing."""
    points = np.column_stack([line(), np.full(len(line()), 40.0)])
    road = Make.course(points, "road", 30, id="a")
    crest = Make.level(points, None, None, plateau_radius_m=15, id="a")
    one, other = (np.array(solver.solve([s], SETTINGS, 3)[3]) for s in (road, crest))
    assert np.abs(one - other).max() <= grid.spacing(3, SIZE) / 256 / 2
    turn = np.linspace(0, 2 * np.pi, 40)
    ring = np.column_stack([2000 + 600 * np.cos(turn), 2000 + 600 * np.sin(turn), np.full(40, 50.0)])
    inside = {
        kind: float(np.array(solver.solve([made], SETTINGS, 3)[3])[250, 250])
        for kind, made in (("course", Make.course(ring, "road")), ("level", Make.level(ring, None, None)))
    }
    assert inside["level"] == pytest.approx(50, abs=0.1)
    assert inside["course"] < 45


def test_odd_courses_settle(solver: Solver) -> None:
    """SPEC S544: a point, a line that crosses itself, that leaves the land, has no heights, goes straight up."""
    settings = SETTINGS
    cross = [(1000, 1000, 90), (3000, 3000, 60), (3000, 1000, 50), (1000, 3000, 10)]
    far = [(3900, 2000, 10), (9000, 2100, 5), (9000, 9000, -30)]
    odd = [
        Make.course([(700, 700, 50)], "ridge", 20),
        Make.course(cross, "river", 25, (None, 80), (None, 80)),
        Make.course(far, "river", 10),
        Make.course([(500, 3500, 0), (500.001, 3500, 400)], "road"),
        Make.course(cross, "ridge").model_copy(update={"course": c.Course(use="ridge"), "id": "bare"}),
    ]
    for stroke in odd:
        h = np.array(solver.solve([mountain(), stroke], settings, 2)[2])
        assert np.isfinite(h).all()
        assert np.abs(h).max() < 1000


def test_what_is_no_course_is_refused() -> None:
    """SPEC D400."""
    with pytest.raises(ValueError, match="never rises"):
        Make.course([(0, 0, 0), (100, 0, 1)], "river")
    with pytest.raises(ValueError, match="at most 512"):
        Make.course([(float(k), 0.0, 0.0) for k in range(c.MAX_COURSE_POINTS + 1)], "road")
    with pytest.raises(ValueError, match="river"):
        Make.course([(0, 0, 0), (100, 0, 1)], "canal")  # type: ignore[arg-type]
