"""Numbers of a document that kernels can compute: the contract's bounds leave room for numbers that float32 does not.

A solver reads settings through ``computable`` and lengths of strokes through the floors below, so that every document
that the contract allows has finite ground (docs/decisions/0031-what-a-room-may-take.md). Ordinary ones pass unchanged.
"""

from __future__ import annotations

from typing import Final

from esker.contract import MAX_LEVEL, TILE_CELLS, TerrainSettings

LEAST_REACH_FRACTION: Final = 1 / (TILE_CELLS << MAX_LEVEL)
"""A shorter reach counts as this share of the domain, a cell of the finest global level. Screening grows with the
square of a cell over the reach."""
CLOSEST_M: Final = 1e-6
"""Neighbouring points of a crest that are closer count as one: the square of their distance has to be a number."""


def computable(settings: TerrainSettings) -> TerrainSettings:
    """The settings with which a solve is computed: the same object for nearly every terrain."""
    least = settings.size_m * LEAST_REACH_FRACTION
    if settings.reach_m is None or settings.reach_m >= least:
        return settings
    return settings.model_copy(update={"reach_m": least})
