"""The colour of the ground from above: what lies and grows on it, in the colours of the page's looks."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from esker.contract import Look
from esker.exporting.ground import WHOLE, Ground, Mask

Colour = tuple[float, float, float]


class Palette(NamedTuple):
    """Linear albedos, the middle of what ``shaders/wgsl/look_*.wgsl`` draws."""

    earth: Colour
    rock: Colour
    grass: Colour
    forest: Colour
    snow: Colour
    bed: Colour


SNOW: Final = (0.80, 0.83, 0.87)
PALETTES: Final[dict[Look, Palette]] = {
    "natural": Palette((0.135, 0.108, 0.072), (0.176, 0.172, 0.166), (0.115, 0.130, 0.044), (0.031, 0.049, 0.018),
                       SNOW, (0.42, 0.355, 0.245)),
    "alpine": Palette((0.125, 0.105, 0.070), (0.146, 0.143, 0.140), (0.110, 0.118, 0.050), (0.030, 0.042, 0.030),
                      SNOW, (0.40, 0.37, 0.33)),
    "desert": Palette((0.515, 0.352, 0.202), (0.400, 0.203, 0.113), (0.118, 0.112, 0.052), (0.050, 0.058, 0.022),
                      SNOW, (0.52, 0.40, 0.26)),
    "paper": Palette(*[(0.80, 0.715, 0.570)] * 6),
}  # fmt: skip
STEEP: Final = (0.55, 1.0)
"""Tangents of slopes from which, and up to which, rock shows."""
WET: Final = np.float32(0.4)
"""How much darker ground is that is all wet."""


def colours(ground: Ground) -> NDArray[np.uint8]:
    """(rows, columns, 3) sRGB, row 0 south: rock where it is steep, earth elsewhere, grass, forest and snow over it as
    the masks say, darker where it is wet; the bed where it lies under water. No light: an engine brings its own."""
    palette, masks = PALETTES[ground.settings.look], ground.masks
    north, east = np.gradient(ground.heights, np.float32(ground.spacing_m))
    low, high = STEEP
    t = np.clip((np.hypot(north, east) - low) / (high - low), 0.0, 1.0)
    seen = _mixed(np.broadcast_to(_linear(palette.earth), (*t.shape, 3)), palette.rock, t * t * (3.0 - 2.0 * t))
    for name, colour in (("grass", palette.grass), ("forest", palette.forest)):
        seen = _mixed(seen, colour, _share(masks[name]))
    seen = _mixed(seen, (0.0, 0.0, 0.0), WET * _share(masks["wetness"]))
    seen = _mixed(seen, palette.snow, _share(masks["snow"]))
    seen = _mixed(seen, palette.bed, _share(masks["water"]))
    coded: NDArray[np.uint8] = np.rint(_encoded(seen) * 255.0).astype(np.uint8)
    return coded


def _share(mask: Mask) -> NDArray[np.float32]:
    return mask.astype(np.float32) * np.float32(1.0 / WHOLE)


def _linear(colour: Colour) -> NDArray[np.float32]:
    return np.array(colour, dtype=np.float32)


def _mixed(under: NDArray[np.float32], over: Colour, share: NDArray[np.float32]) -> NDArray[np.float32]:
    amount = share.astype(np.float32)[..., None]
    made: NDArray[np.float32] = under * (1 - amount) + _linear(over) * amount
    return made


def _encoded(linear: NDArray[np.float32]) -> NDArray[np.float32]:
    """The transfer function of sRGB (IEC 61966-2-1)."""
    high = 1.055 * np.power(np.maximum(linear, 0.0031308), 1.0 / 2.4) - 0.055
    coded: NDArray[np.float32] = np.where(linear <= 0.0031308, 12.92 * linear, high).astype(np.float32)
    return coded
