"""Heights coded in the colours of pictures: Terrarium and Mapbox Terrain-RGB tiles."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final, Literal, get_args

import numpy as np
from numpy.typing import NDArray

Encoding = Literal["terrarium", "mapbox"]
ENCODINGS: Final[tuple[Encoding, ...]] = get_args(Encoding)
STEP_M: Final[Mapping[Encoding, float]] = {"terrarium": 1 / 256, "mapbox": 0.1}
LOWEST_M: Final = -11_500.0
HIGHEST_M: Final = 9_000.0
"""Nothing solid on Earth is lower or higher: a picture that decodes to more is no elevation in this code."""


def decode(bands: NDArray[Any], encoding: Encoding) -> NDArray[np.float64]:
    """Heights in metres (rows, cols) from uint8 red, green, blue (3, rows, cols).

    Terrarium: 256 R + G + B/256 - 32768 (Tilezen Joerd, "Terrarium"). Mapbox Terrain-RGB: -10000 + 0.1 (65536 R + 256 G
    + B) (Mapbox documentation, "Terrain-RGB").
    """
    red, green, blue = bands.astype(np.float64)
    if encoding == "terrarium":
        return np.asarray(256.0 * red + green + blue / 256.0 - 32768.0)
    return np.asarray(0.1 * (65536.0 * red + 256.0 * green + blue) - 10000.0)


def plausible(low_m: float, high_m: float) -> bool:
    """True when decoded heights could be some of the Earth's."""
    return low_m >= LOWEST_M and high_m <= HIGHEST_M
