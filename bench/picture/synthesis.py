"""Detail on the device: what a tile costs, views from empty caches, a flight.

``esker bench synthesis --json``: every native adapter that wgpu finds, and Chromium's SwiftShader where
that is installed, runs the page's own WGSL (``_slots``). Paper 1 rebuilds 604 patches of 32 x 32 vertices
in 2.4 s on a GeForce 6800 GT. The views here draw as many patches, and as many vertices; timed is all that makes their
tiles and bounds, uploads included, until the device is done, by the wall clock; ``cpu``: what the process
computes meanwhile on all cores, all of the work where the adapter is a CPU. ``floor``: the bytes that a tile must read
and write, at the rate at which the same adapter copies.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import statistics
import sys
import time
from collections import OrderedDict
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bench.room import _serving
from bench.room._slots import AREA, HELD, Job, SlotMaker, child_of
from esker import grid
from esker.contract import PATCH_CELLS, SUBPATCHES
from esker.synthesis.site import Site, tile_window
from esker.synthesis.state import State, unpack
from esker.synthesis.subdivide import finest_level
from esker.version import VERSION

SIZE: Final = 4096.0
SOLVED: Final = 4
CAPACITY: Final = 1024
PATCHES: Final = {"as_many_patches": 604, "as_many_vertices": 604 * 4}
"""Figure 8 b of paper 1 draws 604 patches of 32 x 32 vertices; ours have 16 x 16 cells."""
PAPER: Final = {"view_ms": 2438.0, "patch_of_32_ms": 0.5, "device": "GeForce 6800 GT, 2005"}
BATCHES: Final = (1, 4, 16, 64)
FRAMES: Final = 300
FIELD_OF_VIEW: Final = 60.0
SWIFTSHADER: Final = "/usr/lib/chromium/vk_swiftshader_icd.json"
PARENT: Final = 37
"""Samples along one side of the parent's window that a slot is made from."""
TILE_BYTES: Final = AREA * (8 + 16 + 3 * 4) + PARENT * PARENT * (8 + 16)
"""Ground, state and three texels of 4 bytes written, the parent's ground and state read."""


class Eye(NamedTuple):
    """Place in metres, ``z`` above the ground; ``yaw`` in radians from the x axis."""

    x: float
    y: float
    z: float
    yaw: float


Patch = tuple[int, int]


@dataclass(frozen=True)
class Cut:
    """What a view draws: leaves in view, and all tiles that they rest on."""

    patches: int
    tiles: frozenset[tuple[int, int, int]]


def select(eye: Eye, cell_px: float, top: int, height_px: int = 800) -> Cut:
    """The restricted tree of 16-cell patches whose cells cover at most ``cell_px`` pixels on flat ground."""
    pixels = height_px / (2 * math.tan(math.radians(FIELD_OF_VIEW) / 2))
    wanted: list[set[Patch]] = []
    level_nodes = [(i, j) for j in range(SUBPATCHES) for i in range(SUBPATCHES)]
    for level in range(top):
        cell = grid.spacing(level, SIZE)
        split = {p for p in level_nodes if _near(eye, p, cell, pixels / cell_px)}
        wanted.append(split)
        level_nodes = [(2 * i + a, 2 * j + b) for i, j in split for a in (0, 1) for b in (0, 1)]
    for level in range(top - 1, 0, -1):
        side = SUBPATCHES << level
        for i, j in wanted[level]:
            around = ((i + a, j + b) for a in (-1, 0, 1) for b in (-1, 0, 1))
            wanted[level - 1].update((a >> 1, b >> 1) for a, b in around if 0 <= a < side and 0 <= b < side)
    tiles = {(0, 0, 0)}
    for level, split in enumerate(wanted):
        tiles.update((level + 1, i >> 1, j >> 1) for i, j in split)
    leaves = 0
    nodes = [(i, j) for j in range(SUBPATCHES) for i in range(SUBPATCHES)]
    for level in range(top + 1):
        split = wanted[level] if level < top else set()
        cell = grid.spacing(level, SIZE)
        leaves += sum(1 for p in nodes if p not in split and _seen(eye, p, cell))
        nodes = [(2 * i + a, 2 * j + b) for i, j in split for a in (0, 1) for b in (0, 1)]
    return Cut(leaves, frozenset(tiles))


def _near(eye: Eye, patch: Patch, cell: float, reach: float) -> bool:
    """Returns whether a patch is in view, and nearer than where its cells are small enough."""
    w = PATCH_CELLS * cell
    dx = max(patch[0] * w - eye.x, 0.0, eye.x - (patch[0] + 1) * w)
    dy = max(patch[1] * w - eye.y, 0.0, eye.y - (patch[1] + 1) * w)
    return math.sqrt(dx * dx + dy * dy + eye.z * eye.z) < cell * reach and _seen(eye, patch, cell)


def _seen(eye: Eye, patch: Patch, cell: float) -> bool:
    """The circle round the patch meets the wedge of a wide picture."""
    w = PATCH_CELLS * cell
    radius = w * math.sqrt(0.5)
    dx, dy = (patch[0] + 0.5) * w - eye.x, (patch[1] + 0.5) * w - eye.y
    forward = dx * math.cos(eye.yaw) + dy * math.sin(eye.yaw)
    across = abs(-dx * math.sin(eye.yaw) + dy * math.cos(eye.yaw))
    half = math.radians(FIELD_OF_VIEW) / 2 * 1.6
    return across * math.cos(half) - forward * math.sin(half) <= radius and forward >= -radius


def limit_for(eye: Eye, patches: int, top: int) -> float:
    """Pixels a cell may cover so that about so many patches are drawn."""
    low, high = 0.5, 64.0
    for _ in range(18):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if select(eye, middle, top).patches > patches else (low, middle)
    return high


def terrain() -> Site:
    """A ridge over waves, solved to level SOLVED, in quanta as on the wire."""
    guides = []
    for level in range(SOLVED + 1):
        t = np.arange(grid.samples(level)) * grid.spacing(level, SIZE)
        x, y = np.meshgrid(t, t)
        z = 520 * np.maximum(0, 1 - np.abs(x - 1900 - 0.2 * y) / 700) + 70 * np.sin(x / 210) * np.cos(y / 260)
        q = grid.quantum(level, SIZE)
        guides.append((np.rint(z / q) * q).astype(np.float32))
    return Site(SIZE, 12345, tuple(guides), sea_level_m=0.0)


def strokes() -> dict[str, NDArray[np.float32]]:
    """All six channels as strokes leave them, on 257 x 257."""
    rng = np.random.default_rng(1)
    names = ("amplitude", "roughness", "snow", "grass", "forest", "wetness")
    return {name: rng.uniform(0, 1, (257, 257)).astype(np.float32) for name in names}


class Cache:
    """Slots of one device, least recently used out first: the page's atlas without its pictures."""

    def __init__(self, maker: SlotMaker) -> None:
        self.maker = maker
        self.slots: OrderedDict[tuple[int, int, int], int] = OrderedDict()
        self.free = list(range(maker.capacity - 1, -1, -1))

    def want(self, tiles: frozenset[tuple[int, int, int]]) -> list[Job]:
        """Takes in missing tiles; returns the jobs that fill them. Raises RuntimeError where they do not fit."""
        jobs = []
        for tile in sorted(tiles):
            if tile in self.slots:
                self.slots.move_to_end(tile)
        for tile in sorted(tiles - self.slots.keys()):
            if not self.free:
                victim, slot = self.slots.popitem(last=False)
                if victim in tiles:
                    raise RuntimeError("the view does not fit into the cache")
                self.free.append(slot)
            slot = self.slots[tile] = self.free.pop()
            jobs.append(self.job(tile, slot))
        return jobs

    def job(self, tile: tuple[int, int, int], slot: int) -> Job:
        """Returns what fills a tile's slot; solved tiles are held with all their neighbours."""
        level, x, y = tile
        parent = self.slots[level - 1, x >> 1, y >> 1] if level else 0
        return Job(slot, level, x, y, parent, HELD if level <= SOLVED else 0)

    def fill(self, jobs: list[Job]) -> None:
        """Uploads, synthesis, bounds; until the device is done."""
        for job in jobs:
            if job.held:
                self.maker.put(job.slot, self.maker.site.guide(tile_window(job.level, job.x, job.y)).astype(np.float32))
        self.maker.run(jobs)
        self.maker.bounds(jobs)


def timed(action: Callable[[], None], repeats: int) -> dict[str, float]:
    """Milliseconds: least and median of some runs; the least that the process computed on all its cores."""
    walls, cpus = [], []
    for _ in range(repeats):
        began, cpu = time.perf_counter(), time.process_time()
        action()
        walls.append(1e3 * (time.perf_counter() - began))
        cpus.append(1e3 * (time.process_time() - cpu))
    return {"least": round(min(walls), 4), "median": round(statistics.median(walls), 4), "cpu": round(min(cpus), 4)}


def per_tile(maker: SlotMaker, repeats: int) -> dict[str, Any]:
    """Milliseconds a tile by rule and batch, of composing and of bounds."""
    jobs = [Job(0, 0, 0, 0, 0, HELD)]
    maker.put(0, maker.site.guide(tile_window(0, 0, 0)).astype(np.float32))
    for slot in range(1, 1 + 4 + 16 + 64):
        up = jobs[(slot - 1) // 4]
        jobs.append(child_of(up, slot, (slot - 1) & 1, (slot - 1) >> 1 & 1))
    batch = [job for job in jobs if job.level == 3]

    def once(action: Callable[[list[Job]], object], n: int) -> None:
        action(batch[:n])
        maker.wait()

    def many(action: Callable[[list[Job]], object], sizes: tuple[int, ...]) -> dict[str, dict[str, float]]:
        out = {}
        for n in sizes:
            once(action, n)
            times = timed(partial(once, action, n), repeats)
            out[str(n)] = {key: round(value / n, 4) for key, value in times.items()}
        return out

    site = maker.site
    out: dict[str, Any] = {}
    for name, other in (
        ("landscape", site),
        ("landscape_painted", replace(site, channels=strokes())),
        ("smooth", replace(site, rule="smooth")),
        ("plain", replace(site, rule="plain")),
    ):
        maker.configure(other)
        maker.run(jobs)
        out[name] = many(maker.run, BATCHES if name == "landscape" else BATCHES[-1:])
    maker.configure(site)
    out["compose"] = many(lambda some: maker.run(some, "compose"), BATCHES[-1:])
    out["bounds"] = many(maker.bounds, BATCHES[-1:])
    return out


def copy_rate(maker: SlotMaker, repeats: int) -> float:
    """Bytes a second that the adapter reads and writes when it copies states to grounds."""
    size, times = maker.grounds.size, 4

    def copy() -> None:
        encoder = maker.device.create_command_encoder()
        for _ in range(times):
            encoder.copy_buffer_to_buffer(maker.states, 0, maker.grounds, 0, size)
        maker.device.queue.submit([encoder.finish()])
        maker.wait()

    copy()
    return float(2 * times * size / (1e-3 * timed(copy, repeats)["least"]))


def view(maker: SlotMaker, eye: Eye, patches: int, repeats: int) -> dict[str, Any]:
    """Measures the way from empty caches to all tiles of a view with so many patches."""
    top = finest_level(SIZE)
    limit = limit_for(eye, patches, top)
    cut = select(eye, limit, top)

    def rebuild() -> None:
        cache = Cache(maker)
        cache.fill(cache.want(cut.tiles))

    rebuild()
    levels = [level for level, _, _ in cut.tiles]
    return {
        "patches": cut.patches,
        "tiles": len(cut.tiles),
        "finest_level": max(levels),
        "finest_cell_m": grid.spacing(max(levels), SIZE),
        "pixels_a_cell": round(limit, 3),
        "ms": timed(rebuild, repeats),
    }


def path() -> Iterator[Eye]:
    """Yields the eyes of a flight: from 400 m down to eye height, turning, then a walk of 1.4 m/s; FRAMES, thirty a
    second."""
    eye = Eye(700.0, 700.0, 400.0, 0.7)
    down = (1.7 / 400) ** (1 / (0.7 * FRAMES))
    for frame in range(FRAMES):
        step = max(1.4, 0.6 * eye.z) / 30
        yaw = eye.yaw + 0.003 * math.sin(frame / 40)
        eye = Eye(eye.x + step * math.cos(yaw), eye.y + step * math.sin(yaw), max(1.7, eye.z * down), yaw)
        yield eye


def flight(maker: SlotMaker, limit: float, frames: int) -> dict[str, Any]:
    """Tiles made anew in each of the first frames of the flight, and what that takes."""
    top = finest_level(SIZE)
    cache = Cache(maker)
    made, times, drawn = [], [], []
    for frame, eye in enumerate(islice(path(), frames)):
        cut = select(eye, limit, top)
        jobs = cache.want(cut.tiles)
        began = time.perf_counter()
        if jobs:
            cache.fill(jobs)
        if frame == 0:
            continue
        made.append(len(jobs))
        drawn.append(cut.patches)
        times.append(1e3 * (time.perf_counter() - began))
    most = sorted(times)[int(0.95 * len(times))]
    return {
        "frames": len(made),
        "patches": {"mean": round(statistics.mean(drawn), 1), "most": max(drawn)},
        "tiles_made": {"mean": round(statistics.mean(made), 2), "most": max(made), "frames_without": made.count(0)},
        "ms": {"mean": round(statistics.mean(times), 3), "p95": round(most, 3), "most": round(max(times), 3)},
    }


def adapters() -> list[Any]:
    """Adapters of native backends; Chromium's SwiftShader joins unless drivers were asked for by name."""
    if "VK_ADD_DRIVER_FILES" not in os.environ and Path(SWIFTSHADER).exists():
        os.environ["VK_ADD_DRIVER_FILES"] = SWIFTSHADER
    import wgpu

    return [a for a in wgpu.gpu.enumerate_adapters_sync() if a.info["backend_type"] in ("Vulkan", "Metal", "D3D12")]


def measure(adapter: Any, repeats: int, frames: int) -> dict[str, Any]:
    """All figures of one adapter."""
    site = terrain()
    maker = SlotMaker(site, CAPACITY, adapter)
    rate = copy_rate(maker, repeats)
    eye = Eye(700.0, 700.0, 60.0, 0.7)
    info = adapter.info
    floor_ms = round(1e3 * TILE_BYTES / rate, 5)
    views = {name: view(maker, eye, patches, max(2, repeats // 2)) for name, patches in PATCHES.items()}
    return {
        "adapter": info["device"],
        "driver": info["description"],
        "kind": info["adapter_type"],
        "backend": info["backend_type"],
        "tile_ms": per_tile(maker, repeats),
        "floor": {"tile_bytes": TILE_BYTES, "copy_gb_s": round(rate / 1e9, 2), "tile_ms": floor_ms},
        "views": views,
        "flight": flight(maker, views["as_many_patches"]["pixels_a_cell"], frames),
    }


def states(adapter: Any) -> list[State]:
    """A tile of every level to 12, the same on every adapter but for the rounding of its arithmetic."""
    site = replace(terrain(), channels=strokes())
    maker = SlotMaker(site, 16, adapter)
    cache = Cache(maker)
    jobs = cache.want(frozenset((level, 1365 >> (12 - level), 2730 >> (12 - level)) for level in range(13)))
    cache.fill(jobs)
    return [unpack(maker.state(job.slot)) for job in jobs]


def agreement(found: list[State], first: list[State]) -> dict[str, Any]:
    """Returns how far one adapter's detail is from another's: metres, units of 16 bits, share of equal d."""
    pairs = list(zip(found, first, strict=True))
    units = [np.abs(a - b).max() * 65535 for one, two in pairs for a, b in zip(one[2:], two[2:], strict=True)]
    return {
        "detail_m": float(max(np.abs(one.d - two.d).max() for one, two in pairs)),
        "channel_units": round(float(max(units))),
        "equal_details": round(float(np.mean([np.mean(one.d == two.d) for one, two in pairs])), 4),
    }


def main(argv: list[str]) -> int:
    """``esker bench synthesis [--json] [-o FILE] [--quick]``."""
    parser = argparse.ArgumentParser(prog="esker bench synthesis", description=__doc__)
    parser.add_argument("--json", action="store_true", help="print the result as JSON")
    parser.add_argument("-o", "--output", type=Path, help="write the JSON to a file too")
    parser.add_argument("--quick", action="store_true", help="few repeats, a short flight: to see that it works")
    arguments = parser.parse_args(argv)
    repeats, frames = (2, 6) if arguments.quick else (15, FRAMES)
    found = [measure(adapter, repeats, frames) for adapter in adapters()]
    if not found:
        sys.stderr.write("no adapter: install mesa-vulkan-drivers, or a GPU's driver\n")
        return 1
    made = [states(adapter) for adapter in adapters()]
    for one, own in zip(found, made, strict=True):
        one["agreement_with_first"] = agreement(own, made[0])
    result = {
        "bench": "synthesis",
        "version": VERSION,
        "machine": _serving.machine(),
        "samples_a_tile": AREA,
        "paper": PAPER,
        "adapters": found,
    }
    text = json.dumps(result, indent=1) + "\n"
    if arguments.output:
        arguments.output.write_text(text, encoding="utf-8")
    if arguments.json:
        sys.stdout.write(text)
    else:
        for one in found:
            best = one["tile_ms"]["landscape"][str(BATCHES[-1])]["least"]
            views = ", ".join(f"{v['patches']} patches {v['ms']['least']:.0f} ms" for v in one["views"].values())
            made = one["flight"]["tiles_made"]["mean"]
            sys.stdout.write(f"{one['adapter']}: {best:.3f} ms a tile; {views}; {made} tiles a frame of the flight\n")
    return 0
