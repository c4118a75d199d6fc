"""Where the milliseconds of one appended segment go, in this process, one step after the other (DESIGN 15).

Each phase is the least and the median over all segments. On the wire come the socket, the journal and the hand-over
from thread to thread beside them; what is computed in another thread there does not add up.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from esker import contract as c
from esker.events import Level
from esker.solve import multigrid, passes
from esker.solve.passes import Job
from esker.solve.solver import Solver
from esker.tiles.delivery import ClientTiles, TileServer


class _Clock:
    """Adds up what each phase of a segment takes."""

    def __init__(self, finish: Callable[[], None]) -> None:
        self._finish = finish
        self._taken: list[dict[str, float]] = []

    def segment(self) -> None:
        """The next segment begins."""
        self._taken.append({})

    def __call__(self, phase: str, work: Callable[[], Any]) -> Any:
        start = time.perf_counter()
        found = work()
        self._finish()
        row = self._taken[-1]
        row[phase] = row.get(phase, 0.0) + time.perf_counter() - start
        return found

    def result(self) -> dict[str, dict[str, float]]:
        """Least and median milliseconds by phase."""
        columns = {phase: [1000 * row.get(phase, 0.0) for row in self._taken] for phase in self._taken[0]}
        return {p: {"least": round(min(v), 2), "p50": round(float(np.median(v)), 2)} for p, v in columns.items()}


def measure(solver: Solver, documents: Sequence[c.Document], tiles: TileServer, client: ClientTiles) -> dict[str, Any]:
    """Phases of documents that follow one another by a segment each; the first only prepares.

    ``tiles`` holds the ground before them, ``client`` looks at it and has what it wants. Without a device: nothing.
    """
    if solver.device is None:
        return {}
    first, *rest = documents
    for result in solver.steps(first.strokes, first.settings, tiles.levels):
        if isinstance(result, Level):
            tiles.put_level(first.clock, result.level, result.heights, result.settled, result.channel)
    _send(client, lambda _, work: work())
    clock = _Clock(solver.device.queue.finish)
    workspace = solver._pool.idle[-1]
    assert workspace.preview_workspace is not None
    for number, document in enumerate(rest):
        clock.segment()
        job = Job(document.strokes, document.settings, None)
        coarse = _solve(clock, workspace.preview_workspace, job, "level 0: ", 0)
        clock("level 0: take", lambda: tiles.put_level(first.clock + number + 1, 0, coarse, False))  # noqa: B023
        _send(client, clock, "level 0: ")
        fine = _solve(clock, workspace, job, "", tiles.levels)
        clock("take", lambda: tiles.put_level(first.clock + number + 1, tiles.levels, fine, False))  # noqa: B023
        _send(client, clock)
    return clock.result()


def _solve(clock: _Clock, workspace: Any, job: Job, name: str, level: int) -> Any:
    """Previews up to ``level`` as ``passes`` makes them, with a pause after each phase."""
    tables, window = clock(f"{name}pack", lambda: workspace.packer.pack(*job))
    workspace.size_m = tables.size_m
    clock(f"{name}raster", lambda: workspace.rasterise(tables, window))
    rows = window.sample_rows
    for system in (workspace.gradient, workspace.height):
        clock(f"{name}coarsen", lambda: system.coarsen(tables.screening, rows))  # noqa: B023
    if level:  # from the ground before (``passes.amended``)
        clock("gradient", lambda: passes.amend_gradient(workspace, job.settings))
        clock("guidance", lambda: passes.amend_guidance(workspace))
        for _ in range(2):
            clock("heights", lambda: multigrid.cycle(workspace.height))
    else:
        clock(f"{name}coarse levels", lambda: passes._coarse(workspace, 0))
    return clock(f"{name}read", lambda: workspace.read(level))


def _send(client: ClientTiles, clock: Callable[..., Any], name: str = "") -> None:
    while (plan := clock(f"{name}plan", client.plan)) is not None:
        clock(f"{name}encode", plan.encode)
        client.commit(plan)
