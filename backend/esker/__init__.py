"""Esker: sketch one landscape together. ``from esker import Terrain, Stroke, connect``."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from esker.api.live.client import connect
    from esker.api.terrain import Stroke, Terrain
    from esker.errors import EskerError

_HOMES = {
    "Terrain": "esker.api.terrain",
    "Stroke": "esker.api.terrain",
    "connect": "esker.api.live.client",
    "EskerError": "esker.errors",
}


def __getattr__(name: str) -> Any:
    """The public names, imported when first used: the contract alone must not pull in SciPy or OpenCL."""
    from importlib import import_module

    if name == "__version__":
        return _version()
    home = _HOMES.get(name)
    if home is None:
        raise AttributeError(f"module 'esker' has no attribute '{name}'")
    return getattr(import_module(home), name)


def _version() -> str:
    """Returns what is installed. Reading it takes longer than everything else here, and commands do not need it."""
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("esker")
    except PackageNotFoundError:  # run from a source tree that was never installed
        return "0+unknown"


__all__ = ["EskerError", "Stroke", "Terrain", "__version__", "connect"]
