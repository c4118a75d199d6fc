"""Esker: sketch one landscape together. ``from esker import Terrain, Stroke, connect``."""

from __future__ import annotations

from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from esker.client import connect
    from esker.terrain import Stroke, Terrain

_HOMES = {"Terrain": "esker.terrain", "Stroke": "esker.terrain", "connect": "esker.client"}

try:
    __version__ = version("esker")
except PackageNotFoundError:  # run from a source tree that was never installed
    __version__ = "0+unknown"


def __getattr__(name: str) -> Any:
    """The public names, imported when first used: the contract alone must not pull in SciPy or OpenCL."""
    home = _HOMES.get(name)
    if home is None:
        raise AttributeError(f"module 'esker' has no attribute '{name}'")
    return getattr(import_module(home), name)


__all__ = ["Stroke", "Terrain", "__version__", "connect"]
