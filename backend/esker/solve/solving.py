"""A solve in progress, which can tell what newer strokes look like from afar while it goes on (DESIGN 8)."""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from esker.contract import Stroke, TerrainSettings
from esker.solve import passes
from esker.solve.base import Base, bound
from esker.solve.device import Device
from esker.solve.faults import guarded
from esker.solve.passes import Job, LevelResult, Workspace


@dataclass(eq=False)
class Seat:
    """Where a solve keeps the workspace that it has at present."""

    workspace: Workspace | None = None


class Solving(Iterator[LevelResult | None]):
    """What ``Solver.steps`` gives: an iterator to be closed when it is left early."""

    def __init__(self, run: Generator[LevelResult | None, Any, Any], seat: Seat, device: Device | None) -> None:
        self._run, self._seat, self._device = run, seat, device

    def __next__(self) -> LevelResult | None:
        return next(self._run)

    def close(self) -> None:
        """Ends the solve; its workspace is free for others."""
        self._run.close()

    def glimpse(
        self, strokes: Sequence[Stroke], settings: TerrainSettings, base: Base | None = None
    ) -> LevelResult | None:
        """The coarsest preview of other strokes, as their own solve would begin with; None where that has no scout.

        Changes nothing of the solve: its scout has done its work. To be called between two steps, in their thread.
        Raises DeviceErrors.
        """
        workspace = self._seat.workspace
        if workspace is None or workspace.scout is None or (base is None) == workspace.based:
            return None
        try:
            with guarded(self._device):
                return passes.scouted(workspace, Job(strokes, settings, bound(base, self._device)))
        except BaseException:
            workspace.scout.packer.forget()
            raise
