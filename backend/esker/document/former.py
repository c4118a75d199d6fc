"""Reads what an earlier Esker wrote: a number beyond a bound that was set since counts as that bound.

A journal is never refused for a limit that is younger than it. What comes over the wire is not read this way: there a
number out of bounds is refused.

Documents are read stroke by stroke: the parser keeps the interpreter while it reads a text, so a heavy document that is
read at once in a thread makes all others wait for seconds, the event loop among them. A stroke that somebody holds is
not parsed again: copies of a class, and what is read once more, share theirs.
"""

from __future__ import annotations

import hashlib
import json
import logging
import math
import re
from collections.abc import Callable, Iterator
from typing import Any, Final, TypeVar
from weakref import WeakValueDictionary

from pydantic import ValidationError

from esker import contract as c
from esker.contract import Op

log = logging.getLogger("esker.former")

T = TypeVar("T")

LISTS: Final[dict[str, Any]] = {
    "strokes": c.Stroke,
    "deleted": c.Stroke,
    "layers": c.Layer,
    "deleted_layers": c.Layer,
}
"""The lists of a document that can be long, with what is in them."""
_HELD: Final[WeakValueDictionary[tuple[str, bytes], Any]] = WeakValueDictionary()
"""Strokes and layers that somebody holds, by list and digest of what they were read from."""
SPACE: Final = " \t\n\r"
_TEXT: Final = r'"[^"\\]*+(?:\\.[^"\\]*+)*+"'
_FLAT: Final = rf'\{{[^{{}}"]*+(?:{_TEXT}[^{{}}"]*+)*+\}}'
_OBJECT: Final = re.compile(rf'\{{[^{{}}"]*+(?:(?:{_TEXT}|{_FLAT})[^{{}}"]*+)*+\}}', re.DOTALL)
"""Where an object ends, with objects in it that have none themselves, as a stroke's do. Whether all in it is JSON says
whoever reads it. Nothing is tried twice, so it takes as long as the object is, a fifth of what decoding it takes."""
BOUNDS: Final = {"greater_than_equal": "ge", "greater_than": "gt", "less_than_equal": "le", "less_than": "lt"}
"""Kinds of errors that a bound makes, and where they name it."""


def read_op(text: str) -> Op:
    """An op of a journal. Raises ValidationError for what was never valid."""
    op: Op = _mended(c.OP.validate_json, text)
    return op


def read_document(text: str | bytes) -> c.Document:
    """A document of a journal or of a file. Raises ValidationError for what was never valid."""
    lists: dict[str, list[Any]] = {}
    rest: list[str] = []
    try:
        whole = text if isinstance(text, str) else text.decode()
        for key, place, piece in _pieces(whole):
            if place is None:
                rest.append(f"{json.dumps(key)}:{piece}")
            elif place < 0:
                lists[key] = []
            else:
                lists[key].append(_item(key, place, piece))
    except ValidationError:
        raise
    except (ValueError, IndexError, RecursionError) as error:
        raise _invalid([{"type": "json_invalid", "loc": (), "input": "", "ctx": {"error": str(error)}}]) from None
    head = _mended(c.Document.model_validate_json, f"{{{','.join(rest)}}}")
    return head.model_copy(update={key: tuple(items) for key, items in lists.items()})


def _pieces(text: str) -> Iterator[tuple[str, int | None, str]]:
    """Yields the parts of a document: the text of each item of its long lists with the list's name and the item's
    number (-1, without a text, for the beginning of the list), and of everything else with its name and None."""
    scan = json.JSONDecoder().raw_decode
    at = _after(text, 0, "{")
    while text[at] != "}":
        key, at = scan(text, at)
        if not isinstance(key, str):
            raise ValueError("a key is no text")
        at = _after(text, at, ":")
        if key not in LISTS or text[at] != "[":
            _, end = scan(text, at)
            yield key, None, text[at:end]
        else:
            yield key, -1, ""
            number, end = 0, _after(text, at, "[")
            while text[end] != "]":
                at = end
                found = _OBJECT.match(text, at)
                end = found.end() if found else scan(text, at)[1]
                yield key, number, text[at:end]
                number += 1
                end = _between(text, end, "]")
            end += 1
        at = _between(text, end, "}")
    if text[at + 1 :].strip(SPACE):
        raise ValueError("something follows the document")


def _after(text: str, at: int, mark: str) -> int:
    """The place of what follows ``mark``, which comes next. Raises ValueError."""
    at = _skipped(text, at)
    if text[at] != mark:
        raise ValueError(f"{mark} is missing at character {at}")
    return _skipped(text, at + 1)


def _between(text: str, at: int, end: str) -> int:
    """The place of what follows a comma, or of ``end``. Raises ValueError."""
    at = _skipped(text, at)
    if text[at] == end:
        return at
    following = _after(text, at, ",")
    if text[following] == end:
        raise ValueError(f"nothing follows the comma at character {at}")
    return following


def _skipped(text: str, at: int) -> int:
    while text[at] in SPACE:
        at += 1
    return at


def _item(key: str, number: int, text: str) -> Any:
    """Returns a stroke or layer: the one that somebody holds, where the text is the same. Raises ValidationError that
    tells its place in the document."""
    known = key, hashlib.sha256(text.encode()).digest()
    if (held := _HELD.get(known)) is not None:
        return held
    try:
        return _HELD.setdefault(known, _mended(LISTS[key].model_validate_json, text))
    except ValidationError as error:
        found = error.errors(include_url=False)
        raise _invalid([{**one, "loc": (key, number, *one["loc"])} for one in found]) from None


def _invalid(found: list[Any]) -> ValidationError:
    kept = [{name: one[name] for name in ("type", "loc", "input", "ctx") if name in one} for one in found]
    return ValidationError.from_exception_data("Document", kept)  # type: ignore[arg-type]


def _mended(read: Callable[[str | bytes], T], text: str | bytes) -> T:
    try:
        return read(text)
    except ValidationError as error:
        wrong = [one for one in error.errors(include_url=False) if one["type"] in BOUNDS]
        if not wrong:
            raise
    raw = json.loads(text)
    for one in wrong:
        _clamp(raw, one["loc"], _bound(one["type"], one["ctx"]))
    return read(json.dumps(raw))


def _bound(kind: str, context: dict[str, Any]) -> float:
    """The number nearest to what was there that is allowed."""
    bound: float = context[BOUNDS[kind]]
    if kind not in ("greater_than", "less_than"):
        return bound
    up = kind == "greater_than"
    return bound + (1 if up else -1) if isinstance(bound, int) else math.nextafter(bound, math.inf if up else -math.inf)


def _clamp(raw: Any, place: tuple[int | str, ...], bound: float) -> None:
    """Puts a bound at a place of decoded JSON. Pydantic's places also name the kind of an op, which is no key."""
    holder, last, value = None, place[-1], raw
    for part in place:
        if isinstance(value, dict) and part not in value:
            continue
        holder, last, value = value, part, value[part]
    assert holder is not None
    log.warning("%s was %r; it counts as %r, the bound since then", ".".join(map(str, place)), value, bound)
    holder[last] = bound
