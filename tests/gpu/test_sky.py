"""The baked sky against the float64 twin, and the light that it gives (SPEC R62)."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
import wgpu
from numpy.typing import NDArray

from tests.gpu import sky_twin
from tests.gpu.device import open_device, source

WIDTH, HEIGHT = 64, 48


def sun_at(elevation_deg: float) -> NDArray[np.float64]:
    """Unit vector to a sun in the east."""
    e = math.radians(elevation_deg)
    return np.array([math.cos(e), 0.0, math.sin(e)])


def bake(elevation_deg: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The table of radiance (HEIGHT, WIDTH, 3) and the eight vectors of ambient light."""
    device = open_device()
    usage = wgpu.TextureUsage
    table = device.create_texture(
        size=(WIDTH, HEIGHT, 1),
        format="rgba16float",
        usage=usage.STORAGE_BINDING | usage.TEXTURE_BINDING | usage.COPY_SRC,
    )
    flags = wgpu.BufferUsage
    ambient = device.create_buffer(size=128, usage=flags.STORAGE | flags.COPY_SRC)
    job = device.create_buffer_with_data(data=np.array([*sun_at(elevation_deg), 0], np.float32), usage=flags.UNIFORM)
    module = device.create_shader_module(code=source("sky/atmosphere", "sky/tables"))
    encoder = device.create_command_encoder()
    whole = {"buffer": ambient, "offset": 0, "size": 128}
    bindings = {
        "bake_sky": ([(1, table.create_view())], (WIDTH // 8, HEIGHT // 8, 1)),
        "bake_ambient": ([(2, table.create_view()), (3, whole)], (1, 1, 1)),
    }
    for entry, (more, groups) in bindings.items():
        pipeline = device.create_compute_pipeline(layout="auto", compute={"module": module, "entry_point": entry})
        resources = [(0, {"buffer": job, "offset": 0, "size": 16}), *more]
        group = device.create_bind_group(
            layout=pipeline.get_bind_group_layout(0),
            entries=[{"binding": binding, "resource": resource} for binding, resource in resources],
        )
        work = encoder.begin_compute_pass()
        work.set_pipeline(pipeline)
        work.set_bind_group(0, group)
        work.dispatch_workgroups(*groups)
        work.end()
    device.queue.submit([encoder.finish()])
    texels = device.queue.read_texture(
        {"texture": table}, {"bytes_per_row": WIDTH * 8, "rows_per_image": HEIGHT}, (WIDTH, HEIGHT, 1)
    )
    sky = np.frombuffer(texels, np.float16).reshape(HEIGHT, WIDTH, 4)[..., :3].astype(np.float64)
    vectors = np.frombuffer(device.queue.read_buffer(ambient), np.float32).reshape(8, 4)[:, :3].astype(np.float64)
    return sky, vectors


def direction(col: int, row: int) -> NDArray[np.float64]:
    """The direction that a texel stands for (`direction_of` in sky/tables.wgsl)."""
    azimuth = 2 * math.asin(col / (WIDTH - 1))
    elevation = math.asin((row / (HEIGHT - 1)) ** 2)
    return np.array(
        [math.cos(azimuth) * math.cos(elevation), math.sin(azimuth) * math.cos(elevation), math.sin(elevation)]
    )


@pytest.mark.parametrize("elevation", [2.0, 15.0, 50.0])
def test_the_sky_is_that_of_its_twin(elevation: float) -> None:
    """R62: all orders of scattering, within 10 % of the brightest channel there, 15 % with the sun at 2 degrees."""
    sky, _ = bake(elevation)
    assert np.isfinite(sky).all()
    sun = sun_at(elevation)
    allowed = 0.15 if elevation < 5 else 0.10
    for col in (0, 20, 40, 63):
        for row in (3, 14, 30, 47):
            want = sky_twin.radiance(direction(col, row), sun)
            assert np.abs(sky[row, col] - want).max() < allowed * want.max(), (col, row, sky[row, col], want)


def test_light_falls_and_reddens_towards_sunset() -> None:
    """R62: a lower sun is dimmer and redder; the sky still gives light when it is at the horizon."""
    suns = [bake(elevation)[1] for elevation in (0.5, 5.0, 20.0, 60.0)]
    light = [vectors[6] for vectors in suns]
    for lower, higher in pairwise(light):
        assert (lower < higher).all()
        assert lower[0] / lower[2] > higher[0] / higher[2]
    assert suns[0][4].min() > 0.005
    assert suns[2][0].sum() > suns[2][1].sum(), "the face towards the sun sees the brighter sky"
