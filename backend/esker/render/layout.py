"""Host structs from the shaders' own text: where the fields of a WGSL struct lie (WGSL, section 14.4.1)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from esker.wgsl.tree import Constant, Literal, Module, Struct, WgslError
from esker.wgsl.types import Array, Type, scalar_of, type_of

_SIZES: Final = {"vec2": (8, 8), "vec3": (12, 16), "vec4": (16, 16), "mat4x4": (64, 16)}


class StructLayout:
    """Size in bytes and the offset of each field of ``struct name``. Raises WgslError for types that no host writes."""

    def __init__(self, module: Module, name: str) -> None:
        found = module.declarations.get(name)
        if not isinstance(found, Struct):
            raise WgslError(0, f"there is no struct {name}")
        self._module = module
        self.offsets: dict[str, int] = {}
        self._kinds: dict[str, Type] = {}
        at, self.align = 0, 4
        for field in found.fields:
            kind = type_of(field.type, found.line)
            size, align = self._measure(kind, found.line)
            at = -(-at // align) * align
            self.offsets[field.name] = at
            self._kinds[field.name] = kind
            self.align = max(self.align, align)
            at += size
        self.end = at
        self.size = -(-at // 16) * 16

    def pack(self, values: Mapping[str, ArrayLike]) -> bytes:
        """The struct with these fields, zero elsewhere. Raises KeyError for a field that it lacks."""
        out = bytearray(self.size)
        for name, value in values.items():
            kind = self._kinds[name]
            scalar = scalar_of(kind.element if isinstance(kind, Array) else kind)
            data = np.asarray(value, dtype={"f32": "<f4", "i32": "<i4", "u32": "<u4"}[scalar]).tobytes()
            at = self.offsets[name]
            out[at : at + len(data)] = data
        if len(out) != self.size:
            raise ValueError("a value is larger than its field")
        return bytes(out)

    def _measure(self, kind: Type, line: int) -> tuple[int, int]:
        if isinstance(kind, Array):
            size, align = self._measure(kind.element, line)
            return -(-size // align) * align * self._count(kind.length, line), align
        if kind in ("f32", "i32", "u32"):
            return 4, 4
        found = self._module.declarations.get(kind) if isinstance(kind, str) else None
        if isinstance(found, Struct):
            inner = StructLayout(self._module, found.name)
            return -(-inner.end // inner.align) * inner.align, inner.align
        sizes = _SIZES.get(kind[:-1]) if isinstance(kind, str) else None
        if sizes is None:
            raise WgslError(line, f"hosts do not write fields of the type {kind}")
        return sizes

    def _count(self, length: str, line: int) -> int:
        found = self._module.declarations.get(length)
        if isinstance(found, Constant) and isinstance(found.value, Literal):
            return int(found.value.text)
        if not length.isdigit():
            raise WgslError(line, f"the length {length} is no number")
        return int(length)
