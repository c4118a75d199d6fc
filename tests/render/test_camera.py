"""The cameras are those of the page (frontend/test/core/projection.test.ts, camera.test.ts; SPEC I1, I4, V5)."""

from __future__ import annotations

import math

import numpy as np
import pytest

from esker import grid
from esker.contract import TerrainSettings
from esker.render.camera import Camera, Vec3, axes, home, look_at
from esker.render.pictures.views import camera_of
from esker.render.surface import Surface

SIZE = 4096.0
SETTINGS = TerrainSettings(size_m=SIZE)


def test_home_on_a_tall_picture_is_that_of_the_page() -> None:
    camera = home(SIZE, 390, 844)
    assert (*camera.eye, *camera.target) == pytest.approx((-2235, -7137, 4725.8, 2048, 2048, 1432.9), abs=0.06)


@pytest.mark.parametrize(("size", "near"), [(100_000.0, 0.1), (SIZE, 0.1), (64.0, 64 / 4096)])
@pytest.mark.parametrize("away", [0.5, 50.0, 20_000.0])
def test_the_near_plane_is_that_of_the_page_however_far_one_looks(size: float, near: float, away: float) -> None:
    assert look_at((0, 0, 10), (away, 0, 10), size, 320, 200).near == near


@pytest.fixture(scope="module")
def wall() -> Surface:
    """A plain at 100 m in the west and one at 700 m in the east, with a cell of 16 m between them."""
    levels = []
    for level in range(3):
        n = grid.samples(level)
        z = np.where(np.arange(n) * SIZE / (n - 1) <= SIZE / 2, 100.0, 700.0)
        levels.append(np.broadcast_to(z, (n, n)).astype(np.float32))
    return Surface(SIZE, levels)


def near_plane(camera: Camera) -> list[Vec3]:
    """9 x 9 places of the near plane, to the picture's corners, metres."""
    forward, right, up = axes(camera)
    out = []
    for across in np.linspace(-1, 1, 9):
        for along in np.linspace(-1, 1, 9):
            direction = forward + camera.tangent * (across * camera.aspect * right + along * up)
            x, y, z = np.asarray(camera.eye) + camera.near * direction
            out.append((float(x), float(y), float(z)))
    return out


@pytest.mark.parametrize("from_wall_m", [-0.2, -0.05, 0.0, 3.0, 12.0])
@pytest.mark.parametrize("heading", range(0, 360, 45))
def test_no_corner_of_the_near_plane_is_in_the_ground(wall: Surface, from_wall_m: float, heading: int) -> None:
    """I4, at the foot of a wall and on a slope of 88 degrees: height over the ground just below is not enough."""
    x = SIZE / 2 + from_wall_m
    ahead = x + 30 * math.sin(math.radians(heading)), 2000 + 30 * math.cos(math.radians(heading))
    camera = camera_of(f"eye:{x},2000,target:{ahead[0]},{ahead[1]}", wall, SETTINGS, 320, 200)
    assert min(z - wall.height_at(px, py) for px, py, z in near_plane(camera)) > 0


def test_an_orbit_never_stands_in_the_ground(wall: Surface) -> None:
    """It is lifted and goes on looking at its target, as in the page; an eye with a height stands just there."""
    camera = camera_of("orbit:90,2,1000,target:1900,2000", wall, SETTINGS, 320, 200)
    assert camera.eye == pytest.approx((1900 + 1000 * math.cos(math.radians(2)), 2000, 701.7))
    assert camera.target == (1900, 2000, 100)
    free = camera_of("orbit:90,50,1000,target:1900,2000", wall, SETTINGS, 320, 200)
    assert free.eye[2] == pytest.approx(100 + 1000 * math.sin(math.radians(50)))
    assert camera_of("eye:2900,2000,699,target:1900,2000", wall, SETTINGS, 320, 200).eye == (2900, 2000, 699)


def test_on_a_small_model_the_eye_stands_lower() -> None:
    flat = Surface(64.0, [np.zeros((grid.samples(0),) * 2, np.float32)])
    assert camera_of("eye:3,3,target:9,9", flat, TerrainSettings(size_m=64.0), 320, 200).eye[2] == pytest.approx(0.64)
