"""Frames of rivers: all lines of a terrain as bytes, and back (twin of ``frontend/src/net/rivers.ts``)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from esker.contract import (
    FRAME_HEADER,
    FRAME_MAGIC,
    FRAME_SETTLED,
    MAX_LEVEL,
    MAX_RIVER_BYTES,
    PROTOCOL_VERSION,
    RIVER_UNITS_PER_CELL,
    TILE_CELLS,
    FrameKind,
)
from esker.tiles.codec.frame import FrameError, NumberReader, folded, unfolded, write_number

Points = tuple[tuple[int, int], ...]


@dataclass(frozen=True)
class RiverLine:
    """One river. ``points``: x and y in RIVER_UNITS_PER_CELL. ``areas``: at its head and its end, RIVER_AREA_STEPS
    times the binary logarithm of m2. ``into``: the index of the river that it runs into, None for none."""

    points: Points
    areas: tuple[int, int]
    into: int | None


@dataclass(frozen=True)
class RiverFrame:
    """All rivers of a terrain at one clock, found on the samples of ``level``."""

    clock: int
    level: int
    settled: bool
    rivers: tuple[RiverLine, ...]


def write_rivers(clock: int, level: int, settled: bool, rivers: Sequence[RiverLine]) -> bytes:
    """A whole frame. A river comes before the one that it runs into."""
    start = np.zeros((), dtype=FRAME_HEADER)
    start["magic"], start["protocol"], start["kind"] = FRAME_MAGIC, PROTOCOL_VERSION, FrameKind.RIVERS
    start["level"], start["clock"] = level, clock & 0xFFFFFFFF
    start["flags"], start["tiles"] = FRAME_SETTLED if settled else 0, len(rivers)
    out = bytearray(start.tobytes())
    for k, river in enumerate(rivers):
        head, end = river.areas
        x, y = river.points[0]
        into = 0 if river.into is None else river.into - k
        for number in (len(river.points), x, y, folded(head), folded(end - head), into):
            write_number(out, number)
        for u, v in river.points[1:]:
            write_number(out, folded(u - x))
            write_number(out, folded(v - y))
            x, y = u, v
    return bytes(out)


def is_rivers(data: bytes | memoryview) -> bool:
    """Whether a binary frame has rivers, and no tiles."""
    at = FRAME_HEADER.fields["kind"][1] if FRAME_HEADER.fields else 0
    return len(data) > at and data[at] == FrameKind.RIVERS


def read_rivers(data: bytes | memoryview) -> RiverFrame:
    """Takes a frame of rivers apart. Raises FrameError with what is wrong."""
    if not FRAME_HEADER.itemsize <= len(data) <= MAX_RIVER_BYTES:
        raise FrameError(f"a frame of rivers has {FRAME_HEADER.itemsize} to {MAX_RIVER_BYTES} bytes, not {len(data)}")
    start = np.frombuffer(data, dtype=FRAME_HEADER, count=1)[0]
    if start["magic"] != FRAME_MAGIC or start["kind"] != FrameKind.RIVERS:
        raise FrameError("this is no frame of rivers")
    if start["protocol"] != PROTOCOL_VERSION:
        raise FrameError(f"frame protocol {start['protocol']} is not {PROTOCOL_VERSION}")
    if start["level"] > MAX_LEVEL or start["channel"] or start["drops"]:
        raise FrameError("a frame of rivers has a level, no channel and no dropped tiles")
    level, count = int(start["level"]), int(start["tiles"])
    reader = NumberReader(memoryview(data)[FRAME_HEADER.itemsize :])
    rivers = tuple(_river(reader, k, count, level) for k in range(count))
    if reader.at != len(reader.view):
        raise FrameError(f"{len(reader.view) - reader.at} bytes follow the last river")
    return RiverFrame(int(start["clock"]), level, bool(start["flags"] & FRAME_SETTLED), rivers)


def _river(reader: NumberReader, own: int, count: int, level: int) -> RiverLine:
    size = reader.number()
    x, y = reader.number(), reader.number()
    head = unfolded(reader.number())
    end = head + unfolded(reader.number())
    into = reader.number()
    if not 2 <= size <= len(reader.view):
        raise FrameError(f"a river has at least two points, and no more than its frame has bytes, not {size}")
    if into and own + into >= count:
        raise FrameError(f"river {own} runs into river {own + into} of {count}")
    points = [(x, y)]
    for _ in range(size - 1):
        x, y = x + unfolded(reader.number()), y + unfolded(reader.number())
        points.append((x, y))
    most = (TILE_CELLS << level) * RIVER_UNITS_PER_CELL
    if any(not (0 <= u <= most and 0 <= v <= most) for u, v in points):
        raise FrameError("a river leaves the terrain")
    return RiverLine(tuple(points), (head, end), own + into if into else None)
