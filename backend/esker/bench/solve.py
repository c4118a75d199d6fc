"""The solver alone: set-up, previews, settling, convergence and bytes per level (DESIGN 15).

Times are the least and the median of several runs of the whole step in one process, on the solver's default device.
Bytes are a model: each visit reads guess, right-hand side and stiffness and writes the result once, and reads or writes
a quarter of that for the coarser level; the share is those bytes over the time of a cycle, against a plain copy of
64 MiB in NumPy on the same machine in the same run. The peer is SciPy's sparse direct solver on the same system.
"""

from __future__ import annotations

import argparse
import json
import statistics
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import scipy.sparse.linalg as spla

from esker import grid, templates
from esker.bench import _serving
from esker.bench.stream import fifty
from esker.contract import DEFAULT_LEVEL, MAX_LEVEL, Stroke, TerrainSettings
from esker.solve import multigrid
from esker.solve.assembly import assemble
from esker.solve.device import open_device
from esker.solve.levels import ClSystem, ClWorkspace
from esker.solve.solver import PREVIEW_GRADIENT_CYCLES, PREVIEW_HEIGHT_CYCLES, Solver

RUNS = 7
PEER_LEVEL = 3
COPY_BYTES = 64 * 1024 * 1024
FINE_BYTES = 16
"""Per sample of a visit: guess, right-hand side, stiffness, result."""
COARSE_BYTES = 2
"""Per fine sample: the correction read and the residual written at a quarter of the samples."""
RESTRICT_BYTES = 5


@dataclass
class Recorder:
    """A ``multigrid.System`` that only counts the bytes of the model and the launches."""

    top: int
    channels: int
    moved: float = 0
    launches: int = 0
    order: list[str] = field(default_factory=list)

    def _count(self, level: int, per_sample: float) -> None:
        self.moved += self.channels * per_sample * grid.samples(level) ** 2
        self.launches += 1

    def visit(
        self, level: int, *, rhs: str, out: str, guess: str | None, correction: str | None, residual: bool
    ) -> None:
        self.order.append(f"{rhs}{out}{level}")
        fine = FINE_BYTES if guess is not None else FINE_BYTES - 4
        self._count(level, fine + COARSE_BYTES / 2 * ((correction is not None) + residual))

    def restrict(self, level: int) -> None:
        self._count(level, RESTRICT_BYTES)

    def bottom(self, *, rhs: str, out: str, cycles: int) -> None:
        self.order.append(f"{rhs}{out}0x{cycles}")
        self._count(0, FINE_BYTES * cycles)

    def swap(self, level: int) -> None:
        self.order.append(f"swap{level}")

    def change(self, old: str, new: str) -> float:
        raise NotImplementedError(f"nothing to compare in {old} and {new}: only the order of calls is recorded")


def timed(work: Callable[[], object], runs: int = RUNS) -> dict[str, float]:
    """Milliseconds: least and median."""
    work()
    out = []
    for _ in range(runs):
        start = time.perf_counter()
        work()
        out.append(1e3 * (time.perf_counter() - start))
    return {"least": round(min(out), 2), "median": round(statistics.median(out), 2)}


def copy_bandwidth() -> float:
    """Bytes read plus written per second by a copy of COPY_BYTES, best of several."""
    a = np.ones(COPY_BYTES // 4, dtype=np.float32)
    b = np.empty_like(a)
    return 2 * COPY_BYTES / (timed(lambda: np.copyto(b, a))["least"] / 1e3)


def stages(solver: Solver, strokes: Sequence[Stroke], settings: TerrainSettings, level: int) -> dict[str, float]:
    """Milliseconds from the call to level 0, to the last preview, to the last settled level; least of RUNS."""
    best: dict[str, float] = {}
    for _ in range(RUNS):
        start = time.perf_counter()
        for result in solver.steps(strokes, settings, level):
            if result is None:
                continue
            name = "settled" if result.settled else f"level_{result.level}"
            now = 1e3 * (time.perf_counter() - start)
            if result.settled and result.level < level:
                continue
            best[name] = round(min(best.get(name, 1e9), now), 2)
    return best


def edits(strokes: Sequence[Stroke]) -> list[list[Stroke]]:
    """The set with one stroke shortened, several times: what an append undoes."""
    out = []
    for k in range(0, len(strokes), max(1, len(strokes) // RUNS)):
        s = strokes[k]
        out.append([*strokes[:k], s.model_copy(update={"curve": s.curve[:-2]}), *strokes[k + 1 :]])
    return out


def after_edit(solver: Solver, strokes: Sequence[Stroke], settings: TerrainSettings, level: int) -> dict[str, float]:
    """Milliseconds from a one-stroke change to level 0 and to the finest preview, median over several strokes."""
    first, last = [], []
    for edited in edits(strokes):
        solver.solve(strokes, settings, level)
        start = time.perf_counter()
        for result in solver.steps(edited, settings, level):
            if result is None:
                continue
            now = 1e3 * (time.perf_counter() - start)
            if result.level == 0:
                first.append(now)
            if result.level == level:
                last.append(now)
                break
    return {"level_0": round(statistics.median(first), 2), f"level_{level}": round(statistics.median(last), 2)}


def kernels(w: ClWorkspace, strokes: Sequence[Stroke], settings: TerrainSettings, copy: float) -> dict[str, Any]:
    """Set-up and cycles of a workspace by themselves, with factors and the share of the copy bandwidth."""
    queue, top = w.launch.queue, w.top

    def finished(work: Callable[[], object]) -> Callable[[], None]:
        def run() -> None:
            work()
            queue.finish()

        return run

    def load() -> None:
        w.packer.forget()
        w.load(strokes, settings)

    out: dict[str, Any] = {"set_up_ms": timed(finished(load))}
    out["gradient_factor"] = _to_start(w.gradient, PREVIEW_GRADIENT_CYCLES)
    for level in range(top + 1):
        w.guide(level)
    out["height_factor"] = _to_start(w.height, PREVIEW_HEIGHT_CYCLES)
    for name, system in (("gradient", w.gradient), ("height", w.height)):
        model = Recorder(top, system.channels)
        multigrid.cycle(model)
        ms = timed(finished(lambda system=system: multigrid.cycle(system)))  # type: ignore[misc]
        out[f"{name}_cycle"] = {
            "ms": ms,
            "launches": model.launches,
            "model_mb": round(model.moved / 1e6, 1),
            "share_of_copy": round(model.moved / (ms["least"] / 1e3) / copy, 3),
        }
    return out


def _to_start(system: ClSystem, done: int) -> float:
    """Full multigrid, then the mean convergence factor of the cycles that float32 can still see."""
    for level in range(system.top):
        multigrid.start(system, level)
        multigrid.finish(system, level)
    multigrid.start(system, system.top)
    updates = []
    for _ in range(done + 5):
        multigrid.cycle(system)
        updates.append(system.change("v", "u"))
    first, last = updates[1], updates[4]
    return round((last / first) ** (1 / 3), 3) if first > 0 else 0.0


def peer(strokes: Sequence[Stroke], settings: TerrainSettings, solver: Solver) -> dict[str, float]:
    """SciPy's direct solver for one height channel, and how far the settled heights are from it."""
    a, b = assemble(strokes, settings, PEER_LEVEL)
    start = time.perf_counter()
    exact = spla.spsolve(a.tocsc(), b)
    elapsed = time.perf_counter() - start
    heights = solver.solve(strokes, settings, PEER_LEVEL)[PEER_LEVEL]
    error = np.abs(heights.ravel() - exact).max() / np.ptp(exact)
    return {"level": PEER_LEVEL, "spsolve_ms": round(1e3 * elapsed, 1), "error_of_relief": float(f"{error:.2g}")}


def scenes() -> dict[str, tuple[Sequence[Stroke], TerrainSettings]]:
    """Fifty seeded strokes, and the starting terrains."""
    out: dict[str, tuple[Sequence[Stroke], TerrainSettings]] = {"fifty": (fifty().strokes, TerrainSettings())}
    for name in templates.ORDER:
        document = templates.load(name).document
        out[name] = (document.strokes, document.settings)
    return out


def main(argv: list[str]) -> int:
    """``esker bench solve [--json] [--finest N] [--scene NAME ...]``."""
    parser = argparse.ArgumentParser(prog="esker bench solve", description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("--finest", type=int, choices=range(1, MAX_LEVEL + 1), default=DEFAULT_LEVEL, metavar="N")
    parser.add_argument("--scene", action="append", choices=list(scenes()), help="default: all")
    parser.add_argument("--json", action="store_true", help="print the result as JSON")
    options = parser.parse_args(argv)
    device = open_device()
    solver = Solver(max_level=options.finest)
    copy = copy_bandwidth()
    result: dict[str, Any] = {
        "machine": _serving.machine(solver.device_name),
        "copy_gb_per_s": round(copy / 1e9, 2),
        "scenes": {},
    }
    for name, (strokes, settings) in scenes().items():
        if options.scene and name not in options.scene:
            continue
        row: dict[str, Any] = {"strokes": len(strokes), "levels": {}}
        for level in range(min(PEER_LEVEL, options.finest), options.finest + 1):
            at: dict[str, Any] = {"from_rest_ms": stages(solver, strokes, settings, level)}
            at["after_edit_ms"] = after_edit(solver, strokes, settings, level)
            if device is not None:
                at |= kernels(ClWorkspace(device, level), strokes, settings, copy)
            row["levels"][str(grid.samples(level))] = at
        row["peer"] = peer(strokes, settings, solver)
        result["scenes"][name] = row
        print(f"{name} done", file=sys.stderr)
    sys.stdout.write(json.dumps(result, indent=1 if options.json else None) + "\n")
    return 0
