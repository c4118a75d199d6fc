"""Compiles all loops of this room that a server runs for layers: a process of its own does it before the first base."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from esker import contract as c
from esker.patchwork.base import Base
from esker.patchwork.lod import space
from esker.patchwork.lod.space import Placed
from esker.patchwork.raster import rasters

SIZE_M: Final = 4096.0
SIDE: Final = 150
"""Samples along a side of the built-in grids: several patches, and coarser grids of them."""
LEVEL: Final = 2


def warm() -> None:
    """Makes bases of a survey, of a finer one with a hole across it and of a third, and asks all that rooms ask."""
    heights = np.random.default_rng(1).random((SIDE, SIDE), dtype=np.float32) * 90
    torn = heights.copy()
    torn[20:40, 50:70] = np.nan
    with tempfile.TemporaryDirectory(prefix="esker-warm-") as folder:
        survey = _placed(heights, Path(folder) / "survey", "survey", anchor=(900.0, 900.0), spacing_m=(10.0, 10.0))
        place: dict[str, Any] = {"anchor": (1400.0, 1300.0), "spacing_m": (5.0, 5.0), "rotation_deg": 27.0}
        finer = _placed(torn, Path(folder) / "finer", "finer", **place)
        third = _placed(heights, Path(folder) / "third", "third", anchor=(1500.0, 1500.0), spacing_m=(3.0, 3.0))
        for edition in (1, c.CURRENT_EDITION):
            before = Base(space.build([survey]), SIZE_M, None, edition)
            _asked(before)
            after = Base(space.build([survey, finer], before.model), SIZE_M, before, edition)
            after.changed(before)
            _asked(after)
        _asked(Base(space.build([survey, finer, third], after.model), SIZE_M, after, c.CURRENT_EDITION))


def _placed(heights: NDArray[np.float32], folder: Path, name: str, **place: Any) -> Placed:
    """A layer whose grid is mapped from disk, as those of terrains are."""
    rasters.build_out_of_core(heights, folder)
    raster = rasters.read(folder)
    return Placed(c.Layer(id=name, content=raster.digest, facts=raster.facts(), accuracy_m=0.0, **place), raster)


def _asked(base: Base) -> None:
    base.level(LEVEL)
    base.window(LEVEL + 1, slice(10, 90), slice(30, 90))
    base.survey(LEVEL)
    points = np.stack(np.meshgrid(*[np.linspace(0.0, SIZE_M, 9)] * 2), axis=-1).reshape(-1, 2)
    base.sample(points)
    base.sample(points, 4.0, smooth=False, derivatives=True)
