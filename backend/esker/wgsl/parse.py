"""Reads the WGSL subset of ``shaders/wgsl`` into a tree (WebGPU Shading Language, W3C, sections 3 to 11).

What the subset leaves out is refused with its line: pointers but for ``&`` in arrayLength and atomics, texture
parameters, templates of the user's own, ``continuing``, fall-through, 16-bit types.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Final

from esker.wgsl.tree import (
    Assign,
    Attribute,
    Binary,
    Block,
    Call,
    Case,
    Constant,
    Declaration,
    Declare,
    Evaluate,
    Expr,
    Field,
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
    TypeRef,
    Unary,
    Variable,
    WgslError,
)

_TOKEN: Final = re.compile(
    r"(?P<skip>\s+|//[^\n]*|/\*.*?\*/)"
    r"|(?P<number>0[xX][0-9a-fA-F]+[iu]?|(?:\d+\.\d*|\.\d+|\d+)(?:[eE][+-]?\d+)?[fiuh]?)"
    r"|(?P<word>[A-Za-z_]\w*)"
    r"|(?P<sign><<=|>>=|->|&&|\|\||==|!=|<=|>=|<<|>>|\+\+|--|\+=|-=|\*=|/=|%=|&=|\|=|\^=|[-+*/%&|^~!<>=.,;:(){}\[\]@])",
    re.DOTALL,
)
_PRECEDENCE: Final = {
    "||": 1, "&&": 2, "|": 3, "^": 4, "&": 5, "==": 6, "!=": 6, "<": 7, ">": 7, "<=": 7, ">=": 7,
    "<<": 8, ">>": 8, "+": 9, "-": 9, "*": 10, "/": 10, "%": 10,
}  # fmt: skip
_TEMPLATES: Final = re.compile(r"array|vec[234]|mat[234]x[234]|ptr|atomic|texture_\w+|bitcast")
_ASSIGN: Final = frozenset(("=", "+=", "-=", "*=", "/=", "%=", "&=", "|=", "^=", "<<=", ">>="))
_REFUSED: Final = frozenset(("enable", "requires", "diagnostic", "const_assert", "alias"))


@dataclass(frozen=True)
class _Token:
    kind: str
    text: str
    line: int


def tokens(source: str) -> list[_Token]:
    """Words, numbers and signs with their lines. Raises WgslError."""
    found: list[_Token] = []
    at, line = 0, 1
    while at < len(source):
        match = _TOKEN.match(source, at)
        if match is None:
            raise WgslError(line, f"{source[at]!r} is no part of WGSL")
        kind = match.lastgroup or ""
        if kind != "skip":
            found.append(_Token(kind, match.group(), line))
        line += match.group().count("\n")
        at = match.end()
    found.append(_Token("end", "the end of the file", line))
    return found


def parse(source: str) -> Module:
    """The tree of a module. Raises WgslError for what is outside the subset."""
    return _Parser(tokens(source)).module()


class _Parser:
    """Recursive descent; one method a rule of the grammar."""

    def __init__(self, found: list[_Token]) -> None:
        self._tokens = found
        self._at = 0

    # --- tokens

    @property
    def _next(self) -> _Token:
        return self._tokens[self._at]

    def _sees(self, *texts: str) -> bool:
        return self._next.kind in ("word", "sign") and self._next.text in texts

    def _take(self, *texts: str) -> bool:
        if not self._sees(*texts):
            return False
        self._at += 1
        return True

    def _expect(self, text: str) -> _Token:
        token = self._next
        if not self._take(text):
            raise WgslError(token.line, f"{text!r} was expected, not {token.text!r}")
        return token

    def _word(self) -> str:
        token = self._next
        if token.kind != "word":
            raise WgslError(token.line, f"a name was expected, not {token.text!r}")
        self._at += 1
        return token.text

    # --- the module

    def module(self) -> Module:
        found: dict[str, Declaration] = {}
        while self._next.kind != "end":
            if self._take(";"):
                continue
            declared = self._declaration()
            if declared.name in found:
                raise WgslError(declared.line, f"{declared.name} is declared twice")
            found[declared.name] = declared
        return Module(found)

    def _declaration(self) -> Declaration:
        attributes = self._attributes()
        token = self._next
        if token.text in _REFUSED:
            raise WgslError(token.line, f"{token.text!r} is outside the subset")
        if self._take("struct"):
            return self._struct(token.line)
        if self._take("fn"):
            return self._function(attributes, token.line)
        if self._take("var"):
            return self._variable(attributes, token.line)
        if self._sees("const", "override"):
            self._at += 1
            name = self._word()
            kind = self._type() if self._take(":") else None
            value = self._expression() if self._take("=") else None
            self._expect(";")
            return Constant(name, kind, value, token.text == "override", token.line)
        raise WgslError(token.line, f"a declaration was expected, not {token.text!r}")

    def _attributes(self) -> tuple[Attribute, ...]:
        found = []
        while self._take("@"):
            name = self._word()
            args: list[str] = []
            if self._take("("):
                while not self._take(")"):
                    args.append(self._next.text)
                    self._at += 1
                    self._take(",")
            found.append(Attribute(name, tuple(args)))
        return tuple(found)

    def _struct(self, line: int) -> Struct:
        name = self._word()
        self._expect("{")
        fields = []
        while not self._take("}"):
            fields.append(self._field())
            if not self._take(","):
                self._expect("}")
                break
        return Struct(name, tuple(fields), line)

    def _field(self) -> Field:
        attributes = self._attributes()
        name = self._word()
        self._expect(":")
        return Field(name, self._type(), attributes)

    def _variable(self, attributes: tuple[Attribute, ...], line: int) -> Variable:
        space, access = "", ""
        if self._take("<"):
            space = self._word()
            access = self._word() if self._take(",") else "read"
            self._expect(">")
        name = self._word()
        self._expect(":")
        kind = self._type()
        if self._sees("="):
            raise WgslError(line, f"the variable {name} of the module has an initial value: outside the subset")
        self._expect(";")
        return Variable(name, space, access, kind, attributes, line)

    def _function(self, attributes: tuple[Attribute, ...], line: int) -> Function:
        name = self._word()
        self._expect("(")
        parameters = []
        while not self._take(")"):
            parameters.append(self._field())
            if not self._take(","):
                self._expect(")")
                break
        result: TypeRef | None = None
        result_attributes: tuple[Attribute, ...] = ()
        if self._take("->"):
            result_attributes = self._attributes()
            result = self._type()
        return Function(name, tuple(parameters), result, result_attributes, attributes, self._block(), line)

    def _type(self) -> TypeRef:
        line = self._next.line
        name = self._word()
        if name in ("ptr", "f16"):
            raise WgslError(line, f"{name!r} is outside the subset")
        if name == "atomic":  # in GLSL any integer of a buffer is one
            self._expect("<")
            held = self._type()
            self._split()
            self._expect(">")
            return held
        return TypeRef(name, self._template() if self._sees("<") else ())

    def _template(self) -> tuple[TypeRef | Expr, ...]:
        self._expect("<")
        args: list[TypeRef | Expr] = []
        while not self._take(">"):
            if self._next.kind == "number":
                args.append(self._primary())
            else:
                args.append(self._type())
            self._split()
            self._take(",")
        return tuple(args)

    def _split(self) -> None:
        """Two lists of types may end in one token."""
        if self._sees(">>"):
            token = self._next
            self._tokens[self._at : self._at + 1] = [_Token("sign", ">", token.line)] * 2

    # --- statements

    def _block(self) -> Block:
        line = self._expect("{").line
        found = []
        while not self._take("}"):
            if not self._take(";"):
                found.append(self._statement())
        return Block(tuple(found), line)

    def _statement(self) -> Statement:
        token = self._next
        if token.text in ("continuing", "fallthrough"):
            raise WgslError(token.line, f"{token.text!r} is outside the subset")
        if self._sees("{"):
            return self._block()
        if self._take("if"):
            return self._if(token.line)
        if self._take("for"):
            return self._for(token.line)
        if self._take("while"):
            condition = self._expression()
            return For(None, condition, None, self._block(), token.line)
        if self._take("loop"):
            return For(None, None, None, self._block(), token.line)
        if self._take("switch"):
            return self._switch(token.line)
        found = self._simple()
        self._expect(";")
        return found

    def _simple(self) -> Statement:
        """A statement that ends with a semicolon (or stands in the head of a loop)."""
        token = self._next
        if self._take("return"):
            return Return(None if self._sees(";") else self._expression(), token.line)
        if self._take("break", "continue", "discard"):
            return Jump(token.text, token.line)
        if self._take("let", "var", "const"):
            name = self._word()
            kind = self._type() if self._take(":") else None
            value = self._expression() if self._take("=") else None
            return Declare(token.text, name, kind, value, token.line)
        if self._take("_"):
            self._expect("=")
            return Assign(None, "=", self._expression(), token.line)
        target = self._unary()
        if self._sees("++", "--"):
            op = self._next.text
            self._at += 1
            return Assign(target, f"{op[0]}=", Literal("1", "int", token.line), token.line)
        if self._next.text in _ASSIGN:
            op = self._next.text
            self._at += 1
            return Assign(target, op, self._expression(), token.line)
        if isinstance(target, Call):
            return Evaluate(target, token.line)
        raise WgslError(token.line, f"a statement was expected, not {token.text!r}")

    def _if(self, line: int) -> If:
        condition = self._expression()
        then = self._block()
        otherwise = None
        if self._take("else"):
            at = self._next.line
            otherwise = Block((self._if(at),), at) if self._take("if") else self._block()
        return If(condition, then, otherwise, line)

    def _for(self, line: int) -> For:
        self._expect("(")
        first = None if self._sees(";") else self._simple()
        self._expect(";")
        condition = None if self._sees(";") else self._expression()
        self._expect(";")
        step = None if self._sees(")") else self._simple()
        self._expect(")")
        return For(first, condition, step, self._block(), line)

    def _switch(self, line: int) -> Switch:
        value = self._expression()
        self._expect("{")
        cases = []
        while not self._take("}"):
            selectors: list[Expr] = []
            default = self._take("default")
            if not default:
                self._expect("case")
                while not self._sees(":", "{"):
                    if self._take("default"):
                        default = True
                    else:
                        selectors.append(self._expression())
                    self._take(",")
            self._take(":")
            cases.append(Case(tuple(selectors), default, self._block()))
        return Switch(value, tuple(cases), line)

    # --- expressions

    def _expression(self, least: int = 1) -> Expr:
        left = self._unary()
        while True:
            token = self._next
            rank = _PRECEDENCE.get(token.text, 0) if token.kind == "sign" else 0
            if rank < least:
                return left
            self._at += 1
            left = Binary(token.text, left, self._expression(rank + 1), token.line)

    def _unary(self) -> Expr:
        token = self._next
        if self._take("-", "!", "~", "&"):
            return Unary(token.text, self._unary(), token.line)
        if self._sees("*"):
            raise WgslError(token.line, "a pointer is followed: outside the subset")
        return self._postfix(self._primary())

    def _postfix(self, base: Expr) -> Expr:
        while True:
            line = self._next.line
            if self._take("."):
                base = Member(base, self._word(), line)
            elif self._take("["):
                index = self._expression()
                self._expect("]")
                base = Index(base, index, line)
            else:
                return base

    def _primary(self) -> Expr:
        token = self._next
        if self._take("("):
            inner = self._expression()
            self._expect(")")
            return inner
        if token.kind == "number":
            self._at += 1
            return _number(token)
        if self._take("true", "false"):
            return Literal(token.text, "bool", token.line)
        name = self._word()
        template = self._template() if self._sees("<") and _TEMPLATES.fullmatch(name) else ()
        if not self._take("("):
            if template:
                raise WgslError(token.line, f"a type, {name}, stands where a value should")
            return Name(name, token.line)
        args = []
        while not self._take(")"):
            args.append(self._expression())
            if not self._take(","):
                self._expect(")")
                break
        return Call(TypeRef(name, template), tuple(args), token.line)


def _number(token: _Token) -> Literal:
    text = token.text
    if text[:2].lower() == "0x":
        kind = {"u": "u32", "i": "i32"}.get(text[-1], "int")
        return Literal(text.rstrip("iu"), kind, token.line)
    if text[-1] == "h":
        raise WgslError(token.line, f"{text}: 16-bit numbers are outside the subset")
    kind = {"f": "f32", "i": "i32", "u": "u32"}.get(text[-1], "")
    text = text.rstrip("fiu")
    if not kind:
        kind = "float" if any(mark in text for mark in ".eE") else "int"
    return Literal(text, kind, token.line)
