"""Older ground is blended into surveys along their seams (SPEC PW60 to PW67)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from esker import grid
from esker.patchwork.base import Base
from esker.patchwork.lod import space
from esker.patchwork.lod.space import Placed
from esker.patchwork.seams import loops, reference
from esker.patchwork.seams.borders import border_of
from esker.patchwork.seams.seam_blend import SeamBlend
from tests.patchwork.blend_scenes import Floats, placed, places, sampled, shifted

SIZE = 1024.0
PLACE = {"anchor": (380.0, 250.0), "rotation_deg": 27.0, "spacing_m": (4.0, 4.0)}
ROWS, COLS = 90, 100


def hills(x: Floats, y: Floats) -> Floats:
    """No steeper than 1 in 3."""
    return np.asarray(300 + 60 * np.sin(x / 340) * np.cos(y / 290) + 10 * np.sin(x / 97 + y / 130))


def risen(x: Floats, y: Floats) -> Floats:
    """Twelve to 28 m higher."""
    return np.asarray(hills(x, y) + 20 + 8 * np.sin(x / 150))


def wide(ground: Callable[[Floats, Floats], Floats] = hills, name: str = "aaaaaaaa") -> Placed:
    return sampled(ground, 125, 125, name, anchor=(-100.0, -100.0), spacing_m=(10.0, 10.0), accuracy_m=3.0)


def newer(ground: Callable[[Floats, Floats], Floats] = risen, name: str = "bbbbbbbb", **more: object) -> Placed:
    fields = {"accuracy_m": 0.5, "priority": 1, **PLACE, **more}
    return sampled(ground, ROWS, COLS, name, **fields)


def third() -> Placed:
    """Across the border of the newer one, lower than both."""
    place = {"anchor": (600.0, 480.0), "rotation_deg": -10.0, "spacing_m": (3.0, 3.0)}
    return sampled(lambda x, y: hills(x, y) - 15, 80, 80, "cccccccc", accuracy_m=0.2, priority=2, **place)


class Unblended(Base):
    """What the ground was without it."""

    @property
    def seam_blend(self) -> SeamBlend:
        return SeamBlend(space.build([]), self.size_m)


MODEL = space.build([wide(), newer()])
LEVEL = 4
SPACING = grid.spacing(LEVEL, SIZE)


def inside(margin: float) -> NDArray[np.bool_]:
    """Which samples of LEVEL lie in the newer survey's rectangle grown by ``margin`` metres."""
    x, y = np.meshgrid(*[np.arange(grid.samples(LEVEL)) * SPACING] * 2)
    turn = np.radians(27.0)
    u = np.cos(turn) * (x - 380) + np.sin(turn) * (y - 250)
    v = -np.sin(turn) * (x - 380) + np.cos(turn) * (y - 250)
    end_u, end_v = (COLS - 1) * 4.0, (ROWS - 1) * 4.0
    return np.asarray((u > -margin) & (u < end_u + margin) & (v > -margin) & (v < end_v + margin))


def steepest(heights: NDArray[np.float32]) -> float:
    """Greatest slope from sample to sample."""
    return float(max(np.abs(np.diff(heights, axis=axis)).max() for axis in (0, 1)) / SPACING)


@pytest.mark.parametrize("raised", [0.0, 0.7], ids=["the same", "within a quarter of a cell"])
def test_surveys_that_agree_change_no_bit(raised: float) -> None:
    """SPEC PW60."""
    model = space.build([wide(), newer(lambda x, y: hills(x, y) + raised)])
    for level in (2, LEVEL):
        assert np.array_equal(Base(model, SIZE).level(level), Unblended(model, SIZE).level(level))
    at = np.random.default_rng(0).uniform(0, SIZE, (300, 2))
    blended, plain = (kind(model, SIZE).sample(at, derivatives=True) for kind in (Base, Unblended))
    assert all(a is not None and b is not None and np.array_equal(a, b) for a, b in zip(blended, plain, strict=True))


def test_the_newest_survey_stays_to_the_bit() -> None:
    """SPEC PW61: its own samples, and all ground that its kernels cover."""
    blended, plain = Base(MODEL, SIZE).level(LEVEL), Unblended(MODEL, SIZE).level(LEVEL)
    assert np.array_equal(blended[inside(1.9)], plain[inside(1.9)])
    assert (blended != plain).mean() > 0.02
    x, y = places(ROWS, COLS, **PLACE)
    at = np.stack([x.ravel(), y.ravel()], axis=1)
    assert np.abs(Base(MODEL, SIZE).sample(at).heights - risen(x, y).ravel()).max() < 2e-3


def test_there_is_a_slope_and_no_step() -> None:
    """SPEC PW62: 28 m within a few metres become a slope of the ground's own kind."""
    blended, plain = Base(MODEL, SIZE).level(LEVEL), Unblended(MODEL, SIZE).level(LEVEL)
    assert steepest(plain) > 3
    assert steepest(blended) < 1.5
    correction = blended - plain
    assert correction.min() > -0.01
    assert correction.max() < 29


def tilted(x: Floats, y: Floats) -> Floats:
    """1 in 2.2."""
    return np.asarray(300 + 0.4 * x + 0.2 * y)


@pytest.mark.parametrize("raised", [0.0, 20.0], ids=["the same", "higher"])
def test_no_crease_where_the_border_slopes(raised: float) -> None:
    """SPEC PW62: a survey goes on along its slope beyond its edge and around nodata in it. On a tilted plane nothing of
    its border is seen; where it is blended, the slope changes by no more than that of the blend in a cell."""

    def holed(x: Floats, y: Floats) -> Floats:
        return np.where(np.hypot(x - 560, y - 520) < 60, np.nan, tilted(x, y) + raised)

    model = space.build([wide(tilted), newer(holed)])
    for level in (3, LEVEL):
        x, y = np.meshgrid(*[np.arange(grid.samples(level)) * grid.spacing(level, SIZE)] * 2)
        bent = Base(model, SIZE).level(level) - tilted(x, y)
        turns = max(np.abs(np.diff(bent, 2, axis=axis)).max() for axis in (0, 1)) / grid.spacing(level, SIZE)
        assert turns < (0.02 if raised == 0 else 0.6)


def test_places_beside_a_newer_survey_show_the_older_as_levels_do() -> None:
    """SPEC PW53: all patches of the older one are stale there, the coarse ones hardly more than the fine ones."""
    base = Unblended(space.build([wide(), newer(lambda x, y: hills(x, y) + 300)]), SIZE)
    ring = inside(120) & ~inside(12)
    row, col = (at[::97] for at in np.nonzero(ring))
    at: Floats = np.stack([col, row], axis=1).astype(np.float64) * np.float64(SPACING)
    found = base.sample(at)
    assert np.abs(found.heights - hills(at[:, 0], at[:, 1])).max() < 0.5
    assert np.abs(found.heights - base.level(LEVEL)[row, col]).max() < 0.05


def test_the_reach_is_bounded() -> None:
    """SPEC PW63: five times the difference, and never more than an eighth of the domain (corners are rounder)."""
    blended, plain = Base(MODEL, SIZE).level(LEVEL), Unblended(MODEL, SIZE).level(LEVEL)
    assert not (blended != plain)[~inside(loops.RUN * 28)].any()
    far = space.build([wide(), newer(lambda x, y: hills(x, y) + 400)])
    blended, plain = Base(far, SIZE).level(LEVEL), Unblended(far, SIZE).level(LEVEL)
    assert not (blended != plain)[~inside(SIZE / 8)].any()
    assert steepest(blended) < 2 * 1.717 * 400 / (SIZE / 8)


def test_order_does_not_count_and_removing_restores() -> None:
    """SPEC PW64: from any base before, to the bit."""
    alone = Base(space.build([wide()]), SIZE)
    before = {level: alone.level(level).copy() for level in (3, LEVEL)}
    orders = [(newer(), third()), (third(), newer())]
    found = []
    for order in orders:
        base = alone
        for one in order:
            base = Base(base.model.with_(one), SIZE, base)
            base.level(LEVEL)
        found.append(base.level(LEVEL))
    expected = Base(space.build([third(), wide(), newer()]), SIZE).level(LEVEL)
    assert all(np.array_equal(level, expected) for level in found)
    for name in ("bbbbbbbb", "cccccccc"):
        base = Base(base.model.without(name), SIZE, base)
    for level, heights in before.items():
        assert np.array_equal(base.level(level), heights)


def test_a_change_is_told_with_its_reach() -> None:
    """SPEC PW65: what differs lies in the rectangle that is told, and ground far from it is taken over."""
    base = Base(MODEL, SIZE)
    for model in (
        MODEL.with_(third()),
        MODEL.with_(newer(lambda x, y: risen(x, y) + 6)),
        MODEL.without("bbbbbbbb"),
        MODEL.with_(newer(anchor=(300.0, 330.0))),
    ):
        base.level(LEVEL)
        after = Base(model, SIZE, base)
        expected = Base(model, SIZE)
        assert np.array_equal(after.level(LEVEL), expected.level(LEVEL))
        rect = after.changed(base)
        assert rect is not None
        differ = np.argwhere(after.level(LEVEL) != base.level(LEVEL)) * SPACING
        (y0, x0), (y1, x1) = differ.min(axis=0), differ.max(axis=0)
        assert rect.x0 <= x0 <= x1 <= rect.x1
        assert rect.y0 <= y0 <= y1 <= rect.y1
        base = after


def test_windows_levels_and_places_see_one_ground() -> None:
    """SPEC PW66: windows to the bit; places nearly, derivatives by differences."""
    model = space.build([wide(), newer(), third()])
    base = Base(model, SIZE)
    whole = base.level(LEVEL)
    part = Base(model, SIZE).window(LEVEL, slice(413, 500), slice(301, 433))
    assert np.array_equal(part, whole[413:500, 301:433])
    fine = base.window(8, slice(413 * 16, 413 * 16 + 33), slice(301 * 16, 301 * 16 + 33))
    assert np.abs(fine[::16, ::16] - whole[413:416, 301:304]).max() < 0.05
    points, h = np.random.default_rng(3).uniform(250, 950, (1500, 2)), 0.01
    found = base.sample(points, derivatives=True)
    assert found.gradient is not None
    assert found.hessian is not None
    at = np.round(points / SPACING)
    nodes = base.sample(at * SPACING).heights
    assert np.abs(nodes - whole[at[:, 1].astype(int), at[:, 0].astype(int)]).max() < 0.3
    ends = [base.sample(shifted(points, *d), derivatives=True) for d in ((h, 0), (-h, 0), (0, h), (0, -h))]
    east, west, north, south = (end.heights for end in ends)
    assert np.abs((east - west) / (2 * h) - found.gradient[:, 0]).max() < 5e-3
    assert np.abs((north - south) / (2 * h) - found.gradient[:, 1]).max() < 5e-3
    steep, other = ends[0].gradient, ends[1].gradient
    assert steep is not None
    assert other is not None
    assert np.quantile(np.abs((steep - other) / (2 * h) - found.hessian[:, :2]), 0.99) < 1e-3


def test_compiled_loops_give_what_the_twin_gives() -> None:
    """SPEC PW67."""
    seam_blend = SeamBlend(MODEL, SIZE)
    border = border_of(MODEL.layers[1])
    points, weight, difference, _ = seam_blend.differences(1)
    assert np.abs(difference - 20 - 8 * np.sin(points[:, 0] / 150)).max() < 1
    zone = seam_blend.zones[1]
    rng = np.random.default_rng(1)
    at = rng.uniform(200, 900, (400, 2))
    at = np.concatenate([at, points[rng.integers(0, len(points), 200)] + rng.normal(0, 8, (200, 2))])
    plain = reference.corrections(points, weight, difference, zone.pitch, zone.cell, zone.cap, at)
    compiled = seam_blend.corrections(1, at)
    assert np.abs(plain).max() > 10
    assert np.abs(plain - compiled).max() < 1e-3
    jets = np.zeros((len(at), 6))
    loops.correction_jets(seam_blend.tables, 0, at, 0, len(at), jets)
    assert np.allclose(jets[:, 0], compiled, atol=1e-9)
    assert np.abs(border.weight.sum() - 8 * (ROWS + COLS)) < 1e-6


def test_the_border_goes_around_nodata() -> None:
    """SPEC PW63: a side of a cell is of it where a valid sample meets one that is none; none twice, none left out."""
    rng = np.random.default_rng(5)
    heights = rng.normal(size=(60, 75))
    heights[rng.random(heights.shape) < 0.05] = np.nan
    heights[20:40, 30:50] = np.nan
    one = placed(heights, spacing_m=(2.0, 3.0), anchor=(7.0, 9.0))
    border = border_of(space.build([one]).layers[0])
    valid = np.pad(~np.isnan(heights), 1)
    upright, level = (valid != np.roll(valid, 1, axis=axis) for axis in (1, 0))
    assert border.weight.sum() == 3.0 * upright.sum() + 2.0 * level.sum()
    expected = [(c - 1.5, r - 1.0) for r, c in np.argwhere(upright)] + [
        (c - 1.0, r - 1.5) for r, c in np.argwhere(level)
    ]
    found = (border.points - (7.0, 9.0)) / (2.0, 3.0)
    assert sorted(map(tuple, np.round(found, 6).tolist())) == sorted(expected)


def test_no_layers_and_no_overlap_bend_nothing() -> None:
    far = newer(anchor=(5000.0, 5000.0))
    for model in (space.build([]), space.build([wide()]), space.build([wide(), far])):
        assert not SeamBlend(model, SIZE).zones


def test_differences_are_those_to_the_ground_below_as_it_was_bent() -> None:
    """SPEC PW64: of three layers the second counts where it lies, and the first, raised to meet it, beside it."""
    model = space.build([wide(), newer(), third()])
    points, _, difference, _ = SeamBlend(model, SIZE).differences(2)
    x, y = points[:, 0], points[:, 1]
    turn = np.radians(27.0)
    u, v = np.cos(turn) * (x - 380) + np.sin(turn) * (y - 250), -np.sin(turn) * (x - 380) + np.cos(turn) * (y - 250)
    beyond = np.maximum(np.maximum(-u, u - (COLS - 1) * 4.0), np.maximum(-v, v - (ROWS - 1) * 4.0))
    there, beside, far = beyond < -8, (beyond > 8) & (beyond < 16), beyond > loops.RUN * 28
    assert min(there.sum(), beside.sum(), far.sum()) > 5
    assert np.abs(difference + 35 + 8 * np.sin(x / 150))[there].max() < 1
    assert np.abs(difference + 35 + 8 * np.sin(x / 150))[beside].max() < 6
    assert np.abs(difference + 15)[far].max() < 1


def test_where_the_older_ground_ends_the_border_counts_in_part() -> None:
    """SPEC PW63: no more than the older layer covers there, and nothing beyond."""
    model = space.build([wide(), newer(anchor=(1000.0, 300.0))])
    found, border = SeamBlend(model, SIZE).differences(1), border_of(model.layers[1])
    whole = {(x, y): w for (x, y), w in zip(border.points.tolist(), border.weight.tolist(), strict=True)}
    share = found.weight / np.array([whole[x, y] for x, y in found.points.tolist()])
    assert len(found.points) < len(border.points)
    assert share.max() == pytest.approx(1)
    assert ((share > 0.05) & (share < 0.95)).any()


def test_what_is_taken_over_is_of_the_same_domain() -> None:
    """SPEC PW65: the reach of a correction is a share of the domain, too."""
    model = space.build([wide(), newer(lambda x, y: hills(x, y) + 200)])
    at = np.random.default_rng(2).uniform(200, 900, (200, 2))
    before, fresh = SeamBlend(model, SIZE), SeamBlend(model, SIZE / 2)
    assert np.array_equal(SeamBlend(model, SIZE / 2, before).corrections(1, at), fresh.corrections(1, at))
    assert not np.array_equal(before.corrections(1, at), fresh.corrections(1, at))
