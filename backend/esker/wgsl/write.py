"""Functions, structs and constants of a WGSL tree as GLSL 4.30 (what ``stage`` puts together to shaders).

WGSL leaves out the types of most variables and GLSL wants them all, so every expression is typed on its way.
"""

from __future__ import annotations

from collections.abc import Mapping

from esker.wgsl.calls import Calls
from esker.wgsl.names import Used, safe, spell
from esker.wgsl.tree import (
    Assign,
    Binary,
    Block,
    Constant,
    Declare,
    Evaluate,
    Expr,
    For,
    Function,
    If,
    Index,
    Jump,
    Literal,
    Member,
    Module,
    Name,
    Return,
    Statement,
    Struct,
    Switch,
    Unary,
    Variable,
    WgslError,
)
from esker.wgsl.types import (
    COMPARISONS,
    SCALARS,
    Array,
    Texture,
    Type,
    abstract,
    common,
    glsl_type,
    product,
    scalar_of,
    type_of,
    vector,
    width,
)


class Writer:
    """Writes what an entry point reaches. ``constants``: other values for constants of the module."""

    def __init__(self, module: Module, constants: Mapping[str, float] | None = None) -> None:
        self.module = module
        self.used = Used()
        self._calls = Calls(self)
        self._overrides = dict(constants or {})
        self._scopes: list[dict[str, Type]] = []
        self._result: Type = "void"
        unknown = [n for n in self._overrides if not isinstance(module.declarations.get(n), Constant)]
        if unknown:
            raise WgslError(0, f"there is no constant {unknown[0]}")
        self._constant_types: dict[str, Type] = {}

    # --- the module

    def need_type(self, kind: Type, line: int = 0) -> str:
        """The type's name in GLSL; a struct and an array's length are written first."""
        if isinstance(kind, Array):
            self.need_type(kind.element, line)
            if kind.length and not kind.length.isdigit():
                self.constant(kind.length, line)
        elif isinstance(kind, str) and not scalar_of(kind) and kind not in ("void", "sampler"):
            self._struct(kind, line)
        return safe(kind) if isinstance(kind, str) and kind in self.used.structs else glsl_type(kind)

    def declare(self, kind: Type, name: str, line: int = 0) -> str:
        """``spell``, after all that the type needs has been written."""
        self.need_type(kind, line)
        return spell(kind, name)

    def _struct(self, name: str, line: int) -> None:
        if name in self.used.structs:
            return
        found = self.module.declarations.get(name)
        if not isinstance(found, Struct):
            raise WgslError(line, f"the type {name!r} is not known")
        fields = [f"  {self.declare(type_of(f.type, found.line), safe(f.name), found.line)};" for f in found.fields]
        self.used.structs[name] = "\n".join((f"struct {safe(name)} {{", *fields, "};"))

    def constant(self, name: str, line: int) -> Type:
        """Type of a constant of the module, which is written where it was not yet."""
        if name in self._constant_types:
            return self._constant_types[name]
        found = self.module.declarations.get(name)
        if not isinstance(found, Constant):
            raise WgslError(line, f"{name!r} is not known")
        if found.value is None and name not in self._overrides:
            raise WgslError(found.line, f"the override {name} has no value")
        text, kind = self.expression(found.value) if found.value is not None else ("0", "f32")
        if found.type is not None:
            wanted = type_of(found.type, found.line)
            text, kind = self._coerce(text, kind, wanted, found.value), wanted
        if name in self._overrides:
            text = f"{glsl_type(kind)}({self._overrides[name]!r})"
        self._constant_types[name] = kind
        self.used.constants[name] = f"const {self.declare(kind, safe(name), found.line)} = {text};"
        return kind

    def function(self, name: str, line: int = 0) -> Function:
        """A function of the module, written with all that it calls. Recursion is not allowed in either language."""
        found = self.module.declarations.get(name)
        if not isinstance(found, Function):
            raise WgslError(line, f"there is no function {name!r}")
        if name not in self.used.functions:
            outer = (self._scopes, self._result)
            self._result = type_of(found.result, found.line) if found.result else "void"
            self._scopes = [{p.name: type_of(p.type, found.line) for p in found.parameters}]
            for kind in self._scopes[0].values():
                if isinstance(kind, Texture) or kind == "sampler":
                    raise WgslError(found.line, f"{name} takes a texture or sampler: outside the subset")
            takes = ", ".join(self.declare(kind, safe(p), found.line) for p, kind in self._scopes[0].items())
            head = f"{self.need_type(self._result, found.line)} {safe(name)}({takes})"
            body = self.block(found.body, "")
            self.used.functions[name] = f"{head} {body}"
            self._scopes, self._result = outer
        return found

    # --- statements

    def block(self, block: Block, indent: str) -> str:
        """``{ ... }`` in a scope of its own."""
        self._scopes.append({})
        lines = [self.statement(s, indent + "  ") for s in block.statements]
        self._scopes.pop()
        return "\n".join(("{", *lines, f"{indent}}}"))

    def statement(self, s: Statement, indent: str) -> str:
        """One statement with its indentation."""
        return indent + self._statement(s, indent)

    def _statement(self, s: Statement, indent: str) -> str:
        if isinstance(s, Block):
            return self.block(s, indent)
        if isinstance(s, If):
            otherwise = "" if s.otherwise is None else f" else {self.block(s.otherwise, indent)}"
            return f"if ({self.expression(s.condition)[0]}) {self.block(s.then, indent)}{otherwise}"
        if isinstance(s, For):
            return self._for(s, indent)
        if isinstance(s, Switch):
            return self._switch(s, indent)
        return f"{self._simple(s)};"

    def _simple(self, s: Statement) -> str:
        if isinstance(s, Declare):
            return self._declare(s)
        if isinstance(s, Assign):
            return self._assign(s)
        if isinstance(s, Return):
            if s.value is None:
                return "return"
            return f"return {self.value(s.value, self._result)}"
        if isinstance(s, Jump):
            return s.word
        if isinstance(s, Evaluate):
            return self.expression(s.call)[0]
        raise WgslError(getattr(s, "line", 0), "this statement cannot stand here")

    def _for(self, s: For, indent: str) -> str:
        self._scopes.append({})
        first = self._simple(s.first) if s.first else ""
        condition = self.expression(s.condition)[0] if s.condition else ""
        step = self._simple(s.step) if s.step else ""
        body = self.block(s.body, indent)
        self._scopes.pop()
        return f"for ({first}; {condition}; {step}) {body}"

    def _switch(self, s: Switch, indent: str) -> str:
        text, kind = self.expression(s.value)
        lines = [f"switch ({text}) {{"]
        for case in s.cases:
            labels = [f"case {self.value(v, kind)}:" for v in case.selectors] + ["default:"] * case.default
            lines.append(f"{indent}  {' '.join(labels)} {self.block(case.body, indent + '  ')} break;")
        return "\n".join((*lines, f"{indent}}}"))

    def _declare(self, s: Declare) -> str:
        kind: Type
        if s.value is None:
            if s.type is None:
                raise WgslError(s.line, f"{s.name} has neither type nor value")
            kind, text = type_of(s.type, s.line), self._zero(type_of(s.type, s.line), s.line)
        else:
            text, kind = self.expression(s.value)
            wanted = type_of(s.type, s.line) if s.type else kind
            if abstract(wanted) and s.kind != "const":
                wanted = "f32" if wanted == "float" else "i32"
            text, kind = self._coerce(text, kind, wanted, s.value), wanted
        declared = self.declare(kind, safe(s.name), s.line)
        self._scopes[-1][s.name] = kind
        return f"{'const ' * (s.kind == 'const')}{declared} = {text}"

    def _zero(self, kind: Type, line: int) -> str:
        """WGSL's variables start as zero, GLSL's as anything."""
        if isinstance(kind, Array):
            if not kind.length.isdigit():
                raise WgslError(line, "an array variable needs its length as a number, or a value")
            each = self._zero(kind.element, line)
            return f"{self.need_type(kind, line)}({', '.join([each] * int(kind.length))})"
        found = self.module.declarations.get(kind) if isinstance(kind, str) else None
        if isinstance(found, Struct):
            parts = (self._zero(type_of(f.type, line), line) for f in found.fields)
            return f"{self.need_type(kind, line)}({', '.join(parts)})"
        return f"{self.need_type(kind, line)}({'false' if scalar_of(kind) == 'bool' else '0'})"

    def _assign(self, s: Assign) -> str:
        if s.target is None:
            return self.expression(s.value)[0]
        target, kind = self.expression(s.target)
        if s.op in ("<<=", ">>="):
            return f"{target} {s.op} {self.expression(s.value)[0]}"
        if s.op == "%=":
            return f"{target} = {self._binary(Binary('%', s.target, s.value, s.line))[0]}"
        if s.op == "=":
            return f"{target} = {self.value(s.value, kind)}"
        text, right = self.expression(s.value)
        return f"{target} {s.op} {self._coerce(text, right, scalar_of(kind) or kind, s.value)}"

    # --- expressions

    def value(self, e: Expr, wanted: Type) -> str:
        """An expression where a value of this type is wanted."""
        text, kind = self.expression(e)
        return self._coerce(text, kind, wanted, e)

    def _coerce(self, text: str, kind: Type, wanted: Type, e: Expr | None) -> str:
        """Numbers without a suffix in the type that is wanted."""
        scalar = scalar_of(wanted)
        if not abstract(kind) or scalar in ("", kind):
            return text
        if isinstance(e, Literal):
            if scalar in ("f32", "float"):
                return text if kind == "float" else f"{text}.0"
            return f"{text}u" if scalar == "u32" else text
        if scalar == "float":
            return f"float({text})"
        return f"{SCALARS[scalar]}({text})" if scalar in SCALARS else text

    def expression(self, e: Expr) -> tuple[str, Type]:
        """Text and type."""
        if isinstance(e, Literal):
            return (f"{e.text}u" if e.type == "u32" else _plain(e)), e.type
        if isinstance(e, Name):
            return self._name(e)
        if isinstance(e, Unary):
            text, kind = self.expression(e.operand)
            if e.op == "&":
                raise WgslError(e.line, "pointers are outside the subset")
            return (f"not({text})" if e.op == "!" and width(kind) > 1 else f"({e.op}{text})"), kind
        if isinstance(e, Binary):
            return self._binary(e)
        if isinstance(e, Member):
            return self._member(e)
        if isinstance(e, Index):
            text, kind = self.expression(e.base)
            index = self.expression(e.index)[0]
            return f"{text}[{index}]", self._element(kind, e.line)
        return self._calls.text(e)

    def _name(self, e: Name) -> tuple[str, Type]:
        for scope in reversed(self._scopes):
            if e.name in scope:
                return safe(e.name), scope[e.name]
        found = self.module.declarations.get(e.name)
        if isinstance(found, Variable):
            self.used.variables[e.name] = found
            kind = type_of(found.type, found.line)
            if not isinstance(kind, Texture) and kind != "sampler":
                self.need_type(kind, found.line)
            return safe(e.name), kind
        kind = self.constant(e.name, e.line)
        return safe(e.name), kind

    def _element(self, kind: Type, line: int) -> Type:
        if isinstance(kind, Array):
            return kind.element
        if isinstance(kind, str) and kind.startswith("mat"):
            return vector(int(kind[5]), "f32")
        if width(kind) > 1:
            return scalar_of(kind)
        raise WgslError(line, f"{kind} has no elements")

    def _member(self, e: Member) -> tuple[str, Type]:
        text, kind = self.expression(e.base)
        found = self.module.declarations.get(kind) if isinstance(kind, str) else None
        if isinstance(found, Struct):
            for f in found.fields:
                if f.name == e.name:
                    return f"{text}.{safe(e.name)}", type_of(f.type, found.line)
            raise WgslError(e.line, f"{kind} has no field {e.name}")
        if width(kind) > 1 and len(e.name) <= 4 and set(e.name) <= set("xyzwrgba"):
            return f"{text}.{e.name}", vector(len(e.name), scalar_of(kind))
        raise WgslError(e.line, f"{kind} has no part {e.name}")

    def _binary(self, e: Binary) -> tuple[str, Type]:
        left, a = self.expression(e.left)
        right, b = self.expression(e.right)
        op = e.op
        if op in ("<<", ">>"):
            return f"({left} {op} {right})", a
        scalar = common((a, b))
        left, right = self._coerce(left, a, scalar, e.left), self._coerce(right, b, scalar, e.right)
        wide = max(width(a), width(b))
        if op in COMPARISONS:
            if wide > 1:
                return f"{COMPARISONS[op]}({left}, {right})", vector(wide, "bool")
            return f"({left} {op} {right})", "bool"
        if scalar == "bool":
            if wide > 1:
                raise WgslError(e.line, f"{op} on vectors of truth values is outside the subset")
            return f"({left} {({'&': '&&', '|': '||'}).get(op, op)} {right})", "bool"
        kind = product(a, b, e.line)
        if op == "%" and scalar != "u32":
            # The remainder has the sign of the left side, as in C; GLSL leaves that open, and has none for floats.
            whole = f"trunc({left} / {right})" if scalar in ("f32", "float") else f"({left} / {right})"
            return f"({left} - {right} * {whole})", kind
        return f"({left} {op} {right})", kind


def _plain(e: Literal) -> str:
    """A number as GLSL reads it: floats have a point or an exponent."""
    if e.type == "f32" and not any(mark in e.text for mark in ".eE"):
        return f"{e.text}.0"
    return e.text
