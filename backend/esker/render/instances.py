"""Trees, rocks and tufts of a picture: found by the page's kernel, drawn by the page's shaders (docs/renderer.md)."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import moderngl
import numpy as np

from esker.contract import (
    MAX_SYNTHESIS_LEVEL,
    MOST_FAR_TREES,
    MOST_NEAR_TREES,
    MOST_ROCKS,
    MOST_TUFTS,
    SOIL_M,
    TILE_CELLS,
    TREE_NEAR_M,
)
from esker.render import sources
from esker.render.programs import Compute, Draw, Resources

FLOATS: Final = 12
"""Numbers that tell one instance."""


class Sort(NamedTuple):
    """A kind in one of its shapes: entry points, vertices of one, and how many a picture may have (scatter.wgsl)."""

    name: str
    vertices: int
    most: int


SORTS: Final = (
    Sort("tree", 336, MOST_NEAR_TREES),
    Sort("impostor", 6, MOST_FAR_TREES),
    Sort("rock", 96, MOST_ROCKS),
    Sort("tuft", 45, MOST_TUFTS),
)
KINDS: Final = 3


def soil_level(size_m: float) -> int:
    """The level on which the channels count, whatever level is drawn: none comes or goes as tiles refine."""
    return min(max(round(math.log2(size_m / (TILE_CELLS * SOIL_M))), 0), MAX_SYNTHESIS_LEVEL)


class Instances:
    """The programs, and what they found for a picture."""

    def __init__(self, context: moderngl.Context, *, half_depth: bool) -> None:
        self._context = context
        module = sources.scatter()
        self._scatter, self._close = (Compute(context, module, entry) for entry in ("scatter", "close"))
        drawn = sources.instances()
        self._draws = [
            Draw(context, drawn, f"{s.name}_vertex", f"{s.name}_fragment", patches=0, half_depth=half_depth)
            for s in SORTS
        ]

    def find(self, resources: Resources, records: moderngl.Buffer, count: int, size_m: float) -> list[moderngl.Buffer]:
        """The instances on these patches in the view that ``resources`` holds: a buffer for each of SORTS."""
        head = np.array([count, soil_level(size_m), 0, 0], dtype="<u4")
        head[2:3] = np.array([TREE_NEAR_M], dtype="<f4").view("<u4")
        found = self._context.buffer(reserve=4 * FLOATS * sum(s.most for s in SORTS))
        draws = self._context.buffer(np.array([[s.vertices, 0, 0, 0] for s in SORTS], dtype="<u4").tobytes())
        own = {"turn": self._context.buffer(head.tobytes()), "records": records, "found": found, "draws": draws}
        bound = Resources(resources.textures, resources.samplers, {**resources.buffers, **own})
        if count:
            self._scatter.run(bound, (count, KINDS, 1))
            self._close.run(bound, (1, 1, 1))
        counts = np.frombuffer(draws.read(), dtype="<u4").reshape(-1, 4)[:, 1].tolist()
        out, first = [], 0
        for sort, n in zip(SORTS, counts, strict=True):
            own_buffer = self._context.buffer(reserve=max(4 * FLOATS * n, 16))
            if n:
                self._context.copy_buffer(own_buffer, found, 4 * FLOATS * n, read_offset=4 * FLOATS * first)
            out.append(own_buffer)
            first += sort.most
        self.counts = dict(zip((s.name for s in SORTS), counts, strict=True))
        return out

    def draw(self, resources: Resources, frame: tuple[float, float], found: list[moderngl.Buffer]) -> None:
        """Draws what was found."""
        for sort, draw, buffer in zip(SORTS, self._draws, found, strict=True):
            n = self.counts[sort.name]
            if n:
                draw.run(resources, frame, records=buffer, layout="4f4 4f4 4f4 /i", count=n, vertices=sort.vertices)
