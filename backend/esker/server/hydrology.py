"""Finds the rivers of open terrains, with the detail on their ground: ``session.rivers.Hydrology`` (docs/water.md)."""

from __future__ import annotations

import math
from concurrent.futures import Future, ThreadPoolExecutor

import numpy as np

from esker import contract as c
from esker import grid
from esker.flow.reaches import UNITS_PER_CELL, Reaches, find_reaches
from esker.flow.rivers import water_of
from esker.process import priority
from esker.synthesis.detailed import DetailedTerrain, site_of
from esker.tiles.codec.rivers import RiverLine, write_rivers
from esker.tiles.snapshot import Snapshot

FEWER = 0.5
"""Where all rivers do not fit a frame, so many times as many are looked for."""


class Hydrology:
    """One thread of low priority for the rivers of all terrains. Safe from any thread."""

    def __init__(self) -> None:
        self._thread = ThreadPoolExecutor(1, "rivers", initializer=priority.yield_to_others)

    def find(
        self, ground: Snapshot, settings: c.TerrainSettings, span_m: tuple[float, float] | None, settled: bool
    ) -> Future[bytes]:
        """Begins to look; the outcome is a frame of all rivers. ``span_m``: lowest and highest sample of the elevation
        layers. Raises RuntimeError after ``close``."""
        return self._thread.submit(frame_of, ground, settings, span_m, settled)

    def close(self) -> None:
        """Drops what waits, and takes no more."""
        self._thread.shutdown(wait=False, cancel_futures=True)


def frame_of(ground: Snapshot, settings: c.TerrainSettings, span_m: tuple[float, float] | None, settled: bool) -> bytes:
    """The rivers of a ground as a frame of MAX_RIVER_BYTES at most; where there are more, the largest."""
    every = slice(0, grid.samples(ground.level))
    site = site_of(settings, ground.heights, ground.channels, ground_m=span_m)
    heights = DetailedTerrain(site).window(ground.level, every, every).heights
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
