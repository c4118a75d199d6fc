"""Blending: twins, exactness, continuity (SPEC PW40 to PW46)."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from esker.patchwork.blend import lattice as blend
from esker.patchwork.blend import points as blend_points
from esker.patchwork.blend import reference, splines
from esker.patchwork.blend.lattice import Lattice
from esker.patchwork.lod import space
from esker.patchwork.query.queries import Index
from esker.solve.opencl.device import Device, open_device
from tests.patchwork.blend_scenes import Floats, placed, places, plane, rough, sampled, shifted, three_layers

KINDS = pytest.mark.parametrize("smooth", [False, True], ids=["bilinear", "bicubic"])
TOLERANCES = (0.0, 6.0, 40.0)
MODEL = three_layers()
INDEX = Index(MODEL)


@pytest.fixture(scope="module")
def device() -> Device:
    found = open_device()
    if found is None:
        pytest.skip("no OpenCL device: the compiled loops are tested by themselves")
    return found


def lattice_points(lattice: Lattice) -> Floats:
    rows, cols = np.mgrid[lattice.row0 : lattice.row1, lattice.col0 : lattice.col1] * lattice.spacing
    return np.stack([cols.ravel(), rows.ravel()], axis=1)


def scattered(count: int, seed: int = 0) -> Floats:
    return np.random.default_rng(seed).uniform(-400, 4000, (count, 2))


def test_spline_coefficients_are_those_of_the_definition() -> None:
    """SPEC PW40."""
    rng = np.random.default_rng(3)
    for side in (11, 18, 32):
        samples = rng.normal(size=(side, side)) * 100
        out = np.zeros((splines.STRIDE, splines.STRIDE), dtype=np.float32)
        splines.prefilter(samples.copy(), side, out)
        expected = reference.coefficients(samples)
        assert np.abs(out[: side + 2, : side + 2] - expected).max() < 1e-4
        corner = np.array([0.0, side - 1.0, 3.0])
        found = reference.patch_heights(samples, corner, corner[::-1], smooth=True)
        assert found == pytest.approx([samples[3, 0], samples[side - 1, side - 1], samples[0, 3]], abs=1e-9)


@KINDS
def test_the_loops_agree_with_the_twin(smooth: bool) -> None:
    """SPEC PW41."""
    lattice = Lattice(37.0, -5, 100, 3, 104)
    points = lattice_points(lattice)
    for tolerance in TOLERANCES:
        index = INDEX.uniform(tolerance)
        heights, cover = blend.evaluate(blend.pack(MODEL, index, smooth, tolerance), lattice)
        expected, presence, _ = reference.evaluate(MODEL, index, points, smooth, tolerance)
        assert np.abs(cover.ravel() - presence).max() < 2e-5
        there = presence > 1e-3
        assert np.abs(heights.ravel()[there] - expected[there]).max() < 5e-3


@KINDS
def test_the_kernel_agrees_with_the_loops(device: Device, smooth: bool) -> None:
    """SPEC PW41."""
    lattice = Lattice(37.0, 0, 97, 0, 65)
    for tolerance in TOLERANCES:
        packed = blend.pack(MODEL, INDEX.uniform(tolerance), smooth, tolerance)
        heights, cover = blend.evaluate(packed, lattice)
        on_device, presence = blend.evaluate(packed, lattice, device)
        assert np.abs(cover - presence).max() < 1e-5
        assert np.abs(heights - on_device)[cover > 1e-3].max() < 5e-3


@KINDS
def test_places_agree_with_the_twin(smooth: bool) -> None:
    """SPEC PW41."""
    points = scattered(4000)
    for tolerance in TOLERANCES:
        index = INDEX.uniform(tolerance)
        found = blend_points.evaluate(blend.pack(MODEL, index, smooth, tolerance), points)
        expected, presence, _ = reference.evaluate(MODEL, index, points, smooth, tolerance)
        assert np.abs(found.cover[:, 0] - presence).max() < 1e-12
        there = presence > 1e-9
        assert np.abs(found.heights[there, 0] - expected[there]).max() < 2e-4


@KINDS
def test_a_bin_has_the_same_bits_whatever_is_asked_for_with_it(device: Device, smooth: bool) -> None:
    """SPEC PW42."""
    whole = Lattice(20.0, 0, 160, 0, 160)
    all_of_them = blend.pack(MODEL, INDEX.uniform(6.0), smooth, 6.0)
    rng = np.random.default_rng(8)
    for wanted in (None, device):
        heights, cover = blend.evaluate(all_of_them, whole, wanted)
        for _ in range(8):
            r, c = rng.integers(0, 150, 2)
            part = Lattice(20.0, int(r), int(r) + int(rng.integers(1, 10)), int(c), int(c) + int(rng.integers(1, 10)))
            few = blend.pack(MODEL, INDEX.uniform(6.0, part.rect()), smooth, 6.0)
            assert len(few) < len(all_of_them)
            h, m = blend.evaluate(few, part, wanted)
            rows, cols = slice(part.row0, part.row1), slice(part.col0, part.col1)
            assert np.array_equal(h, heights[rows, cols])
            assert np.array_equal(m, cover[rows, cols])


def test_more_patches_than_the_paper_saw_may_overlap() -> None:
    """SPEC PW43: paper 2 never saw more than six; no number is assumed."""
    layers = [
        sampled(plane, 40, 40, f"layer{k:03}", anchor=(200.0, 200.0), rotation_deg=7.0 * k, accuracy_m=1.0 + 0.1 * k)
        for k in range(10)
    ]
    model = space.build(layers)
    index = np.arange(model.count, dtype=np.int32)
    points = np.random.default_rng(1).uniform(200, 400, (500, 2))
    expected, _, count = reference.evaluate(model, index, points, smooth=True)
    assert count.max() > 12
    found = blend_points.evaluate(blend.pack(model, index, smooth=True), points)
    there = count > 0
    assert np.abs(found.heights[there, 0] - expected[there]).max() < 1e-4


@KINDS
def test_a_tilted_plane_is_reproduced(smooth: bool) -> None:
    """SPEC PW44: across patches of two layers, at the edges of a grid, too, and around nodata."""
    layers = [
        sampled(plane, 150, 150, "aaaaaaaa", anchor=(-1000.0, -1000.0), spacing_m=(40.0, 40.0), accuracy_m=3.0),
        sampled(plane, 90, 90, "bbbbbbbb", anchor=(900.0, 300.0), rotation_deg=31.0, spacing_m=(14.0, 9.0)),
    ]
    x, y = places(90, 90, anchor=(900.0, 300.0), rotation_deg=31.0, spacing_m=(14.0, 9.0))
    holed = plane(x, y)
    holed[30:42, 50:71] = np.nan
    place: dict[str, Any] = {"anchor": (900.0, 1300.0), "rotation_deg": 31.0, "spacing_m": (14.0, 9.0)}
    layers.append(placed(holed, "cccccccc", lift_m=-125.0, **place))
    model = space.build(layers)
    chosen = Index(model).resolved(1.0, 0.0, (0.0, 0.0, 3000.0, 3000.0))
    points = np.random.default_rng(2).uniform(500, 2500, (6000, 2))
    found = blend_points.evaluate(blend.pack(model, chosen, smooth), points)
    assert np.abs(found.heights[:, 0] - plane(*points.T)).max() < 2e-3
    assert np.abs(found.heights[:, 1:3] - [0.2, -0.125]).max() < 2e-3


@KINDS
def test_samples_of_a_perfect_layer_are_reproduced(smooth: bool) -> None:
    """SPEC PW45: at its own sample places, at tolerance 0."""
    fields: dict[str, Any] = {"anchor": (100.0, 50.0), "rotation_deg": 19.0, "spacing_m": (10.0, 15.0)}
    layer = sampled(rough, 75, 100, **fields)
    model = space.build([layer])
    x, y = places(75, 100, **fields)
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    found = blend_points.evaluate(blend.pack(model, Index(model).uniform(0.0), smooth), points)
    assert np.abs(found.heights[:, 0] - layer.raster.heights.ravel()).max() < 1e-3
    assert (found.cover[:, 0] == 1).all()


def sharpest(model: space.Model, smooth: bool, lines: int = 60) -> tuple[Floats, Floats]:
    """Greatest change (6,) of value and derivatives within half a metre, and in the worst hundredth of each such."""
    rng = np.random.default_rng(5)
    packed = blend.pack(model, Index(model).uniform(0.0), smooth, 0.0)
    start, way = rng.uniform(600, 2400, (lines, 2)), rng.normal(size=(lines, 2))
    way /= np.linalg.norm(way, axis=1)[:, None]

    def walked(t: Floats) -> Floats:
        """Changes (lines, steps, 6) along the lines, at distances t (lines, n)."""
        points = start[:, None] + way[:, None] * t[:, :, None]
        found = blend_points.evaluate(packed, points.reshape(-1, 2)).heights
        return np.abs(np.diff(found.reshape(*t.shape, 6), axis=1))

    coarse = np.broadcast_to(np.arange(-400, 401) * 0.5, (lines, 801))
    wide = walked(coarse)
    narrow = np.empty((lines, 6))
    for k in range(6):
        at = np.take_along_axis(coarse, wide[:, :, k].argmax(axis=1)[:, None], axis=1)
        narrow[:, k] = walked(at + np.linspace(0, 0.5, 101))[:, :, k].max(axis=1)
    return wide.max(axis=(0, 1)), narrow.max(axis=0)


@pytest.mark.parametrize(("smooth", "order"), [(False, 0), (True, 2)], ids=["bilinear-C0", "bicubic-C2"])
def test_the_ground_is_as_continuous_as_the_paper_says(smooth: bool, order: int) -> None:
    """SPEC PW46: across three turned layers no derivative up to ``order`` jumps. A jump keeps its size however near one
    looks; what is continuous changes in a hundredth of the way by about a hundredth."""
    wide, narrow = sharpest(MODEL, smooth)
    parts = {0: [0], 1: [1, 2], 2: [3, 4, 5]}
    for n in range(order + 1):
        assert (narrow[parts[n]] < 0.1 * wide[parts[n]] + 1e-6).all(), n


def test_facets_of_bilinear_patches_are_seen() -> None:
    """The test above can fail: the slope of bilinear patches jumps at every sample."""
    wide, narrow = sharpest(space.build([MODEL.placed[0]]), smooth=False, lines=20)
    assert narrow[0] < 0.1 * wide[0]
    assert (narrow[1:3] > 0.9 * wide[1:3]).all()


def test_derivatives_are_those_of_the_heights() -> None:
    """SPEC PW46."""
    points, h = scattered(1500, 9), 1e-2
    packed = blend.pack(MODEL, INDEX.uniform(6.0), True, 6.0)

    def at(dx: float, dy: float) -> blend_points.Places:
        return blend_points.evaluate(packed, shifted(points, dx * h, dy * h))

    middle, east, west, north, south = at(0, 0), at(1, 0), at(-1, 0), at(0, 1), at(0, -1)
    ne, sw, nw, se = at(1, 1), at(-1, -1), at(-1, 1), at(1, -1)
    for which, bound in (("heights", 2e-5), ("cover", 1e-6)):
        f, e, w, n, s = (getattr(p, which) for p in (middle, east, west, north, south))
        diagonal = [getattr(p, which)[:, 0] for p in (ne, sw, nw, se)]
        there = middle.cover[:, 0] > 1e-2
        expected = [
            (e[:, 0] - w[:, 0]) / (2 * h),
            (n[:, 0] - s[:, 0]) / (2 * h),
            (e[:, 0] + w[:, 0] - 2 * f[:, 0]) / h**2,
            (diagonal[0] + diagonal[1] - diagonal[2] - diagonal[3]) / (4 * h**2),
            (n[:, 0] + s[:, 0] - 2 * f[:, 0]) / h**2,
        ]
        for k, value in enumerate(expected):
            worst = np.quantile(np.abs(f[:, k + 1] - value)[there], 0.99)
            assert worst < bound * (1 + np.abs(value[there]).max()), (which, k)
