"""Cases of pour.json: water poured out on ground of whole numbers, and how high it stands."""

from __future__ import annotations

from typing import Any

from esker.flow.pour import brim, pour
from esker.flow.water import NO_SEA, find_water
from tests.flow.grounds import Ints, grounds
from tests.vectors.flow_cases import valleys

VOLUMES = (0.5, 40.0, 900.0, 20_000.0, 1e9)
NAMES = ("crater", "crater in the sea", "pits of one sample", "corner along the mesh", "rough", "one row")


def pour_vectors() -> list[dict[str, Any]]:
    """One case a ground, each with water at some places; ``sea`` is null where there is none."""
    asked: dict[str, tuple[Ints, int]] = {name: grounds()[name] for name in NAMES}
    asked["valleys"] = (valleys(), NO_SEA)
    return [_case(name, *ground) for name, ground in asked.items()]


def _case(name: str, z: Ints, sea: int) -> dict[str, Any]:
    water = find_water(z, sea)
    places = range(0, z.size, max(1, z.size // 9))
    return {
        "name": name,
        "rows": z.shape[0],
        "cols": z.shape[1],
        "sea": None if sea == NO_SEA else sea,
        "ground": z.ravel().tolist(),
        "brims": [[at, brim(water, at)] for at in places],
        "poured": [_poured(water, at, volume) for at in places for volume in VOLUMES],
    }


def _poured(water: Any, at: int, volume: float) -> dict[str, Any]:
    found = pour(water, at, volume)
    pools = [{"level": pool.level, "samples": pool.samples.tolist()} for pool in found.pools]
    return {"at": at, "volume": volume, "left": found.left, "pools": pools}
