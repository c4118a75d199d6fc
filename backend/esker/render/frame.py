"""What is drawn, and the uniform that all passes of a picture read (twin of frontend/src/gpu/frame.ts and looks.ts)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from esker.contract import MAX_SYNTHESIS_LEVEL, TILE_CELLS, TerrainSettings
from esker.contract.fractal import relief_m, shore_m, zero_m
from esker.render.camera import Camera, Vec3, axes, eye_projection, part, reversed_depth

Overlay = Literal["none", "contours", "slope", "patches", "detail"]
Detail = Literal["rich", "plain"]
OVERLAYS: Final[dict[str, int]] = {"none": 0, "contours": 1, "slope": 2, "patches": 3, "detail": 4}


class LookFigures(NamedTuple):
    """Figures of a look: number in view.wgsl, exposure, optical depth of the haze across the domain, strength of
    contours."""

    number: int
    exposure: float
    haze: float
    contours: float


LOOKS: Final[dict[str, LookFigures]] = {
    "natural": LookFigures(0, 1.3, 0.2, 0),
    "alpine": LookFigures(1, 0.82, 0.2, 0),
    "desert": LookFigures(2, 1.0, 0.2, 0),
    "paper": LookFigures(3, 1.45, 0.05, 0.6),
}


@dataclass(frozen=True)
class Scene:
    """All that one picture shows. ``tau_px``: screen-error bound; ``time``: seconds, for waves; ``ground_m``:
    lowest and highest sample of the elevation layers, None without any; ``instances``: with trees, rocks and tufts."""

    settings: TerrainSettings
    camera: Camera
    tau_px: float = 1.0
    time: float = 12.0
    overlay: Overlay = "none"
    ground_m: tuple[float, float] | None = None
    instances: bool = False


class Rect(NamedTuple):
    """Pixels of the picture that are drawn at a time; ``top`` counts from above."""

    left: int
    top: int
    width: int
    height: int


def sun_direction(azimuth_deg: float, elevation_deg: float) -> Vec3:
    """Unit vector towards the sun; azimuth clockwise from north."""
    a, e = math.radians(azimuth_deg), math.radians(max(elevation_deg, 0.5))
    return math.sin(a) * math.cos(e), math.cos(a) * math.cos(e), math.sin(e)


def adaptation(elevation_deg: float) -> float:
    """How far an eye opens as the sun sinks, 1 at 24 degrees: light falls by thirty from there to half a degree."""
    s = math.sin(math.radians(max(elevation_deg, 0.0)))
    return float(((s + 0.354) / (s + 0.004) / 1.85) ** 0.7)


def contour_interval(relief_m: float, wanted: float = 24) -> float:
    """A round interval (1, 2 or 5 times a power of ten) that gives about ``wanted`` lines over the relief."""
    raw = max(relief_m, 1e-3) / wanted
    power = 10.0 ** math.floor(math.log10(raw))
    mantissa = raw / power
    return power * (1 if mantissa <= 1 else 2 if mantissa <= 2 else 5 if mantissa <= 5 else 10)


def base_height(low: float, size_m: float) -> float:
    """Where the block's foot lies."""
    step = size_m / 32
    return math.floor((low - 0.02 * size_m) / step) * step


def view_values(
    scene: Scene,
    rect: Rect,
    range_m: tuple[float, float],
    amplitude: float,
    *,
    lakes: bool = False,
    rivers: bool = False,
) -> dict[str, ArrayLike]:
    """Fields of ``View`` (view.wgsl). ``range_m``: lowest and highest solved ground; ``amplitude``: metres that the
    value 1 of the channel texture stands for; ``lakes``, ``rivers``: there are some."""
    low, high = range_m
    settings, camera = scene.settings, scene.camera
    lat = None if settings.place is None else settings.place.lat_deg
    look, relief = LOOKS[settings.look], high - low
    sun = sun_direction(settings.sun_azimuth_deg, settings.sun_elevation_deg)
    zero = zero_m(lat, settings.sea_level_m, scene.ground_m)
    exposure = 1.0 if settings.look == "paper" else adaptation(settings.sun_elevation_deg)
    return {
        **_camera_values(camera, rect, settings.size_m),
        "sun": [*sun, sun[2]],
        "time": scene.time % 3600,
        "size": settings.size_m,
        "base": base_height(low, settings.size_m),
        "sea": zero,
        "has_sea": 0.0 if settings.sea_level_m is None else 1.0,
        "has_lakes": 1.0 if lakes else 0.0,
        "has_rivers": 1.0 if rivers else 0.0,
        "exposure": look.exposure * exposure,
        "haze": look.haze / settings.size_m,
        "low": low,
        "high": high,
        "grid": 1 - _smoothstep(0.02, 0.1, relief / settings.size_m),
        "contour": contour_interval(relief),
        "contour_strength": look.contours if relief > 0 else 0.0,
        "line_scale": 1.0,
        "exaggeration": 1.0,
        "look": look.number,
        "amplitude": amplitude,
        "relief": relief_m(settings.size_m, lat, 0.0 if scene.ground_m is None else scene.ground_m[1] - zero),
        "shore": shore_m(settings.size_m, lat),
        "shade": 1.0,
        "overlay": OVERLAYS[scene.overlay],
    }


def _camera_values(camera: Camera, rect: Rect, size_m: float) -> dict[str, ArrayLike]:
    forward, right, up = axes(camera)
    eye = np.array(camera.eye)
    cell = size_m / (TILE_CELLS << MAX_SYNTHESIS_LEVEL)
    whole = np.floor(eye[:2] / cell)
    ortho, tan = camera.ortho_height_m > 0, camera.tangent
    per_pixel = camera.ortho_height_m / camera.height if ortho else 2 * tan / camera.height
    if not ortho:
        # The rays of a part of the picture start from its middle.
        x = 2 * (rect.left + rect.width / 2) / camera.width - 1
        y = 1 - 2 * (rect.top + rect.height / 2) / camera.height
        forward = forward + x * tan * camera.aspect * right + y * tan * up
    matrix = part(reversed_depth(eye_projection(camera)), camera, *rect)
    return {
        "eye_proj": matrix.T,
        "eye": [*eye, 1.0 if ortho else 0.0],
        "eye_low": [*(eye - eye.astype(np.float32)), 0.0],
        "eye_cell": whole,
        "eye_part": eye[:2] - whole * cell,
        "finest_cell": cell,
        "right": [*right, tan * camera.aspect * rect.width / camera.width],
        "up": [*up, tan * rect.height / camera.height],
        "forward": [*forward, per_pixel],
        "viewport": [camera.width, camera.height],
        "guard": [1.0, 1.0],
    }


def _smoothstep(a: float, b: float, v: float) -> float:
    t = min(1.0, max(0.0, (v - a) / (b - a)))
    return t * t * (3 - 2 * t)
