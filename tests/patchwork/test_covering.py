"""Covers of one kernel by many: quartering says what cutting says (SPEC PW17)."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from esker.patchwork.lod import covering

Floats = NDArray[np.float64]
UNIT = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


def tiles(side: int, turn: float, rng: np.random.Generator) -> Floats:
    """Kernels (n, 4, 2) that tile the unit square and what lies around it, turned; some twice as great, too."""
    c, s = np.cos(turn), np.sin(turn)
    matrix = np.array([[c, s], [-s, c]])
    found = []
    for step in (1, 2):
        at = np.stack(np.meshgrid(np.arange(-side, 2 * side, step), np.arange(-side, 2 * side, step)), -1).reshape(
            -1, 2
        )
        found.append((at[:, None] + step * UNIT) / side @ matrix)
    kernels = np.concatenate(found)
    return np.asarray(kernels[rng.permutation(len(kernels))])


def both(
    kernels: Floats, z: Floats, quad: Floats, whether: bool = False, slack: Floats | None = None
) -> tuple[float, float]:
    """By quartering and by cutting, with a world far from its origin."""
    slack = np.zeros(len(z)) if slack is None else slack
    corner = np.array([5e5, 5e6])
    order = np.argsort(z, kind="stable")
    args = (kernels + corner, slack, z, quad, 1.0, *corner, order, len(order), np.inf)
    return covering.least_cover(*args, whether), covering._cut(*args)  # type: ignore[call-arg]


@pytest.mark.parametrize("turn", [0.0, 0.3, 0.8])
def test_the_least_error_is_that_of_cutting(turn: float) -> None:
    rng = np.random.default_rng(int(10 * turn))
    for side in (7, 11):
        kernels = tiles(side, turn, rng)
        for share in (1.0, 0.97, 0.6):
            kept = kernels[rng.random(len(kernels)) < share]
            z = np.round(rng.uniform(0, 9, len(kept)), 1)
            quartered, cut = both(kept, z, UNIT)
            assert quartered == cut
            assert (both(kept, z, UNIT, whether=True)[0] == np.inf) == (cut == np.inf)


def test_one_missing_tile_is_found() -> None:
    """Whichever it is; and what lies outside does not count."""
    rng = np.random.default_rng(5)
    kernels = np.concatenate([(np.array([i, j]) + UNIT)[None] / 9 for j in range(9) for i in range(9)])
    z = np.arange(81.0)
    assert both(kernels, z, UNIT) == (80.0, 80.0)
    for gone in rng.permutation(81)[:20]:
        less = np.delete(kernels, gone, axis=0)
        assert both(less, np.delete(z, gone), UNIT) == (np.inf, np.inf)
    over = np.concatenate([kernels, [2 * UNIT - 0.5]])
    assert both(over, np.append(z, 40.5), UNIT)[0] == 40.5


def test_slack_reaches_into_quarters_beside() -> None:
    """Every second kernel is too small by what those around it, across the edges of quarters too, may be grown by."""
    gap, z = 0.004, np.arange(100.0)
    at = np.stack(np.meshgrid(np.arange(-1, 9), np.arange(-1, 9), indexing="ij"), -1).reshape(-1, 2)
    small = at.sum(axis=1) % 2 == 1
    size = np.where(small, 1 / 8 - 2 * gap, 1 / 8)[:, None, None]
    kernels = (at / 8 + np.where(small, gap, 0.0)[:, None])[:, None] + size * UNIT
    for grown, covered in ((1.01 * gap, True), (0.9 * gap, False)):
        quartered, cut = both(kernels, z, UNIT, slack=np.where(small, 0.0, grown))
        assert quartered == cut
        assert (cut < np.inf) == covered
