"""Cases of rivermap.json: rivers, and what shaders read of them."""

from __future__ import annotations

from typing import Any

import numpy as np

from esker.flow.rivers import River
from esker.render.rivers import CELLS, COLUMNS, LATTICES, river_map

SIZE_M = 4096.0
LEVEL = 2
CELL_M = SIZE_M / (64 << LEVEL)

BEND = [(100.0, 40.0), (103.5, 44.25), (104.0, 52.0), (96.0, 60.5)]
STRAIGHT = [(96.0, 60.5), (0.0, 61.0)]


def rivermap_vectors() -> list[dict[str, Any]]:
    """Lines in cells of LEVEL, areas in m2; ``cells``: [cell, pieces of eight numbers]."""
    return [
        _case("none", [], 1.0),
        _case("a bend that runs into a straight one", [(BEND, (2e5, 9e5)), (STRAIGHT, (1.4e6, 2e6))], 1.0),
        _case("wet", [(BEND, (2e5, 9e5))], 8.0),
    ]


def _case(
    name: str, lines: list[tuple[list[tuple[float, float]], tuple[float, float]]], wetness: float
) -> dict[str, Any]:
    rivers = [River(np.array(points) * CELL_M, areas, (0.0, 0.0), (0.0, 0.0), None) for points, areas in lines]
    found = river_map(rivers, SIZE_M, wetness)
    cells = []
    if found is not None:
        texels = found.reshape(-1, 4)
        for k in range(sum((CELLS >> j) ** 2 for j in range(LATTICES))):
            first, count = (int(v) for v in texels[k, :2])
            if count:
                pieces = texels[first : first + 2 * count].reshape(-1, 8)
                cells.append([k, [[round(float(v), 3) for v in piece] for piece in pieces]])
    return {
        "name": name,
        "size_m": SIZE_M,
        "level": LEVEL,
        "wetness": wetness,
        "rivers": [{"cells": [v for p in points for v in p], "areas": list(areas)} for points, areas in lines],
        "columns": COLUMNS,
        "cells": cells,
    }
