"""The terrain as a pure function of its strokes (DESIGN 5): previews coarse to fine, then the settled levels.

Equations: minimise over the samples of the finest level G

    sum_edges (d_j - d_i - g_ij)^2 + sum_i a_i (d_i - c_i)^2 + eps sum_i (d_i - w_i c_i)^2

(DESIGN 5.1; see docs/solver.md for the last term), first for the two gradient components with g = 0, then for the
heights with the diffused gradient as guidance g. The result depends on the set of strokes and on the settings alone:
every solve starts from zero, strokes are ordered by id, and no cache changes a bit of it.
"""

from __future__ import annotations

import os
import time
import weakref
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from esker import grid
from esker.contract import MAX_LEVEL, Channel, Stroke, TerrainSettings
from esker.solve import multigrid, passes, proof
from esker.solve.base import Base, bound
from esker.solve.channels import ChannelSolver, channel_level
from esker.solve.constraints import Shapes
from esker.solve.device import NUMPY, NUMPY_NAME, Device, open_device
from esker.solve.faults import OutOfDeviceMemoryError, guarded, is_fault
from esker.solve.passes import (
    PREVIEW_GRADIENT_CYCLES,
    PREVIEW_HEIGHT_CYCLES,
    Basis,
    Job,
    LevelResult,
    Workspace,
)
from esker.solve.refine import Refiner, Refinery
from esker.solve.sayings import BASES, Layer, Speakers, speakers
from esker.solve.solving import Seat, Solving
from esker.solve.workspaces import give_back, new_workspace

__all__ = ["PREVIEW_GRADIENT_CYCLES", "PREVIEW_HEIGHT_CYCLES", "Basis", "LevelResult", "Pyramid", "Solver", "Workspace"]

SPARE_BYTES = 5 << 30
"""Memory that idle workspaces may keep, with the raster of the strokes that they last solved, but no more than a
fifth of the machine's: a room whose workspace was given to another one has all its strokes rasterised again."""
SPARE_SECONDS = 300.0
"""How long a workspace is kept that nobody uses: who has been away for longer waits once for the raster."""
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
    """Solves stroke sets on one device. Use it from one thread; solves may be interleaved level by level.

    ``device``: part of the name of an OpenCL platform or device, or "numpy"; None takes the best there is.
    ``threads`` limits PoCL and counts for the first solver of a process (default: all cores). Raises NoDeviceError
    when a device that was asked for by name is missing, ValueError for a level that is not solved globally.
    """

    def __init__(self, device: str | None = None, max_level: int = 4, threads: int | None = None) -> None:
        if not 0 <= max_level <= MAX_LEVEL:
            raise ValueError(f"max_level must be 0..{MAX_LEVEL}, not {max_level}")
        self.max_level = max_level
        self._spare: list[Workspace] = []
        self._idle_since: weakref.WeakKeyDictionary[Workspace, float] = weakref.WeakKeyDictionary()
        self._refinery: Refinery | None = None
        self._shapes = Shapes()
        self._channel_solvers: dict[int, ChannelSolver] = {}
        self._spare_bytes = min(SPARE_BYTES, os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") // 5)
        self._device: Device | None = None
        self._device = open_device(device, threads, self._check)

    @property
    def device_name(self) -> str:
        """What solves, for logs and people."""
        return NUMPY_NAME if self._device is None else self._device.name

    @property
    def device(self) -> Device | None:
        """The opened device, None with NumPy: for others that compute on it, from the same thread."""
        return self._device

    def refiner(self, basis: Basis) -> Refiner:
        """What refines a settled solve of this solver above its level (DESIGN 5.6). Refiners share a cache."""
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

        None comes wherever the work can be left for a while, or for good: between the cycles of the finest level, so
        that many rooms can share a device. Close the generator to stop; G is ``levels`` or the solver's ``max_level``.
        With ``basis`` the last result carries what refinement starts from. ``base``: the ground without strokes, above
        which heights are then given. Not ``coarsest``: without level 0, a glimpse of these strokes is out already.
        Raises ValueError for a level outside 0..MAX_LEVEL.
        """
        job, seat = Job(strokes, settings, bound(base, self._device)), Seat()
        return Solving(self._run(job, self._level(levels), None, basis, seat, coarsest), seat, self._device)

    def base_levels(self, base: Base, levels: int | None = None) -> Iterator[LevelResult]:
        """The base itself, channel BASE on levels 0..G, then how fine its data are, SURVEY on the levels of channels.

        Raises ValueError like ``steps``, DeviceErrors.
        """
        top = self._level(levels)
        with guarded(self._device):
            for level in range(top + 1):
                yield LevelResult(level, base.level(level, self._device), settled=True, channel=Channel.BASE)
            for level in range(channel_level(top) + 1):
                yield LevelResult(level, base.survey(level), settled=True, channel=Channel.SURVEY)

    def channels(
        self,
        strokes: Sequence[Stroke],
        settings: TerrainSettings,
        levels: int | None = None,
        *,
        base: Base | None = None,
    ) -> Iterator[LevelResult | None]:
        """What ``steps`` gives out beside the heights, alone: for strokes of which only that has changed.

        None comes wherever the work can be left. Raises ValueError like ``steps``.
        """
        job = Job(strokes, settings, bound(base, self._device))
        return self._retried(lambda top: self._alone(job, top), self._level(levels))

    def solve(
        self,
        strokes: Sequence[Stroke],
        settings: TerrainSettings,
        levels: int | None = None,
        on_level: Callable[[LevelResult], None] | None = None,
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
        latest: dict[int, LevelResult] = {}
        run = self._run(Job(strokes, settings, bound(base, self._device)), top, warm, basis=False)
        for result in run:
            if result is not None and result.channel == Channel.HEIGHT:
                latest[result.level] = result
                if on_level is not None:
                    on_level(result)
            if should_stop is not None and should_stop():
                run.close()
                break
        done = [latest[level] for level in range(top + 1) if level in latest]
        return Pyramid(tuple(r.heights for r in done), len(done) == top + 1 and all(r.settled for r in done))

    def tidy(self, now: float | None = None) -> int:
        """Gives back the memory of workspaces that have been idle for SPARE_SECONDS; returns how many there were.

        ``now``: of ``time.monotonic``.
        """
        late = (time.monotonic() if now is None else now) - SPARE_SECONDS
        count = len(self._spare)
        self._spare = [w for w in self._spare if self._idle_since[w] > late]
        count -= len(self._spare)
        if count:
            give_back()
        return count

    def _check(self, device: Device) -> None:
        """Compile the kernels now, not under somebody's first stroke, and trust none whose ground is not the twin's.

        Raises DeviceError.
        """
        self._device = device
        mine, twin = (s.solve(proof.STROKES, TerrainSettings(), proof.LEVEL) for s in (self, Solver(NUMPY)))
        self._spare.clear()
        proof.compare(device, mine[proof.LEVEL], twin[proof.LEVEL])

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
        seat: Seat | None = None,
        coarsest: bool = True,
    ) -> Generator[LevelResult | None]:
        yield from self._retried(lambda level: self._attempt(job, level, warm, basis, seat or Seat(), coarsest), top)

    def _retried(
        self, attempt: Callable[[int], Iterator[LevelResult | None]], top: int
    ) -> Generator[LevelResult | None]:
        """Without memory for it, once more without what is kept for later."""
        try:
            yield from attempt(top)
            return
        except OutOfDeviceMemoryError:
            if not self._spare and not self._channel_solvers:
                raise
        self._spare.clear()
        self._channel_solvers.clear()
        yield from attempt(top)

    def _attempt(
        self, job: Job, top: int, warm: NDArray[np.float32] | None, basis: bool, seat: Seat, coarsest: bool
    ) -> Generator[LevelResult | None]:
        """One solve. A workspace whose device failed, or that diverged, is dropped, all others are kept.

        Painted channels come right after the coarsest preview, so that they keep up with a pen that never rests; those
        of which the strokes speak that the pen draws would hold it up, and come when it does rest.
        """
        with guarded(self._device):
            settings, spoken = job.settings, speakers(job.strokes, job.settings)
            late = [layer.channel for layer in spoken if not layer.painted]
            early = [channel for channel in BASES if channel not in late]
            workspace = seat.workspace = self._take(job, top)
            keep, half = True, False
            try:
                scouting = warm is None and workspace.scout is not None
                if scouting:
                    if coarsest:
                        yield passes.scouted(workspace, job)
                    yield from self._channels(spoken, job, top, early)
                edited = scouting and _edited(workspace, job)
                half = True
                yield from workspace.loading(*job)
                half, workspace.standing = False, None
                if warm is None:
                    previews = self._previews(workspace, job, coarsest=not scouting, edited=edited)
                    if not scouting:
                        yield next(previews)
                        yield from self._channels(spoken, job, top, early)
                    yield from previews
                else:
                    passes.gradients(workspace)
                    workspace.warm(warm)
                    yield from self._channels(spoken, job, top, early)
                workspace.standing = passes.standing_on(job)
                yield from passes.to_rest(workspace, settings)
                yield from self._channels(spoken, job, top, late)
                yield from passes.settled(workspace, job, basis)
            except GeneratorExit:
                if half:
                    workspace.packer.forget()
                raise
            except BaseException as error:
                workspace.packer.forget()
                if workspace.scout is not None:
                    workspace.scout.packer.forget()
                keep = not (is_fault(error) or isinstance(error, multigrid.DivergedError))
                raise
            finally:
                seat.workspace = None
                if keep:
                    self._give(workspace)
                del workspace  # the traceback of an error would keep it

    def _previews(
        self, workspace: Workspace, job: Job, *, coarsest: bool, edited: bool
    ) -> Iterator[LevelResult | None]:
        """Previews coarse to fine. Of ground of which little was ``edited`` the finest comes first, made from what it
        was: then the others go with it, so that what settles depends on the strokes alone."""
        settings, shown = job.settings, False
        if edited:
            assert workspace.scout is not None
            relief = max(float(np.ptp(workspace.scout.read(0))), 1.0)
            for result in passes.amended(workspace, settings, relief):
                if result is not None:
                    shown, workspace.standing = True, passes.standing_on(job)
                yield result
        cycles = passes.preview_gradient_cycles(settings)
        paced = shown or workspace.top > PACED_ABOVE
        for result in self._paced(passes.previews(workspace, cycles, coarsest=coarsest), paced):
            again = shown and result is not None and result.level == workspace.top
            yield None if again else result

    def _paced(self, steps: Iterator[LevelResult | None], paced: bool) -> Iterator[LevelResult | None]:
        """``paced``: what is enqueued is done before somebody else has a turn, as the queue is in order: on big levels,
        and where nobody waits."""
        for result in steps:
            if result is None and self._device is not None and paced:
                self._device.queue.finish()
            yield result

    def _alone(self, job: Job, top: int) -> Iterator[LevelResult | None]:
        with guarded(self._device):
            yield from self._channels(speakers(job.strokes, job.settings), job, top, BASES)

    def _channels(
        self, spoken: Mapping[Layer, Speakers], job: Job, top: int, channels: Iterable[Channel]
    ) -> Iterator[LevelResult | None]:
        """Channels other than the heights, final, levels coarse to fine."""
        level = channel_level(top)
        solver = self._channel_solvers.setdefault(level, ChannelSolver(self._device, level))
        for channel, levels in solver.pyramids(spoken, job.settings, channels, job.base):
            for coarser, samples in enumerate(levels):
                yield LevelResult(coarser, samples, settled=True, channel=channel)
            yield None

    def _take(self, job: Job, top: int) -> Workspace:
        """An idle workspace that has most of these strokes rasterised already; or a new one; or the longest idle."""
        based = job.base is not None
        idle = [w for w in self._spare if w.top == top and w.based == based]
        strokes, settings = job.strokes, job.settings
        best = max(idle, key=lambda w: w.packer.likeness(strokes, settings), default=None)
        if best is not None and 2 * best.packer.likeness(strokes, settings) < len(strokes):
            # Where everybody in a room draws at once, most strokes differ from solve to solve: it is theirs still.
            best = max(idle, key=lambda w: w.packer.kinship(strokes))
            if 2 * best.packer.kinship(strokes) < len(strokes):
                best = idle[0] if self._kept() + grid.solve_bytes(top, based) > self._spare_bytes else None
        if best is not None:
            self._spare.remove(best)
            return best
        while self._spare and self._kept() + grid.solve_bytes(top, based) > self._spare_bytes:
            self._spare.pop(0)
        made = new_workspace(self._device, top, based)
        made.packer.shapes = self._shapes
        if top >= grid.SCOUT_FROM:
            made.scout = new_workspace(self._device, grid.SCOUT, based)
            made.scout.packer.shapes = self._shapes
        return made

    def _kept(self) -> int:
        return sum(grid.solve_bytes(w.top, w.based) for w in self._spare)

    def _give(self, workspace: Workspace) -> None:
        self._spare.append(workspace)
        self._idle_since[workspace] = time.monotonic()
        while len(self._spare) > 1 and self._kept() > self._spare_bytes:
            self._spare.pop(0)


def _edited(workspace: Workspace, job: Job) -> bool:
    """Whether the finest level still holds the ground of nearly the same strokes."""
    if workspace.standing is None or workspace.standing != passes.standing_on(job):
        return False
    known = workspace.packer.likeness(job.strokes, job.settings)
    return known >= 0 and len(job.strokes) - known <= EDITED
