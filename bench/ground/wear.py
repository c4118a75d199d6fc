"""What gullies do: crests, levels against each other, the statistics of running water beside real ground, cost a tile.

``esker bench wear --json [--grids FOLDER]``. Ground: the starting terrains ``SCENES`` at level 4, as they are solved,
with the noise of before (erosion 0) and with gullies (erosion 1). Real ground: the grids of the starting terrains
rainier and helens, and every ``NAME@METRES.npy`` of a folder, (rows, cols) with cells of so many metres. ``crests``:
d on samples of level 3 that strokes fix, hold 1. ``levels``: d of a coarse level against that of a finer one at the
same places. ``statistics``: as ``statistics`` says. ``tile_ms``: what the page's own WGSL takes for a tile on the
adapter that wgpu finds.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, uniform_filter

from bench.picture import synthesis as tiles
from bench.room import _serving
from bench.room._slots import HELD, Job, SlotMaker, child_of
from esker import Terrain, contract, grid, templates
from esker.flow import receivers, water
from esker.solve.constraints import raster_reference
from esker.solve.constraints.constraints import pack
from esker.synthesis.site import tile_window
from esker.templates import survey
from esker.version import VERSION

SCENES: Final = ("alpine-ridge", "volcanic-island")
GROUNDS: Final[dict[str, dict[str, float]]] = {
    "noise_of_before": {"erosion": 0.0},
    "gullies_alone": {"erosion": 1.0, "hold": 1.0, "detail": 0.0},
    "gullies": {"erosion": 1.0, "hold": 1.0},
    "gullies_hold_0.9": {"erosion": 1.0, "hold": 0.9},
    "gullies_hold_0": {"erosion": 1.0, "hold": 0.0},
}
LEVEL: Final = 4
PAIRS: Final = ((2, 4), (2, 6), (4, 6))
WINDOW: Final = (420, 300, 200)
"""Row, column and side of a window of level 4."""
AREAS: Final = (8, 16, 32, 64, 128, 256, 512)
HILLY: Final = 0.08
"""Slope of the ground, smoothed over 15 cells, above which it counts for the statistics."""
Grid = NDArray[np.float64]


def scene(name: str, **changes: float) -> Terrain:
    """A starting terrain with other settings of its detail."""
    document = templates.load(name).document
    return Terrain.from_document(document.model_copy(update={"settings": document.settings.model_copy(update=changes)}))


def crests(name: str) -> dict[str, Any]:
    """RMS and worst of d where strokes fix the ground, metres, for each of ``GROUNDS``."""
    terrain = scene(name)
    fixed = raster_reference.rasterise(pack(terrain.strokes, terrain.settings, LEVEL - 1), None).height_d < 0
    out: dict[str, Any] = {"samples": int(fixed.sum())}
    for label, changes in GROUNDS.items():
        d = scene(name, **changes).attributes(LEVEL)["detail"].astype(np.float64)
        there = d[::2, ::2][fixed]
        out[label] = {"rms_m": round(rms(there), 3), "worst_m": round(float(np.abs(there).max()), 2),
                      "all_rms_m": round(rms(d), 2), "all_mean_m": round(float(d.mean()), 2)}  # fmt: skip
    return out


def levels(name: str, **changes: float) -> dict[str, Any]:
    """Differences between d of two levels at the same places: metres RMS, share of the relief, correlation."""
    terrain = scene(name, **changes)
    relief = float(np.ptp(terrain.heights(LEVEL)))
    row, col, side = WINDOW
    d: dict[int, NDArray[np.float32]] = {}
    s = grid.spacing(LEVEL, terrain.settings.size_m)
    for level in sorted({level for pair in PAIRS for level in pair}):
        found = terrain.window(level, col * s, row * s, (col + side) * s, (row + side) * s, detail=True)
        d[level] = found.attributes["detail"]
    out = {}
    for coarse, fine in PAIRS:
        step = 1 << (fine - coarse)
        there = d[fine][::step, ::step].astype(np.float64)
        away = there - d[coarse]
        out[f"{coarse}_and_{fine}"] = {
            "rms_m": round(rms(away), 2), "of_the_relief": round(rms(away) / relief, 5),
            "correlation": round(float(np.corrcoef(there.ravel(), d[coarse].ravel())[0, 1]), 3),
        }  # fmt: skip
    return out


def statistics(z: Grid, cell_m: float, sea_m: float | None = None) -> dict[str, float]:
    """Measures the hilly part of a grid: median slope; exponent b of P(area > a) ~ a^-b and the share of samples with
    64 above them; theta of slope ~ area^-theta; hypsometric integral; basins of 1,000 samples of land; the share of the
    land that lies under standing water. What the sea covers is no land: water runs to it as it does to the border."""
    n = min(z.shape)
    z = np.ascontiguousarray(z[:n, :n], np.float64)
    sea = water.sea_quanta(sea_m, cell_m)
    found = water.find_water(water.quanta(z, cell_m), sea)
    land = found.z > sea
    gy, gx = np.gradient(uniform_filter(z, 15), cell_m)
    hilly = (np.hypot(gx, gy) > HILLY) & land
    for edge in (np.s_[:4], np.s_[-4:], np.s_[:, :4], np.s_[:, -4:]):
        hilly[edge] = False
    area = found.area[hilly].astype(np.float64)
    share = np.array([(area >= a).mean() for a in AREAS])
    gy, gx = np.gradient(z, cell_m)
    heights = z[hilly]
    return {
        "hilly": round(float(hilly.mean()), 3),
        "slope_median": round(float(np.median(np.hypot(gx, gy)[hilly])), 3),
        "area_exponent": round(fall(np.log(AREAS), np.log(share)), 3),
        "area_64_share": round(float(share[3]), 4),
        "theta": round(theta(found, cell_m, hilly), 3),
        "hypsometric": round(float((heights.mean() - heights.min()) / np.ptp(heights)), 3),
        "basins_per_1000": round(1000 * (len(found.spill) - 1) / np.count_nonzero(land), 2),
        "standing_water": round(float((found.filled > found.z)[land].mean()), 4),
    }


def theta(found: water.Water, cell_m: float, hilly: NDArray[np.bool_]) -> float:
    """Concavity: how fast slopes along the water fall as areas grow."""
    n = found.shape[1]
    to, filled = found.receiver.ravel(), found.filled.ravel() * (cell_m / contract.QUANTA_PER_CELL)
    here = np.flatnonzero(to != receivers.OUT)
    away = np.abs(to[here] - here)
    slope = np.zeros(to.size)
    slope[here] = (filled[here] - filled[to[here]]) / np.where((away == 1) | (away == n), cell_m, cell_m * np.sqrt(2))
    slope, area = slope.reshape(found.shape)[hilly], found.area[hilly].astype(np.float64)
    areas, slopes = [], []
    for low in 2.0 ** np.arange(5, 12):
        inside = (area >= low) & (area < 2 * low)
        if inside.sum() > 30 and slope[inside].mean() > 0:
            areas.append(np.log(low * np.sqrt(2)))
            slopes.append(np.log(slope[inside].mean()))
    return fall(np.array(areas), np.array(slopes)) if len(areas) > 2 else 0.0


def fall(x: Grid, y: Grid) -> float:
    """How fast y falls by x: minus the slope of the straight line through the points."""
    return -float(np.polyfit(x, y, 1)[0])


def real_grids(folder: Path | None) -> Iterator[tuple[str, Grid, float]]:
    """Name, heights and cell of each real grid."""
    for template_id in templates.REAL:
        template = templates.load(template_id)
        for layer in template.document.layers:
            kept = template.grids.get(layer.content)
            if kept is not None:
                yield kept, filled(survey.read(survey.FOLDER / f"{kept}.npz").heights), layer.spacing_m[0]
    for path in sorted(folder.glob("*@*.npy")) if folder is not None else ():
        yield path.stem, filled(np.load(path)), float(path.stem.rpartition("@")[2])


def filled(heights: NDArray[Any]) -> Grid:
    """Voids filled by the nearest sample."""
    z = heights.astype(np.float64)
    holes = ~np.isfinite(z)
    if holes.any():
        nearest = distance_transform_edt(holes, return_distances=False, return_indices=True)
        z = z[tuple(nearest)]
    return z


def tile_ms(erosion: float, repeats: int = 9) -> dict[str, float]:
    """Times of a tile of level 3 among the 64 of its level, milliseconds."""
    site = replace(tiles.terrain(), erosion=erosion, channels=tiles.strokes())
    maker = SlotMaker(site, 128)
    maker.put(0, site.guide(tile_window(0, 0, 0)).astype(np.float32))
    jobs = [Job(0, 0, 0, 0, 0, HELD)]
    for slot in range(1, 1 + 4 + 16 + 64):
        jobs.append(child_of(jobs[(slot - 1) // 4], slot, (slot - 1) & 1, (slot - 1) >> 1 & 1))
    batch = [job for job in jobs if job.level == 3]

    def once() -> None:
        maker.run(batch)
        maker.wait()

    maker.run(jobs)
    once()
    return {key: round(value / len(batch), 4) for key, value in tiles.timed(once, repeats).items()}


def rms(z: NDArray[Any]) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(np.square(z, dtype=np.float64))))


def measure(folder: Path | None) -> dict[str, Any]:
    """All figures."""
    grounds: dict[str, Any] = {}
    for name in SCENES:
        cell = grid.spacing(LEVEL, contract.DEFAULT_SIZE_M)
        sea_m = scene(name).settings.sea_level_m
        grounds[f"{name}, solved"] = statistics(scene(name).heights(LEVEL).astype(np.float64), cell, sea_m)
        for label in ("noise_of_before", "gullies_hold_0.9"):
            z = scene(name, **GROUNDS[label]).heights(LEVEL, detail=True)
            grounds[f"{name}, {label}"] = statistics(z.astype(np.float64), cell, sea_m)
    real = {name: {"cell_m": cell} | statistics(z, cell) for name, z, cell in real_grids(folder)}
    compared: Mapping[str, Any] = {
        label: levels(SCENES[0], **GROUNDS[label]) for label in ("noise_of_before", "gullies_alone", "gullies")
    }
    return {
        "crests": {name: crests(name) for name in SCENES},
        "levels": compared,
        "statistics": grounds | real,
        "tile_ms": {f"erosion_{erosion:g}": tile_ms(erosion) for erosion in (0.0, 1.0, 0.0, 1.0)},
    }


def main(argv: list[str]) -> int:
    """The command."""
    p = argparse.ArgumentParser(prog="esker bench wear", description=str(__doc__).partition("\n\n")[0])
    p.add_argument("--json", action="store_true", help="print JSON")
    p.add_argument("--grids", type=Path, help="a folder of NAME@METRES.npy, real ground to compare with")
    options = p.parse_args(argv)
    result = {"bench": "wear", "version": VERSION, "machine": _serving.machine(), **measure(options.grids)}
    json.dump(result, sys.stdout, indent=1 if options.json else 2)
    sys.stdout.write("\n")
    return 0
