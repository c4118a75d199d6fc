"""Cases of lakes.json: ground of whole sixteenths of a metre, and the lakes on it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from esker.contract import LAKE_LEVEL, NO_LAKE, TILE_CELLS
from esker.synthesis.lakes import find_lakes, waves_of

SIDE = 25
SCALE = 16
# The ground as it is asked, and so wide that the largest lakes have the waves of the sea.
WAVES_CELLS_M = (16.0, 512.0)
Floats = NDArray[np.float64]


def _grounds() -> dict[str, tuple[Floats, dict[str, Any]]]:
    y, x = np.mgrid[0:SIDE, 0:SIDE].astype(np.float64)
    away = np.hypot(x - 12, y - 12)
    crater = 90 - 6 * np.abs(away - 6)
    valley = 30 + 2 * y + 5 * np.abs(x - 12)
    dam = np.where(np.abs(y - 7) < 1.5, np.maximum(valley, 75), valley)
    # Two hollows with a ridge of one sample between them, the western one higher.
    twins = np.where(x < 12, 60 - 2 * (5 - np.abs(x - 6)), 40 - 3 * (5 - np.abs(x - 18)))
    twins = np.where(np.abs(x - 12) < 0.5, 70, twins) + 3 * np.abs(y - 12)
    rough = crater + np.random.default_rng(5).normal(0, 6, crater.shape)
    breach = np.where((np.abs(y - 12) < 0.5) & (x > 12), 52, crater)
    # Water passes from south-east to north-west between two samples of a rim, and not from south-west to north-east.
    closed = np.where(np.maximum(np.abs(x - 12), np.abs(y - 12)) == 5, 80.0, np.where(away < 7.5, 50.0, 40.0))
    closed[7, 7] = 45
    opened = closed.copy()
    opened[17, 7] = 55
    return {
        "crater": (crater, {}),
        "crater in the sea": (crater, {"sea_m": 60.0}),
        "crater filled by the sea": (crater, {"sea_m": 100.0}),
        "too shallow": (crater, {"least_m": 40.0}),
        "valley runs off": (valley, {}),
        "valley behind a dam": (dam, {}),
        "two with a ridge between": (twins, {"least_m": 2.0}),
        "rough": (rough, {"least_m": 1.0}),
        "breached rim": (breach, {}),
        "rim without its south-western corner": (closed, {}),
        "rim with a low north-western corner": (opened, {}),
    }


def lake_vectors() -> list[dict[str, Any]]:
    """One case a ground: what is asked, levels and samples that follow, and the waves on terrains of two sizes."""
    out = []
    for name, (ground, rule) in _grounds().items():
        steps = np.rint(ground * SCALE).astype(np.int64)
        asked = {"cell_m": 16.0, "least_m": 4.0, "sea_m": None, **rule}
        lakes = find_lakes((steps / SCALE).astype(np.float32), asked["cell_m"], asked["least_m"], asked["sea_m"])
        levels = [None if z == NO_LAKE else z for z in lakes.levels.ravel().tolist()]
        samples = sorted(lakes.samples.items())
        sizes = [cell * (TILE_CELLS << LAKE_LEVEL) for cell in WAVES_CELLS_M]
        waves = [{"size_m": size, "heights": sorted(waves_of(lakes, size).items())} for size in sizes]
        found = {"levels": levels, "samples": samples, "waves": waves}
        out.append({"name": name, **asked, "ground": steps.ravel().tolist(), **found})
    return out
