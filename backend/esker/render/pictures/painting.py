"""What the drawing process of ``previews.py`` does: one picture after the other with the same device and context."""

from __future__ import annotations

import io
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Final

from PIL import Image

from esker.contract import Document
from esker.document.layers import span_m
from esker.patchwork.raster import rasters
from esker.patchwork.raster.rasters import Raster, RasterError
from esker.render.camera import Camera, orbit
from esker.render.frame import Scene
from esker.render.pictures.studio import Stage, prepare
from esker.render.reference import Reference
from esker.solve.solver import Solver

BESIDE_SUN_DEG: Final = 55.0
ELEVATION_DEG: Final = 16.0
DISTANCE: Final = 0.78
"""Distance of the eye from the middle, in sides of the domain."""
SIGHT_HEIGHT: Final = 0.3
"""Height of the middle of the picture, as a share of the relief."""


@cache
def _reference() -> Reference:
    return Reference("rich")


@cache
def _solver(device: str | None, level: int) -> Solver:
    return Solver(device, max_level=level, threads=1)


def _held(document: Document, grids: Path | None) -> dict[str, Raster]:
    """The rasters of a document that are in a folder, by content."""
    out: dict[str, Raster] = {}
    if grids is None:
        return out
    for layer in document.layers:
        with suppress(RasterError):
            out[layer.content] = rasters.read(grids / layer.content)
    return out


def camera_for(stage: Stage, width: int, height: int) -> Camera:
    """A view that fills the picture: half to the side of the sun, so that slopes have light and shade, and near."""
    settings = stage.document.settings
    size = settings.size_m
    low, high = stage.surface.range_m
    if settings.sea_level_m is not None:
        low = max(low, min(settings.sea_level_m, high))
    pivot = (size / 2, size / 2, low + SIGHT_HEIGHT * (high - low))
    azimuth, distance = settings.sun_azimuth_deg + BESIDE_SUN_DEG, DISTANCE * size
    return orbit(azimuth, ELEVATION_DEG, distance, pivot, size, width, height)


def picture(
    document: Document, grids: Path | None, device: str | None, size: tuple[int, int], level: int, quality: int
) -> bytes:
    """The terrain in its own look and light, as JPEG. Raises device.NoGraphics, and what solves raise."""
    reference = _reference()
    held = _held(document, grids)
    layers = tuple(layer for layer in document.layers if layer.content in held)
    document = document.model_copy(update={"layers": layers})
    stage = prepare(document, _solver(device, level), grids=held, level=level, refined=level)
    scene = Scene(document.settings, camera_for(stage, *size), ground_m=span_m(document.layers))
    made = reference.draw(stage.surface, scene, stage.channels)
    out = io.BytesIO()
    Image.fromarray(made.pixels).save(out, "JPEG", quality=quality, optimize=True)
    return out.getvalue()
