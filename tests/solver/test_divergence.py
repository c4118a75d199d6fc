"""Cycles that lead away from the solution end in an error, not in a ground (SPEC S29)."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from esker.solve import multigrid
from esker.solve.multigrid import DivergedError
from esker.solve.solver import Solver
from tests.solver.scenes import SETTINGS, flank, ridge


class JournalEntry:
    """A system without fields whose updates are a function of the number of the cycle, from 0; its values are at most
    a thousand, or ``most``."""

    floor = 1e-6

    def __init__(self, update: Callable[[int], float], top: int = 1, most: float = 1e3) -> None:
        self.update, self.top, self.most, self.cycles = update, top, most, 0

    def visit(
        self, level: int, *, rhs: str, out: str, guess: str | None, correction: str | None, residual: bool
    ) -> None:
        """Nothing to sweep."""

    def restrict(self, level: int) -> None:
        """Nothing to restrict."""

    def bottom(self, *, rhs: str, out: str, cycles: int) -> None:
        """Nothing to solve."""

    def swap(self, level: int) -> None:
        """Nothing to exchange."""

    def hold(self) -> None:
        """Nothing is fixed."""

    def change(self, old: str, new: str) -> float:
        assert (old, new) == ("v", "u")
        self.cycles += 1
        return self.update(self.cycles - 1)

    def largest(self, name: str) -> float:
        assert name == "u"
        return self.most


def settle(update: Callable[[int], float], top: int = 1, most: float = 1e3) -> int:
    """The number of cycles until the system is at rest."""
    system = JournalEntry(update, top, most)
    for _ in multigrid.converge(system, 1e-3):
        pass
    return system.cycles


@pytest.mark.parametrize("growth", [1.2, 2.5, 1e30])
def test_updates_that_grow_are_an_error(growth: float) -> None:
    with pytest.raises(DivergedError, match=r"^The ground .*\.$"):
        settle(lambda k: growth**k)


@pytest.mark.parametrize("wrong", [math.nan, math.inf])
@pytest.mark.parametrize("cycle", [0, 3])
def test_updates_that_are_no_numbers_are_an_error(wrong: float, cycle: int) -> None:
    with pytest.raises(DivergedError):
        settle(lambda k: wrong if k == cycle else 0.5**k)


def test_what_converges_is_at_rest() -> None:
    assert settle(lambda k: 0.1**k) == 4
    assert settle(lambda k: 9.0 if k == 1 else 0.5**k) == 11, "one bad step"


def test_what_shrinks_slowly_goes_on_for_longer() -> None:
    """SPEC S182: at a factor of 0.9 nine updates are still to come, of 0.5 one."""
    assert settle(lambda k: 0.5**k) == 11
    assert settle(lambda k: 0.9**k) == 88


@pytest.mark.parametrize("ratio", [1.0, 1.02])
def test_an_update_that_stays_is_rounding_only_if_it_is_small(ratio: float) -> None:
    """SPEC S182: a ratio near one alone does not tell. It settled ground that was 125 m off."""
    assert settle(lambda k: 0.01 * ratio**k, most=1e5) == 2
    with pytest.raises(DivergedError):
        settle(lambda k: 0.01 * ratio**k)


def test_level_0_alone_is_judged_too() -> None:
    """SPEC S182: 24 bottom cycles were taken for enough."""
    assert settle(lambda k: 0.1**k, top=0) == 5
    assert settle(lambda k: 1e-9 * k, top=0) == 1
    with pytest.raises(DivergedError):
        settle(lambda k: 2.0**k, top=0)
    with pytest.raises(DivergedError):
        settle(lambda k: k * math.nan, top=0)


@pytest.mark.parametrize("device", [None, "numpy"])
def test_a_ground_that_is_no_number_is_an_error(device: str | None, monkeypatch: pytest.MonkeyPatch) -> None:
    """A kernel's largest update is that of the samples that are numbers: the heights themselves tell."""
    solver = Solver(device)
    strokes = [ridge((1500, 1350), (2700, 1300), 300, flank(), "a")]
    good = solver.solve(strokes, SETTINGS, 2)[2]
    converge = multigrid.converge

    def spoilt(system: multigrid.System, tolerance: float) -> object:
        yield from converge(system, tolerance)
        [workspace] = taken
        workspace.warm(np.full(good.shape, np.nan, dtype=np.float32))

    taken = list(solver._pool.idle)
    with monkeypatch.context() as patch:
        patch.setattr(multigrid, "converge", spoilt)
        with pytest.raises(DivergedError):
            solver.solve(strokes, SETTINGS, 2)
    assert not solver._pool.idle, "nothing of it is used again"
    assert (solver.solve(strokes, SETTINGS, 2)[2] == good).all()


def test_equations_that_diverge_are_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    """A border whose springs saturate on coarse levels, with a reach of the domain's size (docs/solver.md)."""
    settings = SETTINGS.model_copy(update={"border": "pinned", "reach_m": 4096.0})
    strokes = [ridge((1500, 350), (2700, 300), 300, flank(), "a")]
    solver = Solver("numpy")
    assert np.isfinite(solver.solve(strokes, settings, 2)[2]).all()
    monkeypatch.setattr("esker.solve.reference.PINNED", -math.inf)
    monkeypatch.setattr("esker.solve.reference.PINNED_STIFFNESS", math.inf)
    monkeypatch.setattr("esker.solve.reference.on_lines", lambda d: np.zeros_like(d[:, ::2, ::2], dtype=np.bool_))
    with pytest.raises(DivergedError):
        Solver("numpy").solve(strokes, settings, 2)
