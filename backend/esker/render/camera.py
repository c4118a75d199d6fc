"""Cameras: the twin of the page's (frontend/src/core/camera/state.ts, camera/projection.ts)."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

Vec3 = tuple[float, float, float]
Floats = NDArray[np.float64]

FOV_DEG: Final = 45.0
"""Vertical field of view."""
NEAR_M: Final = 0.1
"""The near plane, metres; nearer on small models. Reversed depth loses no precision by it."""
HOME_HEADING_DEG: Final = 25.0
HOME_PITCH_DEG: Final = -16.0
HOME_ELEVATION_DEG: Final = 19.0
_HOME_MARGIN: Final = 0.06
_TALL_PITCH_DEG: Final = -2.0
_TALL_ELEVATION_DEG: Final = 6.0
_TALL_MARGIN: Final = -0.46
"""What a picture adds to these that is twice as tall as wide: the page's TALL."""
_STEEPEST: Final = 0.999
"""Sine of the steepest sight whose upper side is still up; beyond, north is."""


class Land(NamedTuple):
    """How high the land lies on the whole, and what of it must be seen at its corners, metres."""

    ground_m: float
    low_m: float


@dataclass(frozen=True)
class Camera:
    """A camera at one moment: metres; ``width`` and ``height`` in pixels. ``ortho_height_m`` > 0: a map from above."""

    eye: Vec3
    target: Vec3
    width: int
    height: int
    near: float
    far: float
    up: Vec3 = (0.0, 0.0, 1.0)
    fov_deg: float = FOV_DEG
    ortho_height_m: float = 0.0

    @property
    def aspect(self) -> float:
        """Width by height."""
        return self.width / self.height

    @property
    def tangent(self) -> float:
        """Tangent of half the vertical field of view."""
        return math.tan(math.radians(self.fov_deg) / 2)

    def sized(self, width: int, height: int) -> Camera:
        """Returns the view on a picture of another size."""
        return replace(self, width=width, height=height)


def axes(camera: Camera) -> tuple[Floats, Floats, Floats]:
    """Forward, right and up, (3,) float64 each: orthonormal, in the world's axes."""
    forward = _unit(np.subtract(camera.target, camera.eye))
    right = _unit(np.cross(forward, camera.up))
    return forward, right, np.cross(right, forward)


def eye_projection(camera: Camera) -> Floats:
    """(4, 4) matrix from places relative to the eye to clip space: x right, y up, z from 0 (near) to w (far)."""
    forward, right, up = axes(camera)
    near, far = camera.near, camera.far
    out = np.zeros((4, 4))
    if camera.ortho_height_m > 0:
        out[0, :3] = right * 2 / (camera.ortho_height_m * camera.aspect)
        out[1, :3] = up * 2 / camera.ortho_height_m
        out[2] = [*forward / (far - near), -near / (far - near)]
        out[3, 3] = 1
    else:
        depth = far / (far - near)
        out[0, :3] = right / (camera.tangent * camera.aspect)
        out[1, :3] = up / camera.tangent
        out[2] = [*forward * depth, -depth * near]
        out[3, :3] = forward
    return out


def reversed_depth(m: Floats) -> Floats:
    """Returns the matrix (4, 4) with depth from w at the near plane to 0 at the far one: floats hold it equally
    well."""
    out = m.copy()
    out[2] = m[3] - m[2]
    return out


def part(m: Floats, camera: Camera, left: int, top: int, width: int, height: int) -> Floats:
    """Clip space (4, 4) of a rectangle of the picture's pixels, from its upper left: an off-centre projection."""
    out = m.copy()
    middle_x = 2 * (left + width / 2) / camera.width - 1
    middle_y = 1 - 2 * (top + height / 2) / camera.height
    out[0] = (m[0] - middle_x * m[3]) * camera.width / width
    out[1] = (m[1] - middle_y * m[3]) * camera.height / height
    return out


def look_at(eye: Vec3, target: Vec3, size_m: float, width: int, height: int) -> Camera:
    """A perspective camera; metres, and pixels for ``width`` and ``height``.

    The near plane is the page's: as near as eyes come to the ground (``views.standing_room``), however far they look.
    Raises ValueError where eye and target are the same place.
    """
    away = math.dist(eye, target)
    if away < 1e-6:
        raise ValueError("The eye and what it looks at are the same place.")
    reach = math.hypot(eye[0] - size_m / 2, eye[1] - size_m / 2, eye[2]) + 2 * size_m
    near = min(NEAR_M, size_m / 4096)
    steep = abs(target[2] - eye[2]) / away
    return Camera(
        eye, target, width, height, near, 2 * reach, (0.0, 1.0, 0.0) if steep > _STEEPEST else (0.0, 0.0, 1.0)
    )


def orbit(
    azimuth_deg: float, elevation_deg: float, distance_m: float, pivot: Vec3, size_m: float, width: int, height: int
) -> Camera:
    """A camera that looks at ``pivot``. ``azimuth_deg``: where it stands, clockwise from north (180: in the south)."""
    a, e = math.radians(azimuth_deg), math.radians(elevation_deg)
    flat = distance_m * math.cos(e)
    eye = (pivot[0] + flat * math.sin(a), pivot[1] + flat * math.cos(a), pivot[2] + distance_m * math.sin(e))
    return look_at(eye, pivot, size_m, width, height)


def home(
    size_m: float, width: int, height: int, heading_deg: float = HOME_HEADING_DEG, land: Land | None = None
) -> Camera:
    """The page's view of the whole terrain: all of it under a sky that takes the upper third of the picture.

    On a picture taller than wide it comes nearer and cuts off the corners at the left and the right.

    ``land``: how high it lies, where that is not about 0.
    """
    ground_m, low_m = land or Land(0.0, 0.0)
    tall = min(max(2 * (1 - width / height), 0.0), 1.0)
    h, p = math.radians(heading_deg), math.radians(HOME_PITCH_DEG + tall * _TALL_PITCH_DEG)
    forward = np.array([math.cos(p) * math.sin(h), math.cos(p) * math.cos(h), math.sin(p)])
    right = np.array([math.cos(h), -math.sin(h), 0.0])
    up = np.cross(right, forward)
    corners = [np.array([x, y, z]) for x in (0, size_m) for y in (0, size_m) for z in (ground_m, low_m)]
    tan = math.tan(math.radians(FOV_DEG) / 2)
    wide, high = tan * width / height * (1 - _HOME_MARGIN - tall * _TALL_MARGIN), tan * (1 - _HOME_MARGIN)
    lift = math.cos(p) * math.tan(math.radians(HOME_ELEVATION_DEG + tall * _TALL_ELEVATION_DEG)) + math.sin(p)
    half, distance = size_m / 2, size_m / 2
    pivot = np.array([half, half, ground_m])
    for _ in range(9):
        fitted = half
        for corner in corners:
            q = corner - pivot
            spread = max(abs(q @ up) / high, abs(q @ right) / wide)
            fitted = max(fitted, spread - q @ forward)
        distance = float(fitted)
        pivot = np.array([half, half, ground_m + lift * distance])
    eye = _vec(pivot - forward * distance)
    return look_at(eye, _vec(pivot), size_m, width, height)


def _unit(v: NDArray[np.floating]) -> Floats:
    return np.asarray(v / (np.linalg.norm(v) or 1.0), dtype=np.float64)


def _vec(v: Floats) -> Vec3:
    return float(v[0]), float(v[1]), float(v[2])
