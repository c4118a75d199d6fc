"""Heightmaps that Esker wrote as PNG: their text says the range of heights and where they lay (``exports``).

The text is a stranger's like the rest of the file: where something in it cannot be so, all of it is passed over, and
the file is asked about like any other picture.
"""

from __future__ import annotations

import json
import math
import struct
from pathlib import Path
from typing import Any, Final

from pydantic import ValidationError

from esker import contract as c
from esker.importing.formats.gdal_source import GdalSource
from esker.importing.source import Own
from esker.importing.wire import OWN_FORMAT

KEYWORD: Final = b"Esker"
MAX_TEXT_BYTES: Final = 64 * 1024
MAX_CHUNKS: Final = 64
"""Chunks before the samples that are looked at."""
STEPS: Final = 65535
MAX_NUMBER: Final = 1e7
"""No metres in such a text are larger."""


def recognise(source: GdalSource, path: Path) -> None:
    """Takes heights and place from the text of a 16-bit picture of Esker's. Other pictures stay as they are."""
    if source.dtype != "uint16" or source.bands != 1:
        return
    facts = _text(path)
    if facts is None or facts.get("samples") != [source.cols, source.rows]:
        return
    low, high, spacing = (_number(facts.get(key)) for key in ("low_m", "high_m", "spacing_m"))
    corner = facts.get("south_west_m")
    if low is None or high is None or spacing is None or not isinstance(corner, list) or len(corner) != 2:
        return
    x, y = (_number(value) for value in corner)
    if x is None or y is None or high < low or not c.MIN_GRID_SPACING_M <= spacing <= c.MAX_GRID_SPACING_M:
        return
    side = _number(facts.get("terrain_m")) or spacing * (max(source.rows, source.cols) - 1)
    source.gain, source.bias, source.measured = (high - low) / STEPS, low, True
    source.own = Own((x, y), spacing, side, _place(facts.get("place")))
    source.format = OWN_FORMAT


def _number(value: Any) -> float | None:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    return float(value) if math.isfinite(value) and abs(value) <= MAX_NUMBER else None


def _place(value: Any) -> c.Place | None:
    try:
        return None if value is None else c.Place.model_validate(value)
    except ValidationError:
        return None


def _text(path: Path) -> dict[str, Any] | None:
    """The JSON of the chunk that Esker wrote, which stands before the samples."""
    with path.open("rb") as file:
        file.seek(8)
        for _ in range(MAX_CHUNKS):
            head = file.read(8)
            if len(head) < 8:
                return None
            length, kind = struct.unpack(">I4s", head)
            if kind in (b"IDAT", b"IEND"):
                return None
            if kind != b"iTXt" or length > MAX_TEXT_BYTES:
                file.seek(length + 4, 1)
                continue
            found = _itxt(file.read(length))
            file.seek(4, 1)
            if found is not None:
                return found
    return None


def _itxt(chunk: bytes) -> dict[str, Any] | None:
    """Keyword, two bytes of compression (none), language, translated keyword, text."""
    keyword, _, rest = chunk.partition(b"\0")
    if keyword != KEYWORD or rest[:2] != b"\0\0":
        return None
    text = rest[2:].partition(b"\0")[2].partition(b"\0")[2]
    try:
        found = json.loads(text)
    except (ValueError, RecursionError):
        return None
    return found if isinstance(found, dict) else None
