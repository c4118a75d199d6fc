"""What a request is about, from its path alone. Pure."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Final

CHANGES_NOTHING: Final = frozenset({"GET", "HEAD", "OPTIONS"})
MOST_HELLO: Final = 16 * 1024
"""Bytes of a first message that is looked into for its terrain."""
_MOST_ID: Final = 64


@dataclass(frozen=True)
class About:
    """What a request is about: a terrain, a class, a picture's token, the seat of a device, or what a join code opens.

    changes: it may change something, so that only the owner does it.
    """

    terrain: str = ""
    lesson: str = ""
    picture: str = ""
    is_seat: bool = False
    is_code: bool = False
    changes: bool = False


def about(method: str, path: str) -> About | None:
    """Returns what a request is about; None for one that every node answers by itself.

    >>> about("GET", "/api/terrains/abc/links")
    About(terrain='abc', lesson='', picture='', is_seat=False, is_code=False, changes=False)
    >>> about("POST", "/api/join").is_code
    True
    >>> about("GET", "/assets/x.js"), about("POST", "/api/terrains"), about("POST", "/api/terrains/import")
    (None, None, None)
    """
    parts, changes = path.split("/"), method not in CHANGES_NOTHING
    match parts[1:]:
        case ["api", "terrains", terrain, *_] if _is_id(terrain) and terrain != "import":
            return About(terrain=terrain, changes=changes)
        case ["api", "classes", lesson, *_] if _is_id(lesson):
            return About(lesson=lesson, changes=changes)
        case ["api", "seat"]:
            return About(is_seat=True, changes=changes)
        case ["api", "server", "terrains", terrain, *_] if _is_id(terrain):
            return About(terrain=terrain, changes=changes)
        case ["preview", name] if name.endswith(".jpg") and _is_id(name.removesuffix(".jpg")):
            return About(picture=name.removesuffix(".jpg"))
        case ["api", "join"] if changes:
            return About(is_code=True, changes=True)
        case ["api", "room"] if changes:
            return About(is_code=True)
        case _:
            return None


def _is_id(text: str) -> bool:
    return 0 < len(text) <= _MOST_ID and text.isascii() and text.replace("-", "").replace("_", "").isalnum()


def terrain_of_hello(text: str) -> str:
    """Returns the terrain that the first message of a socket names; empty where it names none.

    >>> terrain_of_hello('{"type": "hello", "terrain": "abc"}')
    'abc'
    >>> terrain_of_hello("[")
    ''
    """
    try:
        said = json.loads(text)
    except (ValueError, RecursionError):
        return ""
    terrain = said.get("terrain") if isinstance(said, dict) else None
    return terrain if isinstance(terrain, str) and _is_id(terrain) else ""
