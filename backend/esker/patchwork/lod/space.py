"""LOD space: all patches of all layers as upright boxes over the ground (paper 2, section 3.3; DESIGN 11).

A patch serves tolerances from its error (``min_z``) up to where greater patches cover its kernel (``max_z``), half
open. Both are pure functions of the set of layers, so that the order of edits leaves no trace: :func:`build` and any
sequence of :meth:`Model.with_`, ``without`` and ``replaced`` that ends at the same layers give the same arrays.

**Precedence.** Of two layers that overlap, the one with the greater priority is believed; at equal priority the more
accurate, then the finer, then the greater id. A patch of the other is measured against its samples, too.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from esker.patchwork.lod import cover, remeasure
from esker.patchwork.lod.layer_patches import Ints, LayerPatches, Placed, layer_patches, reached
from esker.patchwork.lod.precedence import precedence
from esker.patchwork.raster import patches
from esker.patchwork.raster.patches import Floats
from esker.patchwork.raster.samples import cut

__all__ = ["Model", "Placed", "build"]

GROUND = ("content", "anchor", "rotation_deg", "spacing_m", "scale", "lift_m", "accuracy_m", "priority", "hidden")
"""Fields of a layer that its patches follow from."""


@dataclass(frozen=True, eq=False)
class Model:
    """The patches of all visible layers, N in all, by (priority, layer id, scale, row, col). Arrays are read-only.

    ``owner``: index into ``placed``. ``level``: mipmap level. ``row``, ``col``: first sample in it, may be negative
    (clamped). ``side``: samples a side. ``to_patch``: world (x, y, 1) to sample coordinates 0..side-1. ``extent``: the
    domain is [0, extent] in them: side - 1, less at the end of a grid. ``kernel``: world corners, counter-clockwise.
    ``half``: half sides of the domain, metres. ``slack``: how far the kernel's true edges may leave the straight ones,
    metres. ``min_z``, ``max_z``: metres; max_z <= min_z: wiped out. ``floor``, ``low``: see :mod:`cover`; a patch is
    chosen at tolerance e exactly when ``low <= e < max_z``.
    """

    placed: tuple[Placed, ...]
    owner: NDArray[np.int32]
    level: NDArray[np.int8]
    row: NDArray[np.int32]
    col: NDArray[np.int32]
    side: NDArray[np.int8]
    to_patch: Floats
    extent: Floats
    kernel: Floats
    half: Floats
    slack: Floats
    area: Ints
    min_z: Floats
    max_z: Floats
    floor: NDArray[np.bool_]
    low: Floats
    layers: tuple[LayerPatches, ...] = field(repr=False)
    first: tuple[int, ...] = field(repr=False)
    measured: dict[tuple[str, str], tuple[Ints, Floats]] = field(repr=False)

    @property
    def count(self) -> int:
        """The number of patches, wiped out ones counted."""
        return len(self.min_z)

    def samples(self, index: int) -> NDArray[np.float32]:
        """Heights (side, side) of a patch in metres: scale and lift applied, margins without data filled."""
        flat, _ = self.gather(np.array([index]))
        side = int(self.side[index])
        return flat.reshape(side, side)

    def gather(self, index: NDArray[np.integer]) -> tuple[NDArray[np.float32], Ints]:
        """Heights of many patches, one after the other, and where each begins (k + 1 offsets)."""
        sides = self.side[index].astype(np.int64)
        offsets = np.concatenate([[0], np.cumsum(sides * sides)]).astype(np.int64)
        out = np.empty(offsets[-1], np.float32)
        for k, p in enumerate(np.asarray(index).tolist()):
            placed = self.placed[self.owner[p]]
            block = out[offsets[k] : offsets[k + 1]].reshape(sides[k], sides[k])
            cut(placed.raster.mips[self.level[p]], int(self.row[p]), int(self.col[p]), block, False)
            if placed.layer.scale != 1.0 or placed.layer.lift_m != 0.0:
                block[:] = placed.layer.scale * block.astype(np.float64) + placed.layer.lift_m
        return out, offsets

    def with_(self, placed: Placed) -> Model:
        """The model with a layer more, or with a layer of the same id replaced."""
        return build((*(p for p in self.placed if p.layer.id != placed.layer.id), placed), self)

    def without(self, layer_id: str) -> Model:
        """The model without a layer; itself if it has none of that id."""
        rest = tuple(p for p in self.placed if p.layer.id != layer_id)
        return self if len(rest) == len(self.placed) else build(rest, self)

    def replaced(self, placed: Iterable[Placed]) -> Model:
        """The model of other layers, made with what did not change."""
        return build(placed, self)


def _same_ground(a: Placed, b: Placed) -> bool:
    return a.raster.digest == b.raster.digest and all(getattr(a.layer, n) == getattr(b.layer, n) for n in GROUND)


def build(placed: Iterable[Placed], before: Model | None = None) -> Model:
    """The model of a set of layers. Hidden ones are left out; of two with one id the later counts.

    ``before``: a model whose parts are used where they are the same; the result does not depend on it.
    """
    visible = {p.layer.id: p for p in placed}
    order = sorted((p for p in visible.values() if not p.layer.hidden), key=lambda p: (p.layer.priority, p.layer.id))
    known = {} if before is None else {s.placed.layer.id: s for s in before.layers}
    layers: list[LayerPatches] = []
    kept: set[str] = set()
    for one in order:
        old = known.get(one.layer.id)
        if old is not None and _same_ground(old.placed, one):
            kept.add(one.layer.id)
            layers.append(old)
        else:
            layers.append(layer_patches(one))
    measured = {} if before is None else {k: v for k, v in before.measured.items() if kept.issuperset(k)}
    return _assembled(tuple(order), tuple(layers), measured)


def _assembled(
    placed: tuple[Placed, ...], layers: tuple[LayerPatches, ...], measured: dict[tuple[str, str], tuple[Ints, Floats]]
) -> Model:
    if not layers:
        return _empty()
    first = np.concatenate([[0], np.cumsum([s.count for s in layers])]).tolist()
    owner = np.repeat(np.arange(len(layers), dtype=np.int32), [s.count for s in layers])
    scale = np.concatenate([s.scale for s in layers])
    row, col, side = (np.concatenate(column) for column in zip(*(s.windows() for s in layers), strict=True))
    kernel = np.concatenate([s.kernel for s in layers])
    min_z, meets = _measured_against_newer(placed, layers, first, measured)
    max_z, floor = _boxes(layers, first, min_z, kernel, meets)
    model = Model(
        placed,
        owner,
        np.maximum(scale - patches.SMALL_SCALES, 0).astype(np.int8),
        row,
        col,
        side.astype(np.int8),
        np.concatenate([s.to_patch for s in layers]),
        np.concatenate([s.extent for s in layers]),
        kernel,
        np.concatenate([s.half for s in layers]),
        np.concatenate([s.slack for s in layers]),
        np.concatenate([s.area for s in layers]),
        min_z,
        max_z,
        floor,
        np.where(floor, 0.0, min_z),
        layers,
        tuple(first[:-1]),
        measured,
    )
    for value in vars(model).values():
        if isinstance(value, np.ndarray):
            value.flags.writeable = False
    return model


def _measured_against_newer(
    placed: tuple[Placed, ...],
    layers: tuple[LayerPatches, ...],
    first: list[int],
    measured: dict[tuple[str, str], tuple[Ints, Floats]],
) -> tuple[Floats, NDArray[np.bool_]]:
    """Errors of all patches, and which of them meet another layer. Fills ``measured`` with the pairs it lacks."""
    min_z = np.concatenate([s.own for s in layers])
    meets = np.zeros(len(min_z), bool)
    for a, old in enumerate(layers):
        for b, new in enumerate(layers):
            if a == b:
                continue
            near = reached(old, new)
            meets[first[a] : first[a + 1]] |= near
            if not near.any() or precedence(placed[a].layer) > precedence(placed[b].layer):
                continue
            key = placed[a].layer.id, placed[b].layer.id
            if key not in measured:
                measured[key] = remeasure.distances(old, new)
            index, distance = measured[key]
            at = index + first[a]
            min_z[at] = np.maximum(min_z[at], distance + placed[b].layer.accuracy_m)
    return min_z, meets


def _boxes(
    layers: tuple[LayerPatches, ...], first: list[int], min_z: Floats, kernel: Floats, meets: NDArray[np.bool_]
) -> tuple[Floats, NDArray[np.bool_]]:
    """Tops and floors: in closed form where a layer is alone, by cutting polygons where patches meet other layers'."""
    max_z = np.empty(len(min_z))
    floor = np.empty(len(min_z), bool)
    for k, one in enumerate(layers):
        part = slice(first[k], first[k + 1])
        max_z[part], floor[part] = cover.nested(one, min_z[part])
    which = np.flatnonzero(meets)
    if len(which):
        ix = cover.index(list(layers), first, min_z, kernel)
        max_z[which] = cover.tops(ix, which)
        floor[which] = False
        live = which[max_z[which] > min_z[which]]
        floor[live] = cover.floors(ix, live)
    return max_z, floor


def _empty() -> Model:
    def zeros(shape: tuple[int, ...], dtype: type) -> Any:
        return np.zeros((0, *shape), dtype)

    f, i32, i8 = np.float64, np.int32, np.int8
    return Model(
        (),
        zeros((), i32),
        zeros((), i8),
        zeros((), i32),
        zeros((), i32),
        zeros((), i8),
        zeros((2, 3), f),
        zeros((2,), f),
        zeros((4, 2), f),
        zeros((2,), f),
        zeros((), f),
        zeros((), np.int64),
        zeros((), f),
        zeros((), f),
        zeros((), bool),
        zeros((), f),
        (),
        (),
        {},
    )
