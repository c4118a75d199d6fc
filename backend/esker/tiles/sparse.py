"""Selection above the levels that are solved as a whole: sparse, downward from wanted tiles only (DESIGN 5.6, 7).

The rule is that of ``quadtree``. A tile that was never made has no error yet; half of its parent's, over the same
ground, stands for it: that is what remains of it at a crest, where it shrinks most slowly. Once made, its own error
decides, so flat or smooth land is looked into once and never sent, and crests are refined to the finest level. Where
the ground has changed since, the greater of the two counts.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import cached_property
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from esker import grid
from esker.contract import SUBPATCHES, View
from esker.grid import TileKey
from esker.tiles.bounds import Floats, SubPatches
from esker.tiles.pyramid import Counts, Mask
from esker.tiles.quadtree import MARGIN, SHADING_CELL_PX, SHADING_ERROR, screen_error
from esker.tiles.refined import Known, RefinedTiles, code

Index = NDArray[np.int64]

EXPECTED: Final = np.float32(0.5)
"""A tile whose error is not known is taken to have this part of its parent's error."""
LIKELY: Final = 8.0
"""A tile that is not known is taken for as bad as that where it is this many times too bad: so several levels are made
in one go near crests, in fewer and fuller steps."""


@dataclass(frozen=True, eq=False)
class Selection:
    """Wanted tiles of levels ``first``, ``first`` + 1 ...: their codes, sorted, and projected errors in pixels."""

    first: int
    codes: tuple[Index, ...]
    errors: tuple[Floats, ...]

    @staticmethod
    def nothing(levels: int, finest: int) -> Selection:
        """Returns a selection without tiles, for all levels above ``levels``."""
        n = finest - levels
        empty = np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.float32)
        return Selection(levels + 1, (empty[0],) * n, (empty[1],) * n)

    @property
    def count(self) -> int:
        """The number of tiles wanted."""
        return sum(len(c) for c in self.codes)

    @cached_property
    def tiles(self) -> dict[TileKey, float]:
        """The wanted tiles with their errors, coarse to fine."""
        out: dict[TileKey, float] = {}
        for level, codes, errors in zip(itertools.count(self.first), self.codes, self.errors, strict=False):
            mask = (1 << level) - 1
            for c, e in zip(codes.tolist(), errors.tolist(), strict=True):
                out[TileKey(level, c & mask, c >> level)] = e
        return out


@dataclass(frozen=True, eq=False)
class _Boxes:
    """Tiles of one level as ``quadtree.screen_error`` reads them."""

    size_m: float
    x: Floats
    y: Floats
    half: Floats
    spacing: Floats
    low: Floats
    high: Floats
    error: Floats
    valid: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class _Parents:
    """Wanted and known tiles of a level: places (n,), bounds (n, 4, 4) in metres."""

    x: Index
    y: Index
    low: Floats
    high: Floats
    error: Floats


class Relief(Protocol):
    """The levels that are solved as a whole, as selection reads them: ``pyramid.Pyramid`` or ``surface.Surface``."""

    @property
    def size_m(self) -> float: ...
    @property
    def levels(self) -> int: ...
    def changes(self) -> Counts: ...
    def sub_patches(self, level: int) -> SubPatches: ...


def select_refined(pyramid: Relief, refined: RefinedTiles, wanted: Mask, view: View) -> Selection:
    """Wanted tiles of all levels above the pyramid's; ``wanted``: its selection of the finest level of its own.

    Closed under parents; the eight neighbours of a wanted tile's parent are wanted as far as they lie above the
    pyramid; ``restrict_below`` says it of the pyramid's finest level.
    """
    parents = _finest(pyramid, wanted)
    changed = pyramid.changes()
    codes: list[Index] = []
    errors: list[Floats] = []
    for level in range(refined.levels + 1, refined.finest + 1):
        below = _children(parents, level, refined, changed)
        boxes = below.boxes
        inside, error, cell = screen_error(boxes, view)
        tau = MARGIN * view.tau_px
        bends = (boxes.error > SHADING_ERROR * 2 * boxes.spacing) & (cell > SHADING_CELL_PX * tau)
        chosen = inside & (cell > tau) & ((error > tau) | bends)
        place = code(below.x[chosen], below.y[chosen], level)
        order = np.argsort(place)
        codes.append(place[order])
        errors.append(error[chosen][order])
        parents = below.parents(chosen, chosen & (error > LIKELY * tau))
        if not len(parents.x):
            break
    for _ in range(refined.finest - refined.levels - len(codes)):
        codes.append(np.zeros(0, dtype=np.int64))
        errors.append(np.zeros(0, dtype=np.float32))
    for i in range(len(codes) - 1, 0, -1):
        level = refined.levels + 1 + i
        around = _around_parents(codes[i], level)
        more = np.setdiff1d(around, codes[i - 1], assume_unique=True)
        if len(more):
            merged = np.concatenate([codes[i - 1], more])
            order = np.argsort(merged)
            codes[i - 1] = merged[order]
            errors[i - 1] = np.concatenate([errors[i - 1], np.zeros(len(more), dtype=np.float32)])[order]
    return Selection(refined.levels + 1, tuple(codes), tuple(errors))


def restrict_below(selection: Selection, wanted: list[Mask]) -> bool:
    """Adds the parents of selected tiles and their neighbours to the mask of the level below.

    Returns True if it changed.
    """
    level = selection.first - 1
    if not selection.codes or not len(selection.codes[0]):
        return False
    around = _around_parents(selection.codes[0], selection.first)
    rows, cols = around >> level, around & ((1 << level) - 1)
    if wanted[level][rows, cols].all():
        return False
    wanted[level][rows, cols] = True
    return True


def _around_parents(codes: Index, level: int) -> Index:
    """Returns codes of the parents' level: each tile's parent and the parent's eight neighbours; sorted, unique."""
    side = 1 << (level - 1)
    parents = np.unique(code((codes & ((1 << level) - 1)) >> 1, codes >> (level + 1), level - 1))
    x, y = parents & (side - 1), parents >> (level - 1)
    offset = np.arange(-1, 2)
    nx = np.broadcast_to(x[:, None, None] + offset, (len(x), 3, 3)).ravel()
    ny = np.broadcast_to(y[:, None, None] + offset[:, None], (len(x), 3, 3)).ravel()
    fits = (nx >= 0) & (nx < side) & (ny >= 0) & (ny < side)
    return np.unique(code(nx[fits], ny[fits], level - 1))


def _finest(pyramid: Relief, wanted: Mask) -> _Parents:
    """Returns the wanted tiles of the pyramid's finest level."""
    y, x = np.nonzero(wanted)
    q = np.float32(grid.quantum(pyramid.levels, pyramid.size_m))
    subs = pyramid.sub_patches(pyramid.levels)
    side = wanted.shape[0]

    def gathered(a: NDArray[np.int32] | NDArray[np.uint32]) -> Floats:
        found = a.reshape(side, SUBPATCHES, side, SUBPATCHES)[y, :, x, :]
        return np.asarray(found * q, dtype=np.float32)

    return _Parents(
        x.astype(np.int64), y.astype(np.int64), gathered(subs.low), gathered(subs.high), gathered(subs.error)
    )


@dataclass(frozen=True, eq=False)
class _Children:
    """The four children of each parent: places and boxes (4n,); which are known, and where in ``made``."""

    x: Index
    y: Index
    boxes: _Boxes
    known: NDArray[np.bool_]
    at: Index
    same: NDArray[np.bool_]
    """Tiles under which the ground has not changed since they were made."""
    made: Known

    def parents(self, chosen: NDArray[np.bool_], likely: NDArray[np.bool_]) -> _Parents:
        """Selection goes on downward from the chosen tiles that are known and the likely ones that are not."""
        mask = chosen & self.known
        at, changed = self.at[mask], ~self.same[mask]
        low, high, error = self.made.low[at], self.made.high[at], self.made.error[at]
        if changed.any():
            boxes = self.boxes
            low[changed] = np.minimum(low[changed], boxes.low[mask][changed, None, None])
            high[changed] = np.maximum(high[changed], boxes.high[mask][changed, None, None])
            error[changed] = np.maximum(error[changed], boxes.error[mask][changed, None, None])
        guessed = likely & ~self.known
        if not guessed.any():
            return _Parents(self.x[mask], self.y[mask], low, high, error)
        shape = (int(guessed.sum()), SUBPATCHES, SUBPATCHES)
        bounds = (
            np.concatenate([known, np.broadcast_to(guess[guessed][:, None, None], shape)])
            for known, guess in ((low, self.boxes.low), (high, self.boxes.high), (error, self.boxes.error))
        )
        x, y = (np.concatenate([place[mask], place[guessed]]) for place in (self.x, self.y))
        return _Parents(x, y, *bounds)


def _children(parents: _Parents, level: int, refined: RefinedTiles, changed: NDArray[np.uint32]) -> _Children:
    """``changed``: per tile of the finest whole level, the stamp of the last change of the ground there."""
    n = len(parents.x)
    x = (2 * parents.x[:, None] + np.array([0, 1, 0, 1])).ravel()
    y = (2 * parents.y[:, None] + np.array([0, 0, 1, 1])).ravel()

    def quarters(ufunc: np.ufunc, a: Floats) -> Floats:
        pairs = ufunc(a[:, :, 0::2], a[:, :, 1::2])
        out: Floats = ufunc(pairs[:, 0::2], pairs[:, 1::2]).reshape(4 * n)
        return out

    error = quarters(np.maximum, parents.error) * EXPECTED
    low, high = quarters(np.minimum, parents.low) - error, quarters(np.maximum, parents.high) + error
    made = refined.known(level)
    place = code(x, y, level)
    at = np.searchsorted(made.codes, place)
    known = at < len(made.codes)
    known[known] = made.codes[at[known]] == place[known]
    same = np.zeros(4 * n, dtype=np.bool_)
    if known.any():
        up, mine = level - refined.levels, at[known]
        kept = changed[y[known] >> up, x[known] >> up] <= made.ground[mine]
        same[known] = kept
        low[known] = np.where(kept, made.lowest[mine], np.minimum(made.lowest[mine], low[known]))
        high[known] = np.where(kept, made.highest[mine], np.maximum(made.highest[mine], high[known]))
        error[known] = np.where(kept, made.worst[mine], np.maximum(made.worst[mine], error[known]))
    width = refined.size_m / (1 << level)
    boxes = _Boxes(
        refined.size_m,
        ((x + 0.5) * width).astype(np.float32),
        ((y + 0.5) * width).astype(np.float32),
        np.full(4 * n, width / 2, dtype=np.float32),
        np.full(4 * n, grid.spacing(level, refined.size_m), dtype=np.float32),
        low,
        high,
        error,
        np.ones(4 * n, dtype=np.bool_),
    )
    return _Children(x, y, boxes, known, at, same, made)
