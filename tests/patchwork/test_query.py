"""Queries of LOD space (SPEC PW30 to PW35)."""

from __future__ import annotations

import numpy as np
import pytest

from esker.patchwork.blend import reference
from esker.patchwork.lod import space
from esker.patchwork.lod.space import Model
from esker.patchwork.query.quadtree_index import CAPACITY, QuadtreeIndex
from esker.patchwork.query.queries import Bounded, Chosen, Index, Sampled, Surface, View, difference, slope
from tests.patchwork.blend_scenes import Floats, rough, sampled, shifted, three_layers

MODEL = three_layers()
INDEX = Index(MODEL)
ALONE = space.build([sampled(rough, 300, 260, spacing_m=(12.0, 12.0), accuracy_m=0.5)])


def kernels_over(model: Model, index: Chosen, points: Floats) -> np.ndarray:
    """(points, patches): which kernels hold which places (a rectangle in the patch's frame)."""
    out = np.zeros((len(points), len(index)), dtype=bool)
    for at, k in enumerate(index):
        quad = model.kernel[k]
        turn = np.roll(quad, -1, axis=0) - quad
        side = [turn[e, 0] * (points[:, 1] - quad[e, 1]) - turn[e, 1] * (points[:, 0] - quad[e, 0]) for e in range(4)]
        out[:, at] = (np.stack(side) >= -1e-6).all(axis=0)
    return out


def domains_over(model: Model, index: Chosen, points: Floats) -> np.ndarray:
    """(points, patches): which domains hold which places."""
    at = np.einsum("kij,pj->pki", model.to_patch[index, :, :2], points) + model.to_patch[index, :, 2]
    return np.asarray(((at > 0) & (at < model.extent[index])).all(axis=2))


@pytest.mark.parametrize("e", [0.0, 0.5, 1.0, 3.0, 7.5, 20.0, 60.0, 500.0])
def test_a_uniform_query_is_the_definition(e: float) -> None:
    """SPEC PW30: low <= e < max_z, nothing else, however it is asked."""
    expected = np.flatnonzero((MODEL.low <= e) & (e < MODEL.max_z))
    assert np.array_equal(np.sort(INDEX.uniform(e)), expected)
    everywhere = INDEX.uniform(e, (-1e6, -1e6, 1e6, 1e6))
    assert np.array_equal(np.sort(everywhere), expected)
    rng = np.random.default_rng(int(10 * e))
    for _ in range(12):
        x0, y0 = rng.uniform(-500, 4000, 2)
        x1, y1 = x0 + rng.uniform(1, 900), y0 + rng.uniform(1, 900)
        found = set(INDEX.uniform(e, (x0, y0, x1, y1)).tolist())
        grid = np.stack(np.meshgrid(np.linspace(x0, x1, 40), np.linspace(y0, y1, 40)), axis=-1).reshape(-1, 2)
        touched = set(expected[domains_over(MODEL, expected.astype(np.int32), grid).any(axis=0)].tolist())
        assert touched <= found
        # What is found beyond that may only graze the rectangle between the places that were tried.
        step = max(x1 - x0, y1 - y0) / 39 * 1.5
        wider = np.concatenate([shifted(grid, dx, dy) for dx in (-step, 0, step) for dy in (-step, 0, step)])
        assert found <= set(expected[domains_over(MODEL, expected.astype(np.int32), wider).any(axis=0)].tolist())


def looking(rng: np.random.Generator, per_metre: float) -> View:
    return View(
        eye=tuple(rng.uniform(0, 3000, 2)), heading=rng.uniform(0, 2 * np.pi), half_angle=rng.uniform(0.2, 1.2),
        far=rng.uniform(300, 4000), slope=per_metre,
    )  # fmt: skip


def inside(view: View, count: int, rng: np.random.Generator) -> Floats:
    """Places in a view's triangle."""
    cuts = np.asarray(np.sort(rng.uniform(size=(2, count)), axis=0))
    a, b = cuts[0], cuts[1]
    eye, left, right = view.triangle()
    weights = np.stack([a, b - a, 1 - b], axis=1)
    return np.asarray(weights @ np.stack([eye, left, right]))


def check_cut(model: Model, chosen: Chosen, points: Floats, allowed: Floats) -> None:
    """Every place that the model covers is covered; no patch that is blended there is less accurate than allowed."""
    everything = np.arange(model.count, dtype=np.int32)
    coverable = np.asarray(kernels_over(model, everything, points).any(axis=1))
    assert np.asarray(kernels_over(model, chosen, points).any(axis=1))[coverable].all()
    used = domains_over(model, chosen, points)
    assert (np.where(used, model.low[chosen], 0).max(axis=1, initial=0) <= allowed + 1e-9).all()


@pytest.mark.parametrize("model", [ALONE, MODEL], ids=["one layer", "three layers"])
def test_no_view_misses_a_place_or_breaks_its_bound(model: Model) -> None:
    """SPEC PW31: 120 random views, zero violations."""
    index, rng = Index(model), np.random.default_rng(4)
    sizes = []
    for _ in range(60):
        view = looking(rng, 10 ** rng.uniform(-3, -0.5))
        chosen = index.view(view)
        assert len(np.unique(chosen)) == len(chosen)
        points = inside(view, 400, rng)
        check_cut(model, chosen, points, view.tolerance(points))
        sizes.append(len(chosen))
    assert max(sizes) > 20


def test_the_paper_s_cut_breaks_the_bound() -> None:
    """Why PW31 departs from paper 2, section 5.1: boxes that the plane cuts are too coarse in front of the cut."""
    rng, broken = np.random.default_rng(4), 0
    for _ in range(10):
        view = looking(rng, 0.01)
        points = inside(view, 400, rng)
        allowed = view.tolerance(points)
        everything = np.arange(ALONE.count, dtype=np.int32)
        over = domains_over(ALONE, everything, points)
        cut = over & (ALONE.low <= allowed[:, None]) & (allowed[:, None] < ALONE.max_z)
        chosen = everything[cut.any(axis=0)]
        used = domains_over(ALONE, chosen, points)
        broken += int((np.where(used, ALONE.low[chosen], 0).max(axis=1) > allowed).sum())
    assert broken > 20


def test_height_errors_in_a_view_stay_below_a_pixel() -> None:
    """SPEC PW31: measured on heights, against the ground at tolerance 0."""
    index, rng = Index(ALONE), np.random.default_rng(11)
    exact = index.uniform(0.0)
    for _ in range(6):
        view = looking(rng, slope(1.0, 1080, np.radians(45)) * 20)._replace(eye=(1500.0, 1500.0), far=1400.0)
        points = inside(view, 300, rng)
        near, cover, _ = reference.evaluate(ALONE, index.view(view), points, smooth=False)
        best, there, _ = reference.evaluate(ALONE, exact, points, smooth=False)
        known = (cover == 1) & (there == 1)
        # A sample's error is bounded; between samples of the fine grid both interpolate them.
        assert (np.abs(near - best)[known] <= view.tolerance(points)[known] + 2 * 0.5).all()


def surfaces(rng: np.random.Generator) -> list[tuple[Surface, Floats, Floats]]:
    """Surfaces with places in their region and what is allowed there."""
    rect = (200.0, 150.0, 2600.0, 2500.0)
    points = rng.uniform(rect[:2], rect[2:], (500, 2))
    values = rng.uniform(0, 1, (13, 9)) ** 3 * 60
    at = (points - rect[:2]) / (rect[2] - rect[0], rect[3] - rect[1]) * (8, 12)
    i, j = np.minimum(at.astype(int), (7, 11)).T
    f, g = at[:, 0] - i, at[:, 1] - j
    bilinear = (1 - g) * ((1 - f) * values[j, i] + f * values[j, i + 1]) + g * (
        (1 - f) * values[j + 1, i] + f * values[j + 1, i + 1]
    )
    centre = np.array([1300.0, 1400.0])

    def lowest(boxes: Floats) -> Floats:
        nearest = np.clip(centre, boxes[:, :2], boxes[:, 2:])
        return np.asarray(0.03 * np.linalg.norm(nearest - centre, axis=1))

    cone = 0.03 * np.linalg.norm(points - centre, axis=1)
    return [(Sampled(rect, values), points, bilinear), (Bounded(rect, lowest), points, cone)]


@pytest.mark.parametrize("model", [ALONE, MODEL], ids=["one layer", "three layers"])
def test_a_region_may_have_any_tolerance(model: Model) -> None:
    """SPEC PW32."""
    index = Index(model)
    for seed in range(8):
        for surface, points, allowed in surfaces(np.random.default_rng(seed)):
            chosen = index.region(surface)
            check_cut(model, chosen, points, allowed)
            assert len(chosen) < len(index.uniform(0.0))


def test_a_level_surface_chooses_what_a_uniform_query_does() -> None:
    """SPEC PW32: with one tolerance everywhere the safe cut is the minimal one."""
    index = Index(ALONE)
    for e in (0.0, 0.5, 4.0, 30.0, 200.0):
        rect = (700.0, 600.0, 1900.0, 1500.0)
        level = Bounded(rect, lambda boxes, e=e: np.full(len(boxes), e))  # type: ignore[misc]
        found = set(index.region(level).tolist())
        assert set(index.uniform(e, rect).tolist()) == found
        flat = View((1300.0, 1000.0), 0.3, 0.7, 900.0, 0.0, floor=e)
        seen = index.view(flat)
        assert (ALONE.low[seen] <= e).all()
        assert (e < ALONE.max_z[seen]).all()


def test_bad_regions_and_screens_are_refused() -> None:
    for values in (np.zeros(4), -np.ones((3, 3)), np.full((3, 3), np.nan)):
        with pytest.raises(ValueError, match="tolerances"):
            Sampled((0, 0, 1, 1), values)
    with pytest.raises(ValueError, match="region"):
        Sampled((0, 0, 0, 1), np.zeros((2, 2)))
    with pytest.raises(ValueError, match="positive"):
        slope(0, 1080, 1.0)


def test_the_difference_of_two_answers_makes_one_of_the_other() -> None:
    """SPEC PW33: what a client that holds the first answer must be sent."""
    rng = np.random.default_rng(2)
    view = View((1000.0, 1000.0), 0.4, 0.6, 2000.0, 0.01)
    held = set(INDEX.view(view).tolist())
    before = INDEX.view(view)
    for _ in range(20):
        eye = (view.eye[0] + rng.normal() * 60, view.eye[1] + rng.normal() * 60)
        view = view._replace(eye=eye, heading=view.heading + rng.normal() * 0.1)
        after = INDEX.view(view)
        added, removed = difference(before, after)
        assert held.isdisjoint(added.tolist())
        assert held.issuperset(removed.tolist())
        held = (held | set(added.tolist())) - set(removed.tolist())
        assert held == set(after.tolist())
        before = after


def same(a: Index, b: Index) -> None:
    for e in (0.0, 0.7, 5.0, 33.0, 250.0):
        assert np.array_equal(np.sort(a.uniform(e)), np.sort(b.uniform(e)))
    for part, other in ((a.tree, b.tree), (a.boxes, b.boxes)):
        for name in part._fields:
            assert np.array_equal(getattr(part, name), getattr(other, name)), name


def test_an_index_follows_its_model() -> None:
    """SPEC PW34: after layers came, went and moved it equals one that is made anew."""
    layers = {p.layer.id: p for p in MODEL.placed}
    index = Index(space.build([layers["aaaaaaaa"]]))
    model = index.model.with_(layers["cccccccc"])
    index = index.updated(model)
    same(index, Index(model))
    model = model.with_(layers["bbbbbbbb"])
    index = index.updated(model)
    same(index, Index(model))
    moved = layers["bbbbbbbb"].layer.model_copy(update={"anchor": (1300.0, 200.0)})
    model = model.with_(space.Placed(moved, layers["bbbbbbbb"].raster))
    index = index.updated(model)
    same(index, Index(model))
    model = model.without("cccccccc")
    index = index.updated(model)
    same(index, Index(model))
    assert index.updated(model) is index


@pytest.mark.parametrize("model", [ALONE, MODEL], ids=["one layer", "three layers"])
def test_the_paper_s_quadtree_gives_the_same_answers(model: Model) -> None:
    """SPEC PW35."""
    tree, index, rng = QuadtreeIndex(model), Index(model), np.random.default_rng(6)
    for e in (0.0, 0.5, 2.0, 7.5, 30.0, 300.0):
        assert np.array_equal(np.sort(tree.uniform(e)), np.sort(index.uniform(e)))
        for _ in range(6):
            x, y, w, h = *rng.uniform(-400, 3500, 2), *rng.uniform(1, 900, 2)
            rect = (x, y, x + w, y + h)
            assert np.array_equal(np.sort(tree.uniform(e, rect)), np.sort(index.uniform(e, rect)))
    assert 1 <= tree.copies < 2
    assert (np.diff(tree.nodes.start) <= CAPACITY).all()
    for n in range(len(tree.nodes.child)):
        tops = model.max_z[tree.nodes.patch[tree.nodes.start[n] : tree.nodes.start[n + 1]]]
        assert (tops[1:] <= tops[:-1]).all()


def test_no_layers_no_patches() -> None:
    index = Index(space.build([]))
    assert len(index.uniform(0.0)) == len(index.uniform(0.0, (0, 0, 1, 1))) == 0
    assert len(QuadtreeIndex(index.model).uniform(0.0)) == 0
    assert len(index.view(View((0.0, 0.0), 0.0, 0.5, 100.0, 0.1))) == 0
    assert len(index.region(Bounded((0, 0, 1, 1), lambda boxes: np.zeros(len(boxes))))) == 0
