"""The page's synthesis pass under wgpu-py: the same WGSL, buffers and jobs (gpu/synthesis/synthesis.ts, bounds.ts).

For tests and benchmarks. Runs on any adapter that wgpu finds; Mesa's lavapipe on a machine without a GPU.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from esker.contract import BASE_FAR, BASE_ROUGHNESS, BASE_SURVEY, MAX_SYNTHESIS_LEVEL, SUBPATCHES, TILE_SAMPLES, fractal
from esker.resources import SHADERS
from esker.synthesis import hash as noise
from esker.synthesis.rules import gullies
from esker.synthesis.rules.targets import tie
from esker.synthesis.site import BORDER, Biases, Site

PARTS: Final = ("tiles/tile", *(f"synthesis/{name}" for name in ("hash", "interpolate", "site", "targets", "gullies")))
SLOT: Final = TILE_SAMPLES + 2 * BORDER
"""Samples along one side of a slot."""
AREA: Final = SLOT * SLOT
ACROSS: Final = 16
"""Slots along one side of a texture layer."""
GROUPS: Final = -(-((SLOT // 2 + 1) ** 2) // 64)
"""Workgroups of 64 parents' cells that make a slot."""
JOB_WORDS: Final = 8
JOB_ALIGN: Final = 256 // (4 * JOB_WORDS)
HELD: Final = 0b111_111_111
"""All nine tiles are held."""
NODE: Final = (*Biases._fields[:6], "survey", "far", "erosion")
"""Channels in the order in which a node has them."""
TEXTURES: Final = ("heights", "attributes0", "attributes1")


class Job(NamedTuple):
    """One tile to make. ``parent``: its slot; ``held``: bit (dy + 1) * 3 + dx + 1 where that tile is held."""

    slot: int
    level: int
    x: int
    y: int
    parent: int = 0
    held: int = 0


def source(*names: str) -> str:
    """The generated constants, then the named WGSL files, as gpu/shaders.ts joins them."""
    files = [SHADERS / "generated" / "contract.wgsl", *(SHADERS / "wgsl" / f"{name}.wgsl" for name in names)]
    return "\n".join(Path(file).read_text() for file in files)


def site_words(site: Site, bits: int, varied: bool, biased: bool) -> NDArray[np.uint32]:
    """``SynthSite`` of synthesis/site.wgsl: gpu/synthesis/site.ts in Python."""
    look, sea = site.look_rule, site.sea_level_m
    head = [site.size_m, site.amplitude_m, site.zero_m, 0.0 if sea is None else 1.0, *look]
    words = [
        np.array(head, np.float32).view(np.uint32),
        np.array([site.solved, site.cyclic, bits, varied, biased, site.surveyed], np.uint32),
        np.array([site.relief_m, site.shore_m], np.float32).view(np.uint32),
        np.array([5 if _wide(site) else 3, site.eroded, site.gully_side], np.uint32),
        np.array([site.erosion, site.hold, site.far_m, site.far_margin_m, 0, 0], np.float32).view(np.uint32),
    ]
    for level in range(MAX_SYNTHESIS_LEVEL + 1):
        starts = [site.seed + fractal.HASH_STEP * (fractal.HASH_STREAMS * level + stream) for stream in range(4)]
        words.append(noise.mix(np.array([start & 0xFFFFFFFF for start in starts], np.uint32)))
        numbers = [
            1 / site.spacing(max(0, level - 1)),
            tie(level),
            fractal.CHANNEL_NOISE * 2.0 ** (-fractal.CHANNEL_NOISE_DECAY * level),
            fractal.SMOOTHNESS_NOISE * 2.0 ** (-fractal.SMOOTHNESS_NOISE_DECAY * level),
        ]
        words.append(np.array(numbers, np.float32).view(np.uint32))
        start = site.seed + fractal.HASH_STEP * (fractal.HASH_STREAMS * level + fractal.GULLY_STREAM)
        words.append(noise.mix(np.array([start & 0xFFFFFFFF], np.uint32)))
        octave = [gullies.wave_m(site, level), gullies.depth_m(site, level), 0]
        words.append(np.array(octave, np.float32).view(np.uint32))
    return np.concatenate(words)


def _wide(site: Site) -> bool:
    """Whether nodes of the channels hold survey, far and erosion too."""
    return any(name in site.channels for name in ("survey", "far", "erosion"))


def channel_values(site: Site) -> tuple[NDArray[np.float32], int, bool, bool]:
    """All channels on the finest of their grids, (n, n, 6), or 10 of wide nodes; log2(n - 1); do they vary; is any bias
    asked for."""
    cells = max([1, *(len(values) - 1 for values in site.channels.values())])
    out = np.zeros((cells + 1, cells + 1, 10 if _wide(site) else 6), np.float32)
    out[..., 1] = BASE_ROUGHNESS
    if _wide(site):
        out[..., 6], out[..., 7] = BASE_SURVEY, BASE_FAR
    for k, name in enumerate(NODE):
        if name in site.channels:
            values = site.channels[name].astype(np.float64)
            while len(values) <= cells:
                values = _refined(values)
            out[..., k] = values
    biased = bool(out[..., 2:6].any())
    return out, cells.bit_length() - 1, biased or bool((out != out[0, 0]).any()), biased


def _refined(z: NDArray[np.float64]) -> NDArray[np.float64]:
    """Twice as many cells, bilinear."""
    for _ in range(2):
        wide = np.empty((2 * len(z) - 1, z.shape[1]))
        wide[::2], wide[1::2] = z, (z[1:] + z[:-1]) / 2
        z = wide.T
    return z


class SlotMaker:
    """Slots of one terrain on a device. ``adapter``: of wgpu; the first that there is if none is given.

    Raises RuntimeError when there is no adapter.
    """

    def __init__(self, site: Site, capacity: int = 64, adapter: Any = None) -> None:
        import wgpu

        self.wgpu = wgpu
        adapter = adapter or wgpu.gpu.request_adapter_sync(power_preference="low-power")
        if adapter is None:
            raise RuntimeError("no Vulkan adapter: install mesa-vulkan-drivers")
        self.capacity = capacity
        self.device = adapter.request_device_sync()
        usage = wgpu.BufferUsage
        storage = usage.STORAGE | usage.COPY_DST | usage.COPY_SRC
        self.grounds = self.device.create_buffer(size=8 * AREA * capacity, usage=storage)
        self.states = self.device.create_buffer(size=16 * AREA * capacity, usage=storage)
        self.jobs = self.device.create_buffer(size=4 * JOB_WORDS * 4096, usage=storage)
        side, layers = ACROSS * SLOT, max(2, -(-capacity // ACROSS**2))
        flags = wgpu.TextureUsage.STORAGE_BINDING | wgpu.TextureUsage.TEXTURE_BINDING | wgpu.TextureUsage.COPY_SRC
        formats = {"heights": "r32float", "attributes0": "rgba8unorm", "attributes1": "rgba8unorm"}
        self.textures = {
            name: self.device.create_texture(size=(side, side, layers), format=formats[name], usage=flags)
            for name in TEXTURES
        }
        self._layout = self._bind_group_layout()
        self._bounds: Any = None
        self.configure(site)

    def configure(self, site: Site) -> None:
        """Another terrain, or other settings, in the same slots."""
        self.site = site
        usage = self.wgpu.BufferUsage
        values, bits, varied, biased = channel_values(site)
        channels = self.device.create_buffer_with_data(data=values, usage=usage.STORAGE)
        words = self.device.create_buffer_with_data(data=site_words(site, bits, varied, biased), usage=usage.UNIFORM)
        code = source(*PARTS, f"synthesis/rule_{site.rule}", "synthesis/slots", "synthesis/synthesise")
        module = self.device.create_shader_module(code=code)
        layout = self.device.create_pipeline_layout(bind_group_layouts=[self._layout])
        self._pipelines = {
            entry: self.device.create_compute_pipeline(layout=layout, compute={"module": module, "entry_point": entry})
            for entry in ("synthesise", "compose", "compose_root")
        }
        buffers = [words, self.jobs, self.grounds, self.states, channels]
        resources: list[Any] = [{"buffer": b, "offset": 0, "size": b.size} for b in buffers]
        resources[1]["size"] = self.jobs.size // 2
        resources += [self._view(name) for name in TEXTURES]
        entries = [{"binding": i, "resource": resource} for i, resource in enumerate(resources)]
        self._group = self.device.create_bind_group(layout=self._layout, entries=entries)

    def put(self, slot: int, guide: NDArray[np.float32], base: NDArray[np.float32] | None = None) -> None:
        """Held samples of a slot, (69, 69) each; what is not held is written over. Without ``base`` it is the guide."""
        both = np.stack([guide, guide if base is None else base], axis=-1).astype(np.float32)
        self.device.queue.write_buffer(self.grounds, 8 * AREA * slot, np.ascontiguousarray(both))

    def run(self, jobs: Sequence[Job], what: str = "synthesise") -> None:
        """Makes tiles, parents before children; ``what`` may be "compose"."""
        encoder = self.device.create_command_encoder()
        self.encode(encoder, jobs, what)
        self.device.queue.submit([encoder.finish()])

    def encode(self, encoder: Any, jobs: Sequence[Job], what: str = "synthesise") -> None:
        """Writes what ``run`` does into an encoder. It may be called once per submission."""
        words = np.zeros((0, JOB_WORDS), np.uint32)
        compute = encoder.begin_compute_pass()
        for level, batch in _by_level(jobs):
            compute.set_pipeline(self._pipelines["compose_root" if what == "compose" and not level else what])
            compute.set_bind_group(0, self._group, [words.nbytes])
            compute.dispatch_workgroups(GROUPS, len(batch))
            block = np.zeros((-(-len(batch) // JOB_ALIGN) * JOB_ALIGN, JOB_WORDS), np.uint32)
            block[: len(batch), :6] = batch
            words = np.concatenate([words, block])
        compute.end()
        self.device.queue.write_buffer(self.jobs, 0, words)

    def bounds(self, jobs: Sequence[Job]) -> NDArray[np.float32]:
        """Returns what tiles/bounds.wgsl finds in tiles that were made: (tiles, 4, 4, 4), sub-patch rows from the
        south."""
        if self._bounds is None:
            module = self.device.create_shader_module(code=source("tiles/tile", "tiles/bounds"))
            self._bounds = self.device.create_compute_pipeline(
                layout="auto", compute={"module": module, "entry_point": "compute_bounds"}
            )
        words = np.zeros((len(jobs) + 1, JOB_WORDS), np.uint32)
        words[0, :1] = np.array([self.site.size_m], np.float32).view(np.uint32)
        words[1:, :6] = jobs
        usage = self.wgpu.BufferUsage
        listed = self.device.create_buffer_with_data(
            data=np.concatenate([words[0, :4], words[1:].ravel()]), usage=usage.STORAGE
        )
        shape = (len(jobs), SUBPATCHES, SUBPATCHES, 4)
        out = self.device.create_buffer(size=4 * int(np.prod(shape)), usage=usage.STORAGE | usage.COPY_SRC)
        resources = [_whole(listed), self._view("heights"), self._view("attributes1"), _whole(out)]
        group = self.device.create_bind_group(
            layout=self._bounds.get_bind_group_layout(0),
            entries=[{"binding": i, "resource": resource} for i, resource in enumerate(resources)],
        )
        encoder = self.device.create_command_encoder()
        compute = encoder.begin_compute_pass()
        compute.set_pipeline(self._bounds)
        compute.set_bind_group(0, group)
        compute.dispatch_workgroups(len(jobs))
        compute.end()
        self.device.queue.submit([encoder.finish()])
        return np.frombuffer(self.device.queue.read_buffer(out), np.float32).reshape(shape)

    def ground(self, slot: int) -> NDArray[np.float32]:
        """Guide and base of a slot, (69, 69, 2) metres."""
        data = self.device.queue.read_buffer(self.grounds, 8 * AREA * slot, 8 * AREA)
        return np.frombuffer(data, np.float32).reshape(SLOT, SLOT, 2)

    def state(self, slot: int) -> NDArray[np.uint32]:
        """Words of a slot's state, (69, 69, 4); ``esker.synthesis.state.unpack`` reads them."""
        data = self.device.queue.read_buffer(self.states, 16 * AREA * slot, 16 * AREA)
        return np.frombuffer(data, np.uint32).reshape(SLOT, SLOT, 4)

    def texels(self, name: str, slot: int) -> NDArray[Any]:
        """Texels of a slot: heights (69, 69) float32 metres, attributes (69, 69, 4) uint8."""
        col, row, layer = slot % ACROSS * SLOT, slot // ACROSS % ACROSS * SLOT, slot // ACROSS**2
        data = self.device.queue.read_texture(
            {"texture": self.textures[name], "origin": (col, row, layer)},
            {"bytes_per_row": 512, "rows_per_image": SLOT},
            (SLOT, SLOT, 1),
        )
        rows = np.frombuffer(data, np.uint8).reshape(SLOT, 512)[:, : 4 * SLOT]
        if name == "heights":
            return np.ascontiguousarray(rows).view(np.float32)
        return rows.reshape(SLOT, SLOT, 4)

    def wait(self) -> None:
        """Waits until all that was submitted is done, by reading four bytes."""
        self.device.queue.read_buffer(self.states, 0, 4)

    def _view(self, name: str) -> Any:
        return self.textures[name].create_view(dimension="2d-array")

    def _bind_group_layout(self) -> Any:
        def buffer(kind: str, dynamic: bool = False) -> dict[str, Any]:
            return {"buffer": {"type": kind, "has_dynamic_offset": dynamic}}

        def store(fmt: str) -> dict[str, Any]:
            return {"storage_texture": {"access": "write-only", "format": fmt, "view_dimension": "2d-array"}}

        parts = [
            buffer("uniform"),
            buffer("read-only-storage", True),
            buffer("storage"),
            buffer("storage"),
            buffer("read-only-storage"),
            store("r32float"),
            store("rgba8unorm"),
            store("rgba8unorm"),
        ]
        visibility = self.wgpu.ShaderStage.COMPUTE
        return self.device.create_bind_group_layout(
            entries=[{"binding": i, "visibility": visibility, **part} for i, part in enumerate(parts)]
        )


def _whole(buffer: Any) -> dict[str, Any]:
    return {"buffer": buffer, "offset": 0, "size": buffer.size}


def _by_level(jobs: Sequence[Job]) -> Iterator[tuple[int, list[Job]]]:
    for level in sorted({job.level for job in jobs}):
        yield level, [job for job in jobs if job.level == level]


def child_of(job: Job, slot: int, east: int, north: int, held: int = 0) -> Job:
    """The job of a child of a tile."""
    return Job(slot, job.level + 1, 2 * job.x + east, 2 * job.y + north, job.slot, held)
