"""Cases of flow.json: ground of whole numbers, the water on it, and its rivers."""

from __future__ import annotations

from typing import Any

import numpy as np

from esker.flow.reaches import find_reaches
from esker.flow.water import NO_SEA, find_water
from tests.flow.grounds import Ints, grounds

SIDE = 41


def valleys() -> Ints:
    """A bowl that is open to the south, with spurs between its valleys and a hollow behind a bar."""
    y, x = np.mgrid[0:SIDE, 0:SIDE].astype(np.int64)
    spurs = np.abs((x * 3 + y) % 20 - 10) * 40
    bowl = (x - 20) * (x - 20) * 8 + y * 150
    bar = np.where((y == 12) & (np.abs(x - 20) < 9), 1500, 0)
    rough = (x * 7919 + y * 104729) % 97
    return np.asarray(spurs + bowl + bar + rough, dtype=np.int32)


def flow_vectors() -> list[dict[str, Any]]:
    """One case a ground; ``sea`` is null where there is none, ``many`` 0 where no rivers were asked for."""
    asked: dict[str, tuple[Ints, int, float]] = {name: (z, sea, 0.0) for name, (z, sea) in grounds().items()}
    asked["valleys"] = (valleys(), NO_SEA, 1.0)
    asked["valleys by the sea, many rivers"] = (valleys(), 1200, 4.0)
    return [_case(name, *ground) for name, ground in asked.items()]


def _case(name: str, z: Ints, sea: int, many: float) -> dict[str, Any]:
    water = find_water(z, sea)
    reaches = find_reaches(water, many)
    return {
        "name": name,
        "rows": z.shape[0],
        "cols": z.shape[1],
        "sea": None if sea == NO_SEA else sea,
        "many": many,
        "ground": z.ravel().tolist(),
        "receiver": water.receiver.ravel().tolist(),
        "filled": water.filled.ravel().tolist(),
        "area": water.area.ravel().tolist(),
        "reaches": [
            {
                "points": reaches.points[reaches.start[k] : reaches.start[k + 1]].ravel().tolist(),
                "areas": reaches.areas[k].tolist(),
                "next": int(reaches.next[k]),
            }
            for k in range(len(reaches))
        ],
    }
