"""The cycle, as data flow (DESIGN 5.3): full multigrid and F(0,4)-cycles over any back end.

A back end is a ``System``: named fields on levels top..0 (below level 0, ``bottom`` solves for itself). Field names:
``f`` right-hand side of the problem, ``u``/``v`` the solution and its successor, ``b`` right-hand side of a
correction equation, ``e``/``t`` the correction and its predecessor. A call works on all channels of the system.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Protocol

FMG_BOTTOM_CYCLES = 4
"""Bottom cycles that start the full multigrid."""
LONE_BOTTOM_CYCLES = 24
"""Bottom cycles when level 0 is the finest: they must settle it."""

MOST_BOTTOM_CYCLES = 24 << 6

MAX_CYCLES = 120
UPDATE_SHARE = 0.5
"""Error after a cycle as a share of its last update, at least: convergence factors of ordinary scenes are below 0.4."""
FIRST_SHARE = 1.0
"""Share that stands for UPDATE_SHARE after the first cycle, when nothing tells the factor yet."""
DIVERGED = 10.0
"""An update above this many times the first one does not come back: the corrections feed on themselves."""


class DivergedError(RuntimeError):
    """The cycles lead away from the solution. The message is a sentence for people."""

    def __init__(self, message: str = "The ground could not be settled: its equations did not converge.") -> None:
        super().__init__(message)


class System(Protocol):
    """One family of equations A u = f, all channels with the same A, on every level.

    floor: what its numbers leave of an update that could be zero, as a share of the largest value.
    """

    top: int
    floor: float

    def visit(
        self, level: int, *, rhs: str, out: str, guess: str | None, correction: str | None, residual: bool
    ) -> None:
        """out = S(guess + P correction), S the Chebyshev sweeps; with ``residual``: b of level - 1 = R (rhs - A out).

        Without guess the start is zero, at fixed samples their value. P correction vanishes at fixed samples. The
        correction is a field of level - 1.
        """

    def restrict(self, level: int) -> None:
        """b of level - 1 = R b."""

    def bottom(self, *, rhs: str, out: str, cycles: int) -> None:
        """out = V-cycles from zero for level 0 and the levels below it."""

    def swap(self, level: int) -> None:
        """Exchange u and v of a level."""

    def hold(self) -> None:
        """u of the finest level = f where it is fixed; of the first channel, and fixed samples are those of one."""

    def change(self, old: str, new: str) -> float:
        """Largest absolute difference of two fields of the finest level."""

    def largest(self, name: str) -> float:
        """Largest absolute value of a field of the finest level."""


def correct(system: System, level: int, *, full: bool) -> None:
    """e of ``level`` = approximate solution of A e = b from zero: an F-cycle if ``full``, else a V-cycle."""
    if level == 0:
        system.bottom(rhs="b", out="e", cycles=2 if full else 1)
        return
    system.restrict(level)
    correct(system, level - 1, full=full)
    if not full:
        system.visit(level, rhs="b", out="e", guess=None, correction="e", residual=False)
        return
    system.visit(level, rhs="b", out="t", guess=None, correction="e", residual=True)
    correct(system, level - 1, full=False)
    system.visit(level, rhs="b", out="e", guess="t", correction="e", residual=False)


def start(system: System, level: int) -> None:
    """u of ``level`` from u of level - 1, ready for cycles: b of level - 1 holds its residual (full multigrid)."""
    if level == 0:
        system.bottom(rhs="f", out="u", cycles=FMG_BOTTOM_CYCLES if system.top > 0 else LONE_BOTTOM_CYCLES)
    else:
        system.visit(level, rhs="f", out="u", guess=None, correction="u", residual=True)


def finish(system: System, level: int) -> None:
    """One F-cycle on a level between the bottom and the top: its preview, and what the next level starts from."""
    if level > 0:
        correct(system, level - 1, full=True)
        system.visit(level, rhs="f", out="v", guess="u", correction="e", residual=False)
        system.swap(level)


def refresh(system: System) -> None:
    """Sweep u of the finest level once more after its right-hand side changed, leaving the new residual."""
    system.visit(system.top, rhs="f", out="v", guess="u", correction=None, residual=True)
    system.swap(system.top)


def cycle(system: System) -> None:
    """One F-cycle on the finest level. Its residual is in b of the level below, before the cycle and after it.

    Here a system prints what a cycle on four levels asks of it. Indentation is the level. A visit S(...) prolongs the
    correction (P) and sweeps; where it says "residual", it restricts the new residual to b of the level below.

    >>> class Printing:
    ...     top, floor = 3, 0.0
    ...
    ...     def visit(self, level, *, rhs, out, guess, correction, residual):
    ...         start = " + ".join(name for name in (guess, f"P {correction}") if name)
    ...         print("    " * level + f"{level}: {out} = S({start})" + (", residual" if residual else ""))
    ...
    ...     def restrict(self, level):
    ...         print("    " * level + f"{level}: restrict b")
    ...
    ...     def bottom(self, *, rhs, out, cycles):
    ...         print(f"0: {out} = bottom, cycles: {cycles}")
    ...
    ...     def swap(self, level):
    ...         print("    " * level + f"{level}: swap u and v")
    >>> cycle(Printing())
            2: restrict b
        1: restrict b
    0: e = bottom, cycles: 2
        1: t = S(P e), residual
    0: e = bottom, cycles: 1
        1: e = S(t + P e)
            2: t = S(P e), residual
        1: restrict b
    0: e = bottom, cycles: 1
        1: e = S(P e)
            2: e = S(t + P e)
                3: v = S(u + P e), residual
                3: swap u and v
    """
    correct(system, system.top - 1, full=True)
    system.visit(system.top, rhs="f", out="v", guess="u", correction="e", residual=True)
    system.swap(system.top)


def converge(system: System, tolerance: float) -> Iterator[None]:
    """Cycles until the estimated error of the finest level is below ``tolerance``; leaves off between them.

    With a factor r, the error after a cycle is at most r / (1 - r) of its update; r is the ratio of the last two.
    Updates that have stopped to shrink are rounding if they are as small as ``System.floor``, else the cycle does not
    converge. Raises DivergedError then, and when an update is not finite, or above DIVERGED times the first.
    """
    if system.top == 0:
        yield from _converge_bottom(system, tolerance)
        return
    first = before = math.inf
    for k in range(1, MAX_CYCLES + 1):
        cycle(system)
        update = system.change("v", "u")
        first = update if k == 1 else first
        if not math.isfinite(update) or update > DIVERGED * first:
            raise DivergedError
        ratio = update / before if before > 0 else 0.0
        share = FIRST_SHARE if k == 1 else max(UPDATE_SHARE, ratio / (1 - ratio)) if ratio < 1 else math.inf
        if update == 0 or update * share < tolerance:
            return
        if k > 1 and ratio >= 1 and update <= system.floor * system.largest("u"):
            return
        before = update
        yield
    raise DivergedError


def _converge_bottom(system: System, tolerance: float) -> Iterator[None]:
    """Converges level 0 alone: bottom cycles, twice as many every time, until they change nothing any more."""
    cycles = LONE_BOTTOM_CYCLES
    system.bottom(rhs="f", out="u", cycles=cycles)
    while cycles < MOST_BOTTOM_CYCLES:
        cycles *= 2
        system.bottom(rhs="f", out="v", cycles=cycles)
        update = system.change("v", "u")
        if not math.isfinite(update):
            raise DivergedError
        if update < max(tolerance, system.floor * system.largest("u")):
            return
        system.swap(0)
        yield
    raise DivergedError
