"""Hostile frames that know the protocol: messages made from the contract's own models, then damaged (SPEC P403).

A field or an operation that is added to the contract is drawn at once. The same seed gives the same frames.
"""

from __future__ import annotations

import json
import random
import struct
import types
import typing
from collections.abc import Iterator
from typing import Annotated, Any, Final, Literal, Union, get_args, get_origin

from pydantic import BaseModel, StringConstraints

from bench.strangers._attacks import frame
from esker import contract as c

KINDS: Final = get_args(get_args(c.ClientMessage)[0])
"""Models of all messages of a client."""
NUMBERS: Final = (
    0, 1, -1, 0.5, -0.0, 5e-324, 1e-300, 1e7, -1e7, 1e308, 2**31, 2**53, 2**53 + 1, 2**63, -(2**63), 10**30,
)  # fmt: skip
RAW: Final = ("NaN", "Infinity", "-Infinity", "1e999", "1E-999", "--1", "0x10", "01", "tru", "nul", "'a'", "", "[", "{")
TEXTS: Final = (
    "", "x", "s0", "\u0000", "\u202e", "\U0001f600" * 30, "é" * 200, "a" * 5000, "__proto__", "../../etc", "%00",
)  # fmt: skip
IDS: Final = tuple(f"s{n}" for n in range(6))
MOST_ITEMS: Final = 5
FATAL: Final = 0.02
"""Share of frames that break the framing or the envelope. The server hangs up upon these."""


class Frames:
    """Frames of one connection after its hello, which says that it is ``client``."""

    def __init__(self, rng: random.Random, client: str) -> None:
        self._rng, self._client, self._count, self._last = rng, client, 0, b""

    def __iter__(self) -> Iterator[bytes]:
        return self

    def __next__(self) -> bytes:
        """The bytes of the next frame, masked as a client's are."""
        rng = self._rng
        if rng.random() < FATAL:
            return rng.choice((self._framing, self._envelope))()
        if self._last and rng.random() < 0.05:
            return self._last  # this is sent once more, under the same id
        self._last = frame(json.dumps(self._ops() if rng.random() < 0.7 else self._other()).encode())
        return self._last

    def _ops(self) -> dict[str, Any]:
        """A well-formed envelope around operations that are whole, damaged, or in the wrong order."""
        ops = []
        for _ in range(self._rng.choice((1, 1, 1, 2, 4))):
            self._count += 1
            op = self.message(self._rng.choice(get_args(get_args(c.Op)[0])))
            if self._rng.random() < 0.6:
                self._damage(op)
            ops.append({"id": f"{self._client}:{self._count}", "op": op})
        return {"type": "ops", "ops": ops}

    def _other(self) -> dict[str, Any]:
        return self.message(self._rng.choice([kind for kind in KINDS if kind not in (c.Hello, c.Ops, c.Seek)]))

    def message(self, model: type[BaseModel]) -> dict[str, Any]:
        """Values within what the model says, at its ends as often as between; some optional fields are left out."""
        made = {}
        for name, field in model.model_fields.items():
            if not field.is_required() and name != "type" and self._rng.random() < 0.3:
                continue
            value = self._value(field.annotation, field.metadata)
            made[name] = field.default if name == "type" else value
        return made

    def _value(self, kind: Any, metadata: list[Any]) -> Any:
        rng, origin = self._rng, get_origin(kind)
        if origin is Annotated:
            inner, *more = get_args(kind)
            return self._value(inner, [*metadata, *more])
        if origin in (Union, types.UnionType):
            return self._value(rng.choice(get_args(kind)), metadata)
        if origin is Literal:
            return rng.choice(get_args(kind))
        if origin is tuple:
            parts = get_args(kind)
            if parts[-1] is Ellipsis:
                return [self._value(parts[0], []) for _ in range(rng.randint(1, MOST_ITEMS))]
            return [self._value(part, []) for part in parts]
        if isinstance(kind, type) and issubclass(kind, BaseModel):
            return self.message(kind)
        if kind in (float, int):
            return self._number(kind, metadata)
        if kind is str:
            return self._text(metadata)
        return {bool: rng.random() < 0.5}.get(typing.cast(Any, kind))

    def _number(self, kind: type, metadata: list[Any]) -> float:
        parts = [one for part in metadata for one in (part, *getattr(part, "metadata", ()))]
        ends = [getattr(part, name) for part in parts for name in ("ge", "gt", "le", "lt") if hasattr(part, name)]
        low, high = (min(ends, default=-100), max(ends, default=100))
        between = (low + high) / 2, self._rng.uniform(low, min(high, 4096))
        value = self._rng.choice((low, high, low + 1, high - 1, *between))
        return int(value) if kind is int else float(value)

    def _text(self, metadata: list[Any]) -> str:
        patterns = [part.pattern for part in metadata if isinstance(part, StringConstraints) and part.pattern]
        if any("#" in str(pattern) for pattern in patterns):
            return "#12ab9f"
        if patterns:
            return "0" * 64 if "{64}" in str(patterns[0]) else self._rng.choice(IDS)
        return self._rng.choice(("", "name", "é" * 20))

    def _damage(self, op: dict[str, Any]) -> None:
        """One field, anywhere in it, becomes what it must not be; or goes; or another one comes."""
        rng: random.Random = self._rng
        place: Any = op
        while True:
            key = rng.choice(list(place)) if isinstance(place, dict) else rng.randrange(len(place))
            inner = place[key]
            if isinstance(inner, (dict, list)) and inner and rng.random() < 0.7:
                place = inner
                continue
            break
        match rng.randrange(4):
            case 0 if isinstance(place, dict):
                del place[key]
            case 1 if isinstance(place, dict):
                place[rng.choice(TEXTS)] = rng.choice(NUMBERS)
            case 2:
                nested = {"type": "group", "ops": [json.loads(json.dumps(op))]}
                place[key] = rng.choice((None, True, [], {}, [[]], [None] * 300, nested))
            case _:
                place[key] = rng.choice((*NUMBERS, *TEXTS))

    def _envelope(self) -> bytes:
        """A message that ends the connection: no JSON, of another kind, too early, too deep, too long, cut off."""
        rng = self._rng
        text = json.dumps(self._ops() if rng.random() < 0.5 else self._other())
        match rng.randrange(8):
            case 0:
                text = text[: rng.randrange(len(text))]
            case 1:
                text = text.replace(rng.choice("0123456789,:{"), rng.choice(RAW), 1)
            case 2:
                text = json.dumps(self.message(rng.choice((c.Hello, c.Seek))))
            case 3:
                text = rng.choice(("[", '{"a":', '{"type":"ops","ops":[')) * rng.choice((10, 1_000, 20_000))
            case 4:
                text = text.replace('"type"', rng.choice(('"typ"', '"type":1,"type"', '"\\u0074ype"')), 1)
            case 5:
                return frame(bytes(rng.randrange(256) for _ in range(rng.randrange(200))))
            case 6:
                broken: Any = json.loads(text)
                self._damage(broken)
                text = json.dumps(broken)
            case _:
                text += rng.choice((text, " " * 70_000, "\u0000"))
        return frame(text.encode())

    def _framing(self) -> bytes:
        """A frame that breaks RFC 6455, or uses a corner of it."""
        rng = self._rng
        match rng.randrange(9):
            case 0:
                return frame(b"x" * rng.choice((0, 1, 126, 65_536)), opcode=2)
            case 1:
                return frame(b"x", opcode=rng.choice((3, 4, 5, 6, 7, 11, 12, 13, 14, 15)))
            case 2:
                return frame(b"{", fin=False) + frame(b"", 0, fin=False) * rng.randrange(40) + frame(b"}", 0)
            case 3:
                return frame(b"x" * 126, opcode=rng.choice((8, 9, 10)))
            case 4:
                return frame(
                    struct.pack("!H", rng.choice((0, 999, 1000, 1004, 1005, 1006, 1015, 3000, 5000, 65535))), 8
                )
            case 5:
                head = bytearray(frame(b"{}"))
                head[0] |= rng.choice((0x40, 0x20, 0x10, 0x70))
                return bytes(head)
            case 6:
                return b"\x81\x02{}"  # this has no mask
            case 7:
                size = rng.choice((2**20, 2**40, 2**63 - 1, 2**63, 2**64 - 1))
                return struct.pack("!BBQ", 0x81, 0xFF, size) + bytes(9)
            case _:
                return frame(b"1", 9) * rng.randrange(50) + frame(b"{}", 0)


def before_hello(rng: random.Random) -> bytes:
    """What somebody sends who was not let in."""
    frames = Frames(rng, "nobody")
    hello = frames.message(c.Hello)
    frames._damage(hello)
    return rng.choice((frame(json.dumps(hello).encode()), next(frames), frames._envelope(), frames._framing()))
