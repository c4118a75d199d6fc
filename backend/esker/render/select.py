"""Which 16-cell patches are drawn: the rule of the page's selection (tiles/patches/selection.ts) on arrays.

A patch is split while it commits more than ``tau`` pixels of error; then neighbours, across corners too, are split
until they differ by at most one level. Each corner of a drawn patch gets a morph weight that belongs to its point: 1
where a coarser patch meets it, 0 where a finer one does, else the greatest weight that is asked by the patches there
(docs/renderer.md).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from esker.contract import PATCH_CELLS, QUANTA_PER_CELL, SUBPATCHES
from esker.render.camera import Camera, eye_projection
from esker.synthesis.lakes import Surfaces

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Node = tuple[int, int]
Split = list[dict[Node, float]]
"""Per level: column and row of each split patch, and its screen error in taus (0: split for its neighbours' sake)."""

SMALLEST_CELL: Final = 1.0
SHADING_ERROR: Final = 1.5 / QUANTA_PER_CELL
SHADING_CELL_PX: Final = 5.0
MORPH_WIDTH: Final = 0.25
WEST, EAST, SOUTH, NORTH = 1, 2, 4, 8


class Figures(Protocol):
    """What the selection asks of the ground."""

    @property
    def size_m(self) -> float:
        """Side of the domain, metres."""

    @property
    def levels(self) -> int:
        """Finest level that can be drawn."""

    def bounds(self, level: int, nodes: Ints) -> tuple[Floats, Floats, Floats]:
        """Returns of (n, 2) patches (column, row): lowest and highest ground of them and all below, and the largest
        distance, metres, between a patch as drawn and what is below it (0: nothing is)."""


@dataclass(frozen=True)
class Cut:
    """Drawn patches. ``nodes``: (n, 2) column and row on ``level``; ``edges``: bits of the sides with a coarser
    neighbour, ``border``: of those on the domain's border; ``morph``: (n,) own weight, ``corners``: (n, 4) weights,
    south-west, south-east, north-west, north-east, all as unorm8; ``wet``: some of it lies below water. ``near``,
    ``far``: (n, 3) corners of the boxes that patches stay in, ``water``: how high water may stand there, metres."""

    level: Ints
    nodes: Ints
    edges: Ints
    border: Ints
    morph: NDArray[np.uint8]
    corners: NDArray[np.uint8]
    wet: NDArray[np.bool_]
    near: Floats
    far: Floats
    water: Floats
    split: Split

    def within(self, camera: Camera, planes: Floats, foot_m: float) -> NDArray[np.bool_]:
        """Returns which patches may be seen inside ``planes`` (``frustum``).

        On the domain's border the ground reaches down to ``foot_m``.
        """
        near, far = self.near - np.array(camera.eye), self.far - np.array(camera.eye)
        near[self.border != 0, 2] = np.minimum(near[self.border != 0, 2], foot_m - camera.eye[2])
        far[self.wet, 2] = np.maximum(far[self.wet, 2], self.water[self.wet] - camera.eye[2])
        return _touching(planes, near, far)

    def tiles(self) -> list[tuple[int, int, int]]:
        """(level, x, y) of all tiles that the cut rests on: the root, and those that hold the children of split
        patches. Parents come first."""
        found = {(0, 0, 0): None}
        for level, nodes in enumerate(self.split):
            for px, py in nodes:
                found.setdefault((level + 1, px // 2, py // 2))
        return sorted(found)


def frustum(m: Floats) -> Floats:
    """(6, 4) planes, relative to the eye, that clip space is bounded by; inside is where they are positive."""
    return np.array([m[3] + m[0], m[3] - m[0], m[3] + m[1], m[3] - m[1], m[2], m[3] - m[2]])


def _touching(planes: Floats, near: Floats, far: Floats) -> NDArray[np.bool_]:
    """Returns which boxes, (n, 3) corners relative to the eye, are not wholly outside one of the planes."""
    inside = np.ones(len(near), dtype=np.bool_)
    for plane in planes:
        furthest = np.where(plane[:3] > 0, far, near)
        inside &= furthest @ plane[:3] + plane[3] >= 0
    return inside


def choose(ground: Figures, camera: Camera, tau_px: float, water: Surfaces | None = None) -> Cut:
    """The cut for a camera. ``water``: patches below it are drawn as far as its surface is in view."""
    walk = _Walk(ground, camera, tau_px, water or Surfaces(None, None))
    split = walk.descend()
    enforce(split)
    return walk.emit(split)


class _Walk:
    """One selection."""

    def __init__(self, ground: Figures, camera: Camera, tau_px: float, water: Surfaces) -> None:
        self.ground, self.tau, self.water = ground, tau_px, water
        self.eye = np.array(camera.eye)
        self.ortho = camera.ortho_height_m > 0
        self.pixels = camera.height / (camera.ortho_height_m if self.ortho else 2 * camera.tangent)
        self.planes = frustum(eye_projection(camera))

    def descend(self) -> Split:
        """Splits what commits too much error, from the root down."""
        split: Split = []
        nodes = _roots()
        for level in range(self.ground.levels):
            seen = self._visible(level, nodes)
            nodes = nodes[seen]
            ratio = self._screen_error(level, nodes)
            nodes, ratio = nodes[ratio > 1], ratio[ratio > 1]
            split.append({(px, py): r for (px, py), r in zip(nodes.tolist(), ratio.tolist(), strict=True)})
            if not len(nodes):
                break
            nodes = _children(nodes)
        return split

    def emit(self, split: Split) -> Cut:
        """The visible leaves of the restricted tree."""
        rows: list[tuple[int, ...]] = []
        nodes = _roots()
        for level in range(len(split) + 1):
            nodes = nodes[self._visible(level, nodes)]
            inner = split[level] if level < len(split) else {}
            last = (SUBPATCHES << level) - 1
            deeper = []
            for px, py in nodes.tolist():
                if (px, py) in inner:
                    deeper.append((px, py))
                    continue
                border = WEST * (px == 0) | EAST * (px == last) | SOUTH * (py == 0) | NORTH * (py == last)
                corners = _corners(split, level, px, py) if level else (0, 0, 0, 0)
                own = _unorm8(_morph(split[level - 1][px >> 1, py >> 1])) if level else 0
                rows.append((level, px, py, _edges(split, level, px, py), border, own, *corners))
            if not deeper:
                break
            nodes = _children(np.array(deeper, dtype=np.int64))
        table = np.array(rows, dtype=np.int64).reshape(-1, 10)
        return Cut(
            table[:, 0],
            table[:, 1:3],
            table[:, 3],
            table[:, 4],
            table[:, 5].astype(np.uint8),
            table[:, 6:10].astype(np.uint8),
            *self._boxes(table),
            split,
        )

    def _boxes(self, table: Ints) -> tuple[NDArray[np.bool_], Floats, Floats, Floats]:
        """Returns which patches are wet, the boxes of all, and how high water may stand on them."""
        near, far, water = np.empty((len(table), 3)), np.empty((len(table), 3)), np.empty(len(table))
        for level in np.unique(table[:, 0]):
            here = table[:, 0] == level
            nodes, w = table[here, 1:3], self.ground.size_m / (SUBPATCHES << int(level))
            low, high, _ = self.ground.bounds(int(level), nodes)
            near[here], far[here] = np.column_stack((nodes * w, low)), np.column_stack(((nodes + 1) * w, high))
            water[here] = self.water.highest(int(level), nodes)
        return near[:, 2] < water, near, far, water

    def _visible(self, level: int, nodes: Ints) -> NDArray[np.bool_]:
        w = self.ground.size_m / (SUBPATCHES << level)
        low, high, _ = self.ground.bounds(level, nodes)
        near = np.column_stack((nodes * w - self.eye[:2], low - self.eye[2]))
        far = np.column_stack((near[:, :2] + w, np.maximum(high, self.water.highest(level, nodes)) - self.eye[2]))
        return _touching(self.planes, near, far)

    def _screen_error(self, level: int, nodes: Ints) -> Floats:
        """Error of stopping at these patches, in taus; at most 1 where they need not be split."""
        cell = self.ground.size_m / ((SUBPATCHES << level) * PATCH_CELLS)
        low, high, error = self.ground.bounds(level, nodes)
        scale = self.pixels / (1.0 if self.ortho else self._distance(level, nodes, low, high))
        cell_px = cell * scale
        rough = np.where(error > SHADING_ERROR * cell, cell_px / (SHADING_CELL_PX * self.tau), 0.0)
        found = np.maximum(error * scale / self.tau, rough)
        return np.asarray(np.where((error == 0) | (cell_px <= SMALLEST_CELL * self.tau), 0.0, found))

    def _distance(self, level: int, nodes: Ints, low: Floats, high: Floats) -> Floats:
        w = self.ground.size_m / (SUBPATCHES << level)
        near = np.column_stack((nodes * w, low))
        far = np.column_stack(((nodes + 1) * w, high))
        away = np.maximum(np.maximum(near - self.eye, self.eye - far), 0)
        return np.asarray(np.maximum(1e-3, np.sqrt((away**2).sum(axis=1))))


def _roots() -> Ints:
    return np.array([(px, py) for py in range(SUBPATCHES) for px in range(SUBPATCHES)], dtype=np.int64)


def _children(nodes: Ints) -> Ints:
    return np.asarray((2 * nodes[:, None, :] + np.array([(0, 0), (1, 0), (0, 1), (1, 1)])).reshape(-1, 2))


def enforce(split: Split) -> None:
    """Fine to coarse: the neighbours of a split patch must exist, so their parents are split as well."""
    for level in range(len(split) - 1, 0, -1):
        last = (SUBPATCHES << (level - 1)) - 1
        above = split[level - 1]
        for px, py in split[level]:
            ux, uy = px >> 1, py >> 1
            dx, dy = 2 * (px & 1) - 1, 2 * (py & 1) - 1
            for x, y in ((ux, uy), (ux + dx, uy), (ux, uy + dy), (ux + dx, uy + dy)):
                if 0 <= x <= last and 0 <= y <= last:
                    above.setdefault((x, y), 0.0)


def _is_split(split: Split, level: int, px: int, py: int) -> bool:
    return level < len(split) and (px, py) in split[level]


def _exists(split: Split, level: int, px: int, py: int) -> bool:
    """True when the patch is a node of the cut's tree: its parent is split. Outside the domain: true."""
    last = (SUBPATCHES << level) - 1
    return level == 0 or not (0 <= px <= last and 0 <= py <= last) or _is_split(split, level - 1, px >> 1, py >> 1)


def _edges(split: Split, level: int, px: int, py: int) -> int:
    sides = ((WEST, px - 1, py), (EAST, px + 1, py), (SOUTH, px, py - 1), (NORTH, px, py + 1))
    return sum(bit for bit, x, y in sides if not _exists(split, level, x, y))


def _morph(parent_ratio: float) -> float:
    """1 when the parent's error is at the bound (about to be merged), 0 from ``MORPH_WIDTH`` beyond it on."""
    return min(1.0, max(0.0, 1.0 - (parent_ratio - 1.0) / MORPH_WIDTH))


def _unorm8(weight: float) -> int:
    return int(weight * 255 + 0.5)


def _corners(split: Split, level: int, px: int, py: int) -> tuple[int, int, int, int]:
    last = (SUBPATCHES << level) - 1
    out = []
    for sy in (-1, 1):
        for sx in (-1, 1):
            around = [(0, 0), (sx, 0), (0, sy), (sx, sy)]
            inside = [(px + x, py + y) for x, y in around if 0 <= px + x <= last and 0 <= py + y <= last]
            out.append(_unorm8(_weight(split, level, inside)))
    return out[0], out[1], out[2], out[3]


def _weight(split: Split, level: int, patches: list[Node]) -> float:
    """Weight of the point where these patches meet (the first is the one that is drawn)."""
    weight = 0.0
    for px, py in patches:
        ratio = split[level - 1].get((px >> 1, py >> 1))
        if ratio is None:
            return 1.0
        if _is_split(split, level, px, py):
            return 0.0
        weight = max(weight, _morph(ratio))
    return weight
