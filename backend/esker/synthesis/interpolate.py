"""Interpolation of a parent's samples at a child's (docs/synthesis.md, "Interpolation").

Child i lies at parent p = i / 2 (even) or half-way from p = (i - 1) / 2 to p + 1 (odd). Every rule is a stencil over
p - 1 .. p + 2 per axis, x first, then y. Edges of a tile depend on what both tiles beside it hold, never on which of
them is asked.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from esker.synthesis.state import Array


@dataclass(frozen=True)
class Window:
    """A rectangle of samples of a level: rows r0..r1, columns c0..c1, half open, global indices.

    It may reach outside of the domain: samples there are what the border of the outermost tiles holds.
    """

    level: int
    r0: int
    r1: int
    c0: int
    c1: int

    @property
    def shape(self) -> tuple[int, int]:
        """Rows, columns."""
        return self.r1 - self.r0, self.c1 - self.c0

    @property
    def rows(self) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
        """Global row indices j."""
        return np.arange(self.r0, self.r1, dtype=np.int64)

    @property
    def cols(self) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
        """Global column indices i."""
        return np.arange(self.c0, self.c1, dtype=np.int64)

    def parent(self) -> Window:
        """The samples of the next coarser level from which these are made: p - 1 of the first to p + 1 of the last, or
        p + 2 if that is odd. The border of a tile is made from the border of its parent."""
        r, c = self.r1 - 1, self.c1 - 1
        return Window(
            self.level - 1,
            (self.r0 >> 1) - 1, (r >> 1) + 2 + (r & 1),
            (self.c0 >> 1) - 1, (c >> 1) + 2 + (c & 1),
        )  # fmt: skip

    def within(self, other: Window) -> tuple[slice, slice]:
        """Where this window lies in an array of ``other``. Raises ValueError where it does not."""
        if self.level != other.level:
            raise ValueError(f"a window of level {self.level} does not lie in one of level {other.level}")
        if not (other.r0 <= self.r0 <= self.r1 <= other.r1 and other.c0 <= self.c0 <= self.c1 <= other.c1):
            raise ValueError(f"{self} does not lie in {other}")
        return slice(self.r0 - other.r0, self.r1 - other.r0), slice(self.c0 - other.c0, self.c1 - other.c0)


Taps = tuple[tuple[float, float, float, float], tuple[float, float, float, float]]
"""Weights of p - 1 .. p + 2 at even and at odd children."""

B_SPLINE: Final[Taps] = ((1 / 8, 6 / 8, 1 / 8, 0), (0, 1 / 2, 1 / 2, 0))
"""Cubic B-spline subdivision (paper 1, section 4: smooth surfaces)."""
DERIVATIVE: Final[Taps] = ((-1 / 2, 0, 1 / 2, 0), (0, -1, 1, 0))
"""First derivative, times the parent's spacing."""
SECOND: Final[Taps] = ((1, -2, 1, 0), (1 / 2, -1 / 2, -1 / 2, 1 / 2))
"""Second derivative, times the square of the parent's spacing."""
FOUR_POINT: Final[Taps] = ((0, 1, 0, 0), (-1 / 16, 9 / 16, 9 / 16, -1 / 16))
"""Interpolating subdivision (Deslauriers and Dubuc): it keeps the parent's samples."""


def along_x(z: Array, taps: Taps, parent: Window, child: Window) -> Array:
    """Values of the rows of ``parent`` at the columns of ``child``. ``z``: (rows, columns) of ``parent``."""
    out = np.empty((z.shape[0], child.shape[1]), dtype=z.dtype)
    for odd, weights in enumerate(taps):
        to, start, count = _places(odd, parent.c0, child.c0, child.c1)
        parts = [w * z[:, start + k : start + k + count] for k, w in enumerate(weights) if w != 0]
        out[:, to::2] = sum(parts[1:], parts[0])
    return out


def along_y(z: Array, taps: Taps, parent: Window, child: Window) -> Array:
    """Interpolates along columns, as ``along_x`` does along rows. ``z``: (rows of ``parent``, any)."""
    out = np.empty((child.shape[0], z.shape[1]), dtype=z.dtype)
    for odd, weights in enumerate(taps):
        to, start, count = _places(odd, parent.r0, child.r0, child.r1)
        parts = [w * z[start + k : start + k + count] for k, w in enumerate(weights) if w != 0]
        out[to::2] = sum(parts[1:], parts[0])
    return out


def _places(odd: int, parent: int, first: int, stop: int) -> tuple[int, int, int]:
    """Where the even or odd ones of children ``first`` to ``stop`` begin, where p - 1 of their first parent lies among
    samples that begin at ``parent``, and how many there are."""
    at = first + ((first ^ odd) & 1)
    return at - first, (at >> 1) - 1 - parent, max(0, (stop - at + 1) // 2)


def upsampled(z: Array, taps: Taps, parent: Window, child: Window) -> Array:
    """Values of ``parent`` at the samples of ``child`` by the same stencil along both axes."""
    return along_y(along_x(z, taps, parent, child), taps, parent, child)
