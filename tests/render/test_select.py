"""The cut of the reference keeps the rules of the page's selection (SPEC R1 to R4)."""

from __future__ import annotations

import numpy as np
import pytest

from esker.contract import SUBPATCHES
from esker.render.camera import home, look_at
from esker.render.select import EAST, NORTH, SOUTH, WEST, Cut, choose
from esker.render.surface import Surface
from tests.render.ground import rough_levels

SIZE = 4096.0


@pytest.fixture(scope="module")
def surface() -> Surface:
    return Surface(SIZE, rough_levels(4, SIZE))


def cuts(surface: Surface) -> list[Cut]:
    rng = np.random.default_rng(5)
    found = [choose(surface, home(SIZE, 640, 400), 1.0)]
    for _ in range(6):
        eye = (*rng.uniform(0, SIZE, 2), rng.uniform(150, 900))
        target = (*rng.uniform(0, SIZE, 2), 0.0)
        found.append(choose(surface, look_at(eye, target, SIZE, 320, 200), float(rng.uniform(0.5, 3))))
    return found


def test_the_domain_is_covered_once(surface: Surface) -> None:
    """R1: with everything in view, each cell of the finest lattice lies in exactly one patch."""
    cut = choose(surface, look_at((2048, 2047, 20_000), (2048, 2048, 0), SIZE, 2000, 2000), 1.0)
    finest = int(cut.level.max())
    assert finest > 1
    count = np.zeros((SUBPATCHES << finest,) * 2, dtype=int)
    for level, (px, py) in zip(cut.level, cut.nodes, strict=True):
        w = 1 << (finest - level)
        count[py * w : (py + 1) * w, px * w : (px + 1) * w] += 1
    assert (count == 1).all()


def test_neighbours_differ_by_one_level_and_agree(surface: Surface) -> None:
    """R2, R3, R4: levels of touching patches, edge bits, weights of shared points."""
    for cut in cuts(surface):
        at = {
            (level, px, py): k
            for k, (level, (px, py)) in enumerate(zip(cut.level.tolist(), cut.nodes.tolist(), strict=True))
        }
        weights: dict[tuple[int, float, float], set[int]] = {}
        for (level, px, py), k in at.items():
            for bit, dx, dy in ((WEST, -1, 0), (EAST, 1, 0), (SOUTH, 0, -1), (NORTH, 0, 1)):
                x, y = px + dx, py + dy
                coarser = (level - 1, x >> 1, y >> 1) in at
                if coarser:
                    assert cut.edges[k] & bit
                if (level, x, y) in at:
                    assert not cut.edges[k] & bit
                for up in range(2, level + 1):
                    assert (level - up, x >> up, y >> up) not in at
            for corner in range(4):
                x, y = (px + (corner & 1)) / 2**level, (py + (corner >> 1)) / 2**level
                weights.setdefault((level, x, y), set()).add(int(cut.corners[k, corner]))
        assert all(len(found) == 1 for found in weights.values())
        for level, x, y in weights:
            if (level + 1, x, y) in weights:
                assert weights[level + 1, x, y] == {255}
                assert weights[level, x, y] == {0}


def test_patches_have_a_weight_of_their_own(surface: Surface) -> None:
    """R71: by the parent's error in bounds; all at it where the parent was split for its neighbours' sake alone."""
    between = 0
    for cut in cuts(surface):
        for level, (px, py), morph in zip(cut.level.tolist(), cut.nodes.tolist(), cut.morph.tolist(), strict=True):
            ratio = cut.split[level - 1][px >> 1, py >> 1] if level else 9.0
            wanted = 255 if ratio <= 1 else 0 if ratio >= 1.25 else 255 * (1.25 - ratio) / 0.25
            assert abs(morph - wanted) <= 0.5 + 1e-6
            between += 0 < morph < 255
    assert between > 5


def test_tiles_of_a_cut_come_with_their_ancestors(surface: Surface) -> None:
    """R5."""
    for cut in cuts(surface):
        tiles = cut.tiles()
        assert tiles[0] == (0, 0, 0)
        assert all((level - 1, x >> 1, y >> 1) in tiles for level, x, y in tiles if level)
        assert {(int(n), int(p[0]) // 4, int(p[1]) // 4) for n, p in zip(cut.level, cut.nodes, strict=True)} <= set(
            tiles
        )


def test_flat_ground_is_not_refined() -> None:
    """R7."""
    flat = Surface(SIZE, [np.zeros((65, 65), dtype=np.float32), np.zeros((129, 129), dtype=np.float32)])
    assert (choose(flat, home(SIZE, 640, 400), 0.1).level == 0).all()
