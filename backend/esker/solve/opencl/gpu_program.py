"""The program for GPUs: which tiles a device can hold, and the source that is compiled for them (DESIGN 5.3).

A tile is what one work-group does of a level: ``width`` x (``strips`` * ``rows``) samples, HALO of them on each side
shared with the neighbours; a work-item owns ``rows`` samples of a column. Which tile does a sample does not change its
bits, so the choice is one of speed alone.
"""

from __future__ import annotations

from collections.abc import Mapping
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

    def groups(self, samples: int) -> tuple[int, int]:
        """Work-groups that cover a level of ``samples`` a side."""
        return -(-samples // (self.width - 2 * HALO)), -(-samples // (self.height - 2 * HALO))

    def kernel(self, channels: int) -> str:
        """Name of its visit kernel."""
        return f"visit_{channels}_{self.width}x{self.height}"


@dataclass(frozen=True)
class Strip:
    """What one work-group of a marching visit does (``gpu/march.cl``): a strip of columns, ``rows`` of them."""

    rows: int

    def groups(self, samples: int) -> tuple[int, int]:
        """Work-groups that cover a level of ``samples`` a side."""
        return -(-samples // (STRIP_WIDTH - 2 * HALO)), -(-samples // self.rows)


STRIP_WIDTH = 128
"""Columns of a strip: 116 of them are outputs. Local memory is 12 KiB, less than the bottom's."""
STRIP_ROWS = (64, 32)
"""Rows of a strip, best first, and the strips that each compute unit should have: measured on an H200 (decision 13)."""
STRIPS_A_UNIT = 2


def march_kernel(channels: int) -> str:
    """Name of the kernel that marches."""
    return f"march_{channels}"


TILE = Tile(32, 8, 4)
"""For levels that strips do not fill the device with: 20 x 20 samples of 32 x 32 are outputs, in less local memory than
the bottom's."""


@dataclass(frozen=True)
class Plan:
    """Sizes of kernels that fit a device.

    ``units``: compute units; ``bottom_items``: work-items of the bottom kernel.
    """

    bottom_items: int
    units: int

    def strip(self, samples: int) -> Strip | None:
        """The strips in which a level is marched over: as long as they give every compute unit enough groups; None
        where even short ones do not."""
        for rows in STRIP_ROWS:
            strip = Strip(rows)
            across, along = strip.groups(samples)
            if across * along >= STRIPS_A_UNIT * self.units:
                return strip
        return None


def plan(items: int, local_bytes: int, units: int) -> Plan | None:
    """The plan for work-groups of at most ``items`` with ``local_bytes`` of local memory; None: not a GPU to us."""
    fitting = [count for count in _ITEMS if count <= items]
    if (
        items < max(CHANGE_ITEMS, CHAIN_ITEMS, BIN_ITEMS, TILE.items, STRIP_WIDTH)
        or not fitting
        or local_bytes < _BOTTOM_BYTES
    ):
        return None
    return Plan(fitting[0], units)


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
SOURCES = ("gpu/level.cl", "gpu/setup.cl", "gpu/bottom.cl", "nearest.cl", "section.cl", "gpu/raster.cl")
OVER_SOURCES = ("gpu/level.cl", "nearest.cl", "section.cl", "gpu/raster.cl", "gpu/over_base.cl")
VISIT = "gpu/visit.cl"
MARCHING = "gpu/march.cl"


def over_source(files: dict[str, str]) -> str:
    """The rasteriser over a base (``device.kernel_of``)."""
    return "\n".join([SCALAR, *(files[name] for name in OVER_SOURCES)])


def source(files: dict[str, str]) -> str:
    """The program's text from the files' texts; the visits come once per number of channels."""
    parts = [SCALAR, *(files[name] for name in SOURCES)]
    for channels in CHANNELS:
        values = {
            "VISIT": TILE.kernel(channels),
            "CHANNELS": channels,
            "TILE_WIDTH": TILE.width,
            "TILE_STRIPS": TILE.strips,
            "TILE_ROWS": TILE.rows,
        }
        parts += _with(values, files[VISIT])
        marching = {"MARCH": march_kernel(channels), "MARCH_CHANNELS": channels, "MARCH_WIDTH": STRIP_WIDTH}
        parts += _with(marching, files[MARCHING])
    return "\n".join(parts)


def _with(values: Mapping[str, object], text: str) -> list[str]:
    """A file between definitions and their end."""
    return [*(f"#define {name} {value}" for name, value in values.items()), text, *(f"#undef {n}" for n in values)]
