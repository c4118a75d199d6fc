"""Refinement above the global levels, tile by tile (DESIGN 5.6).

A tile of level L is computed from its parent level's samples under it and a halo around (``refine_engine``); level by
level down from the finest global one. Every sample is a pure function of the strokes, the settings and the settled
solve: which tiles were asked for, in which order, in which groups and from what cache does not change a bit.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence, Set
from dataclasses import dataclass
from functools import cached_property
from hashlib import blake2b
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from esker.contract import MAX_REFINED_LEVEL, TILE_CELLS, TILE_SAMPLES, Stroke, TerrainSettings
from esker.grid import TileKey
from esker.solve.base import Base, bound
from esker.solve.constraints.constraints import Shapes
from esker.solve.opencl.device import Device, row_kernels
from esker.solve.refine.base_blocks import BaseWindows, BlockCache
from esker.solve.refine.boxes import (
    Box,
    bounds_of,
    evenly_cut,
    group_around,
    in_z_order,
    keys_of,
    paste,
    samples_of,
    span_of,
    tiles_over,
)
from esker.solve.refine.cache import CACHE_BYTES, FieldCache
from esker.solve.refine.cl_engine import ClEngine
from esker.solve.refine.engine import CHANNELS, Engine, Fields, NumpyEngine, Pending, Span, Step, step
from esker.solve.refine.stroke_set import DIGEST_BYTES, Strokes

LOOK_SECONDS: Final = 0.0002
"""Between two looks at the device, and at who is in a hurry."""
SPARE_SECONDS: Final = 30.0
"""So long after the last step its memory is given back: who only looks at what there is needs none."""
Plan = dict[int, set[TileKey]]
"""Per level the tiles that are still to be made."""


class Basis(Protocol):
    """A settled solve (``solver.Basis``)."""

    @property
    def strokes(self) -> tuple[Stroke, ...]: ...
    @property
    def settings(self) -> TerrainSettings: ...
    @property
    def level(self) -> int: ...
    @property
    def heights(self) -> NDArray[np.float32]: ...
    @property
    def gradient(self) -> NDArray[np.float32]: ...
    @property
    def base(self) -> Base | None: ...


@dataclass(frozen=True)
class RefinedTile:
    """A tile above the global levels.

    heights: (65, 65) float32 metres above the base, read-only; edges are bit-equal to the neighbours'. content: digest
    of all that it depends on: equal content, same bits. base: the base there, None where the terrain has none.
    """

    key: TileKey
    heights: NDArray[np.float32]
    content: bytes
    base: NDArray[np.float32] | None = None


@dataclass(frozen=True, eq=False)
class _Begun:
    """A step under way for the tiles of a box."""

    level: int
    box: Box
    pending: Pending

    def holds(self, key: TileKey) -> bool:
        """Returns whether the step makes a tile."""
        x0, y0, x1, y1 = self.box
        return key.level == self.level and x0 <= key.x < x1 and y0 <= key.y < y1


class Refiner:
    """Refines one settled solve. Use it from the solver's thread."""

    def __init__(
        self,
        basis: Basis,
        engine: Engine,
        cache: FieldCache,
        blocks: BlockCache | None = None,
        shapes: Shapes | None = None,
    ) -> None:
        self.basis, self.cache, self._engine = basis, cache, engine
        under = bound(basis.base, engine.device)
        self._base = None if under is None else BaseWindows(under, BlockCache() if blocks is None else blocks)
        self._digests: dict[TileKey, bytes] = {}
        self._content: dict[TileKey, bytes] = {}
        self._strokes = Strokes(basis.strokes, basis.settings, self._base, shapes)
        self._under_way: deque[_Begun] = deque()
        """Oldest first; they outlive the iterator that began them."""
        self._urgent: Callable[[], bool] | None = None
        self._waiting: dict[int, dict[TileKey, Fields | None]] = {}
        """Fields that the iterators need of tiles, by the identity of their dictionary."""

    @cached_property
    def _ground(self) -> NDArray[np.float32]:
        """Gradient and heights of the settled solve, one above the other.

        They take twelve megabytes at level 4, so a room in which nobody looks closely has none.
        """
        return np.concatenate([self.basis.gradient, self.basis.heights[None]])

    def content(self, key: TileKey) -> bytes:
        """Digest of all that a tile depends on: the key, the settings, the strokes that reach its windows at any level
        of the chain, the settled samples under them. Raises ValueError for a tile that is not above the global levels
        or not within the terrain."""
        known = self._content.get(key)
        if known is None:
            known = self._content[key] = self._digest(key)
        return known

    def tiles(self, keys: Sequence[TileKey], urgent: Callable[[], bool] | None = None) -> Iterator[RefinedTile | None]:
        """Every tile of ``keys`` once, in that order; None wherever the work can be left.

        ``urgent``: whether somebody else needs this thread. It is asked while the device works; None comes then.
        Close the iterator to stop; what was finished stays in the cache. Raises ValueError like ``content``.
        """
        for key in keys:
            self.content(key)
            if urgent is not None and urgent():
                yield None
        wanted = list(dict.fromkeys(keys))
        left = self._plan(wanted)
        for n, key in enumerate(wanted):
            self._urgent = urgent  # other iterators may have run in between
            yield from self._look_ahead(wanted[n:], left)
            field = (yield from self._made([key], left))[key]
            yield RefinedTile(key, field[2], self.content(key), self._under(key))

    def _plan(self, keys: Iterable[TileKey]) -> Plan:
        """Returns by level the tiles that are neither kept nor under way.

        Where tiles are made, as parents of finer ones too, tiles beside them are made with them.
        """
        left: Plan = {level: set() for level in range(self.basis.level + 1, MAX_REFINED_LEVEL + 1)}
        for key in keys:
            if self.content(key) not in self.cache and not self._is_under_way(key):
                left[key.level].add(key)
        return left

    def _look_ahead(self, coming: Sequence[TileKey], plan: Plan) -> Generator[None, None, None]:
        """Begins as many steps for the tiles that come next as may be under way: the device works on while the caller
        takes those that are made."""
        while len(self._under_way) < self._engine.ahead:
            first = next((key for key in coming if key in plan[key.level]), None)
            if first is None:
                return
            yield from self._begun(first, set(), plan)

    def _under(self, key: TileKey) -> NDArray[np.float32] | None:
        """The base at a tile's samples."""
        if self._base is None:
            return None
        samples = self._base.window(key.level, span_of(key))
        samples.flags.writeable = False
        return samples

    def clear(self) -> None:
        """Drop all that is kept, for all refiners of the solver: fields and rasterised constraints."""
        self._under_way.clear()
        self.cache.clear()
        self._engine.clear()

    def forget(self, keys: Iterable[TileKey]) -> None:
        """Drop tiles from the cache. Raises DeviceError like ``tiles``: those under way are finished first."""
        while self._under_way:
            self._finish()
        for key in keys:
            self.cache.drop(self.content(key))

    def window(
        self, level: int, rows: slice, cols: slice, progress: Callable[[float], None] | None = None
    ) -> NDArray[np.float32]:
        """Heights above the base of a rectangle of samples of any level up to MAX_REFINED_LEVEL: (rows, cols)
        float32, metres.

        ``progress`` is told the share that is done. Raises ValueError for slices with steps or outside of the level.
        """
        if not 0 <= level <= MAX_REFINED_LEVEL:
            raise ValueError(f"level must be 0..{MAX_REFINED_LEVEL}, not {level}")
        span = Span(*bounds_of(rows, level), *bounds_of(cols, level))
        if level <= self.basis.level:
            jump = 1 << (self.basis.level - level)
            whole = self.basis.heights[::jump, ::jump]
            return np.ascontiguousarray(whole[span.r0 : span.r1, span.c0 : span.c1])
        out = np.empty(span.shape, dtype=np.float32)
        groups = in_z_order(evenly_cut(tiles_over(span, level)))
        for done, box in enumerate(groups):
            keys = keys_of(level, box)
            for key, field in self._all(keys).items():
                paste(out[None], span, key, field[2:])
            if progress is not None:
                progress((done + 1) / len(groups))
        return out

    def _all(self, keys: list[TileKey]) -> dict[TileKey, Fields]:
        """The fields of tiles, without leaving the work."""
        self._urgent = None
        work = self._made(keys, self._plan(keys))
        while True:
            try:
                next(work)
            except StopIteration as end:
                found: dict[TileKey, Fields] = end.value
                return found

    def _made(self, keys: Iterable[TileKey], plan: Plan) -> Generator[None, None, dict[TileKey, Fields]]:
        """Fields of tiles of one level, from the cache or made now, with others of the plan beside them; yields where
        the work can be left."""
        out: dict[TileKey, Fields | None] = {key: self.cache.get(self.content(key)) for key in keys}
        self._waiting[id(out)] = out
        try:
            while missing := [key for key, field in out.items() if field is None]:
                left = [key for key in missing if not self._is_under_way(key)]
                if left:
                    yield from self._begun(left[0], set(left), plan)
                else:
                    yield from self._oldest()
        finally:
            del self._waiting[id(out)]
        return {key: field for key, field in out.items() if field is not None}

    def _begun(self, first: TileKey, others: Set[TileKey], plan: Plan) -> Generator[None, None, None]:
        """Begins the step of ``first`` and of those of the others and of the plan that go with it, after making what it
        needs of the parent level."""
        level = first.level
        box = group_around(first, {first} | others | plan[level])
        x0, y0, x1, y1 = box
        at = step(level, Span(y0 * TILE_CELLS, y1 * TILE_CELLS + 1, x0 * TILE_CELLS, x1 * TILE_CELLS + 1))
        parent = yield from self._parent(at, plan)
        while len(self._under_way) >= self._engine.ahead:
            yield from self._oldest()
        for begun in tuple(self._under_way):
            yield from self._until(begun.pending, lambda pending: pending.prepared)
        self._under_way.append(_Begun(level, box, self._engine.begin(at, self._strokes, parent)))
        plan[level].difference_update(keys_of(level, box))
        yield

    def _oldest(self) -> Generator[None, None, None]:
        """Finishes the oldest step under way."""
        oldest = self._under_way[0]
        yield from self._until(oldest.pending, lambda pending: pending.ready)
        if self._under_way and self._under_way[0] is oldest:
            self._finish()

    def _until(self, pending: Pending, enough: Callable[[Pending], bool]) -> Generator[None, None, None]:
        """Waits for a step for those who may be interrupted; the others wait where they need it, without a look at the
        clock."""
        while self._urgent is not None and not enough(pending):
            if self._urgent():
                yield
            if not pending.poll():
                time.sleep(LOOK_SECONDS)

    def _is_under_way(self, key: TileKey) -> bool:
        return any(begun.holds(key) for begun in self._under_way)

    def _finish(self) -> None:
        """Waits for the oldest step under way and keeps its tiles."""
        begun = self._under_way.popleft()
        fields = begun.pending.fields()
        x0, y0 = begun.box[:2]
        for key in keys_of(begun.level, begun.box):
            r, c = (key.y - y0) * TILE_CELLS, (key.x - x0) * TILE_CELLS
            tile = fields[:, r : r + TILE_SAMPLES, c : c + TILE_SAMPLES].copy()
            tile.flags.writeable = False
            self.cache.put(self.content(key), tile)
            for waiting in self._waiting.values():
                if key in waiting:
                    waiting[key] = tile

    def _parent(self, at: Step, plan: Plan) -> Generator[None, None, Fields]:
        """Returns the span of the next coarser level that a step reads."""
        p = at.parent
        if at.level - 1 == self.basis.level:
            return self._ground[:, p.r0 : p.r1, p.c0 : p.c1]
        out = np.empty((CHANNELS, *p.shape), dtype=np.float32)
        tiles = yield from self._made(keys_of(at.level - 1, tiles_over(p, at.level - 1)), plan)
        for key, field in tiles.items():
            paste(out, p, key, field)
        return out

    def _digest(self, key: TileKey) -> bytes:
        low = self.basis.level
        side = 1 << key.level if 0 <= key.level <= MAX_REFINED_LEVEL else 0
        if key.level <= low or not (0 <= key.x < side and 0 <= key.y < side):
            raise ValueError(f"{key} is not a tile of levels {low + 1}..{MAX_REFINED_LEVEL}")
        span, level = span_of(key), key.level
        at = step(level, span)
        out = blake2b(repr((low, tuple(key))).encode(), digest_size=DIGEST_BYTES)
        while True:
            if self._base is not None:
                out.update(self._base.digest(level, at.window))
            if level == low + 1:
                break
            level -= 1
            at = step(level, samples_of(tiles_over(at.parent, level)))
        out.update(self._strokes.digest(at.level, at.box))
        for ground in keys_of(low, tiles_over(at.parent, low)):
            out.update(self._ground_digest(ground))
        return out.digest()

    def _ground_digest(self, key: TileKey) -> bytes:
        known = self._digests.get(key)
        if known is None:
            s = span_of(key)
            part = np.ascontiguousarray(self._ground[:, s.r0 : s.r1, s.c0 : s.c1])
            known = self._digests[key] = blake2b(part.tobytes(), digest_size=DIGEST_BYTES).digest()
        return known


class Refinery:
    """The parts that the refiners of one solver share: the kernels' memory on ``device`` (None: NumPy) and the cache.

    Refinement has row-wise kernels only; a GPU runs them too, correctly and slowly.
    """

    def __init__(self, device: Device | None, cache_bytes: int = CACHE_BYTES, shapes: Shapes | None = None) -> None:
        self.cache = FieldCache(cache_bytes)
        self._device, self._blocks, self._shapes = device, BlockCache(), shapes
        self._engine: Engine | None = None
        self._looked_at = -math.inf
        """When somebody asked last whether there is anything to give back, and there was a step since."""
        self._steps = 0

    def refiner(self, basis: Basis) -> Refiner:
        """A refiner of a settled solve of the same solver. Raises DeviceError."""
        if self._engine is None:
            self._engine = NumpyEngine() if self._device is None else ClEngine(row_kernels(self._device))
        return Refiner(basis, self._engine, self.cache, self._blocks, self._shapes)

    def tidy(self, now: float) -> bool:
        """Gives back the memory of steps, and what is kept between them, when none was begun for SPARE_SECONDS; whether
        there was any."""
        if self._engine is None or self._engine.is_empty:
            return False
        if self._engine.begun != self._steps:
            self._steps, self._looked_at = self._engine.begun, now
        if now - self._looked_at < SPARE_SECONDS or not self._engine.release():
            return False
        self.cache.clear()
        self._blocks.clear()
        return True
