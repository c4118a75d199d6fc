"""The ground as a solid for printers: binary STL (3D Systems, "StereoLithography Interface Specification", 1988)."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from esker import contract
from esker.contract import ModelOptions
from esker.exporting.ground import Ground
from esker.exporting.printing.drawing import CannotPrint

TRIANGLE: Final = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
HEADER_BYTES: Final = 80
ON_FOOT: Final = np.array([1.0, 1.0, 0.0], dtype=np.float32)

Points = NDArray[np.float32]


def corners(ground: Ground, wanted: ModelOptions) -> Points:
    """Triangles (n, 3, 3) of a closed solid, millimetres: x east, y north, z up; its south-western foot at the origin.

    The ground on top, four walls, and a foot that lies ``base_mm`` under the lowest sample. Every edge belongs to
    exactly two triangles, which run along it in opposite directions. Raises CannotPrint."""
    rows, columns = ground.heights.shape
    most = contract.EXPORT_MESH_SAMPLES
    if max(rows, columns) > most or min(rows, columns) < 2:
        raise CannotPrint(f"A solid has 2 to {most} samples a side, not {columns} x {rows}: take a coarser level.")
    if not np.isfinite(ground.heights).all():
        raise CannotPrint("The ground has samples without a height.")
    per = wanted.width_mm / (max(rows, columns) - 1)
    scale = per / ground.spacing_m
    top = np.empty((rows, columns, 3), dtype=np.float32)
    top[..., 0] = (np.arange(columns) * per)[None, :]
    top[..., 1] = (np.arange(rows) * per)[:, None]
    z = ground.heights.astype(np.float64)
    top[..., 2] = (z - z.min()) * (scale * wanted.exaggeration) + wanted.base_mm
    sw, se, nw, ne = top[:-1, :-1], top[:-1, 1:], top[1:, :-1], top[1:, 1:]
    surface = np.stack([sw, se, ne, sw, ne, nw], axis=2).reshape(-1, 3, 3)
    rim = np.concatenate([top[0, :-1], top[:-1, -1], top[-1, :0:-1], top[:0:-1, 0]])  # it runs anticlockwise
    after = np.roll(rim, -1, axis=0)
    foot, foot_after = rim * ON_FOOT, after * ON_FOOT
    walls = np.stack([foot, foot_after, after, foot, after, rim], axis=1).reshape(-1, 3, 3)
    middle = np.broadcast_to(0.5 * ON_FOOT * top[-1, -1], foot.shape)
    bottom = np.stack([middle, foot_after, foot], axis=1)
    return np.concatenate([surface, walls, bottom])


def write_solid(path: Path, ground: Ground, wanted: ModelOptions) -> None:
    """Writes the file. Raises CannotPrint, OSError."""
    found = corners(ground, wanted)
    out = np.zeros(len(found), dtype=TRIANGLE)
    a, b, c = (found[:, k].astype(np.float64) for k in range(3))
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    out["normal"] = normal / np.where(length > 0, length, 1.0)
    out["corners"] = found
    with path.open("wb") as file:
        file.write(b"Esker, millimetres, z up".ljust(HEADER_BYTES))
        file.write(len(found).to_bytes(4, "little"))
        out.tofile(file)
