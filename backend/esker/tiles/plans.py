"""Frames decided but not yet coded, and the cache of coded tiles (DESIGN 6).

A plan holds immutable arrays only: it may be encoded in any thread, at any time, and always gives the same bytes.
"""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from esker.contract import Channel, Filter, FrameKind, Predictor
from esker.grid import TileKey
from esker.tiles.codec import coding
from esker.tiles.codec.filters import pack_smallest
from esker.tiles.codec.frame import FrameHead, TileRecord, ratio, write_frame
from esker.tiles.codec.payload import Ints, Wide, child_window, cost, predict

CACHE_BYTES: Final = 16 << 20
"""A room's cache of coded tiles: with small tiles, which only seem to take nothing, what 32 MiB of payloads were."""

DIFFERENCES: Final = (Filter.ROW, Filter.PLANE)

ENTRY_BYTES: Final = 640
"""What an entry of the cache takes beside its payload. While somebody draws most payloads are smaller."""

CacheKey = tuple[int, int, int, int, int, int, int, int]
"""Channel; level, x and y of the tile; its version, its parent's version; then the versions of both that the tile may
be predicted from instead, 0 for none."""
_Coded = tuple[int, int, int, int, int, int, bytes, int]
"""The fields of a ``TileRecord``. Numbers and bytes in plain tuples are nothing that Python's garbage collector goes
through: a cache of records and keys was most of what it did, and the whole server waits for it."""


class EncodedTiles:
    """The coded tiles used last, by (key, version, base version), shared by all clients of a room; safe across
    threads."""

    def __init__(self, limit: int = CACHE_BYTES) -> None:
        """``limit``: bytes of payloads and of what entries take beside them."""
        self._limit = limit
        self._lock = threading.Lock()
        self._items: OrderedDict[CacheKey, _Coded] = OrderedDict()
        self._bytes = 0

    def get(self, key: CacheKey) -> TileRecord | None:
        """Returns the coded tile, or None."""
        with self._lock:
            found = self._items.get(key)
            if found is None:
                return None
            self._items.move_to_end(key)
        return _record(found)

    def put(self, key: CacheKey, value: TileRecord) -> None:
        """Keeps a coded tile and forgets the least recently used ones above the limit."""
        with self._lock:
            if key in self._items:
                return
            self._items[key] = _plain(value)
            self._bytes += len(value.payload) + ENTRY_BYTES
            while self._bytes > self._limit and len(self._items) > 1:
                payload = self._items.popitem(last=False)[1][_PAYLOAD]
                self._bytes -= len(payload) + ENTRY_BYTES

    @property
    def bytes(self) -> int:
        """Bytes that are counted."""
        return self._bytes


_PAYLOAD: Final = 6


def _plain(tile: TileRecord) -> _Coded:
    numbers = tile.x, tile.y, int(tile.predictor), tile.shift, tile.version, tile.base_version
    return *numbers, bytes(tile.payload), int(tile.filter)


def _record(coded: _Coded) -> TileRecord:
    x, y, predictor, shift, version, base_version, payload, kind = coded
    return TileRecord(x, y, Predictor(predictor), shift, version, base_version, payload, Filter(kind))


@dataclass(frozen=True, eq=False)
class TileState:
    """A tile at one of its versions: (65, 65) int32 quanta of its level, never changed."""

    version: int
    samples: Ints


@dataclass(frozen=True, eq=False)
class TilePlan:
    """A tile to send, and all that it may be predicted from.

    ``parent``: as the client holds it when the frame arrives; None at level 0. ``before``, ``parent_before``: the same
    tile as the client holds it, and the parent as it was then, where the server still knows them.
    """

    key: TileKey
    now: TileState
    parent: TileState | None
    before: TileState | None = None
    parent_before: TileState | None = None

    def cache_key(self, channel: Channel) -> CacheKey:
        """Returns all that the coded bytes depend on."""
        parent, before, above = (0 if s is None else s.version for s in (self.parent, self.before, self.parent_before))
        return int(channel), *self.key, self.now.version, parent, before, above


@dataclass(frozen=True, eq=False)
class FramePlan:
    """A frame decided but not yet coded. ``source`` is for the ledger that planned it."""

    kind: FrameKind
    channel: Channel
    level: int
    clock: int
    settled: bool
    tiles: tuple[TilePlan, ...]
    drops: tuple[TileKey, ...]
    source: object
    cache: EncodedTiles
    smooth: bool = False
    """Whether residuals are smooth, so that filters are worth trying: those of refined tiles are."""

    @property
    def keys(self) -> tuple[TileKey, ...]:
        """The tiles that the frame carries."""
        return tuple(tile.key for tile in self.tiles)

    def encode(self) -> bytes:
        """Returns the binary frame. The function is pure: the same plan always gives the same bytes."""
        predictions: dict[tuple[TileKey, int], Wide] = {}
        scale = ratio(self.channel)

        def predicted(key: TileKey, state: TileState) -> Wide:
            """Returns the part of its parent's prediction that belongs to ``key``: made once for all four children."""
            place = (key.parent(), state.version)
            if place not in predictions:
                predictions[place] = predict(state.samples, scale)
            return child_window(predictions[place], key.x, key.y)

        def coded(tile: TilePlan) -> TileRecord:
            name = tile.cache_key(self.channel)
            data = self.cache.get(name)
            if data is None:
                data = _coded(tile, predicted, self.smooth)
                self.cache.put(name, data)
            return data

        head = FrameHead(self.kind, self.level, self.clock, self.settled, self.channel)
        return write_frame(head, [(d.x, d.y) for d in self.drops], coding.in_two(coded, self.tiles))


def _coded(tile: TilePlan, predicted: Callable[[TileKey, TileState], Wide], smooth: bool) -> TileRecord:
    """Codes a tile with the cheapest of its predictors, and the smallest of the filters that are worth a try."""
    if tile.parent is not None and not smooth:
        own = predicted(tile.key, tile.parent)
        before, then = tile.before, tile.parent_before
        held = None if before is None else before.samples
        found = coding.code(tile.now.samples, own, held, None if then is None else predicted(tile.key, then))
        if found is not None:
            base = tile.parent.version if before is None or found.predictor == Predictor.PARENT else before.version
            return TileRecord(
                tile.key.x,
                tile.key.y,
                found.predictor,
                found.shift,
                tile.now.version,
                base,
                found.payload,
                found.filter,
            )
    kind, base_version, residual = min(_options(tile, predicted), key=lambda option: cost(option[2]))
    if kind == Predictor.ZERO:
        filters: tuple[Filter, ...] = DIFFERENCES
    else:
        filters = (Filter.LATTICE, *DIFFERENCES) if smooth else (Filter.LATTICE,)
    made, shift, payload = pack_smallest(residual, filters)
    return TileRecord(tile.key.x, tile.key.y, kind, shift, tile.now.version, base_version, payload, made)


def _options(tile: TilePlan, predicted: Callable[[TileKey, TileState], Wide]) -> list[tuple[Predictor, int, Wide]]:
    """Returns each way to predict a tile: predictor, version of what it predicts from, and residual."""
    key, now, parent, before, then = tile.key, tile.now, tile.parent, tile.before, tile.parent_before
    found: list[tuple[Predictor, int, Wide]] = []
    moved: Wide | None = None
    if parent is None:
        found.append((Predictor.ZERO, 0, now.samples.astype(np.int64)))
    else:
        own = predicted(key, parent).astype(np.int64)
        found.append((Predictor.PARENT, parent.version, now.samples - own))
        if then is not None:
            moved = own - predicted(key, then)
    if before is not None:
        change: Wide = now.samples - before.samples.astype(np.int64)
        found.append((Predictor.PREVIOUS if parent is None else Predictor.HELD, before.version, change))
        if moved is not None:
            found.append((Predictor.PREVIOUS, before.version, change - moved))
    return [option for option in found if np.abs(option[2]).max() < 1 << 31]
