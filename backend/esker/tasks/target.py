"""Ground as a target: all samples of a level in a text that fits a message.

Heights are whole steps above the lowest. What is kept of a sample is how far it is from the plane through its three
neighbours to the west and south, in zigzag order (0, -1, 1, -2, ...), all low bytes before all high ones,
deflated. Twin of ``frontend/src/app/lesson/task/target.ts``.
"""

from __future__ import annotations

import base64
import binascii
import zlib
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from esker import contract as c
from esker.errors import EskerError

Heights = NDArray[np.float32]

FINEST_STEPS: Final = 2_048
COARSEST_STEPS: Final = 256
"""Steps from the lowest to the highest sample: as many as fit, at least so many."""
MOST_STEPS: Final = 0xFFFF


class BadTarget(EskerError):
    """A text that is no target, or ground that none can be made of."""

    def __init__(self, message: str) -> None:
        super().__init__("bad_target", message)


def _side(level: int) -> int:
    return (c.TILE_CELLS << level) + 1


def encode(heights: NDArray[Any], size_m: float) -> c.Target:
    """The target that a ground is, heights in metres with row 0 south: every second sample where all do not fit.

    Raises BadTarget for heights that are not those of a level, or not finite.
    """
    level = next((k for k in range(c.TASK_LEVEL + 1) if heights.shape == (_side(k), _side(k))), None)
    if level is None or not np.isfinite(heights).all():
        raise BadTarget("A target is made of the ground of a coarse level.")
    z = heights.astype(np.float64)
    low, relief = float(z.min()), float(z.max() - z.min())
    steps = FINEST_STEPS
    while True:
        step = max(relief / steps, c.MIN_TARGET_STEP_M)
        text = base64.b64encode(zlib.compress(zigzagged(np.rint((z - low) / step).astype(np.int64)), 9)).decode()
        if len(text) <= c.MAX_TARGET_CHARACTERS:
            return c.Target(size_m=size_m, level=level, low_m=low, step_m=step, data=text)
        if steps > COARSEST_STEPS:
            steps //= 2
        elif level == 0:
            raise BadTarget("This ground is too rough to be a target.")
        else:
            z, level, steps = z[::2, ::2], level - 1, FINEST_STEPS


def zigzagged(k: NDArray[np.int64]) -> bytes:
    """Steps as the bytes that are deflated."""
    around = np.pad(k, ((1, 0), (1, 0)))
    off = (k - around[1:, :-1] - around[:-1, 1:] + around[:-1, :-1]).astype(np.int16)
    zigzag = ((off.astype(np.int32) << 1) ^ (off.astype(np.int32) >> 15)).astype(np.uint16).ravel()
    planes = np.concatenate([(zigzag & 0xFF).astype(np.uint8), (zigzag >> 8).astype(np.uint8)])
    return planes.tobytes()


def decode(target: c.Target) -> Heights:
    """The heights of a target in metres, row 0 south. Raises BadTarget; never unpacks more than a level holds."""
    side = _side(target.level)
    wanted = 2 * side * side
    try:
        unpacker = zlib.decompressobj()
        data = unpacker.decompress(base64.b64decode(target.data, validate=True), wanted + 1)
    except (binascii.Error, ValueError, zlib.error):
        data = b""
    if len(data) != wanted:
        raise BadTarget("The target of this task is damaged.")
    planes = np.frombuffer(data, np.uint8).astype(np.uint16).reshape(2, side, side)
    zigzag = planes[0] | planes[1] << 8
    off = (zigzag >> 1) ^ (0 - (zigzag & 1))
    k = np.cumsum(np.cumsum(off.astype(np.int64), axis=0), axis=1) & MOST_STEPS
    return np.asarray(target.low_m + target.step_m * k, dtype=np.float32)
