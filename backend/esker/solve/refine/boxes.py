"""Boxes of tiles above the global levels, and the samples that they share with spans of a level. Pure."""

from __future__ import annotations

import itertools
from collections.abc import Set
from typing import Final

from esker import grid
from esker.contract import MAX_REFINED_LEVEL, TILE_CELLS
from esker.grid import TileKey
from esker.solve.refine.engine import Fields, Span

GROUP: Final = 4
"""Tiles along a side of what one step computes at most: more, and a step takes too long to be left; fewer, and the
halo costs more than the tiles."""

Box = tuple[int, int, int, int]
"""Tiles x0 .. x1 - 1, y0 .. y1 - 1 as (x0, y0, x1, y1)."""


def group_around(key: TileKey, left: Set[TileKey]) -> Box:
    """The box of at most GROUP tiles a side around ``key`` that holds most of the tiles that are left to make."""
    near = [(x, y) for _, x, y in left if abs(x - key.x) < GROUP and abs(y - key.y) < GROUP]
    best: list[tuple[int, int]] = []
    for y0 in range(key.y - GROUP + 1, key.y + 1):
        for x0 in range(key.x - GROUP + 1, key.x + 1):
            held = [at for at in near if x0 <= at[0] < x0 + GROUP and y0 <= at[1] < y0 + GROUP]
            best = max(best, held, key=len)
    xs, ys = zip(*best, strict=True)
    return min(xs), min(ys), max(xs) + 1, max(ys) + 1


def span_of(key: TileKey) -> Span:
    """The samples of one tile, both edges included."""
    return samples_of((key.x, key.y, key.x + 1, key.y + 1))


def samples_of(box: Box) -> Span:
    """The samples of a box of tiles, both edges included."""
    x0, y0, x1, y1 = box
    return Span(y0 * TILE_CELLS, y1 * TILE_CELLS + 1, x0 * TILE_CELLS, x1 * TILE_CELLS + 1)


def tiles_over(span: Span, level: int) -> Box:
    """The fewest tiles that hold a span."""
    last = (1 << level) - 1
    r, c = max(span.r1 - 2, span.r0), max(span.c1 - 2, span.c0)
    return (
        min(span.c0 // TILE_CELLS, last),
        min(span.r0 // TILE_CELLS, last),
        min(c // TILE_CELLS, last) + 1,
        min(r // TILE_CELLS, last) + 1,
    )


def keys_of(level: int, box: Box) -> list[TileKey]:
    """The tiles of a box, row by row from the south."""
    x0, y0, x1, y1 = box
    return [TileKey(level, x, y) for y in range(y0, y1) for x in range(x0, x1)]


def evenly_cut(box: Box) -> list[Box]:
    """A box cut evenly into boxes of at most GROUP tiles a side."""
    x0, y0, x1, y1 = box
    across, along = _cuts(x0, x1), _cuts(y0, y1)
    return [(a, b, c, d) for b, d in along for a, c in across]


def _cuts(low: int, high: int) -> list[tuple[int, int]]:
    parts = -(-(high - low) // GROUP)
    edges = [low + (high - low) * k // parts for k in range(parts + 1)]
    return list(itertools.pairwise(edges))


def in_z_order(boxes: list[Box]) -> list[Box]:
    """So that boxes follow each other that share parents."""

    def spread(v: int) -> int:
        return sum(((v >> k) & 1) << (2 * k) for k in range(MAX_REFINED_LEVEL + 1))

    return sorted(boxes, key=lambda b: spread(b[0]) | spread(b[1]) << 1)


def paste(out: Fields, span: Span, key: TileKey, tile: Fields) -> None:
    """Copies what a tile shares with a span: ``out`` (channels, *span.shape), ``tile`` (channels, 65, 65)."""
    at = span_of(key)
    r0, r1, c0, c1 = max(span.r0, at.r0), min(span.r1, at.r1), max(span.c0, at.c0), min(span.c1, at.c1)
    out[:, r0 - span.r0 : r1 - span.r0, c0 - span.c0 : c1 - span.c0] = tile[
        :, r0 - at.r0 : r1 - at.r0, c0 - at.c0 : c1 - at.c0
    ]


def bounds_of(part: slice, level: int) -> tuple[int, int]:
    """First sample of a slice of a level's rows or columns and the one after its last.

    Raises ValueError for a slice that is empty, has steps or reaches beyond the level.
    """
    n = grid.samples(level)
    low, high, jump = part.indices(n)
    if jump != 1 or low >= high or (part.stop is not None and part.stop > n) or (part.start or 0) < 0:
        raise ValueError(f"not a range of the {n} samples of level {level}: {part}")
    return low, high
