"""Workspaces of one solver: who solves next takes one over, and those that nobody uses go (DESIGN 5.3; decision 31).

All of them together stay within a bound at every moment, those that solve included, so far as those that are idle can
make room. What a workspace that went had packed is kept: the room that comes back is rasterised, but not packed again.
"""

from __future__ import annotations

import time
import weakref

from esker import grid
from esker.process import memory, system
from esker.solve.constraints.constraints import Packer, Shapes
from esker.solve.opencl.device import Device
from esker.solve.opencl.workspaces import new_workspace
from esker.solve.passes import Job, Workspace

MOST_BYTES = 3 << 29
"""Memory that workspaces may hold, with the raster of the strokes that they last solved, but no more than an eighth of
what there is: a room whose workspace was given to another one has all its strokes rasterised again."""
SHARE = 8
SPARE_SECONDS = 20.0
"""How long a workspace is kept that nobody uses: who has rested for longer waits once for the raster."""
PACKED = 16
"""Rooms whose packed strokes are kept after their workspace went, some kilobytes a stroke."""
PACKED_SECONDS = 300.0


class Spares:
    """Use it from the solver's thread. ``idle``: longest idle first."""

    def __init__(self, shapes: Shapes) -> None:
        self._shapes = shapes
        self.bound = min(MOST_BYTES, memory.available_bytes() // SHARE)
        self.idle: list[Workspace] = []
        self.since: weakref.WeakKeyDictionary[Workspace, float] = weakref.WeakKeyDictionary()
        self._made: weakref.WeakSet[Workspace] = weakref.WeakSet()
        self._packed: list[tuple[float, int, bool, Packer, Packer | None]] = []
        """What workspaces that went had packed: since when, their level, whether over a base, and their scout's."""

    def take(self, job: Job, top: int, device: Device | None) -> Workspace:
        """An idle workspace that has most of these strokes rasterised already; or a new one; or the longest idle."""
        based = job.base is not None
        idle = [w for w in self.idle if w.top == top and w.based == based]
        strokes, settings = job.strokes, job.settings
        best = max(idle, key=lambda w: w.packer.likeness(strokes, settings), default=None)
        if best is not None and 2 * best.packer.likeness(strokes, settings) < len(strokes):
            # Where everybody in a room draws at once, most strokes differ from solve to solve: it is theirs still.
            best = max(idle, key=lambda w: w.packer.kinship(strokes))
            if 2 * best.packer.kinship(strokes) < len(strokes):
                best = idle[0] if self.held + grid.solve_bytes(top, based) > self.bound else None
        if best is not None:
            self.idle.remove(best)
            return best
        while self.idle and self.held + grid.solve_bytes(top, based) > self.bound:
            self._drop(self.idle[0])
        return self._new(job, top, device)

    def _new(self, job: Job, top: int, device: Device | None) -> Workspace:
        based = job.base is not None
        made = new_workspace(device, top, based)
        made.packer.shapes = self._shapes
        if top >= grid.SCOUT_FROM:
            made.scout = new_workspace(device, grid.SCOUT, based)
            made.scout.packer.shapes = self._shapes
        self._made.add(made)
        for packed in self._packed:
            _, level, over, packer, scouts = packed
            if (level, over) == (top, based) and 2 * packer.likeness(job.strokes, job.settings) > len(job.strokes):
                made.packer = packer
                if made.scout is not None and scouts is not None:
                    made.scout.packer = scouts
                self._packed.remove(packed)
                break
        return made

    @property
    def held(self) -> int:
        """Bytes of all workspaces that there are."""
        return sum(grid.solve_bytes(w.top, w.based) for w in self._made)

    def give(self, workspace: Workspace) -> None:
        """A solve has ended; its workspace may be taken over."""
        self.idle.append(workspace)
        self.since[workspace] = time.monotonic()
        while len(self.idle) > 1 and self.held > self.bound:
            self._drop(self.idle[0])

    def _drop(self, workspace: Workspace, now: float | None = None) -> None:
        """A workspace goes; what it had packed stays for a while."""
        self.idle.remove(workspace)
        self._made.discard(workspace)
        packers = [workspace.packer] + ([workspace.scout.packer] if workspace.scout is not None else [])
        for packer in packers:
            packer.unrastered()
        scout = packers[1] if len(packers) > 1 else None
        self._packed.append(
            (time.monotonic() if now is None else now, workspace.top, workspace.based, packers[0], scout)
        )
        del self._packed[:-PACKED]

    def tidy(self, now: float) -> int:
        """Gives back the memory of workspaces that have been idle for SPARE_SECONDS; returns how many there were."""
        count = 0
        while (late := next((w for w in self.idle if self.since[w] <= now - SPARE_SECONDS), None)) is not None:
            self._drop(late, now)
            count += 1
        if count:
            system.give_memory_back()
        self._packed = [packed for packed in self._packed if packed[0] > now - PACKED_SECONDS]
        return count

    def clear(self) -> None:
        """Without memory: what is kept for later goes at once."""
        self.idle.clear()
        self._packed.clear()
