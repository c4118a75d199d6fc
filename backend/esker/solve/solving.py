"""A solve in progress, which can tell what newer strokes look like from afar while it goes on (DESIGN 8)."""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from typing import Any

from esker.contract import Stroke, TerrainSettings
from esker.events import Preview, SolveEvent
from esker.solve import passes
from esker.solve.base import Base, bound
from esker.solve.constraints.computable import computable
from esker.solve.opencl.device import Device
from esker.solve.opencl.faults import guarded
from esker.solve.passes import Job
from esker.solve.pool.pool import Lease

EARLY_STROKES = 128
"""Strokes that may be packed for an early preview, which cannot be left."""


class Solving(Iterator[SolveEvent]):
    """The iterator that ``Solver.steps`` gives. It is to be closed when it is left early."""

    def __init__(self, run: Generator[SolveEvent, Any, Any], lease: Lease, device: Device | None) -> None:
        self._run, self._lease, self._device = run, lease, device

    def __next__(self) -> SolveEvent:
        return next(self._run)

    def close(self) -> None:
        """Ends the solve; its workspace is free for others."""
        self._run.close()

    def early_preview(
        self, strokes: Sequence[Stroke], settings: TerrainSettings, base: Base | None = None
    ) -> Preview | None:
        """The coarsest preview of other strokes, as their own solve would begin with; None where that has no
        preview workspace, or where so many strokes are others that it would take longer than a turn.

        Changes nothing of the solve: its preview workspace has done its work. To be called between two steps, in their
        thread.
        Raises DeviceErrors.
        """
        workspace = self._lease.workspace
        if workspace is None or workspace.preview_workspace is None or (base is None) == workspace.based:
            return None
        try:
            with guarded(self._device):
                job = Job(strokes, computable(settings), bound(base, self._device))
                if len(strokes) - workspace.preview_workspace.packer.unchanged_count(*job[:2]) > EARLY_STROKES:
                    return None
                return next(found for found in passes.coarsest_preview(workspace, job) if isinstance(found, Preview))
        except BaseException:
            workspace.preview_workspace.packer.forget()
            raise
