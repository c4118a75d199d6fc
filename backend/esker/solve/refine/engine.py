"""One step of refinement of one window: from the parent's fields to those of the next level (DESIGN 5.6).

Cubic prolongation, then weighted Jacobi sweeps of both steps of the solver with the constraints of the finer level:
first the two gradient components, then the heights with them as guidance, with a correction on a coarse grid
(``correction``) before the last of them. Each sample is a function of the samples
within HALO of it, and is computed by the same operations in every window: windows agree bit for bit on what they share.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final, NamedTuple, Protocol

import numpy as np
from numpy.polynomial.legendre import legroots
from numpy.typing import NDArray

from esker import grid
from esker.contract import CHEBYSHEV_HIGH, TerrainSettings
from esker.solve import reference
from esker.solve.constraints import raster_reference
from esker.solve.constraints.constraints import BIN, BinBox, Tables
from esker.solve.opencl.device import Device
from esker.solve.refine import correction, pocket
from esker.solve.refine.base_blocks import BaseWindows

GRADIENT_SWEEPS: Final = 8
FIRST_SWEEPS: Final = 36
"""Sweeps of the height before its correction, which sees what they leave."""
LAST_SWEEPS: Final = 4
"""Sweeps of the height after its correction. All counts are even, and as large as whole bins have room for: tiles begin
on bins, so that a halo of 127 takes no more of them than one of 113. docs/decisions/0060-pockets.md."""
GRADIENT_LOW: Final = 0.25
"""The sweeps of the gradient damp errors from here upward."""
CORRECTED: Final = LAST_SWEEPS + pocket.REACH
"""Samples around a window whose residuals count."""
SWEPT: Final = CORRECTED + 1
"""Samples around a window that are right before its correction."""
HALO: Final = SWEPT + FIRST_SWEEPS + GRADIENT_SWEEPS
"""Samples around a window that take part. Of the first sweep's samples the right-hand side needs one less, and its
divergence one more."""
CHANNELS: Final = 3
"""d/dx, d/dy, height."""

Values = NDArray[np.float32]
Fields = NDArray[np.float32]
"""(CHANNELS, rows, columns): d/dx, d/dy (metres per metre), height (metres)."""


class Span(NamedTuple):
    """Samples of a level: rows r0 .. r1 - 1, columns c0 .. c1 - 1."""

    r0: int
    r1: int
    c0: int
    c1: int

    def grown(self, by: int, samples: int) -> Span:
        """Returns the span with ``by`` more samples on every side, as far as the level goes."""
        return Span(max(0, self.r0 - by), min(samples, self.r1 + by), max(0, self.c0 - by), min(samples, self.c1 + by))

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns)."""
        return self.r1 - self.r0, self.c1 - self.c0


@dataclass(frozen=True)
class Step:
    """Spans of samples that one step computes and reads.

    core: the result; box: the bins of the window; parent: what is read of the next coarser level.
    """

    level: int
    core: Span
    box: BinBox
    parent: Span

    @property
    def window(self) -> Span:
        """The samples of the window: it begins on a bin and ends where the level does."""
        n = grid.samples(self.level)
        by0, by1, bx0, bx1 = self.box
        return Span(by0 * BIN, min(by1 * BIN, n), bx0 * BIN, min(bx1 * BIN, n))


@lru_cache(maxsize=4096)
def step(level: int, core: Span) -> Step:
    """The step that computes the samples ``core`` of ``level``."""
    n = grid.samples(level)
    halo = core.grown(HALO, n)
    box = halo.r0 // BIN, -(-halo.r1 // BIN), halo.c0 // BIN, -(-halo.c1 // BIN)
    r0, r1, c0, c1 = (box[0] * BIN, min(n, box[1] * BIN), box[2] * BIN, min(n, box[3] * BIN))
    under = Span(r0 // 2, (r1 - 1) // 2 + 1, c0 // 2, (c1 - 1) // 2 + 1)
    # the cubic between samples i and i + 1 needs i - 1 and i + 2
    parent = Span(under.r0 - 1, under.r1 + 2, under.c0 - 1, under.c1 + 2)
    m = grid.samples(level - 1)
    clipped = Span(max(0, parent.r0), min(m, parent.r1), max(0, parent.c0), min(m, parent.c1))
    return Step(level, core, box, clipped)


@lru_cache(maxsize=1)
def gradient_weights() -> NDArray[np.float64]:
    """Relaxations of the sweeps of the gradient: Chebyshev's on [GRADIENT_LOW, 2] of the scaled spectrum."""
    mid, half = (CHEBYSHEV_HIGH + GRADIENT_LOW) / 2, (CHEBYSHEV_HIGH - GRADIENT_LOW) / 2
    k = np.arange(GRADIENT_SWEEPS)
    return 1 / _leja(mid + half * np.cos(np.pi * (2 * k + 1) / (2 * GRADIENT_SWEEPS)))


@lru_cache(maxsize=2)
def height_weights(sweeps: int) -> NDArray[np.float64]:
    """Relaxations of sweeps of the height, whose polynomial is the smallest in the mean on the scaled spectrum.

    Of all polynomials p of their degree n with p(0) = 1 the one with the least integral of p^2 over [0, 2], which is
    2 / (n + 1)^2: a kernel polynomial (Stiefel 1958), whose roots are those of (P_n - P_n+1)(1 - t), Legendre's P, but
    for the one at 0. What is nearly as smooth as the window is wide shrinks more than with Chebyshev's polynomial of an
    interval, which must leave that out, and so do kinks.
    """
    series = np.zeros(sweeps + 2)
    series[-2:] = 1, -1
    return 1 / _leja(1 - np.sort(legroots(series).real)[:-1])


def _leja(roots: NDArray[np.float64]) -> NDArray[np.float64]:
    """Roots in Leja's order (Calvetti and Reichel 1996), the largest first, so that rounding errors do not grow: in
    their natural order float32 would lose all digits."""
    left = np.sort(roots)
    order: list[float] = []
    while len(left):
        farness = np.log(np.abs(left[:, None] - order)).sum(axis=1) if order else left
        k = int(np.argmax(farness))
        order.append(float(left[k]))
        left = np.delete(left, k)
    return np.asarray(order)


def with_ghosts(parent: NDArray[Any], at: Step) -> NDArray[Any]:
    """The parent's samples with a ring of ghosts: beyond the level's border by quadratic extrapolation.

    Shape (channels, rows + 2, columns + 2) around ``at.window``'s parents; where the level goes on, its own samples.
    """
    out, m = parent, grid.samples(at.level - 1)
    for axis, low, high in ((1, at.parent.r0, at.parent.r1), (2, at.parent.c0, at.parent.c1)):
        a = np.moveaxis(out, axis, 0)
        south = [3 * a[:1] - 3 * a[1:2] + a[2:3]] if low == 0 else []
        north = [3 * a[-1:] - 3 * a[-2:-1] + a[-3:-2]] if high == m else []
        out = np.moveaxis(np.concatenate([*south, a, *north]), 0, axis)
    return out


class StrokeWindows(Protocol):
    """The strokes, as far as a step needs them."""

    settings: TerrainSettings
    base: BaseWindows | None

    def tables(self, level: int, box: BinBox) -> Tables:
        """The rasteriser's tables of a box of bins."""

    def shared_tables(self, level: int, box: BinBox) -> Generator[None, None, Tables]:
        """Yields, and returns at its end, the tables for kernels.

        They are made bit by bit: lists may name strokes that do not reach the box.
        """

    def bins_digest(self, level: int, box: BinBox) -> bytes:
        """Digest of all that decides the constraints of a box of bins at this level."""


class Pending(Protocol):
    """A step under way. ``prepared``: what it shares with others that begin is known; ``ready``: ``fields`` will not
    wait."""

    @property
    def prepared(self) -> bool: ...

    @property
    def ready(self) -> bool: ...

    def poll(self) -> bool:
        """Does a little of what the host has to do for it; False: for now nothing. Raises DeviceError."""

    def prepare(self) -> None:
        """Waits until it is ``prepared``. Raises DeviceError."""

    def fields(self) -> Fields:
        """The fields of the step's core; waits for them. Raises DeviceError."""


class Engine(Protocol):
    """Computes steps.

    device: on what; None is NumPy. ahead: how many steps may be under way at once. begun: how many there were so far.
    is_empty: there is nothing to ``release``.
    """

    begun: int

    @property
    def device(self) -> Device | None: ...

    @property
    def ahead(self) -> int: ...

    @property
    def is_empty(self) -> bool: ...

    def begin(self, at: Step, strokes: StrokeWindows, parent: Fields) -> Pending:
        """Begins to make ``at.core``'s fields from the parent's on ``at.parent``. Raises DeviceError."""

    def clear(self) -> None:
        """Drop what is kept between steps."""

    def release(self) -> bool:
        """Drops the memory of steps, too, unless one is under way; returns whether it did."""


@dataclass(frozen=True)
class Done:
    """A step that is finished."""

    made: Fields
    prepared = ready = True

    def poll(self) -> bool:
        """See ``Pending``."""
        return False

    def prepare(self) -> None:
        """See ``Pending``."""

    def fields(self) -> Fields:
        """See ``Pending``."""
        return self.made


class NumpyEngine:
    """The twin in float64, and what serves without OpenCL."""

    device = None
    ahead = 1
    begun = 0
    is_empty = True

    def clear(self) -> None:
        """Nothing is kept."""

    def release(self) -> bool:
        """Nothing is held."""
        return False

    def begin(self, at: Step, strokes: StrokeWindows, parent: Fields) -> Pending:
        """Nothing is under way: the step is done at once."""
        tables = strokes.tables(at.level, at.box)
        under = None if strokes.base is None else strokes.base.window(at.level, at.window).astype(np.float64)
        c = raster_reference.rasterise(tables, under)
        f = c.height_f
        if under is not None:
            f = reference.over_base(f, c.height_d, c.share, c.target, under, tables.spacing_m)
        u = prolongation(with_ghosts(parent.astype(np.float64), at), at.window)
        gradient = sweeps(u[:2], c.gradient_f, c.gradient_d[None], tables.screening, gradient_weights())
        fixed = c.height_d[None] < 0
        rhs = reference.divergence(f[None], c.height_d[None], gradient, tables.spacing_m)
        start = np.where(fixed, f[None], u[2:])
        height = relaxed(start, rhs, c.height_d[None], tables.screening)
        w, core = at.window, at.core
        rows, columns = slice(core.r0 - w.r0, core.r1 - w.r0), slice(core.c0 - w.c0, core.c1 - w.c0)
        return Done(np.concatenate([gradient, height])[:, rows, columns].astype(np.float32))


def prolongation(parent: NDArray[np.float64], window: Span) -> NDArray[np.float64]:
    """The samples of ``window`` by the cubic through four samples; parent: ``with_ghosts``."""
    for axis, count in ((1, window.shape[0]), (2, window.shape[1])):
        a = np.moveaxis(parent, axis, 0)
        between = (9 * (a[1:-2] + a[2:-1]) - (a[:-3] + a[3:])) / 16
        out = np.empty((count, *a.shape[1:]))
        out[::2] = a[1 : 1 + (count + 1) // 2]
        out[1::2] = between[: count // 2]
        parent = np.moveaxis(out, 0, axis)
    return parent


def relaxed(
    u: NDArray[np.float64], rhs: NDArray[np.float64], d: NDArray[np.float64], screening: float
) -> NDArray[np.float64]:
    """The height step of a window from its start, (1, rows, columns)."""
    u = sweeps(u, rhs, d, screening, height_weights(FIRST_SWEEPS))
    residual = reference.residual(u, rhs, d, screening)
    u = correction.corrected(u[0], residual[0], d[0], screening)[None]
    return sweeps(u, rhs, d, screening, height_weights(LAST_SWEEPS))


def sweeps(
    u: NDArray[np.float64],
    rhs: NDArray[np.float64],
    d: NDArray[np.float64],
    screening: float,
    weights: NDArray[np.float64],
) -> NDArray[np.float64]:
    """A sweep for each weight; the window's ends are mirrored like the level's borders."""
    q = np.where(d < 0, 0.0, 1 / (4 + screening + np.maximum(d, 0)))
    for w in weights:
        u = u + w * q * reference.residual(u, rhs, d, screening)
    return u
