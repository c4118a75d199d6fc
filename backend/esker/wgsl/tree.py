"""The syntax tree of the WGSL subset that Esker's shaders use; see ``wgsl.parse``. Names as in the specification."""

from __future__ import annotations

from dataclasses import dataclass


class WgslError(ValueError):
    """A shader is outside the subset; the message names the line and the construct."""

    def __init__(self, line: int, message: str) -> None:
        super().__init__(f"line {line}: {message}")
        self.line = line


@dataclass(frozen=True)
class TypeRef:
    """A type as written: ``vec3f``, ``array<vec4f, 8>``, ``Struct``. ``args``: types or, for lengths, expressions."""

    name: str
    args: tuple[TypeRef | Expr, ...] = ()


@dataclass(frozen=True)
class Attribute:
    """``@name(args)``; arguments as text."""

    name: str
    args: tuple[str, ...] = ()


# --- expressions ------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Literal:
    """A number or truth value; ``type`` is f32, i32, u32, bool, or "int" and "float" for numbers without a suffix."""

    text: str
    type: str
    line: int


@dataclass(frozen=True)
class Name:
    """A variable or constant."""

    name: str
    line: int


@dataclass(frozen=True)
class Unary:
    """``op operand``: one of - ! ~ &."""

    op: str
    operand: Expr
    line: int


@dataclass(frozen=True)
class Binary:
    """``left op right``."""

    op: str
    left: Expr
    right: Expr
    line: int


@dataclass(frozen=True)
class Call:
    """A function, built-in, conversion or constructor."""

    callee: TypeRef
    args: tuple[Expr, ...]
    line: int


@dataclass(frozen=True)
class Member:
    """``base.name``: a field or a swizzle."""

    base: Expr
    name: str
    line: int


@dataclass(frozen=True)
class Index:
    """``base[index]``."""

    base: Expr
    index: Expr
    line: int


Expr = Literal | Name | Unary | Binary | Call | Member | Index

# --- statements -------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Declare:
    """``let``, ``var`` or ``const`` in a function."""

    kind: str
    name: str
    type: TypeRef | None
    value: Expr | None
    line: int


@dataclass(frozen=True)
class Assign:
    """``target op value``; ``op`` is = or a compound one. ``i++`` is ``i += 1``; a target of None is ``_``."""

    target: Expr | None
    op: str
    value: Expr
    line: int


@dataclass(frozen=True)
class If:
    """``if``; ``otherwise`` is empty without an else."""

    condition: Expr
    then: Block
    otherwise: Block | None
    line: int


@dataclass(frozen=True)
class For:
    """``for (first; condition; step) body``; ``while`` has only a condition, ``loop`` nothing at all."""

    first: Statement | None
    condition: Expr | None
    step: Statement | None
    body: Block
    line: int


@dataclass(frozen=True)
class Case:
    """One clause of a switch; no selectors: ``default``."""

    selectors: tuple[Expr, ...]
    default: bool
    body: Block


@dataclass(frozen=True)
class Switch:
    """``switch``; cases never fall through."""

    value: Expr
    cases: tuple[Case, ...]
    line: int


@dataclass(frozen=True)
class Return:
    """``return value``."""

    value: Expr | None
    line: int


@dataclass(frozen=True)
class Jump:
    """``break``, ``continue`` or ``discard``."""

    word: str
    line: int


@dataclass(frozen=True)
class Evaluate:
    """A call for its effect."""

    call: Call
    line: int


@dataclass(frozen=True)
class Block:
    """``{ ... }``."""

    statements: tuple[Statement, ...]
    line: int


Statement = Declare | Assign | If | For | Switch | Return | Jump | Evaluate | Block

# --- the module -------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Field:
    """A member of a struct or a parameter of a function."""

    name: str
    type: TypeRef
    attributes: tuple[Attribute, ...]

    def attribute(self, name: str) -> Attribute | None:
        """The attribute of this name, if there is one."""
        return next((a for a in self.attributes if a.name == name), None)


@dataclass(frozen=True)
class Struct:
    """``struct``."""

    name: str
    fields: tuple[Field, ...]
    line: int


@dataclass(frozen=True)
class Constant:
    """``const`` or ``override`` of the module."""

    name: str
    type: TypeRef | None
    value: Expr | None
    override: bool
    line: int


@dataclass(frozen=True)
class Variable:
    """``var<space, access>`` of the module, textures and samplers too (space "")."""

    name: str
    space: str
    access: str
    type: TypeRef
    attributes: tuple[Attribute, ...]
    line: int


@dataclass(frozen=True)
class Function:
    """``fn``, entry points too. ``result`` is None where nothing is returned."""

    name: str
    parameters: tuple[Field, ...]
    result: TypeRef | None
    result_attributes: tuple[Attribute, ...]
    attributes: tuple[Attribute, ...]
    body: Block
    line: int

    def attribute(self, name: str) -> Attribute | None:
        """The attribute of this name, if there is one."""
        return next((a for a in self.attributes if a.name == name), None)


Declaration = Struct | Constant | Variable | Function


@dataclass(frozen=True)
class Module:
    """A parsed module: declarations by name, in the order of the text."""

    declarations: dict[str, Declaration]
