"""Calls: functions of the module, constructors, conversions and WGSL's built-in functions in GLSL."""

from __future__ import annotations

from typing import Protocol

from esker.wgsl.names import Used, safe
from esker.wgsl.tree import Call, Expr, Function, Module, Name, Struct, TypeRef, Unary, WgslError
from esker.wgsl.types import (
    BITCAST,
    FIXED,
    FLOAT_ONLY,
    SAME,
    Array,
    Texture,
    Type,
    abstract,
    common,
    glsl_type,
    scalar_of,
    type_of,
    vector,
    width,
)

_ATOMIC = ("atomicAdd", "atomicMin", "atomicMax", "atomicOr", "atomicAnd")
_SCALAR_NAMES = ("f32", "i32", "u32", "bool")


class Expressions(Protocol):
    """What calls need of the writer of the functions around them."""

    module: Module
    used: Used

    def expression(self, e: Expr) -> tuple[str, Type]:
        """Text and type of an expression."""

    def value(self, e: Expr, wanted: Type) -> str:
        """Text of an expression as a value of the wanted type."""

    def need_type(self, kind: Type, line: int = 0) -> str:
        """The type's name in GLSL, after its definition has been written."""

    def function(self, name: str, line: int = 0) -> Function:
        """The module's function of that name, after it has been written."""


class Calls:
    """Writes calls for a writer of functions. A call has values, and values are the writer's."""

    def __init__(self, writer: Expressions) -> None:
        self._in = writer

    def text(self, e: Call) -> tuple[str, Type]:
        """Text and type of a call. Raises WgslError for functions that the subset lacks."""
        name = e.callee.name
        found = self._in.module.declarations.get(name)
        if isinstance(found, Function):
            return self._own(e)
        if isinstance(found, Struct):
            kinds = [type_of(f.type, found.line) for f in found.fields]
            made = self._in.need_type(name, e.line)
            if not e.args:
                raise WgslError(e.line, f"{name}() without values is outside the subset")
            return f"{made}({', '.join(self._in.value(a, k) for a, k in zip(e.args, kinds, strict=True))})", name
        if name.startswith("texture"):
            return self._texture(e)
        if name == "bitcast":
            return self._bitcast(e)
        if name == "array" or name in _SCALAR_NAMES or name.startswith(("vec", "mat")):
            return self._construct(e)
        return self._built_in(e)

    def _own(self, e: Call) -> tuple[str, Type]:
        found = self._in.function(e.callee.name, e.line)
        if len(found.parameters) != len(e.args):
            raise WgslError(e.line, f"{found.name} takes {len(found.parameters)} values, not {len(e.args)}")
        kinds = [type_of(p.type, found.line) for p in found.parameters]
        args = ", ".join(self._in.value(a, k) for a, k in zip(e.args, kinds, strict=True))
        return f"{safe(found.name)}({args})", type_of(found.result, found.line) if found.result else "void"

    def _construct(self, e: Call) -> tuple[str, Type]:
        parts = [self._in.expression(a) for a in e.args]
        kind = self._constructed(e.callee, [k for _, k in parts], e.line)
        if isinstance(kind, Array):
            return (
                f"{self._in.need_type(kind, e.line)}({', '.join(self._in.value(a, kind.element) for a in e.args)})",
                kind,
            )
        text = ", ".join(t for t, _ in parts) or ("false" if scalar_of(kind) == "bool" else "0")
        return f"{glsl_type(kind)}({text})", kind

    def _constructed(self, callee: TypeRef, kinds: list[Type], line: int) -> Type:
        name = callee.name
        if name == "array" and not callee.args:
            if not kinds:
                raise WgslError(line, "array() without type and values is outside the subset")
            scalar = common(kinds) if width(kinds[0]) == 1 else ""
            return Array({"int": "i32", "float": "f32"}.get(scalar, scalar) or kinds[0], str(len(kinds)))
        if name in ("vec2", "vec3", "vec4") and not callee.args:
            return vector(int(name[3]), common(kinds) if kinds else "i32")
        if name.startswith("mat") and not callee.args and not name.endswith("f"):
            return f"{name}f"
        return type_of(callee, line)

    def _bitcast(self, e: Call) -> tuple[str, Type]:
        ref = e.callee.args[0] if e.callee.args else None
        if not isinstance(ref, TypeRef) or len(e.args) != 1:
            raise WgslError(e.line, "bitcast needs a type and one value")
        kind = type_of(ref, e.line)
        text, had = self._in.expression(e.args[0])
        pair = (scalar_of(had), scalar_of(kind))
        if pair[0] == pair[1]:
            return text, kind
        if pair not in BITCAST:
            raise WgslError(e.line, f"bitcast from {had} to {kind} is outside the subset")
        name = glsl_type(kind) if BITCAST[pair] in ("int", "uint") else BITCAST[pair]
        return f"{name}({text})", kind

    def _built_in(self, e: Call) -> tuple[str, Type]:
        name, line = e.callee.name, e.line
        if name == "arrayLength":
            base = e.args[0]
            text = self._in.expression(base.operand if isinstance(base, Unary) and base.op == "&" else base)[0]
            return f"uint({text}.length())", "u32"
        if name == "workgroupBarrier":
            return "barrier()", "void"
        if name == "storageBarrier":
            return "memoryBarrierBuffer()", "void"
        if name in _ATOMIC:
            return self._atomic(e)
        kinds = [self._in.expression(a)[1] for a in e.args]
        scalar = common(kinds[:2] if name == "select" else kinds) if kinds else ""
        if name in FLOAT_ONLY and abstract(scalar):
            scalar = "f32"
        args = [
            self._in.value(a, scalar) if abstract(k) else self._in.value(a, k)
            for a, k in zip(e.args, kinds, strict=True)
        ]
        kind = self._widest(kinds[:2] if name == "select" else kinds, scalar)
        if name == "select":
            if width(kinds[2]) > 1:
                return f"mix({args[0]}, {args[1]}, {args[2]})", kind
            return f"({args[2]} ? {args[1]} : {args[0]})", kind
        if name in ("dpdy", "dpdyFine", "dpdyCoarse"):
            return f"(-dFdy{name[4:]}({args[0]}))", kind  # GLSL's rows go up, WGSL's down
        if name == "saturate":
            return f"clamp({args[0]}, 0.0, 1.0)", kind
        if name == "dot":
            if scalar in ("f32", "float"):
                return f"dot({args[0]}, {args[1]})", "f32"
            raise WgslError(line, "dot of integers is outside the subset")
        if name in FIXED:
            return f"{FIXED[name][0]}({', '.join(args)})", FIXED[name][1]
        if name in SAME:
            return f"{SAME[name]}({', '.join(args)})", kind
        raise WgslError(line, f"the function {name!r} is outside the subset")

    def _atomic(self, e: Call) -> tuple[str, Type]:
        """An operation on one integer of a buffer, which gives what stood there before."""
        place = e.args[0]
        if not isinstance(place, Unary) or place.op != "&" or len(e.args) != 2:
            raise WgslError(e.line, f"{e.callee.name} takes a pointer and one value")
        text, kind = self._in.expression(place.operand)
        return f"{e.callee.name}({text}, {self._in.value(e.args[1], kind)})", kind

    def _widest(self, kinds: list[Type], scalar: str) -> Type:
        wide = max((k for k in kinds), key=width, default="void")
        if not kinds or not width(wide):
            return kinds[0] if kinds else "void"
        return scalar if width(wide) == 1 else vector(width(wide), scalar)

    # --- textures

    def _sampler(self, texture: Expr, sampler: Expr | None) -> tuple[str, Texture]:
        """Name of the combined sampler of a texture and a sampler, both variables of the module."""
        _, kind = self._in.expression(texture)
        if not isinstance(texture, Name) or not isinstance(kind, Texture):
            raise WgslError(texture.line, "a texture of the module was expected")
        with_sampler = ""
        if sampler is not None:
            if not isinstance(sampler, Name) or self._in.expression(sampler)[1] != "sampler":
                raise WgslError(texture.line, "a sampler of the module was expected")
            with_sampler = sampler.name
        name = f"tex_{texture.name}" + (f"_{with_sampler}" if with_sampler else "")
        self._in.used.samplers[texture.name, with_sampler] = name
        return name, kind

    def _texture(self, e: Call) -> tuple[str, Type]:
        name, args = e.callee.name, list(e.args)
        if name in ("textureSample", "textureSampleLevel", "textureSampleGrad", "textureSampleBias"):
            tex, kind = self._sampler(args[0], args[1])
            rest = args[2:]
            at = self._in.value(rest.pop(0), "vec2f")
            if kind.array:
                at = f"vec3({at}, float({self._in.expression(rest.pop(0))[0]}))"
            more = "".join(f", {self._in.value(a, 'f32')}" for a in rest)
            to = {"textureSampleLevel": "textureLod", "textureSampleGrad": "textureGrad"}.get(name, "texture")
            return f"{to}({tex}, {at}{more})", vector(4, kind.scalar)
        if name == "textureLoad":
            tex, kind = self._sampler(args[0], None)
            if kind.format:
                raise WgslError(e.line, "reading a storage texture is outside the subset")
            at, rest = self._texel(args[1:], kind)
            level = self._in.expression(rest[0])[0] if rest else "0"
            return f"texelFetch({tex}, {at}, int({level}))", vector(4, kind.scalar)
        if name == "textureStore":
            text, stored = self._in.expression(args[0])
            if not isinstance(stored, Texture) or not stored.format:
                raise WgslError(e.line, "a storage texture was expected")
            at, rest = self._texel(args[1:], stored)
            return f"imageStore({text}, {at}, {self._in.value(rest[0], vector(4, stored.scalar))})", "void"
        if name in ("textureDimensions", "textureNumLayers"):
            text, found = self._in.expression(args[0])
            if isinstance(found, Texture) and found.format:
                size = f"imageSize({text})"
            else:
                tex, _ = self._sampler(args[0], None)
                size = f"textureSize({tex}, {self._in.value(args[1], 'i32') if len(args) > 1 else '0'})"
            return (f"uvec2({size}.xy)", "vec2u") if name == "textureDimensions" else (f"uint({size}.z)", "u32")
        raise WgslError(e.line, f"the function {name!r} is outside the subset")

    def _texel(self, args: list[Expr], kind: Texture) -> tuple[str, list[Expr]]:
        at = f"ivec2({self._in.expression(args[0])[0]})"
        if not kind.array:
            return at, args[1:]
        return f"ivec3({at}, int({self._in.expression(args[1])[0]}))", args[2:]
