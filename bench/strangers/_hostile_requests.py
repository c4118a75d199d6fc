"""Hostile requests that know the routes: bodies made from the models that the application takes, whole and damaged, and
texts for the socket of a wall (SPEC P543). A route or a field that is added is drawn at once.
"""

from __future__ import annotations

import json
import random
import re
from collections.abc import Iterator, Mapping
from typing import Any, Final, NamedTuple, get_args

from pydantic import BaseModel

from bench.strangers._hostile_frames import RAW, TEXTS, Frames
from esker import contract as c

WORDS: Final = ("s0", "x", "-", "%00", "..%2f..", "a" * 300, "%F0%9F%98%80")


class Route(NamedTuple):
    """A route that takes a body. ``model``: of the body, None where it takes a file."""

    method: str
    path: str
    model: type[BaseModel] | None


def routes_of(app: Any) -> list[Route]:
    """All routes of an application that change something."""
    return [
        Route(method, route.path, _model(getattr(route, "body_field", None)))
        for route in app.routes
        for method in sorted(getattr(route, "methods", None) or ())
        if method in ("POST", "PUT", "PATCH", "DELETE")
    ]


def _model(field: Any) -> type[BaseModel] | None:
    kind = None if field is None else field.field_info.annotation
    kinds = [kind, *get_args(kind)]
    return next((each for each in kinds if isinstance(each, type) and issubclass(each, BaseModel)), None)


class Requests:
    """Requests to these routes: method, path and body. The same seed gives the same ones."""

    def __init__(self, rng: random.Random, routes: list[Route], known: Mapping[str, str]) -> None:
        """``known``: what stands for the names in paths, where it is not made up."""
        self._rng, self._routes, self._known = rng, routes, known
        self._frames = Frames(rng, "me")

    def __iter__(self) -> Iterator[tuple[str, str, bytes]]:
        return self

    def __next__(self) -> tuple[str, str, bytes]:
        rng = self._rng
        route = rng.choice(self._routes)
        path = re.sub(r"{(\w+)(?::\w+)?}", lambda name: self._word(name.group(1)), route.path)
        if rng.random() < 0.1:
            path += rng.choice(("?at_once=true", "?at=-1", "?at=1e999", "?client=%00", "?name=" + "a" * 3000, "?&&=="))
        return route.method, path, self._body(route.model)

    def _word(self, name: str) -> str:
        known = self._known.get(name)
        return known if known is not None and self._rng.random() < 0.9 else self._rng.choice(WORDS)

    def _body(self, model: type[BaseModel] | None) -> bytes:
        rng = self._rng
        if model is None:
            return rng.choice((b"", b"x", bytes(rng.randrange(256) for _ in range(300)), b"{}"))
        made = self._frames.message(model)
        for name in made.keys() & self._known.keys():
            if rng.random() < 0.8:
                made[name] = self._known[name]
        if made and rng.random() < 0.5:
            self._frames._damage(made)
        text = json.dumps(made)
        if rng.random() < 0.1:
            text = rng.choice((text[: len(text) // 2], rng.choice(RAW), "[" * 2_000, json.dumps([made] * 50), text * 2))
        return text.encode("utf-8", "surrogatepass")


def wall_texts(rng: random.Random, hello: dict[str, Any]) -> list[str]:
    """What somebody says on the socket of a wall: a hello, whole or damaged, then more."""
    frames = Frames(rng, "me")
    first = dict(hello)
    if rng.random() < 0.5:
        frames._damage(first)
    texts = [json.dumps(first)]
    for _ in range(rng.randrange(4)):
        said = frames.message(rng.choice((c.WallFocus, c.WallHello)))
        if rng.random() < 0.5:
            frames._damage(said)
        texts.append(rng.choice((json.dumps(said), json.dumps(said), rng.choice(RAW), rng.choice(TEXTS), "[" * 5_000)))
    return texts
