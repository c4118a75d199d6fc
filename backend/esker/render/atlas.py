"""Tiles on the device: the page's atlas (frontend/src/gpu/atlas/atlas.ts) for one picture."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import moderngl
import numpy as np
from numpy.typing import ArrayLike, NDArray

from esker.contract import MAX_SYNTHESIS_LEVEL, TILE_SAMPLES
from esker.render import sources
from esker.render.layout import StructLayout
from esker.render.programs import Compute, Resources, Textured
from esker.render.surface import SLOT, SlotData, Surface, Tile
from esker.synthesis.state import H_SCALE, Array, State
from esker.wgsl.tree import Module

SLOTS_ACROSS: Final = 16
SLOTS_PER_LAYER: Final = SLOTS_ACROSS**2
MAX_SLOTS: Final = 2048
"""About 160 MB on the device, twice that with what the rule keeps."""
JOBS: Final = 1024
GROUPS: Final = -(-(TILE_SAMPLES + 2) // 8)
PENUMBRA: Final = 0.02
NO_SLOT: Final = 0xFFFFFFFF

# A shorter march, as the page uses where the device computes on the CPU (frontend/src/gpu/atlas/tilecompute.ts).
PLAIN_MARCH: Final = {"SUN_STEPS": 32, "SUN_GROWTH": 0.18, "SKY_DIRECTIONS": 5, "SKY_STEPS": 4}


class Atlas:
    """Heights, gradients, light and attributes of the tiles of a cut. Slot 0 is the root's."""

    def __init__(self, context: moderngl.Context, tiles: Sequence[Tile], surface: Surface) -> None:
        """Raises ValueError for more tiles than MAX_SLOTS, or where the root is not the first."""
        if len(tiles) > MAX_SLOTS or tiles[0] != (0, 0, 0):
            raise ValueError(f"an atlas holds the root and up to {MAX_SLOTS} tiles in all, not {len(tiles)}")
        self.slots = {tile: slot for slot, tile in enumerate(tiles)}
        layers = max(2, -(-len(tiles) // SLOTS_PER_LAYER))
        side = SLOTS_ACROSS * SLOT
        shape = (side, side, layers)
        self.heights = context.texture_array(shape, 1, dtype="f4")
        self.slopes = context.texture_array(shape, 4, dtype="f2")
        self.light = context.texture_array(shape, 4, dtype="f1")
        self.attributes0 = context.texture_array(shape, 4, dtype="f1")
        self.attributes1 = context.texture_array(shape, 4, dtype="f1")
        for texture in self.textures.values():
            texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        for tile, slot in self.slots.items():
            self._upload(slot, surface.slot(*tile))
        self._context = context
        self.pages = context.buffer(page_table(self.slots).tobytes())
        """Slots by tile, for shaders."""

    @property
    def textures(self) -> dict[str, moderngl.TextureArray]:
        """By the names that view.wgsl has for them."""
        names = ("heights", "slopes", "light", "attributes0", "attributes1")
        return {name: getattr(self, name) for name in names}

    def compute(self, normals: Compute, sun: Compute, size_m: float, high: float, direction: Sequence[float]) -> None:
        """Gradients, then sun and sky visibility of all tiles."""
        jobs = np.array([(slot, *tile) for tile, slot in self.slots.items()], dtype=np.uint32)
        under: dict[str, ArrayLike] = {"high": high, "sun": [*direction, PENUMBRA]}
        passes: list[tuple[Compute, Module, dict[str, ArrayLike], dict[str, Textured]]] = [
            (normals, sources.normals(), {}, {"slopes_out": self.slopes}),
            (sun, sources.sun(), under, {"light_out": self.light}),
        ]
        for compute, module, head, images in passes:
            layout = StructLayout(module, "JobList" if "JobList" in module.declarations else "SunList")
            for first in range(0, len(jobs), JOBS):
                some = jobs[first : first + JOBS]
                data = bytearray(layout.pack({"size": size_m, "count": len(some), **head}))
                at = layout.offsets["jobs"]
                data[at : at + some.nbytes] = some.tobytes()
                buffers = {"list": self._context.buffer(bytes(data)), "pages": self.pages}
                nearest = self._context.sampler(filter=(moderngl.NEAREST, moderngl.NEAREST))
                resources = Resources(dict(self.textures), {"nearest": nearest}, buffers, images)
                compute.run(resources, (GROUPS, GROUPS, len(some)))

    def _upload(self, slot: int, data: SlotData) -> None:
        col, row, layer = slot % SLOTS_ACROSS, slot // SLOTS_ACROSS % SLOTS_ACROSS, slot // SLOTS_PER_LAYER
        place = (col * SLOT, row * SLOT, layer, SLOT, SLOT, 1)
        self.heights.write(np.ascontiguousarray(data.heights, dtype="<f4").tobytes(), viewport=place)
        if data.state is not None and data.grain is not None:
            first, second = attribute_texels(data.state, data.grain)
            self.attributes0.write(first.tobytes(), viewport=place)
            self.attributes1.write(second.tobytes(), viewport=place)


def attribute_texels(state: State, grain: Array) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """(69, 69, 4) each, as synthesis/synthesise.wgsl writes them: snow, wet, foam, h/2; grass, forest, grain, and 0
    where the page tells its selection of the next level."""
    pairs = (
        (state.snow, state.wet, state.foam, state.h / H_SCALE),
        (state.grass, state.forest, 0.5 + 0.5 * grain, np.zeros_like(grain)),
    )
    first, second = (np.floor(np.clip(np.stack(p, axis=-1), 0, 1) * 255 + 0.5).astype(np.uint8) for p in pairs)
    return first, second


def page_table(slots: dict[Tile, int]) -> NDArray[np.uint32]:
    """The hash table by which shaders find a tile's slot (frontend/src/gpu/atlas/pagetable.ts): (places, 2)."""
    places = sources.number(sources.sun(), "PLACES")
    if len(slots) > places // 2:
        raise ValueError(f"the page table is made for {places // 2} tiles")
    table = np.full((places, 2), NO_SLOT, dtype=np.uint32)
    shift = 32 - (places - 1).bit_length()
    for (level, x, y), slot in slots.items():
        column = x | (level << MAX_SYNTHESIS_LEVEL)
        mixed = (column * 0x9E3779B1 & 0xFFFFFFFF) ^ (y * 0x85EBCA77 & 0xFFFFFFFF)
        place = mixed >> shift
        while table[place, 0] != NO_SLOT:
            place = (place + 1) % places
        table[place] = column, y | slot << MAX_SYNTHESIS_LEVEL
    return table
