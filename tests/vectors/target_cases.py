"""Cases of targets.json: texts of targets with some of their heights, and texts that are none."""

from __future__ import annotations

import base64
import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from esker import contract as c
from esker.tasks.target import BadTarget, decode, zigzagged

SIDE = 65
PLACES = ((0, 0), (0, 64), (64, 0), (64, 64), (1, 0), (0, 1), (17, 40), (33, 32))


def stored(data: bytes) -> str:
    """A zlib stream that is not compressed, in base64: its bytes are the same whatever made it."""
    block = b"\x01" + len(data).to_bytes(2, "little") + (len(data) ^ 0xFFFF).to_bytes(2, "little") + data
    return base64.b64encode(b"\x78\x01" + block + zlib.adler32(data).to_bytes(4, "big")).decode()


def grounds() -> dict[str, tuple[NDArray[np.int64], float, float]]:
    """Steps of samples, the lowest height and the step."""
    y, x = np.mgrid[0:SIDE, 0:SIDE]
    return {
        "a plane that rises to the north-east": (3 * x + 2 * y, -10.5, 0.25),
        "a cliff of all steps": (np.where(x > 30, 65535, 0), 0.0, 0.1),
        "a chequered ground": (((x + y) % 2) * 1000 + x * y % 7, 812.0625, 1.5),
    }


def target_vectors() -> list[dict[str, Any]]:
    """One case a ground; ``heights`` null where the text is no target."""
    cases = []
    for name, (k, low, step) in grounds().items():
        target = c.Target(size_m=4096.0, level=0, low_m=low, step_m=step, data=stored(zigzagged(k)))
        z = decode(target)
        heights = [[row, col, float(z[row, col])] for row, col in PLACES]
        cases.append(
            {"name": name, "target": target.model_dump(), "heights": heights, "sum": float(z.sum(dtype=float))}
        )
    whole = zigzagged(grounds()["a chequered ground"][0])
    wrong = {
        "one byte short": stored(whole[:-1]),
        "one byte long": stored(whole + b"\0"),
        "no zlib": "AAAA",
        "no base64": "A",
    }
    for name, data in wrong.items():
        target = c.Target(size_m=4096.0, level=0, low_m=0.0, step_m=1.0, data=data)
        try:
            decode(target)
        except BadTarget:
            cases.append({"name": name, "target": target.model_dump(), "heights": None})
    return cases
