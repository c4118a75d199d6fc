"""A stroke set as the windows of refinement see it: tables, and digests of what reaches a window (DESIGN 5.6)."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import replace
from hashlib import blake2b
from typing import Final

import numpy as np

from esker import grid
from esker.contract import Stroke, TerrainSettings
from esker.solve.constraints.constraints import BIN, BinBox, Shapes, Tables, WindowPacker, bins
from esker.solve.constraints.tables import INDEX_FIELDS
from esker.solve.refine.base_blocks import BaseWindows

PACK_AROUND: Final = 48
"""Bins around a window that are packed with it."""
PACKED: Final = 12
"""Tables kept by a refiner."""
DIGEST_BYTES: Final = 16
_WITHOUT_EFFECT: Final = {"author", "label", "locked", "finished", "amplitude_m", "roughness"}
"""Fields of a stroke that do not change heights."""


class Strokes:
    """A stroke set as windows see it.

    The coarsest window of a chain holds all finer ones, on the ground, and strokes reach farthest at the coarsest
    level: so the digest of its strokes is that of the chain's.
    """

    def __init__(
        self,
        strokes: Sequence[Stroke],
        settings: TerrainSettings,
        base: BaseWindows | None = None,
        shapes: Shapes | None = None,
    ) -> None:
        self.settings, self.base = settings, base
        self._packer = WindowPacker(strokes, settings, base=None if base is None else base.base, shapes=shapes)
        self._grounds = {} if base is None else self._packer.grounds
        self._own: dict[str, bytes] = {}
        self._windows: dict[tuple[int, BinBox], bytes] = {}
        self._packed: list[Tables] = []
        self._start = repr((settings.size_m, settings.reach_m, settings.border, settings.edition)).encode()

    def tables(self, level: int, box: BinBox) -> Tables:
        """The rasteriser's tables of a box of bins."""
        return self._packer.pack(level, box)

    def shared_tables(self, level: int, box: BinBox) -> Generator[None, None, Tables]:
        """Tables that serve for a box of bins, cut from those of a larger one around it: most of the time of packing
        goes to strokes, not to bins, and the next windows are near. Their lists may name strokes beside the box. To be
        left between strokes."""
        held = [t for t in self._packed if t.level == level and _holds(t.box, box)]
        if not held:
            count, more = bins(grid.samples(level)), PACK_AROUND
            by0, by1, bx0, bx1 = box
            around = max(0, by0 - more), min(count, by1 + more), max(0, bx0 - more), min(count, bx1 + more)
            held = [(yield from self._packer.packing(level, around))]
            self._packed = [*held, *self._packed[: PACKED - 1]]
        return rows_of(held[0], box)

    def digest(self, level: int, box: BinBox) -> bytes:
        """Digest of all that decides the constraints of a box of bins, at this or any finer level, but for the base."""
        known = self._windows.get((level, box))
        if known is None:
            out = blake2b(self._start, digest_size=DIGEST_BYTES)
            for stroke in self._packer.reaching(level, box):
                out.update(self._digest(stroke))
            known = self._windows[level, box] = out.digest()
        return known

    def bins_digest(self, level: int, box: BinBox) -> bytes:
        """Digest of all that decides the constraints of a box of bins at this level."""
        if self.base is None:
            return self.digest(level, box)
        n, (by0, by1, bx0, bx1) = grid.samples(level), box
        bounds = by0 * BIN, min(by1 * BIN, n), bx0 * BIN, min(bx1 * BIN, n)
        return self.digest(level, box) + self.base.digest(level, bounds)

    def _digest(self, stroke: Stroke) -> bytes:
        known = self._own.get(stroke.id)
        if known is None:
            text = stroke.model_dump_json(exclude=_WITHOUT_EFFECT).encode()
            if stroke.id in self._grounds:
                ground = self._grounds[stroke.id]
                text += repr((ground.fill, ground.cut)).encode()
            known = self._own[stroke.id] = blake2b(text, digest_size=DIGEST_BYTES).digest()
        return known


def _holds(outer: BinBox, inner: BinBox) -> bool:
    return outer[0] <= inner[0] and inner[1] <= outer[1] and outer[2] <= inner[2] and inner[3] <= outer[3]


def rows_of(tables: Tables, box: BinBox) -> Tables:
    """The tables of a larger box as the rasteriser's kernel reads them for a box within it."""
    down, rows = box[0] - tables.box[0], box[1] - box[0]
    index, at = tables.index.copy(), INDEX_FIELDS.index("spans")
    index[:, at] = np.where(index[:, at] < 0, -1, index[:, at] + down * BIN)
    return replace(tables, box=box, index=index, row_start=tables.row_start[down : down + rows + 1])
