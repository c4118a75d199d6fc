"""Whole GLSL shaders from entry points of a WGSL module: bindings, stage inputs and outputs, ``main``.

WGSL and OpenGL differ in three places that are settled here: the rows of a picture are counted from above and from
below, depth runs from 0 to 1 and from -1 to 1 (unless ``glClipControl`` says otherwise), and textures and samplers are
two things and one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from esker.wgsl.names import Used, safe, spell
from esker.wgsl.tree import Field, Function, Module, Struct, Variable, WgslError
from esker.wgsl.types import FORMATS, Texture, Type, type_of
from esker.wgsl.write import Writer

_BUILT_IN = {
    "vertex_index": "uint(gl_VertexID)",
    "instance_index": "uint(gl_InstanceID)",
    "front_facing": "gl_FrontFacing",
    "global_invocation_id": "gl_GlobalInvocationID",
    "local_invocation_id": "gl_LocalInvocationID",
    "local_invocation_index": "gl_LocalInvocationIndex",
    "workgroup_id": "gl_WorkGroupID",
    "num_workgroups": "gl_NumWorkGroups",
}
FRAME = "wgsl_frame"
"""Uniform vec2 of fragment shaders: the picture's first column, and the row from above of its lower edge."""


@dataclass
class Bindings:
    """Numbers of what a program binds, shared by its stages. Keys are the names of the WGSL variables."""

    uniforms: dict[str, int] = field(default_factory=dict)
    storage: dict[str, int] = field(default_factory=dict)
    images: dict[str, int] = field(default_factory=dict)
    samplers: dict[tuple[str, str], int] = field(default_factory=dict)
    """(texture, sampler or "") -> texture unit."""


@dataclass(frozen=True)
class Feed:
    """Where a vertex-like entry point takes its inputs from, when another stage runs it (tessellation)."""

    built_in: Mapping[str, str] = field(default_factory=dict)
    locations: Mapping[int, str] = field(default_factory=dict)
    head: str = ""
    """Declarations and layout qualifiers of the stage."""
    mix: str = ""
    """Statements that set ``uint at[3]`` and ``float share[3]``: the vertex lies between three others, whose outputs
    are mixed by these shares. ``built_in["vertex_index"]`` is then ``at[k]``."""


def translate(
    module: Module,
    entry: str,
    bindings: Bindings,
    *,
    constants: Mapping[str, float] | None = None,
    feed: Feed | None = None,
    half_depth: bool = True,
) -> str:
    """The GLSL shader of one entry point.

    ``constants``: values for ``override`` and ``const`` declarations. ``half_depth``: clip space has z from 0 to w, as
    after ``glClipControl``. Raises WgslError.
    """
    writer = Writer(module, constants)
    found = writer.function(entry)
    stages = [a.name for a in found.attributes if a.name in ("vertex", "fragment", "compute")]
    if not stages:
        raise WgslError(found.line, f"{entry} is no entry point")
    stage = _Stage(writer, found, stages[0], feed or Feed(), half_depth)
    interface, main = stage.interface()
    head = ["#version 430", *([feed.head] if feed else []), *stage.layout()]
    used = writer.used
    parts = [*head, *used.constants.values(), *used.structs.values(), *_resources(used, bindings), *interface]
    # GLSL wants functions before they are called: they were written in that order.
    return "\n".join((*parts, *used.functions.values(), main, ""))


def functions(module: Module, *names: str) -> str:
    """These functions of a module and all that they need, for shaders that are not translated. Raises WgslError for
    functions that read what a program binds."""
    writer = Writer(module)
    for name in names:
        if writer.function(name) and writer.used.variables:
            raise WgslError(0, f"{name} reads what a program binds")
    used = writer.used
    return "\n".join((*used.constants.values(), *used.structs.values(), *used.functions.values()))


def _resources(used: Used, bindings: Bindings) -> list[str]:
    lines = []
    for name, variable in used.variables.items():
        kind = type_of(variable.type, variable.line)
        if kind == "sampler":
            continue
        if isinstance(kind, Texture):
            if kind.format:
                unit = bindings.images.setdefault(name, len(bindings.images))
                shape = "image2DArray" if kind.array else "image2D"
                prefix = "u" if kind.scalar == "u32" else ""
                access = f"layout({FORMATS[kind.format]}, binding = {unit})"
                lines.append(f"{access} writeonly uniform {prefix}{shape} {safe(name)};")
            continue
        lines.append(_block(name, variable, kind, bindings))
    for (texture, sampler), name in used.samplers.items():
        variable = used.variables[texture]
        found = type_of(variable.type, variable.line)
        assert isinstance(found, Texture)
        unit = bindings.samplers.setdefault((texture, sampler), len(bindings.samplers))
        prefix = {"f32": "", "i32": "i", "u32": "u"}[found.scalar]
        lines.append(f"layout(binding = {unit}) uniform {prefix}sampler{'2DArray' if found.array else '2D'} {name};")
    return lines


def _block(name: str, variable: Variable, kind: Type, bindings: Bindings) -> str:
    own = spell(kind, safe(name))
    if variable.space == "uniform":
        unit = bindings.uniforms.setdefault(name, len(bindings.uniforms))
        return f"layout(std140, binding = {unit}) uniform block_{name} {{ {own}; }};"
    if variable.space == "storage":
        unit = bindings.storage.setdefault(name, len(bindings.storage))
        access = "readonly " if variable.access == "read" else ""
        return f"layout(std430, binding = {unit}) {access}buffer block_{name} {{ {own}; }};"
    if variable.space == "workgroup":
        return f"shared {own};"
    if variable.space == "private":
        return f"{own};"
    raise WgslError(variable.line, f"variables of the address space {variable.space!r} are outside the subset")


@dataclass
class _Stage:
    """Inputs and outputs of one entry point."""

    writer: Writer
    found: Function
    stage: str
    feed: Feed
    half_depth: bool

    def layout(self) -> list[str]:
        if self.stage == "compute":
            size = self.found.attribute("workgroup_size")
            sides = [*(size.args if size else ("1",)), "1", "1"][:3]
            return [
                "layout({}) in;".format(", ".join(f"local_size_{a} = {n}" for a, n in zip("xyz", sides, strict=True)))
            ]
        return [f"uniform vec2 {FRAME};"] if self.stage == "fragment" else []

    def interface(self) -> tuple[list[str], str]:
        """Declarations of inputs and outputs, and ``main``."""
        declared: list[str] = []
        before: list[str] = []
        args = []
        for p in self.found.parameters:
            kind = type_of(p.type, self.found.line)
            struct = self._struct(kind)
            if struct is None:
                args.append(self._input(p, kind, declared))
                continue
            name = f"in_{p.name}"
            made = self.writer.need_type(kind)
            fields = ", ".join(self._input(f, type_of(f.type, struct.line), declared) for f in struct.fields)
            before.append(f"  {made} {name} = {made}({fields});")
            args.append(name)
        call = f"{safe(self.found.name)}({', '.join(args)})"
        if self.feed.mix:
            before.append(f"  {self.feed.mix}")
        after = self._outputs(call, declared)
        return declared, "\n".join(("void main() {", *before, *after, "}"))

    def _struct(self, kind: Type) -> Struct | None:
        found = self.writer.module.declarations.get(kind) if isinstance(kind, str) else None
        return found if isinstance(found, Struct) else None

    def _input(self, f: Field, kind: Type, declared: list[str]) -> str:
        built_in, location = f.attribute("builtin"), f.attribute("location")
        if built_in is not None:
            name = built_in.args[0]
            if name == "position":
                return f"vec4(gl_FragCoord.x + {FRAME}.x, {FRAME}.y - gl_FragCoord.y, gl_FragCoord.zw)"
            if name in self.feed.built_in:
                return self.feed.built_in[name]
            if name in _BUILT_IN:
                return _BUILT_IN[name]
            raise WgslError(self.found.line, f"the built-in input {name} is outside the subset")
        if location is None:
            raise WgslError(self.found.line, f"the input {f.name} has neither location nor built-in")
        place = int(location.args[0])
        if self.stage == "vertex":
            if place in self.feed.locations:
                return self.feed.locations[place]
            declared.append(f"layout(location = {place}) in {self.writer.need_type(kind)} a_{place};")
            return f"a_{place}"
        declared.append(f"layout(location = {place}) {_flat(f)}in {self.writer.need_type(kind)} v_{place};")
        return f"v_{place}"

    def _outputs(self, call: str, declared: list[str]) -> list[str]:
        if self.found.result is None:
            return [f"  {call};"]
        kind = type_of(self.found.result, self.found.line)
        struct = self._struct(kind)
        if struct is None:
            result = Field("result", self.found.result, self.found.result_attributes)
            return self._output(result, kind, call, declared)
        made = self.writer.need_type(kind)
        lines = [f"  {made} made = {call};"]
        if self.feed.mix:
            fields = [safe(f.name) for f in struct.fields if not _flat(f)]
            mixed = " ".join(f"made.{f} = share[0] * a.{f} + share[1] * b.{f} + share[2] * c.{f};" for f in fields)
            calls = (f"{made} {name} = {call.replace('at[k]', f'at[{k}]')};" for k, name in enumerate("abc"))
            lines = [f"  {' '.join(calls)} {made} made = a;", f"  {mixed}"]
        for f in struct.fields:
            lines += self._output(f, type_of(f.type, struct.line), f"made.{safe(f.name)}", declared)
        return lines

    def _output(self, f: Field, kind: Type, text: str, declared: list[str]) -> list[str]:
        built_in, location = f.attribute("builtin"), f.attribute("location")
        if built_in is not None and built_in.args[0] == "position":
            fix = [] if self.half_depth else ["  gl_Position.z = 2.0 * gl_Position.z - gl_Position.w;"]
            return [f"  gl_Position = {text};", *fix]
        if location is None:
            raise WgslError(self.found.line, f"the output {f.name} is outside the subset")
        place = int(location.args[0])
        name = f"{'result' if self.stage == 'fragment' else 'v'}_{place}"
        flat = "" if self.stage == "fragment" else _flat(f)
        declared.append(f"layout(location = {place}) {flat}out {self.writer.need_type(kind)} {name};")
        return [f"  {name} = {text};"]


def _flat(f: Field) -> str:
    how = f.attribute("interpolate")
    if how is None:
        return ""
    if how.args[0] != "flat":
        raise WgslError(0, f"interpolation {how.args[0]} is outside the subset")
    return "flat "
