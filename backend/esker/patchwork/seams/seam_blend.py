"""Older ground is blended into surveys along their seams: where two layers disagree along the border of the one that is
believed, the ground of the other is bent to meet it.

The blend alone lets a newer layer end within 1.5 of its cells, whatever lies beside it. Here the border of each layer,
the edge of what its kernels cover, is sampled a cell apart. At each border point the difference D of the layer to the
ground of all layers that are trusted less is known. Ground of these layers gets the correction

    u = D(x) (1 - d^2 / R^2)^3,    1 / R^2 = 1 / (RUN |D(x)|)^2 + 1 / cap^2,

with d the distance to the border and D(x) the border's differences, averaged over the more of it the farther x is:
detail along the border fades near it, as in a membrane. So a difference is gone at RUN = 5 times its size, or nearer:
the cap is an eighth of the domain. What differs by less than a quarter of the newer layer's cell agrees: there u is 0,
and no bit changes.

D(x) and d come from one ladder of kernel sums (``loops``): nodes h apart, 1.4 h, 2 h, ... from the border's own
spacing on. The density of the border's kernel sum says how far the border is, since the kernel is nearly Gaussian,
and the quotient of sums is the mean difference (a normalised convolution, Knutsson and Westin 1993). Each place takes
the finest level that the border is near enough to. The result is a smooth function (C2) of the place alone, the same
for every level, window and tolerance.

Layers are blended in the order of precedence: the differences of each are those to the ground below it as it was
blended before. A patch of layer j gets v_j, the sum of u over the layers that are trusted more, and what is added to
the blend is sum W v / sum W: nothing where only patches of the most trusted layer have weight, so that its samples
stay.
"""

from __future__ import annotations

import dataclasses
import hashlib
import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from esker.patchwork.blend import lattice as blend
from esker.patchwork.blend import points as blend_points
from esker.patchwork.blend.jets import product, total
from esker.patchwork.blend.loops import BIN
from esker.patchwork.blend.packs import Pack
from esker.patchwork.jit import bands, kernel, spread
from esker.patchwork.lod.precedence import precedence
from esker.patchwork.lod.space import Model
from esker.patchwork.raster import patches
from esker.patchwork.seams import loops
from esker.patchwork.seams.borders import border_of
from esker.patchwork.seams.loops import AGREED, BLOCK, FAR, RUN, RUNG, Tables

Floats = NDArray[np.float64]
Rect = tuple[float, float, float, float]

_CAP: Final = 8
"""Parts of the domain's side, one of which is the farthest that a correction reaches."""


class Zone(NamedTuple):
    """The correction of the ground around a layer.

    ``digest``: of all that the zone follows from. ``rect``: x0, y0, x1, y1, nothing is corrected outside. The other
    fields are as in ``loops.Tables``.
    """

    digest: bytes
    rect: Rect
    cell: float
    cap: float
    wide: float
    reach: tuple[int, int, int, int]
    held: NDArray[np.bool_]
    pitch: tuple[float, ...]
    corner: tuple[tuple[int, int, int, int], ...]
    blocks: tuple[NDArray[np.int32], ...]
    nodes: tuple[NDArray[np.float32], ...]
    dense: tuple[NDArray[np.bool_], ...]


class Differences(NamedTuple):
    """Border points (n, 2) of a layer that lie on other ground, their ``weight`` (n,) in metres of border, and
    ``difference`` (n,) metres by which the layer is higher there; ``pitch`` metres from point to point at most."""

    points: Floats
    weight: Floats
    difference: Floats
    pitch: float


class SeamBlend:
    """Corrections of a model on a domain of ``size_m`` metres. Immutable; safe to use from any thread.

    ``before``: those of another model; what is the same is taken from it, the result does not depend on it. ``bent``:
    see ``blend.pack``.
    """

    def __init__(self, model: Model, size_m: float, before: SeamBlend | None = None, bent: bool = False) -> None:
        self._model, self._bent = model, bent
        order = sorted(range(len(model.placed)), key=lambda k: precedence(model.placed[k].layer))
        self._place = np.empty(len(order), dtype=np.int32)
        self._place[order] = np.arange(len(order), dtype=np.int32)
        self._order, self._cap = order, size_m / _CAP
        self._numbers = [blend.layer_number(p.layer) for p in model.placed]
        self._boxes = [_box(held.kernel.reshape(-1, 2)) for held in model.layers]
        self.zones: dict[int, Zone] = {}
        """Zones by place in the order of precedence, least first; layers that agree with all ground below them have
        none."""
        self._known: dict[bytes, Zone | None] = {}
        was = {} if before is None or before._bent != bent else before._known
        self.tables = _flat({})
        for place in range(1, len(order)):
            asked = self._asked(place, size_m)
            if asked is None:
                continue
            key = self._key(place, asked, size_m)
            zone = was[key] if key in was else self._zone(place)
            self._known[key] = zone
            if zone is not None:
                self.zones[place] = zone
                self.tables = _flat(self.zones)

    def corrections(self, place: int, points: Floats) -> Floats:
        """Corrections u (n,) by the layer at ``place`` in the order of precedence, at points (n, 2); metres."""
        out = np.zeros(len(points))
        for z in np.flatnonzero(self.tables.above == place).tolist():
            loops.corrections(self.tables, z, points, out)
        return out

    def _below(self, place: int, rect: Rect) -> list[int]:
        """Places in the order of precedence below ``place`` whose layers, or what they do around them, meet a
        rectangle."""
        found = []
        for p in range(place):
            zone = self.zones.get(p)
            if _meet(self._boxes[self._order[p]], rect) or (zone is not None and _meet(zone.rect, rect)):
                found.append(p)
        return found

    def _asked(self, place: int, size_m: float) -> Rect | None:
        """Returns the rectangle of a layer that can have a border that matters; None if nothing lies below it."""
        k = self._order[place]
        reach = 3 * max(max(p.layer.spacing_m) for p in self._model.placed)
        box = _grown(self._boxes[k], reach)
        far = self._cap
        if not _meet(box, (-far, -far, size_m + far, size_m + far)):
            return None
        return box if any(_meet(self._boxes[self._order[p]], box) for p in range(place)) else None

    def _key(self, place: int, asked: Rect, size_m: float) -> bytes:
        """Returns a digest of all that a zone follows from: the layer, those below it in order, and their zones around
        them."""
        parts = [self._numbers[self._order[place]].to_bytes(8, "little"), repr(size_m).encode()]
        for p in self._below(place, asked):
            zone = self.zones.get(p)
            parts += [self._numbers[self._order[p]].to_bytes(8, "little"), b"" if zone is None else zone.digest]
        return hashlib.blake2b(b"\0".join(parts), digest_size=16).digest()

    def _zone(self, place: int) -> Zone | None:
        """The differences along a layer's border as nodes; None where it agrees with all ground below."""
        layer = self._model.placed[self._order[place]].layer
        points, weight, difference, first = self.differences(place)
        cell = math.sqrt(layer.spacing_m[0] * layer.spacing_m[1])
        hot = np.abs(difference) > AGREED * cell
        if not hot.any():
            return None
        reach = 1 / math.hypot(1 / (RUN * float(np.abs(difference).max())), 1 / self._cap)
        pitch = [first]
        while FAR * pitch[-1] ** 2 < reach**2:
            pitch.append(RUNG * pitch[-1])
        digest = hashlib.blake2b(repr((cell, self._cap, pitch[0])).encode(), digest_size=16)
        for array in (points, weight, difference):
            digest.update(array.tobytes())
        levels = zip(*(_spread_out(points, weight, difference, p) for p in pitch), strict=True)
        wide, found = _first_reach(points[hot], pitch)
        held = np.ones(found[2] * found[3], dtype=np.bool_)
        zone = Zone(digest.digest(), (0, 0, 0, 0), cell, self._cap, wide, found, held, tuple(pitch), *levels)
        loops.reach_cells(_flat({place: zone}), 1.25 * reach, held)
        if not held.any():
            return None
        rows, cols = np.nonzero(held.reshape(found[3], found[2]))
        rect = (cols.min() + found[0], rows.min() + found[1], cols.max() + found[0] + 1, rows.max() + found[1] + 1)
        x0, y0, x1, y1 = (float(end) * wide for end in rect)
        return zone._replace(rect=(x0, y0, x1, y1))

    def differences(self, place: int) -> Differences:
        """Returns the differences of the layer at ``place`` in the order of precedence to the ground below it."""
        k = self._order[place]
        border = border_of(self._model.layers[k])
        there = ((border.points > -self._cap) & (border.points < (_CAP + 1) * self._cap)).all(axis=1)
        points, weight = border.points[there], border.weight[there]
        ground, known = self._ground(place, points)
        met = known > 0
        difference = self._alone(k, points[met])[0] - ground[met]
        return Differences(points[met], (weight * known)[met], difference, border.pitch)

    def _ground(self, place: int, points: Floats) -> tuple[Floats, Floats]:
        """Heights and cover at points of the layers below ``place``, each laid over those that are trusted less."""
        ground, known = np.zeros(len(points)), np.zeros(len(points))
        if len(points) == 0:
            return ground, known
        for p in self._below(place, _box(points)):
            heights, cover = self._alone(self._order[p], points)
            for above in range(p + 1, place):
                heights += self.corrections(above, points)
            rest = (1 - cover) * known
            known = cover + rest
            share = np.divide(cover, known, out=np.zeros_like(known), where=known > 0)
            ground = share * heights + (1 - share) * ground
        return ground, known

    def _alone(self, k: int, points: Floats) -> tuple[Floats, Floats]:
        """Heights and cover at points of a layer alone, from its own samples."""
        held = self._model.layers[k]
        own = slice(0, held.scale_range(patches.SMALL_SCALES)[1])
        grown = 3 * max(held.placed.layer.spacing_m)
        near = _near(held.kernel[own], grown, points)
        index = (near + self._model.first[k]).astype(np.int32)
        found = blend_points.evaluate(blend.pack(self._model, index, True, bent=self._bent), points)
        return found.heights[:, 0].copy(), found.cover[:, 0].copy()

    def lay(self, packed: Pack, lattice: blend.Lattice, heights: NDArray[np.float32]) -> None:
        """Add the corrections to the blend ``heights`` of patches on a lattice, in place."""
        t, s = self.tables, lattice.spacing
        x0, y0, x1, y1 = lattice.rect()
        hit = [z.rect for z in self.zones.values() if _meet(z.rect, (x0, y0, x1, y1))]
        if not hit or not len(packed):
            return
        low, high = np.min([z[:2] for z in hit], axis=0), np.max([z[2:] for z in hit], axis=0)
        col0, row0 = (
            max(a, int(b)) for a, b in zip((lattice.col0, lattice.row0), np.clip(low / s, 0, 2**30), strict=True)
        )
        col1, row1 = (
            min(a, int(b) + 2) for a, b in zip((lattice.col1, lattice.row1), np.clip(high / s, 0, 2**30), strict=True)
        )
        if row1 <= row0 or col1 <= col0:
            return
        part = blend.Lattice(s, row0, row1, col0, col1)
        r0, r1, c0, c1 = part.bins
        found, constants = blend.bins(packed, part), blend.per_patch(packed)
        out = np.empty(((r1 - r0) * BIN, (c1 - c0) * BIN), dtype=np.float32)
        place = self._place[packed.owner]

        def some(start: int, stop: int) -> None:
            loops.correct_bins(found.start, found.patch, found.origin, found.step, constants, packed.rank, place,
                                 packed.smooth, t, s, (r0, c0), c1 - c0, start, stop, out)  # fmt: skip

        spread(some, bands((r1 - r0) * (c1 - c0), 4))
        top, left = row0 - r0 * BIN, col0 - c0 * BIN
        there = heights[row0 - lattice.row0 : row1 - lattice.row0, col0 - lattice.col0 : col1 - lattice.col0]
        more = out[top : top + row1 - row0, left : left + col1 - col0]
        np.add(there, more, out=there, where=more != 0)

    def lay_jets(self, packed: Pack, points: Floats, jets: Floats) -> None:
        """Add the corrections to the jets (n, 6) of the blend of patches at points (n, 2), in place."""
        if not self.zones or not len(packed):
            return
        place = self._place[packed.owner]
        for p in np.unique(place).tolist():
            corrected = np.zeros((len(points), 6))
            work = self.tables, p, points

            def some(start: int, stop: int, work: tuple[Tables, int, Floats] = work, out: Floats = corrected) -> None:
                loops.correction_jets(*work, start, stop, out)

            spread(some, bands(len(points), 256))
            hit = np.flatnonzero(corrected.any(axis=1))
            if len(hit) == 0:
                continue
            mine = np.zeros_like(packed.coefficients)
            mine[place == p] = 1
            share = blend_points.evaluate(dataclasses.replace(packed, coefficients=mine), points[hit]).heights
            _add_products(share, corrected[hit], hit, jets)

    def changed(self, other: SeamBlend) -> list[Rect]:
        """Rectangles outside of which two is blended give the same corrections."""
        ours, theirs = self._lain(), other._lain()
        return [a[key] for a, b in ((ours, theirs), (theirs, ours)) for key in a if key not in b]

    def _lain(self) -> dict[tuple[bytes, tuple[int, ...]], Rect]:
        """Zones with the layers whose ground they correct."""
        found = {}
        for place, zone in self.zones.items():
            lower = (self._order[p] for p in range(place))
            met = sorted(self._numbers[k] for k in lower if _meet(self._boxes[k], zone.rect))
            found[zone.digest, tuple(met)] = zone.rect
        return found


@kernel
def _add_products(share: Floats, corrected: Floats, places: NDArray[np.int64], out: Floats) -> None:
    for k in range(len(places)):
        a, b, c = share[k], corrected[k], out[places[k]]
        jet = product((a[0], a[1], a[2], a[3], a[4], a[5]), (b[0], b[1], b[2], b[3], b[4], b[5]))
        jet = total((c[0], c[1], c[2], c[3], c[4], c[5]), jet)
        for m in range(6):
            out[places[k], m] = jet[m]


def _spread_out(
    points: Floats, weight: Floats, difference: Floats, pitch: float
) -> tuple[tuple[int, int, int, int], NDArray[np.int32], NDArray[np.float32], NDArray[np.bool_]]:
    """One level of nodes: corner, chart of blocks, blocks and their dense cells, see ``loops.Tables``."""
    base = np.floor(points / pitch).astype(np.int64) - 1
    low, high = (base.min(axis=0) - 3) // BLOCK, (base.max(axis=0) + 3) // BLOCK + 1
    wide, tall = (high - low).tolist()
    corner = int(low[0]), int(low[1]), wide, tall
    chart = np.full(wide * tall, -1, dtype=np.int32)
    count = loops.mark(points, pitch, np.array(corner), chart)
    nodes = np.zeros((count, BLOCK + 3, BLOCK + 3, 2))
    loops.scatter(points, weight, difference, pitch, np.array(corner), chart, nodes)
    kept = nodes.astype(np.float32)
    dense = np.empty((count, BLOCK, BLOCK), dtype=np.bool_)
    loops.dense_cells(kept, dense)
    return corner, chart, kept, dense


def _first_reach(hot: Floats, pitch: list[float]) -> tuple[float, tuple[int, int, int, int]]:
    """Side of the cells of a reach, and the first column and row, columns and rows of those that kernels of the
    differing points ``hot`` meet at all."""
    wide = max(8 * pitch[0], pitch[-1] / 8)
    x0, y0, x1, y1 = _grown(_box(hot), 4 * pitch[-1])
    first = math.floor(x0 / wide), math.floor(y0 / wide)
    return wide, (*first, math.floor(x1 / wide) + 1 - first[0], math.floor(y1 / wide) + 1 - first[1])


def _flat(zones: dict[int, Zone]) -> Tables:
    """Lays the zones of all places one behind the other, in an order of their own, so that sums have one order."""
    ordered = sorted(zones.items(), key=lambda item: item[1].digest)
    all_blocks, all_nodes, all_dense, charts, done, at = [], [], [], [], 0, 0
    for _, zone in ordered:
        for blocks, nodes, dense in zip(zone.blocks, zone.nodes, zone.dense, strict=True):
            charts.append(at)
            all_blocks.append(np.where(blocks < 0, -1, blocks + done).astype(np.int32))
            all_nodes.append(nodes)
            all_dense.append(dense)
            at, done = at + len(blocks), done + len(nodes)
    begins = np.cumsum([0, *(len(zone.held) for _, zone in ordered)]).tolist()
    return Tables(
        np.array([place for place, _ in ordered], dtype=np.int32),
        np.array([zone.cell for _, zone in ordered]),
        np.array([zone.cap for _, zone in ordered]),
        np.array([zone.wide for _, zone in ordered]),
        np.array([(*zone.reach, at) for at, (_, zone) in zip(begins, ordered, strict=False)], dtype=np.int64).reshape(
            -1, 5
        ),
        np.concatenate([np.zeros(0, np.bool_), *(zone.held for _, zone in ordered)]),
        np.cumsum([0, *(len(zone.pitch) for _, zone in ordered)], dtype=np.int64),
        np.array([p for _, zone in ordered for p in zone.pitch]),
        np.array([c for _, zone in ordered for c in zone.corner], dtype=np.int64).reshape(-1, 4),
        np.array(charts, dtype=np.int64),
        np.concatenate([np.zeros(0, np.int32), *all_blocks]),
        np.concatenate([np.zeros((0, BLOCK + 3, BLOCK + 3, 2), np.float32), *all_nodes]),
        np.concatenate([np.zeros((0, BLOCK, BLOCK), np.bool_), *all_dense]),
    )


def _near(kernels: Floats, grown: float, points: Floats) -> NDArray[np.int64]:
    """Returns which quads (n, 4, 2), grown by ``grown`` metres, may hold one of the points: never misses one."""
    if len(points) == 0 or len(kernels) == 0:
        return np.zeros(0, dtype=np.int64)
    low, high = kernels.min(axis=1) - grown, kernels.max(axis=1) + grown
    start, end = points.min(axis=0), points.max(axis=0)
    maybe = np.flatnonzero(((low <= end) & (high >= start)).all(axis=1))
    if len(maybe) == 0:
        return maybe
    low, high = low[maybe], high[maybe]
    pitch = max(float((high - low).max()) / 2, float((end - start).max()) / 1024, 1e-3)
    cell = np.floor((points - start) / pitch).astype(np.int64)
    wide, tall = (int(n) + 1 for n in cell.max(axis=0))
    held = np.zeros((tall + 1, wide + 1), dtype=np.int64)
    held[cell[:, 1] + 1, cell[:, 0] + 1] = 1
    held = held.cumsum(axis=0).cumsum(axis=1)
    c0, r0 = np.clip(np.floor((low - start) / pitch), 0, (wide - 1, tall - 1)).astype(np.int64).T
    c1, r1 = np.clip(np.floor((high - start) / pitch), 0, (wide - 1, tall - 1)).astype(np.int64).T + 1
    return np.asarray(maybe[held[r1, c1] - held[r0, c1] - held[r1, c0] + held[r0, c0] > 0])


def _box(points: Floats) -> Rect:
    """Bounds of points (n, 2); an empty rectangle of none."""
    if len(points) == 0:
        return math.inf, math.inf, -math.inf, -math.inf
    (x0, y0), (x1, y1) = points.min(axis=0).tolist(), points.max(axis=0).tolist()
    return x0, y0, x1, y1


def _grown(rect: Rect, by: float) -> Rect:
    return rect[0] - by, rect[1] - by, rect[2] + by, rect[3] + by


def _meet(a: Rect, b: Rect) -> bool:
    return a[0] <= b[2] and b[0] <= a[2] and a[1] <= b[3] and b[1] <= a[3]
