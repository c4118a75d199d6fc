"""Rasters: mipmaps and own errors against their twins, which patches there are, the stored form (SPEC PW1 to PW5)."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from esker.patchwork.lod import layer_patches
from esker.patchwork.raster import errors_reference as reference
from esker.patchwork.raster import mipmaps, patches, rasters
from esker.patchwork.raster.rasters import Raster, RasterError
from esker.patchwork.raster.samples import cut
from tests.patchwork.model_scenes import Floats, bend, land, layer

RNG = np.random.default_rng(7)


def grid(rows: int, cols: int, hole: bool = False) -> Floats:
    v, u = np.indices((rows, cols)).astype(float)
    heights = land(u * 10.0, v * 10.0) + RNG.normal(0, 1, (rows, cols))
    if hole:
        heights[rows // 2 : rows // 2 + 5, cols // 3 : cols // 3 + 9] = np.nan
        heights[3, 3] = np.inf
        heights[-1, -3:] = np.nan
    return heights


@pytest.mark.parametrize(("rows", "cols"), [(64, 64), (65, 97), (29, 113), (5, 60), (4, 4), (28, 28), (57, 56)])
@pytest.mark.parametrize("hole", [False, True])
def test_mipmaps_are_means_of_what_is_valid(rows: int, cols: int, hole: bool) -> None:
    """SPEC PW1."""
    raster = rasters.build(grid(rows, cols, hole and rows > 20))
    twin = reference.mipmaps(raster.heights.astype(float))
    assert [mip.shape for mip in raster.mips] == [mip.shape for mip in twin] == mipmaps.shapes(rows, cols)
    for mip, plain in zip(raster.mips, twin, strict=True):
        np.testing.assert_allclose(mip, plain, rtol=0, atol=1e-4)


@pytest.mark.parametrize("hole", [False, True])
@pytest.mark.parametrize("bent", [False, True])
@pytest.mark.parametrize(("rows", "cols"), [(120, 131), (57, 250)])
def test_own_errors_are_as_defined(rows: int, cols: int, bent: bool, hole: bool) -> None:
    """SPEC PW2, PW3: every patch of every scale, plain grids by one loop, holed and bent ones by another."""
    warp = bend(layer("x", rows, cols), 4.0, RNG) if bent else None
    raster = rasters.build(grid(rows, cols, hole), warp)
    twin = tuple(mip.astype(float) for mip in raster.mips)
    for scale, table in enumerate(raster.errors.tables):
        for j, i in np.argwhere(~np.isnan(table)).tolist():
            assert table[j, i] == pytest.approx(reference.patch_error(twin, raster.warp, scale, j, i), abs=2e-4)
    for box, measured in zip(raster.errors.rim, raster.errors.rim_errors, strict=True):
        assert measured == pytest.approx(reference.rim_error(twin[0], raster.warp, box), abs=2e-4)
    assert len(raster.errors.rim) > 5 if hole else len(raster.errors.rim) == 0
    tables = sum(int((~np.isnan(t)).sum()) for t in raster.errors.tables)
    assert raster.errors.count == tables + len(raster.errors.rim) > 0


def kernels(raster: Raster, scale: int) -> list[tuple[slice, slice]]:
    """Samples in the kernels of a scale."""
    step = 7 << scale
    found = np.argwhere(~np.isnan(raster.errors.tables[scale])).tolist()
    return [(slice(j * step, (j + 1) * step), slice(i * step, (i + 1) * step)) for j, i in found]


def test_small_patches_beside_nodata() -> None:
    """SPEC PW4: no kernel holds nodata; of the grid's level each whole block of 7 samples is in exactly one kernel."""
    raster = rasters.build(grid(130, 143, hole=True))
    for scale in range(len(raster.errors.tables)):
        assert not any(np.isnan(raster.heights[at]).any() for at in kernels(raster, scale))
    held = np.zeros(raster.heights.shape, int)
    for scale in range(patches.SMALL_SCALES + 1):
        for at in kernels(raster, scale):
            held[at] += 1
    for j in range(0, 130, 7):
        for i in range(0, 143, 7):
            block = slice(j, j + 7), slice(i, i + 7)
            whole = not np.isnan(raster.heights[block]).any()
            assert (held[block] == whole).all()
    assert raster.errors.tables[0].size
    assert not rasters.build(grid(130, 143)).errors.tables[0].size


def test_bent_lattices_have_no_patches_that_bend_too_far() -> None:
    """SPEC PW5: coarse kernels are made where their edges are straight to a quarter cell, fine ones always."""
    warp = bend(layer("x", 400, 400), 40.0, np.random.default_rng(3))
    raster = rasters.build(grid(400, 400), warp)
    plain = rasters.build(grid(400, 400))
    made, full = raster.errors.count, plain.errors.count
    assert made != full
    for scale, table in enumerate(raster.errors.tables):
        j, i = np.nonzero(~np.isnan(table))
        if len(j) and scale:
            laid = patches.lay(400, 400, raster.warp, scale, j, i)
            assert laid.bend.max() <= 0.25 * (1 << patches.level_of(scale))
    held = np.zeros((400, 400), int)
    for scale in range(patches.SMALL_SCALES + 1):
        for at in kernels(raster, scale):
            held[at] += 1
    assert (held == 1).all()


def test_neighbours_share_their_corners() -> None:
    """SPEC PW5: bent kernels meet without a gap, bit for bit."""
    warp = bend(layer("x", 120, 120), 6.0, RNG)
    j, i = (index.ravel() for index in np.indices((5, 5)))
    laid = patches.lay(120, 120, warp, 2, j, i).kernel.reshape(5, 5, 4, 2)
    assert np.array_equal(laid[:, :-1, 1], laid[:, 1:, 0])
    assert np.array_equal(laid[:-1, :, 2], laid[1:, :, 1])


@pytest.mark.parametrize("bent", [False, True])
def test_a_raster_comes_back_from_disk(tmp_path: Path, bent: bool) -> None:
    """SPEC PW5: written, read and built out of core: the same bits and the same name."""
    heights = grid(100, 130, hole=True).astype(np.float32)
    warp = bend(layer("x", 100, 130), 4.0, RNG) if bent else None
    raster = rasters.build(heights, warp)
    rasters.write(tmp_path / "a", raster)
    mapped = np.lib.format.open_memmap(tmp_path / "in.npy", "w+", np.float32, heights.shape)
    mapped[:] = heights
    elsewhere = rasters.build_out_of_core(mapped, tmp_path / "b", warp)
    (tmp_path / "c").mkdir()
    shutil.move(tmp_path / "in.npy", tmp_path / "c" / "heights.npy")
    inplace = np.load(tmp_path / "c" / "heights.npy", mmap_mode="r+")
    rasters.build_out_of_core(inplace, tmp_path / "c", warp)
    for other in (rasters.read(tmp_path / "a"), elsewhere, rasters.read(tmp_path / "b"), rasters.read(tmp_path / "c")):
        assert other.digest == raster.digest
        assert rasters.verify(other)
        assert other.facts() == raster.facts()
        for mine, theirs in zip(
            (*raster.mips, *raster.errors.tables), (*other.mips, *other.errors.tables), strict=True
        ):
            assert mine.tobytes() == theirs.tobytes()
        assert not other.heights.flags.writeable


def test_the_name_is_that_of_the_content() -> None:
    """SPEC PW5: heights, shape and net name a raster; the sort of NaN does not."""
    heights = grid(40, 40)
    assert rasters.build(heights).digest == rasters.build(heights.astype(np.float32)).digest
    assert rasters.build(heights).digest != rasters.build(heights + 1).digest
    assert rasters.build(heights).digest != rasters.build(heights, np.zeros((2, 2, 2))).digest
    assert rasters.build(heights[:20]).digest != rasters.build(heights[:20].reshape(40, 20)).digest
    strange = heights.astype(np.float32)
    strange[0, 0] = np.nan
    other = strange.copy()
    other.view(np.uint32)[0, 0] = 0xFFC01234
    assert rasters.build(strange).digest == rasters.build(other).digest
    assert rasters.digest(strange, None) == rasters.digest(other, None) == rasters.build(strange).digest


@pytest.mark.parametrize(
    ("heights", "says"),
    [
        (np.zeros((3, 50)), "at least 4"),
        (np.zeros(50), "rows and columns"),
        (np.full((9, 9), np.nan), "no data"),
        (np.zeros((9, 9), complex), "numbers"),
        (np.broadcast_to(np.float32(0), (1 << 15, 1 << 15)), "more than"),
    ],
)
def test_what_is_no_grid_is_refused(heights: Floats, says: str) -> None:
    with pytest.raises(RasterError, match=says):
        rasters.build(heights)
    with pytest.raises(RasterError, match="net"):
        rasters.build(np.zeros((9, 9)), np.zeros((1, 4, 2)))


def test_a_broken_directory_is_refused(tmp_path: Path) -> None:
    """SPEC PW5: whatever is missing, cut short or of another shape is told, never mapped."""
    good = tmp_path / "good"
    rasters.write(good, rasters.build(grid(80, 70, hole=True)))
    for path in sorted(good.iterdir()):
        for harm in ("missing", "short", "shape"):
            bad = tmp_path / "bad"
            shutil.copytree(good, bad, dirs_exist_ok=True)
            target = bad / path.name
            if harm == "missing":
                target.unlink()
            elif harm == "short":
                target.write_bytes(target.read_bytes()[:-9])
            elif path.suffix == ".npy":
                np.save(target, np.zeros((5, 2), np.float32))
            else:
                target.write_text(json.dumps({"format": 99}))
            with pytest.raises(RasterError):
                rasters.read(bad)
            shutil.rmtree(bad)
    with pytest.raises(RasterError):
        rasters.read(tmp_path / "nowhere")


def test_progress_tells_its_stages() -> None:
    seen: list[tuple[str, float]] = []
    rasters.build(grid(120, 120), progress=lambda stage, share: seen.append((stage, share)))
    assert [stage for stage, share in seen if share == 1.0] == ["mipmaps", "errors"]
    assert all(0 <= share <= 1 for _, share in seen)


def cut_of(heights: Floats, row: int, col: int, side: int) -> Floats:
    block = np.empty((side, side), np.float32)
    cut(heights.astype(np.float32), row, col, block, False)
    return block.astype(float)


def test_samples_beyond_the_grid_and_in_nodata_are_those_of_the_twin() -> None:
    """SPEC PW4: at every border and corner, with far more patch than grid, beside nodata, in thin strips."""
    heights = grid(60, 64)
    heights[20:, 41:] = np.nan
    heights[RNG.random(heights.shape) < 0.03] = np.nan
    places = [(-2, -2), (12, 15), (18, 36), (40, 38), (50, -2), (56, 20), (-2, 55)]
    for of, where in ((heights, places), (heights[:2, :9], [(-2, -2)]), (grid(5, 3), [(-2, -2), (2, 1)])):
        for row, col in where:
            want = reference.patch_samples(of, row, col, 18)
            np.testing.assert_allclose(cut_of(of, row, col, 18), want, atol=1e-3)


def test_planes_go_on_and_peaks_do_not() -> None:
    """SPEC PW4: a plane beyond the border and around nodata is the plane; no sample that is needed leaves the heights
    by more than their range, however rough they are."""
    row, col = np.indices((40, 50)).astype(float)
    plane = 300 + 7 * col - 4 * row
    holed = plane.copy()
    holed[12:20, 14:26] = np.nan
    holed[5, 5] = holed[0, 30] = np.nan
    for of, r, c in ((plane, -2, -2), (plane, 26, 38), (holed, 3, 3), (holed, 18, 12), (holed, -2, 24)):
        v, u = np.mgrid[r : r + 18, c : c + 18]
        near = (slice(0, 16), slice(0, 16)) if np.isnan(of).any() else (slice(None), slice(None))
        np.testing.assert_allclose(cut_of(of, r, c, 18)[near], (300 + 7 * u - 4 * v)[near], atol=1e-2)
    noise = np.random.default_rng(1).uniform(-1, 1, (40, 50))
    for r, c in ((-2, -2), (-2, 36), (26, -2)):
        inner = cut_of(noise, r, c, 18)[:16] if r < 0 else cut_of(noise, r, c, 18)[2:]
        assert np.abs(inner).max() < 3


@pytest.mark.parametrize("turn", [0.0, 90.0, 180.0, 270.0, -90.0, 30.0, -117.0, 360.0])
def test_layers_turn_counter_clockwise(turn: float) -> None:
    """SPEC PW5: sample [row, col] lies at anchor + R(turn) (col sx, row sy); quarter turns are exact."""
    of = layer("x", 9, 9, anchor=(100.0, 50.0), rotation_deg=turn, spacing_m=(3.0, 5.0))
    c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    at = layer_patches.mapped(layer_patches.affine(of), np.array([[2.0, 0.0], [0.0, 2.0]]))
    np.testing.assert_allclose(at, [[100 + 6 * c, 50 + 6 * s], [100 - 10 * s, 50 + 10 * c]], atol=1e-9)
    if turn % 90 == 0:
        assert np.array_equal(at, np.round(at))
