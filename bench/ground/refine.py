"""Refinement above the global levels (DESIGN 5.6): how close to a global solve, and what it costs.

``error``: refined heights against settled global solves of the levels above G (one step, and two in a row), in shares
of the relief; near: within NEAR_CELLS of a crest, far: elsewhere. ``cost``: per level, tiles by themselves and as a
block, from nothing and from the cache. ``view``: a viewer of 1024 x 768 near the ground of a world refined to level 6
and of one 16 times as wide, refined to level 10, with the same strokes around the viewer and cells of the same size:
time from nothing until everything that the server's selection wants is made.
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
import sys
import time
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.room import _serving
from esker import grid
from esker.contract import DEFAULT_SIZE_M, MAX_REFINED_LEVEL, Document, Stroke, TerrainSettings, View
from esker.events import Done
from esker.grid import TileKey
from esker.process.garbage import Collector
from esker.solve.constraints.crest import crest_of
from esker.solve.refine.refinement import Refiner
from esker.solve.solver import Basis, Solver
from esker.templates import gallery
from esker.tiles.delivery import ClientTiles, TileServer

SCENES = ("fifty", "alpine-ridge", "canyon")
UNSEEN = tuple(f"unseen-{seed}" for seed in (11, 12, 13, 101, 102, 103))
"""Forty random strokes from a seed, which nothing was tuned for: for ``error`` alone."""
NEAR_CELLS = 16
BAND_ROWS = 256
"""Rows of a comparison at a time: memory stays small beside the solver's."""
DEPTHS = (6, MAX_REFINED_LEVEL)
"""Finest levels of the two worlds of ``view``."""
EYE_ABOVE_M = 12.0
MAX_ROUNDS = 60


def say(text: str) -> None:
    """Progress, for people, beside the result."""
    print(time.strftime("%H:%M:%S"), text, file=sys.stderr, flush=True)


def settle(solver: Solver, strokes: Sequence[Stroke], settings: TerrainSettings, level: int) -> Basis:
    """Returns what refinement starts from."""
    *_, last = solver.steps(strokes, settings, level, basis=True)
    assert isinstance(last, Done)
    found: Basis = last.basis
    return found


def crest_distance(strokes: Sequence[Stroke], size_m: float, level: int) -> NDArray[np.float32]:
    """Per sample of a level the distance to the nearest crest line, cells, NEAR_CELLS and more as infinity."""
    n = grid.samples(level)
    out = np.full((n, n), np.inf, dtype=np.float32)
    s = grid.spacing(level, size_m)
    for stroke in strokes:
        for a, b in _crest_segments(stroke):
            _mark(out, a / s, b / s)
    return out


def _crest_segments(stroke: Stroke) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    crest = crest_of(stroke)
    if crest is None:
        return []
    plan = crest.points[:, :2]
    ring = np.vstack([plan, plan[:1]]) if crest.closed or len(plan) == 1 else plan
    return list(itertools.pairwise(ring))


def _mark(out: NDArray[np.float32], a: NDArray[np.float64], b: NDArray[np.float64]) -> None:
    """Lowers ``out`` to the distance from a segment, in cells, where it is less than NEAR_CELLS."""
    low = np.maximum(np.floor(np.minimum(a, b) - NEAR_CELLS), 0).astype(int)
    high = np.minimum(np.ceil(np.maximum(a, b) + NEAR_CELLS) + 1, len(out)).astype(int)
    if (low >= high).any():
        return
    x, y = np.arange(low[0], high[0])[None, :], np.arange(low[1], high[1])[:, None]
    d, length2 = b - a, float(((b - a) ** 2).sum())
    u = np.clip(((x - a[0]) * d[0] + (y - a[1]) * d[1]) / max(length2, 1e-12), 0, 1)
    r = np.hypot(x - a[0] - u * d[0], y - a[1] - u * d[1])
    part = out[low[1] : high[1], low[0] : high[0]]
    np.minimum(part, np.where(r <= NEAR_CELLS, r, np.inf), out=part)


def compare(refiner: Refiner, exact: NDArray[np.float32], level: int) -> dict[str, float]:
    """Largest and RMS error of a refined level, all over, near crests and far from them, in shares of the relief."""
    n, relief = grid.samples(level), float(np.ptp(exact))
    near_crest = np.isfinite(crest_distance(refiner.basis.strokes, refiner.basis.settings.size_m, level))
    most, square, count = {"near": 0.0, "far": 0.0}, {"near": 0.0, "far": 0.0}, {"near": 0, "far": 0}
    for first in range(0, n, BAND_ROWS):
        rows = slice(first, min(n, first + BAND_ROWS))
        error = np.abs(refiner.window(level, rows, slice(0, n)) - exact[rows]).astype(np.float64) / relief
        for name, mask in (("near", near_crest[rows]), ("far", ~near_crest[rows])):
            part = error[mask]
            most[name] = max(most[name], float(part.max(initial=0.0)))
            square[name] += float((part**2).sum())
            count[name] += part.size
    out = {"max": max(most.values()), "rms": math.sqrt(sum(square.values()) / n**2)}
    for name in most:
        out |= {f"max_{name}": most[name], f"rms_{name}": math.sqrt(square[name] / max(count[name], 1))}
    return {name: float(f"{value:.3g}") for name, value in out.items()}


def scene_of(name: str) -> Document:
    """A scene of the gallery, or one of UNSEEN."""
    if not name.startswith("unseen-"):
        return gallery.load(name)
    strokes = gallery.random_strokes(40, int(name.rsplit("-", 1)[1]), (400.0, 1600.0), (80.0, 360.0))
    return Document(id=name, strokes=tuple(strokes))


def errors(solver: Solver, scene: str, low: int, steps: int) -> dict[str, Any]:
    """``compare`` for the levels above ``low``."""
    document = scene_of(scene)
    refiner = solver.refiner(settle(solver, document.strokes, document.settings, low))
    out: dict[str, Any] = {"relief_m": round(float(np.ptp(refiner.basis.heights)), 1)}
    for level in range(low + 1, low + steps + 1):
        exact = solver.solve(document.strokes, document.settings, level)[level]
        out[f"{grid.samples(low)} to {grid.samples(level)}"] = compare(refiner, exact, level)
        say(f"{scene}: level {level} from {low}: {out[f'{grid.samples(low)} to {grid.samples(level)}']}")
    return out


def made(refiner: Refiner, keys: Sequence[TileKey]) -> tuple[float, float]:
    """Makes tiles; (milliseconds in all, longest time between two yields)."""
    start = last = time.perf_counter()
    longest = 0.0
    for _ in refiner.tiles(keys):
        now = time.perf_counter()
        longest, last = max(longest, now - last), now
    return 1e3 * (time.perf_counter() - start), 1e3 * longest


def costs(solver: Solver, scene: str, low: int, high: int, runs: int) -> dict[str, Any]:
    """Milliseconds per level: a lone tile with all above it, nothing kept; a block of 16 whose parents are kept, with
    the constraints that they share; one of its tiles again, constraints kept."""
    document = gallery.load(scene)
    basis = settle(solver, document.strokes, document.settings, low)
    out: dict[str, Any] = {}
    for level in range(low + 1, high + 1):
        x, y = (4 * int(0.55 * (1 << level) / 4), 4 * int(0.45 * (1 << level) / 4))
        block = [TileKey(level, x + i, y + j) for j in range(4) for i in range(4)]
        cold, warm, sixteen, cached, longest = [], [], [], [], []
        for _ in range(runs):
            refiner = solver.refiner(basis)
            refiner.clear()
            cold.append(made(refiner, block[:1])[0])
            refiner.clear()
            if level > low + 1:
                made(refiner, sorted({key.parent() for key in _around(block)}))
            everything, pause = made(refiner, block)
            sixteen.append(everything)
            longest.append(pause)
            cached.append(made(refiner, block)[0])
            refiner.forget(block[:1])
            warm.append(made(refiner, block[:1])[0])
        out[str(grid.samples(level))] = {
            "lone_tile_cold_ms": round(min(cold), 2),
            "tile_again_ms": round(min(warm), 2),
            "block_of_16_parents_known_ms": round(min(sixteen), 2),
            "tiles_per_s": round(16e3 / min(sixteen)),
            "tile_cached_ms": round(min(cached) / 16, 4),
            "longest_step_ms": round(min(longest), 2),
        }
        say(f"{scene}: cost at level {level}: {out[str(grid.samples(level))]}")
    return out


def _around(block: Sequence[TileKey]) -> set[TileKey]:
    """A block and the ring of tiles around it, as far as the level goes."""
    side = 1 << block[0].level
    near = {TileKey(k.level, k.x + i, k.y + j) for k in block for j in (-2, 0, 2) for i in (-2, 0, 2)}
    return {k for k in near if 0 <= k.x < side and 0 <= k.y < side}


def world(scene: str, depth: int, least: int) -> tuple[Sequence[Stroke], TerrainSettings]:
    """The strokes of a scene in the middle of a world whose cells at level ``depth`` are as wide as the scene's own at
    level ``least``."""
    document = gallery.load(scene)
    scale = float(1 << (depth - least))
    shift = DEFAULT_SIZE_M * (scale - 1) / 2
    settings = document.settings.model_copy(update={"size_m": document.settings.size_m * scale})

    def moved(stroke: Stroke) -> Stroke:
        places = {
            name: (point[0] + shift, point[1] + shift, point[2])
            for name, point in (("first", stroke.first), ("last", stroke.last))
        }
        return stroke.model_copy(update=places)

    return [moved(s) for s in document.strokes], settings


def viewer(size_m: float, ground: NDArray[np.float32]) -> View:
    """Eyes near the ground in the middle of the world, looking north-east."""
    middle = size_m / 2
    height = float(ground[len(ground) // 2, len(ground) // 2]) + EYE_ABOVE_M
    return View(eye=(middle, middle, height), target=(middle + 400, middle + 300, height - 20), width=1024, height=768)


def settle_view(scene: str, depth: int, low: int, least: int) -> dict[str, Any]:
    """Milliseconds from nothing until a view is complete, and how many tiles of which level it took."""
    strokes, settings = world(scene, depth, least)
    solver = Solver()  # knows nothing of the scene
    start, start_cpu = time.perf_counter(), time.process_time()
    basis = settle(solver, strokes, settings, low)
    settled = time.perf_counter()
    server = TileServer(settings.size_m, low, depth)
    for level in range(low + 1):
        step = 1 << (low - level)
        server.put_level(1, level, np.ascontiguousarray(basis.heights[::step, ::step]), settled=True)
    client = ClientTiles(server)
    client.set_view(viewer(settings.size_m, basis.heights))
    refiner, tiles, selecting = solver.refiner(basis), 0, 0.0
    by_level: dict[int, int] = {}
    refining = 0.0
    for _ in range(MAX_ROUNDS):
        now = time.perf_counter()
        keys = server.requests([client])[0]
        selecting += time.perf_counter() - now
        if not keys:
            break
        for tile in refiner.tiles(keys):
            if tile is not None:
                refining += time.perf_counter() - now
                server.put_tile(1, tile)
                tiles += 1
                by_level[tile.key.level] = by_level.get(tile.key.level, 0) + 1
                now = time.perf_counter()
    total, cpu = 1e3 * (time.perf_counter() - start), 1e3 * (time.process_time() - start_cpu)
    return {
        "total_ms": round(total, 1),
        "cpu_ms": round(cpu, 1),
        "global_levels_ms": round(1e3 * (settled - start), 1),
        "refining_ms": round(1e3 * refining, 1),
        "selecting_ms": round(1e3 * selecting, 1),
        "tiles": tiles,
        "tiles_by_level": {str(level): by_level[level] for level in sorted(by_level)},
    }


def whole(scene: str, level: int) -> float:
    """Milliseconds from nothing until a level is settled that is solved as a whole: the smaller world's alternative."""
    document, solver = gallery.load(scene), Solver()
    start = time.perf_counter()
    settle(solver, document.strokes, document.settings, level)
    return round(1e3 * (time.perf_counter() - start), 1)


def views(scene: str, low: int, runs: int) -> dict[str, Any]:
    """``settle_view`` of both worlds, the quickest run of each, and their ratio."""
    out: dict[str, Any] = {}
    found: dict[int, list[dict[str, Any]]] = {depth: [] for depth in DEPTHS}
    for _ in range(runs):
        for depth in DEPTHS:
            found[depth].append(settle_view(scene, depth, low, DEPTHS[0]))
    for depth in DEPTHS:
        ordered = sorted(found[depth], key=lambda row: row["total_ms"])
        out[str(grid.samples(depth))] = ordered[0]
    out["whole_ms"] = whole(scene, DEPTHS[0])
    for name, of in (("ratio", "total_ms"), ("cpu_ratio", "cpu_ms")):
        small, large = (out[str(grid.samples(depth))][of] for depth in DEPTHS)
        out[name] = round(large / small, 2)
    say(f"{scene}: {out}")
    return out


def as_a_server() -> None:
    """Sets the collector as a server does (``run.Assembly.run``): it never looks at what is there now. Else it stops
    one view in four for 100 ms, and now and then a step."""
    Collector().begin()


def run(solver: Solver, quick: bool) -> dict[str, Any]:
    """All three parts."""
    low, steps, high = (2, 1, 4) if quick else (4, 2, MAX_REFINED_LEVEL)
    scenes = SCENES[:1] if quick else SCENES
    runs = 1 if quick else 5
    error = {scene: errors(solver, scene, low, steps) for scene in (*scenes, *(UNSEEN[:1] if quick else UNSEEN))}
    as_a_server()
    return {
        "global_level": low,
        "error": error,
        "cost": {scene: costs(solver, scene, low, high, runs) for scene in scenes},
        "view": {scene: views(scene, low, runs) for scene in scenes},
    }


def main(argv: list[str]) -> int:
    """``esker bench refine [--json] [--quick]``."""
    parser = argparse.ArgumentParser(prog="esker bench refine", description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("--json", action="store_true", help="print the result as JSON")
    parser.add_argument("--quick", action="store_true", help="coarse levels, one scene, one run: does it work?")
    options = parser.parse_args(argv)
    solver = Solver()
    result = {"machine": _serving.machine(solver.device_name)} | run(solver, options.quick)
    sys.stdout.write(json.dumps(result, indent=1 if options.json else None) + "\n")
    return 0
