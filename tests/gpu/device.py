"""Runs the project's WGSL compute files under wgpu-py: the same text that the browser compiles."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import wgpu
from numpy.typing import NDArray

SHADERS = Path(__file__).resolve().parents[2] / "shaders"
SLOT = 69
"""Texels along one side of an atlas slot: 65 samples and a border of 2."""
BORDER = 2
ACROSS = 16
NO_SLOT = 0xFFFFFFFF


def source(*names: str) -> str:
    """The generated constants, then the named WGSL files, as gpu/shaders.ts joins them."""
    parts = [SHADERS / "generated" / "contract.wgsl", *(SHADERS / "wgsl" / f"{name}.wgsl" for name in names)]
    return "\n".join(part.read_text() for part in parts)


@cache
def open_device() -> Any:
    """A device of the first adapter (lavapipe on a machine without a GPU). Raises RuntimeError when there is none."""
    adapter = wgpu.gpu.request_adapter_sync(power_preference="low-power")
    if adapter is None:
        raise RuntimeError("no Vulkan adapter: install mesa-vulkan-drivers")
    return adapter.request_device_sync()


def slot_origin(slot: int) -> tuple[int, int, int]:
    """Column, row and layer of the first texel (border included) of a slot."""
    return slot % ACROSS * SLOT, slot // ACROSS % ACROSS * SLOT, slot // (ACROSS * ACROSS)


class TinyAtlas:
    """Height, gradient and light textures of one layer, as gpu/atlas/atlas.ts makes them."""

    def __init__(self) -> None:
        self.device = open_device()
        side = ACROSS * SLOT
        usage = wgpu.TextureUsage

        def make(fmt: str, flags: int) -> Any:
            return self.device.create_texture(
                size=(side, side, 2), format=fmt, usage=flags | usage.TEXTURE_BINDING | usage.COPY_SRC
            )

        self.heights = make("r32float", usage.COPY_DST)
        self.slopes = make("rgba16float", usage.STORAGE_BINDING)
        self.light = make("rgba8unorm", usage.STORAGE_BINDING)

    def put(self, slot: int, samples: NDArray[np.float32]) -> None:
        """Upload the 69 x 69 samples of a slot."""
        col, row, layer = slot_origin(slot)
        self.device.queue.write_texture(
            {"texture": self.heights, "origin": (col, row, layer)},
            np.ascontiguousarray(samples, dtype=np.float32),
            {"bytes_per_row": SLOT * 4, "rows_per_image": SLOT},
            (SLOT, SLOT, 1),
        )

    def read(self, texture: Any, slot: int, dtype: type[np.generic], channels: int) -> NDArray[Any]:
        """The 69 x 69 x channels texels of a slot."""
        width = ACROSS * SLOT
        pitch = -(-width * channels * np.dtype(dtype).itemsize // 256) * 256
        _, _, layer = slot_origin(slot)
        data = self.device.queue.read_texture(
            {"texture": texture, "origin": (0, 0, layer)},
            {"bytes_per_row": pitch, "rows_per_image": width},
            (width, width, 1),
        )
        rows = np.frombuffer(data, dtype=np.uint8).reshape(width, pitch)
        texels = np.ascontiguousarray(rows[:, : width * channels * np.dtype(dtype).itemsize]).view(dtype)
        col, row, _ = slot_origin(slot)
        return texels.reshape(width, width, channels)[row : row + SLOT, col : col + SLOT]

    def run(self, code: str, entry: str, bindings: list[tuple[dict[str, Any], Any]], jobs: int) -> None:
        """Dispatch a compute shader over `jobs` slots; `bindings` are (layout entry, resource) in binding order."""
        visibility = wgpu.ShaderStage.COMPUTE
        layout = self.device.create_bind_group_layout(
            entries=[{"binding": i, "visibility": visibility, **entry} for i, (entry, _) in enumerate(bindings)]
        )
        group = self.device.create_bind_group(
            layout=layout, entries=[{"binding": i, "resource": resource} for i, (_, resource) in enumerate(bindings)]
        )
        pipeline = self.device.create_compute_pipeline(
            layout=self.device.create_pipeline_layout(bind_group_layouts=[layout]),
            compute={"module": self.device.create_shader_module(code=code), "entry_point": entry},
        )
        encoder = self.device.create_command_encoder()
        compute = encoder.begin_compute_pass()
        compute.set_pipeline(pipeline)
        compute.set_bind_group(0, group)
        compute.dispatch_workgroups(-(-67 // 8), -(-67 // 8), jobs)
        compute.end()
        self.device.queue.submit([encoder.finish()])

    def buffer(self, data: NDArray[Any]) -> dict[str, Any]:
        """A read-only storage buffer with this content."""
        made = self.device.create_buffer_with_data(data=data, usage=wgpu.BufferUsage.STORAGE)
        return {"buffer": made, "offset": 0, "size": made.size}

    def view(self, texture: Any) -> Any:
        """The texture as a 2D array."""
        return texture.create_view(dimension="2d-array")


READ = {"buffer": {"type": "read-only-storage"}}
HEIGHTS = {"texture": {"sample_type": "unfilterable-float", "view_dimension": "2d-array"}}


def store(fmt: str) -> dict[str, Any]:
    """Layout entry of a write-only storage texture array."""
    return {"storage_texture": {"access": "write-only", "format": fmt, "view_dimension": "2d-array"}}


def job_list(size: float, jobs: list[tuple[int, int, int, int]]) -> NDArray[np.uint32]:
    """`JobList` of tiles/normals.wgsl: jobs are (slot, level, x, y)."""
    words = np.zeros(4 + 4 * 1024, np.uint32)
    words[:1] = np.array([size], np.float32).view(np.uint32)
    words[1] = len(jobs)
    words[4 : 4 + 4 * len(jobs)] = np.array(jobs, np.uint32).ravel()
    return words


def sun_list(
    size: float, high: float, sun: tuple[float, float, float, float], jobs: list[tuple[int, int, int, int]]
) -> NDArray[np.uint32]:
    """`SunList` of tiles/sun.wgsl: `sun` is the unit vector and the penumbra's tangent."""
    words = np.zeros(8 + 4 * 1024, np.uint32)
    words[0:1] = np.array([size], np.float32).view(np.uint32)
    words[1] = len(jobs)
    words[2:3] = np.array([high], np.float32).view(np.uint32)
    words[4:8] = np.array(sun, np.float32).view(np.uint32)
    words[8 : 8 + 4 * len(jobs)] = np.array(jobs, np.uint32).ravel()
    return words


def page_table(slots: dict[tuple[int, int, int], int]) -> NDArray[np.uint32]:
    """The atlas's page table (gpu/atlas/pagetable.ts): 4096 pairs of words, open addressing by hash."""
    table = np.full((4096, 2), NO_SLOT, np.uint32)
    for (level, x, y), slot in slots.items():
        column = level << 17 | x
        place = ((column * 0x9E3779B1 ^ y * 0x85EBCA77) & 0xFFFFFFFF) >> 20
        while table[place, 0] != NO_SLOT:
            place = (place + 1) % len(table)
        table[place] = column, slot << 17 | y
    return table
