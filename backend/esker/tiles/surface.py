"""The elevation layers' ground under the strokes' offsets, and their sum, which is what is drawn (DESIGN 6, 7, 11).

Offsets and base are pyramids of their own, in the same quanta, so that each is streamed only when it changes. Views
select by their sum. Where no layer lies there is no base, and the sum is the offsets themselves.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from esker import grid
from esker.tiles.bounds import Bounds, SubPatches, nest
from esker.tiles.codec.payload import SAMPLE_LIMIT, Ints
from esker.tiles.pyramid import Counts, Level, Pyramid


class BasePyramid(Pyramid):
    """The newest levels of the base. They are never previews: each put is final until the layers change."""

    def put_base(self, clock: int, level: int, heights: NDArray[np.float32]) -> int:
        """Replaces a level: (N_l, N_l) float32 metres. See ``Pyramid.settle``; raises the same.

        A base that was never anything but zero is not held: what no layer lies under is not sent.
        """
        if 0 <= level <= self.top and heights.shape == (grid.samples(level),) * 2 and np.isfinite(heights).all():
            if not self.held and not heights.any():
                return 0
            self.begin(clock, level)
        return self.settle(clock, level, heights)

    @property
    def held(self) -> bool:
        """True once some layer was there."""
        return self.level(0) is not None


def total(offset: Ints, base: Ints) -> Ints:
    """Returns the quanta of the ground as it is drawn, offsets and base, saturating like both."""
    return np.asarray(np.clip(offset + base, -SAMPLE_LIMIT, SAMPLE_LIMIT))


class Surface:
    """Bounds and changes of offsets plus base. Owned by ``delivery.TileServer``; used from its thread."""

    def __init__(self, offsets: Pyramid, base: BasePyramid) -> None:
        """Both pyramids have the same size and levels."""
        self._offsets, self._base = offsets, base
        self._subs: list[SubPatches] | None = None
        n = offsets.levels + 1
        self._seen: list[tuple[Level | None, Level | None]] = [(None, None)] * n
        """The samples from which each level of ``_subs`` was made."""
        self._bounds: tuple[int, Bounds] | None = None
        self._moved: tuple[Counts, Counts] | None = None
        """The changes that each pyramid reported last."""
        self._changes = np.zeros((1 << offsets.levels,) * 2, dtype=np.uint32)
        self._changes_stamp = -1

    @property
    def size_m(self) -> float:
        """Side of the domain, metres."""
        return self._offsets.size_m

    @property
    def levels(self) -> int:
        """The finest level that is solved as a whole."""
        return self._offsets.levels

    @property
    def stamp(self) -> int:
        """A counter that rises with every put of either part."""
        return self._offsets.stamp + self._base.stamp

    @property
    def generation(self) -> int:
        """A counter that rises when a selection might come out differently."""
        return self._offsets.generation + self._base.generation

    def changes(self) -> Counts:
        """Per tile of the finest level: the stamp by which it was last known to have changed, 0 for never."""
        if not self._base.held:
            return self._offsets.changes()
        if self._changes_stamp != self.stamp:
            now = self._offsets.changes(), self._base.changes()
            if self._moved is None:
                self._changes[:] = self.stamp
            else:
                was = self._moved
                self._changes[(now[0] != was[0]) | (now[1] != was[1])] = self.stamp
            self._moved = (now[0].copy(), now[1].copy())
            self._changes_stamp = self.stamp
        return self._changes

    def sub_patches(self, level: int) -> SubPatches:
        """Returns the bounds of a level's sub-patches as they are now; not to be changed."""
        if not self._base.held:
            return self._offsets.sub_patches(level)
        self.bounds()
        assert self._subs is not None
        return self._subs[level]

    def bounds(self) -> Bounds:
        """Bounds of the newest levels, recomputed where a sample of either part changed since the last call."""
        if not self._base.held:
            return self._offsets.bounds()
        if self._bounds is not None and self._bounds[0] == self.stamp:
            return self._bounds[1]
        if self._subs is None:
            self._subs = [SubPatches(level) for level in range(self.levels + 1)]
        above: NDArray[np.bool_] | None = None
        for level, subs in enumerate(self._subs):
            dirty = self._dirty(level)
            if dirty is not None:
                both = dirty if above is None else dirty | above.repeat(2, axis=0).repeat(2, axis=1)
                subs.update(self._window(level), self._window(level - 1) if level else None, both)
            above = dirty
            self._seen[level] = self._offsets.level(level), self._base.level(level)
        valid = [self._offsets.level(level) is not None for level in range(self.levels + 1)]
        found = nest(self._subs, valid, self.size_m)
        self._bounds = self.stamp, found
        return found

    def _dirty(self, level: int) -> NDArray[np.bool_] | None:
        """Returns which tiles of the level changed since ``bounds`` saw it; None where there is no such level."""
        now = self._offsets.level(level), self._base.level(level)
        if now[0] is None:
            return None
        out = np.zeros((1 << level,) * 2, dtype=np.bool_)
        for new, old in zip(now, self._seen[level], strict=True):
            if new is None or old is None:
                out |= new is not old
            else:
                out |= new.versions != old.versions
        return out

    def _window(self, level: int) -> Callable[[slice, slice], Ints]:
        offset, base = self._offsets.level(level), self._base.level(level)
        assert offset is not None
        if base is None:
            return offset.window
        return lambda rows, cols: total(offset.window(rows, cols), base.window(rows, cols))
