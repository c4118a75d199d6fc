"""Heights as grids: 16-bit heightmaps of game engines, GeoTIFF for GIS, arrays for NumPy."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Final

import numpy as np
from PIL import Image, PngImagePlugin

from esker.exporting.ground import Ground
from esker.exporting.heightmap import STEPS, quantised
from esker.importing.placement.fitting import frame

MIDDLE: Final = 32_768
"""The value that Unreal Engine puts at the height of the landscape itself."""
UNREAL_RANGE_M: Final = STEPS / 128.0
"""Metres from 0 to 65535 of an Unreal landscape whose scale is 100 %: 128 steps a metre."""


def hints(ground: Ground) -> dict[str, Any]:
    """``Ground.facts`` and how engines are to be set so that a heightmap of 16 bits has its true size.

    Unreal Engine: landscapes have one vertex a sample, scale 100 is a metre a quad and 512 m of height, 32768 lies at
    the actor. Unity: width, length and height of the terrain, metres, and its lowest point.
    """
    facts = ground.facts()
    low, high = facts["low_m"], facts["high_m"]
    width, length = facts["size_m"]
    return facts | {
        "encoding": f"uint16, little-endian, row 0 north; metres = low_m + value * (high_m - low_m) / {STEPS}",
        "unreal": {
            "scale_x": 100.0 * ground.spacing_m,
            "scale_y": 100.0 * ground.spacing_m,
            "scale_z": 100.0 * (high - low) / UNREAL_RANGE_M,
            "location_z_cm": 100.0 * (low + (high - low) * MIDDLE / STEPS),
        },
        "unity": {"width": width, "length": length, "height": high - low, "position_y": low},
    }


def sentence(ground: Ground) -> str:
    """What somebody must know who opens a heightmap."""
    rows, columns = ground.heights.shape
    low, high = ground.range_m
    return f"{columns} x {rows} samples, north first: 0 is {low:.9g} m, {STEPS} is {high:.9g} m"


def write_png(path: Path, ground: Ground) -> None:
    """A PNG of 16 bits, row 0 north, from the lowest sample (0) to the highest (65535); the largest error is half a
    step. Its text says the range (Description) and the rest of ``hints`` (Esker, JSON). Raises OSError."""
    text = PngImagePlugin.PngInfo()
    text.add_text("Description", sentence(ground))
    text.add_itxt("Esker", json.dumps(hints(ground)))
    with path.open("wb") as file:
        Image.fromarray(quantised(ground.heights)).save(file, format="PNG", pnginfo=text, compress_level=4)


def write_r16(path: Path, ground: Ground) -> None:
    """Writes the quantised numbers alone, without a header, and beside them ``hints`` as JSON. Raises OSError."""
    quantised(ground.heights).tofile(path)
    path.with_suffix(".json").write_text(json.dumps(hints(ground), indent=2) + "\n", encoding="utf-8")


def write_npy(path: Path, ground: Ground) -> None:
    """float32 metres as they are, row 0 south. Raises OSError."""
    with path.open("wb") as file:
        np.save(file, ground.heights)


def write_geotiff(path: Path, ground: Ground) -> None:
    """A GeoTIFF of float32 metres, row 0 north, a sample in the middle of each pixel (AREA_OR_POINT=Point).

    Where the terrain has a place on Earth its system is the terrain's own frame, the transverse Mercator projection
    around that place; without one the numbers are metres from the south-western corner, and no system is named.
    Raises OSError."""
    import rasterio
    from rasterio.transform import Affine

    rows, columns = ground.heights.shape
    settings, s = ground.settings, ground.spacing_m
    north = ground.y_m + (rows - 1) * s
    crs = None if settings.place is None else rasterio.CRS.from_wkt(frame(settings.place, settings.size_m).to_wkt())
    low, high = ground.range_m
    try:
        with rasterio.open(
            path, "w", driver="GTiff", width=columns, height=rows, count=1, dtype="float32", crs=crs,
            transform=Affine(s, 0.0, ground.x_m - 0.5 * s, 0.0, -s, north + 0.5 * s),
            tiled=True, blockxsize=256, blockysize=256, compress="deflate", predictor=3, zlevel=4,
        ) as file:  # fmt: skip
            file.write(ground.heights[::-1], 1)
            file.update_tags(AREA_OR_POINT="Point", TIFFTAG_IMAGEDESCRIPTION=settings.title or "Esker terrain")
            file.update_tags(1, STATISTICS_MINIMUM=low, STATISTICS_MAXIMUM=high)
            file.set_band_unit(1, "metre")
    except rasterio.errors.RasterioError as error:
        raise OSError(f"GDAL could not write it ({error}).") from error
