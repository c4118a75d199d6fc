"""Binary frames (DESIGN 6): layout of the contract's FRAME_HEADER and TILE_DROP and of its tiles, written and read.

A frame is the header, then the drops, then for each tile a few short numbers and its payload; nothing follows.
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
    TILE_FILTER_BITS,
    TILE_MAX_SHIFT,
    TILE_PREDICTOR_BITS,
    Channel,
    Filter,
    FrameKind,
    Predictor,
)
from esker.tiles.codec.entropy import MAX_BYTES


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
"""Channels in quanta of heights, with all levels: the ground that is drawn is their sum."""


def ratio(channel: Channel) -> int:
    """Returns the quanta of a level in one of the next coarser level: heights halve their step, the other channels keep
    it."""
    return 2 if channel in GROUND else 1


def finest_level(channel: Channel) -> int:
    """Returns the finest level that a frame of this channel may have."""
    return MAX_REFINED_LEVEL if channel in GROUND else MAX_LEVEL - CHANNEL_LEVELS_BELOW


@dataclass(frozen=True)
class TileRecord:
    """One coded tile. ``base_version``: of the parent for ``Predictor.PARENT``, of the same tile as held for
    ``PREVIOUS`` and ``HELD``, 0 for ``ZERO``; versions have 32 bits. ``shift``: see ``payload.pack``."""

    x: int
    y: int
    predictor: Predictor
    shift: int
    version: int
    base_version: int
    payload: bytes | memoryview
    filter: Filter = Filter.NONE


def write_frame(head: FrameHead, drops: Sequence[tuple[int, int]], tiles: Sequence[TileRecord]) -> bytes:
    """A whole frame. ``drops``: (x, y)."""
    start = np.zeros((), dtype=FRAME_HEADER)
    start["magic"], start["protocol"], start["kind"] = FRAME_MAGIC, PROTOCOL_VERSION, head.kind
    start["level"], start["channel"], start["clock"] = head.level, head.channel, head.clock & 0xFFFFFFFF
    start["flags"] = FRAME_SETTLED if head.settled else 0
    start["tiles"], start["drops"] = len(tiles), len(drops)
    out = bytearray(start.tobytes() + np.array(list(drops), dtype=TILE_DROP).tobytes())
    version = base = 0
    for tile in tiles:
        coding = tile.predictor | tile.filter << TILE_PREDICTOR_BITS
        coding |= tile.shift << (TILE_PREDICTOR_BITS + TILE_FILTER_BITS)
        for number in (tile.x, tile.y, coding, folded(tile.version - version), folded(tile.base_version - base)):
            write_number(out, number)
        write_number(out, len(tile.payload))
        out += tile.payload
        version, base = tile.version, tile.base_version
    return bytes(out)


def unfolded(number: int) -> int:
    """The number that ``folded`` made so."""
    return -(number + 1) // 2 if number & 1 else number // 2


def folded(number: int) -> int:
    """Maps 0, -1, 1, -2, 2 ... to 0, 1, 2, 3, 4 ..."""
    return 2 * number if number >= 0 else -2 * number - 1


def write_number(out: bytearray, number: int) -> None:
    """Writes LEB128: seven bits a byte, the lowest first, the highest bit set where more follow."""
    while number > 127:
        out.append(number & 127 | 128)
        number >>= 7
    out.append(number)


class NumberReader:
    """A reader of the rest of a frame. ``version``, ``base``: those of the tile before."""

    def __init__(self, view: memoryview) -> None:
        self.view, self.at, self.version, self.base = view, 0, 0, 0

    def number(self) -> int:
        """Returns the next number; raises FrameError beyond 35 bits or the end."""
        value = 0
        for shift in range(0, 35, 7):
            if self.at >= len(self.view):
                break
            byte = self.view[self.at]
            self.at += 1
            value |= (byte & 127) << shift
            if byte < 128:
                return value
        raise FrameError("the frame ends inside its numbers, or one of them is too long")

    def version_after(self, last: int) -> int:
        """Returns a version, written as the difference to one before it."""
        version = last + unfolded(self.number())
        if not 0 <= version <= 0xFFFFFFFF:
            raise FrameError(f"version {version} has more than 32 bits")
        return version

    def tile(self) -> TileRecord:
        """Returns the next tile; its payload is a view."""
        x, y, coding = self.number(), self.number(), self.number()
        predictor = coding & (1 << TILE_PREDICTOR_BITS) - 1
        kind = coding >> TILE_PREDICTOR_BITS & (1 << TILE_FILTER_BITS) - 1
        shift = coding >> (TILE_PREDICTOR_BITS + TILE_FILTER_BITS)
        if shift > TILE_MAX_SHIFT:
            raise FrameError(f"residuals are shifted by {TILE_MAX_SHIFT} bits at most, not {shift}")
        self.version, self.base = self.version_after(self.version), self.version_after(self.base)
        size = self.number()
        if size > MAX_BYTES:
            raise FrameError(f"a tile payload of {size} bytes is too large")
        if len(self.view) < self.at + size:
            raise FrameError("the frame ends inside a tile payload")
        payload = self.view[self.at : self.at + size]
        self.at += size
        return TileRecord(x, y, Predictor(predictor), shift, self.version, self.base, payload, Filter(kind))


def read_frame(data: bytes | memoryview) -> tuple[FrameHead, list[tuple[int, int]], list[TileRecord]]:
    """Takes a frame apart without decoding its tiles; payloads are views. Raises FrameError with what is wrong."""
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
    reader = NumberReader(view[at:])
    tiles = [reader.tile() for _ in range(int(start["tiles"]))]
    if reader.at != len(reader.view):
        raise FrameError(f"{len(reader.view) - reader.at} bytes follow the last tile")
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
