"""The index of paper 2, section 4.2: a quadtree whose nodes list the 64 boxes with the highest tops.

A node holds those live patches whose domain's box meets it, that no node above it holds, with the greatest ``max_z``;
the rest go down to each child that they meet. A query reads a node's list from its top down to its tolerance, and goes
down only from nodes whose whole list lies above it. Kept beside the nested pyramids (``pyramid_index``) to be measured
against them: it needs no nesting, but patches stand in several nodes, and large ones are met again in each.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from esker.patchwork.jit import kernel
from esker.patchwork.lod.space import Model
from esker.patchwork.query.pyramid_index import Boxes, apart, boxes

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

CAPACITY: Final = 64
"""Boxes of a node (the paper's threshold t)."""
_DEEPEST: Final = 20
"""Levels of the tree at most: in the last one nodes hold whatever meets them."""


class Nodes(NamedTuple):
    """``box`` float64 (nodes, 4) x0, y0, x1, y1; ``child`` int64 (nodes,): the first of four, -1 for a leaf; patches
    of node n, by falling ``max_z``: ``patch[start[n]:start[n + 1]]``."""

    box: Floats
    child: Ints
    start: Ints
    patch: NDArray[np.int32]


class QuadtreeIndex:
    """Uniform queries by the paper's quadtree; answers as ``query.Index``."""

    def __init__(self, model: Model) -> None:
        self.model, self.boxes = model, boxes(model)
        alive = np.flatnonzero(model.low < model.max_z)
        self.nodes = _built(self.boxes, alive[np.argsort(-model.max_z[alive], kind="stable")])

    @property
    def copies(self) -> float:
        """Nodes that a live patch stands in, on average (paper 2: below two)."""
        alive = int(np.count_nonzero(self.model.low < self.model.max_z))
        return len(self.nodes.patch) / alive if alive else 0.0

    def uniform(self, e: float, rect: tuple[float, float, float, float] | None = None) -> NDArray[np.int32]:
        """Patches chosen at tolerance e metres: all, or those whose domain meets a rectangle."""
        if self.model.count == 0:
            return np.zeros(0, dtype=np.int32)
        x0, y0, x1, y1 = rect or (-np.inf, -np.inf, np.inf, np.inf)
        out = np.empty(self.model.count, dtype=np.int32)
        seen = np.zeros(self.model.count, dtype=np.bool_)
        return out[: _uniform(self.nodes, self.boxes, e, x0, y0, x1, y1, rect is not None, seen, out)].copy()


def _built(found: Boxes, order: Ints) -> Nodes:
    """The tree over patches in order of falling tops: none that comes later displaces one from its node."""
    if len(order) == 0:
        return Nodes(np.zeros((0, 4)), np.zeros(0, np.int64), np.zeros(1, np.int64), np.zeros(0, np.int32))
    box = found.box[order]
    low, high = box[:, :2].min(axis=0), box[:, 2:].max(axis=0)
    side = float((high - low).max())
    squares, children, lists = [(low[0], low[1], low[0] + side, low[1] + side)], [-1], []
    waiting = [(0, 0, order)]
    held: dict[int, Ints] = {}
    while waiting:
        node, depth, those = waiting.pop()
        kept = those if depth == _DEEPEST else those[:CAPACITY]
        held[node] = kept
        rest = those[len(kept) :]
        if len(rest) == 0:
            continue
        children[node] = len(squares)
        x0, y0, x1, y1 = squares[node]
        mx, my = (x0 + x1) / 2, (y0 + y1) / 2
        b = found.box[rest]
        for square in ((x0, y0, mx, my), (mx, y0, x1, my), (x0, my, mx, y1), (mx, my, x1, y1)):
            meets = (b[:, 0] <= square[2]) & (b[:, 2] >= square[0]) & (b[:, 1] <= square[3]) & (b[:, 3] >= square[1])
            waiting.append((len(squares), depth + 1, rest[meets]))
            squares.append(square)
            children.append(-1)
    lists = [held[node] for node in range(len(squares))]
    start = np.concatenate([[0], np.cumsum([len(those) for those in lists])]).astype(np.int64)
    return Nodes(np.array(squares), np.array(children, np.int64), start, np.concatenate(lists).astype(np.int32))


@kernel
def _uniform(
    t: Nodes,
    found: Boxes,
    e: float,
    x0: float,
    y0: float,
    x1: float,
    y1: float,
    bounded: bool,
    seen: NDArray[np.bool_],
    out: NDArray[np.int32],
) -> int:
    stack = np.empty(4 * (_DEEPEST + 1), np.int64)
    held, count = 1, 0
    stack[0] = 0
    while held:
        held -= 1
        n = stack[held]
        b = t.box[n]
        if b[0] > x1 or b[2] < x0 or b[1] > y1 or b[3] < y0:
            continue
        whole = True
        for at in range(t.start[n], t.start[n + 1]):
            k = t.patch[at]
            if found.max_z[k] <= e:
                whole = False
                break
            if found.low[k] > e or seen[k]:
                continue
            p = found.box[k]
            if bounded and (
                p[0] > x1 or p[2] < x0 or p[1] > y1 or p[3] < y0 or apart(found.corners[k], x0, y0, x1, y1)
            ):
                continue
            seen[k] = True
            out[count] = k
            count += 1
        if whole and t.child[n] >= 0:
            for c in range(4):
                stack[held] = t.child[n] + c
                held += 1
    return count
