"""The heights of a live terrain from Python, solved here from the confirmed document."""

from __future__ import annotations

import threading
from abc import ABC
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from esker import contract as c
from esker.api import arguments
from esker.api.live.layers import Grids
from esker.api.terrain import Terrain
from esker.api.terrain_water import Flood, Raindrop, Watershed
from esker.contract import Document
from esker.document.sync import SyncDoc
from esker.flow.rivers import River
from esker.solve.solver import Solver


class LiveHeights(ABC):
    """The methods of ``LiveTerrain`` that an offline ``Terrain`` of the same document answers."""

    _solver: Solver | None
    _grids: Grids
    _sync: SyncDoc
    _changed: threading.Condition
    _local: tuple[Document, Terrain] | None

    def heights(self, level: int = c.DEFAULT_LEVEL) -> NDArray[np.float32]:
        """Settled heights of the confirmed document, solved here; see ``Terrain.heights``."""
        level = arguments.whole("level", level, 0, c.MAX_LEVEL)
        return self._offline().heights(level)

    def rivers(
        self, level: int = c.DEFAULT_LEVEL, many: float | None = None, wetness: float | None = None
    ) -> tuple[River, ...]:
        """The rivers of the confirmed document, found here; see ``Terrain.rivers``."""
        return self._offline().rivers(level, many, wetness)

    def watershed(self, x: float, y: float, level: int = c.DEFAULT_LEVEL) -> Watershed:
        """What drains through a point of the confirmed document; see ``Terrain.watershed``."""
        return self._offline().watershed(x, y, level)

    def raindrop(self, x: float, y: float, level: int = c.DEFAULT_LEVEL) -> Raindrop:
        """The way of a drop on the confirmed document; see ``Terrain.raindrop``."""
        return self._offline().raindrop(x, y, level)

    def flood(
        self,
        x: float,
        y: float,
        volume_m3: float | None = None,
        rain_mm: float | None = None,
        level: int = c.DEFAULT_LEVEL,
    ) -> Flood:
        """Where poured water or rain stands on the confirmed document; see ``Terrain.flood``."""
        return self._offline().flood(x, y, volume_m3, rain_mm, level)

    def assemble(self, level: int) -> Any:
        """The sparse system of the confirmed document; see ``Terrain.assemble``."""
        level = arguments.whole("level", level, 0, c.MAX_LEVEL)
        return self._offline().assemble(level)

    def save(self, path: str | Path) -> None:
        """Writes the confirmed document as an ``.esker`` file. Raises ValueError for what is no path, OSError."""
        path = arguments.path("path", path)
        self._offline().save(path)

    def _offline(self) -> Terrain:
        with self._changed:
            document = self._sync.confirmed.to_document()
        if self._local is None or self._local[0] != document:
            grids = self._grids.of(document.layers)
            self._local = (document, Terrain.from_document(document, grids, self._solver, trusted=True))
        return self._local[1]
