"""Drainage areas by other programs, for ``bench.ground.flow``: each takes float64 heights and gives samples."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from contextlib import suppress
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
INSTALL: Final = "pip install fastscapelib topotoolbox pyflwdir"


def fastscapelib(heights: Floats) -> Floats:
    """Single flow with depressions resolved by a minimum spanning tree, in C++."""
    import fastscapelib as fs

    fixed = fs.NodeStatus.FIXED_VALUE
    grid = fs.RasterGrid(list(heights.shape), [1.0, 1.0], fixed)
    graph = fs.FlowGraph(grid, [fs.SingleFlowRouter(), fs.MSTSinkResolver()])
    graph.update_routes(heights)
    return np.asarray(graph.accumulate(1.0))


def topotoolbox(heights: Floats) -> Floats:
    """Single flow carved through depressions, in C."""
    import topotoolbox as tt

    ground: Any = tt.GridObject()
    ground.z, ground.cellsize = np.asfortranarray(heights.astype(np.float32)), 1.0
    return np.asarray(tt.FlowObject(ground).flow_accumulation().z)


def pyflwdir(heights: Floats) -> Floats:
    """A priority flood with numba."""
    import pyflwdir as pf

    return np.asarray(pf.from_dem(heights, nodata=-1e9, outlets="edge").upstream_area("cell"))


PEERS: Final[dict[str, Callable[[Floats], Floats]]] = {
    "fastscapelib": fastscapelib,
    "topotoolbox": topotoolbox,
    "pyflwdir": pyflwdir,
}


def installed() -> dict[str, Callable[[Floats], Floats]]:
    """Those that are at hand, with what they need themselves."""
    found = {}
    for name, run in PEERS.items():
        with suppress(ImportError):
            importlib.import_module(name)
            found[name] = run
    return found
