"""The ground of a tile server at one moment, for whoever computes beside the tile thread (docs/water.md)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from esker import grid
from esker.tiles.channels import values
from esker.tiles.delivery import TileServer
from esker.tiles.surface import total

Grid = NDArray[np.float32]


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
