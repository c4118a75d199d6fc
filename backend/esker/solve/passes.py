"""The passes of one solve over a workspace: previews coarse to fine, cycles to rest, settled levels (DESIGN 5.3)."""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from esker import grid
from esker.contract import Stroke, TerrainSettings
from esker.events import PAUSE, Done, Pause, Preview, Settled, pauses
from esker.solve import multigrid
from esker.solve.base import Base, Bound
from esker.solve.constraints.constraints import Packer
from esker.solve.injection import frozen, injections

PREVIEW_GRADIENT_CYCLES = 1
PREVIEW_HEIGHT_CYCLES = 3
WIDE_REACHES = (1 / 16, 1 / 4)
"""A reach above each of these shares of the domain takes one gradient cycle more: what full multigrid leaves of the
gradient is smooth, and the farther it is felt the more height it adds up to."""
AMEND_SHARE = 1e-3
"""Estimated error, as a share of the relief, at which a preview made from the ground before an edit is shown."""
AMEND_CYCLES = 5
"""Cycles after which it is given up."""
HEIGHT_SHARE = 0.25
"""Error, in quanta of the finest level, at which the heights are at rest: half of what DESIGN 5.3 asks for."""
GRADIENT_SHARE = 1 / 16
"""Share of a quantum that the gradient's own error may cost the heights."""


@dataclass(frozen=True)
class Basis:
    """A settled solve, from which refinement above the global levels starts (DESIGN 5.6).

    heights: (N, N) float32 of level ``level``, metres above the ``base`` (None: a plane at 0); gradient: (2, N, N)
    float32, d/dx and d/dy, metres per metre: in bands that of the ground, elsewhere of the heights. Both read-only.
    """

    strokes: tuple[Stroke, ...]
    settings: TerrainSettings
    level: int
    heights: NDArray[np.float32]
    gradient: NDArray[np.float32]
    base: Base | None = None


class Workspace(Protocol):
    """Memory and kernels for one solve at a time of one finest level; ``device_workspace`` says what each does.

    preview_workspace: a small one that makes the coarsest preview of the same strokes; None below level
    ``grid.PREVIEW_WORKSPACE_FROM``.
    relief_m: about how high the ground is from its deepest to its highest, once there was a coarsest preview.
    bytes: memory that it holds, without its preview workspace.
    solved_for: settings and base (``conditions``) that the ground of the finest level, u of both steps, was solved
    with, if that ground is of the strokes that are packed; None where it is not.
    """

    top: int
    packer: Packer
    preview_workspace: Workspace | None
    solved_for: object
    relief_m: float
    based: bool

    @property
    def bytes(self) -> int: ...
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
    def given(self, heights: NDArray[np.float32], gradient: NDArray[np.float32]) -> None: ...
    def rest(self) -> None: ...


class Job(NamedTuple):
    """The strokes, settings and base to be solved. ``base``: see ``Basis``, on the device that solves."""

    strokes: Sequence[Stroke]
    settings: TerrainSettings
    base: Bound | None


def preview_gradient_cycles(settings: TerrainSettings) -> int:
    """Gradient cycles of the finest preview that keep it within 10^-3 of the relief (docs/solver.md)."""
    reach = settings.size_m if settings.reach_m is None else settings.reach_m
    return PREVIEW_GRADIENT_CYCLES + sum(reach > share * settings.size_m for share in WIDE_REACHES)


def coarsest_preview(w: Workspace, job: Job) -> Iterator[Preview | Pause]:
    """The coarsest preview, made by the preview workspace from constraints that were rasterised coarsely."""
    small = w.preview_workspace
    assert small is not None
    yield from pauses(small.loading(*job))
    _coarse(small, 0)
    found = frozen(small.read(0))
    w.relief_m = max(float(np.ptp(found)), 1.0)
    small.rest()
    yield Preview(0, found)


def _coarse(w: Workspace, level: int) -> None:
    """Makes both steps on a level below the finest, once the next coarser one is done."""
    multigrid.start(w.gradient, level)
    multigrid.finish(w.gradient, level)
    w.guide(level)
    multigrid.start(w.height, level)
    multigrid.finish(w.height, level)


def previews(
    w: Workspace, gradient_cycles: int = PREVIEW_GRADIENT_CYCLES, *, coarsest: bool = True
) -> Iterator[Preview | Pause]:
    """Full multigrid, both steps level by level, so that a coarse level is out before the next one is touched.

    Not ``coarsest``: without level 0, which is out already.
    """
    for level in full_multigrid(w, gradient_cycles):
        if level is None:
            yield PAUSE
        elif level > 0 or coarsest or w.top == 0:
            yield Preview(level, frozen(w.read(level)))


def unseen(w: Workspace, job: Job) -> Generator[Settled | Pause]:
    """The heights of the finest level at rest, those of ``previews``, ``to_rest`` and ``settled`` to the bit, and
    nothing of what they show on the way. Raises DivergedError."""
    yield from pauses(w.loading(*job))
    w.solved_for = None
    for _ in full_multigrid(w, preview_gradient_cycles(job.settings)):
        yield PAUSE
    w.solved_for = conditions(job)
    yield from pauses(to_rest(w, job.settings))
    yield Settled(w.top, finest(w))


def full_multigrid(w: Workspace, gradient_cycles: int) -> Iterator[int | None]:
    """Makes both steps level by level.

    Yields each level when it is done, and None where the work can be left before that.
    """
    for level in range(w.top):
        _coarse(w, level)
        yield level
    w.solved_for = None
    yield from _cycles(w.gradient, gradient_cycles)
    w.guide(w.top)
    yield from _cycles(w.height, PREVIEW_HEIGHT_CYCLES)
    yield w.top


def conditions(job: Job) -> object:
    """Returns the conditions under which ``amended`` may be used: strokes may have changed, these not."""
    return job.settings, None if job.base is None else job.base.base.digest


def amended(w: Workspace, settings: TerrainSettings, relief_m: float) -> Iterator[Preview | Pause]:
    """The finest preview of an edit from the ground before it, which ``w`` still holds: no level of full multigrid, and
    as many cycles as it takes. No result where those are too many: full multigrid is better then.

    Each cycle takes off the error of the ground of before, too, so edits may follow each other. The work can be left
    between the steps, as a newer stroke's first preview waits for what was begun.
    """
    yield PAUSE
    amend_gradient(w, settings)
    yield PAUSE
    amend_guidance(w)
    multigrid.cycle(w.height)
    yield PAUSE
    for more in range(AMEND_CYCLES - 1):
        if more == 1:  # a large edit: then what is left of the gradient's error counts, too
            multigrid.cycle(w.gradient)
            amend_guidance(w)
        multigrid.cycle(w.height)
        if w.height.change("v", "u") * multigrid.UPDATE_SHARE < AMEND_SHARE * relief_m:
            yield Preview(w.top, frozen(w.read(w.top)))
            return
        yield PAUSE


def amend_gradient(w: Workspace, settings: TerrainSettings) -> None:
    """The gradient step of ``amended``."""
    multigrid.refresh(w.gradient)
    for _ in range(preview_gradient_cycles(settings)):
        multigrid.cycle(w.gradient)


def amend_guidance(w: Workspace) -> None:
    """The right-hand side of its height step, and the residual that cycles begin with."""
    w.guide(w.top)
    w.height.hold()
    multigrid.refresh(w.height)


def _cycles(system: multigrid.System, count: int) -> Iterator[None]:
    """Start the finest level from the next coarser and cycle."""
    multigrid.start(system, system.top)
    for _ in range(count if system.top > 0 else 0):
        multigrid.cycle(system)
        yield


def gradients(w: Workspace) -> None:
    """The gradient step alone, up to the finest level."""
    for level in range(w.top):
        multigrid.start(w.gradient, level)
        multigrid.finish(w.gradient, level)
    for _ in _cycles(w.gradient, PREVIEW_GRADIENT_CYCLES):
        pass


def to_rest(w: Workspace, settings: TerrainSettings) -> Iterator[None]:
    """Cycle both steps until their error is too small to see. Raises DivergedError."""
    quantum = grid.quantum(w.top, settings.size_m)
    span = min(settings.reach_m or settings.size_m / 4, settings.size_m / 4)
    yield from multigrid.converge(w.gradient, GRADIENT_SHARE * quantum / span)
    w.guide(w.top)
    if w.top > 0:
        multigrid.refresh(w.height)
    yield from multigrid.converge(w.height, HEIGHT_SHARE * quantum)


def finest(w: Workspace) -> NDArray[np.float32]:
    """The heights of the finest level of a system at rest. Raises DivergedError for heights that are not finite."""
    heights = frozen(w.read(w.top))
    if not np.isfinite(heights).all():
        raise multigrid.DivergedError
    return heights


def settled(w: Workspace, job: Job, basis: bool) -> Iterator[Settled | Done]:
    """All levels of a system at rest: the finest, and its injections.

    Raises DivergedError for heights that are not finite: a kernel's largest update passes over what is not a number.
    """
    heights = finest(w)
    *coarser, last = enumerate(injections(heights))
    for level, samples in coarser:
        yield Settled(level, samples)
    strokes, settings, base = job
    own = None if base is None else base.base
    found = Basis(tuple(strokes), settings, w.top, heights, frozen(w.read_gradient()), own) if basis else None
    if found is not None:
        w.given(heights, found.gradient)
    yield Settled(*last)
    yield Done(found)
