"""Grids that show one smooth ground agree where one of them ends, from edition 3 on (SPEC PW44, S375, S376)."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from esker.patchwork.base import BENT_EDITION, Base
from esker.patchwork.lod import space
from esker.patchwork.lod.space import Model
from esker.patchwork.raster.samples import cut
from tests.patchwork.blend_scenes import Floats, Ground, placed, plane, rough, sampled

SIZE = 4096.0
BENDS = np.array([2e-4, -1.5e-4, 1e-4])
"""Of ``bowl``: half its second derivatives, and the mixed one."""
COARSE, FINE = 40.0, 10.0


def bowl(x: Floats, y: Floats) -> Floats:
    """A quadratic."""
    a, b, c = BENDS
    return np.asarray(300 + 0.2 * x - 0.1 * y + a * (x - 1000) ** 2 + b * (y - 1200) ** 2 + c * (x - 900) * (y - 1100))


def waves(x: Floats, y: Floats) -> Floats:
    """Hills 100 m high, 2.5 km apart."""
    return np.asarray(100 * np.sin(x / 400 + 0.3) * np.cos(y / 500))


def two_grids(ground: Ground, seed: int) -> tuple[Model, Floats, Floats]:
    """A wide grid and a finer one at any place, angle and spacing; places around the finer one, and how far each lies
    beyond its last samples, in its cells."""
    rng = np.random.default_rng(seed)
    cells, turn = int(rng.integers(60, 100)), float(rng.uniform(0, 360))
    steps = float(rng.uniform(0.6, 1)) * FINE, float(rng.uniform(0.6, 1)) * FINE
    anchor = tuple(rng.uniform(1900, 2200, 2).tolist())
    place: dict[str, Any] = {"anchor": anchor, "rotation_deg": turn, "spacing_m": steps}
    wide: dict[str, Any] = {"anchor": (-400.0, -400.0), "spacing_m": (COARSE, COARSE), "accuracy_m": 3.0}
    fine = sampled(ground, cells, cells, "bbbbbbbb", accuracy_m=0.5, priority=1, **place)
    model = space.build([sampled(ground, 123, 123, "aaaaaaaa", **wide), fine])
    u, v = rng.uniform(-6, cells + 5, (2, 20000))
    angle = np.radians(turn)
    x = anchor[0] + steps[0] * u * np.cos(angle) - steps[1] * v * np.sin(angle)
    y = anchor[1] + steps[0] * u * np.sin(angle) + steps[1] * v * np.cos(angle)
    return model, np.stack([x, y], axis=1), np.max([-u, u - cells + 1, -v, v - cells + 1], axis=0)


def off(ground: Ground, seed: int, edition: int) -> tuple[float, float]:
    """Largest errors over the finer grid, to half a cell beyond its samples, and around it; metres."""
    model, points, beyond = two_grids(ground, seed)
    error = np.abs(Base(model, SIZE, edition=edition).sample(points).heights - ground(*points.T))
    return float(error[beyond <= 0.5].max()), float(error[beyond > 0.5].max())


@pytest.mark.parametrize("seed", range(8))
def test_planes_agree(seed: int) -> None:
    """SPEC PW44, S375: to what float32 holds."""
    assert max(off(plane, seed, BENT_EDITION)) < 2e-3


@pytest.mark.parametrize("seed", range(8))
def test_bent_ground_agrees(seed: int) -> None:
    """SPEC S375: over the finer grid with its error of interpolation, beyond it with that of the wide one."""
    for ground, bend in ((bowl, 4e-4), (waves, 6.3e-4)):
        over, around = off(ground, seed, BENT_EDITION)
        assert over < 0.06 * bend * FINE**2 + 1e-3, ground.__name__
        assert around < 0.025 * bend * COARSE**2 + 1e-3, ground.__name__


def test_earlier_editions_keep_their_ground() -> None:
    """SPEC S204: what went on without its bend was up to 0.38 m off, and a terrain that has that keeps it."""
    first, second = (off(waves, 1, edition) for edition in (1, 2))
    assert first == second
    assert first[1] > 4 * off(waves, 1, BENT_EDITION)[1]
    model = two_grids(waves, 1)[0]
    digests = [Base(model, SIZE, edition=edition).digest for edition in (1, 2, BENT_EDITION)]
    assert digests[0] == digests[1] != digests[2]


def test_a_base_before_of_another_edition_is_not_taken_over() -> None:
    """SPEC PW55."""
    model = two_grids(waves, 3)[0]
    old = Base(model, SIZE)
    old.level(3)
    fresh, after = Base(model, SIZE, edition=BENT_EDITION), Base(model, SIZE, old, BENT_EDITION)
    assert np.array_equal(fresh.level(3), after.level(3))
    assert after.changed(old) is not None


def bent_cut(heights: Floats, row: int, col: int, side: int) -> Floats:
    """The samples of a patch that goes on with the bend of its grid."""
    block = np.empty((side, side), np.float32)
    cut(heights.astype(np.float32), row, col, block, True)
    return block.astype(float)


def test_parabolas_go_on_and_noise_does_not() -> None:
    """SPEC S376: beyond borders, corners and into nodata; rough ground goes on as it did but for one place in fifty."""
    row, col = np.indices((40, 50)).astype(float)
    parabola = 300 + 0.5 * col**2 - 0.25 * row**2 + 0.125 * row * col - 9 * col
    holed = parabola.copy()
    holed[12:14, 20:22] = np.nan
    for of, r, c in ((parabola, -2, -2), (parabola, 26, 38), (parabola, 4, 38), (holed, 3, 12)):
        v, u = np.mgrid[r : r + 18, c : c + 18]
        want = 300 + 0.5 * u**2 - 0.25 * v**2 + 0.125 * v * u - 9 * u
        np.testing.assert_allclose(bent_cut(of, r, c, 18), want, atol=2e-2)
    rng = np.random.default_rng(4)
    moved = 0.0
    for _ in range(40):
        noise = rng.normal(0, 10, (40, 50))
        straight = np.empty((18, 18), np.float32)
        cut(noise.astype(np.float32), 10, 38, straight, False)
        moved += float(np.mean(np.abs(bent_cut(noise, 10, 38, 18) - straight)[:, 12:14] > 1e-3)) / 40
    assert moved < 0.02


def test_thin_grids_and_holes_go_on() -> None:
    """SPEC S376: of few samples in line there is no bend; nothing is left unknown."""
    for shape in ((1, 9), (2, 4), (4, 4), (5, 3)):
        assert np.isfinite(bent_cut(np.arange(np.prod(shape)).reshape(shape).astype(float), -2, -2, 18)).all()
    x, y = np.meshgrid(np.arange(60) * 10.0, np.arange(60) * 10.0)
    heights = rough(x, y)
    heights[np.random.default_rng(1).random(heights.shape) < 0.05] = np.nan
    base = Base(space.build([placed(heights, anchor=(1000.0, 1000.0))]), SIZE, edition=BENT_EDITION)
    level = base.level(4)
    assert np.isfinite(level).all()
    assert base.low < level.min() <= level.max() < base.high
