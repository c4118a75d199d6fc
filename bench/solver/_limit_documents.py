"""Random documents at the limits of every field of the contract, made from the contract's own models.

A field that is added to the contract is drawn from here at once. Identifiers are made unique, and anchors are drawn
around the terrain's own size, because documents that ``check_document`` refuses never reach a solver.
"""

from __future__ import annotations

import math
import random
import types
import typing
from typing import Annotated, Any, Final, Literal, Union, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from esker import contract as c
from esker.document.ops import check_document
from esker.document.refusal import Refusal

LONGEST: Final = 4
"""Points of a curve that is drawn, at most: a longer one meets no other limit."""
TRIES: Final = 200
TINY: Final = (5e-324, 1e-300, 1e-45, 1e-38, 1e-12, 1e-6)
"""Numbers that are not zero, but whose square or inverse may be."""
WAYS: Final = ("low", "high", "near", "tiny", "typical")


def document(seed: int) -> c.Document:
    """One document that the server would take. The same seed gives the same document."""
    rng = random.Random(seed)
    for _ in range(TRIES):
        size = rng.choice((c.MIN_SIZE_M, c.MAX_SIZE_M, c.DEFAULT_SIZE_M, rng.uniform(c.MIN_SIZE_M, c.MAX_SIZE_M)))
        try:
            settings = c.TerrainSettings.model_validate(_fields(c.TerrainSettings, rng, {"size_m": size}))
            strokes = tuple(_stroke(k, size, rng) for k in range(rng.randint(1, 3)))
            made = c.Document(id="limits", settings=settings, strokes=strokes)
            check_document(made)
        except (Refusal, ValidationError):
            continue
        return made
    raise AssertionError(f"seed {seed} gives no document that is taken")


def _stroke(k: int, size: float, rng: random.Random) -> c.Stroke:
    kind = rng.choice(get_args(c.StrokeKind))
    paint = _fields(c.Paint, rng, {}) if kind == "paint" else None
    course = _fields(c.Course, rng, {"rises": _rises(size, rng)}) if kind == "course" else None
    own = {"id": f"s{k}", "kind": kind, "paint": paint, "course": course, "hidden": False}
    own |= {"first": _anchor(size, rng), "last": _anchor(size, rng), "curve": _curve(size, rng)}
    return c.Stroke.model_validate(_fields(c.Stroke, rng, own))


def _anchor(size: float, rng: random.Random) -> tuple[float, ...]:
    """On lattice lines, corners and the bound, or anywhere; heights at both ends of their range."""
    far = c.DOMAIN_MARGIN * size
    places = (0.0, size, size / 2, size / 64, -far, far, rng.uniform(0, size), rng.uniform(-far, far), 5e-324)
    heights = (0.0, far, -far, 1e-300, rng.uniform(-size, size))
    return rng.choice(places), rng.choice(places), rng.choice(heights)


def _curve(size: float, rng: random.Random) -> tuple[tuple[float, float], ...]:
    ends = (0.0, 1.0, 0.5, -1e-300, 1e-300, 1 + 2**-52, rng.random())
    heights = (*ends, size, -size, 1e7, -1e7, rng.uniform(-size, size))
    return tuple((rng.choice(ends), rng.choice(heights)) for _ in range(rng.randint(0, LONGEST)))


def _rises(size: float, rng: random.Random) -> tuple[float, ...]:
    """Rises of a course: falling, so that a river is taken, or anything."""
    ends = (0.0, size, -size, 1e-300, c.ABSOLUTE_BOUND_M, -c.ABSOLUTE_BOUND_M, rng.uniform(-size, size))
    rises = [rng.choice(ends) for _ in range(rng.randint(0, LONGEST))]
    return tuple(sorted(rises, reverse=True) if rng.random() < 0.5 else rises)


def _fields(model: type[BaseModel], rng: random.Random, own: dict[str, Any]) -> dict[str, Any]:
    """Values of all fields of a model; ``own`` are given."""
    return {
        name: own[name] if name in own else _value(field.annotation, field.metadata, field, rng)
        for name, field in model.model_fields.items()
    }


def _value(kind: Any, metadata: list[Any], field: FieldInfo | None, rng: random.Random) -> Any:
    if get_origin(kind) is Annotated:
        inner, *more = get_args(kind)
        return _value(inner, [*metadata, *more], field, rng)
    if get_origin(kind) in (Union, types.UnionType):
        return _value(rng.choice(get_args(kind)), metadata, field, rng)
    if get_origin(kind) is Literal:
        return rng.choice(get_args(kind))
    if get_origin(kind) is tuple:
        parts = get_args(kind)
        return () if parts[-1] is Ellipsis else tuple(_value(part, [], None, rng) for part in parts)
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        return _fields(kind, rng, {})
    if kind in (float, int):
        return _number(kind, metadata, field, rng)
    return {bool: rng.random() < 0.5, str: "x"}.get(typing.cast(Any, kind))


def _bounds(metadata: list[Any]) -> tuple[float, float]:
    low, high = -math.inf, math.inf
    for part in metadata:
        for one in (part, *getattr(part, "metadata", ())):
            low = max(low, *(v for v in (getattr(one, "ge", None), getattr(one, "gt", None), low) if v is not None))
            high = min(high, *(v for v in (getattr(one, "le", None), getattr(one, "lt", None), high) if v is not None))
    return low, high


def _number(kind: type, metadata: list[Any], field: FieldInfo | None, rng: random.Random) -> float:
    low, high = _bounds(metadata)
    way = rng.choice(WAYS)
    if kind is int:
        return int({"low": low, "high": high - 1, "near": low + 1, "tiny": low}.get(way, min(high - 1, max(low, 7))))
    typical = field.default if field is not None and isinstance(field.default, float) else (low + high) / 2
    tiny = min(max(rng.choice(TINY), low), high)
    values = {"low": low, "high": high, "near": math.nextafter(low, high), "tiny": tiny, "typical": typical}
    return float(values[way])
