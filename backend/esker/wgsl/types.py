"""Types of the WGSL subset, their GLSL names, and what built-in functions return (WGSL specification, section 17)."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from esker.wgsl.tree import Expr, Literal, Name, TypeRef, WgslError

LETTERS: Final = {"f": "f32", "i": "i32", "u": "u32", "b": "bool"}
LETTER_OF: Final = {scalar: letter for letter, scalar in LETTERS.items()}
SCALARS: Final = {"f32": "float", "i32": "int", "u32": "uint", "bool": "bool"}
_VECTOR_PREFIX: Final = {"f": "", "i": "i", "u": "u", "b": "b"}
_VECTOR: Final = re.compile(r"vec([234])([fiub])")
_MATRIX: Final = re.compile(r"mat([234])x([234])f")

# Formats of storage textures: layout qualifier of GLSL.
FORMATS: Final = {
    "rgba16float": "rgba16f",
    "rgba32float": "rgba32f",
    "r32float": "r32f",
    "rg32float": "rg32f",
    "rgba8unorm": "rgba8",
    "r32uint": "r32ui",
}


@dataclass(frozen=True)
class Array:
    """``array<element, length>``; the length is text of a constant, "" for an array sized at run time."""

    element: Type
    length: str


@dataclass(frozen=True)
class Texture:
    """A texture. ``dimension`` is 2d or 2d_array; ``scalar`` what its texels hold; ``format`` only for storage."""

    dimension: str
    scalar: str
    format: str = ""

    @property
    def array(self) -> bool:
        """True for layers."""
        return self.dimension == "2d_array"


Type = str | Array | Texture
"""f32, i32, u32, bool; "int" and "float" for numbers without a suffix; vec3f ..., mat4x4f; the name of a struct;
sampler; void; or one of the classes above."""


def type_of(ref: TypeRef, line: int = 0) -> Type:
    """The type that is meant. Raises WgslError for types outside the subset."""
    name = ref.name
    if name == "array":
        if not ref.args or not isinstance(ref.args[0], TypeRef):
            raise WgslError(line, "an array without the type of its elements is outside the subset")
        return Array(type_of(ref.args[0], line), _length(ref.args[1]) if len(ref.args) > 1 else "")
    if name.startswith("texture_"):
        return _texture(ref, line)
    if ref.args:
        inner = ref.args[0]
        scalar = LETTER_OF.get(inner.name) if isinstance(inner, TypeRef) else None
        if scalar is None or not (re.fullmatch(r"vec[234]", name) or re.fullmatch(r"mat[234]x[234]", name)):
            raise WgslError(line, f"the type {name}<...> is outside the subset")
        return f"{name}{scalar}"
    if name.startswith("sampler_"):
        raise WgslError(line, f"{name} is outside the subset")
    return name


def _length(value: TypeRef | Expr) -> str:
    if isinstance(value, Literal):
        return value.text
    if isinstance(value, (TypeRef, Name)):
        return value.name
    raise WgslError(0, "the length of an array is a number or a constant in this subset")


def _texture(ref: TypeRef, line: int) -> Texture:
    names = [arg.name for arg in ref.args if isinstance(arg, TypeRef)]
    match = re.fullmatch(r"texture_(storage_)?(2d|2d_array)", ref.name)
    if match is None or not names:
        raise WgslError(line, f"{ref.name} is outside the subset")
    if match.group(1):
        if names[0] not in FORMATS:
            raise WgslError(line, f"storage format {names[0]} is outside the subset")
        return Texture(match.group(2), "u32" if names[0].endswith("uint") else "f32", names[0])
    return Texture(match.group(2), names[0])


def glsl_type(kind: Type) -> str:
    """The name of a type that variables may have; for arrays that of ``element[length]``."""
    if isinstance(kind, Array):
        return f"{glsl_type(kind.element)}[{kind.length}]"
    assert isinstance(kind, str), "textures are no values"
    kind = {"int": "i32", "float": "f32"}.get(kind, kind)
    if kind in SCALARS:
        return SCALARS[kind]
    if match := _VECTOR.fullmatch(kind):
        return f"{_VECTOR_PREFIX[match.group(2)]}vec{match.group(1)}"
    if match := _MATRIX.fullmatch(kind):
        return f"mat{match.group(1)}" if match.group(1) == match.group(2) else kind[:-1]
    return kind


def abstract(kind: Type) -> bool:
    """True for numbers without a suffix, which take the type of what they meet."""
    return kind in ("int", "float")


def scalar_of(kind: Type) -> str:
    """f32, i32, u32, bool, "int" or "float": of one component. "" for what has none."""
    if not isinstance(kind, str):
        return ""
    if kind in SCALARS or abstract(kind):
        return kind
    if match := _VECTOR.fullmatch(kind):
        return LETTERS[match.group(2)]
    return "f32" if _MATRIX.fullmatch(kind) else ""


def width(kind: Type) -> int:
    """Components of a vector, 1 for a scalar, 0 for all else."""
    if not isinstance(kind, str):
        return 0
    if match := _VECTOR.fullmatch(kind):
        return int(match.group(1))
    return 1 if kind in SCALARS or abstract(kind) else 0


def vector(count: int, scalar: str) -> str:
    """``vec{count}`` of a scalar type; the scalar itself for 1."""
    scalar = {"int": "i32", "float": "f32"}.get(scalar, scalar)
    return scalar if count == 1 else f"vec{count}{LETTER_OF[scalar]}"


def common(kinds: Sequence[Type]) -> str:
    """The scalar type that numbers take when they meet: that of the first with a suffix, else float before int."""
    scalars = [scalar_of(kind) for kind in kinds]
    fixed = [s for s in scalars if s and not abstract(s)]
    return fixed[0] if fixed else ("float" if "float" in scalars else "int")


def product(left: Type, right: Type, line: int) -> Type:
    """Type of an arithmetic operation, matrix products among them."""
    a = _MATRIX.fullmatch(left) if isinstance(left, str) else None
    b = _MATRIX.fullmatch(right) if isinstance(right, str) else None
    if a and b:
        return f"mat{b.group(1)}x{a.group(2)}f" if a.group(1) != b.group(1) else left
    if a:
        return vector(int(a.group(2)), "f32") if width(right) > 1 else left
    if b:
        return vector(int(b.group(1)), "f32") if width(left) > 1 else right
    wide = max(width(left), width(right))
    if not wide:
        raise WgslError(line, f"{left} and {right} cannot be calculated with")
    scalar = common((left, right))
    return scalar if wide == 1 else vector(wide, scalar)


# WGSL name -> GLSL name of built-in functions whose result has the type of their first concrete argument.
SAME: Final = {
    **{name: name for name in (
        "abs", "acos", "acosh", "asin", "asinh", "atan", "atanh", "ceil", "clamp", "cos", "cosh", "cross", "degrees",
        "exp", "exp2", "floor", "fma", "fract", "log", "log2", "max", "min", "mix", "normalize", "pow", "radians",
        "reflect", "refract", "sign", "sin", "sinh", "smoothstep", "sqrt", "step", "tan", "tanh", "trunc", "transpose",
        "fwidth",
    )},
    "atan2": "atan",
    "inverseSqrt": "inversesqrt",
    "round": "roundEven",
    "dpdx": "dFdx",
    "dpdxFine": "dFdxFine",
    "dpdxCoarse": "dFdxCoarse",
    "countOneBits": "bitCount",
    "extractBits": "bitfieldExtract",
    "insertBits": "bitfieldInsert",
    "faceForward": "faceforward",
}  # fmt: skip
FLOAT_ONLY: Final = frozenset(SAME) - {
    "abs",
    "clamp",
    "max",
    "min",
    "sign",
    "countOneBits",
    "extractBits",
    "insertBits",
}
# Functions with a result of their own type.
FIXED: Final = {
    "all": ("all", "bool"),
    "any": ("any", "bool"),
    "determinant": ("determinant", "f32"),
    "distance": ("distance", "f32"),
    "length": ("length", "f32"),
    "unpack4x8unorm": ("unpackUnorm4x8", "vec4f"),
    "unpack4x8snorm": ("unpackSnorm4x8", "vec4f"),
    "unpack2x16unorm": ("unpackUnorm2x16", "vec2f"),
    "unpack2x16float": ("unpackHalf2x16", "vec2f"),
    "pack4x8unorm": ("packUnorm4x8", "u32"),
    "pack2x16unorm": ("packUnorm2x16", "u32"),
    "pack2x16float": ("packHalf2x16", "u32"),
}
# bitcast<to>(from)
BITCAST: Final = {
    ("f32", "i32"): "floatBitsToInt",
    ("f32", "u32"): "floatBitsToUint",
    ("i32", "f32"): "intBitsToFloat",
    ("u32", "f32"): "uintBitsToFloat",
    ("i32", "u32"): "uint",
    ("u32", "i32"): "int",
}
COMPARISONS: Final = {
    "<": "lessThan", "<=": "lessThanEqual", ">": "greaterThan", ">=": "greaterThanEqual", "==": "equal",
    "!=": "notEqual",
}  # fmt: skip

# Words that GLSL keeps for itself and names of its functions: variables of that name get a trailing underscore.
RESERVED: Final = frozenset(re.findall(r"\w+", """
    attribute const uniform varying buffer shared coherent volatile restrict readonly writeonly atomic_uint layout
    centroid flat smooth noperspective patch sample break continue do for while switch case default if else subroutine
    in out inout float double int void bool true false invariant precise discard return mat2 mat3 mat4 dmat2 dmat3
    dmat4 vec2 vec3 vec4 ivec2 ivec3 ivec4 bvec2 bvec3 bvec4 dvec2 dvec3 dvec4 uint uvec2 uvec3 uvec4 lowp mediump
    highp precision struct common partition active asm class union enum typedef template this resource goto inline
    noinline public static extern external interface long short half fixed unsigned superp input output hvec2 hvec3
    hvec4 fvec2 fvec3 fvec4 filter sizeof cast namespace using image2D image2DArray sampler2D sampler2DArray texture
    textureSize texelFetch noise1 noise2 noise3 noise4 main length distance dot cross normalize reflect refract
    radians degrees sin cos tan asin acos atan sinh cosh tanh asinh acosh atanh pow exp log exp2 log2 sqrt inversesqrt
    abs sign floor trunc round roundEven ceil fract mod modf min max clamp mix step smoothstep isnan isinf fma frexp
    ldexp outerProduct transpose determinant inverse lessThan lessThanEqual greaterThan greaterThanEqual equal notEqual
    any all not barrier dFdx dFdy fwidth faceforward ftransform
    """))  # fmt: skip
