"""Queries of LOD space (paper 2, sections 3.3 and 5.1): which patches stand for the ground at a tolerance.

Uniform queries without a region are answered from two lists, of live patches by their least tolerance and by their
greatest: the shorter of what the two leave is looked through. All else walks the nested pyramids (``pyramid_index``),
which was found the better of the two indexes: ``quadtree_index`` is the paper's, kept to be measured against.

Every answer is an int32 array of patches of the model, in no particular order.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from esker.patchwork.blend.lattice import layer_number
from esker.patchwork.jit import kernel
from esker.patchwork.lod.space import Model
from esker.patchwork.query import pyramid_index
from esker.patchwork.raster import patches

Floats = NDArray[np.float64]
Chosen = NDArray[np.int32]
Rect = tuple[float, float, float, float]
"""x0, y0, x1, y1 in metres."""


class View(NamedTuple):
    """What is seen from a place, as the plane of paper 2, section 5.1: error allowed = ``slope`` * depth, and at least
    ``floor`` metres, over the triangle that ends ``far`` metres ahead.

    ``eye``: x, y in metres. ``heading``: radians, counter-clockwise from east. ``half_angle``: half the horizontal
    field of view, radians, below a right angle.
    """

    eye: tuple[float, float]
    heading: float
    half_angle: float
    far: float
    slope: float
    floor: float = 0.0

    def triangle(self) -> Floats:
        """float64 (3, 2), counter-clockwise from the eye."""
        ahead, aside = self.forward() * self.far, self.far * math.tan(self.half_angle)
        side = np.array([-math.sin(self.heading), math.cos(self.heading)]) * aside
        eye = np.array(self.eye, dtype=np.float64)
        return np.stack([eye, eye + ahead - side, eye + ahead + side])

    def forward(self) -> Floats:
        """Unit vector (2,)."""
        return np.array([math.cos(self.heading), math.sin(self.heading)])

    def tolerance(self, points: Floats) -> Floats:
        """Error allowed at places (n, 2), metres."""
        return np.asarray(np.maximum((points - np.array(self.eye)) @ self.forward() * self.slope, self.floor))


def slope(pixels: float, height_px: float, field_of_view: float) -> float:
    """Metres of height error a metre of depth that show as ``pixels`` on a screen: paper 2, section 5.1.

    ``field_of_view``: vertical, radians. Raises ValueError for what is no screen.
    """
    if not (pixels > 0 and height_px > 0 and 0 < field_of_view < math.pi):
        raise ValueError("pixels, height and field of view must be positive, the last below 180 degrees")
    return pixels * 2 * math.tan(field_of_view / 2) / height_px


class Surface(Protocol):
    """A tolerance that varies over a region: the surface that LOD space is cut with."""

    def lowest(self, boxes: Floats) -> Floats:
        """A lower bound (n,) of the tolerance, metres, in boxes (n, 4); inf where one misses the region."""


class Bounded:
    """A tolerance over a rectangle, given by a function that bounds it from below on boxes (n, 4) -> (n,)."""

    def __init__(self, rect: Rect, lowest: Callable[[Floats], Floats]) -> None:
        self.rect, self._lowest = rect, lowest

    def lowest(self, boxes: Floats) -> Floats:
        """See ``Surface``."""
        x0, y0, x1, y1 = self.rect
        cut = np.stack([np.maximum(boxes[:, 0], x0), np.maximum(boxes[:, 1], y0),
                        np.minimum(boxes[:, 2], x1), np.minimum(boxes[:, 3], y1)], axis=1)  # fmt: skip
        empty = (cut[:, 0] > cut[:, 2]) | (cut[:, 1] > cut[:, 3])
        out = np.full(len(boxes), np.inf)
        out[~empty] = self._lowest(cut[~empty])
        return out


class Sampled(Bounded):
    """A tolerance given by samples (rows, cols) over a rectangle, its corners included; bilinear between them."""

    def __init__(self, rect: Rect, tolerance: NDArray[np.floating]) -> None:
        super().__init__(rect, self._least)
        values = np.asarray(tolerance, dtype=np.float64)
        if values.ndim != 2 or min(values.shape) < 2 or not (values >= 0).all():
            raise ValueError("tolerances must be a grid of 2 x 2 samples or more, none below 0")
        if not (rect[2] > rect[0] and rect[3] > rect[1]):
            raise ValueError("a region must have some width and height")
        cells = np.minimum(np.minimum(values[1:, 1:], values[1:, :-1]), np.minimum(values[:-1, 1:], values[:-1, :-1]))
        # Least of 2^a x 2^b cells from each place on: any box is the least of four such, overlapping.
        self._tables = [[cells]]
        for a in range(cells.shape[0].bit_length()):
            if a:
                self._tables.append([_least(self._tables[a - 1][0], 1 << (a - 1), 0)])
            for b in range(1, cells.shape[1].bit_length()):
                self._tables[a].append(_least(self._tables[a][b - 1], 1 << (b - 1), 1))
        self._shape = cells.shape

    def _least(self, boxes: Floats) -> Floats:
        x0, y0, x1, y1 = self.rect
        tall, wide = self._shape
        scale = np.array([wide / (x1 - x0), tall / (y1 - y0)])
        low = np.floor((boxes[:, :2] - (x0, y0)) * scale - 1e-9).astype(np.int64)
        high = np.floor((boxes[:, 2:] - (x0, y0)) * scale + 1e-9).astype(np.int64)
        c0, r0 = np.clip(low, 0, (wide - 1, tall - 1)).T
        c1, r1 = np.clip(high, 0, (wide - 1, tall - 1)).T
        a, b = (np.log2(n).astype(np.int64) for n in (r1 - r0 + 1, c1 - c0 + 1))
        out = np.empty(len(boxes))
        for pair in set(zip(a.tolist(), b.tolist(), strict=True)):
            k = (a == pair[0]) & (b == pair[1])
            table, back, left = self._tables[pair[0]][pair[1]], r1[k] + 1 - (1 << pair[0]), c1[k] + 1 - (1 << pair[1])
            out[k] = np.minimum(np.minimum(table[r0[k], c0[k]], table[back, c0[k]]),
                                np.minimum(table[r0[k], left], table[back, left]))  # fmt: skip
        return out


def _least(values: Floats, step: int, axis: int) -> Floats:
    a = values[:-step] if axis == 0 else values[:, :-step]
    b = values[step:] if axis == 0 else values[:, step:]
    return np.minimum(a, b)


class Index:
    """The arrays that queries of one model need.

    Immutable; ``updated`` makes those of a changed model and keeps what stayed.
    """

    def __init__(self, model: Model) -> None:
        self.model = model
        self.boxes = pyramid_index.boxes(model)
        self.tree = pyramid_index.tree(model, self.boxes)
        alive = np.flatnonzero(model.low < model.max_z).astype(np.int32)
        self._by_low = alive[np.argsort(model.low[alive], kind="stable")]
        self._by_top = alive[np.argsort(-model.max_z[alive], kind="stable")]
        self._columns()
        self._places()

    def _columns(self) -> None:
        low, top = self.model.low, self.model.max_z
        self._low, self._low_top = low[self._by_low], top[self._by_low]
        self._least_top = np.minimum.accumulate(self._low_top)
        self._top, self._top_low = -top[self._by_top], low[self._by_top]

    def _places(self) -> None:
        layers = self.model.layers
        self._place = np.zeros((self.model.count, 3), dtype=np.int32)
        for start, held in zip(self.model.first, layers, strict=True):
            part = self._place[start : start + held.count]
            part[:, 0], part[:, 1], part[:, 2] = held.scale, held.j, held.i
        self._steps = np.array([max(p.layer.spacing_m) for p in self.model.placed])

    def updated(self, model: Model) -> Index:
        """The index of another model, from this one: what layers that stayed have is taken over. Equal to a new one."""
        if model is self.model:
            return self
        new = object.__new__(Index)
        new.model = model
        now, then = _shared(model, self.model)
        new.boxes = pyramid_index.boxes(model, self.boxes, (now, then))
        new.tree = pyramid_index.tree(model, new.boxes)
        stays = (model.low[now] == self.model.low[then]) & (model.max_z[now] == self.model.max_z[then])
        place = np.full(self.model.count, -1, dtype=np.int32)
        place[then[stays]] = now[stays]
        fresh = np.ones(model.count, dtype=bool)
        fresh[now[stays]] = False
        come = np.flatnonzero(fresh & (model.low < model.max_z)).astype(np.int32)
        new._by_low = _merged(place[self._by_low], come, model.low)
        new._by_top = _merged(place[self._by_top], come, -model.max_z)
        new._columns()
        new._places()
        return new

    def uniform(self, e: float, rect: Rect | None = None) -> Chosen:
        """Patches chosen at tolerance e metres: all, or those whose domain meets a rectangle."""
        if self.model.count == 0:
            return np.zeros(0, dtype=np.int32)
        if rect is not None:
            out = np.empty(self.model.count, dtype=np.int32)
            return out[: pyramid_index.uniform(self.tree, self.boxes, e, *rect, out)].copy()
        accurate = int(self._low.searchsorted(e, "right"))
        needed = int(self._top.searchsorted(-e))
        if accurate == 0 or self._least_top[accurate - 1] > e:  # all that are accurate enough are needed, too
            return self._by_low[:accurate].copy()
        if accurate <= needed:
            return _above(self._by_low[:accurate], self._low_top, e)
        return _below(self._by_top[:needed], self._top_low, e)

    def resolved(self, spacing_m: float, e: float, rect: Rect) -> Chosen:
        """What shows the ground to samples ``spacing_m`` metres apart, in a rectangle: the patches chosen at tolerance
        e, those whose own samples are farther apart than that replaced by finer ones of their layer, down to the data.

        So a layer's data is shown as it is where samples are as close as it, whatever other layers there are. Patches
        of rims that none of the samples [row, col] * spacing lies in are left out: coarse levels need few of them.
        """
        chosen = self._met(self.uniform(e, rect), spacing_m)
        if len(chosen) == 0:
            return chosen
        finest = np.floor(np.log2(np.maximum(spacing_m / self._steps, 1.0)) + 1e-9).astype(np.int64)
        allowed = finest + patches.SMALL_SCALES
        room = 4 * len(chosen) + 64
        while True:
            out = np.empty(room, dtype=np.int32)
            count = pyramid_index.refined(self.tree, chosen, self.model.owner, self._place, allowed, out)
            if count >= 0:
                return out[:count].copy()
            room *= 4

    def _met(self, chosen: Chosen, spacing_m: float) -> Chosen:
        """Patches less those of rims that lie between the samples of a lattice, by a cell at least."""
        rim = self._place[chosen, 0] == patches.RIM
        if not rim.any():
            return chosen
        some = chosen[rim]
        box, more = self.boxes.box[some], self._steps[self.model.owner[some], None]
        first, last = np.ceil((box[:, :2] - more) / spacing_m), np.floor((box[:, 2:] + more) / spacing_m)
        keep = np.ones(len(chosen), dtype=bool)
        keep[rim] = (first <= last).all(axis=1)
        return chosen[keep]

    def view(self, view: View) -> Chosen:
        """The safe cut of a view: every place in its triangle is covered, by patches that are accurate enough wherever
        they are seen; below a place's best accuracy by the best there is."""
        room = 4096
        while self.model.count:
            out = np.empty(room, dtype=np.int32)
            count = pyramid_index.view(
                self.tree, self.boxes, view.triangle(), view.forward(), view.slope, view.floor, out
            )
            if count >= 0:
                return out[:count].copy()
            room *= 4
        return np.zeros(0, dtype=np.int32)

    def region(self, surface: Surface) -> Chosen:
        """The safe cut of any surface, as ``view``: scale by scale."""
        chosen = []
        for layer in range(len(self.model.placed)):
            chosen += self._walk(layer, surface)
        found = np.concatenate(chosen) if chosen else np.zeros(0, dtype=np.int32)
        return found if len(self.model.placed) < 2 else self._needed(found, surface)

    def _walk(self, layer: int, surface: Surface) -> list[Chosen]:
        """The coarsest patches of a layer that are accurate enough."""
        t, found = self.tree, []
        bottom, top = int(t.first[layer]), int(t.first[layer + 1]) - 1
        nodes = np.arange(t.scale[top, 1] * t.scale[top, 2])
        for s in range(top, bottom - 1, -1):
            base, _, cols = t.scale[s]
            box = t.box[base + nodes]
            nodes = nodes[box[:, 0] <= box[:, 2]]
            nodes = nodes[np.isfinite(surface.lowest(t.box[base + nodes]))]
            patch = t.patch[base + nodes]
            there = np.flatnonzero(patch >= 0)
            lowest = surface.lowest(self.boxes.box[patch[there]])
            safe = there[(self.model.low[patch[there]] <= lowest) & np.isfinite(lowest)]
            found.append(patch[safe])
            rest = np.ones(len(nodes), dtype=bool)
            rest[safe] = False
            if s == bottom:
                found.append(self._safe_rim(layer, nodes[rest], surface))
                break
            j, i = np.divmod(nodes[rest], cols)
            _, down, across = t.scale[s - 1]
            y = (2 * j[:, None] + [0, 0, 1, 1]).ravel()
            x = (2 * i[:, None] + [0, 1, 0, 1]).ravel()
            inside = (y < down) & (x < across)
            nodes = y[inside] * across + x[inside]
        return found

    def _safe_rim(self, layer: int, nodes: NDArray[np.int64], surface: Surface) -> Chosen:
        """The patches of the rim below nodes of the lowest scale that are accurate enough."""
        at = int(self.tree.rim_at[layer])
        if at < 0:
            return np.zeros(0, dtype=np.int32)
        start, stop = self.tree.rim[at + nodes], self.tree.rim[at + nodes + 1]
        count = stop - start
        patch = np.repeat(start - np.cumsum(count) + count, count) + np.arange(count.sum())
        lowest = surface.lowest(self.boxes.box[patch])
        safe: Chosen = patch[(self.model.low[patch] <= lowest) & np.isfinite(lowest)].astype(np.int32)
        return safe

    def _needed(self, chosen: Chosen, surface: Surface) -> Chosen:
        """Leaves out patches that other layers' greater patches, accurate enough themselves, cover."""
        lowest = surface.lowest(self.boxes.box[chosen])
        keep = np.ones(len(chosen), dtype=bool)
        for at in np.flatnonzero(self.model.max_z[chosen] <= lowest):
            q = self.model.kernel[chosen[at]]
            rect = (q[:, 0].min(), q[:, 1].min(), q[:, 0].max(), q[:, 1].max())
            others = self.uniform(float(self.model.max_z[chosen[at]]), rect)
            least = surface.lowest(self.boxes.box[others])
            keep[at] = len(others) == 0 or bool((self.model.low[others] > least).any())
        return chosen[keep]


def difference(before: Chosen, after: Chosen) -> tuple[Chosen, Chosen]:
    """Returns the patches that came and went between two answers from one model: (added, removed), each ascending."""
    return np.setdiff1d(after, before), np.setdiff1d(before, after)


@kernel
def _above(chosen: Chosen, top: Floats, e: float) -> Chosen:
    out = np.empty(chosen.size, np.int32)
    count = 0
    for k in range(chosen.size):
        out[count] = chosen[k]
        count += top[k] > e
    return out[:count]


@kernel
def _below(chosen: Chosen, low: Floats, e: float) -> Chosen:
    out = np.empty(chosen.size, np.int32)
    count = 0
    for k in range(chosen.size):
        out[count] = chosen[k]
        count += low[k] <= e
    return out[:count]


def _shared(model: Model, other: Model) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Patches of layers that lie alike in both models: where they are in each."""
    places = {layer_number(p.layer): k for k, p in enumerate(other.placed)}
    now, then = [np.zeros(0, dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
    for k, placed in enumerate(model.placed):
        at = places.pop(layer_number(placed.layer), None)
        if at is not None:
            count = model.layers[k].count
            now.append(np.arange(count) + model.first[k])
            then.append(np.arange(count) + other.first[at])
    return np.concatenate(now), np.concatenate(then)


def _merged(old: Chosen, come: Chosen, key: Floats) -> Chosen:
    """A sorted list without its -1, with patches more at their places."""
    old = old[old >= 0]
    come = come[np.argsort(key[come], kind="stable")]
    return np.insert(old, np.searchsorted(key[old], key[come], side="right"), come)
