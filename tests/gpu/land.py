"""A terrain whose tiles lie in slots on a device, with what is held above the solved levels: for synthesis tests."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.room._slots import SLOT, Job, SlotMaker
from esker import grid
from esker.synthesis.site import BORDER, Site

SIZE = 4096.0
Tile = tuple[int, int, int]


@cache
def hills(level: int, wavy: bool = False) -> NDArray[np.float32]:
    """A whole level of heights in quanta: a sharp ridge, waves, a shore at 0 m. ``wavy``: fits a cyclic domain."""
    t = np.arange(grid.samples(level)) * grid.spacing(level, SIZE)
    x, y = np.meshgrid(t, t)
    z = 60.0 * np.sin(x * 2 * np.pi * 3 / SIZE) * np.cos(y * 2 * np.pi * 2 / SIZE)
    if not wavy:
        z += 500.0 * np.maximum(0.0, 1.0 - np.abs(x - 1900.0 - 0.2 * y) / 600.0)
    q = grid.quantum(level, SIZE)
    heights: NDArray[np.float32] = (np.rint(z / q) * q).astype(np.float32)
    if wavy:
        heights[:, -1], heights[-1] = heights[:, 0], heights[0]
    return heights


def surveyed(seed: int) -> dict[str, NDArray[np.float32]]:
    """Elevation data of many spacings, beside none."""
    levels = np.random.default_rng(seed).uniform(-2, 5, (33, 33))
    return {"survey": np.maximum(levels, -1).astype(np.float32)}


def fixed(seed: int) -> dict[str, NDArray[np.float32]]:
    """Paint of gullies, and distances from what strokes fix."""
    rng = np.random.default_rng(seed)
    far, erosion = rng.uniform(0, 1, (257, 257)), rng.uniform(-1, 1, (17, 17))
    return {"far": far.astype(np.float32), "erosion": erosion.astype(np.float32)}


def painted(seed: int) -> dict[str, NDArray[np.float32]]:
    """Channels as strokes leave them, on grids of several sizes, one of them finer than level 0."""
    rng = np.random.default_rng(seed)
    sides = {"amplitude": 129, "roughness": 65, "snow": 17, "grass": 65, "forest": 9, "wetness": 5}
    out = {name: rng.uniform(-1, 1, (side, side)).astype(np.float32) for name, side in sides.items()}
    out["amplitude"] *= 8
    out["roughness"] = 0.5 + 0.5 * out["roughness"]
    return out


def site_of(solved: int = 2, **changes: Any) -> Site:
    fields: dict[str, Any] = {"seed": 2**31 + 12345, "sea_level_m": 20.0, **changes}
    guides = tuple(hills(level, bool(changes.get("cyclic"))) for level in range(solved + 1))
    return Site(SIZE, guides=guides, **fields)


def lineage(path: Iterable[tuple[int, int]]) -> list[Tile]:
    """The root and one child of each after it, by its quadrant (east, north)."""
    tiles = [(0, 0, 0)]
    for east, north in path:
        level, x, y = tiles[-1]
        tiles.append((level + 1, 2 * x + east, 2 * y + north))
    return tiles


class Land:
    """Tiles of a terrain in slots, with what is held above the solved levels."""

    def __init__(self, site: Site, tiles: Iterable[Tile], held: dict[Tile, NDArray[np.float32]] | None = None) -> None:
        self.site = site
        ordered = sorted(set(tiles))
        # Slots scattered over rows and layers, so that a wrong address shows.
        self.slots = {tile: 37 * k % 300 if k else 0 for k, tile in enumerate(ordered)}
        assert len(set(self.slots.values())) == len(ordered)
        self.held = held or {}
        self.maker = SlotMaker(site, 300)
        self.jobs = [self.job(tile) for tile in ordered]
        for job in self.jobs:
            self.upload(job)
        self.maker.run(self.jobs)

    def mask(self, level: int, x: int, y: int) -> int:
        side = 1 << level
        bits = 0
        for k in range(9):
            there = (level, x + k % 3 - 1, y + k // 3 - 1)
            if self.site.cyclic:
                there = (level, there[1] % side, there[2] % side)
            inside = min(there[1:]) >= 0 and max(there[1:]) < side
            if inside and (level <= self.site.solved or there in self.held):
                bits |= 1 << k
        return bits

    def job(self, tile: Tile) -> Job:
        level, x, y = tile
        parent = self.slots[level - 1, x // 2, y // 2] if level else 0
        return Job(self.slots[tile], level, x, y, parent, self.mask(level, x, y))

    def upload(self, job: Job) -> None:
        """What the atlas writes: held samples, one owner each; what is not held gets a wild value."""
        if job.held == 0:
            return
        out = np.full((SLOT, SLOT), 1.0e7, np.float32)
        inner = slice(BORDER, SLOT - BORDER)
        side = 1 << job.level
        for k in reversed(range(9)):
            if not job.held >> k & 1:
                continue
            dx, dy = k % 3 - 1, k // 3 - 1
            x, y = (job.x + dx) % side, (job.y + dy) % side
            pad = np.full((3 * SLOT, 3 * SLOT), np.nan, np.float32)
            pad[SLOT + dy * 64 + BORDER :, SLOT + dx * 64 + BORDER :][:65, :65] = self.heights(job.level, x, y)
            part = pad[SLOT : 2 * SLOT, SLOT : 2 * SLOT]
            out = np.where(np.isnan(part), out, part)
        assert job.level or (out[inner, inner] < 1e6).all()
        self.maker.put(job.slot, out)

    def heights(self, level: int, x: int, y: int) -> NDArray[np.float32]:
        if level > self.site.solved:
            return self.held[level, x, y]
        return self.site.guides[level][64 * y : 64 * y + 65, 64 * x : 64 * x + 65]

    def everything(self, tile: Tile) -> NDArray[np.uint32]:
        """All bits that a slot has: (69, 69, 9) words."""
        slot = self.slots[tile]
        parts = [self.maker.ground(slot).view(np.uint32), self.maker.state(slot)]
        parts.append(self.maker.texels("heights", slot).view(np.uint32)[..., None])
        texels = (self.maker.texels(name, slot) for name in ("attributes0", "attributes1"))
        parts += [np.ascontiguousarray(bytes4).view(np.uint32) for bytes4 in texels]
        return np.concatenate(parts, axis=-1)


def around(level: int, x: int, y: int) -> list[Tile]:
    """The four tiles that meet at the south-west corner of one."""
    return [(level, x + dx, y + dy) for dy in (-1, 0) for dx in (-1, 0)]


def with_ancestors(tiles: Iterable[Tile]) -> set[Tile]:
    out: set[Tile] = set()
    for level, x, y in tiles:
        out |= {(level - up, x >> up, y >> up) for up in range(level + 1)}
    return out


def disagreements(land: Land) -> int:
    """How many words differ where slots of a level overlap: shared edges, corners and the borders beyond them."""
    bad = 0
    seen = {tile: land.everything(tile) for tile in land.slots}
    for (level, x, y), west in seen.items():
        for dx, dy in ((1, 0), (0, 1), (1, 1), (1, -1)):
            other = seen.get((level, x + dx, y + dy))
            if other is None:
                continue
            rows, other_rows = overlap(dy)
            cols, other_cols = overlap(dx)
            same = west[rows, cols] == other[other_rows, other_cols]
            bad += int(same.size - np.count_nonzero(same))
    return bad


def overlap(step: int) -> tuple[slice, slice]:
    """Where a slot and its neighbour have the same samples along one axis."""
    if step == 0:
        return slice(None), slice(None)
    near, far = slice(64, SLOT), slice(0, SLOT - 64)
    return (near, far) if step > 0 else (far, near)
