"""What a sample carries from level to level: detail and attribute channels in 16 bytes (docs/synthesis.md, "State").

Words: detail d (float32 bits) | h, snow | wet, grass | forest, foam (low, high half, unorm16 each; h as h/2).
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

Array = NDArray[np.floating]
UNORM: Final = 65535.0
WORDS: Final = 4
H_SCALE: Final = 2.0
"""h is stored as a share of this."""


class State(NamedTuple):
    """Arrays of one shape. ``d``: metres; ``h``: smoothness exponent 0..2; the rest 0..1."""

    d: Array
    h: Array
    snow: Array
    wet: Array
    grass: Array
    forest: Array
    foam: Array


class Relief(NamedTuple):
    """The part of a state that heights follow from: detail, smoothness and snow. Arrays of one shape, as in State."""

    d: Array
    h: Array
    snow: Array


def unorm16(x: Array) -> NDArray[np.uint32]:
    """0..1 to 0..65535, to the nearest; outside of it, clamped; NaN to 0."""
    safe = np.nan_to_num(x, nan=0.0, posinf=1.0, neginf=0.0)
    rounded: NDArray[np.uint32] = np.floor(0.5 + UNORM * np.clip(safe, 0.0, 1.0)).astype(np.uint32)
    return rounded


def pack(state: State) -> NDArray[np.uint32]:
    """(..., 4) uint32 words of a state of shape (...)."""
    out = np.empty((*state.d.shape, WORDS), dtype=np.uint32)
    out[..., 0] = state.d.astype(np.float32).view(np.uint32)
    halves = (state.h / H_SCALE, state.snow, state.wet, state.grass, state.forest, state.foam)
    for k in range(3):
        out[..., 1 + k] = unorm16(halves[2 * k]) | (unorm16(halves[2 * k + 1]) << np.uint32(16))
    return out


def unpack(words: NDArray[np.uint32], dtype: DTypeLike = np.float64) -> State:
    """The state of (..., 4) uint32 words."""
    d = np.ascontiguousarray(words[..., 0]).view(np.float32).astype(dtype)
    halves: list[Array] = []
    for k in range(1, WORDS):
        halves += [(part.astype(dtype) / UNORM) for part in (words[..., k] & 0xFFFF, words[..., k] >> np.uint32(16))]
    return State(d, halves[0] * H_SCALE, *halves[1:])


def stored(state: State) -> State:
    """The state as it is after being stored: what the next level sees."""
    return unpack(pack(state), state.d.dtype)


def stored_relief(relief: Relief) -> Relief:
    """``stored`` of the part that heights follow from, with the same bits."""
    dtype = relief.d.dtype
    h, snow = (unorm16(x).astype(dtype) / UNORM for x in (relief.h / H_SCALE, relief.snow))
    return Relief(relief.d.astype(np.float32).astype(dtype), h * H_SCALE, snow)
