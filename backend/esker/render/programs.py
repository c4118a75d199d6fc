"""Programs from WGSL entry points, and what they bind by the names of the WGSL variables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

import moderngl

from esker.contract import PATCH_CELLS
from esker.wgsl.stage import FRAME, Bindings, Feed, functions, translate
from esker.wgsl.tree import Module

PITCH: Final = PATCH_CELLS + 1
VERTICES_PER_DRAW: Final = 60_000
"""llvmpipe of Mesa 22 can take 65,536 tessellated vertices at once."""

# Patches of water have a level of their own beside the record (water/water.wgsl).
_RECORD_VERTEX: Final = """#version 430
layout(location = 0) in uvec4 a_0;
layout(location = 1) in vec4 a_1;
out uvec4 record_in;
out vec4 water_in;
void main() { record_in = a_0; water_in = a_1; }
"""
# A patch has 16 segments a side; 8 where its neighbour is coarser, which leaves exactly the vertices that both have.
_CONTROL: Final = """#version 430
layout(vertices = 1) out;
in uvec4 record_in[];
in vec4 water_in[];
patch out uvec4 record_out;
patch out vec4 water_out;
{functions}
void main() {{
  uvec4 record = record_in[0];
  record_out = record;
  water_out = water_in[0];
  uint edges = patch_edges(record);
  float full = {cells}.0;
  gl_TessLevelOuter[0] = (edges & 1u) != 0u ? 0.5 * full : full;
  gl_TessLevelOuter[1] = (edges & 4u) != 0u ? 0.5 * full : full;
  gl_TessLevelOuter[2] = (edges & 2u) != 0u ? 0.5 * full : full;
  gl_TessLevelOuter[3] = (edges & 8u) != 0u ? 0.5 * full : full;
  gl_TessLevelInner[0] = full;
  gl_TessLevelInner[1] = full;
}}
"""
_HEAD: Final = "layout(quads, equal_spacing, ccw) in;\npatch in uvec4 record_out;\npatch in vec4 water_out;"
_NEAREST: Final = f"""
uint grid_point() {{
  uvec2 g = uvec2(gl_TessCoord.xy * {PATCH_CELLS}.0 + 0.5);
  return g.x + {PITCH}u * g.y;
}}"""
# Between the samples the surface is that of two triangles a cell, cut from its south-east to its north-west corner.
_BETWEEN: Final = f"""ivec2 g = ivec2(gl_TessCoord.xy * {PATCH_CELLS}.0 * {{factor}}.0 + 0.5);
  ivec2 cell = min(g / {{factor}}, ivec2({PATCH_CELLS - 1}));
  vec2 f = vec2(g - cell * {{factor}}) / {{factor}}.0;
  bool low = f.x + f.y <= 1.0;
  uint south = uint(cell.x) + {PITCH}u * uint(cell.y);
  uint at[3] = uint[3](low ? south : south + {PITCH + 1}u, south + 1u, south + {PITCH}u);
  float share[3];
  share[1] = low ? f.x : 1.0 - f.y;
  share[2] = low ? f.y : 1.0 - f.x;
  share[0] = 1.0 - share[1] - share[2];"""


def _evaluation(factor: int) -> Feed:
    """What the tessellation evaluation stage feeds to a vertex entry point, ``factor`` segments a cell."""
    locations = {0: "record_out", 1: "water_out"}
    if factor == 1:
        return Feed({"vertex_index": "grid_point()"}, locations, _HEAD + _NEAREST)
    return Feed({"vertex_index": "at[k]"}, locations, _HEAD, _BETWEEN.format(factor=factor))


Textured = moderngl.Texture | moderngl.TextureArray


@dataclass
class Resources:
    """What programs may bind, by the names of WGSL variables."""

    textures: dict[str, Textured] = field(default_factory=dict)
    samplers: dict[str, moderngl.Sampler] = field(default_factory=dict)
    buffers: dict[str, moderngl.Buffer] = field(default_factory=dict)
    images: dict[str, Textured] = field(default_factory=dict)

    def bind(self, bindings: Bindings) -> None:
        """Binds all that a program needs. Raises KeyError for what is not there."""
        for name, unit in bindings.uniforms.items():
            self.buffers[name].bind_to_uniform_block(unit)
        for name, unit in bindings.storage.items():
            self.buffers[name].bind_to_storage_buffer(unit)
        for name, unit in bindings.images.items():
            self.images[name].bind_to_image(unit, read=False, write=True)
        for (texture, sampler), unit in bindings.samplers.items():
            self.textures[texture].use(unit)
            # Samplers of texelFetch do not matter, but a unit keeps the one it had.
            self.samplers[sampler or "nearest"].use(unit)


class Draw:
    """A pass that draws: vertex and fragment entry point, with tessellation between them for patches."""

    def __init__(
        self, context: moderngl.Context, module: Module, vertex: str, fragment: str, *, patches: int, half_depth: bool
    ) -> None:
        """``patches``: segments a cell of tessellated patches; 0 for what is no patch."""
        self.bindings = Bindings()
        feed = _evaluation(patches) if patches else None
        constants = {"PITCH": PITCH} if "PITCH" in module.declarations else {}
        shape = translate(module, vertex, self.bindings, constants=constants, feed=feed, half_depth=half_depth)
        colour = translate(module, fragment, self.bindings, constants=constants)
        if patches:
            control = _CONTROL.format(functions=functions(module, "patch_edges"), cells=PATCH_CELLS * patches)
            self.program = context.program(
                vertex_shader=_RECORD_VERTEX,
                tess_control_shader=control,
                tess_evaluation_shader=shape,
                fragment_shader=colour,
            )
        else:
            self.program = context.program(vertex_shader=shape, fragment_shader=colour)
        self._patches = patches
        self._context = context

    def run(
        self,
        resources: Resources,
        frame: tuple[float, float],
        *,
        records: moderngl.Buffer | None = None,
        layout: str = "",
        count: int,
        vertices: int = 6 * PATCH_CELLS,
    ) -> None:
        """Draws ``count`` patches, or instances of ``vertices``, of ``records`` with ``layout``, or vertices."""
        resources.bind(self.bindings)
        if FRAME in self.program:
            self.program[FRAME].value = frame  # type: ignore[union-attr]
        names = ("a_0", "a_1", "a_2")[: len(layout.removesuffix("/i").split())]
        attributes = (layout, *names)
        if records is None:
            self._context.vertex_array(self.program, []).render(moderngl.TRIANGLES, vertices=count)
        elif self._patches:
            self._context.patch_vertices = 1
            array = self._context.vertex_array(self.program, [(records, *attributes)])
            step = VERTICES_PER_DRAW // (PATCH_CELLS * self._patches + 1) ** 2
            for first in range(0, count, step):
                array.render(moderngl.PATCHES, vertices=min(step, count - first), first=first)
        else:
            array = self._context.vertex_array(self.program, [(records, *attributes)])
            array.render(moderngl.TRIANGLES, vertices=vertices, instances=count)


class Compute:
    """A compute entry point."""

    def __init__(
        self, context: moderngl.Context, module: Module, entry: str, constants: Mapping[str, float] | None = None
    ) -> None:
        self.bindings = Bindings()
        self.shader = context.compute_shader(translate(module, entry, self.bindings, constants=constants))
        self._context = context

    def run(self, resources: Resources, groups: tuple[int, int, int]) -> None:
        """Runs work groups and waits for what they write to be seen."""
        resources.bind(self.bindings)
        self.shader.run(*groups)
        self._context.memory_barrier()
