"""Makes the base of a terrain's layers from the stored grids: ``session.ground.ports.Elevation`` (DESIGN 11)."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable

from esker import contract as c
from esker.patchwork.base import Base
from esker.patchwork.lod import space
from esker.patchwork.lod.space import Placed
from esker.patchwork.raster.rasters import RasterError
from esker.store.grids import GridStore

log = logging.getLogger("esker.server.elevation")


class Elevation:
    """Bases over the grids of one ``GridStore``. Blocking; safe from any thread."""

    def __init__(self, grids: GridStore, prepare: Callable[[threading.Event], None] = lambda _: None) -> None:
        """``prepare``: called once, before the first base is made; it ends when its event is set (``close``)."""
        self._grids, self._prepare = grids, prepare
        self._turn, self._prepared, self._closed = threading.Lock(), False, threading.Event()

    def base(
        self,
        layers: tuple[c.Layer, ...],
        size_m: float,
        before: object = None,
        tell: Callable[[str], None] = log.warning,
        edition: int = 1,
    ) -> Base | None:
        """The base of the visible layers; None when there is none.

        ``before``: an earlier base of this terrain. A layer whose grid is missing or damaged is left out, and ``tell``
        is called with a sentence. ``edition``: of the terrain's rules. Raises RuntimeError where ``close`` came first.
        """
        earlier = before if isinstance(before, Base) else None
        placed = [found for layer in layers if not layer.hidden and (found := self._placed(layer, tell)) is not None]
        if not placed:
            return None
        self._begin()
        model = space.build(placed, earlier.model if earlier is not None else None)
        base = Base(model, size_m, earlier, edition)
        return earlier if earlier is not None and earlier.digest == base.digest else base

    def close(self) -> None:
        """Ends what is prepared: no base that waits for it is made any more."""
        self._closed.set()

    def _begin(self) -> None:
        with self._turn:
            if not self._prepared:
                self._prepare(self._closed)
                if self._closed.is_set():
                    raise RuntimeError("the server is stopping")
            self._prepared = True

    def _placed(self, layer: c.Layer, tell: Callable[[str], None]) -> Placed | None:
        try:
            return Placed(layer, self._grids.read(layer.content))
        except RasterError as error:
            log.error("layer %s is left out: %s", layer.id, error)
            tell(f"The layer “{layer.name or layer.id}” is left out: its elevation grid is missing or damaged here.")
            return None
