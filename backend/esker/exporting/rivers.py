"""Rivers as GeoJSON: lines in longitude and latitude where the terrain has a place on Earth, else in its own metres."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from esker.contract import TerrainSettings
from esker.flow.rivers import River

DIGITS_DEG = 7
"""A centimetre on the ground."""
DIGITS_M = 2


def write_rivers(path: Path, rivers: Sequence[River], settings: TerrainSettings) -> None:
    """Writes a FeatureCollection, one LineString a river (docs/exporting.md). Raises OSError."""
    path.write_text(json.dumps(collection(rivers, settings), allow_nan=False, separators=(",", ":")) + "\n", "utf-8")


def collection(rivers: Sequence[River], settings: TerrainSettings) -> dict[str, Any]:
    """The rivers as a value for JSON. Without a place on Earth ``metres`` says that coordinates are the terrain's."""
    digits = DIGITS_M if settings.place is None else DIGITS_DEG
    features = []
    for k, (river, (east, north)) in enumerate(zip(rivers, _placed(rivers, settings), strict=True)):
        line = [[round(float(x), digits), round(float(y), digits)] for x, y in zip(east, north, strict=True)]
        properties: dict[str, Any] = {"river": k, "into": river.next}
        for name in ("area_m2", "width_m", "depth_m"):
            head, end = getattr(river, name)
            properties |= {f"{name}_head": round(head, 3), f"{name}_end": round(end, 3)}
        features.append(
            {"type": "Feature", "geometry": {"type": "LineString", "coordinates": line}, "properties": properties}
        )
    facts: dict[str, Any] = {} if settings.place else {"metres": True, "size_m": settings.size_m}
    return {"type": "FeatureCollection", "name": settings.title, **facts, "features": features}


def _placed(rivers: Sequence[River], settings: TerrainSettings) -> list[tuple[Any, Any]]:
    """Coordinates of the points of each river: x and y, or longitude and latitude."""
    lines = [(river.points[:, 0], river.points[:, 1]) for river in rivers]
    if settings.place is None or not lines:
        return lines
    from esker.importing.placement.fitting import on_earth_from_frame  # not with this module: it brings pyproj

    cuts = np.cumsum([len(x) for x, _ in lines])[:-1]
    x, y = (np.concatenate([line[axis] for line in lines]) for axis in (0, 1))
    lon, lat = on_earth_from_frame(settings.place, settings.size_m, x, y)
    return list(zip(np.split(lon, cuts), np.split(lat, cuts), strict=True))
