"""All patches of one layer in the world, as arrays: all that follows from the layer alone."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from esker import contract
from esker.patchwork.jit import kernel
from esker.patchwork.raster import patches
from esker.patchwork.raster.patches import Floats
from esker.patchwork.raster.rasters import Raster
from esker.patchwork.raster.rim import blocks

Ints = NDArray[np.int64]

AREA_QUANTA: Final = 1_000_000
"""Areas are ordered by log2 in steps of a millionth: float noise must not order patches of equal size."""


@dataclass(frozen=True, eq=False)
class Placed:
    """An elevation layer of the document with the raster that its ``content`` names."""

    layer: contract.Layer
    raster: Raster


def affine(layer: contract.Layer) -> Floats:
    """(2, 3): (warped) lattice (u, v, 1) to world (x, y), metres. Quarter turns are exact."""
    quarter, rest = divmod(layer.rotation_deg, 90.0)
    turn = math.radians(rest)
    cos, sin = (1.0, 0.0) if rest == 0 else (math.cos(turn), math.sin(turn))
    for _ in range(int(quarter) % 4):
        cos, sin = -sin, cos
    sx, sy = layer.spacing_m
    return np.array([[cos * sx, -sin * sy, layer.anchor[0]], [sin * sx, cos * sy, layer.anchor[1]]])


def inverse(matrix: Floats) -> Floats:
    """The inverse (..., 2, 3) of affine maps (..., 2, 3)."""
    a, b, c, d = matrix[..., 0, 0], matrix[..., 0, 1], matrix[..., 1, 0], matrix[..., 1, 1]
    determinant = a * d - b * c
    out = np.empty_like(matrix)
    out[..., 0, 0], out[..., 0, 1] = d / determinant, -b / determinant
    out[..., 1, 0], out[..., 1, 1] = -c / determinant, a / determinant
    out[..., 0, 2] = -(out[..., 0, 0] * matrix[..., 0, 2] + out[..., 0, 1] * matrix[..., 1, 2])
    out[..., 1, 2] = -(out[..., 1, 0] * matrix[..., 0, 2] + out[..., 1, 1] * matrix[..., 1, 2])
    return out


def composed(outer: Floats, inner: Floats) -> Floats:
    """The affine map ``outer`` after ``inner``, both (..., 2, 3)."""
    out = np.empty(np.broadcast_shapes(outer.shape, inner.shape))
    for row in range(2):
        for col in range(3):
            out[..., row, col] = outer[..., row, 0] * inner[..., 0, col] + outer[..., row, 1] * inner[..., 1, col]
        out[..., row, 2] += outer[..., row, 2]
    return out


def mapped(matrix: Floats, points: Floats) -> Floats:
    """Points (..., 2) under one affine map (2, 3). Equal points give equal bits."""
    x, y = points[..., 0], points[..., 1]
    first = matrix[0, 0] * x + matrix[0, 1] * y + matrix[0, 2]
    return np.stack([first, matrix[1, 0] * x + matrix[1, 1] * y + matrix[1, 2]], -1)


@dataclass(frozen=True, eq=False)
class LayerPatches:
    """The n patches of one layer, ordered by (scale, j, i). Fields as in ``space.Model``; and

    ``own``: accuracy + own error, metres. ``area``: log2 of the nominal kernel's area in steps of AREA_QUANTA.
    ``tables[scale]``: index of patch (j, i) of the layer, -1 where there is none. Patches of the rim come first, by
    their block (j, i) of the tiling's scale 0, ``rim_start[j * blocks a row + i]`` ..; it is empty if there are none.
    ``j`` and ``i`` of theirs are the row and column of their kernel's first sample. ``to_world``, ``to_lattice``: the
    layer's affine and its inverse. ``sway``: greatest displacement of the control net, lattice units.
    """

    placed: Placed
    scale: NDArray[np.int8]
    j: NDArray[np.int32]
    i: NDArray[np.int32]
    to_patch: Floats
    kernel: Floats
    extent: Floats
    half: Floats
    slack: Floats
    own: Floats
    area: Ints
    tables: tuple[NDArray[np.int32], ...]
    rim_start: Ints
    to_world: Floats
    to_lattice: Floats
    sway: float

    @property
    def count(self) -> int:
        return len(self.own)

    def scale_range(self, scale: int) -> tuple[int, int]:
        """First patch of a scale and the one after its last."""
        return int(np.searchsorted(self.scale, scale)), int(np.searchsorted(self.scale, scale, "right"))

    def windows(self) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32]]:
        """First row and column of the patches in their levels, and how many samples a side they have."""
        size = patches.SMALLEST_KERNEL << np.clip(self.scale, 0, patches.SMALL_SCALES).astype(np.int32)
        row, col = self.j * size - patches.RING, self.i * size - patches.RING
        rim = self.placed.raster.errors.rim
        if len(rim):
            part = slice(0, len(rim))
            row[part], col[part], size[part] = rim[:, 0] - patches.RING, rim[:, 1] - patches.RING, rim[:, 2:].max(1)
        return row, col, (size + 2 * patches.RING).astype(np.int32)


def layer_patches(placed: Placed) -> LayerPatches:
    """Lay the patches of a layer in the world."""
    raster = placed.raster
    rows, cols = raster.heights.shape
    rim, rows_of = raster.errors.rim, _Rows(placed)
    if len(rim):
        laid = patches.lay_rim(rows, cols, raster.warp, rim)
        size = rim[:, 2:].prod(axis=1).astype(np.float64)
        rows_of.add(laid, raster.errors.rim_errors, patches.RIM, rim[:, :2].astype(np.int64), size)
    tables, first = [], len(rim)
    for scale, table in enumerate(raster.errors.tables):
        there = ~np.isnan(table)
        j, i = np.nonzero(there)
        # Where there is a rim the small tables are the way to it.
        index = np.full(patches.table_shape(rows, cols, scale) if len(rim) else table.shape, -1, np.int32)
        if len(j):
            index[there] = np.arange(first, first + len(j))
        tables.append(index)
        first += len(j)
        if not len(j) and (rows_of.parts or scale < len(raster.errors.tables) - 1):
            continue  # the last one stands for a grid without any patch, all of whose rim was left out
        laid = patches.lay(rows, cols, raster.warp, scale, j, i)
        size = np.full(len(j), 4.0**scale * patches.SMALLEST_KERNEL**2)
        rows_of.add(laid, table[there], scale, np.stack([j, i], 1), size)
    starts = blocks(rim, patches.table_shape(rows, cols, 0)) if len(rim) else np.zeros(0, np.int64)
    return rows_of.gathered(tuple(tables), starts)


class _Rows:
    """The patches of a layer as they come, scale by scale."""

    def __init__(self, placed: Placed) -> None:
        self._placed = placed
        self._to_world = affine(placed.layer)
        self._to_lattice = inverse(self._to_world)
        self._cell = math.log2(placed.layer.spacing_m[0] * placed.layer.spacing_m[1])
        self.parts: list[dict[str, NDArray[Any]]] = []
        """Columns by the names of LayerPatches's fields."""

    def add(self, laid: patches.Lattice, errors: NDArray[np.float32], scale: int, at: Ints, samples: Floats) -> None:
        """n patches of one scale. ``errors`` (n,) in the raster's unit; ``at`` (n, 2) their j and i; ``samples`` (n,)
        how many their nominal kernels have."""
        layer = self._placed.layer
        to_patch = composed(laid.to_patch, self._to_lattice)
        from_patch = inverse(to_patch)
        unit = np.hypot(from_patch[:, 0, :2], from_patch[:, 1, :2])
        self.parts.append(
            {
                "scale": np.full(len(at), scale, np.int8),
                "j": at[:, 0].astype(np.int32),
                "i": at[:, 1].astype(np.int32),
                "to_patch": to_patch,
                "kernel": mapped(self._to_world, laid.kernel),
                "extent": laid.extent,
                "half": laid.extent / 2 * unit,
                "slack": laid.bend * max(layer.spacing_m),
                "own": layer.accuracy_m + abs(layer.scale) * errors.astype(np.float64),
                "area": np.rint((self._cell + np.log2(samples)) * AREA_QUANTA).astype(np.int64),
            }
        )

    def gathered(self, tables: tuple[NDArray[np.int32], ...], rim_start: Ints) -> LayerPatches:
        """All of them. ``tables``, ``rim_start``: as in LayerPatches."""
        columns = {name: np.concatenate([part[name] for part in self.parts]) for name in self.parts[0]}
        columns["kernel"] = _counter_clockwise(columns["kernel"])
        warp = self._placed.raster.warp
        return LayerPatches(
            self._placed,
            **columns,
            tables=tables,
            rim_start=rim_start,
            to_world=self._to_world,
            to_lattice=self._to_lattice,
            sway=0.0 if warp is None else float(np.abs(warp).max()) * 1.5 + 0.5,
        )


def _counter_clockwise(kernel: Floats) -> Floats:
    """Quads (n, 4, 2), turned round where a mirroring control net made them run clockwise."""
    a, b = kernel[:, 2] - kernel[:, 0], kernel[:, 3] - kernel[:, 1]
    clockwise = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0] < 0
    if clockwise.any():
        kernel[clockwise] = kernel[clockwise, ::-1]
    return kernel


def reached(of: LayerPatches, by: LayerPatches) -> NDArray[np.bool_]:
    """Returns which patches of ``of`` have a domain that may touch the grid of ``by`` (never misses one)."""
    rows, cols = by.placed.raster.heights.shape
    edge = 0.5 + by.sway
    out = np.empty(of.count, np.bool_)
    _reached(of.to_patch, of.extent, by.to_lattice, edge, cols - 1 + edge, rows - 1 + edge, out)
    return out


@kernel
def _reached(
    to_patch: Floats, extent: Floats, m: Floats, edge: float, end_u: float, end_v: float, out: NDArray[np.bool_]
) -> None:
    for k in range(len(to_patch)):
        t = to_patch[k]
        determinant = t[0, 0] * t[1, 1] - t[0, 1] * t[1, 0]
        u0, u1, v0, v1 = np.inf, -np.inf, np.inf, -np.inf
        for corner in range(4):
            du = (extent[k, 0] if corner & 1 else 0.0) - t[0, 2]
            dv = (extent[k, 1] if corner & 2 else 0.0) - t[1, 2]
            x = (t[1, 1] * du - t[0, 1] * dv) / determinant
            y = (t[0, 0] * dv - t[1, 0] * du) / determinant
            u, v = m[0, 0] * x + m[0, 1] * y + m[0, 2], m[1, 0] * x + m[1, 1] * y + m[1, 2]
            u0, u1, v0, v1 = min(u0, u), max(u1, u), min(v0, v), max(v1, v)
        out[k] = u0 <= end_u and u1 >= -edge and v0 <= end_v and v1 >= -edge
