"""The nested patch pyramid as an index: the kernels of a scale tile those of the next, so the patches are the tree.

A node is a kernel's place at a scale, with or without a patch. It knows the least ``low`` and the greatest ``max_z`` of
the live patches in its subtree, and the box around their domains: what a query prunes by.

View-dependent queries take the *safe* cut. Paper 2 (section 5.1) takes every box that its plane cuts; a patch so taken
may be coarser than the plane allows in the nearer part of its domain, where it is blended in all the same. Here a patch
is taken only if it is accurate enough (``low`` <= tolerance) everywhere in its domain and in view, and dropped only if
greater patches so taken cover its kernel: its own layer's parents, or those that cover it at its ``max_z``. So every
place in view is covered, and no height there misses by more than the tolerance of the place.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from esker.patchwork.jit import kernel
from esker.patchwork.lod.space import Model
from esker.patchwork.query.polygons import MOST, depths

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class Tree(NamedTuple):
    """Nodes of all layers' pyramids, coarsest scale last in each layer; patches of rims are below the lowest ones.

    ``patch`` int32 (nodes,): index into the model, -1 without; ``least``, ``most`` float64 (nodes,); ``box`` float64
    (nodes, 4) x0, y0, x1, y1. ``scale`` int64 (scales of all layers, 3): first node, rows, cols; the scales of layer k
    are ``first[k]`` to ``first[k + 1]``. Rim patches of node n of layer k's lowest scale, counted from its first, are
    ``rim[rim_at[k] + n]`` up to the next; ``rim_at`` is -1 where a layer has none.
    """

    patch: NDArray[np.int32]
    least: Floats
    most: Floats
    box: Floats
    scale: Ints
    first: Ints
    rim: Ints
    rim_at: Ints


class Boxes(NamedTuple):
    """The boxes of all patches of a model:

    ``low``, ``max_z`` and ``kernel`` as there; ``corners`` (n, 4, 2) of the domains, in turn, and the ``box`` (n, 4)
    around each, x0, y0, x1, y1.
    """

    low: Floats
    max_z: Floats
    corners: Floats
    box: Floats
    kernel: Floats


def boxes(model: Model, known: Boxes | None = None, same: tuple[Ints, Ints] | None = None) -> Boxes:
    """Boxes of a model; ``known`` those of another, whose patches ``same[1]`` are patches ``same[0]`` of this one."""
    corners, box = np.empty((model.count, 4, 2)), np.empty((model.count, 4))
    fresh = np.ones(model.count, dtype=bool)
    if known is not None and same is not None:
        corners[same[0]], box[same[0]] = known.corners[same[1]], known.box[same[1]]
        fresh[same[0]] = False
    index = np.flatnonzero(fresh)
    to, extent = model.to_patch[index], model.extent[index]
    at = np.stack([extent[:, [0, 0, 0, 0]] * [0, 1, 1, 0], extent[:, [1, 1, 1, 1]] * [0, 0, 1, 1]], axis=2)
    at = at - to[:, None, :, 2]
    det = to[:, 0, 0] * to[:, 1, 1] - to[:, 0, 1] * to[:, 1, 0]
    inverse = np.stack([to[:, 1, 1], -to[:, 0, 1], -to[:, 1, 0], to[:, 0, 0]], 1).reshape(-1, 2, 2) / det[:, None, None]
    made = np.einsum("nij,nkj->nki", inverse, at)
    corners[index], box[index] = made, np.concatenate([made.min(axis=1), made.max(axis=1)], axis=1)
    return Boxes(model.low, model.max_z, corners, box, model.kernel)


def tree(model: Model, found: Boxes) -> Tree:
    """The pyramids of all layers of a model."""
    patch, scales, first, nodes = [], [], [0], 0
    rims, rim_at, filled = [np.zeros(0, np.int64)], [], 0
    for start, held in zip(model.first, model.layers, strict=True):
        rim_at.append(filled if len(held.rim_start) else -1)
        rims.append(held.rim_start + start)
        filled += len(held.rim_start)
        for table in held.tables:
            patch.append(np.where(table < 0, -1, table + start).astype(np.int32).ravel())
            scales.append((nodes, *table.shape))
            nodes += table.size
        first.append(len(scales))
    out = Tree(
        np.concatenate(patch) if patch else np.zeros(0, np.int32),
        np.full(nodes, np.inf),
        np.full(nodes, -np.inf),
        np.tile([np.inf, np.inf, -np.inf, -np.inf], (nodes, 1)),
        np.array(scales, dtype=np.int64).reshape(-1, 3),
        np.array(first, dtype=np.int64),
        np.concatenate(rims),
        np.array(rim_at, dtype=np.int64),
    )
    for layer in range(len(model.layers)):
        _summarise(layer, out, found)
    return out


@kernel
def _raise(t: Tree, found: Boxes, n: int, first: int, end: int) -> None:
    """Widen a node's bounds by those of the patches first..end that are alive."""
    box = t.box
    for k in range(first, end):
        if found.low[k] < found.max_z[k]:
            t.least[n], t.most[n] = min(t.least[n], found.low[k]), max(t.most[n], found.max_z[k])
            box[n, 0], box[n, 1] = min(box[n, 0], found.box[k, 0]), min(box[n, 1], found.box[k, 1])
            box[n, 2], box[n, 3] = max(box[n, 2], found.box[k, 2]), max(box[n, 3], found.box[k, 3])


@kernel
def _summarise(layer: int, t: Tree, found: Boxes) -> None:
    """Bounds of all subtrees of a layer, bottom up."""
    low, most, box = t.least, t.most, t.box
    for s in range(t.first[layer], t.first[layer + 1]):
        node, rows, cols = t.scale[s]
        below = s > t.first[layer]
        under, down, across = t.scale[s - 1] if below else t.scale[s]
        for j in range(rows):
            for i in range(cols):
                n = node + j * cols + i
                k = t.patch[n]
                if k >= 0 and found.low[k] < found.max_z[k]:
                    low[n], most[n] = found.low[k], found.max_z[k]
                    for c in range(4):
                        box[n, c] = found.box[k, c]
                if not below:
                    if t.rim_at[layer] >= 0:
                        at = t.rim_at[layer] + n - node
                        _raise(t, found, n, t.rim[at], t.rim[at + 1])
                    continue
                for y in range(2 * j, min(2 * j + 2, down)):
                    for x in range(2 * i, min(2 * i + 2, across)):
                        m = under + y * across + x
                        low[n], most[n] = min(low[n], low[m]), max(most[n], most[m])
                        box[n, 0], box[n, 1] = min(box[n, 0], box[m, 0]), min(box[n, 1], box[m, 1])
                        box[n, 2], box[n, 3] = max(box[n, 2], box[m, 2]), max(box[n, 3], box[m, 3])


@kernel
def apart(corners: Floats, x0: float, y0: float, x1: float, y1: float) -> bool:
    """Returns whether a parallelogram (4, 2) and an upright rectangle whose boxes meet are apart, by the axes of the
    parallelogram."""
    for side in range(2):
        ax, ay = corners[side, 0], corners[side, 1]
        nx, ny = -(corners[side + 1, 1] - ay), corners[side + 1, 0] - ax
        far = nx * (corners[(side + 2) % 4, 0] - ax) + ny * (corners[(side + 2) % 4, 1] - ay)
        a, b = nx * (x0 - ax), nx * (x1 - ax)
        c, d = ny * (y0 - ay), ny * (y1 - ay)
        low, high = min(a, b) + min(c, d), max(a, b) + max(c, d)
        if high < min(0.0, far) or low > max(0.0, far):
            return True
    return False


@kernel
def _uniform_rim(
    found: Boxes,
    first: int,
    end: int,
    e: float,
    x0: float,
    y0: float,
    x1: float,
    y1: float,
    out: NDArray[np.int32],
    count: int,
) -> int:
    """Those of the patches first..end that :func:`uniform` looks for, behind ``count`` in ``out``; -1 for too many."""
    for k in range(first, end):
        b = found.box[k]
        outside = b[0] > x1 or b[2] < x0 or b[1] > y1 or b[3] < y0
        if outside or found.low[k] > e or e >= found.max_z[k] or apart(found.corners[k], x0, y0, x1, y1):
            continue
        if count == out.size:
            return -1
        out[count] = k
        count += 1
    return count


@kernel
def _push_below(t: Tree, s: int, j: int, i: int, stack: Ints, held: int) -> int:
    """Puts the up to four nodes below node (j, i) of scale s on a stack of (scale, j, i); returns how many it holds."""
    _, down, across = t.scale[s - 1]
    for y in range(2 * j, min(2 * j + 2, down)):
        for x in range(2 * i, min(2 * i + 2, across)):
            stack[held, 0], stack[held, 1], stack[held, 2] = s - 1, y, x
            held += 1
    return held


@kernel
def uniform(t: Tree, found: Boxes, e: float, x0: float, y0: float, x1: float, y1: float, out: NDArray[np.int32]) -> int:
    """Patches chosen at tolerance e whose domain meets a rectangle, into ``out``; returns how many, -1 for too many."""
    stack = np.empty((256, 3), np.int64)
    count = 0
    for layer in range(t.first.size - 1):
        top = t.first[layer + 1] - 1
        _, rows, cols = t.scale[top]
        for root in range(rows * cols):
            stack[0, 0], stack[0, 1], stack[0, 2] = top, root // cols, root % cols
            held = 1
            while held:
                held -= 1
                s, j, i = stack[held]
                node, _, wide = t.scale[s]
                n = node + j * wide + i
                if t.least[n] > e or t.most[n] <= e:
                    continue
                if t.box[n, 0] > x1 or t.box[n, 2] < x0 or t.box[n, 1] > y1 or t.box[n, 3] < y0:
                    continue
                k = t.patch[n]
                if k >= 0 and found.low[k] <= e and e < found.max_z[k]:
                    b = found.box[k]
                    outside = b[0] > x1 or b[2] < x0 or b[1] > y1 or b[3] < y0
                    if not outside and not apart(found.corners[k], x0, y0, x1, y1):
                        if count == out.size:
                            return -1
                        out[count] = k
                        count += 1
                if s == t.first[layer] and t.rim_at[layer] >= 0:
                    at = t.rim_at[layer] + n - node
                    count = _uniform_rim(found, t.rim[at], t.rim[at + 1], e, x0, y0, x1, y1, out, count)
                    if count < 0:
                        return -1
                if s > t.first[layer]:
                    held = _push_below(t, s, j, i, stack, held)
    return count


@kernel
def refined(
    t: Tree,
    chosen: NDArray[np.int32],
    owner: NDArray[np.int32],
    place: NDArray[np.int32],
    allowed: NDArray[np.int64],
    out: NDArray[np.int32],
) -> int:
    """``chosen``, with patches above scale ``allowed[layer]`` replaced by those of it in their kernels; how many.

    ``place``: int32 (n, 3), scale, j and i of every patch. A patch stays where the finer ones do not fill its kernel.
    """
    stack = np.empty((256, 3), np.int64)
    count = 0
    for at in range(chosen.size):
        layer = owner[chosen[at]]
        first = t.first[layer]
        if place[chosen[at], 0] < 0:  # of the rim: there is nothing finer
            if count == out.size:
                return -1
            out[count] = chosen[at]
            count += 1
            continue
        stack[0, 0], stack[0, 1], stack[0, 2] = place[chosen[at], 0], place[chosen[at], 1], place[chosen[at], 2]
        held = 1
        while held:
            held -= 1
            s, j, i = stack[held]
            node, _, wide = t.scale[first + s]
            begin = held
            finer = s > allowed[layer]
            if finer:
                under, down, across = t.scale[first + s - 1]
                for y in range(2 * j, min(2 * j + 2, down)):
                    for x in range(2 * i, min(2 * i + 2, across)):
                        finer = finer and t.patch[under + y * across + x] >= 0
                        stack[held, 0], stack[held, 1], stack[held, 2] = s - 1, y, x
                        held += 1
            if not finer:
                held = begin
                if count == out.size:
                    return -1
                out[count] = t.patch[node + j * wide + i]
                count += 1
    return count


@kernel
def view(
    t: Tree, found: Boxes, triangle: Floats, forward: Floats, slope: float, floor: float, out: NDArray[np.int32]
) -> int:
    """The safe cut for tolerance max(floor, slope * depth) over a triangle, into ``out``; returns how many, at most
    ``out.size``: if more are there, -1."""
    stack = np.empty((256, 3), np.int64)
    work = np.empty((4, MOST))
    corners = np.empty((4, 2))
    near = np.empty(4096, np.int32)
    layers, count = t.first.size - 1, 0
    for layer in range(layers):
        top = t.first[layer + 1] - 1
        _, rows, cols = t.scale[top]
        for root in range(rows * cols):
            stack[0, 0], stack[0, 1], stack[0, 2] = top, root // cols, root % cols
            held = 1
            while held:
                held -= 1
                s, j, i = stack[held]
                node, _, wide = t.scale[s]
                n = node + j * wide + i
                b = t.box[n]
                if b[0] > b[2]:
                    continue
                corners[0, 0], corners[0, 1], corners[1, 0], corners[1, 1] = b[0], b[1], b[2], b[1]
                corners[2, 0], corners[2, 1], corners[3, 0], corners[3, 1] = b[2], b[3], b[0], b[3]
                low, high = depths(corners, triangle, forward, work)
                if low > high:
                    continue
                k = t.patch[n]
                if k >= 0:
                    low, high = depths(found.corners[k], triangle, forward, work)
                    e = max(floor, slope * low)
                    if low <= high and found.low[k] <= e:
                        if (
                            layers == 1
                            or found.max_z[k] > e
                            or not _covered(t, found, k, triangle, forward, slope, floor, near, work)
                        ):
                            if count == out.size:
                                return -1
                            out[count] = k
                            count += 1
                        continue
                if s == t.first[layer] and t.rim_at[layer] >= 0:
                    at = t.rim_at[layer] + n - node
                    part = (t.rim[at], t.rim[at + 1])
                    count = _view_rim(t, found, part, triangle, forward, slope, floor, near, work, out, count)
                    if count < 0:
                        return -1
                if s > t.first[layer]:
                    held = _push_below(t, s, j, i, stack, held)
    return count


@kernel
def _view_rim(
    t: Tree,
    found: Boxes,
    part: tuple[int, int],
    triangle: Floats,
    forward: Floats,
    slope: float,
    floor: float,
    near: NDArray[np.int32],
    work: Floats,
    out: NDArray[np.int32],
    count: int,
) -> int:
    """Those of a part of the patches that :func:`view` takes, behind ``count`` in ``out``; -1 for too many."""
    for k in range(part[0], part[1]):
        low, high = depths(found.corners[k], triangle, forward, work)
        e = max(floor, slope * low)
        if low > high or found.low[k] > e:
            continue
        if found.max_z[k] <= e and _covered(t, found, k, triangle, forward, slope, floor, near, work):
            continue
        if count == out.size:
            return -1
        out[count] = k
        count += 1
    return count


@kernel
def _covered(
    t: Tree,
    found: Boxes,
    k: int,
    triangle: Floats,
    forward: Floats,
    slope: float,
    floor: float,
    near: NDArray[np.int32],
    work: Floats,
) -> bool:
    """Whether the patches that cover k's kernel at its ``max_z`` are all accurate enough in view. Too many: no."""
    q = found.kernel[k]
    x0, x1 = min(q[0, 0], q[1, 0], q[2, 0], q[3, 0]), max(q[0, 0], q[1, 0], q[2, 0], q[3, 0])
    y0, y1 = min(q[0, 1], q[1, 1], q[2, 1], q[3, 1]), max(q[0, 1], q[1, 1], q[2, 1], q[3, 1])
    count = uniform(t, found, found.max_z[k], x0, y0, x1, y1, near)
    for at in range(count):
        low, high = depths(found.corners[near[at]], triangle, forward, work)
        if low <= high and found.low[near[at]] > max(floor, slope * low):
            return False
    return count > 0
