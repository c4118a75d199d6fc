"""Heights as files that other programs open: NumPy arrays, and 16-bit heightmaps of game engines and modellers."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image, PngImagePlugin

from esker.exporting.ground import bands

SUFFIXES: Final = (".npy", ".png", ".r16")
STEPS: Final = 65_535


def write(path: Path, heights: NDArray[np.float32]) -> str:
    """Writes heights (float32, metres, row 0 south) as the suffix of ``path`` says; returns what to tell of it.

    .npy: as they are. .png and .r16 (little-endian, no header): uint16 from the lowest (0) to the highest (65535),
    row 0 north, as these programs expect. Raises OSError.
    """
    if path.suffix == ".npy":
        with path.open("wb") as file:
            np.save(file, heights)
        return ""
    low, high = float(heights.min()), float(heights.max())
    rows, columns = heights.shape
    said = f"{columns} x {rows} samples, north first: 0 is {low:.9g} m, {STEPS} is {high:.9g} m"
    steps = quantised(heights)
    if path.suffix == ".r16":
        steps.tofile(path)
    else:
        info = PngImagePlugin.PngInfo()
        info.add_text("Description", said)
        Image.fromarray(steps).save(path, format="PNG", pnginfo=info)
    return said


def quantised(heights: NDArray[np.float32]) -> NDArray[np.uint16]:
    """Steps (little-endian uint16, row 0 north) of heights in metres; the largest error is half a step."""
    low, high = float(heights.min()), float(heights.max())
    scale = STEPS / (high - low) if high > low else 0.0
    steps = np.empty(heights.shape, dtype="<u2")
    for start, stop in bands(0, *heights.shape):
        steps[start:stop] = np.rint((heights[::-1][start:stop].astype(np.float64) - low) * scale)
    return steps
