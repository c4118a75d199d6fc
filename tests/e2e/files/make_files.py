"""Cuts the small elevation files of the end-to-end tests from surveys of Mount St Helens (USGS, public domain).

Run: ``python -m tests.e2e.files.make_files FOLDER`` with the folder that holds msh_2000_10m.tif (2000, 10 m cells) and
msh_20041011_2m.tif (11 October 2004, 2 m cells). The results are committed, so that the tests need nothing else.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import rasterio
from rasterio.windows import Window

HERE = Path(__file__).parent
VALLEY = Window(56, 220, 192, 192)
"""The crater and its breach to the north, 1920 m a side."""
DOME = Window(232, 48, 96, 96)
"""The growing dome, 192 m a side, without a hole."""


def main(source: Path) -> None:
    """Write helens.tif (GeoTIFF with its place) and dome.npy (bare heights, south row first)."""
    with rasterio.open(source / "msh_2000_10m.tif") as file:
        profile = file.profile
        profile.update(
            width=VALLEY.width,
            height=VALLEY.height,
            transform=file.window_transform(VALLEY),
            compress="deflate",
            predictor=3,
            tiled=False,
        )
        profile.pop("blockxsize", None)
        profile.pop("blockysize", None)
        heights = np.round(file.read(1, window=VALLEY), 1)
    with rasterio.open(HERE / "helens.tif", "w", **profile) as out:
        out.write(heights, 1)
    with rasterio.open(source / "msh_20041011_2m.tif") as file:
        dome = file.read(1, window=DOME)
    if (dome < 0).any():
        raise ValueError("the window of the dome has holes")
    np.save(HERE / "dome.npy", np.round(dome[::-1], 1).astype(np.float32))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
