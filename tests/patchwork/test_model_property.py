"""Random scenes of two to five turned grids: what must hold of every model (SPEC PW9 to PW16)."""

from __future__ import annotations

import os

import numpy as np
import pytest

from esker.patchwork.lod import reference
from esker.patchwork.lod.precedence import default_priority, precedence
from esker.patchwork.lod.space import Model, Placed, build
from tests.patchwork.model_scenes import (
    Floats,
    blended,
    chosen,
    inside,
    land,
    layer,
    places,
    random_scene,
    same,
    surveyed,
)

SEEDS = range(200)
ORDERED_EVERY = 1 if os.environ.get("ESKER_LONG") else 2
"""One scene of so many is put together in other orders, which takes a third of the time of all checks.

Each scene tries six orders and changes of its own, so a hundred scenes try six hundred of them.
"""
TOLERANCES = (0.0, 0.5, 2.0, 7.0, 30.0, 200.0)


BLOCKS = [SEEDS[k::8] for k in range(8)]


@pytest.mark.parametrize("block", BLOCKS, ids=lambda block: f"seeds{block.start}by8")
def test_random_scenes(block: range) -> None:
    for seed in block:
        scene = random_scene(seed)
        model = build(scene)
        rng = np.random.default_rng(seed + 1000)
        if seed // len(BLOCKS) % ORDERED_EVERY == 0:
            check_order(scene, model, rng)
        check_cover(model, rng)
        check_need(model, rng)
        check_error(model, rng)


def check_order(scene: list[Placed], model: Model, rng: np.random.Generator) -> None:
    """SPEC PW9, PW10: any order, one by one or at once; the same layer again; a layer gone."""
    grown = build([])
    for k in rng.permutation(len(scene)):
        grown = grown.with_(scene[k])
    assert same(grown, model)
    twice = grown.with_(scene[int(rng.integers(len(scene)))])
    assert same(twice, model)
    gone = scene[int(rng.integers(len(scene)))]
    assert same(twice.without(gone.layer.id), build([p for p in scene if p is not gone]))
    assert same(twice.without(gone.layer.id).with_(gone), model)
    moved = Placed(gone.layer.model_copy(update={"anchor": (33.0, -40.0), "priority": 3}), gone.raster)
    assert same(grown.with_(moved), build([moved if p is gone else p for p in scene]))
    assert same(grown.with_(moved).with_(gone), model)


def check_cover(model: Model, rng: np.random.Generator) -> None:
    """SPEC PW11: at every tolerance, 0 too, ground that any kernel covers lies in a kernel of the cut.

    To the slack of bent kernels; and always well inside the domain of a patch of the cut.
    """
    low, high = model.kernel.min(axis=(0, 1)), model.kernel.max(axis=(0, 1))
    points = rng.uniform(low, high, (200, 2))
    within = inside(model.kernel, points)
    could = within.any(axis=0)
    slack = np.where(within, model.slack[:, None], 0.0)
    for tolerance in TOLERANCES:
        cut = chosen(model, tolerance)
        hit = inside(model.kernel[cut], points, model.slack[cut] + slack.max() + 1e-3).any(axis=0)
        assert (hit | ~could).all(), tolerance
        height = blended(model, cut, points, tolerance)
        assert not np.isnan(height[could]).any()


def check_need(model: Model, rng: np.random.Generator) -> None:
    """SPEC PW12, PW13: no patch of a cut is covered by greater ones of it that are accurate enough."""
    for tolerance in TOLERANCES:
        cut = chosen(model, tolerance)
        some = rng.permutation(cut)[:12]
        for p in some.tolist():
            if model.min_z[p] <= tolerance:
                rivals = [int(q) for q in cut if model.min_z[q] <= tolerance]
                rivals = [q for q in rivals if q != p and reference.key(model, q) > reference.key(model, p)]
            else:  # it serves below its error: then no more accurate ones cover it
                rivals = [int(q) for q in cut if q != p and model.min_z[q] < model.min_z[p]]
            points = _within(model, p, rng)
            if rivals and inside(model.kernel[rivals], points).any(axis=0).all():
                assert reference.uncovered(model, p, rivals) > reference.COVERED, (tolerance, p)


def _within(model: Model, p: int, rng: np.random.Generator) -> Floats:
    """Points of the kernel of a patch."""
    a, b = rng.uniform(0, 1, (2, 30, 1))
    k = model.kernel[p]
    return np.asarray((k[0] * (1 - a) + k[1] * a) * (1 - b) + (k[3] * (1 - a) + k[2] * a) * b)


def check_error(model: Model, rng: np.random.Generator) -> None:
    """SPEC PW14: against the most trusted samples at a place the blend errs by e, or by the best patch there."""
    for one in model.placed:
        more = {k for k, other in enumerate(model.placed) if precedence(other.layer) > precedence(one.layer)}
        at = places(one.layer, one.raster.warp).reshape(-1, 2)
        heights = one.layer.scale * one.raster.heights.ravel().astype(float) + one.layer.lift_m
        some = rng.permutation(np.flatnonzero(~np.isnan(heights)))[:100]
        for tolerance in (0.0, 2.0, 30.0):
            cut = chosen(model, tolerance)
            height = blended(model, cut, at[some], tolerance)
            believed = np.isnan(blended(model, cut[np.isin(model.owner[cut], list(more))], at[some], tolerance))
            within = inside(model.kernel[cut], at[some])
            best = np.where(within, np.maximum(model.min_z[cut], tolerance)[:, None], np.inf).min(
                axis=0, initial=np.inf
            )
            err = np.abs(height - heights[some]) + one.layer.accuracy_m
            good = believed & ~np.isnan(height) & np.isfinite(best)
            assert (err[good] <= best[good] + 1e-3).all()
            assert (model.min_z[cut][~model.floor[cut]] <= tolerance).all()


@pytest.mark.parametrize("seed", range(6))
def test_tops_floors_and_errors_are_as_defined(seed: int) -> None:
    """SPEC PW7, PW8, PW17: the compiled search gives what the plain definitions give."""
    model = build(random_scene(seed + 300))
    rng = np.random.default_rng(seed)
    for p in rng.permutation(model.count)[:60].tolist():
        assert model.max_z[p] == reference.top(model, p)
        assert bool(model.floor[p]) == reference.floor(model, p)
        assert model.min_z[p] == pytest.approx(reference.error(model, p), abs=2e-4)


def test_a_finer_grid_survives_a_coarser_one() -> None:
    """SPEC PW15: with better accuracy, and, as the finer is believed, with equal accuracy too."""
    for accuracy in (0.5, 4.0):
        fine = surveyed(layer("fine", 80, 80, anchor=(310.0, 290.0), rotation_deg=20.0, accuracy_m=accuracy))
        coarse = surveyed(layer("zcoarse", 60, 60, spacing_m=(40.0, 40.0), accuracy_m=4.0))
        for model in (build([fine, coarse]), build([coarse]).with_(fine), build([fine]).with_(coarse)):
            mine = model.owner == [p.layer.id for p in model.placed].index("fine")
            own = build([fine])
            at_zero = chosen(model, accuracy)
            assert np.count_nonzero(mine[at_zero]) == len(chosen(own, accuracy))


def test_the_same_grid_twice_leaves_one() -> None:
    """SPEC PW10: the same content under another id: one of each pair of patches serves, at every tolerance."""
    first = surveyed(layer("first", 90, 100, rotation_deg=31.0))
    second = Placed(first.layer.model_copy(update={"id": "second"}), first.raster)
    alone, both = build([first]), build([first, second])
    assert np.array_equal(both.max_z > both.min_z, np.repeat([False, True], alone.count))
    for tolerance in TOLERANCES:
        assert len(chosen(both, tolerance)) == len(chosen(alone, tolerance))


def test_stale_ground_is_measured_against_the_newer() -> None:
    """SPEC PW6: an old, wide grid does not hide a newer, smaller one that says something else."""
    old = surveyed(layer("old", 120, 120, accuracy_m=1.0))
    new = surveyed(
        layer("new", 60, 60, anchor=(300.0, 300.0), accuracy_m=1.0, priority=1), height=lambda x, y: land(x, y) + 80.0
    )
    model = build([old, new])
    middle = np.array([[595.0, 595.0]])
    for tolerance in (1.0, 10.0, 60.0):
        height = blended(model, chosen(model, tolerance), middle, tolerance)
        assert abs(height[0] - (land(595.0, 595.0) + 80.0)) <= tolerance  # type: ignore[arg-type]
    stale = build([old, Placed(new.layer.model_copy(update={"priority": -1}), new.raster)])
    height = blended(stale, chosen(stale, 10.0), middle, 10.0)
    assert abs(height[0] - land(595.0, 595.0)) <= 10.0  # type: ignore[arg-type]


def test_stale_ground_does_not_show_through() -> None:
    """SPEC PW18: inside a newer, finer survey the old ground that still serves around it has no weight."""
    old = surveyed(layer("old", 120, 120, accuracy_m=3.0))
    new = surveyed(
        layer(
            "new", 110, 120, anchor=(403.0, 507.0), rotation_deg=12.0, spacing_m=(2.0, 2.0), accuracy_m=0.5, priority=1
        ),
        height=lambda x, y: land(x, y) + 80.0,
    )
    model = build([old, new])
    inner = places(new.layer)[6:-6, 6:-6].reshape(-1, 2)
    true = new.raster.heights[6:-6, 6:-6].ravel()
    for tolerance in (0.0, 1.0, 10.0):
        cut = chosen(model, tolerance)
        assert (model.owner[cut] == 0).any()
        within = inside(model.kernel[cut[model.owner[cut] == 1]], inner).any(axis=0)
        wrong = np.abs(blended(model, cut, inner, tolerance) - true)[within]
        assert wrong.max() <= tolerance + 1e-3


def test_a_coarse_grid_added_later_goes_below_the_better_ones() -> None:
    """SPEC PW19."""
    fine = layer("fine", 50, 50, anchor=(100.0, 100.0), rotation_deg=30.0, accuracy_m=1.0, priority=2)
    far = layer("far", 50, 50, anchor=(9000.0, 0.0), accuracy_m=0.5, priority=7)
    coarse = layer("coarse", 60, 60, spacing_m=(40.0, 40.0), accuracy_m=10.0)
    assert default_priority(coarse, [fine, far]) == 2
    believed = sorted([fine, coarse.model_copy(update={"priority": 2})], key=precedence)
    assert [one.id for one in believed] == ["coarse", "fine"]
    assert default_priority(coarse, [far]) == 8
    assert default_priority(fine.model_copy(update={"id": "again"}), [fine, coarse]) == 3, (
        "what comes later is believed"
    )
    assert default_priority(coarse.model_copy(update={"accuracy_m": 0.5}), [fine]) == 3, "coarser, but more accurate"
    assert default_priority(fine, [fine]) == 0


def test_level_ground_is_one_patch() -> None:
    """SPEC PW7, PW8: where all patches are equally accurate the greatest one serves, at every tolerance, 0 too."""
    flat = surveyed(layer("flat", 120, 90, accuracy_m=2.0), height=lambda x, y: 0 * (x + y) + 7.0)
    model = build([flat])
    for tolerance in TOLERANCES:
        cut = chosen(model, tolerance)
        assert model.level[cut].tolist() == [len(flat.raster.mips) - 1]
    other = surveyed(layer("small", 40, 40, anchor=(20.0, 30.0), accuracy_m=2.0), height=lambda x, y: 0 * (x + y) + 7.0)
    both = build([flat, other])
    assert [len(chosen(both, tolerance)) for tolerance in TOLERANCES] == [1] * len(TOLERANCES)
