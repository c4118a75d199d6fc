"""Binary frames (DESIGN 6): layout of the contract's FRAME_HEADER, TILE_DROP, TILE_HEADER, written and read.

A frame is the header, then the drops, then for each tile its header and payload; nothing follows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from esker.contract import (
    CHANNEL_LEVELS_BELOW,
    FRAME_HEADER,
    FRAME_MAGIC,
    FRAME_SETTLED,
    MAX_LEVEL,
    MAX_REFINED_LEVEL,
    PROTOCOL_VERSION,
    TILE_DROP,
    TILE_HEADER,
    Channel,
    Filter,
    FrameKind,
    Predictor,
)
from esker.tiles.codec import MAX_PAYLOAD


class FrameError(ValueError):
    """A frame that is truncated, malformed or does not fit what its receiver holds."""


@dataclass(frozen=True)
class FrameHead:
    """Header of a frame. ``settled``: the level is final for ``clock``."""

    kind: FrameKind
    level: int
    clock: int
    settled: bool
    channel: Channel = Channel.HEIGHT


GROUND: Final = frozenset({Channel.HEIGHT, Channel.BASE})
"""The channels in quanta of heights, with all levels: what is drawn is their sum."""


def ratio(channel: Channel) -> int:
    """Quanta of a level in one of the next coarser level: heights halve their step, the other channels keep it."""
    return 2 if channel in GROUND else 1


def finest_level(channel: Channel) -> int:
    """The finest level that a frame of this channel may have."""
    return MAX_REFINED_LEVEL if channel in GROUND else MAX_LEVEL - CHANNEL_LEVELS_BELOW


@dataclass(frozen=True)
class TileRecord:
    """One coded tile, with the header's fields by name.

    ``base_version``: of the parent for ``Predictor.PARENT``, of the same tile as held for ``PREVIOUS``, 0 for ``ZERO``.
    """

    x: int
    y: int
    predictor: Predictor
    planes: int
    version: int
    base_version: int
    payload: bytes | memoryview
    filter: Filter = Filter.NONE


def write_tile(tile: TileRecord) -> bytes:
    """Tile header and payload."""
    head = np.zeros((), dtype=TILE_HEADER)
    head["x"], head["y"], head["predictor"], head["planes"] = tile.x, tile.y, tile.predictor, tile.planes
    head["version"], head["base_version"], head["bytes"] = tile.version, tile.base_version, len(tile.payload)
    head["filter"] = tile.filter
    return head.tobytes() + bytes(tile.payload)


def write_frame(head: FrameHead, drops: Sequence[tuple[int, int]], tiles: Sequence[bytes]) -> bytes:
    """A whole frame. ``drops``: (x, y); ``tiles``: results of ``write_tile``."""
    start = np.zeros((), dtype=FRAME_HEADER)
    start["magic"], start["protocol"], start["kind"] = FRAME_MAGIC, PROTOCOL_VERSION, head.kind
    start["level"], start["channel"], start["clock"] = head.level, head.channel, head.clock & 0xFFFFFFFF
    start["flags"] = FRAME_SETTLED if head.settled else 0
    start["tiles"], start["drops"] = len(tiles), len(drops)
    gone = np.array(list(drops), dtype=TILE_DROP)
    return b"".join([start.tobytes(), gone.tobytes(), *tiles])


def read_frame(data: bytes | memoryview) -> tuple[FrameHead, list[tuple[int, int]], list[TileRecord]]:
    """Takes a frame apart without inflating it; payloads are views. Raises FrameError with what is wrong."""
    view = memoryview(data)
    if len(view) < FRAME_HEADER.itemsize:
        raise FrameError("the frame ends inside its header")
    start = np.frombuffer(view, dtype=FRAME_HEADER, count=1)[0]
    head = _head(start)
    side = 1 << head.level
    at = FRAME_HEADER.itemsize
    count = int(start["drops"])
    if len(view) < at + count * TILE_DROP.itemsize:
        raise FrameError("the frame ends inside its list of dropped tiles")
    drops = [(int(d["x"]), int(d["y"])) for d in np.frombuffer(view, dtype=TILE_DROP, count=count, offset=at)]
    at += count * TILE_DROP.itemsize
    tiles: list[TileRecord] = []
    for _ in range(int(start["tiles"])):
        if len(view) < at + TILE_HEADER.itemsize:
            raise FrameError("the frame ends inside a tile header")
        h = np.frombuffer(view, dtype=TILE_HEADER, count=1, offset=at)[0]
        at += TILE_HEADER.itemsize
        size = int(h["bytes"])
        if size > MAX_PAYLOAD:
            raise FrameError(f"a tile payload of {size} bytes is too large")
        if len(view) < at + size:
            raise FrameError("the frame ends inside a tile payload")
        tiles.append(_record(h, view[at : at + size]))
        at += size
    if at != len(view):
        raise FrameError(f"{len(view) - at} bytes follow the last tile")
    places = [(t.x, t.y) for t in tiles]
    if any(x >= side or y >= side for x, y in places + drops):
        raise FrameError(f"a tile lies outside level {head.level}")
    if len(set(places)) != len(places):
        raise FrameError("a tile occurs twice")
    return head, drops, tiles


def _head(start: np.void) -> FrameHead:
    if start["magic"] != FRAME_MAGIC:
        raise FrameError("this is not an Esker frame")
    if start["protocol"] != PROTOCOL_VERSION:
        raise FrameError(f"frame protocol {start['protocol']} is not {PROTOCOL_VERSION}")
    if start["kind"] not in (FrameKind.LEVEL, FrameKind.FILL):
        raise FrameError(f"unknown frame kind {start['kind']}")
    if start["channel"] not in tuple(Channel):
        raise FrameError(f"unknown channel {start['channel']}")
    channel = Channel(int(start["channel"]))
    if start["level"] > finest_level(channel):
        raise FrameError(f"level {start['level']} is above {finest_level(channel)}")
    settled = bool(start["flags"] & FRAME_SETTLED)
    return FrameHead(FrameKind(int(start["kind"])), int(start["level"]), int(start["clock"]), settled, channel)


def _record(h: np.void, payload: memoryview) -> TileRecord:
    if h["predictor"] not in tuple(Predictor):
        raise FrameError(f"unknown predictor {h['predictor']}")
    if h["filter"] not in tuple(Filter):
        raise FrameError(f"unknown filter {h['filter']}")
    return TileRecord(
        x=int(h["x"]),
        y=int(h["y"]),
        predictor=Predictor(int(h["predictor"])),
        planes=int(h["planes"]),
        version=int(h["version"]),
        base_version=int(h["base_version"]),
        payload=payload,
        filter=Filter(int(h["filter"])),
    )
