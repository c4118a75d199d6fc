"""Bases of random layers: finite, bounded, the same bits in windows, reused as made (SPEC PW50, PW52, PW55, PW57)."""

from __future__ import annotations

import numpy as np
import pytest

from esker import grid
from esker.patchwork.base import Base
from esker.patchwork.lod import space
from esker.patchwork.lod.space import Placed
from esker.patchwork.query.queries import Index, View
from esker.patchwork.raster import rim
from tests.patchwork.blend_scenes import placed


def layers(rng: np.random.Generator, size: float) -> list[Placed]:
    """One to four grids of any form: holes, bends, turned, mirrored in height, far too fine or far too coarse."""
    found = []
    for k in range(rng.integers(1, 5)):
        rows, cols = rng.integers(4, 70, 2)
        heights = rng.normal(size=(rows, cols)).cumsum(0).cumsum(1) * rng.choice([0.01, 1, 30])
        if rng.random() < 0.5:
            heights[rng.random((rows, cols)) < rng.choice([0.02, 0.3, 0.9])] = np.nan
        if rng.random() < 0.3:
            heights[: rows // 2, : cols // 3] = np.nan
        heights[-1, -1] = 1.0
        warp = rng.normal(size=(3, 3, 2)) * 0.3 if rng.random() < 0.3 else None
        step = 10 ** rng.uniform(-3, 5) if rng.random() < 0.2 else size / rng.integers(20, 400)
        spacing = np.clip([step, step * rng.uniform(0.5, 2)], 1e-3, 1e5)
        found.append(
            placed(
                heights, f"layer{k:03}", warp, anchor=tuple((rng.uniform(-0.3, 1, 2) * size).tolist()),
                rotation_deg=float(rng.uniform(-180, 180)), spacing_m=tuple(spacing.tolist()),
                accuracy_m=float(rng.choice([0, 0.1, 5])), scale=float(rng.choice([1, -2, 0.3048])),
                priority=int(rng.integers(0, 3)),
            )
        )  # fmt: skip
    return found


@pytest.mark.parametrize("seed", range(16))
def test_any_layers_make_ground(seed: int) -> None:
    rng = np.random.default_rng(seed)
    size = float(rng.choice([64.0, 1000.0, 4096.0, 65536.0]))
    chosen = layers(rng, size)
    model = space.build(chosen)
    base, level = Base(model, size), int(rng.integers(0, 4))
    ground = base.level(level)
    assert np.isfinite(ground).all()
    assert base.low <= ground.min() <= ground.max() <= base.high
    fine = int(rng.integers(4, 13))
    row, col = rng.integers(-5, grid.cells(fine), 2).tolist()
    window = Base(model, size).window(fine, slice(row, row + 70), slice(col, col + 66))
    assert np.isfinite(window).all()
    part = base.window(fine, slice(row + 13, row + 30), slice(col + 5, col + 60))
    assert np.array_equal(part, window[13:30, 5:60])
    sample = base.sample(rng.uniform(-0.1, 1.1, (50, 2)) * size, derivatives=True)
    assert all(part is not None and np.isfinite(part).all() for part in sample)
    less = model.without(chosen[0].layer.id)
    assert np.array_equal(Base(less, size, base).level(level), Base(less, size).level(level))
    assert set(Index(model).view(View((0.5 * size, 0.5 * size), 1.0, 0.5, size, 0.01))) <= set(range(model.count))


def test_a_grid_without_a_patch_is_no_ground(monkeypatch: pytest.MonkeyPatch) -> None:
    """Samples far apart are ground, each by itself (SPEC PW4); were none let in: nothing to blend, and no fault."""
    heights = np.full((40, 40), np.nan)
    heights[::5, ::5] = 100.0
    model = space.build([placed(heights)])
    assert model.count == 64
    assert Base(model, 1000.0).level(2).max() == pytest.approx(100.0)
    monkeypatch.setattr(rim, "MOST", 0)
    model = space.build([placed(heights)])
    assert model.count == 0
    assert not Base(model, 1000.0).level(2).any()
