"""The solver alone: accuracy on the gallery, times against the machine's own limits, and peers on the same systems.

``accuracy``: convergence factors, previews, rest and the float32 floor of every scene of the gallery, per grid size.
``threads``: set-up, previews, settling, cycles and kernels with one thread and with two, bytes by model, and a copy's
bandwidth and the peak of multiply-adds in the same process. ``peers``: PyAMG and sparse direct solvers on the height
system of one scene, to the same largest errors. Every part runs in a process of its own. DESIGN 15; docs/solver.md.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from bench.room import _serving
from bench.solver import _accuracy, _exact, _kernels, _peers
from esker import grid
from esker.contract import MAX_LEVEL
from esker.solve.opencl.device import open_device
from esker.templates import gallery

PARTS = ("accuracy", "threads", "peers")
TIMED = ("fifty", "alpine-ridge")
"""Scenes that are timed; the first is the peers'."""
ACCURACY_FROM, TIMES_FROM = 2, 3
QUICK_ACCURACY, QUICK_TIMES, QUICK_PEERS = 3, 4, 3
"""Finest levels of a quick run."""
MAPS = "bench/results/solve-maps.npz"


def say(text: str) -> None:
    """Progress, for people, beside the result."""
    print(time.strftime("%H:%M:%S"), text, file=sys.stderr, flush=True)


def apart(work: Callable[..., Any], *args: Any) -> Any:
    """``work(*args)`` in a process of its own: memory goes back, and an OpenCL runtime takes its threads anew."""
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        return pool.submit(work, *args).result()


def accuracy(names: tuple[str, ...], level: int, wanted: str | None) -> tuple[dict[str, Any], dict[str, Any]]:
    """See ``_accuracy.run``."""
    return _accuracy.run(names, range(level, level + 1), say, wanted)


def times(threads: int, finest: int, wanted: str | None) -> dict[str, Any]:
    """See ``_kernels.run``."""
    return _kernels.run(threads, range(min(TIMES_FROM, finest), finest + 1), TIMED, say, wanted)


def thread_counts(wanted: str | None) -> tuple[int, ...]:
    """Numbers of threads that are measured: a device with kernels for GPUs has threads of its own."""
    device = open_device(wanted)
    return (1, 2) if device is None or device.plan is None else (1,)


def problem(level: int, scene: str, ours: dict[str, Any], file: Path, wanted: str | None) -> int:
    """Writes the height system of a scene for the peers; returns the number of unknowns. ``ours``: errors in metres."""
    device = open_device(wanted)
    if device is None:
        raise RuntimeError("No OpenCL device.")
    document = gallery.load(scene)
    w = _exact.workspace(device, level)
    c = _exact.load(w, document.strokes, document.settings)
    exact = _exact.exact(w, c)
    targets = {"preview": _kernels.TARGET * exact.relief, "rest": ours["heights_to_rest"]["error_m"]}
    _peers.save(file, c.height_d, exact.f, c.screening, exact.heights, targets)
    return int(np.sum(c.height_d >= 0))


def against(figures: dict[str, Any], ours: dict[str, Any]) -> dict[str, float]:
    """Returns how many times a peer's set-up and solve take as long as ours (coarsening, full multigrid, cycles)."""
    out = {}
    for target, row in figures.get("solve", {}).items():
        mine = ours["heights_to_target" if target == "preview" else "heights_to_rest"]["ms"]["least"]
        mine += ours["coarsen_heights_ms"]["least"]
        out[target] = _accuracy.significant((figures["set_up_ms"] + row["ms"]) / mine)
    return out


def peers(finest: int, threads: dict[str, Any], options: argparse.Namespace) -> dict[str, Any]:
    """The peers on all sizes, each beside our own figures of this run with every number of threads."""
    wanted = options.device
    scene = TIMED[0]
    levels: dict[str, Any] = {}
    for level in range(min(TIMES_FROM, finest), finest + 1):
        size = str(grid.samples(level))
        if any(size not in rows["scenes"][scene] for rows in threads.values()):
            say(f"peers {size}²: left out, as our own times at this size are not in the result")
            continue
        ours = {count: rows["scenes"][scene][size] for count, rows in threads.items()}
        row: dict[str, Any] = {}
        with tempfile.TemporaryDirectory(prefix="esker-bench-") as folder:
            file = Path(folder) / "problem.npz"
            row["unknowns"] = apart(problem, level, scene, ours["1"], file, wanted)
            for name in options.peer or _peers.NAMES:
                say(f"peers {size}²: {name} ...")
                figures = _peers.run(name, file, options.peer_gib, options.peer_seconds)
                figures["times_ours"] = {count: against(figures, mine) for count, mine in ours.items()}
                row[name] = figures
                say(f"peers {size}²: {name}: {figures.get('failed', figures['times_ours'])}")
        levels[size] = row
    return {"scene": scene, "levels": levels}


def main(argv: list[str]) -> int:
    """``esker bench solve [--json] [--device NAME] [--quick] [--part NAME ...] [--finest N] [-o FILE] ...``."""
    options = _parser().parse_args(argv)
    parts = options.part or PARTS
    kept = options.output is not None and options.output.exists()
    result: dict[str, Any] = json.loads(options.output.read_text(encoding="utf-8")) if kept else {"runs": {}}

    def upto(quick: int) -> int:
        return int(min(quick, options.finest) if options.quick else options.finest)

    def put(part: str, figures: Any, started: dict[str, Any]) -> None:
        """Into the result, and to the file at once: a part takes many minutes."""
        result[part] = figures
        result["runs"][part] = started
        if options.output:
            options.output.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")

    def started() -> dict[str, Any]:
        return _serving.machine() | {"started": time.strftime("%Y-%m-%d %H:%M"), "quick": options.quick}

    if "accuracy" in parts:
        now, finest = started(), upto(QUICK_ACCURACY)
        rows: dict[str, Any] = result.get("accuracy", {})
        for level in range(min(ACCURACY_FROM, finest), finest + 1):
            figures, maps = apart(accuracy, tuple(options.scene or gallery.NAMES), level, options.device)
            for name, sizes in figures.items():
                rows.setdefault(name, {}).update(sizes)
            put("accuracy", rows, now)
            if maps and options.maps:
                # Errors need a digit, heights need not show steps.
                halves = {k: v if k.endswith("heights") else v.astype(np.float16) for k, v in maps.items()}
                np.savez_compressed(options.maps, **halves)
    if "threads" in parts or ("peers" in parts and "threads" not in result):
        now = started()
        counts = apart(thread_counts, options.device)
        put("threads", {str(count): apart(times, count, upto(QUICK_TIMES), options.device) for count in counts}, now)
    if "peers" in parts:
        now = started()
        put("peers", peers(upto(QUICK_PEERS), result["threads"], options), now)
    if not options.output:
        sys.stdout.write(json.dumps(result, indent=1 if options.json else None) + "\n")
    return 0


def _parser() -> argparse.ArgumentParser:
    p = argparse.ArgumentParser(prog="esker bench solve", description=(__doc__ or "").split("\n", 1)[0])
    p.add_argument("--json", action="store_true", help="print the result as indented JSON")
    keep = "write the result here instead, as it comes; parts and sizes that are not run are kept from the file"
    p.add_argument("-o", "--output", type=Path, metavar="FILE.json", help=keep)
    p.add_argument("--device", metavar="NAME", help="part of the name of the OpenCL device (default: the best)")
    p.add_argument("--quick", action="store_true", help="small grids only: about a minute")
    p.add_argument("--part", action="append", choices=PARTS, help="default: all; peers need threads")
    levels = f"finest level, 1..{MAX_LEVEL} (default {MAX_LEVEL})"
    p.add_argument("--finest", type=int, choices=range(1, MAX_LEVEL + 1), default=MAX_LEVEL, metavar="N", help=levels)
    p.add_argument("--scene", action="append", choices=gallery.NAMES, metavar="NAME", help="accuracy of these alone")
    p.add_argument("--maps", type=Path, metavar="FILE.npz", help=f"write error maps (committed: {MAPS})")
    p.add_argument("--peer", action="append", choices=_peers.NAMES, help="these alone (default: all)")
    p.add_argument("--peer-gib", type=float, default=14.0, metavar="GIB", help="memory limit of a peer (default 14)")
    p.add_argument("--peer-seconds", type=float, default=600.0, metavar="S", help="its time limit (default 600)")
    return p
