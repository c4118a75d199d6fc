"""Refined tiles on their way to clients (DESIGN 5.6, 7): how many a view takes, their bytes, what selection costs.

A viewer stands near the ground of a starting terrain, looking along its highest crest, with levels 0 to 4 solved as a
whole. All is measured in this process: the real solver, refiner and tiles; no socket. Bytes do not depend on the
machine; times are the smallest and the median of repeated runs.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable
from typing import Any, Final

import numpy as np

from bench.room import _serving
from esker import contract as c
from esker import templates
from esker.events import Done, Level
from esker.solve.solver import Basis, Solver
from esker.tiles.delivery import ClientTiles, TileServer
from esker.tiles.plans import EncodedTiles, FramePlan
from esker.tiles.quadtree import select
from esker.tiles.sparse import select_refined
from esker.version import VERSION

LEVEL: Final = c.DEFAULT_LEVEL
VIEWERS: Final = 60
REPEATS: Final = 60


def crest_view(basis: Basis, away: float = 60.0, above: float = 18.0) -> c.View:
    """A camera beside the highest place, a little above it, looking past it."""
    step = basis.settings.size_m / (basis.heights.shape[0] - 1)
    row, col = (int(i) for i in np.unravel_index(int(basis.heights.argmax()), basis.heights.shape))
    x, y, z = col * step, row * step, float(basis.heights[row, col])
    return c.View(eye=(x - away / 2, y - away, z + above), target=(x, y, z - 10), width=1024, height=768)


def solve(server: TileServer, solver: Solver, document: c.Document, clock: int) -> Basis:
    """Puts every level of a solve; returns what refinement starts from."""
    basis: Basis | None = None
    for result in solver.steps(document.strokes, document.settings, LEVEL, basis=True):
        if isinstance(result, Level):
            server.put_level(clock, result.level, result.heights, result.settled, result.channel)
        elif isinstance(result, Done):
            basis = result.basis
    assert basis is not None
    return basis


def settle(server: TileServer, solver: Solver, basis: Basis, clock: int, client: ClientTiles) -> list[FramePlan]:
    """Refines and sends until nothing is wanted; returns the frames above the global levels."""
    refiner, frames = solver.refiner(basis), []
    while True:
        while (plan := client.plan()) is not None:
            client.commit(plan)
            if plan.level > LEVEL:
                frames.append(plan)
        requests, _ = server.requests([client])
        if not requests:
            return frames
        for tile in refiner.tiles(requests):
            if tile is not None:
                server.put_tile(clock, tile)


def total(frames: list[FramePlan], *, filters: bool = True) -> dict[str, Any]:
    """Tiles and bytes of frames; without filters: coded afresh as the other levels are."""
    size = 0
    for plan in frames:
        coded = FramePlan(**vars(plan) | {"cache": EncodedTiles(), "smooth": filters})
        size += len(coded.encode())
    tiles = sum(len(plan.keys) for plan in frames)
    return {"tiles": tiles, "bytes": size, "bytes_per_tile": round(size / max(1, tiles))}


def timed(work: Callable[[], object], repeats: int) -> dict[str, float]:
    """Milliseconds of one call."""
    took = []
    for _ in range(repeats):
        began = time.perf_counter()
        work()
        took.append(1000 * (time.perf_counter() - began))
    return {"min_ms": round(min(took), 3), "p50_ms": round(float(np.median(took)), 3)}


def measure(solver: Solver, document: c.Document, finest: int, repeats: int = REPEATS) -> dict[str, Any]:
    """One terrain: the first view, the view after an edit, and the times."""
    size = document.settings.size_m
    server = TileServer(size, LEVEL, finest)
    basis = solve(server, solver, document, 1)
    view, client = crest_view(basis), ClientTiles(server, rest_level=-1)
    client.set_view(view)
    first = settle(server, solver, basis, 1, client)
    held = client.held_refined()
    out: dict[str, Any] = {
        "strokes": len(document.strokes),
        "held_by_level": {level: sum(k.level == level for k in held) for level in range(LEVEL + 1, finest + 1)},
        "first_view": total(first) | {"bytes_without_filters": total(first, filters=False)["bytes"]},
    }
    masks, _ = select(server.pyramid.bounds(), view)
    out["select_global"] = timed(lambda: select(server.pyramid.bounds(), view), repeats)
    out["select_refined"] = timed(lambda: select_refined(server.pyramid, server.refined, masks[-1], view), repeats)
    crowd = [ClientTiles(server) for _ in range(VIEWERS)]
    for i, other in enumerate(crowd):
        x, y, z = view.eye
        other.set_view(view.model_copy(update={"eye": (x + i, y - i, z)}))

    def request() -> None:
        server.refined.generation += 1
        server.requests(crowd)

    out[f"requests_of_{VIEWERS}"] = timed(request, max(1, repeats // 10))
    nearest = min(document.strokes, key=lambda s: abs(s.first[0] - view.eye[0]) + abs(s.first[1] - view.eye[1]))
    moved = nearest.model_copy(update={"plateau_radius_m": nearest.plateau_radius_m + 4})
    strokes = tuple(moved if s.id == moved.id else s for s in document.strokes)
    basis = solve(server, solver, document.model_copy(update={"strokes": strokes}), 2)
    out["after_an_edit"] = total(settle(server, solver, basis, 2, client))
    return out


def main(argv: list[str]) -> int:
    """``esker bench sparse [--json] [--finest LEVEL] [--scene NAME ...]``."""
    parser = argparse.ArgumentParser(prog="esker bench sparse", description=__doc__)
    parser.add_argument("--scene", action="append", choices=list(templates.ORDER), help="default: alpine-ridge, canyon")
    parser.add_argument("--finest", type=int, default=c.DEFAULT_REFINED_LEVEL)
    parser.add_argument("--json", action="store_true", help="print the result as JSON")
    arguments = parser.parse_args(argv)
    solver = Solver(max_level=LEVEL)
    scenes = {
        name: measure(solver, templates.load(name).document, arguments.finest)
        for name in arguments.scene or ("alpine-ridge", "canyon")
    }
    result = {
        "bench": "sparse",
        "version": VERSION,
        "machine": _serving.machine(solver.device_name),
        "levels": [LEVEL, arguments.finest],
        "scenes": scenes,
    }
    if arguments.json:
        sys.stdout.write(json.dumps(result, indent=1) + "\n")
    else:
        for name, scene in scenes.items():
            for key, value in scene.items():
                sys.stdout.write(f"{name}.{key}: {value}\n")
    return 0
