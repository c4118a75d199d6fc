"""Where trees, rocks and tufts stand: the shader's functions against their NumPy twin (SPEC R612)."""

from __future__ import annotations

import numpy as np
import pytest
import wgpu
from numpy.typing import NDArray

from esker.render import stands
from esker.render.frame import LOOKS
from tests.gpu.device import open_device, source

COUNT = 512
ENTRY = f"""
@group(1) @binding(0) var<storage, read> cells: array<vec2i, {COUNT}>;
@group(1) @binding(1) var<storage, read> soils: array<vec4f, {2 * COUNT}>;
@group(1) @binding(2) var<storage, read_write> told: array<f32, {COUNT * 7}>;
@compute @workgroup_size(1)
fn stand(@builtin(global_invocation_id) id: vec3u) {{
  let i = id.x;
  let s = stand_of(cells[i], KIND);
  let a = soils[2u * i];
  let b = soils[2u * i + 1u];
  let soil = Soil(a.x, a.y, a.z, a.w, b.x, b.y, b.z, b.w);
  let values = array<f32, 7>(s.at.x, s.at.y, s.least, s.size, s.turn, s.hue, density(KIND, LOOK, soil));
  for (var k = 0u; k < 7u; k += 1u) {{ told[7u * i + k] = values[k]; }}
}}
"""


def told(kind: int, look: int, cells: NDArray[np.int32], soils: NDArray[np.float32]) -> NDArray[np.float32]:
    """(COUNT, 7) of the shader: place, least, size, turn, hue, density."""
    device = open_device()
    usage = wgpu.BufferUsage
    code = source("view", "instances/stands") + ENTRY.replace("KIND", f"{kind}u").replace("LOOK", f"{look}u")
    module = device.create_shader_module(code=code)
    pipeline = device.create_compute_pipeline(layout="auto", compute={"module": module, "entry_point": "stand"})
    inputs = [device.create_buffer_with_data(data=a.tobytes(), usage=usage.STORAGE) for a in (cells, soils)]
    out = device.create_buffer(size=4 * 7 * COUNT, usage=usage.STORAGE | usage.COPY_SRC)
    entries = [
        {"binding": k, "resource": {"buffer": b, "offset": 0, "size": b.size}} for k, b in enumerate((*inputs, out))
    ]
    group = device.create_bind_group(layout=pipeline.get_bind_group_layout(1), entries=entries)
    encoder = device.create_command_encoder()
    work = encoder.begin_compute_pass()
    work.set_pipeline(pipeline)
    work.set_bind_group(1, group)
    work.dispatch_workgroups(COUNT, 1, 1)
    work.end()
    device.queue.submit([encoder.finish()])
    return np.frombuffer(device.queue.read_buffer(out), dtype=np.float32).reshape(COUNT, 7)


@pytest.mark.parametrize("look", sorted(LOOKS))
@pytest.mark.parametrize("kind", [stands.TREE, stands.ROCK, stands.TUFT])
def test_the_shader_s_stands_are_the_twin_s(kind: int, look: str) -> None:
    """R612: what a cell holds is its hash, exactly; what grows is the same to a float's last digits."""
    rng = np.random.default_rng(11)
    cells = rng.integers(-40_000, 40_000, (COUNT, 2)).astype(np.int32)
    soils = rng.uniform(0, 1, (COUNT, 8)).astype(np.float32)
    soils[:, 5] *= 1.6
    soils[:, 6] *= 0.1
    found = told(kind, LOOKS[look].number, cells, soils)
    want = stands.stands(cells.astype(np.int64), kind)
    hashed = np.column_stack([want.at, want.least, want.size, want.turn, want.hue])
    assert np.abs(found[:, :6] - hashed).max() < 1e-6
    soil = stands.Soil(*soils.astype(np.float64).T)
    assert np.abs(found[:, 6] - stands.density(kind, look, soil)).max() < 1e-5


def test_stands_are_spread_over_their_cells() -> None:
    """R612: neither place nor size of neighbours hang together, and none stands on the edge of its cell."""
    i, j = np.meshgrid(np.arange(-60, 60), np.arange(-60, 60))
    cells = np.column_stack([i.ravel(), j.ravel()])
    for kind in (stands.TREE, stands.ROCK, stands.TUFT):
        s = stands.stands(cells, kind)
        assert s.at.min() >= 0.06
        assert s.at.max() <= 0.94
        numbers = np.column_stack([s.at, s.least, s.size, s.turn, s.hue])
        assert np.abs(numbers.mean(axis=0) - 0.5).max() < 0.02
        assert np.abs(np.corrcoef(numbers.T) - np.eye(6)).max() < 0.05
        beside = numbers.reshape(120, 120, 6)
        for k in range(6):
            assert abs(np.corrcoef(beside[:, :-1, k].ravel(), beside[:, 1:, k].ravel())[0, 1]) < 0.05
