"""The program for GPUs: which tiles a device can hold, and the source that is compiled for them (DESIGN 5.3).

A tile is what one work-group does of a level: ``width`` x (``strips`` * ``rows``) samples, HALO of them on each side
shared with the neighbours; a work-item owns ``rows`` samples of a column. Which tile does a sample does not change its
bits, so the choice is one of speed alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from esker.contract import CHEBYSHEV_SWEEPS, TILE_CELLS
from esker.solve.reference import BOTTOM_LEVELS

HALO = CHEBYSHEV_SWEEPS + 2
"""A sample more a side for every sweep, one for the residual, one for its restriction."""
CHANNELS = (1, 2)
CHANGE_ITEMS = 256
CHAIN = 8
"""Samples a side of the coarsest of three levels that one work-group restricts to in one launch."""
CHAIN_ITEMS = 256
BIN_ITEMS = 256
"""Work-items of a rasteriser's bin, one a sample."""
BOTTOM_SAMPLES = sum(((TILE_CELLS >> k) + 1) ** 2 for k in range(BOTTOM_LEVELS + 1))
_BOTTOM_BYTES = 4 * (2 * BOTTOM_SAMPLES - (TILE_CELLS + 1) ** 2)
_ITEMS = (1024, 512, 256, 128, 64)


@dataclass(frozen=True)
class Tile:
    """A work-group's share of a visit."""

    width: int
    strips: int
    rows: int

    @property
    def height(self) -> int:
        """Rows of samples, halo included."""
        return self.strips * self.rows

    @property
    def items(self) -> int:
        """Work-items."""
        return self.width * self.strips

    def bytes(self, channels: int) -> int:
        """Local memory."""
        return 4 * channels * self.width * self.height

    def groups(self, samples: int) -> tuple[int, int]:
        """Work-groups that cover a level of ``samples`` a side."""
        return -(-samples // (self.width - 2 * HALO)), -(-samples // (self.height - 2 * HALO))

    def kernel(self, channels: int) -> str:
        """Name of its visit kernel."""
        return f"visit_{channels}_{self.width}x{self.height}"


WIDE = (Tile(64, 4, 16), Tile(64, 4, 8), Tile(32, 4, 8), Tile(32, 2, 16))
"""For levels that fill the device, best first: 52 x 52 samples of 64 x 64 are outputs, 66 %."""
SMALL = (Tile(32, 8, 4), Tile(32, 4, 8), Tile(32, 2, 16))
"""For levels that do not: more, smaller groups."""


@dataclass(frozen=True)
class Plan:
    """Sizes of kernels that fit a device.

    ``wide`` by number of channels; ``units``: compute units; ``bottom_items``: work-items of the bottom kernel.
    """

    wide: tuple[Tile, ...]
    small: Tile
    bottom_items: int
    units: int

    def tile(self, channels: int, samples: int) -> Tile:
        """The tile for a level: wide ones as soon as they give every compute unit two groups."""
        wide = self.wide[channels - 1]
        across, along = wide.groups(samples)
        return wide if across * along >= 2 * self.units else self.small


def plan(items: int, local_bytes: int, units: int) -> Plan | None:
    """The plan for work-groups of at most ``items`` with ``local_bytes`` of local memory; None: not a GPU to us."""

    def best(tiles: tuple[Tile, ...], channels: int) -> Tile | None:
        return next((t for t in tiles if t.items <= items and t.bytes(channels) <= local_bytes), None)

    wide = [best(WIDE, channels) for channels in CHANNELS]
    small = best(SMALL, max(CHANNELS))
    fitting = [count for count in _ITEMS if count <= items]
    if small is None or items < max(CHANGE_ITEMS, CHAIN_ITEMS, BIN_ITEMS) or not fitting or local_bytes < _BOTTOM_BYTES:
        return None
    return Plan(tuple(t for t in wide if t is not None), small, fitting[0], units)


def plan_of(device: Any) -> Plan | None:
    """The plan for a pyopencl device."""
    return plan(int(device.max_work_group_size), int(device.local_mem_size), int(device.max_compute_units))


def defines(of: Plan) -> dict[str, float | int]:
    """Constants that only the GPU program needs."""
    return {
        "BOTTOM_ITEMS": of.bottom_items,
        "BOTTOM_SAMPLES": BOTTOM_SAMPLES,
        "CHANGE_ITEMS": CHANGE_ITEMS,
        "CHAIN": CHAIN,
        "CHAIN_ITEMS": CHAIN_ITEMS,
        "TILE_CELLS": TILE_CELLS,
    }


SCALAR = "#define SECTION_SCALAR"
"""Cross-sections of one sample, not of sixteen."""
SOURCES = ("gpu_level.cl", "gpu_setup.cl", "gpu_bottom.cl", "nearest.cl", "section.cl", "gpu_raster.cl")
OVER_SOURCES = ("gpu_level.cl", "nearest.cl", "section.cl", "gpu_raster.cl", "gpu_over_base.cl")
VISIT = "gpu_visit.cl"


def over_source(files: dict[str, str]) -> str:
    """The rasteriser over a base (``device.kernel_of``)."""
    return "\n".join([SCALAR, *(files[name] for name in OVER_SOURCES)])


def source(of: Plan, files: dict[str, str]) -> str:
    """The program's text from the files' texts; the visit comes once per tile and number of channels."""
    parts = [SCALAR, *(files[name] for name in SOURCES)]
    for channels in CHANNELS:
        for tile in dict.fromkeys((of.wide[channels - 1], of.small)):
            values = {
                "VISIT": tile.kernel(channels),
                "CHANNELS": channels,
                "TILE_WIDTH": tile.width,
                "TILE_STRIPS": tile.strips,
                "TILE_ROWS": tile.rows,
            }
            parts += [f"#define {name} {value}" for name, value in values.items()]
            parts.append(files[VISIT])
            parts += [f"#undef {name}" for name in values]
    return "\n".join(parts)
