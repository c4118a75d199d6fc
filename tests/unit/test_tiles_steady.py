"""Drawing in one place leaves the ground elsewhere alone (SPEC T21, T3)."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from esker import grid
from esker.tiles.pyramid import Level, Pyramid
from esker.tiles.stabiliser import Steadier

SIZE_M = 1024.0
LEVELS = 3
Heights = NDArray[np.float32]


def truth(level: int, edited: bool) -> Heights:
    """Ridges everywhere; the edit is a bump in the south-west."""
    n = grid.samples(level)
    y, x = np.mgrid[0:n, 0:n] * (SIZE_M / (n - 1))
    h = 80 * np.sin(x / 60) * np.cos(y / 45)
    if edited:
        h += 120 * np.maximum(0, 1 - np.hypot(x - 180, y - 160) / 90)
    return np.asarray(h, dtype=np.float32)


def preview(level: int, edited: bool) -> Heights:
    """The truth with the error of a coarse level: wrong by up to a seventh of the relief, everywhere."""
    return (truth(level, edited) * np.float32(1 - 0.05 * (LEVELS - level))).astype(np.float32)


def solve(pyramid: Pyramid, clock: int, edited: bool, settle: bool = True) -> list[int]:
    changed = [pyramid.preview(clock, level, preview(level, edited)) for level in range(LEVELS + 1)]
    if settle:
        changed += [pyramid.settle(clock, level, truth(level, edited)) for level in range(LEVELS + 1)]
    return changed


def now(pyramid: Pyramid, level: int) -> Level:
    found = pyramid.level(level)
    assert found is not None
    return found


@pytest.fixture
def settled() -> Pyramid:
    pyramid = Pyramid(SIZE_M, LEVELS)
    solve(pyramid, 1, False)
    return pyramid


def test_solving_the_same_document_again_changes_nothing(settled: Pyramid) -> None:
    assert solve(settled, 2, False) == [0] * (2 * LEVELS + 2)


def test_a_preview_changes_only_the_tiles_that_the_edit_reaches(settled: Pyramid) -> None:
    before = [now(settled, level) for level in range(LEVELS + 1)]
    changed = solve(settled, 2, True, settle=False)
    assert changed[0] == 1
    for level in range(1, LEVELS + 1):
        width = SIZE_M / 2**level
        far = 90 + 3 * SIZE_M / 64  # a step of a coarse sample moves what lies less than three of them away
        reached = {
            (k.x, k.y)
            for k in grid.tiles(level)
            if (k.x + 1) * width > 180 - far
            and k.x * width < 180 + far
            and (k.y + 1) * width > 160 - far
            and k.y * width < 160 + far
        }
        after = now(settled, level)
        moved = {(int(x), int(y)) for y, x in np.argwhere(before[level].versions != after.versions)}
        assert moved
        assert moved <= reached
    assert 0 < sum(solve(settled, 3, True)) < 40


def test_where_the_edit_is_the_new_preview_is_shown(settled: Pyramid) -> None:
    solve(settled, 2, True, settle=False)
    for level in range(LEVELS + 1):
        shown = now(settled, level).samples * grid.quantum(level, SIZE_M)
        n = shown.shape[0]
        r, c = round(160 / SIZE_M * (n - 1)), round(180 / SIZE_M * (n - 1))
        assert shown[r, c] == pytest.approx(preview(level, True)[r, c], abs=1.01 * grid.quantum(0, SIZE_M))


def test_settled_levels_are_exact_whatever_was_shown(settled: Pyramid) -> None:
    solve(settled, 2, True, settle=False)
    solve(settled, 3, True)
    for level in range(LEVELS + 1):
        want = np.rint(truth(level, True) / np.float32(grid.quantum(level, SIZE_M)))
        assert np.array_equal(now(settled, level).samples, want)


def test_signs_of_life_while_settling_are_ignored(settled: Pyramid) -> None:
    solve(settled, 2, True, settle=False)
    stamp = settled.stamp
    assert settled.preview(2, 0, truth(0, True)) == 0
    assert settled.stamp == stamp
    assert settled.preview(3, 0, preview(0, False)) == 1


def test_coarse_previews_that_come_behind_the_finest_are_known_when_the_ground_settles(settled: Pyramid) -> None:
    """A solver that begins with the ground before brings the finest preview first."""
    for level in (0, LEVELS, *range(1, LEVELS)):
        settled.preview(2, level, preview(level, True))
    for level in range(LEVELS + 1):
        settled.settle(2, level, truth(level, True))
    stamps = [now(settled, level).versions.copy() for level in range(LEVELS)]
    for level in range(LEVELS):
        settled.preview(3, level, preview(level, True))
        assert np.array_equal(now(settled, level).versions, stamps[level]), "shown as settled"


def test_without_a_settled_solve_of_the_same_clock_previews_are_shown_as_they_are() -> None:
    steadier = Steadier()
    a, b = preview(0, False), truth(0, False)
    assert steadier.preview(1, a) is a
    steadier.settled(2, b)
    assert steadier.preview(3, a) is a


def test_the_correction_fades_as_the_preview_moves() -> None:
    steadier = Steadier()
    before, settled_heights = np.zeros((1, 6), dtype=np.float32), np.full((1, 6), -10, dtype=np.float32)
    steadier.preview(1, before)
    steadier.settled(1, settled_heights)
    moved = np.array([[0, 4, -4, 10, -10, 50]], dtype=np.float32)
    assert steadier.preview(2, moved).tolist() == [[-10, 4 - 6, -4 - 6, 10, -10, 50]]
