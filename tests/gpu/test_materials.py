"""Functions of the materials, asked one by one (SPEC R610, R615)."""

from __future__ import annotations

import numpy as np
import wgpu
from numpy.typing import NDArray

from tests.gpu.device import open_device, source

COUNT = 256
MODULE = (
    *("view", "tiles/tile", "sky/sky", "material/noise", "tonemap", "material/detail_plain"),
    *("ground/patch", "water/lakes", "material/site", "material/shade"),
)
ENTRY = f"""
@group(1) @binding(0) var<storage, read> asked: array<vec4f, {2 * COUNT}>;
@group(1) @binding(1) var<storage, read_write> told: array<vec4f, {COUNT}>;
@compute @workgroup_size(1)
fn ask(@builtin(global_invocation_id) id: vec3u) {{
  let a = asked[2u * id.x];
  let b = asked[2u * id.x + 1u];
  told[id.x] = vec4f(roughened(normalize(a.xyz), b.xyz), scattered(a.w, b.w));
}}
"""


def ask(asked: NDArray[np.float32]) -> NDArray[np.float64]:
    """(COUNT, 4): the turned normal of (normal, amount) and (relief, hold), and how much of a cover lies."""
    device = open_device()
    usage = wgpu.BufferUsage
    module = device.create_shader_module(code=source(*MODULE) + ENTRY)
    pipeline = device.create_compute_pipeline(layout="auto", compute={"module": module, "entry_point": "ask"})
    data = device.create_buffer_with_data(data=asked.tobytes(), usage=usage.STORAGE)
    out = device.create_buffer(size=16 * COUNT, usage=usage.STORAGE | usage.COPY_SRC)
    entries = [
        {"binding": k, "resource": {"buffer": b, "offset": 0, "size": b.size}} for k, b in enumerate((data, out))
    ]
    group = device.create_bind_group(layout=pipeline.get_bind_group_layout(1), entries=entries)
    encoder = device.create_command_encoder()
    work = encoder.begin_compute_pass()
    work.set_pipeline(pipeline)
    work.set_bind_group(1, group)
    work.dispatch_workgroups(COUNT, 1, 1)
    work.end()
    device.queue.submit([encoder.finish()])
    return np.frombuffer(device.queue.read_buffer(out), dtype=np.float32).reshape(COUNT, 4).astype(np.float64)


def test_relief_turns_every_slope_alike() -> None:
    """R610: a slope along the surface turns its normal by as much whichever way it faces; along the normal by none."""
    rng = np.random.default_rng(5)
    normal = rng.normal(size=(COUNT, 3))
    normal[:, 2] = np.abs(normal[:, 2])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    along = np.cross(normal, rng.normal(size=(COUNT, 3)))
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    slope = rng.uniform(0.05, 1.5, (COUNT, 1))
    straight = rng.uniform(-3, 3, (COUNT, 1))
    relief = along * slope + normal * straight
    asked = np.zeros((COUNT, 2, 4), dtype=np.float32)
    asked[:, 0, :3], asked[:, 1, :3] = normal, relief
    turned = ask(asked.reshape(-1, 4))[:, :3]
    angle = np.degrees(np.arccos(np.clip((turned * normal).sum(axis=1), -1, 1)))
    assert np.abs(angle - np.degrees(np.arctan(slope[:, 0]))).max() < 0.1
    assert ((turned * along).sum(axis=1) < 0).all()


def test_covers_thin_out_over_their_border() -> None:
    """R615: nothing where there is none, all where there is all, more of it where there is more, whatever holds it."""
    asked = np.zeros((COUNT, 2, 4), dtype=np.float32)
    asked[:, 0, 2] = 1
    for hold in (-0.9, -0.4, 0.0, 0.4, 0.9):
        amount = np.linspace(0, 1, COUNT)
        asked[:, 0, 3], asked[:, 1, 3] = amount, hold
        lies = ask(asked.reshape(-1, 4))[:, 3]
        assert lies[0] == 0
        assert lies[-1] == 1
        assert lies.min() >= 0
        assert lies.max() <= 1
        if abs(hold) <= 0.2:
            assert (np.diff(lies) >= 0).all()
        middle = lies[COUNT // 2]
        assert middle > 0.9 if hold > 0.3 else middle < 0.1 if hold < -0.3 else 0.3 < middle < 0.7
