"""The terrain as a pure function of its strokes (DESIGN 5): previews coarse to fine, then the settled levels.

Equations: minimise over the samples of the finest level G

    sum_edges (d_j - d_i - g_ij)^2 + sum_i a_i (d_i - c_i)^2 + eps sum_i (d_i - w_i c_i)^2

(DESIGN 5.1; see docs/solver.md for the last term), first for the two gradient components with g = 0, then for the
heights with the diffused gradient as guidance g. The result depends on the set of strokes and on the settings alone:
every solve starts from zero, strokes are ordered by id, and no cache changes a bit of it.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from esker.contract import MAX_LEVEL, Channel, Stroke, TerrainSettings
from esker.events import PAUSE, BaseLevel, ChannelLevel, Done, Pause, Preview, Settled, SolveEvent, pauses
from esker.process import system
from esker.solve import blank, passes
from esker.solve.base import Base, bound
from esker.solve.blank import is_blank
from esker.solve.channels import ChannelSolver, channel_level
from esker.solve.constraints.channel_targets import BASES, Contributors, Layer, contributors
from esker.solve.constraints.computable import computable
from esker.solve.constraints.constraints import Shapes
from esker.solve.far import FarField
from esker.solve.opencl import proof
from esker.solve.opencl.device import NUMPY, NUMPY_NAME, Device, open_device
from esker.solve.opencl.faults import OutOfDeviceMemoryError, guarded
from esker.solve.passes import PREVIEW_GRADIENT_CYCLES, PREVIEW_HEIGHT_CYCLES, Basis, Job, Workspace
from esker.solve.pool.pool import Lease, WorkspacePool
from esker.solve.refine.refinement import Refiner, Refinery
from esker.solve.solving import Solving

__all__ = ["PREVIEW_GRADIENT_CYCLES", "PREVIEW_HEIGHT_CYCLES", "Basis", "Pyramid", "Solver", "Workspace"]

EDITED = 4
"""Strokes that may be new or changed for a preview to be made from the ground before."""
PACED_ABOVE = 4
"""Up to this level a whole preview takes less time than one cycle of a big terrain."""


@dataclass(frozen=True)
class Pyramid:
    """Levels 0..G of one solve, coarse to fine; ``settled`` False when it was stopped early."""

    levels: tuple[NDArray[np.float32], ...]
    settled: bool

    def __getitem__(self, level: int) -> NDArray[np.float32]:
        return self.levels[level]

    def __len__(self) -> int:
        return len(self.levels)


class Solver:
    """Solves stroke sets on one device. Use a solver from one thread; its solves may be interleaved level by level.

    Parameters
    ----------
    device: part of the name of an OpenCL platform or device, or "numpy"; None takes the best there is.
    max_level: the finest level that is solved as a whole where a call names none, 0..6.
    threads: how many PoCL uses (all cores by default). The first solver of a process decides.

    Raises
    ------
    NoDeviceError: a device that was asked for by name is missing. ValueError: ``max_level`` is not solved globally.

    Examples
    --------
    >>> from esker import Stroke
    >>> from esker.contract import TerrainSettings
    >>> from esker.solve.solver import Solver
    >>> solver = Solver("numpy", max_level=1)
    >>> mesa = Stroke.level([(1000, 1000, 120), (2000, 1200, 120)], plateau_radius_m=200)
    >>> ground = solver.solve([mesa], TerrainSettings())
    >>> len(ground), ground.settled, ground[1].shape, float(ground[1].max())
    (2, True, (129, 129), 120.0)
    """

    def __init__(self, device: str | None = None, max_level: int = 4, threads: int | None = None) -> None:
        if not 0 <= max_level <= MAX_LEVEL:
            raise ValueError(f"max_level must be 0..{MAX_LEVEL}, not {max_level}")
        self.max_level = max_level
        self._refinery: Refinery | None = None
        self._shapes = Shapes()
        self._channel_solvers: dict[int, ChannelSolver] = {}
        self._far_fields: dict[int, FarField] = {}
        self._device: Device | None = None
        self._pool = WorkspacePool(self._shapes)
        self._device = open_device(device, threads, self._check)

    @property
    def device_name(self) -> str:
        """Name of the device that solves, for logs and people."""
        return NUMPY_NAME if self._device is None else self._device.name

    @property
    def device(self) -> Device | None:
        """The opened device, None with NumPy: for others that compute on it, from the same thread."""
        return self._device

    def refiner(self, basis: Basis) -> Refiner:
        """Returns a refiner of a settled solve of this solver, above its level (DESIGN 5.6). Refiners share a cache."""
        if self._refinery is None:
            self._refinery = Refinery(self._device, shapes=self._shapes)
        return self._refinery.refiner(basis)

    def steps(
        self,
        strokes: Sequence[Stroke],
        settings: TerrainSettings,
        levels: int | None = None,
        *,
        basis: bool = False,
        base: Base | None = None,
        coarsest: bool = True,
    ) -> Solving:
        """Previews of levels 0..G, each when it is finished, then 0..G settled.

        Pause comes wherever the work can be left for a while, or for good: between the cycles of the finest level, so
        that many rooms can share a device. Close the generator to stop; G is ``levels`` or the solver's ``max_level``.
        With ``basis`` Done, the last event, carries what refinement starts from. ``base``: the ground without strokes,
        above which heights are then given. Not ``coarsest``: without level 0, which was previewed early.
        Raises ValueError for a level outside 0..MAX_LEVEL.
        """
        job, lease = Job(strokes, computable(settings), bound(base, self._device)), Lease()
        return Solving(self._run(job, self._level(levels), None, basis, lease, coarsest), lease, self._device)

    def base_levels(self, base: Base, levels: int | None = None) -> Iterator[BaseLevel]:
        """The base itself, channel BASE on levels 0..G, then how fine its data are, SURVEY on the levels of channels.

        Raises ValueError like ``steps``, DeviceErrors.
        """
        top = self._level(levels)
        with guarded(self._device):
            for level in range(top + 1):
                yield BaseLevel(level, base.level(level, self._device), Channel.BASE)
            for level in range(channel_level(top) + 1):
                yield BaseLevel(level, base.survey(level), Channel.SURVEY)

    def channels(
        self,
        strokes: Sequence[Stroke],
        settings: TerrainSettings,
        levels: int | None = None,
        *,
        base: Base | None = None,
    ) -> Iterator[SolveEvent]:
        """Yields the channels alone, which ``steps`` gives out beside the heights: for strokes whose heights stayed.

        Pause comes wherever the work can be left, and Done at the end. Raises ValueError like ``steps``.
        """
        job = Job(strokes, computable(settings), bound(base, self._device))
        return self._retried(lambda top: self._alone(job, top), self._level(levels))

    def solve(
        self,
        strokes: Sequence[Stroke],
        settings: TerrainSettings,
        levels: int | None = None,
        on_level: Callable[[Preview | Settled], None] | None = None,
        should_stop: Callable[[], bool] | None = None,
        guess: Pyramid | None = None,
        *,
        base: Base | None = None,
    ) -> Pyramid:
        """The settled pyramid (DESIGN 5.7), heights above the base, or what there was when ``should_stop`` said so
        after some level.

        ``guess``: heights of a similar stroke set at the same levels; saves the previews and a cycle or two.
        """
        top = self._level(levels)
        warm = guess.levels[top] if guess is not None and len(guess) == top + 1 else None
        latest: dict[int, Preview | Settled] = {}
        run = self._run(Job(strokes, computable(settings), bound(base, self._device)), top, warm, basis=False)
        for result in run:
            if isinstance(result, Preview | Settled):
                latest[result.level] = result
                if on_level is not None:
                    on_level(result)
            if should_stop is not None and should_stop():
                run.close()
                break
        done = [latest[level] for level in range(top + 1) if level in latest]
        return Pyramid(tuple(r.heights for r in done), len(done) == top + 1 and all(r.settled for r in done))

    def heights(
        self,
        strokes: Sequence[Stroke],
        settings: TerrainSettings,
        level: int | None = None,
        *,
        base: Base | None = None,
        step: Callable[[], None] = lambda: None,
    ) -> NDArray[np.float32]:
        """The settled heights of one level above the base, (N, N) float32, metres, row 0 south, read-only: those of
        ``solve`` with ``level`` as its finest, to the bit, without what only people who wait are shown on the way.

        ``step`` is called now and then. Raises ValueError like ``steps``, DeviceErrors, DivergedError.
        """
        job = Job(strokes, computable(settings), bound(base, self._device))
        for found in self._retried(lambda top: self._quietly(job, top), self._level(level)):
            step()
            if isinstance(found, Settled):
                return found.heights
        raise AssertionError("a solve ends with heights or raises")

    def tidy(self, now: float | None = None) -> int:
        """Gives back the memory of workspaces that have been idle for SPARE_SECONDS; returns how many there were.
        Memory of refinement goes, too, when nobody has needed it for longer.

        ``now``: of ``time.monotonic``.
        """
        now = time.monotonic() if now is None else now
        if self._refinery is not None and self._refinery.tidy(now):
            system.give_memory_back()
        return self._pool.tidy(now)

    def _check(self, device: Device) -> None:
        """Compile the kernels now, not under somebody's first stroke, and trust none whose ground is not the twin's.

        Raises DeviceError.
        """
        self._device = device
        mine, twin = (s.solve(proof.STROKES, TerrainSettings(), proof.LEVEL) for s in (self, Solver(NUMPY)))
        self._pool.clear()
        proof.compare(device, mine[proof.LEVEL], twin[proof.LEVEL])

    def prove(self) -> None:
        """Solves a small scene that is known to work. Raises DeviceErrors when the device does not."""
        if self._device is None:
            return
        kept, self._pool = self._pool, WorkspacePool(self._shapes)
        try:
            self._check(self._device)
        finally:
            self._pool = kept

    def _level(self, levels: int | None) -> int:
        top = self.max_level if levels is None else levels
        if not 0 <= top <= MAX_LEVEL:
            raise ValueError(f"level must be 0..{MAX_LEVEL}, not {top}")
        return top

    def _run(
        self,
        job: Job,
        top: int,
        warm: NDArray[np.float32] | None,
        basis: bool,
        lease: Lease | None = None,
        coarsest: bool = True,
    ) -> Generator[SolveEvent]:
        yield from self._retried(lambda level: self._attempt(job, level, warm, basis, lease or Lease(), coarsest), top)

    def _retried(self, attempt: Callable[[int], Iterator[SolveEvent]], top: int) -> Generator[SolveEvent]:
        """Makes an attempt. Where there is no memory for it, it is made once more without what is kept for later."""
        try:
            yield from attempt(top)
            return
        except OutOfDeviceMemoryError:
            if not self._pool.idle and not self._channel_solvers:
                raise
        self._pool.clear()
        self._channel_solvers.clear()
        yield from attempt(top)

    def _attempt(
        self, job: Job, top: int, warm: NDArray[np.float32] | None, basis: bool, lease: Lease, coarsest: bool
    ) -> Generator[SolveEvent]:
        """One solve.

        Painted channels come right after the coarsest preview, so that they keep up with a pen that never rests.
        Channels of which drawn strokes ask something would hold the pen up: they come when the pen rests.
        """
        with guarded(self._device):
            asked = contributors(job.strokes, job.settings)
            if is_blank(job.strokes) and warm is None:
                yield from self._channels(asked, job, top, BASES)
                yield from self._far(job, top)
                yield from blank.settled(job, top, basis)
                return
            work = partial(self._shown, job=job, warm=warm, basis=basis, coarsest=coarsest, asked=asked)
            yield from self._pool.leased(lease, job, top, self._device, work)

    def _shown(
        self,
        workspace: Workspace,
        job: Job,
        warm: NDArray[np.float32] | None,
        basis: bool,
        coarsest: bool,
        asked: Mapping[Layer, Contributors],
    ) -> Generator[SolveEvent]:
        """Previews, channels and settled levels of one solve; see ``_attempt``."""
        top = workspace.top
        late = [layer.channel for layer in asked if not layer.painted]
        early = [channel for channel in BASES if channel not in late]
        quick = self._far_field(top).is_quick(job.strokes, job.settings)
        early_made = warm is None and workspace.preview_workspace is not None
        if early_made:
            if coarsest:
                yield from passes.coarsest_preview(workspace, job)
            yield from self._channels(asked, job, top, early)
            if quick:
                yield from self._far(job, top)
        edited = early_made and _edited(workspace, job)
        yield from pauses(workspace.loading(*job))
        workspace.solved_for = None
        if warm is None:
            previews = self._previews(workspace, job, coarsest=not early_made, edited=edited)
            if not early_made:
                yield next(previews)
                yield from self._channels(asked, job, top, early)
            yield from previews
        else:
            passes.gradients(workspace)
            workspace.warm(warm)
            yield from self._channels(asked, job, top, early)
        workspace.solved_for = passes.conditions(job)
        yield from pauses(passes.to_rest(workspace, job.settings))
        yield from self._channels(asked, job, top, late)
        if not (early_made and quick):
            yield from self._far(job, top)
        yield from passes.settled(workspace, job, basis)

    def _quietly(self, job: Job, top: int) -> Iterator[SolveEvent]:
        """One solve of which nothing is shown; see ``_attempt``."""
        with guarded(self._device):
            if is_blank(job.strokes):
                *_, last, _ = blank.settled(job, top, basis=False)
                yield last
                return
            yield from self._pool.leased(Lease(), job, top, self._device, lambda w: passes.unseen(w, job))

    def _previews(self, workspace: Workspace, job: Job, *, coarsest: bool, edited: bool) -> Iterator[SolveEvent]:
        """Previews coarse to fine. Of ground of which little was ``edited`` the finest comes first, made from what it
        was: then the others go with it, so that what settles depends on the strokes alone."""
        settings, shown = job.settings, False
        if edited:
            for result in self._paced(passes.amended(workspace, settings, workspace.relief_m), paced=True):
                if isinstance(result, Preview):
                    shown, workspace.solved_for = True, passes.conditions(job)
                yield result
        cycles = passes.preview_gradient_cycles(settings)
        paced = shown or workspace.top > PACED_ABOVE
        for event in self._paced(passes.previews(workspace, cycles, coarsest=coarsest), paced):
            again = shown and isinstance(event, Preview) and event.level == workspace.top
            yield PAUSE if again else event

    def _paced(self, steps: Iterator[SolveEvent], paced: bool) -> Iterator[SolveEvent]:
        """``paced``: what is enqueued is done before somebody else has a turn, as the queue is in order: on big levels,
        and where nobody waits."""
        for result in steps:
            if isinstance(result, Pause) and self._device is not None and paced:
                self._device.queue.finish()
            yield result

    def _alone(self, job: Job, top: int) -> Iterator[SolveEvent]:
        with guarded(self._device):
            yield from self._channels(contributors(job.strokes, job.settings), job, top, BASES)
            yield from self._far(job, top)
            yield Done()

    def _channels(
        self, asked: Mapping[Layer, Contributors], job: Job, top: int, channels: Iterable[Channel]
    ) -> Iterator[SolveEvent]:
        """Channels other than the heights, final, levels coarse to fine."""
        level = channel_level(top)
        solver = self._channel_solvers.setdefault(level, ChannelSolver(self._device, level))
        for found in solver.making(asked, job.settings, channels, job.base):
            if found is None:
                yield PAUSE
                continue
            channel, levels = found
            for coarser, samples in enumerate(levels):
                yield ChannelLevel(coarser, samples, channel, more=True)
            if any(layer.channel == channel for layer in asked):  # nothing was computed for the others
                yield PAUSE
        yield PAUSE

    def _far_field(self, top: int) -> FarField:
        level = channel_level(top)
        return self._far_fields.setdefault(level, FarField(level))

    def _far(self, job: Job, top: int) -> Iterator[SolveEvent]:
        """Distances from what strokes fix, final, levels coarse to fine."""
        work = self._far_field(top).making(job.strokes, job.settings)
        while True:
            try:
                next(work)
            except StopIteration as end:
                levels: Sequence[NDArray[np.float32]] = end.value
                break
            yield PAUSE
        for level, samples in enumerate(levels):
            yield ChannelLevel(level, samples, Channel.FAR, more=True)
        yield PAUSE


def _edited(workspace: Workspace, job: Job) -> bool:
    """Returns whether the finest level still holds the ground of nearly the same strokes."""
    if workspace.solved_for is None or workspace.solved_for != passes.conditions(job):
        return False
    known = workspace.packer.unchanged_count(job.strokes, job.settings)
    return known >= 0 and len(job.strokes) - known <= EDITED
