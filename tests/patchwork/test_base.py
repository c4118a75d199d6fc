"""The base: levels, windows, what lies beyond the data, reuse (SPEC PW50 to PW58)."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from numpy.typing import NDArray

from esker import grid
from esker.contract import BASE_SURVEY
from esker.patchwork.base import Base
from esker.patchwork.lod import space
from esker.patchwork.lod.space import Model, Placed
from tests.patchwork.blend_scenes import Floats, placed, places, plane, rough, sampled, shifted, three_layers

SIZE = 4096.0
MODEL = three_layers()
FINE = sampled(rough, 90, 110, "dddddddd", anchor=(1500.0, 1200.0), rotation_deg=12.0, spacing_m=(4.0, 4.0))
"""An island of fine data in nothing."""


def clamped(level: NDArray[np.float32], rows: slice, cols: slice) -> NDArray[np.float32]:
    last = len(level) - 1
    row, col = (np.clip(np.arange(s.start, s.stop), 0, last) for s in (rows, cols))
    return np.asarray(level[np.ix_(row, col)])


@pytest.mark.parametrize("model", [MODEL, space.build([FINE])], ids=["three layers", "island"])
def test_windows_are_parts_of_levels(model: Model) -> None:
    """SPEC PW50: bit for bit, in any order, from a base that has made the level and from one that has not."""
    whole, fresh = Base(model, SIZE), Base(model, SIZE)
    rng = np.random.default_rng(0)
    for level in (5, 0, 3, 4, 2):
        n = grid.samples(level)
        samples = whole.level(level)
        assert samples.shape == (n, n)
        assert samples.dtype == np.float32
        assert np.isfinite(samples).all()
        assert not samples.flags.writeable
        for _ in range(6):
            (r, c), (h, w) = rng.integers(-20, n, 2).tolist(), rng.integers(1, 90, 2).tolist()
            rows, cols = slice(r, r + h), slice(c, c + w)
            assert np.array_equal(fresh.window(level, rows, cols), clamped(samples, rows, cols)), (level, rows, cols)


def test_windows_of_fine_levels_do_not_depend_on_each_other() -> None:
    """SPEC PW50: overlapping windows share bits far below whole levels, with data, at its border and beyond."""
    model = space.build([FINE])
    rng = np.random.default_rng(1)
    for level in (7, 10, 14):
        s = grid.spacing(level, SIZE)
        for x, y in ((1600.0, 1400.0), (1500.0, 1200.0), (900.0, 1000.0)):
            r, c = int(y / s), int(x / s)
            big = Base(model, SIZE).window(level, slice(r - 60, r + 60), slice(c - 60, c + 60))
            assert np.isfinite(big).all()
            other = Base(model, SIZE)
            for _ in range(4):
                a, b = (int(v) for v in rng.integers(0, 90, 2))
                part = other.window(level, slice(r - 60 + a, r - 60 + a + 17), slice(c - 60 + b, c - 60 + b + 30))
                assert np.array_equal(part, big[a : a + 17, b : b + 30]), (level, x, y)


def test_threads_may_ask_at_once() -> None:
    """SPEC PW50."""
    expected, base = Base(MODEL, SIZE), Base(MODEL, SIZE)
    asked = [(4, slice(r, r + 100), slice(c, c + 120)) for r in range(0, 900, 150) for c in range(0, 900, 150)]
    with ThreadPoolExecutor(6) as pool:
        found = list(pool.map(lambda a: base.window(*a), asked))
    for (level, rows, cols), window in zip(asked, found, strict=True):
        assert np.array_equal(window, clamped(expected.level(level), rows, cols))


def test_bad_questions_are_refused() -> None:
    base = Base(MODEL, SIZE)
    for level in (-1, 7):
        with pytest.raises(ValueError, match="level"):
            base.level(level)
    with pytest.raises(ValueError, match="level"):
        base.window(18, slice(0, 4), slice(0, 4))
    with pytest.raises(ValueError, match="empty"):
        base.window(3, slice(4, 4), slice(0, 4))
    with pytest.raises(ValueError, match="finite"):
        base.sample(np.array([[0.0, np.nan]]))
    with pytest.raises(ValueError, match="tolerance"):
        base.sample(np.zeros((1, 2)), tolerance=-1)


def test_levels_keep_their_tolerance() -> None:
    """SPEC PW51: against the data: a quarter of a sample's spacing, and the data itself where samples are finer."""
    model = space.build([sampled(plane_with_hills, 420, 420, anchor=(-50.0, -50.0), spacing_m=(10.0, 10.0))])
    base = Base(model, SIZE)
    assert base.spacing_m == 10.0
    assert [base.tolerance(level) for level in (0, 1, 2, 3)] == [16.0, 8.0, 4.0, 2.0]
    for level in range(5):
        x, y = np.meshgrid(*[np.arange(grid.samples(level)) * grid.spacing(level, SIZE)] * 2)
        error = np.abs(base.level(level) - plane_with_hills(x, y))
        exact = grid.spacing(level, SIZE) < 20  # no patch of the data's mipmaps is as fine
        assert error.max() < (0 if exact else base.tolerance(level)) + 1.0, level


def plane_with_hills(x: Floats, y: Floats) -> Floats:
    """Smooth at 10 m: a spline errs by a metre at most."""
    return np.asarray(plane(x, y) + 40 * np.sin(x / 120) * np.cos(y / 90))


def test_beyond_the_data_is_no_cliff() -> None:
    """SPEC PW52: a plateau at 1,700 m with nodata around it and in it: no height leaves the data's range, no step is
    steeper than the data."""
    heights = 1700 + 20 * np.random.default_rng(2).normal(size=(120, 120)).cumsum(axis=0).cumsum(axis=1) / 300
    row, col = np.mgrid[0:120, 0:120]
    heights[np.hypot(row - 60, col - 55) > 45] = np.nan
    heights[50:70, 30:44] = np.nan
    layer = placed(heights, anchor=(1300.0, 1500.0), rotation_deg=33.0, spacing_m=(8.0, 8.0))
    base = Base(space.build([layer]), SIZE)
    steepest = max(np.nanmax(np.abs(np.diff(heights, axis=axis))) for axis in (0, 1)) / 8.0
    for level in range(6):
        ground = base.level(level)
        assert ground.min() > np.nanmin(heights) - 5, level
        assert ground.max() < np.nanmax(heights) + 5, level
        steps = max(np.abs(np.diff(ground, axis=axis)).max() for axis in (0, 1)) / grid.spacing(level, SIZE)
        assert steps < 2 * steepest, level


def test_beyond_the_data_all_levels_show_one_ground() -> None:
    """SPEC PW52: and it is nearly as high as the data's border near it."""
    base = Base(space.build([FINE]), SIZE)
    last = base.level(6)
    for level in range(6):
        step = 1 << (6 - level)
        assert np.abs(base.level(level) - last[::step, ::step]).max() < max(base.tolerance(level), 1.0) * 4


def test_a_grid_smaller_than_a_cell_is_no_spike() -> None:
    """SPEC PW52: 40 m of data at 900 m in a domain of 4 km, in no sample of the coarse levels."""
    layer = placed(np.full((20, 20), 900.0), anchor=(2010.0, 2013.0), spacing_m=(2.0, 2.0))
    base = Base(space.build([layer]), SIZE)
    for level in range(6):
        assert np.abs(base.level(level) - 900).max() < 0.1, level


def test_a_grid_between_all_samples_of_the_anchor_is_no_spike() -> None:
    """SPEC PW52: 4 m of data at 900 m in a domain of 65 km, which no sample of the first ten levels meets."""
    layer = placed(np.full((9, 9), 900.0), anchor=(30_050.0, 30_060.0), spacing_m=(0.5, 0.5))
    base = Base(space.build([layer]), 65_536.0)
    for level in (0, 3, 5):
        assert np.abs(base.level(level) - 900).max() < 0.1, level
    for level in (10, 14):
        at = round(30_052 / grid.spacing(level, 65_536.0))
        assert np.abs(base.window(level, slice(at - 40, at + 40), slice(at - 40, at + 40)) - 900).max() < 0.1, level


def test_places_see_what_levels_show() -> None:
    """SPEC PW53: `sample` at the samples of a level finer than the data."""
    base = Base(space.build([FINE]), SIZE)
    rows, cols = np.mgrid[1100:1900:7, 1300:2100:7]
    points = np.stack([cols.ravel(), rows.ravel()], axis=1) * (SIZE / 4096)
    found = base.sample(points)
    level = base.level(6)[rows.ravel(), cols.ravel()]
    assert np.abs(found.heights - level).max() < 2
    assert np.quantile(np.abs(found.heights - level), 0.99) < 0.1
    assert np.abs(found.heights - level)[base.survey(6)[rows.ravel(), cols.ravel()] > BASE_SURVEY].max() < 0.05
    assert found.gradient is None


def test_derivatives_hold_beyond_the_data_too() -> None:
    """SPEC PW53: across the border, by differences."""
    base = Base(space.build([FINE]), SIZE)
    points, h = np.random.default_rng(3).uniform(1300, 2100, (400, 2)), 0.01
    found = base.sample(points, derivatives=True)
    assert found.gradient is not None
    assert found.hessian is not None
    east, west = base.sample(shifted(points, h, 0)).heights, base.sample(shifted(points, -h, 0)).heights
    north, south = base.sample(shifted(points, 0, h)).heights, base.sample(shifted(points, 0, -h)).heights
    assert np.quantile(np.abs((east - west) / (2 * h) - found.gradient[:, 0]), 0.99) < 1e-3
    assert np.quantile(np.abs((north - south) / (2 * h) - found.gradient[:, 1]), 0.99) < 1e-3
    steep, other = (base.sample(shifted(points, d, 0), derivatives=True).gradient for d in (h, -h))
    assert steep is not None
    assert other is not None
    assert np.quantile(np.abs((steep - other) / (2 * h) - found.hessian[:, :2]), 0.98) < 1e-3


def test_the_survey_tells_where_data_is_and_how_fine() -> None:
    """SPEC PW54."""
    base = Base(MODEL, SIZE)
    survey = base.survey(4)
    levels = {p.layer.id: np.log2(SIZE / (64 * np.sqrt(np.prod(p.layer.spacing_m)))) for p in MODEL.placed}
    assert set(np.unique(survey)) == {np.float32(max(v, BASE_SURVEY)) for v in levels.values()} | {
        np.float32(BASE_SURVEY)
    }
    s = grid.spacing(4, SIZE)
    layer = MODEL.placed[2]
    x, y = places(70, 70, anchor=(900.0, 2100.0), rotation_deg=-40.0, spacing_m=(10.0, 10.0))
    assert layer.layer.id == "cccccccc"
    at = np.round(np.stack([y[35, 10], x[35, 10]]) / s).astype(int)
    assert survey[tuple(at)] == np.float32(levels["cccccccc"])
    hole = np.round(np.stack([y[25, 47], x[25, 47]]) / s).astype(int)
    assert survey[tuple(hole)] < levels["cccccccc"]


@pytest.mark.parametrize("level", [0, 2, 3, 4])
def test_what_is_taken_over_from_the_base_before_is_what_would_be_made(level: int) -> None:
    """SPEC PW55: whatever layers come, go, move or change."""
    base, model = Base(MODEL, SIZE), MODEL
    for change in changes():
        base.level(level)
        model = change(model)
        base = Base(model, SIZE, base)
        expected = Base(model, SIZE)
        assert base.digest == expected.digest
        assert np.array_equal(base.level(level), expected.level(level))


def changes() -> list:  # type: ignore[type-arg]
    def moved(model: Model, name: str, **fields: object) -> Model:
        one = next(p for p in model.placed if p.layer.id == name)
        return model.with_(Placed(one.layer.model_copy(update=fields), one.raster))

    return [
        lambda m: m.with_(FINE),
        lambda m: moved(m, "dddddddd", anchor=(1700.0, 1000.0)),
        lambda m: moved(m, "bbbbbbbb", accuracy_m=9.0),
        lambda m: moved(m, "cccccccc", priority=-1),
        lambda m: moved(m, "bbbbbbbb", lift_m=3.0),
        lambda m: m.without("cccccccc"),
        lambda m: m.without("dddddddd"),
    ]


def test_a_change_is_told_where_it_is() -> None:
    """SPEC PW56: nothing differs outside of the rectangle, on any level; and it is no larger than it must be."""
    before = Base(MODEL, SIZE)
    for number, change in enumerate(changes()):
        after = Base(change(before.model), SIZE, before)
        rect = after.changed(before)
        assert rect is not None
        # Level 5 is finer than all data and costs as much as seven changes on the others, so only the first meets it.
        for level in (0, 3, 4) if number else (0, 3, 5):
            s = grid.spacing(level, SIZE)
            differ = np.argwhere(after.level(level) != before.level(level)) * s
            if len(differ):
                (y0, x0), (y1, x1) = differ.min(axis=0), differ.max(axis=0)
                assert rect.x0 <= x0 <= x1 <= rect.x1
                assert rect.y0 <= y0 <= y1 <= rect.y1
        before = after
    assert Base(before.model, SIZE).changed(before) is None


def test_a_small_change_in_much_data_stays_small() -> None:
    """SPEC PW56."""
    wide = sampled(rough, 120, 120, "aaaaaaaa", anchor=(-300.0, -300.0), spacing_m=(40.0, 40.0), accuracy_m=4.0)
    before = Base(space.build([wide]), SIZE)
    after = Base(before.model.with_(FINE), SIZE, before)
    rect = after.changed(before)
    assert rect is not None
    assert (rect.x1 - rect.x0) * (rect.y1 - rect.y0) < 0.25 * SIZE * SIZE


def test_bounds_hold() -> None:
    """SPEC PW57."""
    for model in (MODEL, space.build([FINE])):
        base = Base(model, SIZE)
        for level in range(6):
            assert base.low <= base.level(level).min()
            assert base.level(level).max() <= base.high


def test_no_layers_are_flat_ground() -> None:
    base = Base(space.build([]), SIZE)
    assert not base.level(4).any()
    assert not base.window(9, slice(0, 70), slice(3, 9)).any()
    assert (base.survey(3) == BASE_SURVEY).all()
    assert (base.low, base.high) == (0.0, 0.0)


def test_the_digest_is_of_what_the_ground_follows_from() -> None:
    """SPEC PW58: order and names do not count, places do."""
    names = [p.layer.model_copy(update={"name": "x", "outline": 1.0}) for p in MODEL.placed]
    same = space.build([Placed(n, p.raster) for n, p in zip(names, MODEL.placed, strict=True)][::-1])
    assert Base(same, SIZE).digest == Base(MODEL, SIZE).digest
    seen = {Base(MODEL, SIZE).digest, Base(MODEL, 2 * SIZE).digest}
    model = MODEL
    for change in changes():
        model = change(model)
        seen.add(Base(model, SIZE).digest)
    assert len(seen) == 2 + len(changes())
