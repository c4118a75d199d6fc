"""Morph weights of a patch's vertices against their NumPy twin (SPEC R4, R71)."""

from __future__ import annotations

import numpy as np
import wgpu
from numpy.typing import NDArray

from esker.contract import PATCH_CELLS
from tests.gpu.device import open_device, source

SIDE = PATCH_CELLS + 1
BAND = 2.0
ENTRY = f"""
@group(1) @binding(0) var<storage, read> test_records: array<vec4u>;
@group(1) @binding(1) var<storage, read_write> test_weights: array<f32>;
@compute @workgroup_size(1)
fn weigh(@builtin(global_invocation_id) id: vec3u) {{
  let g = vec2i(id.xy);
  test_weights[(id.z * {SIDE}u + id.y) * {SIDE}u + id.x] = patch_morph(test_records[id.z], g);
}}
"""


def twin(corners: NDArray[np.float64], own: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 17, 17) weights, row 0 south, of (n, 4) weights of corners and (n,) own ones."""
    t = np.linspace(0, 1, SIDE)
    south, north = (corners[:, k, None] * (1 - t) + corners[:, k + 1, None] * t for k in (0, 2))
    rows = south[:, None, :] * (1 - t)[:, None] + north[:, None, :] * t[:, None]
    away = np.minimum(np.arange(SIDE), np.arange(SIDE)[::-1])
    share = np.maximum(0, 1 - np.minimum(away[:, None], away[None, :]) / BAND)
    weights: NDArray[np.float64] = own[:, None, None] * (1 - share) + rows * share
    return weights


def weigh(records: NDArray[np.uint32]) -> NDArray[np.float32]:
    """What the shader makes of patch records."""
    device = open_device()
    usage = wgpu.BufferUsage
    module = device.create_shader_module(code=source("view", "tiles/tile", "ground/patch") + ENTRY)
    pipeline = device.create_compute_pipeline(layout="auto", compute={"module": module, "entry_point": "weigh"})
    data = device.create_buffer_with_data(data=records.tobytes(), usage=usage.STORAGE)
    out = device.create_buffer(size=4 * len(records) * SIDE * SIDE, usage=usage.STORAGE | usage.COPY_SRC)
    entries = [
        {"binding": k, "resource": {"buffer": b, "offset": 0, "size": b.size}} for k, b in enumerate((data, out))
    ]
    group = device.create_bind_group(layout=pipeline.get_bind_group_layout(1), entries=entries)
    encoder = device.create_command_encoder()
    work = encoder.begin_compute_pass()
    work.set_pipeline(pipeline)
    work.set_bind_group(1, group)
    work.dispatch_workgroups(SIDE, SIDE, len(records))
    work.end()
    device.queue.submit([encoder.finish()])
    return np.frombuffer(device.queue.read_buffer(out), dtype=np.float32).reshape(-1, SIDE, SIDE)


def test_weights_of_vertices() -> None:
    """R71: the corners' on the edges, the patch's own from two cells inside; R4: ends are exact, edges know no more."""
    random = np.random.default_rng(4)
    words = random.integers(0, 256, (200, 5))
    words[:40] = random.integers(0, 2, (40, 5)) * 255
    records = np.zeros((len(words), 4), dtype=np.uint32)
    records[:, 2] = 0xABC | 0xDEF << 12 | words[:, 4] << 24
    records[:, 3] = words[:, :4] @ (1 << np.arange(0, 32, 8))
    found = weigh(records)
    assert np.abs(found - twin(words[:, :4] / 255, words[:, 4] / 255)).max() < 1e-6
    assert set(np.unique(found[:40, ::16, ::16])) <= {0.0, 1.0}
    assert (found[:, 2:-2, 2:-2] == found[:, 2:3, 2:3]).all()
