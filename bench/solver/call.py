"""``Terrain.heights`` after one added stroke, the whole call, in turns with PyAMG on the system of the same document.

PyAMG (Ruge-Stüben, accelerated by conjugate gradients) solves the height step alone, from its finished matrix: set-up
and solve, to 10^-3 of the relief and to Esker's own error at rest. Esker's time is that of the call: the stroke's
tables and raster, both steps, and reading. ``phases_ms`` says where it goes, ``floor`` how much of the arithmetic of a
fresh solve could be left out without another bit: what is read by the finest visits changes nearly everywhere.
"""

from __future__ import annotations

import argparse
import json
import statistics
import sys
import tempfile
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final

from bench.room import _serving
from bench.solver import _exact, _kernels, _peers
from bench.solver._accuracy import significant
from esker import Terrain, contract, grid
from esker.contract import Stroke
from esker.solve import multigrid, passes
from esker.solve.constraints.computable import computable
from esker.solve.passes import Job, Workspace
from esker.solve.solver import Solver
from esker.templates import gallery

PEER: Final = "pyamg_ruge_stuben"
EDITS: Final = 8
ROUNDS: Final = 3
MOVED_M: Final = 200.0


def edits(strokes: tuple[Stroke, ...], size_m: float, count: int) -> list[Stroke]:
    """Strokes to add: some of the scene's own, a little aside."""
    out = []
    for k in range(count):
        old = strokes[k * len(strokes) // count]
        shift = (MOVED_M * (1 if old.first[0] < size_m / 2 else -1), MOVED_M / 2, 0.0)
        first, last = ((x + shift[0], y + shift[1], z) for x, y, z in (old.first, old.last))
        out.append(old.model_copy(update={"id": f"new-{k}", "first": first, "last": last}))
    return out


def calls(solver: Solver, document: contract.Document, level: int, added: list[Stroke]) -> list[float]:
    """Milliseconds of ``heights`` after each stroke more."""
    terrain, out = Terrain.from_document(document, solver=solver), []
    terrain.heights(level)
    for stroke in added:
        terrain.add(stroke)
        start = time.perf_counter()
        terrain.heights(level)
        out.append(1e3 * (time.perf_counter() - start))
    return out


def phases(solver: Solver, document: contract.Document, level: int, added: list[Stroke]) -> dict[str, Any]:
    """Least milliseconds of the parts of a call, the device waited for between them, and cycles of either step."""
    settings, device = computable(document.settings), solver.device
    assert device is not None
    rows: list[dict[str, float]] = []
    for k in range(len(added)):
        job = Job((*document.strokes, *added[: k + 1]), settings, None)
        w = solver._pool.take(job, level, device)
        row: dict[str, float] = {}

        def timed(name: str, work: Iterable[object], row: dict[str, float] = row) -> int:
            start = time.perf_counter()
            count = sum(1 for _ in work)
            device.queue.finish()
            row[name] = 1e3 * (time.perf_counter() - start)
            return count

        timed("strokes_and_raster", w.loading(*job))
        timed("full_multigrid", passes.full_multigrid(w, passes.preview_gradient_cycles(settings)))
        rest = list(_rest(w, job))
        row["gradient_cycles"], row["height_cycles"] = (timed(name, work) + 1 for name, work in rest)
        timed("reading", [passes.finest(w)])
        solver._pool.give(w)
        rows.append(row)
    return {name: round(min(row[name] for row in rows), 2) for name in rows[0]}


def _rest(w: Workspace, job: Job) -> Iterable[tuple[str, Iterable[None]]]:
    """The two halves of ``passes.to_rest``, each when it is asked for."""
    size = job.settings.size_m
    quantum, span = grid.quantum(w.top, size), min(job.settings.reach_m or size / 4, size / 4)
    yield "gradient_to_rest", multigrid.converge(w.gradient, passes.GRADIENT_SHARE * quantum / span)

    def heights() -> Iterable[None]:
        w.guide(w.top)
        multigrid.refresh(w.height)
        yield from multigrid.converge(w.height, passes.HEIGHT_SHARE * quantum)

    yield "heights_to_rest", heights()


def changed(solver: Solver, document: contract.Document, level: int, added: list[Stroke]) -> dict[str, float]:
    """Shares of samples whose bits are others after one stroke more, the mean of several: of the heights, and of what
    the last visit of the finest level reads as its correction."""

    def fields(strokes: tuple[Stroke, ...]) -> dict[str, Any]:
        heights = solver.heights(strokes, document.settings, level)
        w = solver._pool.idle[-1]
        assert isinstance(w, _exact.DeviceWorkspace)
        corrections = {
            f"{name}_correction": s.get("e", level - 1) for name, s in (("gradient", w.gradient), ("height", w.height))
        }
        return {"heights": heights, **corrections}

    before, found = fields(document.strokes), []
    for stroke in added:
        after = fields((*document.strokes, stroke))
        found.append({name: float((before[name].view("u4") != after[name].view("u4")).mean()) for name in before})
    return {name: round(statistics.mean(row[name] for row in found), 3) for name in before}


def floor(row: dict[str, Any], level: int) -> dict[str, float]:
    """What the cycles of a call move and compute by model (docs/solver.md), full multigrid left out."""
    moved = flops = 0.0
    for channels, cycles in ((2, row["gradient_cycles"] + 1), (1, row["height_cycles"] + passes.PREVIEW_HEIGHT_CYCLES)):
        model = _kernels.Recorder(level, channels)
        multigrid.cycle(model)
        moved, flops = moved + cycles * model.moved, flops + cycles * model.flops
    return {"model_mb": round(moved / 1e6, 1), "gflop": round(flops / 1e9, 3)}


def peer(device: Any, document: contract.Document, level: int, gib: float, seconds: float) -> dict[str, Any]:
    """PyAMG on the height step of a document."""
    w = _exact.workspace(device, level)
    constraints = _exact.load(w, document.strokes, document.settings)
    exact = _exact.exact(w, constraints)
    targets = {"preview": _kernels.TARGET * exact.relief, "rest": grid.quantum(level, document.settings.size_m) / 4}
    with tempfile.TemporaryDirectory(prefix="esker-bench-") as folder:
        file = Path(folder) / "problem.npz"
        _peers.save(file, constraints.height_d, exact.f, constraints.screening, exact.heights, targets)
        return _peers.run(PEER, file, gib, seconds)


def measure(solver: Solver, scene: str, level: int, rounds: int, gib: float, seconds: float) -> dict[str, Any]:
    """All figures of a scene: calls and the peer in turns."""
    document = gallery.load(scene)
    added = edits(document.strokes, document.settings.size_m, EDITS)
    ours: list[float] = []
    theirs: dict[str, list[float]] = {"preview": [], "rest": []}
    for _ in range(rounds):
        ours += calls(solver, document, level, added)
        figures = peer(solver.device, document, level, gib, seconds)
        for target, times in theirs.items():
            if target in figures.get("solve", {}):
                times.append(figures["set_up_ms"] + figures["solve"][target]["ms"])
    ours += calls(solver, document, level, added)
    row = phases(solver, document, level, added)
    least = min(ours)
    out: dict[str, Any] = {
        "strokes": len(document.strokes),
        "call_ms": {"least": round(least, 1), "median": round(statistics.median(ours), 1)},
        "phases_ms": row,
        "floor": floor(row, level) | {"bits_changed": changed(solver, document, level, added[:4])},
        "pyamg_ms": {target: round(min(times), 1) for target, times in theirs.items() if times},
    }
    out["times_ours"] = {target: significant(ms / least) for target, ms in out["pyamg_ms"].items()}
    return out


def main(argv: list[str]) -> int:
    """Run the command; prints JSON."""
    p = argparse.ArgumentParser(prog="esker bench call", description=(__doc__ or "").split("\n", 1)[0])
    p.add_argument("--json", action="store_true", help="print the result as indented JSON")
    p.add_argument("--device", metavar="NAME", help="part of the name of the OpenCL device (default: the best)")
    p.add_argument("--level", type=int, choices=range(1, contract.MAX_LEVEL + 1), default=contract.DEFAULT_LEVEL)
    p.add_argument("--scene", action="append", choices=gallery.NAMES, metavar="NAME", help="default: fifty")
    p.add_argument("--rounds", type=int, default=ROUNDS, metavar="N", help=f"turns (default {ROUNDS})")
    p.add_argument("--peer-gib", type=float, default=14.0, metavar="GIB", help="memory limit of PyAMG (default 14)")
    p.add_argument("--peer-seconds", type=float, default=600.0, metavar="S", help="its time limit (default 600)")
    options = p.parse_args(argv)
    machine = _serving.machine() | {"started": time.strftime("%Y-%m-%d %H:%M")}
    solver = Solver(options.device, max_level=options.level)
    if solver.device is None:
        raise SystemExit("No OpenCL device: NumPy is not worth timing.")
    rows = {
        name: measure(solver, name, options.level, options.rounds, options.peer_gib, options.peer_seconds)
        for name in options.scene or ["fifty"]
    }
    result = {"machine": machine | {"device": solver.device_name}, "level": options.level, "scenes": rows}
    sys.stdout.write(json.dumps(result, indent=1 if options.json else None) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
