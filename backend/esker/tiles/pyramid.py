"""Quantised levels with versions (DESIGN 6, 7): what the server knows of the ground, as integers.

A ``Level`` is immutable, so that frames can be encoded from it in another thread; ``Pyramid`` replaces it. Heights are
int32 in quanta ``q_l = s_l / 256``, ``[row, col]``, row 0 south.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import ClassVar, Final, cast

import numpy as np
from numpy.typing import NDArray

from esker import grid
from esker.contract import TILE_CELLS
from esker.tiles import loops
from esker.tiles.bounds import Bounds, SubPatches, dilate, nest
from esker.tiles.codec import coding, entropy
from esker.tiles.codec.payload import SAMPLE_LIMIT, Ints, predict
from esker.tiles.stabiliser import Steadier, moved_along

BLOCK_CELLS: Final = 4
"""Changes are remembered per block of this many cells. What a changed sample moves on finer levels, through the
prediction's stencil of three samples a level, ends less than one block away."""

NARROW: Final = np.iinfo(np.int16)
NARROW_LEVEL: Final = 2
"""Coarser levels take so little that they are left as they are."""

Counts = NDArray[np.uint32]
Mask = NDArray[np.bool_]

PREVIEW_STEP: Final = 8
"""Quanta in which a preview changes samples of the finest level; half as many on each level above, so that all levels
are equally exact in metres, and an error of a parent is none to its children. Settled levels are exact."""
EARLY_PREVIEWS: Final = 8
"""Coarsest previews that are remembered: a finest preview is of one that was shown since its job began."""
FOLLOW_TILES: Final = 256
"""A level follows the movement of at most so many parents. With more, as after a change of all the ground, it starts
afresh."""


@dataclass(frozen=True)
class Level:
    """One level at one moment.

    ``stored``: (N_l, N_l) int32, read-only, or int16 where the level rests (``narrowed``). ``versions``: (2^l, 2^l)
    uint32, the stamp at which each tile last changed. ``stamp``: when the level was last put, changed or not;
    ``changed``: the newest of ``versions``.
    """

    level: int
    stored: Ints | NDArray[np.int16]
    versions: Counts
    stamp: int
    changed: int
    clock: int
    settled: bool
    zero: int = 0
    """What is added to samples that are stored in 16 bits."""

    @property
    def samples(self) -> Ints:
        """All samples, read-only: a copy where they are stored narrowed."""
        return self.window(slice(None), slice(None))

    def window(self, rows: slice, cols: slice) -> Ints:
        """Returns some of the samples: a view, or a copy where they are stored narrowed."""
        part = self.stored[rows, cols]
        if part.dtype == np.int32:
            return cast(Ints, part)
        whole = part.astype(np.int32)
        whole += np.int32(self.zero)
        whole.flags.writeable = False
        return whole

    def narrowed(self) -> Level:
        """Returns the level with its samples stored in half of the memory; itself where they do not fit.

        At level 4, 16 bits hold a quarter of the domain's side from the lowest sample to the highest.
        """
        if self.stored.dtype == np.int16:
            return self
        low, high = int(self.stored.min()), int(self.stored.max())
        if high - low > NARROW.max - NARROW.min:
            return self
        zero = low - NARROW.min
        stored = np.empty(self.stored.shape, dtype=np.int16)
        np.subtract(self.stored, np.int32(zero), out=stored, casting="unsafe")
        stored.flags.writeable = False
        return replace(self, stored=stored, zero=zero)


def quantise(
    heights: NDArray[np.float32],
    level: int,
    size_m: float,
    kept: Ints | None = None,
    step: int = 1,
) -> Ints:
    """Metres to quanta of the level, halves to even, saturating at +-2^28 quanta.

    With ``kept`` (same shape) a sample differs from its kept value by a multiple of ``step``, the nearest one, and by
    none while it is less than a step off: in fewer, rounder numbers a change takes fewer bytes. The decision is made
    per sample of the level, so the shared edges of neighbouring tiles stay equal. Heights must be finite.
    """
    with np.errstate(over="ignore"):
        steps = heights * np.float32(1.0 / grid.quantum(level, size_m))
    np.clip(steps, -SAMPLE_LIMIT, SAMPLE_LIMIT, out=steps)
    if kept is None:
        return np.asarray(np.rint(steps), dtype=np.int32)
    # All stays in float32: with int32 beside it numpy would compute in float64, four times as long.
    away = kept.astype(np.float32)
    np.subtract(steps, away, out=away)
    moved = np.abs(away) >= step
    out = kept.copy()
    out[moved] += np.rint(away[moved] / np.float32(step)).astype(np.int32) * np.int32(step)
    return np.clip(out, -SAMPLE_LIMIT, SAMPLE_LIMIT, out=out)


def follow_parents(samples: Ints, then: Level | None, now: Level | None, ratio: int = 2) -> Ints:
    """A level moved along with its parent, as every client's decoder moves it (``payload.follow``).

    ``samples``: (N_l, N_l); ``then`` and ``now``: the level above when the samples were put, and at present. Each
    parent tile moves its own four children. On an edge that two parents share both say the same, as the prediction
    there depends on the samples of that edge alone.
    """
    if then is None or now is None or then.stored is now.stored:
        return samples
    moved = np.argwhere(then.versions != now.versions)
    if not 0 < len(moved) <= FOLLOW_TILES:
        return samples
    out, before, after = samples.copy(), then.samples, now.samples

    def follow(tiles: NDArray[np.int64]) -> None:
        loops.followed(samples, before, after, tiles, TILE_CELLS, 9 - ratio, SAMPLE_LIMIT, out)

    coding.both(follow, *np.array_split(moved, 2))
    return out


def _depth(level: int) -> int:
    """Earlier states kept of a level: up to six, and no more than 64 MiB."""
    return max(1, min(6, (64 << 20) // (4 * grid.samples(level) ** 2)))


class Pyramid:
    """The newest quantised levels of one terrain. Mutable; owned by ``delivery.TileServer``."""

    ratio: ClassVar[int] = 2
    """Quanta of a level in one of the next coarser level (see ``payload.predict``)."""

    preview_step: ClassVar[int] = PREVIEW_STEP

    def __init__(self, size_m: float, levels: int) -> None:
        self.size_m = size_m
        self.levels = levels
        self.top = levels
        """The finest level that is solved at present; see ``limit``."""
        self.stamp = 0
        """Counts what is taken; every version and stamp is a value of this counter."""
        self.generation = 0
        """Rises when bounds may have changed enough to select again: see ``_store``."""
        self._levels: list[Level | None] = [None] * (levels + 1)
        self._subs = [SubPatches(level) for level in range(levels + 1)]
        self._dirty: list[Mask] = [np.zeros((1 << level, 1 << level), dtype=np.bool_) for level in range(levels + 1)]
        self._earlier: list[deque[Level]] = [deque(maxlen=_depth(level)) for level in range(levels + 1)]
        self._steadiers = [Steadier() for _ in range(levels + 1)]
        self._parents: list[Level | None] = [None] * (levels + 1)
        """Each level's parent as it was when the level was last put."""
        self._previewed = -1
        """Clock of the newest preview of the finest level."""
        self._early: deque[tuple[int, Ints]] = deque(maxlen=EARLY_PREVIEWS)
        """The coarsest level as it was shown for the last previews, with their clocks, oldest first."""
        self._touched = [np.zeros((16 << level, 16 << level), dtype=np.uint32) for level in range(levels)]
        """Stamps of each block's last change. The finest level moves nothing below it and keeps none."""
        self._lineage: list[Counts] = []
        self._lineage_stamp = -1
        self._bounds: Bounds | None = None
        self._bounds_stamp = -1

    def states(self, level: int) -> list[Level]:
        """Returns the level as it is and as it was before the last few changes, newest first."""
        newest = self._levels[level]
        return [] if newest is None else [newest, *self._earlier[level]]

    def forget_earlier(self, is_held: Callable[[int, Counts, Counts], bool]) -> int:
        """Forgets earlier states of levels that serve nobody; returns how many.

        ``is_held(level, versions, newer)``: whether somebody holds a tile of a state with these ``versions`` that no
        state with the ``newer`` ones has.
        """
        count = 0
        for level, earlier in enumerate(self._earlier):
            newest = self._levels[level]
            if newest is None or not earlier:
                continue
            kept, newer = [], newest.versions
            for state in earlier:
                if is_held(level, state.versions, newer):
                    kept.append(state)
                    newer = state.versions
            count += len(earlier) - len(kept)
            self._earlier[level] = deque(kept, maxlen=earlier.maxlen)
        return count

    def narrow(self) -> None:
        """Stores all levels in less memory, for when nobody draws: the next put of a level widens it again."""
        found: dict[int, Level] = {}

        def narrowed(state: Level) -> Level:
            # A level and what its children remember of it stay one array: that is how they are known to be the same.
            now = found.get(id(state.stored)) or found.setdefault(id(state.stored), state.narrowed())
            return state if now.stored is state.stored else replace(state, stored=now.stored, zero=now.zero)

        for level in range(NARROW_LEVEL, self.levels + 1):
            if (state := self._levels[level]) is not None:
                self._levels[level] = narrowed(state)
            self._earlier[level] = deque(map(narrowed, self._earlier[level]), maxlen=self._earlier[level].maxlen)
            if level < self.levels and (parent := self._parents[level + 1]) is not None:
                self._parents[level + 1] = narrowed(parent)

    def level(self, level: int) -> Level | None:
        """Returns the level as it is now, None before it first came."""
        return self._levels[level]

    def settle(self, clock: int, level: int, heights: NDArray[np.float32]) -> int:
        """Replaces a level by settled heights, which are rounded exactly; returns the number of tiles of which a
        sample changed.

        ``heights``: (N_l, N_l) float32 metres, not to be changed afterwards. Raises ValueError for a wrong level or
        shape, or for heights that are not finite, and changes nothing then.
        """
        if not self._takes(level, heights):
            return 0
        self._steadiers[level].settled(clock, heights)
        return self._store(clock, level, heights, True)

    def note(self, clock: int, level: int, heights: NDArray[np.float32]) -> None:
        """Takes note of a coarse preview, and shows nothing of it: its level is injected from the finest preview, which
        is expected soon (docs/decisions/0014-consistent-previews.md). Raises like ``settle``."""
        if self._takes(level, heights) and not self._comes_late(clock, level, heights):
            self._steadiers[level].note(clock, heights)

    def preview(self, clock: int, level: int, heights: NDArray[np.float32]) -> int:
        """Replaces a level by a preview; returns the number of tiles of which a sample changed.

        Heights are stabilised (``stabiliser``), then shown as they were but for coarse steps (``quantise``). Between a
        complete preview and the settled levels of the same clock a solver may repeat coarse levels as a sign of life,
        or bring them only now: these are not shown, as they would only move the ground there and back. Takes and
        raises what ``settle`` does.
        """
        if not self._takes(level, heights) or self._comes_late(clock, level, heights):
            return 0
        stable = self._steadiers[level].preview(clock, heights)
        if level < self.top:
            count = self._store(clock, level, stable, False)
            if level == 0:
                self._early_shown(clock)
            return count
        self._previewed = clock
        count = 0
        stable, newer = self._ahead(clock, stable)
        for coarse in range(level):
            old = self._levels[coarse]
            if (old is None or old.clock != clock) and not (newer and coarse == 0):
                step = 1 << (level - coarse)
                count += self._store(clock, coarse, np.ascontiguousarray(stable[::step, ::step]), False)
        return count + self._store(clock, level, stable, False)

    def _takes(self, level: int, heights: NDArray[np.float32]) -> bool:
        """Returns whether a level is solved at present. Raises ValueError, see ``settle``."""
        if not 0 <= level <= self.levels:
            raise ValueError(f"level {level} is not one of 0..{self.levels}")
        n = grid.samples(level)
        if heights.shape != (n, n):
            raise ValueError(f"level {level} has {n}x{n} samples, not {heights.shape}")
        if level > self.top:
            return False
        if not loops.finite(heights):
            raise ValueError(f"level {level} has heights that are not finite")
        return True

    def _comes_late(self, clock: int, level: int, heights: NDArray[np.float32]) -> bool:
        """Returns whether a coarse preview comes behind the finest one of its clock; then it is only noted."""
        if level == self.top or self._previewed != clock:
            return False
        self._steadiers[level].late(clock, heights)
        return True

    def _early_shown(self, clock: int) -> None:
        """Remembers how the coarsest level is shown for this clock."""
        now = self._levels[0]
        assert now is not None
        if self._early and self._early[-1][0] == clock:
            self._early.pop()
        self._early.append((clock, now.samples))

    def _ahead(self, clock: int, heights: NDArray[np.float32]) -> tuple[NDArray[np.float32], bool]:
        """Moves a finest preview by what the coarsest level has moved since it showed the same clock.

        Also returns whether the coarsest level shows a newer clock: strokes go on while the finest preview of older
        ones is made.
        """
        then = next((samples for shown, samples in self._early if shown == clock), None)
        if then is None or self._early[-1][0] == clock:
            return heights, False
        while self._early[0][0] != clock:
            self._early.popleft()
        return moved_along(heights, then, self._early[-1][1], grid.quantum(0, self.size_m)), True

    def begin(self, clock: int, count: int) -> None:
        """Makes those of the coarsest ``count`` levels zero that were never put."""
        for level in range(min(count, self.top + 1)):
            if self._levels[level] is None:
                n = grid.samples(level)
                self._store(clock, level, np.zeros((n, n), dtype=np.float32), True)

    def _store(self, clock: int, level: int, heights: NDArray[np.float32], settled: bool) -> int:
        """Quantises the heights that are to be shown of a level; versions rise where a sample changed.

        Returns how many tiles changed.
        """
        old = self._levels[level]
        before = None if old is None else old.samples
        parent = self._levels[level - 1] if level else None
        kept = None
        if before is not None and not settled:
            kept = follow_parents(before, self._parents[level], parent, self.ratio)
        self._parents[level] = parent
        step = max(1, self.preview_step >> (self.top - level))
        if kept is None:
            samples = quantise(heights, level, self.size_m)
        else:
            samples = np.empty(heights.shape, dtype=np.int32)
            scale = np.float32(1.0 / grid.quantum(level, self.size_m))
            loops.quantised(heights, kept, scale, step, np.float32(SAMPLE_LIMIT), samples)
        stamp = self.stamp + 1
        changed = self._touch(level, before, samples, stamp)
        count = int(np.count_nonzero(changed))
        if old is not None and not count:
            self._levels[level] = replace(old, stamp=stamp, clock=clock, settled=settled)
        else:
            if old is not None:
                self._earlier[level].appendleft(old)
            samples.flags.writeable = False
            versions = np.where(changed, np.uint32(stamp), 0 if old is None else old.versions).astype(np.uint32)
            versions.flags.writeable = False
            self._levels[level] = Level(level, samples, versions, stamp, stamp, clock, settled)
            self._mark(level, changed)
        self.stamp = stamp
        if old is None or level == self.top:
            self.generation += 1
        return count

    def _touch(self, level: int, old: Ints | None, new: Ints, stamp: int) -> Mask:
        """Remembers which blocks hold a sample that moved; returns which tiles do."""
        side = 1 << level
        cells = TILE_CELLS if level == self.levels else BLOCK_CELLS
        per = TILE_CELLS // cells
        blocks = np.full((side * per, side * per), old is None, dtype=np.bool_)
        if old is not None:
            loops.changed(new, old, cells, blocks)
        if level == self.levels:
            return blocks
        self._touched[level][blocks] = stamp
        return np.asarray(blocks.reshape(side, per, side, per).any(axis=(1, 3)), dtype=np.bool_)

    def lineage(self) -> list[Counts]:
        """Returns for each level, (2^l, 2^l), when an ancestor last changed where it moves this tile, 0 for never."""
        if self._lineage_stamp == self.stamp:
            return self._lineage
        self._lineage = [np.zeros((1 << level, 1 << level), dtype=np.uint32) for level in range(self.levels + 1)]
        for ancestor, touched in enumerate(self._touched):
            near = dilate(touched)
            for level in range(ancestor + 1, self.levels + 1):
                side, blocks = 1 << level, near.shape[0]
                if blocks >= side:
                    per = blocks // side
                    found = near.reshape(side, per, side, per).max(axis=(1, 3))
                else:
                    found = near.repeat(side // blocks, axis=0).repeat(side // blocks, axis=1)
                np.maximum(self._lineage[level], found, out=self._lineage[level])
        self._lineage_stamp = self.stamp
        return self._lineage

    def _mark(self, level: int, changed: Mask) -> None:
        """Returns the tiles whose bounds are recomputed: the changed ones and their children, whose error is against
        them."""
        self._dirty[level] |= changed
        if level < self.levels:
            self._dirty[level + 1] |= changed.repeat(2, axis=0).repeat(2, axis=1)

    def changes(self) -> Counts:
        """Returns for each tile of the finest level when it or an ancestor last changed there, 0 for never."""
        level = self._levels[self.levels]
        above = self.lineage()[self.levels]
        return above if level is None else np.maximum(above, level.versions)

    def limit(self, top: int) -> None:
        """Solves only levels 0..``top`` from now on: levels above are forgotten. Raises ValueError."""
        if not 0 <= top <= self.levels:
            raise ValueError(f"level {top} is not one of 0..{self.levels}")
        for level in range(top + 1, self.levels + 1):
            self._levels[level] = None
            self._earlier[level].clear()
            self._steadiers[level] = Steadier()
        self.top = top
        self.stamp += 1
        self.generation += 1

    def sub_patches(self, level: int) -> SubPatches:
        """Returns the bounds of a level's sub-patches as they are now; not to be changed."""
        self.bounds()
        return self._subs[level]

    def bounds(self) -> Bounds:
        """Returns the bounds of the newest levels, recomputed where samples changed since the last call."""
        if self._bounds is not None and self._bounds_stamp == self.stamp:
            return self._bounds
        for i, level in enumerate(self._levels):
            if level is None:
                continue
            parent = self._levels[i - 1] if i else None
            self._subs[i].update(level.window, None if parent is None else parent.window, self._dirty[i])
            self._dirty[i][:] = False
        self._bounds = nest(self._subs, [level is not None for level in self._levels], self.size_m)
        self._bounds_stamp = self.stamp
        return self._bounds


@lru_cache(maxsize=1)
def warm() -> None:
    """Goes once through all compiled loops that a server runs, so that they are compiled before anybody draws.

    This takes seconds, once a machine. What only clients run, the decoder, they compile.
    """
    pyramid = Pyramid(TILE_CELLS, 1)
    for clock, settled in enumerate((False, True, False, False)):
        for level in (0, 1):
            n = grid.samples(level)
            take = pyramid.settle if settled else pyramid.preview
            take(clock, level, np.full((n, n), clock, dtype=np.float32))
        pyramid.bounds()
    for amplitude in (1, SAMPLE_LIMIT):
        predict(np.full((TILE_CELLS + 1, TILE_CELLS + 1), amplitude, dtype=np.int32))
    coding.warm()
    for lattice in (False, True):
        entropy.encode(np.eye(TILE_CELLS + 1, dtype=np.int64), lattice)
