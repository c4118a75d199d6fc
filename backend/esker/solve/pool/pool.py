"""The workspaces of one solver: who solves leases one, and those that nobody leases go (DESIGN 5.3; decision 31).

All of them together stay within a bound at every moment, leased ones included, as far as idle ones can make room. Few
of them have device memory at a time: the others are parked (decision 57). What a workspace that went had packed is
kept: the room that comes back is rasterised again, but not packed again.
"""

from __future__ import annotations

import time
import weakref
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass

from esker import grid
from esker.contract import Stroke, TerrainSettings
from esker.events import SolveEvent
from esker.process import memory, system
from esker.solve import multigrid
from esker.solve.constraints.constraints import Packer, Shapes
from esker.solve.opencl.device import Device
from esker.solve.opencl.device_workspace import DeviceWorkspace
from esker.solve.opencl.faults import is_fault
from esker.solve.opencl.workspaces import new_workspace
from esker.solve.passes import Job, Workspace
from esker.solve.pool.residency import SHARE as ARENAS_SHARE
from esker.solve.pool.residency import Residency

MOST_BYTES = 3 << 29
"""Memory that workspaces may hold, with the raster of the strokes that they last solved, but no more than an eighth of
what there is: a room whose workspace was given to another one has all its strokes rasterised again."""
SHARE = 8
SPARE_SECONDS = 20.0
"""How long a workspace is kept that nobody uses: who has rested for longer waits once for the raster."""
TRIM_SECONDS = 5.0
"""While solves follow each other, memory that they freed is returned to the system this often: the C library keeps it,
and some seconds of previews leave a hundred megabytes."""
PACKED = 16
"""Rooms whose packed strokes are kept after their workspace went, some kilobytes a stroke."""
PACKED_SECONDS = 300.0


def best_packed(packers: Sequence[Packer], strokes: Sequence[Stroke], settings: TerrainSettings) -> Packer | None:
    """Returns the packer whose last set has at least half of these strokes, or None where all are of other rooms.

    Unchanged strokes count first: what they ask need not be rasterised again. Where everybody in a room draws at once
    most strokes differ from solve to solve; then shared ids tell that the set is the same room's.
    """
    counts = [packer.unchanged_count(strokes, settings) for packer in packers]
    if 2 * max(counts, default=0) < len(strokes):
        counts = [packer.shared_ids(strokes) for packer in packers]
    most = max(counts, default=0)
    return packers[counts.index(most)] if packers and 2 * most >= len(strokes) else None


def _both(workspace: Workspace) -> list[Workspace]:
    """A workspace and its preview workspace."""
    small = workspace.preview_workspace
    return [workspace] if small is None else [workspace, small]


@dataclass(eq=False)
class Lease:
    """A solve's hold on a workspace: there is none before the solve needs one, and none after it ended."""

    workspace: Workspace | None = None


@dataclass(frozen=True)
class Packed:
    """Strokes that a workspace had packed before it went. since: of ``time.monotonic``; preview: those of its preview
    workspace."""

    since: float
    top: int
    based: bool
    packer: Packer
    preview: Packer | None


class WorkspacePool:
    """Owns the workspaces of a solver. Use it from the solver's thread.

    idle: workspaces that nobody leases, the longest idle first; since: when each became idle; bound: bytes that all
    workspaces may hold.
    """

    def __init__(self, shapes: Shapes) -> None:
        self._shapes = shapes
        self.bound = min(MOST_BYTES, memory.available_bytes() // SHARE)
        self.residency = Residency(self.bound // ARENAS_SHARE)
        self.idle: list[Workspace] = []
        self.since: weakref.WeakKeyDictionary[Workspace, float] = weakref.WeakKeyDictionary()
        self._made: weakref.WeakSet[Workspace] = weakref.WeakSet()
        self._packed: list[Packed] = []
        self._leases, self._trimmed = 0, time.monotonic()
        """Leases since memory was last returned to the system, and when that was."""

    def leased(
        self,
        lease: Lease,
        job: Job,
        top: int,
        device: Device | None,
        work: Callable[[Workspace], Generator[SolveEvent]],
    ) -> Iterator[SolveEvent]:
        """Does ``work`` with a workspace for a job, which is idle afterwards.

        A workspace whose device failed, or whose solve diverged, is dropped. Raises what ``work`` raises and
        OutOfDeviceMemoryError.
        """
        workspace = lease.workspace = self.take(job, top, device)
        self._leases += 1
        keep = True
        try:
            yield from self._resident(workspace, work(workspace))
        except GeneratorExit:  # what is packed and rasterised is still that of some set
            raise
        except BaseException as error:
            workspace.packer.forget()
            if workspace.preview_workspace is not None:
                workspace.preview_workspace.packer.forget()
            keep = not (is_fault(error) or isinstance(error, multigrid.DivergedError))
            raise
        finally:
            lease.workspace = None
            for each in _both(workspace):
                each.rest()
            if keep:
                self.give(workspace)
            del workspace  # the traceback of an error would keep it

    def take(self, job: Job, top: int, device: Device | None) -> Workspace:
        """Returns an idle workspace that has most of these strokes already; or a new one, for which those go that are
        idle longest.

        Raises OutOfDeviceMemoryError.
        """
        based = job.base is not None
        idle = [w for w in self.idle if w.top == top and w.based == based]
        packer = best_packed([w.packer for w in idle], job.strokes, job.settings)
        taken = next((w for w in idle if w.packer is packer), None)
        if taken is not None:
            self.idle.remove(taken)
            return taken
        while self.idle and self._is_full(top, based):
            self._drop(self.idle[0])
        return self._new(job, top, device)

    def _new(self, job: Job, top: int, device: Device | None) -> Workspace:
        """Makes a workspace, with what an earlier one had packed of the same room."""
        based = job.base is not None
        made = self._empty(device, top, based)
        if top >= grid.PREVIEW_WORKSPACE_FROM:
            made.preview_workspace = self._empty(device, grid.PREVIEW_WORKSPACE_LEVEL, based)
        self._made.add(made)
        for kept in self._packed:
            same = (kept.top, kept.based) == (top, based)
            if same and 2 * kept.packer.unchanged_count(job.strokes, job.settings) > len(job.strokes):
                made.packer = kept.packer
                if made.preview_workspace is not None and kept.preview is not None:
                    made.preview_workspace.packer = kept.preview
                self._packed.remove(kept)
                break
        return made

    def _empty(self, device: Device | None, top: int, based: bool) -> Workspace:
        made = new_workspace(None, top, based) if device is None else self.residency.new(device, top, based)
        made.packer.shapes = self._shapes
        return made

    def _resident(self, workspace: Workspace, steps: Generator[SolveEvent]) -> Iterator[SolveEvent]:
        """The steps of a solve. When it goes on, somebody else may have had its memory meanwhile."""
        with closing(steps):
            for event in steps:
                yield event
                for each in _both(workspace):
                    if isinstance(each, DeviceWorkspace) and each.in_progress:
                        self.residency.admit(each)

    @property
    def held(self) -> int:
        """Bytes of all workspaces that there are, and of what is kept for the next ones."""
        return self.residency.bytes + sum(each.bytes for w in self._made for each in _both(w))

    def _is_full(self, top: int, based: bool) -> bool:
        """Returns whether one more workspace would be beyond the bound."""
        kinds = [(top, based)]
        if top >= grid.PREVIEW_WORKSPACE_FROM:
            kinds.append((grid.PREVIEW_WORKSPACE_LEVEL, based))
        return self.held + sum(self.residency.cost(*kind) for kind in kinds) > self.bound

    def give(self, workspace: Workspace) -> None:
        """Takes back a workspace that ``take`` gave: it may be leased again."""
        self.idle.append(workspace)
        self.since[workspace] = time.monotonic()
        while len(self.idle) > 1 and self.held > self.bound:
            self._drop(self.idle[0])

    def _drop(self, workspace: Workspace, now: float | None = None) -> None:
        """Lets a workspace go. What it had packed stays for a while."""
        self.idle.remove(workspace)
        self._made.discard(workspace)
        preview = None if workspace.preview_workspace is None else workspace.preview_workspace.packer
        for each in _both(workspace):
            each.packer.unrastered()
            if isinstance(each, DeviceWorkspace):
                self.residency.drop(each)
        since = time.monotonic() if now is None else now
        self._packed.append(Packed(since, workspace.top, workspace.based, workspace.packer, preview))
        del self._packed[:-PACKED]

    def tidy(self, now: float) -> int:
        """Gives back the memory of workspaces that have been idle for SPARE_SECONDS, and now and then what solves
        freed. Returns how many workspaces there were."""
        count = 0
        while (late := next((w for w in self.idle if self.since[w] <= now - SPARE_SECONDS), None)) is not None:
            self._drop(late, now)
            count += 1
        if count:
            self.residency.clear()
        if count or (self._leases and now - self._trimmed >= TRIM_SECONDS):
            self._leases, self._trimmed = 0, now
            system.give_memory_back()
        self._packed = [kept for kept in self._packed if kept.since > now - PACKED_SECONDS]
        return count

    def clear(self) -> None:
        """Forgets at once what is kept for later: there is no memory for it."""
        self.idle.clear()
        self._packed.clear()
        self.residency.clear()
