"""Running water: time at four sizes beside other programs, agreement of areas, rivers from level to level, bytes.

Peers let water take every diagonal; Esker takes those that cross a drawn edge only where that goes down, so a few areas
differ for this, and others for ties and ways over level ground, of which every program has its own.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable
from functools import partial
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from bench.ground import _flow_peers
from esker import Terrain, grid, templates
from esker.flow.reaches import UNITS_PER_CELL, find_reaches
from esker.flow.rivers import water_of
from esker.flow.warming import warm
from esker.flow.water import Water, find_water, quanta
from esker.server.hydrology import Snapshot, frame_of

SCENES: Final = ("alpine-ridge", "volcanic-island", "canyon", "figure-six", "archipelago")
LEVELS: Final = (2, 3, 4, 6)
ROUNDS: Final = {2: 40, 3: 20, 4: 10, 6: 2}
SLOWEST_LEVEL: Final = 4
"""Above it pyflwdir takes minutes."""


def least_ms(work: Callable[[], Any], rounds: int) -> tuple[float, Any]:
    """The least milliseconds of some runs, and what came of the last."""
    best, found = float("inf"), None
    for _ in range(rounds):
        start = time.perf_counter()
        found = work()
        best = min(best, 1e3 * (time.perf_counter() - start))
    return best, found


def sizes(ground: NDArray[np.float32], size_m: float, levels: list[int]) -> list[dict[str, Any]]:
    """Times of each level, Esker's and the peers' in turn, and how many samples have the same area."""
    rows = []
    top = ((len(ground) - 1) // 64).bit_length() - 1
    for level in levels:
        step = 1 << (top - level)
        z = quanta(ground[::step, ::step], grid.spacing(level, size_m))
        heights = z.astype(np.float64)
        ours, water = least_ms(partial(find_water, z), ROUNDS[level])
        row: dict[str, Any] = {"samples": len(z), "esker_ms": round(ours, 2), "basins": int(water.basin.max())}
        for name, run in _flow_peers.installed().items():
            if name == "pyflwdir" and level > SLOWEST_LEVEL:
                continue
            run(heights[:65, :65].copy())
            took, area = least_ms(partial(run, heights), max(1, ROUNDS[level] // 8))
            same = np.abs(area.reshape(z.shape) - water.area)[1:-1, 1:-1] < 0.5
            row[name] = {
                "ms": round(took, 1),
                "times": round(took / ours, 1),
                "same_area": round(float(same.mean()), 4),
            }
        rows.append(row)
    return rows


def points(water: Water, cell_m: float, many: float = 1.0) -> NDArray[np.float64]:
    """Points of all rivers, a cell apart at most, metres."""
    reaches = find_reaches(water, many)
    out = [np.zeros((0, 2))]
    for k in range(len(reaches)):
        line = reaches.points[reaches.start[k] : reaches.start[k + 1]] * (cell_m / UNITS_PER_CELL)
        along = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))))
        at = np.linspace(0, along[-1], max(2, int(along[-1] / cell_m) + 1))
        out.append(np.stack([np.interp(at, along, line[:, axis]) for axis in (0, 1)], axis=1))
    return np.concatenate(out)


def under_water(water: Water, at: NDArray[np.float64], cell_m: float) -> NDArray[np.bool_]:
    """Whether points lie under standing water: ways through lakes are drawn nowhere, so they may differ."""
    col, row = (np.clip(np.rint(at[:, axis] / cell_m).astype(int), 0, len(water.z) - 1) for axis in (0, 1))
    return np.asarray(water.filled[row, col] > water.z[row, col])


def levels_agree(terrain: Terrain) -> dict[str, Any]:
    """Rivers of level 2 against those of level 4, both with their detail; bytes of a frame of each."""
    settings = terrain.settings.model_copy(update={"rivers": 1.0})
    waters = {level: water_of(terrain.heights(level, True), settings.size_m, settings.sea_level_m) for level in (2, 4)}
    coarse, fine = (points(water, grid.spacing(level, settings.size_m)) for level, water in waters.items())
    cell = grid.spacing(2, settings.size_m)
    dry = ~under_water(waters[2], coarse, cell)
    out: dict[str, Any] = {"points": len(coarse)}
    if len(coarse) and len(fine):
        moved, new = (np.asarray(cKDTree(a).query(b)[0]) for a, b in ((fine, coarse), (coarse, fine)))
        out |= {
            "moved_median_cells": round(float(np.median(moved)) / cell, 3),
            "moved_p90_cells": round(float(np.percentile(moved, 90)) / cell, 3),
            "missing": round(float(np.mean(moved > 2 * cell)), 4),
            "new": round(float(np.mean(new > 2 * cell)), 4),
            "on_land": {
                "points": int(dry.sum()),
                "moved_median_cells": round(float(np.median(moved[dry])) / cell, 3),
                "missing": round(float(np.mean(moved[dry] > 2 * cell)), 4),
            },
        }
    for level in (2, 4):
        ground = Snapshot(0, level, terrain.heights(level))
        took, frame = least_ms(partial(frame_of, ground, settings, None, True), 1)
        out[f"level_{level}"] = {"bytes": len(frame), "with_detail_ms": round(took)}
    return out


def main(argv: list[str] | None = None) -> int:
    """Runs the benchmark; returns the exit status."""
    parser = argparse.ArgumentParser(prog="esker bench flow", description=__doc__)
    parser.add_argument("--json", action="store_true", help="print the result as JSON")
    parser.add_argument("--levels", type=int, nargs="+", choices=LEVELS, default=list(LEVELS), help="sizes to measure")
    parser.add_argument("--scenes", nargs="*", choices=SCENES, default=list(SCENES), help="for rivers across levels")
    options = parser.parse_args(argv)
    if missing := _flow_peers.PEERS.keys() - _flow_peers.installed().keys():
        print(f"Not installed: {', '.join(sorted(missing))}. {_flow_peers.INSTALL}", file=sys.stderr)
    warm()
    terrain = Terrain.from_document(templates.load(SCENES[0]).document)
    ground = terrain.heights(max(options.levels))
    result = {
        "scene": SCENES[0],
        "sizes": sizes(ground, terrain.settings.size_m, options.levels),
        "rivers_of_level_2_against_4": {
            name: levels_agree(Terrain.from_document(templates.load(name).document)) for name in options.scenes
        },
    }
    print(json.dumps(result, indent=1) if options.json else result)
    return 0


if __name__ == "__main__":
    sys.exit(main())
