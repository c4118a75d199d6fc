"""The solver's work that is open for one room: its solve, channels beside the solve, refinement (DESIGN 8).

It belongs to the solver's thread and decides nothing.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol, runtime_checkable

from esker import contract as c
from esker.events import BaseLevel, Done, Preview, SolveEvent
from esker.grid import TileKey
from esker.session.ground.base_builder import blank_levels
from esker.session.ground.effects import BaseShown, OpenSolve
from esker.session.ground.jobs import Job
from esker.session.ground.ports import Refinement, Refiner, Solver
from esker.tiles.delivery import RefinedTile


@runtime_checkable
class PreviewingEarly(Protocol):
    """A solve that can make, while it goes on, a coarsest preview of newer strokes."""

    def early_preview(
        self, strokes: Sequence[c.Stroke], settings: c.TerrainSettings, base: Any = None
    ) -> Preview | None:
        """Returns the coarsest preview of other strokes, None when this solve cannot make one now."""
        ...


@dataclass(eq=False)
class Work:
    """The iterators of one room. ``base``: levels of a base that come before those of ``solve``. ``retained``: what
    refinement held before; it is kept until the next solve has shown something, since giving so much memory back takes
    a millisecond or more. ``refined``: the tiles that were made from what is settled."""

    solve: Iterator[SolveEvent] | None = None
    base: Iterator[BaseLevel] | None = None
    beside: Iterator[SolveEvent] | None = None
    refiner: Refiner | None = None
    tiles: Iterator[RefinedTile | None] | None = None
    refined: set[TileKey] = field(default_factory=set)
    retained: object = None

    def open_solve(self, solver: Solver, effect: OpenSolve, basis: bool) -> bool:
        """Begins a solve, after its base where that base is not shown yet.

        Returns whether the solve can preview early.
        """
        job, top = effect.job, effect.top
        more: dict[str, Any] = {} if job.base is None else {"base": job.base}
        if not effect.coarsest:
            more["coarsest"] = False
        self.solve = iter(solver.steps(job.strokes, job.settings, top, basis=basis, **more))
        if effect.base:
            self.base = iter(blank_levels(top) if job.base is None else solver.base_levels(job.base, top))
        return not effect.base and isinstance(self.solve, PreviewingEarly)

    def open_channels(self, solver: Solver, job: Job, top: int, *, beside: bool) -> None:
        """Begins to make channels, alone or beside the solve."""
        based = {} if job.base is None else {"base": job.base}
        made = iter(solver.channels(job.strokes, job.settings, top, **based))
        if beside:
            self.beside = made
        else:
            _close(self.solve)
            self.solve = made

    def adopt_channels(self) -> None:
        """Goes on with the channels that were made beside a solve, and with nothing else."""
        _close(self.solve)
        self.solve, self.beside = self.beside, None

    def step(self) -> SolveEvent | BaseShown:
        """Goes on with the solve until the solve can be left."""
        if self.base is not None:
            found = next(self.base, None)
            if found is not None:
                return found
            self.base = None
            return BaseShown()
        assert self.solve is not None
        event = next(self.solve, Done())
        if isinstance(event, Done):
            _close(self.solve)
            self.solve = None
        return event

    def step_beside(self) -> SolveEvent:
        """Goes on with the channels beside the solve."""
        assert self.beside is not None
        event = next(self.beside, Done())
        if isinstance(event, Done):
            _close(self.beside)
            self.beside = None
        return event

    def preview_early(self, job: Job) -> Preview | None:
        """Returns the coarsest preview of a newer job."""
        assert isinstance(self.solve, PreviewingEarly)
        return self.solve.early_preview(job.strokes, job.settings, job.base)

    def looks(self, refinement: Refinement, urgent: Any) -> bool:
        """Starts on the tiles that are wanted now and were not made yet. Returns False when there are none."""
        assert self.refiner is not None
        if self.tiles is None:
            keys = [key for key in refinement.wanted() if key not in self.refined]
            self.tiles = iter(self.refiner.tiles(keys, urgent)) if keys else None
        return self.tiles is not None

    def refine(self) -> RefinedTile | None:
        """Finishes at most one tile."""
        assert self.tiles is not None
        try:
            tile = next(self.tiles)
        except StopIteration:
            self.tiles = None
            return None
        if tile is not None:
            self.refined.add(tile.key)
        return tile

    def leave(self, keeps: bool) -> None:
        """Ends the solve and refinement. ``keeps``: the channels that are made alone go on beside the next solve."""
        if keeps:
            self.beside, self.solve = self.solve, None
        retained = self.refiner
        self._end()
        self.retained = retained

    def drop(self) -> None:
        """Ends all that is open."""
        _close(self.beside)
        self.beside = None
        self._end()

    def _end(self) -> None:
        for work in (self.base, self.solve, self.tiles):
            _close(work)
        self.base = self.solve = self.tiles = self.refiner = self.retained = None
        self.refined.clear()


def _close(work: object) -> None:
    close = getattr(work, "close", None)
    if close is not None:
        close()
