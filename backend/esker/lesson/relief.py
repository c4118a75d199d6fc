"""A picture of a copy for those who collect it: shaded relief in the manner of the page's 2D map, without contours.

The tints are those of ``frontend/src/gpu/map/shade.ts``. No number of the product follows from a pixel here.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from esker import contract as c

Rgb = tuple[int, int, int]
Floats = NDArray[np.float32]

TINTS: Final[dict[c.Look, tuple[tuple[tuple[float, Rgb], ...], Rgb]]] = {
    "natural": (
        (
            (-0.05, (150, 176, 150)), (0.0, (196, 211, 172)), (0.03, (214, 219, 176)), (0.08, (227, 215, 172)),
            (0.14, (222, 202, 168)), (0.2, (232, 224, 212)), (0.26, (250, 249, 247)),
        ),
        (178, 164, 148),
    ),
    "alpine": (
        (
            (-0.05, (176, 190, 196)), (0.0, (214, 224, 224)), (0.06, (226, 232, 234)), (0.14, (240, 243, 246)),
            (0.24, (252, 253, 255)),
        ),
        (166, 168, 174),
    ),
    "desert": (
        (
            (-0.05, (206, 168, 122)), (0.0, (238, 214, 170)), (0.08, (234, 196, 146)), (0.16, (220, 162, 116)),
            (0.26, (240, 214, 184)),
        ),
        (186, 116, 82),
    ),
    "paper": (((-0.05, (228, 219, 200)), (0.0, (244, 238, 224)), (0.25, (252, 249, 242))), (226, 216, 198)),
}  # fmt: skip
"""Colours by height as a share of the domain's side, and the colour of steep rock."""
SHALLOW: Final = np.array((196, 220, 226), dtype=np.float32)
DEEP: Final = np.array((120, 164, 190), dtype=np.float32)
SHADOW: Final = np.array((0.42, 0.46, 0.6), dtype=np.float32)
LIT: Final = np.array((1.06, 1.03, 0.95), dtype=np.float32)
FLAT_LIGHT: Final = 0.62 * 0.5**0.5 + 0.38 * 0.6428 + 0.03
"""Brightness of flat ground."""
DEEP_SHARE: Final = 0.05
"""Water is darkest where it is this share of the domain's side deep."""


def picture(heights: Floats, settings: c.TerrainSettings) -> NDArray[np.uint8]:
    """(n, n, 3) colours, row 0 north, of (n, n) heights in metres, row 0 south."""
    size = np.float32(settings.size_m)
    gy, gx = np.gradient(heights, size / np.float32(len(heights) - 1))
    steep: Floats = np.hypot(gx, gy)
    stops, rock = TINTS[settings.look]
    sea = np.float32(settings.sea_level_m or 0.0)
    share = (heights - sea) / size
    at = [stop for stop, _ in stops]
    colour = np.stack([np.interp(share, at, [rgb[k] for _, rgb in stops]) for k in range(3)], axis=-1)
    bare = 0.85 * np.clip((steep - 0.62) / 0.5, 0, 1)[..., None]
    colour += (np.asarray(rock, dtype=np.float32) - colour) * bare
    shade = np.clip(_light(np.asarray(1.7 * gx), np.asarray(1.7 * gy)) / FLAT_LIGHT, 0, 1.12)[..., None]
    cool = SHADOW + (1 - SHADOW) * np.minimum(1, shade)
    colour *= cool + (LIT - 1) * (0.4 + np.maximum(0, shade - 1) / 0.12)
    if settings.sea_level_m is not None:
        depth = np.clip((sea - heights) / size / DEEP_SHARE, 0, 1)[..., None]
        colour = np.where(heights[..., None] < sea, SHALLOW + (DEEP - SHALLOW) * np.sqrt(depth), colour)
    return np.asarray(np.clip(colour, 0, 255)[::-1], dtype=np.uint8)


def _light(gx: NDArray[Any], gy: NDArray[Any]) -> NDArray[Any]:
    """Brightness of a slope: three lights from the north-west quarter."""
    inverse = 1 / np.sqrt(1 + gx * gx + gy * gy)
    main = (0.5 * gx - 0.5 * gy + np.sqrt(0.5)) * inverse
    west, north = (0.766 * gx + 0.6428) * inverse, (-0.766 * gy + 0.6428) * inverse
    found: NDArray[Any] = 0.62 * main.clip(0) + 0.22 * west.clip(0) + 0.16 * north.clip(0) + 0.03
    return found


def write(path: Path, heights: Floats, settings: c.TerrainSettings) -> None:
    """The picture as a PNG. Raises OSError."""
    Image.fromarray(picture(heights, settings)).save(path, format="PNG")
