"""When do kernels cover a kernel? Tops and floors of patches, by cutting polygons (paper 2, Patch Invariant; compiled).

The top of a patch P is the smallest z at which the kernels of greater patches with min z <= z together cover P's
kernel; Algorithm 1 of the paper leaves out that they must be greater and is garbled at its end (DESIGN 11). P is the
*floor* of a place if no more accurate patches cover its kernel: below its error nothing better is to be had there.

Kernels meet exactly where nothing bends the lattice. Where a control net does, a kernel is tested smaller by its slack
and covering ones are taken greater by theirs: what that passes over is far narrower than the margins of the patches.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from esker.patchwork.jit import bands, kernel, spread
from esker.patchwork.lod.covering import least_cover, local
from esker.patchwork.lod.layer_patches import LayerPatches
from esker.patchwork.lod.quads import area_of, contains, overlap, shrunk
from esker.patchwork.raster import patches
from esker.patchwork.raster.patches import Floats

Ints = NDArray[np.int64]


class Index(NamedTuple):
    """The patches of several layers by place, for compiled loops.

    Rim patches of block b of layer k: ``rim[rim_at[k] + b]`` up to the next; ``rim_at`` is -1 where a layer has none.
    ``rank``, ``rim_rank``: the greatest area of the patches of a scale and of a rim.
    """

    kernel: Floats
    min_z: Floats
    area: Ints
    slack: Floats
    to_lattice: Floats
    sway: Floats
    tables: NDArray[np.int32]
    rim: Ints
    rim_at: Ints
    rim_rank: Ints
    start: Ints
    tall: Ints
    wide: Ints
    rank: Ints
    lowest: Ints
    scales: Ints


def index(layers: list[LayerPatches], first: list[int], min_z: Floats, kernel: Floats) -> Index:
    """Index of layers whose patches have the places ``first[k]``.. in the arrays of the model."""
    most = max(len(held.tables) for held in layers)
    start = np.full((len(layers), most), -1, np.int64)
    tall, wide, rank = np.zeros_like(start), np.zeros_like(start), np.full_like(start, np.iinfo(np.int64).min)
    flat: list[NDArray[np.int32]] = []
    filled, rims, rim_filled = 0, [np.zeros(0, np.int64)], 0
    rim_at, rim_rank = np.full(len(layers), -1, np.int64), np.full(len(layers), np.iinfo(np.int64).min)
    for k, held in enumerate(layers):
        rows, cols = held.placed.raster.heights.shape
        if len(held.rim_start):
            rim_at[k], rim_rank[k] = rim_filled, held.area[: held.rim_start[-1]].max()
            rims.append(held.rim_start + first[k])
            rim_filled += len(held.rim_start)
        for scale, table in enumerate(held.tables):
            tall[k, scale], wide[k, scale] = patches.table_shape(rows, cols, scale)
            if (table >= 0).any():
                start[k, scale] = filled
                flat.append(np.where(table >= 0, table + first[k], -1).ravel().astype(np.int32))
                filled += table.size
                rank[k, scale] = held.area[held.scale_range(scale)[0]]
    lowest = [
        0 if rim_at[k] >= 0 else next(s for s in range(most) if s == patches.SMALL_SCALES or start[k, s] >= 0)
        for k in range(len(layers))
    ]
    return Index(
        kernel,
        min_z,
        np.concatenate([held.area for held in layers]),
        np.concatenate([held.slack for held in layers]),
        np.stack([held.to_lattice for held in layers]),
        np.array([held.sway for held in layers]),
        np.concatenate(flat) if flat else np.zeros(0, np.int32),
        np.concatenate(rims),
        rim_at,
        rim_rank,
        start,
        tall,
        wide,
        rank,
        np.array(lowest, np.int64),
        np.array([len(held.tables) for held in layers], np.int64),
    )


@kernel
def greater(ix: Index, q: int, p: int) -> bool:
    """The total order: area, then accuracy, then priority, layer and place (the order of the model's arrays)."""
    if ix.area[q] != ix.area[p]:
        return bool(ix.area[q] > ix.area[p])
    if ix.min_z[q] != ix.min_z[p]:
        return bool(ix.min_z[q] < ix.min_z[p])
    return q > p


@kernel
def _box(ix: Index, layer: int, quad: Floats) -> tuple[float, float, float, float]:
    """Bounds of a quad in area coordinates of a layer: low and high column, low and high row."""
    m, sway = ix.to_lattice[layer], ix.sway[layer]
    x0, x1, y0, y1 = np.inf, -np.inf, np.inf, -np.inf
    for c in range(4):
        x = m[0, 0] * quad[c, 0] + m[0, 1] * quad[c, 1] + m[0, 2] + 0.5
        y = m[1, 0] * quad[c, 0] + m[1, 1] * quad[c, 1] + m[1, 2] + 0.5
        x0, x1, y0, y1 = min(x0, x), max(x1, x), min(y0, y), max(y1, y)
    return x0 - sway, x1 + sway, y0 - sway, y1 + sway


@kernel
def _grown(numbers: Ints) -> Ints:
    """A list with room for twice as many."""
    more = np.empty(2 * len(numbers), np.int64)
    for k in range(len(numbers)):
        more[k] = numbers[k]
    return more


@kernel
def _meet(
    ix: Index,
    q: int,
    x: float,
    y: float,
    quad: Floats,
    tolerance: float,
    other: Floats,
    found: Ints,
    count: int,
    best: float,
) -> tuple[Ints, int, float]:
    """Compares a greater patch q with a kernel at (x, y).

    Where q holds all of the kernel its error becomes ``best``; where q holds a part it is found. ``other``: room for
    its corners.
    """
    local(ix.kernel, q, x, y, other)
    if contains(other, quad, ix.slack[q] + tolerance):
        return found, count, ix.min_z[q]
    if overlap(quad, other, ix.slack[q]):
        if count == len(found):
            found = _grown(found)
        found[count] = q
        count += 1
    return found, count, best


@kernel
def _rivals(ix: Index, p: int, quad: Floats, found: Ints) -> tuple[Ints, int, float]:
    """Greater patches whose kernels reach that of p, how many, and the least error of those that hold all of it."""
    x, y = ix.kernel[p, 0, 0], ix.kernel[p, 0, 1]
    other = np.empty((4, 2))
    tolerance = 1e-7 * np.sqrt(area_of(quad, 4))
    best = np.inf
    count = 0
    for layer in range(len(ix.lowest)):
        x0, x1, y0, y1 = _box(ix, layer, ix.kernel[p])
        for scale in range(ix.lowest[layer], ix.scales[layer]):
            if ix.start[layer, scale] < 0 or ix.rank[layer, scale] < ix.area[p]:
                continue
            cells = float(7 << scale)
            wide = ix.wide[layer, scale]
            for j in range(max(0, int(y0 // cells)), min(ix.tall[layer, scale] - 1, int(y1 // cells)) + 1):
                for i in range(max(0, int(x0 // cells)), min(wide - 1, int(x1 // cells)) + 1):
                    q = ix.tables[ix.start[layer, scale] + j * wide + i]
                    if q >= 0 and ix.min_z[q] < best and greater(ix, q, p):
                        found, count, best = _meet(ix, q, x, y, quad, tolerance, other, found, count, best)
        if ix.rim_at[layer] < 0 or ix.rim_rank[layer] < ix.area[p]:
            continue
        wide = ix.wide[layer, 0]
        for j in range(max(0, int(y0 // 7.0)), min(ix.tall[layer, 0] - 1, int(y1 // 7.0)) + 1):
            for i in range(max(0, int(x0 // 7.0)), min(wide - 1, int(x1 // 7.0)) + 1):
                block = ix.rim_at[layer] + j * wide + i
                for q in range(ix.rim[block], ix.rim[block + 1]):
                    if ix.min_z[q] < best and greater(ix, q, p):
                        found, count, best = _meet(ix, q, x, y, quad, tolerance, other, found, count, best)
    return found, count, best


@kernel
def _sorted_below(ix: Index, numbers: Ints, count: int, limit: float) -> int:
    """Keep the patches with an error below ``limit``, by error then number. Returns how many."""
    kept = 0
    for k in range(count):
        q = numbers[k]
        z = ix.min_z[q]
        if z >= limit:
            continue
        at = kept
        while at > 0 and (ix.min_z[numbers[at - 1]] > z or (ix.min_z[numbers[at - 1]] == z and numbers[at - 1] > q)):
            numbers[at] = numbers[at - 1]
            at -= 1
        numbers[at] = q
        kept += 1
    return kept


@kernel
def _tops(ix: Index, which: Ints, start: int, stop: int, out: Floats) -> None:
    """Smallest z at which greater patches cover the kernels of patches; infinity if they never do."""
    own, quad = np.empty((4, 2)), np.empty((4, 2))
    found = np.empty(64, np.int64)
    for w in range(start, stop):
        p = which[w]
        x, y = ix.kernel[p, 0, 0], ix.kernel[p, 0, 1]
        local(ix.kernel, p, x, y, own)
        shrunk(own, ix.slack[p], quad)
        found, count, best = _rivals(ix, p, quad, found)
        count = _sorted_below(ix, found, count, best)
        out[w] = best
        if count > 1:
            out[w] = least_cover(ix.kernel, ix.slack, ix.min_z, quad, area_of(own, 4), x, y, found, count, best, False)


@kernel
def _better(ix: Index, p: int, layer: int, found: Ints, count: int) -> tuple[Ints, int]:
    """Add the greatest patches of a layer that are more accurate than p and near it, from the layer's top down."""
    x0, x1, y0, y1 = _box(ix, layer, ix.kernel[p])
    # At most so many can wait: one patch is at the top, and each has four children.
    stack = np.empty((4 * ix.scales[layer] + 4, 3), np.int64)
    stack[0, 0], stack[0, 1], stack[0, 2] = ix.scales[layer] - 1, 0, 0
    waiting = 1
    while waiting:
        waiting -= 1
        scale, j, i = stack[waiting, 0], stack[waiting, 1], stack[waiting, 2]
        cells = float(7 << scale)
        if i * cells > x1 or (i + 1) * cells < x0 or j * cells > y1 or (j + 1) * cells < y0:
            continue
        q = -1
        if ix.start[layer, scale] >= 0:
            q = ix.tables[ix.start[layer, scale] + j * ix.wide[layer, scale] + i]
        if q >= 0 and (ix.min_z[q] < ix.min_z[p] or (ix.min_z[q] == ix.min_z[p] and greater(ix, q, p))):
            if count == len(found):
                found = _grown(found)
            found[count] = q
            count += 1
        elif scale > ix.lowest[layer]:
            for child in range(4):
                down, right = 2 * j + child // 2, 2 * i + child % 2
                if down < ix.tall[layer, scale - 1] and right < ix.wide[layer, scale - 1]:
                    stack[waiting, 0], stack[waiting, 1], stack[waiting, 2] = scale - 1, down, right
                    waiting += 1
        elif ix.rim_at[layer] >= 0:
            block = ix.rim_at[layer] + j * ix.wide[layer, 0] + i
            for q in range(ix.rim[block], ix.rim[block + 1]):
                if ix.min_z[q] < ix.min_z[p] or (ix.min_z[q] == ix.min_z[p] and greater(ix, q, p)):
                    if count == len(found):
                        found = _grown(found)
                    found[count] = q
                    count += 1
    return found, count


@kernel
def _floors(ix: Index, which: Ints, start: int, stop: int, out: NDArray[np.bool_]) -> None:
    """Returns whether more accurate patches leave some of the kernels of patches to them."""
    own, quad, other = np.empty((4, 2)), np.empty((4, 2)), np.empty((4, 2))
    found = np.empty(64, np.int64)
    for w in range(start, stop):
        p = which[w]
        x, y = ix.kernel[p, 0, 0], ix.kernel[p, 0, 1]
        local(ix.kernel, p, x, y, own)
        shrunk(own, ix.slack[p], quad)
        whole = area_of(own, 4)
        count = 0
        for layer in range(len(ix.lowest)):
            found, count = _better(ix, p, layer, found, count)
        met = 0
        for k in range(count):
            local(ix.kernel, found[k], x, y, other)
            if overlap(quad, other, ix.slack[found[k]]):
                found[met] = found[k]
                met += 1
        left = least_cover(ix.kernel, ix.slack, ix.min_z, quad, whole, x, y, found, met, np.inf, True)
        out[w] = left == np.inf


def tops(ix: Index, which: Ints) -> Floats:
    """Returns the tops of the patches ``which``."""
    out = np.empty(len(which))
    spread(lambda a, b: _tops(ix, which, a, b, out), bands(len(which), 64))
    return out


def floors(ix: Index, which: Ints) -> NDArray[np.bool_]:
    """Returns which of the patches ``which`` are the floor of some place."""
    out = np.empty(len(which), bool)
    spread(lambda a, b: _floors(ix, which, a, b, out), bands(len(which), 64))
    return out


def nested(of: LayerPatches, min_z: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """Tops and floors of the patches of one layer as if it were alone: kernels nest, so no polygon need be cut.

    The top is the smallest error of the patches around (paper 2, section 4.1: kernels of the mipmap levels tile); a
    patch is a floor if within some descendant's kernel no descendant is more accurate. Over and under a patch of the
    rim there is no other.
    """
    rows, cols = of.placed.raster.heights.shape
    small = of.count > 0 and of.scale[0] < patches.SMALL_SCALES
    scales = range(0 if small else patches.SMALL_SCALES, len(of.tables))
    errors = {scale: np.full(patches.table_shape(rows, cols, scale), np.inf) for scale in scales}
    for scale in scales:
        there = of.tables[scale] >= 0
        if there.any():
            errors[scale][there] = min_z[of.tables[scale][there]]
    top = np.full(of.count, np.inf)
    floor = np.ones(of.count, bool)
    above = np.full(errors[scales[-1]].shape, np.inf)
    for scale in reversed(scales):
        a, b = of.scale_range(scale)
        if b > a:
            top[a:b] = above[of.tables[scale] >= 0]
        if scale > scales[0]:
            shape = errors[scale - 1].shape
            above = np.minimum(above, errors[scale]).repeat(2, 0).repeat(2, 1)[: shape[0], : shape[1]]
    below: Floats | None = None
    for scale in scales:
        error = errors[scale]
        worst = np.full(error.shape, np.inf) if below is None else _worst_of_four(below)
        a, b = of.scale_range(scale)
        if b > a:
            floor[a:b] = ~(worst < error)[of.tables[scale] >= 0]
        below = np.minimum(error, worst)
    return top, floor & (top > min_z)


def _worst_of_four(children: Floats) -> Floats:
    """The greatest of the (up to four) children of each parent."""
    rows, cols = children.shape
    padded = np.full((-(-rows // 2) * 2, -(-cols // 2) * 2), -np.inf)
    padded[:rows, :cols] = children
    pairs = np.maximum(padded[::2], padded[1::2])
    return np.maximum(pairs[:, ::2], pairs[:, 1::2])
