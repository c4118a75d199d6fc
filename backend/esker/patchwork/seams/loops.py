"""The seam blend's compiled loops (see ``seam_blend``): tables of the differences along borders, and the correction
that they give.

A table is a ladder of levels of nodes, each RUNG times as far apart as those of the level below. Border points are
spread on the nodes of a level with cubic B-splines and read with them again: a kernel of variance 2/3 pitch^2 whatever
the places, since B-splines reproduce quadratics. Only blocks of nodes near the border are held.
Twin: ``reference``.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from esker.contract import PATCH_MARGIN_CELLS
from esker.patchwork.blend.jets import (
    Jet,
    Line,
    composed,
    product,
    quotient,
    rest,
    scaled,
    tensor,
    total,
    weights,
)
from esker.patchwork.blend.loops import BIN, columns, copy_bin, fade
from esker.patchwork.jit import kernel

Floats = NDArray[np.float64]

BLOCK: Final = 16
"""Cells a side that a block of nodes serves; it holds the three nodes more that their splines need."""
RUNG: Final = math.sqrt(2)
"""Pitch of a level in those of the one before. With 2 the ladder shows, as ripples around corners."""
PEAK: Final = 151 / 315
"""The kernel's value on a straight line of points of density 1: two cubic B-splines convolved, at 0."""
SPREAD: Final = 4 / 3
"""Twice its variance, in squares of the pitch."""
SOFT: Final = 0.1
"""Squares of the pitch over which squared distances are rounded off towards 0."""
NEAR: Final = 1.2
"""Squared distance from the border in pitches up to which a level is believed wholly."""
FAR: Final = 4.8
"""Squared distance from the border in pitches from which on a level is not believed at all."""
LEAST: Final = PEAK * math.exp(-FAR / SPREAD)
"""The kernel's value at ``FAR``."""
RUN: Final = 5.0
"""Metres over which a metre of difference is faded out: no steeper than 1 in 2.9."""
MOST_LAYERS: Final = 1 << 30
"""A number above any count of layers."""
AGREED: Final = 0.25
"""Cells of the newer layer up to which a difference is none; from twice as many on it is blended wholly."""


class Tables(NamedTuple):
    """Differences along the borders of z layers, as nodes; flat, so that compiled loops take them whole.

    Per layer: ``above`` its place in the order of precedence; ``cell`` and ``cap`` metres; its reach: ``wide`` metres
    the side of a cell, ``reach`` int64 (z, 5) first column and row, columns, rows, and where its part of ``held``
    begins, row by row: whether anything may be corrected in the cell; ``ladder`` int64 (z + 1,) where its levels begin.
    Per level: ``pitch`` metres; ``corner`` int64 (levels, 4) first block column and row, columns, rows; ``chart`` int64
    where its part of ``blocks`` begins: the block at each place, row by row, -1 for none. ``nodes`` float32 (blocks,
    19, 19, 2): density of the border, and of the border times difference; ``dense`` (blocks, 16, 16) whether the level
    may be believed in a cell at all.
    """

    above: NDArray[np.int32]
    cell: Floats
    cap: Floats
    wide: Floats
    reach: NDArray[np.int64]
    held: NDArray[np.bool_]
    ladder: NDArray[np.int64]
    pitch: Floats
    corner: NDArray[np.int64]
    chart: NDArray[np.int64]
    blocks: NDArray[np.int32]
    nodes: NDArray[np.float32]
    dense: NDArray[np.bool_]


@kernel
def dense_cells(nodes: NDArray[np.float32], dense: NDArray[np.bool_]) -> None:
    """Cells in which the density may be more than LEAST: a spline leaves the range of its nodes nowhere."""
    for k in range(len(nodes)):
        for row in range(BLOCK):
            for col in range(BLOCK):
                most = np.float32(0)
                for m in range(4):
                    for n in range(4):
                        most = max(most, nodes[k, row + m, col + n, 0])
                dense[k, row, col] = most > LEAST * (1 - 1e-6)


@kernel
def mark(points: Floats, pitch: float, corner: NDArray[np.int64], blocks: NDArray[np.int32]) -> int:
    """Number the blocks (0, 1, ... in ``blocks``, else -1) that hold nodes of some point; how many there are."""
    cols = corner[2]
    for k in range(len(points)):
        i, j = int(np.floor(points[k, 0] / pitch)) - 1, int(np.floor(points[k, 1] / pitch)) - 1
        for bj in range((j - 3) // BLOCK, (j + 3) // BLOCK + 1):
            for bi in range((i - 3) // BLOCK, (i + 3) // BLOCK + 1):
                blocks[(bj - corner[1]) * cols + bi - corner[0]] = 0
    count = 0
    for k in range(len(blocks)):
        if blocks[k] == 0:
            blocks[k] = count
            count += 1
    return count


@kernel
def scatter(
    points: Floats,
    weight: Floats,
    difference: Floats,
    pitch: float,
    corner: NDArray[np.int64],
    blocks: NDArray[np.int32],
    nodes: Floats,
) -> None:
    """Spread points with weights in metres on the nodes of the blocks that ``mark`` numbered."""
    for k in range(len(points)):
        u, v = points[k, 0] / pitch, points[k, 1] / pitch
        i, j = int(np.floor(u)) - 1, int(np.floor(v)) - 1
        a, b = weights(u - i - 1), weights(v - j - 1)
        for bj in range((j - 3) // BLOCK, (j + 3) // BLOCK + 1):
            for bi in range((i - 3) // BLOCK, (i + 3) // BLOCK + 1):
                block = nodes[blocks[(bj - corner[1]) * corner[2] + bi - corner[0]]]
                for m in range(4):
                    row = j + m - bj * BLOCK
                    if row < 0 or row >= BLOCK + 3:
                        continue
                    for n in range(4):
                        col = i + n - bi * BLOCK
                        if 0 <= col < BLOCK + 3:
                            w = weight[k] / pitch * a[n][0] * b[m][0]
                            block[row, col, 0] += w
                            block[row, col, 1] += w * difference[k]


@kernel
def _block(t: Tables, level: int, x: float, y: float) -> tuple[int, int, int, float, float]:
    """Block (-1: none), first node's row and column in it, and the place in its cell."""
    u, v = x / t.pitch[level], y / t.pitch[level]
    i, j = int(np.floor(u)) - 1, int(np.floor(v)) - 1
    bi, bj = i // BLOCK - t.corner[level, 0], j // BLOCK - t.corner[level, 1]
    if bi < 0 or bj < 0 or bi >= t.corner[level, 2] or bj >= t.corner[level, 3]:
        return -1, 0, 0, 0.0, 0.0
    block = t.blocks[t.chart[level] + bj * t.corner[level, 2] + bi]
    return block, j - j // BLOCK * BLOCK, i - i // BLOCK * BLOCK, u - i - 1, v - j - 1


@kernel
def _values(f: float) -> tuple[float, float, float, float]:
    g = 1 - f
    return g * g * g / 6, 2 / 3 - f * f * (1 - f / 2), 2 / 3 - g * g * (1 - g / 2), f * f * f / 6


@kernel
def _step(t: float) -> Line:
    """Quintic step from 0 to 1 and its derivatives, at t."""
    if t <= 0:
        return 0.0, 0.0, 0.0
    if t >= 1:
        return 1.0, 0.0, 0.0
    return t * t * t * (t * (6 * t - 15) + 10), 30 * t * t * (1 - t) * (1 - t), 60 * t * (1 - t) * (1 - 2 * t)


@kernel
def mean_and_square(t: Tables, z: int, x: float, y: float) -> tuple[float, float]:
    """The border's mean difference as seen from a place, metres, and the squared distance to it, inf far from it."""
    left, difference, square = 1.0, 0.0, 0.0
    for level in range(t.ladder[z], t.ladder[z + 1]):
        k, row, col, f, g = _block(t, level, x, y)
        if k < 0 or not t.dense[k, row, col]:
            continue
        a, b = _values(f), _values(g)
        density, moment = 0.0, 0.0
        for m in range(4):
            for n in range(4):
                w = b[m] * a[n]
                density += w * t.nodes[k, row + m, col + n, 0]
                moment += w * t.nodes[k, row + m, col + n, 1]
        if density <= LEAST:
            continue
        q = -SPREAD * math.log(density / PEAK)
        believed = left * _step((FAR - q) / (FAR - NEAR))[0]
        difference += believed * (moment / density)
        square += believed * (q + math.sqrt(q * q + SOFT * SOFT)) / 2 * t.pitch[level] ** 2
        left -= believed
        if left <= 0:
            break
    if left >= 1:
        return 0.0, np.inf
    return difference / (1 - left), square + left * FAR * t.pitch[t.ladder[z + 1] - 1] ** 2


@kernel
def _in_reach(t: Tables, z: int, x: float, y: float) -> bool:
    """Returns whether the cell of a layer's reach that a place lies in is held."""
    i, j = int(np.floor(x / t.wide[z])) - t.reach[z, 0], int(np.floor(y / t.wide[z])) - t.reach[z, 1]
    if i < 0 or j < 0 or i >= t.reach[z, 2] or j >= t.reach[z, 3]:
        return False
    return bool(t.held[t.reach[z, 4] + j * t.reach[z, 2] + i])


@kernel
def reach_cells(t: Tables, far: float, held: NDArray[np.bool_]) -> None:
    """Finds which cells of layer 0's reach are no farther from its border than ``far`` metres, measured from their
    middles."""
    wide, cols = t.wide[0], t.reach[0, 2]
    limit = (far + 1.5 * wide) ** 2
    for k in range(len(held)):
        x, y = (t.reach[0, 0] + k % cols + 0.5) * wide, (t.reach[0, 1] + k // cols + 0.5) * wide
        held[k] = mean_and_square(t, 0, x, y)[1] < limit


@kernel
def correction(t: Tables, z: int, x: float, y: float) -> float:
    """Correction of layer ``z`` at a place, metres."""
    if not _in_reach(t, z, x, y):
        return 0.0
    difference, square = mean_and_square(t, z, x, y)
    size, least = abs(difference), t.cell[z] * AGREED
    if size <= least:
        return 0.0
    s = 1 - square * (1 / (RUN * RUN * size * size) + 1 / (t.cap[z] * t.cap[z]))
    return difference * _step(size / least - 1)[0] * (s * s * s) if s > 0 else 0.0


@kernel
def correction_jet(t: Tables, z: int, x: float, y: float) -> Jet:
    """``correction`` and its derivatives."""
    zero = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    if not _in_reach(t, z, x, y):
        return zero
    left, difference, square = (1.0, 0.0, 0.0, 0.0, 0.0, 0.0), zero, zero
    for level in range(t.ladder[z], t.ladder[z + 1]):
        k, row, col, f, g = _block(t, level, x, y)
        if k < 0 or not t.dense[k, row, col]:
            continue
        density, moment = _node_jets(t, k, row, col, f, g, 1 / t.pitch[level])
        if density[0] <= LEAST:
            continue
        over = 1 / density[0]
        logarithm = (math.log(density[0] / PEAK), over, -over * over)
        q = scaled(composed(density, logarithm), -SPREAD)
        step = _step((FAR - q[0]) / (FAR - NEAR))
        per = -1 / (FAR - NEAR)
        believed = product(left, composed(q, (step[0], step[1] * per, step[2] * per * per)))
        root = math.sqrt(q[0] * q[0] + SOFT * SOFT)
        soft = ((q[0] + root) / 2, (1 + q[0] / root) / 2, SOFT * SOFT / (2 * root * root * root))
        difference = total(difference, product(believed, quotient(moment, density)))
        square = total(square, scaled(product(believed, composed(q, soft)), t.pitch[level] ** 2))
        left = total(left, scaled(believed, -1.0))
        if left[0] <= 0:
            break
    if left[0] >= 1:
        return zero
    square = total(square, scaled(left, FAR * t.pitch[t.ladder[z + 1] - 1] ** 2))
    difference = quotient(difference, rest(left))
    least = t.cell[z] * AGREED
    if abs(difference[0]) <= least:
        return zero
    return _faded(difference, square, least, 1 / (t.cap[z] * t.cap[z]))


@kernel
def _faded(d: Jet, square: Jet, least: float, per_cap: float) -> Jet:
    """The difference ``d`` at squared distance ``square`` from the border, faded out over its reach."""
    size, sign = abs(d[0]), 1.0 if d[0] > 0 else -1.0
    run = 1 / (RUN * RUN * size * size)
    share = composed(d, (run + per_cap, -2 * sign * run / size, 6 * run / (size * size)))
    s = rest(product(square, share))
    if s[0] <= 0:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    step = _step(size / least - 1)
    onset = composed(d, (step[0], sign * step[1] / least, step[2] / (least * least)))
    return product(product(d, onset), composed(s, (s[0] ** 3, 3 * s[0] * s[0], 6 * s[0])))


@kernel
def _node_jets(t: Tables, k: int, row: int, col: int, f: float, g: float, per: float) -> tuple[Jet, Jet]:
    """Density and moment at a place of a block's cell."""
    a, b = weights(f), weights(g)
    density, moment = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for m in range(4):
        for n in range(4):
            w = tensor((a[n][0], a[n][1] * per, a[n][2] * per * per), (b[m][0], b[m][1] * per, b[m][2] * per * per))
            density = total(density, scaled(w, t.nodes[k, row + m, col + n, 0]))
            moment = total(moment, scaled(w, t.nodes[k, row + m, col + n, 1]))
    return density, moment


@kernel
def corrections(t: Tables, z: int, points: Floats, out: Floats) -> None:
    """Add the corrections of layer ``z`` at points (n, 2) to ``out`` (n,)."""
    for k in range(len(points)):
        out[k] += correction(t, z, points[k, 0], points[k, 1])


@kernel
def correction_jets(t: Tables, place: int, points: Floats, first: int, last: int, out: Floats) -> None:
    """Corrections of the ground of the layer at ``place`` in the order of precedence: jets (n, 6) at points
    first..last."""
    for k in range(first, last):
        jet = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        for z in range(len(t.above)):
            if t.above[z] > place:
                jet = total(jet, correction_jet(t, z, points[k, 0], points[k, 1]))
        for c in range(6):
            out[k, c] = jet[c]


@kernel
def _touches(t: Tables, z: int, x0: float, y0: float, x1: float, y1: float) -> bool:
    """Returns whether layer ``z`` may correct something in a rectangle."""
    wide, part = t.wide[z], t.reach[z]
    i0, i1 = max(int(np.floor(x0 / wide)) - part[0], 0), min(int(np.floor(x1 / wide)) - part[0], part[2] - 1)
    j0, j1 = max(int(np.floor(y0 / wide)) - part[1], 0), min(int(np.floor(y1 / wide)) - part[1], part[3] - 1)
    for j in range(j0, j1 + 1):
        for i in range(i0, i1 + 1):
            if t.held[part[4] + j * part[2] + i]:
                return True
    return False


@kernel
def _lay(
    t: Tables,
    lowest: int,
    r0: int,
    c0: int,
    spacing: float,
    on: NDArray[np.bool_],
    bin_corrections: NDArray[np.float32],
) -> bool:
    """Corrections on the bin at sample [r0, c0] by layers above place ``lowest``: ``on[z]`` whether by layer z, and
    ``bin_corrections[z]``."""
    some = False
    for z in range(len(t.above)):
        on[z] = False
        if t.above[z] <= lowest:
            continue
        if not _touches(t, z, c0 * spacing, r0 * spacing, (c0 + BIN - 1) * spacing, (r0 + BIN - 1) * spacing):
            continue
        for row in range(BIN):
            for col in range(BIN):
                # Multiples of the spacing, not steps from the bin's corner: a place has the same bits on all levels.
                found = np.float32(correction(t, z, (c0 + col) * spacing, (r0 + row) * spacing))
                bin_corrections[z, row, col] = found
                on[z] |= found != 0
        some |= on[z]
    return some


@kernel
def correct_bins(
    start: NDArray[np.int32],
    patch: NDArray[np.int32],
    origin: NDArray[np.float32],
    step: NDArray[np.float32],
    constants: NDArray[np.float32],
    rank: NDArray[np.int32],
    place: NDArray[np.int32],
    smooth: bool,
    t: Tables,
    spacing: float,
    corner: tuple[int, int],
    cols: int,
    first: int,
    last: int,
    out: NDArray[np.float32],
) -> None:
    """Sum W v / sum W on bins ``first`` to ``last`` of a lattice with ``cols`` bins a row from bin ``corner`` on.

    W are the weights of ``smooth_bins`` (``linear_bins``), v the corrections of the ground of the patch's layer, whose
    place in the order of precedence is ``place``. ``out`` float32, 0 where nothing is corrected.
    """
    margin = np.float32(1.0 / PATCH_MARGIN_CELLS)
    above, below = np.empty((BIN, BIN), np.float32), np.empty((BIN, BIN), np.float32)
    bare, veil = np.empty((BIN, BIN), np.float32), np.empty((BIN, BIN), np.float32)
    v_of, on = np.empty((BIN, BIN), np.float32), np.empty(len(t.above), np.bool_)
    bin_corrections = np.empty((len(t.above), BIN, BIN), np.float32)
    for at in range(first, last):
        top, left = at // cols * BIN, at % cols * BIN
        lowest = MOST_LAYERS
        for entry in range(start[at], start[at + 1]):
            lowest = min(lowest, int(place[patch[entry]]))
        if not _lay(t, lowest, corner[0] * BIN + top, corner[1] * BIN + left, spacing, on, bin_corrections):
            out[top : top + BIN, left : left + BIN] = 0
            continue
        above[:], below[:], bare[:], veil[:] = 0, 0, 1, 1
        held = np.int32(-1)
        for entry in range(start[at], start[at + 1]):
            k = patch[entry]
            if entry > start[at] and rank[k] != rank[patch[entry - 1]]:
                copy_bin(bare, veil)
            if place[k] != held:
                held = place[k]
                v_of[:] = 0
                for z in range(len(on)):
                    if on[z] and t.above[z] > held:
                        v_of += bin_corrections[z]
            _add_patch(origin[entry], step[k], constants[k], smooth, margin, v_of, veil, above, below, bare)
        for row in range(BIN):
            for col in range(BIN):
                known = below[row, col] > 0
                out[top + row, left + col] = above[row, col] / below[row, col] if known else np.float32(0)


@kernel
def _add_patch(
    origin: NDArray[np.float32],
    step: NDArray[np.float32],
    constants: NDArray[np.float32],
    smooth: bool,
    margin: np.float32,
    v_of: NDArray[np.float32],
    veil: NDArray[np.float32],
    above: NDArray[np.float32],
    below: NDArray[np.float32],
    bare: NDArray[np.float32],
) -> None:
    """Add the weights of one patch in a bin."""
    one, three, zero = np.float32(1), np.float32(3), np.float32(0)
    mid_u, mid_v, per_u, per_v, ku0, ku1, kv0, kv1, volume = constants
    du, dv = step[0], step[1]
    for row in range(BIN):
        u_row, v_row = origin[0] + step[2] * np.float32(row), origin[1] + step[3] * np.float32(row)
        begin, done = columns(u_row, v_row, du, dv, constants)
        for col in range(begin, done):
            u, v = u_row + du * np.float32(col), v_row + dv * np.float32(col)
            tu, tv = abs(u - mid_u) * per_u, abs(v - mid_v) * per_v
            su, sv = max(one - tu, zero), max(one - tv, zero)
            weight = su * sv * volume
            if smooth:
                weight *= su * su * (three * tu + one) * (sv * sv * (three * tv + one))
            weight *= veil[row, col]
            above[row, col] += weight * v_of[row, col]
            below[row, col] += weight
            bare[row, col] *= one - fade(max(ku0 - u, u - ku1) * margin) * fade(max(kv0 - v, v - kv1) * margin)
