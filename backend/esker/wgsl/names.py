"""How names are spelled in GLSL, and what the functions written so far need of their module."""

from __future__ import annotations

from dataclasses import dataclass, field

from esker.wgsl.tree import Variable
from esker.wgsl.types import RESERVED, Array, Type, glsl_type, scalar_of


@dataclass
class Used:
    """What the functions written so far need of the module, in an order that GLSL accepts."""

    structs: dict[str, str] = field(default_factory=dict)
    constants: dict[str, str] = field(default_factory=dict)
    functions: dict[str, str] = field(default_factory=dict)
    variables: dict[str, Variable] = field(default_factory=dict)
    samplers: dict[tuple[str, str], str] = field(default_factory=dict)
    """(texture, sampler or "") -> name of the combined sampler."""


def safe(name: str) -> str:
    """The name in GLSL: names that GLSL keeps for itself get another spelling.

    >>> safe("ridge"), safe("sample"), safe("gl_x")
    ('ridge', 'sample_', 'wgsl_gl_x')
    """
    if name.startswith("gl_") or "__" in name:
        return f"wgsl_{name.replace('__', '_')}"
    return f"{name}_" if name in RESERVED else name


def spell(kind: Type, name: str) -> str:
    """``type name`` with the brackets of arrays where GLSL wants them."""
    if isinstance(kind, Array):
        return f"{spell(kind.element, name)}[{kind.length}]"
    return f"{safe(glsl_type(kind))} {name}" if not scalar_of(kind) else f"{glsl_type(kind)} {name}"
