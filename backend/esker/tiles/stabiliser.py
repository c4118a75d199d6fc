"""Previews that move the ground only where the drawing does (DESIGN 5.3, 8).

A preview of a coarse level differs from the settled ground beside strokes, by up to a third of the relief, everywhere:
shown as it is, the whole landscape would wobble, and be sent again, whenever anybody starts or stops to draw. But both
are pure functions of the document, so the difference is known from the last settled solve. With its preview ``p0`` and
its settled heights ``s0``, a new preview ``p1`` is shown as

    p1 + sign(b) * max(|b| - |p1 - p0|, 0),    b = s0 - p0

which is the settled ground where the preview has not changed, and the new preview where it changed by more than the
correction is worth. The rule is local to a sample, so neighbouring tiles agree on shared edges. Of the three ``s0``,
which others hold too, and ``b`` are kept; ``p0`` is their difference, to a rounding.

While strokes go on, a finest preview is of older ones than the coarsest level shows by then: ``moved_along``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from esker.contract import TILE_CELLS
from esker.tiles import loops
from esker.tiles.codec.payload import Ints

Heights = NDArray[np.float32]


class Steadier:
    """One level's memory of its last settled solve. Keeps references to the arrays given; they must not change."""

    def __init__(self) -> None:
        self._preview: tuple[int, Heights] | None = None
        """The last preview and its clock, until its settled heights come."""
        self._reference: tuple[Heights, Heights] | None = None
        """The settled heights, and what they differ by from their preview."""
        self._settled = -1
        """The clock of the reference."""

    def settled(self, clock: int, heights: Heights) -> None:
        """Says that the level is final for ``clock``.

        Its preview, if it was one of the same clock, becomes the reference.
        """
        if self._preview is not None and self._preview[0] == clock:
            self._reference = (heights, heights - self._preview[1])
        elif self._reference is not None and self._settled == clock:
            before, correction = self._reference
            self._reference = (heights, heights - (before - correction))
        else:
            self._reference = None
        self._preview, self._settled = None, clock

    def note(self, clock: int, heights: Heights) -> None:
        """Remembers a preview that is not shown: the settled heights of its clock will be compared with it."""
        self._preview = (clock, heights)

    def late(self, clock: int, heights: Heights) -> None:
        """Notes a preview that comes behind a finer one of its clock and is not shown, unless one was noted before."""
        if self._preview is None or self._preview[0] != clock:
            self.note(clock, heights)

    def preview(self, clock: int, heights: Heights) -> Heights:
        """Returns what to show for a preview: ``heights`` itself when nothing is known."""
        self.note(clock, heights)
        if self._reference is None:
            return heights
        out = np.empty_like(heights)
        loops.steadied(heights, *self._reference, out)
        return out


def steadied(heights: Heights, settled: Heights, correction: Heights) -> Heights:
    """Returns what to show for a preview: the rule above for ``p1``, ``s0`` and ``b``. Twin of ``loops.steadied``."""
    moved = heights - (settled - correction)
    np.abs(moved, out=moved)
    left = np.abs(correction)
    left -= moved
    np.maximum(left, 0, out=left)
    np.copysign(left, correction, out=left)
    left += heights
    return left


def moved_along(heights: NDArray[np.float32], then: Ints, now: Ints, quantum: float) -> NDArray[np.float32]:
    """Heights of level l, (N_l, N_l), metres, moved by what level 0 has moved, interpolated as the prediction of
    tiles interpolates, each level from the one above; the same array if nowhere.

    ``then``, ``now``: level 0, (65, 65) in quanta of ``quantum`` metres.
    """
    change = now - then
    rows, cols = np.flatnonzero(change.any(axis=1)), np.flatnonzero(change.any(axis=0))
    if not rows.size:
        return heights
    # what a sample moves ends less than three cells from it; the prediction needs four samples a side
    window = tuple(slice(max(0, int(v[0]) - 4), min(TILE_CELLS, int(v[-1]) + 4) + 1) for v in (rows, cols))
    move = change[window].astype(np.float32) * np.float32(quantum)
    step = 1
    while TILE_CELLS * step + 1 < heights.shape[0]:
        for _ in range(2):
            move = _between(move).T
        step *= 2
    out = heights.copy()
    out[tuple(slice(w.start * step, (w.stop - 1) * step + 1) for w in window)] += move
    return out


def _between(a: NDArray[np.float32]) -> NDArray[np.float32]:
    """Upsamples rows, (m, n) -> (m, 2n - 1): the four-point rule (-1, 9, 9, -1)/16, linear beside the ends."""
    out = np.empty((a.shape[0], 2 * a.shape[1] - 1), dtype=np.float32)
    out[:, ::2] = a
    odd = out[:, 1::2]
    np.add(a[:, :-1], a[:, 1:], out=odd)
    odd *= np.float32(0.5)
    odd[:, 1:-1] *= np.float32(1.125)
    odd[:, 1:-1] -= (a[:, :-3] + a[:, 3:]) * np.float32(1 / 16)
    return out
