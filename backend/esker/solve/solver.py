"""The terrain as a pure function of its strokes (DESIGN 5): previews coarse to fine, then the settled levels.

Equations: minimise over the samples of the finest level G

    sum_edges (d_j - d_i - g_ij)^2 + sum_i a_i (d_i - c_i)^2 + eps sum_i (d_i - w_i c_i)^2

(DESIGN 5.1; see docs/solver.md for the last term), first for the two gradient components with g = 0, then for the
heights with the diffused gradient as guidance g. The result depends on the set of strokes and on the settings alone:
every solve starts from zero, strokes are ordered by id, and no cache changes a bit of it.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from esker import grid
from esker.contract import MAX_LEVEL, Channel, Stroke, TerrainSettings
from esker.solve import multigrid, proof
from esker.solve.base import Base
from esker.solve.channels import ChannelSolver, channel_level
from esker.solve.constraints import Packer
from esker.solve.device import NUMPY, NUMPY_NAME, Device, open_device
from esker.solve.faults import OutOfDeviceMemoryError, guarded, is_fault
from esker.solve.injection import frozen, injections
from esker.solve.refine import Refiner, Refinery
from esker.solve.sayings import BASES, Layer, Speakers, speakers
from esker.solve.workspaces import new_workspace

PREVIEW_GRADIENT_CYCLES = 1
PREVIEW_HEIGHT_CYCLES = 3
WIDE_REACHES = (1 / 16, 1 / 4)
"""A reach above each of these shares of the domain takes one gradient cycle more: what full multigrid leaves of the
gradient is smooth, and the farther it is felt the more height it adds up to."""
HEIGHT_SHARE = 0.25
"""Error, in quanta of the finest level, at which the heights are at rest: half of what DESIGN 5.3 asks for."""
GRADIENT_SHARE = 1 / 16
"""Share of a quantum that the gradient's own error may cost the heights."""
SPARE_BYTES = 5 << 30
"""Memory that idle workspaces may keep, with the raster of the strokes that they last solved, but no more than a
fifth of the machine's: a room whose workspace was given to another one has all its strokes rasterised again."""
PACED_ABOVE = 4
"""Up to this level a whole preview takes less time than one cycle of a big terrain."""


@dataclass(frozen=True)
class Basis:
    """What refinement above the global levels starts from (DESIGN 5.6): a settled solve.

    heights: (N, N) float32 of level ``level``, metres above the ``base`` (None: a plane at 0); gradient: (2, N, N)
    float32, d/dx and d/dy, metres per metre: in bands that of the ground, elsewhere of the heights. Both read-only.
    """

    strokes: tuple[Stroke, ...]
    settings: TerrainSettings
    level: int
    heights: NDArray[np.float32]
    gradient: NDArray[np.float32]
    base: Base | None = None


@dataclass(frozen=True)
class LevelResult:
    """One finished level. heights: (N_l, N_l) float32, metres above the base, row 0 south, read-only. ``settled``
    False: a preview that later results correct; True: final for this stroke set, and the injection of the next finer
    level.

    ``channel`` other than HEIGHT: ``heights`` holds that channel instead, in its unit (metres, 0..1, -1..1, levels);
    the same array as last time if nothing of it changed.
    ``basis``: with the last result of a settled solve, if it was asked for.
    """

    level: int
    heights: NDArray[np.float32]
    settled: bool
    channel: Channel = Channel.HEIGHT
    basis: Basis | None = None


@dataclass(frozen=True)
class Pyramid:
    """Levels 0..G of one solve, coarse to fine; ``settled`` False when it was stopped early."""

    levels: tuple[NDArray[np.float32], ...]
    settled: bool

    def __getitem__(self, level: int) -> NDArray[np.float32]:
        return self.levels[level]

    def __len__(self) -> int:
        return len(self.levels)


class Workspace(Protocol):
    """Memory and kernels for one solve at a time of one finest level; ``device_workspace`` says what each does."""

    top: int
    packer: Packer

    @property
    def based(self) -> bool: ...
    @property
    def gradient(self) -> multigrid.System: ...
    @property
    def height(self) -> multigrid.System: ...
    def load(self, strokes: Sequence[Stroke], settings: TerrainSettings, base: Base | None = None) -> None: ...
    def loading(
        self, strokes: Sequence[Stroke], settings: TerrainSettings, base: Base | None = None
    ) -> Iterator[None]: ...
    def guide(self, level: int) -> None: ...
    def warm(self, heights: NDArray[np.float32]) -> None: ...
    def read(self, level: int) -> NDArray[np.float32]: ...
    def read_gradient(self) -> NDArray[np.float32]: ...


class _Job(NamedTuple):
    """What is to be solved."""

    strokes: Sequence[Stroke]
    settings: TerrainSettings
    base: Base | None


class Solver:
    """Solves stroke sets on one device. Use it from one thread; solves may be interleaved level by level.

    ``device``: part of the name of an OpenCL platform or device, or "numpy"; None takes the best there is.
    ``threads`` limits PoCL and counts for the first solver of a process (default: cores - 1). Raises NoDeviceError
    when a device that was asked for by name is missing, ValueError for a level that is not solved globally.
    """

    def __init__(self, device: str | None = None, max_level: int = 4, threads: int | None = None) -> None:
        if not 0 <= max_level <= MAX_LEVEL:
            raise ValueError(f"max_level must be 0..{MAX_LEVEL}, not {max_level}")
        self.max_level = max_level
        self._spare: list[Workspace] = []
        self._refinery: Refinery | None = None
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
            self._refinery = Refinery(self._device)
        return self._refinery.refiner(basis)

    def steps(
        self,
        strokes: Sequence[Stroke],
        settings: TerrainSettings,
        levels: int | None = None,
        *,
        basis: bool = False,
        base: Base | None = None,
    ) -> Iterator[LevelResult | None]:
        """Previews of levels 0..G, each when it is finished, then 0..G settled.

        None comes wherever the work can be left for a while, or for good: between the cycles of the finest level, so
        that many rooms can share a device. Close the generator to stop; G is ``levels`` or the solver's ``max_level``.
        With ``basis`` the last result carries what refinement starts from. ``base``: the ground without strokes, above
        which heights are then given. Raises ValueError for a level outside 0..MAX_LEVEL.
        """
        return self._run(_Job(strokes, settings, base), self._level(levels), None, basis)

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
        job = _Job(strokes, settings, base)
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
        run = self._run(_Job(strokes, settings, base), top, warm, basis=False)
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

    def _run(self, job: _Job, top: int, warm: NDArray[np.float32] | None, basis: bool) -> Generator[LevelResult | None]:
        yield from self._retried(lambda level: self._attempt(job, level, warm, basis), top)

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
        self, job: _Job, top: int, warm: NDArray[np.float32] | None, basis: bool
    ) -> Generator[LevelResult | None]:
        """One solve. A workspace whose device failed, or that diverged, is dropped, all others are kept."""
        with guarded(self._device):
            settings, spoken = job.settings, speakers(job.strokes, job.settings)
            late = [layer.channel for layer in spoken if not layer.painted]
            early = [channel for channel in BASES if channel not in late]
            workspace = self._take(job, top)
            keep, loaded = True, False
            try:
                yield from workspace.loading(*job)
                loaded = True
                if warm is None:
                    previews = self._paced(_previews(workspace, preview_gradient_cycles(settings)), top)
                    yield next(previews)
                    # so what is painted keeps up with a pen that never rests; channels of which the strokes speak that
                    # the pen draws would hold it up, and come when it does rest
                    yield from self._channels(spoken, job, top, early)
                    yield from previews
                else:
                    _gradients(workspace)
                    workspace.warm(warm)
                    yield from self._channels(spoken, job, top, early)
                yield from _to_rest(workspace, settings)
                yield from self._channels(spoken, job, top, late)
                yield from _settled(workspace, job, basis)
            except GeneratorExit:
                if not loaded:
                    workspace.packer.forget()
                raise
            except BaseException as error:
                workspace.packer.forget()
                keep = not (is_fault(error) or isinstance(error, multigrid.DivergedError))
                raise
            finally:
                if keep:
                    self._give(workspace)
                del workspace  # the traceback of an error would keep it

    def _paced(self, steps: Iterator[LevelResult | None], top: int) -> Iterator[LevelResult | None]:
        """On big levels what is enqueued is done before somebody else has a turn: the queue is in order."""
        for result in steps:
            if result is None and self._device is not None and top > PACED_ABOVE:
                self._device.queue.finish()
            yield result

    def _alone(self, job: _Job, top: int) -> Iterator[LevelResult | None]:
        with guarded(self._device):
            yield from self._channels(speakers(job.strokes, job.settings), job, top, BASES)

    def _channels(
        self, spoken: Mapping[Layer, Speakers], job: _Job, top: int, channels: Iterable[Channel]
    ) -> Iterator[LevelResult | None]:
        """Channels other than the heights, final, levels coarse to fine."""
        level = channel_level(top)
        solver = self._channel_solvers.setdefault(level, ChannelSolver(self._device, level))
        for channel, levels in solver.pyramids(spoken, job.settings, channels, job.base):
            for coarser, samples in enumerate(levels):
                yield LevelResult(coarser, samples, settled=True, channel=channel)
            yield None

    def _take(self, job: _Job, top: int) -> Workspace:
        """An idle workspace that has most of these strokes rasterised already; or a new one; or the longest idle."""
        based = job.base is not None
        idle = [w for w in self._spare if w.top == top and w.based == based]
        best = max(idle, key=lambda w: w.packer.likeness(*job), default=None)
        if best is not None and 2 * best.packer.likeness(*job) < len(job.strokes):
            best = idle[0] if self._kept() + grid.solve_bytes(top) > self._spare_bytes else None
        if best is not None:
            self._spare.remove(best)
            return best
        while self._spare and self._kept() + grid.solve_bytes(top) > self._spare_bytes:
            self._spare.pop(0)
        return new_workspace(self._device, top, based)

    def _kept(self) -> int:
        return sum(grid.solve_bytes(w.top) for w in self._spare)

    def _give(self, workspace: Workspace) -> None:
        self._spare.append(workspace)
        while len(self._spare) > 1 and self._kept() > self._spare_bytes:
            self._spare.pop(0)


def preview_gradient_cycles(settings: TerrainSettings) -> int:
    """Gradient cycles of the finest preview that keep it within 10^-3 of the relief (docs/solver.md)."""
    reach = settings.size_m if settings.reach_m is None else settings.reach_m
    return PREVIEW_GRADIENT_CYCLES + sum(reach > share * settings.size_m for share in WIDE_REACHES)


def _previews(w: Workspace, gradient_cycles: int = PREVIEW_GRADIENT_CYCLES) -> Iterator[LevelResult | None]:
    """Full multigrid, both steps level by level, so that a coarse level is out before the next one is touched."""
    for level in range(w.top):
        multigrid.start(w.gradient, level)
        multigrid.finish(w.gradient, level)
        w.guide(level)
        multigrid.start(w.height, level)
        multigrid.finish(w.height, level)
        yield LevelResult(level, frozen(w.read(level)), settled=False)
    yield from _cycles(w.gradient, gradient_cycles)
    w.guide(w.top)
    yield from _cycles(w.height, PREVIEW_HEIGHT_CYCLES)
    yield LevelResult(w.top, frozen(w.read(w.top)), settled=False)


def _cycles(system: multigrid.System, count: int) -> Iterator[None]:
    """Start the finest level from the next coarser and cycle."""
    multigrid.start(system, system.top)
    for _ in range(count if system.top > 0 else 0):
        multigrid.cycle(system)
        yield


def _gradients(w: Workspace) -> None:
    """The gradient step alone, up to the finest level."""
    for level in range(w.top):
        multigrid.start(w.gradient, level)
        multigrid.finish(w.gradient, level)
    for _ in _cycles(w.gradient, PREVIEW_GRADIENT_CYCLES):
        pass


def _to_rest(w: Workspace, settings: TerrainSettings) -> Iterator[None]:
    """Cycle both steps until their error is too small to see."""
    if w.top == 0:
        return
    quantum = grid.quantum(w.top, settings.size_m)
    span = min(settings.reach_m or settings.size_m / 4, settings.size_m / 4)
    yield from multigrid.converge(w.gradient, GRADIENT_SHARE * quantum / span)
    w.guide(w.top)
    multigrid.refresh(w.height)
    yield from multigrid.converge(w.height, HEIGHT_SHARE * quantum)


def _settled(w: Workspace, job: _Job, basis: bool) -> Iterator[LevelResult]:
    """All levels of a system at rest: the finest, and its injections.

    Raises DivergedError for heights that are not finite: a kernel's largest update passes over what is not a number.
    """
    heights = frozen(w.read(w.top))
    if not np.isfinite(heights).all():
        raise multigrid.DivergedError
    *coarser, finest = enumerate(injections(heights))
    for level, samples in coarser:
        yield LevelResult(level, samples, settled=True)
    strokes, settings, base = job
    found = Basis(tuple(strokes), settings, w.top, heights, frozen(w.read_gradient()), base) if basis else None
    yield LevelResult(finest[0], finest[1], settled=True, basis=found)
