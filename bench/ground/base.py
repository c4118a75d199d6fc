"""Base tiles on their way to a page (DESIGN 6, 11): bytes of the first view, of the rest, of changes, and the times.

The starting terrains made of real elevation data, levels 0 to 4, in this process: the real base and tiles; no socket,
and no strokes, whose offsets cost the same with a base as without. Bytes do not depend on the machine.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Iterator
from typing import Any, Final

import numpy as np

from bench.room import _serving
from esker import contract as c
from esker import grid, templates
from esker.contract import Channel
from esker.patchwork.base import Base
from esker.patchwork.lod import space
from esker.patchwork.lod.space import Placed
from esker.tiles.delivery import ClientTiles, TileServer
from esker.tiles.plans import FramePlan
from esker.version import VERSION

LEVEL: Final = c.DEFAULT_LEVEL


def laid(layers: tuple[c.Layer, ...], template: templates.Template, size_m: float, before: Base | None = None) -> Base:
    """The base of these layers."""
    rasters = template.rasters()
    placed = [Placed(layer, rasters[layer.content]) for layer in layers if not layer.hidden]
    return Base(space.build(placed), size_m, before)


def views(base: Base, size_m: float) -> Iterator[tuple[str, c.View]]:
    """The whole domain from the south, and somebody who stands near its middle."""
    heights = base.level(LEVEL)
    mid = heights.shape[0] // 2
    z, half = float(heights[mid, mid]), size_m / 2
    near, far = (half, 0.4 * size_m, z + 0.05 * size_m), (half, -0.6 * size_m, z + 0.55 * size_m)
    yield "whole", c.View(eye=far, target=(half, half, z), width=1600, height=900)
    yield "near", c.View(eye=near, target=(half, 0.6 * size_m, z), width=1600, height=900)


def put(server: TileServer, base: Base, clock: int) -> float:
    """Puts the base, and offsets of zero over it; returns the milliseconds that the base took as tiles."""
    levels = [base.level(level) for level in range(LEVEL + 1)]
    began = time.perf_counter()
    for level, heights in enumerate(levels):
        server.put_level(clock, level, heights, True, Channel.BASE)
    took = 1000 * (time.perf_counter() - began)
    for level in range(LEVEL + 1):
        n = grid.samples(level)
        server.put_level(clock, level, np.zeros((n, n), dtype=np.float32), True)
    return took


def drained(client: ClientTiles) -> tuple[list[tuple[FramePlan, int]], float]:
    """All frames that the client is owed, with their bytes; and the milliseconds that they took."""
    frames = []
    began = time.perf_counter()
    while (plan := client.plan()) is not None:
        frames.append((plan, len(plan.encode())))
        client.commit(plan)
    return frames, 1000 * (time.perf_counter() - began)


def figures(frames: list[tuple[FramePlan, int]], took_ms: float) -> dict[str, Any]:
    """Bytes of a client's frames: of the base by level, and of what lies on it."""
    out: dict[str, Any] = {"bytes": sum(size for _, size in frames), "encode_ms": round(took_ms, 1)}
    base = [(plan, size) for plan, size in frames if plan.channel == Channel.BASE]
    out["offsets_bytes"] = out["bytes"] - sum(size for _, size in base)
    for level in range(LEVEL + 1):
        tiles = sum(len(plan.keys) for plan, _ in base if plan.level == level)
        size = sum(size for plan, size in base if plan.level == level)
        if tiles:
            out[f"base_level_{level}"] = {"tiles": tiles, "bytes": size, "bytes_per_tile": round(size / tiles)}
    return out


def measure(name: str) -> dict[str, Any]:
    """One terrain: first views, everything, and a layer that is moved by 30 m."""
    template = templates.load(name)
    document = template.document
    size_m = document.settings.size_m
    base = laid(document.layers, template, size_m)
    server = TileServer(size_m, LEVEL)
    out: dict[str, Any] = {"size_m": size_m, "layers": len(document.layers), "put_ms": round(put(server, base, 1), 1)}
    for label, view in views(base, size_m):
        client = ClientTiles(server, rest_level=-1)
        client.set_view(view)
        out[f"first_view_{label}"] = figures(*drained(client))
    whole = ClientTiles(server)
    out["everything"] = figures(*drained(whole))
    last = document.layers[-1]
    moved = last.model_copy(update={"anchor": (last.anchor[0] + 30, last.anchor[1])})
    put(server, laid((*document.layers[:-1], moved), template, size_m, base), 2)
    out["layer_moved_whole"] = figures(*drained(whole))
    out["layer_moved_in_view"] = figures(*drained(client))
    return out


def main(argv: list[str]) -> int:
    """``esker bench base [--json] [--scene NAME ...]``."""
    parser = argparse.ArgumentParser(prog="esker bench base", description=__doc__)
    parser.add_argument("--scene", action="append", choices=list(templates.REAL), help="default: all of real places")
    parser.add_argument("--json", action="store_true", help="print the result as JSON")
    arguments = parser.parse_args(argv)
    scenes = {name: measure(name) for name in arguments.scene or templates.REAL}
    result = {"bench": "base", "version": VERSION, "machine": _serving.machine(), "level": LEVEL, "scenes": scenes}
    if arguments.json:
        sys.stdout.write(json.dumps(result, indent=1) + "\n")
        return 0
    for name, scene in scenes.items():
        sys.stdout.write(f"{name}, {scene['size_m']:g} m, {scene['layers']} layers, put in {scene['put_ms']} ms\n")
        for part, value in scene.items():
            if isinstance(value, dict):
                sys.stdout.write(f"  {part}: {value['bytes']:,} bytes in {value['encode_ms']} ms\n")
    return 0
