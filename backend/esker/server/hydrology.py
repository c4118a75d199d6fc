"""Finds the rivers of open terrains, with the detail on their ground: ``session.rivers.Hydrology`` (docs/water.md)."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import NDArray

from esker import contract as c
from esker import grid
from esker.flow.reaches import UNITS_PER_CELL, Reaches, find_reaches
from esker.flow.rivers import water_of
from esker.process import priority
from esker.session.ground.frames.tilethread import Lane, TileThread
from esker.session.rivers import Pace
from esker.synthesis.detailed import DetailedTerrain, site_of
from esker.tiles.channels import values
from esker.tiles.codec.rivers import RiverLine, write_rivers
from esker.tiles.delivery import TileServer
from esker.tiles.surface import total

Grid = NDArray[np.float32]
FEWER = 0.5
"""Where all rivers do not fit a frame, so many times as many are looked for."""


@dataclass(frozen=True)
class Snapshot:
    """A level as clients have it. ``heights``: the ground as it is drawn without detail, (N_l, N_l) float32 metres;
    ``channels``: the finest level of each that is held, in its unit, by its name in small letters."""

    clock: int
    level: int
    heights: Grid
    channels: Mapping[str, Grid] = field(default_factory=dict)


def snapshot(server: TileServer, level: int) -> Snapshot | None:
    """The ground of ``level``, or of the finest level above it that is there; None before there is any.

    Call it in the tile thread. What it reads never changes, so the rest of the work may be done anywhere.
    """
    there = [k for k in range(min(level, server.pyramid.top) + 1) if server.pyramid.level(k) is not None]
    if not there:
        return None
    offset, base = server.pyramid.level(there[-1]), server.base.level(there[-1])
    assert offset is not None
    samples = offset.samples if base is None else total(offset.samples, base.samples)
    heights = (samples * grid.quantum(there[-1], server.pyramid.size_m)).astype(np.float32)
    channels = {}
    for channel, pyramid in server.channels.items():
        held = [found for k in range(pyramid.top + 1) if (found := pyramid.level(k)) is not None]
        if held:
            channels[channel.name.lower()] = values(held[-1].samples, channel)
    return Snapshot(offset.clock, there[-1], heights, channels)


class Hydrology:
    """One thread of low priority for the rivers of all terrains, whose homes have turns: of sixty rooms that one
    stranger opened one is looked at before the next home has its own. Safe from any thread."""

    def __init__(self, prepare: Callable[[threading.Event], None] = lambda _: None) -> None:
        """``prepare``: called in the thread before the first search; it ends when its event is set (``close``)."""
        self.pace = Pace()
        self._closed = threading.Event()
        self._thread = TileThread("rivers", begin=partial(self._begin, prepare))

    def _begin(self, prepare: Callable[[threading.Event], None]) -> None:
        priority.yield_to_others()
        prepare(self._closed)

    def lane(self) -> Lane:
        """Returns a place for the searches of one room."""
        return self._thread.lane()

    def find(
        self,
        lane: Lane,
        ground: Snapshot,
        settings: c.TerrainSettings,
        span_m: tuple[float, float] | None,
        settled: bool,
        is_wanted: Callable[[], bool] = lambda: True,
    ) -> Future[bytes | None]:
        """Begins to look; the outcome is a frame of all rivers, None where ``is_wanted`` said no on the way.

        ``span_m``: lowest and highest sample of the elevation layers. Raises RuntimeError after ``close``.
        """
        return lane.submit(_frame_unless, is_wanted, ground, settings, span_m, settled)

    def close(self) -> None:
        """Drops what waits, and takes no more."""
        self._closed.set()
        self._thread.shutdown(wait=False, cancel_futures=True)


class _Overtaken(Exception):
    """Newer ground is there."""


def _frame_unless(
    is_wanted: Callable[[], bool],
    ground: Snapshot,
    settings: c.TerrainSettings,
    span_m: tuple[float, float] | None,
    settled: bool,
) -> bytes | None:
    def check(_: float = 0.0) -> None:
        if not is_wanted():
            raise _Overtaken

    try:
        check()
        return frame_of(ground, settings, span_m, settled, check)
    except _Overtaken:
        return None


def frame_of(
    ground: Snapshot,
    settings: c.TerrainSettings,
    span_m: tuple[float, float] | None,
    settled: bool,
    progress: Callable[[float], None] | None = None,
) -> bytes:
    """The rivers of a ground as a frame of MAX_RIVER_BYTES at most; where there are more, the largest.

    ``progress`` is told the share of the detail that is done, which is what takes time; what it raises ends it.
    """
    every = slice(0, grid.samples(ground.level))
    site = site_of(settings, ground.heights, ground.channels, ground_m=span_m)
    heights = DetailedTerrain(site).heights(ground.level, every, every, progress)
    water = water_of(heights, settings.size_m, settings.sea_level_m)
    many = settings.rivers
    while True:
        lines = _lines(find_reaches(water, many), grid.spacing(ground.level, settings.size_m))
        frame = write_rivers(ground.clock, ground.level, settled, lines) if len(lines) < 1 << 16 else b""
        if 0 < len(frame) <= c.MAX_RIVER_BYTES:
            return frame
        many *= FEWER


def _lines(reaches: Reaches, cell_m: float) -> list[RiverLine]:
    part = UNITS_PER_CELL // c.RIVER_UNITS_PER_CELL
    points = (reaches.points + part // 2) // part
    codes = np.rint(c.RIVER_AREA_STEPS * (np.log2(np.maximum(reaches.areas, 1)) + 2 * math.log2(cell_m))).astype(int)
    return [
        RiverLine(
            tuple((int(x), int(y)) for x, y in points[reaches.start[k] : reaches.start[k + 1]]),
            (int(codes[k, 0]), int(codes[k, 1])),
            int(reaches.next[k]) if reaches.next[k] >= 0 else None,
        )
        for k in range(len(reaches))
    ]
