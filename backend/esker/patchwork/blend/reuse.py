"""Finds the part of a base that stays when layers change: which bins of a level the patches that differ between two
models reach."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from esker import grid
from esker.patchwork.blend.lattice import Lattice, extents, layer_number
from esker.patchwork.blend.loops import BIN, bin_patches
from esker.patchwork.lod.space import Model


def differing(model: Model, other: Model, tolerance: float | None) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Patches of each model that the other has not, chosen at ``tolerance``; at any tolerance if that is None.

    Layers are compared patch by patch: those of one that did not move, whose patches were chosen before and are now,
    are no difference, whatever their boxes are elsewhere.
    """
    marks = [np.ones(m.count, dtype=bool) for m in (model, other)]
    places = {layer_number(p.layer): k for k, p in enumerate(other.placed)}
    for k, placed in enumerate(model.placed):
        at = places.get(layer_number(placed.layer))
        if at is None:
            continue
        a, b = _part(model, k), _part(other, at)
        if tolerance is None:
            same = (model.low[a] == other.low[b]) & (model.max_z[a] == other.max_z[b])
            same &= model.min_z[a] == other.min_z[b]
        else:
            same = _chosen(model, a, tolerance) == _chosen(other, b, tolerance)
            same &= np.maximum(model.min_z[a], tolerance) == np.maximum(other.min_z[b], tolerance)
        marks[0][a] &= ~same
        marks[1][b] &= ~same
    found = []
    for m, mark in zip((model, other), marks, strict=True):
        whole = slice(0, m.count)
        alive = m.max_z > m.low if tolerance is None else _chosen(m, whole, tolerance)
        found.append(np.flatnonzero(mark & alive).astype(np.int32))
    return found[0], found[1]


def changed_bins(model: Model, other: Model, tolerance: float, lattice: Lattice) -> NDArray[np.bool_]:
    """Bins of a lattice, (rows, cols), whose blended heights the two models may not share."""
    r0, r1, c0, c1 = lattice.bins
    hit = np.zeros((r1 - r0) * (c1 - c0), dtype=bool)
    for m, index in zip((model, other), differing(model, other, tolerance), strict=True):
        found = np.zeros(len(hit) + 1, dtype=np.int64)
        to_patch = m.to_patch[index]
        _, domain = extents(m.kernel[index], to_patch, m.side[index].astype(np.int32))
        pitch, reach = BIN * lattice.spacing, (BIN - 1) * lattice.spacing
        empty = np.empty(0, np.int32), np.empty((0, 2), np.float32)
        bin_patches(to_patch, domain, pitch, reach, r0, r1, c0, c1, found, *empty)
        hit |= found[1:] > 0
    return hit.reshape(r1 - r0, c1 - c0)


def met_bins(rects: Iterable[tuple[float, float, float, float]], lattice: Lattice) -> NDArray[np.bool_]:
    """Bins of a lattice, (rows, cols), that rectangles x0, y0, x1, y1 meet."""
    r0, r1, c0, c1 = lattice.bins
    hit, pitch = np.zeros((r1 - r0, c1 - c0), dtype=bool), BIN * lattice.spacing
    for x0, y0, x1, y1 in rects:
        (left, right), (low, high) = (
            (
                max(0, math.floor(max(a, -pitch) / pitch) - first),
                max(0, math.floor(min(b, end * pitch) / pitch) + 1 - first),
            )
            for a, b, first, end in ((x0, x1, c0, c1), (y0, y1, r0, r1))
        )
        hit[low:high, left:right] = True
    return hit


def reached(model: Model, other: Model) -> grid.Rect | None:
    """Returns a rectangle around the domains of all patches in which two models differ at any tolerance; None if in
    none."""
    rect = None
    for m, index in zip((model, other), differing(model, other, None), strict=True):
        if len(index) == 0:
            continue
        low, high = bounds(m, index)
        (x0, y0), (x1, y1) = low.min(axis=0), high.max(axis=0)
        rect = grid.Rect(float(x0), float(y0), float(x1), float(y1)).union(rect)
    return rect


def bounds(model: Model, index: NDArray[np.int32]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Least and greatest world coordinates of the domains of patches: float64 (k, 2) each."""
    to_patch = model.to_patch[index]
    _, domain = extents(model.kernel[index], to_patch, model.side[index].astype(np.int32))
    corners = np.stack([domain[:, [0, 1, 1, 0]], domain[:, [2, 2, 3, 3]]], axis=2) - to_patch[:, None, :, 2]
    world = np.einsum("nij,nkj->nki", np.linalg.inv(to_patch[:, :, :2]), corners)
    return world.min(axis=1), world.max(axis=1)


def _part(model: Model, layer: int) -> slice:
    start = int(np.searchsorted(model.owner, layer))
    return slice(start, int(np.searchsorted(model.owner, layer, side="right")))


def _chosen(model: Model, part: slice, tolerance: float) -> NDArray[np.bool_]:
    return np.asarray((model.low[part] <= tolerance) & (tolerance < model.max_z[part]), dtype=np.bool_)
