"""The rim: kernels beside nodata, small enough that every valid sample lies in one (SPEC PW4)."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from esker.patchwork.base import Base
from esker.patchwork.lod import space
from esker.patchwork.query.queries import Bounded, Index, View
from esker.patchwork.raster import errors, patches, rasters, rim
from tests.patchwork.model_scenes import Floats, bend, chosen, layer, random_scene, surveyed

Counts = NDArray[np.int64]


def riddled(seed: int, rows: int, cols: int, share: float) -> Floats:
    """A plane with single samples missing, a diagonal coast and a lake."""
    rng = np.random.default_rng(seed)
    v, u = np.indices((rows, cols)).astype(float)
    heights = 3.0 * u - 2.0 * v + 500.0
    heights[rng.random(heights.shape) < share] = np.nan
    heights[v > 0.7 * rows + 0.4 * u] = np.nan
    heights[5:16, 9:22] = np.nan
    return heights


def held(heights: Floats, rim_kernels: rim.Boxes) -> Counts:
    """How many kernels of the grid's own level each sample lies in."""
    raster = rasters.build(heights)
    count = np.zeros(heights.shape, np.int64)
    for scale in range(patches.SMALL_SCALES + 1):
        step = 7 << scale
        for j, i in np.argwhere(~np.isnan(raster.errors.tables[scale])).tolist():
            count[j * step : (j + 1) * step, i * step : (i + 1) * step] += 1
    for row, col, tall, wide in rim_kernels.tolist():
        count[row : row + tall, col : col + wide] += 1
    return count


@pytest.mark.parametrize("share", [0.0, 0.02, 0.2, 0.9])
def test_every_valid_sample_lies_in_one_kernel(share: float) -> None:
    """And no other does, whatever the holes; rectangles keep to the tiling's blocks."""
    for seed, (rows, cols) in enumerate(((64, 71), (20, 130), (9, 8))):
        heights = riddled(seed, rows, cols, share)
        found = rasters.build(heights).errors.rim
        assert np.array_equal(held(heights, found), (~np.isnan(heights)).astype(int))
        assert (found[:, :2] // 7 == (found[:, :2] + found[:, 2:] - 1) // 7).all()


def test_a_grid_without_nodata_has_no_rim() -> None:
    raster = rasters.build(np.ones((50, 60)))
    assert len(raster.errors.rim) == 0
    model = space.build([surveyed(layer("plain", 50, 60))])
    assert np.unique(model.side).tolist() == [patches.side_of(patches.SMALL_SCALES)]


def test_great_rectangles_come_first_and_few_are_needed() -> None:
    """A straight coast takes one rectangle a block."""
    heights = np.ones((28, 70))
    heights[:, 52:] = np.nan
    found = rasters.build(heights).errors.rim
    assert found.tolist() == [[7 * k, 49, 7, 3] for k in range(4)]
    corner = np.ones((7, 7))
    corner[4:, 4:] = np.nan
    assert rasters.build(corner).errors.rim.tolist() == [[0, 0, 4, 7], [4, 0, 3, 4]]


def test_a_riddled_grid_leaves_its_smallest_rectangles_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same ones whoever asks: all from an area on, as many as are allowed."""
    heights = riddled(3, 80, 90, 0.15)
    every = rasters.build(heights).errors.rim
    area = every[:, 2:].prod(axis=1)
    monkeypatch.setattr(rim, "MOST", int((area >= 3).sum()) + 1)
    assert (area == 2).any()
    some = rasters.build(heights).errors.rim
    assert np.array_equal(some, every[area >= 3])
    assert held(heights, some).max() == 1


def test_a_raster_of_an_older_format_is_read(tmp_path: Path) -> None:
    """SPEC PW5: rims and errors are found from its heights; what does not fit them is refused."""
    rows, cols = 60, 66
    warp = bend(layer("x", rows, cols), 3.0, np.random.default_rng(5))
    raster = rasters.build(riddled(4, rows, cols, 0.05), warp)
    rasters.write(tmp_path, raster)
    head = json.loads((tmp_path / rasters.HEAD).read_text())
    stale = raster.errors.tables[2] + np.float32(1)
    np.save(tmp_path / "errors2.npy", stale)
    assert np.array_equal(rasters.read(tmp_path).errors.tables[2], stale, equal_nan=True)
    for older in (2, 1):
        (tmp_path / rasters.HEAD).write_text(json.dumps({**head, "format": older}))
        if older == 1:
            (tmp_path / rasters.RIM).rename(tmp_path / "kept.npy")
        old = rasters.read(tmp_path)
        assert np.array_equal(old.errors.rim, raster.errors.rim)
        assert np.array_equal(old.errors.rim_errors, raster.errors.rim_errors)
        for mine, theirs in zip(raster.errors.tables, old.errors.tables, strict=True):
            assert np.array_equal(mine, theirs, equal_nan=True)
    assert raster.errors.rim_errors.max() > 0
    (tmp_path / rasters.HEAD).write_text(json.dumps(head))
    for strange in (raster.errors.rim + np.int32(5), raster.errors.rim[1:], raster.errors.rim * np.int32(2)):
        np.save(tmp_path / rasters.RIM, strange)
        with pytest.raises(rasters.RasterError, match="rim"):
            rasters.read(tmp_path)


def test_mapped_grids_have_the_bits_of_those_in_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC PW5: in strips of a few rows, with nodata, a bend, both and neither."""
    monkeypatch.setattr("esker.patchwork.raster.paging.STRIP_BYTES", 5000)
    for k, (holes, bent) in enumerate(((0.0, False), (0.03, False), (0.0, True), (0.03, True))):
        heights = riddled(k, 150, 140, holes) if holes else 100 * np.random.default_rng(k).random((150, 140))
        warp = bend(layer("x", 150, 140), 3.0, np.random.default_rng(k)) if bent else None
        one = rasters.build(heights, warp)
        other = rasters.build_out_of_core(heights.astype(np.float32), tmp_path / str(k), warp)
        assert one.digest == other.digest
        for mine, theirs in zip((*one.mips, *one.errors.tables), (*other.mips, *other.errors.tables), strict=True):
            assert mine.tobytes() == theirs.tobytes()
        assert np.array_equal(one.errors.rim, other.errors.rim)
        assert np.array_equal(one.errors.rim_errors, other.errors.rim_errors)


def test_whole_kernels_and_rim_are_found_alike_by_bands() -> None:
    heights = riddled(8, 300, 40, 0.01).astype(np.float32)
    whole = errors.whole_kernels(heights)
    assert whole is not None
    blocks = np.zeros(whole.shape, bool)
    for j, i in np.ndindex(whole.shape):
        blocks[j, i] = not np.isnan(heights[7 * j : 7 * j + 7, 7 * i : 7 * i + 7]).any()
    assert np.array_equal(whole, blocks)


def test_queries_find_the_rim() -> None:
    """SPEC PW30, PW32: in a rectangle, in a view and over a region, the patches that a list of all gives."""
    heights = riddled(6, 90, 100, 0.05)
    model = space.build([surveyed(layer("holed", 90, 100), change=lambda z: np.where(np.isnan(heights), np.nan, z))])
    index = Index(model)
    small = np.flatnonzero(model.layers[0].scale == patches.RIM)
    assert len(small) > 100
    assert np.isin(small, index.uniform(1.0)).all()
    everywhere = (-1e6, -1e6, 1e6, 1e6)
    for e in (0.0, 1.0, 20.0):
        listed = np.sort(index.uniform(e))
        assert np.array_equal(np.sort(index.uniform(e, everywhere)), listed)
        assert np.array_equal(np.sort(index.region(Bounded(everywhere, lambda b, e=e: np.full(len(b), e)))), listed)  # type: ignore[misc]
    view = View((500.0, -2000.0), np.pi / 2, 1.0, 5000.0, 0.0, 1.0)
    assert np.isin(small, index.view(view)).all()
    near = index.uniform(1.0, (300.0, 300.0, 420.0, 380.0))
    assert 0 < len(near) < len(chosen(model, 1.0))


def test_coarse_levels_leave_out_what_lies_between_their_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC PW51: fewer patches, the same bits."""
    heights = riddled(7, 120, 120, 0.05)
    model = space.build([surveyed(layer("holed", 120, 120), change=lambda z: np.where(np.isnan(heights), np.nan, z))])
    index = Index(model)
    whole = (-1e6, -1e6, 1e6, 1e6)
    assert len(index.resolved(200.0, 50.0, whole)) < len(index.uniform(50.0, whole)) / 4
    base = Base(model, 1200.0 / 9 * 8)
    want = [base.level(level).copy() for level in (0, 1)]
    monkeypatch.setattr(Index, "_met", lambda _self, found, _spacing: found)
    every = Base(model, 1200.0 / 9 * 8)
    for level in (0, 1):
        assert np.array_equal(every.level(level), want[level])


def test_samples_beside_nodata_are_ground() -> None:
    """SPEC PW45: at tolerance 0 the surface holds every valid sample, alone in nodata or not."""
    for seed, share in ((1, 0.05), (2, 0.6)):
        heights = riddled(seed, 60, 60, share)
        placed = surveyed(
            layer("holed", 60, 60, anchor=(200.0, 200.0)),
            change=lambda z, h=heights: np.where(np.isnan(h), np.nan, z),  # type: ignore[misc]
        )
        base = Base(space.build([placed]), 1000.0)
        row, col = np.nonzero(~np.isnan(heights))
        at = np.stack([200 + 10.0 * col, 200 + 10.0 * row], 1)
        for smooth in (True, False):
            assert np.abs(base.sample(at, 0.0, smooth).heights - placed.raster.heights[row, col]).max() < 0.02


def test_random_scenes_have_rims() -> None:
    """The scenes of the property tests hold what they are to test."""
    sizes = [sum(len(p.raster.errors.rim) for p in random_scene(seed)) for seed in range(60)]
    assert sum(size > 0 for size in sizes) > 20
